//! The results on one screen: the first table of the report.

use super::model::{Report, Rows, cells};
use crate::published;
use crate::results::Study;
use tactus_lab::eval::evaluate::Method;

/// Adds the results that the page begins with.
pub(super) fn add(study: &Study, report: &mut Report) {
    let mut rows = Rows::new();
    if let Some(pilot) = &study.pilot {
        let same = pilot.most_useful.iter().filter(|m| m.movement == m.paper);
        let found = format!("{} of 3 as in the paper", same.count());
        rows.push(cells!["most useful movements (pilot study)", found, "3"]);
    }
    if let Some(pairs) = &study.pairs {
        let count = pairs.len().max(1) as f64;
        let mean = pairs.iter().map(|p| p.correct).sum::<f64>() / count;
        let paper = pairs.iter().map(|p| p.paper[1]).sum::<f64>() / count;
        let what = "pairs of similar textures, right answers, %";
        rows.push(cells![what, (mean, 1), (paper, 1)]);
    }
    if let Some(identification) = &study.identification {
        for (method, name, paper) in [
            (
                Method::Paper,
                "Bayesian exploration",
                Some(published::BAYESIAN),
            ),
            (Method::Random, "random selection", Some(published::RANDOM)),
            (
                Method::Cycle,
                "uninformed cycling",
                Some(published::CYCLING),
            ),
            (Method::Fused, "fused (not in the paper)", None),
        ] {
            let Some(column) = identification.column(method) else {
                continue;
            };
            let what = format!("identification among 117, {name}, right answers, %");
            let mut row = cells![what, (column.correct, 1)];
            row.push(paper.map_or_else(Default::default, |paper| (paper.correct, 1).into()));
            rows.push(row);
        }
    }
    if !rows.is_empty() {
        report.table("results", &["", "here", "paper"], rows);
    }
}
