//! Explorations in the report: pairs (Table 4), identification (Table 5, fig. 10), and the same in several worlds.

use serde_json::json;

use super::model::{Cell, Report, Rows, cells};
use crate::chart::{Chart, DrawError, Figure, MARKS, Mark, Series};
use crate::identify::{
    Column, Evolution, Identification, METHODS, PairRow, ToldColumn, WorldRow, of_pair, short_name,
};
use crate::published;
use tactus_lab::eval::evaluate::Method;
use tactus_lab::sim::collection::Collection;

/// Adds Table 4, of so many simulations of each way of exploring.
pub(super) fn add_pairs(pairs: &[PairRow], simulations: u64, report: &mut Report) {
    let mean = |of: &dyn Fn(&PairRow) -> f64| mean(pairs, of);
    let mut rows = Rows::new();
    for p in pairs {
        let [a, b] = p
            .textures
            .each_ref()
            .map(|t| format!("{} (T{})", t.name, t.number));
        let [human, machine] = p.paper.map(|share| (share, 1));
        rows.push(cells![
            format!("{a} vs. {b}"),
            human,
            machine,
            (p.correct, 1),
            (p.median, 1),
            (p.mean, 2),
        ]);
    }
    rows.push(cells![
        "Mean",
        (mean(&|p| p.paper[0]), 1),
        (mean(&|p| p.paper[1]), 1),
        (mean(&|p| p.correct), 1),
        Cell::default(),
        (mean(&|p| p.mean), 2),
    ]);
    let header = [
        "pair",
        "people (paper), %",
        "Bayesian exploration (paper), %",
        "Bayesian exploration here, %",
        "median movements here",
        "mean movements here",
    ];
    report.table("table4-pairs", &header, rows);
    let words = json!({"simulations": of_pair(simulations)});
    report.words.insert("pairs", words);
}

fn mean<T>(rows: &[T], of: impl Fn(&T) -> f64) -> f64 {
    rows.iter().map(of).sum::<f64>() / rows.len().max(1) as f64
}

/// Full and short name of a way of exploring, and its column of the paper's Table 5.
fn names(method: Method) -> (&'static str, &'static str, Option<published::Column>) {
    let (in_full, paper) = match method {
        Method::Cycle => ("uninformed cycling", Some(published::CYCLING)),
        Method::Random => ("random selection", Some(published::RANDOM)),
        Method::Paper => ("Bayesian exploration", Some(published::BAYESIAN)),
        _ => ("fused (not in the paper)", None),
    };
    (in_full, short_name(method), paper)
}

/// Adds Table 5 and fig. 10.
pub(super) fn add(identification: &Identification, report: &mut Report) -> Result<(), DrawError> {
    // a way of exploring beside the paper's: two columns, or one
    let mut header = vec!["%".to_owned()];
    for method in METHODS {
        let (name, _, paper) = names(method);
        header.extend(paper.map(|_| format!("{name}, paper")));
        header.push(format!("{name}, here"));
    }
    type Paper<'a> = &'a dyn Fn(&published::Column) -> Cell;
    let row = |what: String, paper: Paper<'_>, ours: &dyn Fn(&Column) -> (f64, usize)| {
        let mut row = cells![what];
        for (method, column) in METHODS.into_iter().zip(&identification.columns) {
            row.extend(names(method).2.map(|column| paper(&column)));
            row.push(ours(column).into());
        }
        row
    };
    let none: Paper<'_> = &|_| Cell::default();
    let median = "median number of movements (11: more than half did not converge)";
    let mut rows = vec![
        row(
            "correct identifications".to_owned(),
            &|p| (p.correct, 1).into(),
            &|c| (c.correct, 1),
        ),
        row(
            "and converged".to_owned(),
            &|p| (p.converged, 1).into(),
            &|c| (c.converged, 1),
        ),
        row("wrong among the converged".to_owned(), none, &|c| {
            (c.wrong_when_sure, 1)
        }),
        row(median.to_owned(), &|p| p.median.into(), &|c| (c.median, 1)),
        row("mean number of movements".to_owned(), none, &|c| {
            (c.mean, 2)
        }),
    ];
    for (at, texture) in identification.textures.iter().enumerate() {
        let name = format!("{} (T{})", texture.name, texture.number);
        let ours = |c: &Column| (c.textures.get(at).copied().unwrap_or(0.0), 1);
        rows.push(row(name, &|p| (p.textures[at], 1).into(), &ours));
    }
    let header: Vec<&str> = header.iter().map(String::as_str).collect();
    report.table("table5-identification", &header, rows);
    add_told(identification, report);
    let fig10 = (1_u8..).zip(&identification.evolutions);
    let fig10 = fig10.map(|(n, evolution)| fig10_panel(n, evolution));
    report
        .figures
        .insert("fig10", fig10.collect::<Result<_, _>>()?);

    let cycled = identification
        .cycled
        .iter()
        .map(|&(movement, property)| format!("{property} at {}", Collection::MOVEMENTS[movement]));
    let against = [Method::Paper, Method::Random, Method::Cycle].map(|method| {
        let ours = identification.column(method)?.correct;
        Some(format!("{:+.1}", ours - names(method).2?.correct))
    });
    let words = json!({
        "simulations": identification.simulations,
        "cycled": cycled.collect::<Vec<_>>(),
        "against": against.into_iter().collect::<Option<Vec<_>>>(),
    });
    report.words.insert("identification", words);
    Ok(())
}

/// Adds the verdicts.
fn add_told(identification: &Identification, report: &mut Report) {
    let row = |(method, told): (Method, &ToldColumn)| {
        let v = &told.verdicts;
        let percent = |share: f64| Cell::from((100.0 * share, 1));
        let mut row = cells![names(method).0];
        row.extend([v.right, v.changed, v.new, v.wrong, v.undecided].map(percent));
        row.extend(cells![(told.mean, 2)]);
        row
    };
    let rows = METHODS.into_iter().zip(&identification.told).map(row);
    let header = [
        "way of exploring",
        "right, %",
        "right name, but changed, %",
        "none of those known, %",
        "wrong, %",
        "undecided, %",
        "mean number of movements",
    ];
    report.table("verdicts", &header, rows.collect());
}

/// The course of the probabilities in one exploration.
fn fig10_panel(n: u8, evolution: &Evolution) -> Result<Figure, DrawError> {
    let steps = evolution.steps.len() as f64;
    let step = |x: f64| {
        let at = (x.round() as usize).wrapping_sub(1);
        evolution
            .steps
            .get(at)
            .map_or_else(String::new, |(movement, property)| {
                format!("M{} {}", movement + 1, property.name()[..1].to_uppercase())
            })
    };
    // the unknown one first: it keeps its colour in all panels
    let all = &evolution.probabilities;
    let (unknown, others): (Vec<_>, Vec<_>) = all
        .iter()
        .partition(|(texture, _)| *texture == evolution.unknown);
    let mut series = Vec::new();
    for (n, (texture, probabilities)) in unknown.into_iter().chain(others).enumerate() {
        let points = (0..)
            .map(f64::from)
            .zip(probabilities.iter().map(|&p| p.into()));
        let name = format!("T{}", texture.number);
        series.push(Series::curve(
            n,
            MARKS[n % MARKS.len()],
            name,
            points.collect(),
        ));
    }
    series.push(Series::dashed("", vec![(0.0, 0.99), (steps, 0.99)]));
    let title = format!("{}: {}", evolution.unknown, evolution.example);
    let told = format!("The answer was {}", evolution.identified);
    let (x, y) = ("movement and property", "probability");
    Chart {
        about: told,
        y_range: (0.0, 1.04),
        x_marks: evolution.steps.len() + 1,
        x_text: &step,
        named_at_end: true,
        ..Chart::new(title, x, y, (-0.2, steps + 0.2), series)
    }
    .figure(format!("fig10-{n}"))
}

/// Adds the results in each world, and the demands.
pub(super) fn add_worlds(worlds: &[WorldRow], report: &mut Report) -> Result<(), DrawError> {
    let mut rows = Rows::new();
    for world in worlds {
        let mut row = cells![world.seed.to_string()];
        for c in &world.columns {
            row.extend(cells![(c.correct, 1), (c.converged, 1), (c.median, 1)]);
        }
        row.extend(cells![(world.pairs, 1)]);
        rows.push(row);
    }
    let mut last = cells!["mean"];
    let mut header = vec!["world".to_owned()];
    for (n, method) in METHODS.into_iter().enumerate() {
        let mean = |of: fn(&Column) -> f64| mean(worlds, |w| of(&w.columns[n]));
        last.extend(cells![
            (mean(|c| c.correct), 2),
            (mean(|c| c.converged), 2),
            (mean(|c| c.median), 1),
        ]);
        let columns = ["correct, %", "and converged, %", "median movements"];
        header.extend(columns.map(|column| format!("{}: {column}", names(method).0)));
    }
    last.extend(cells![(mean(worlds, |w| w.pairs), 2)]);
    rows.push(last);
    header.push("pairs, %".to_owned());
    let header: Vec<&str> = header.iter().map(String::as_str).collect();
    report.table("worlds", &header, rows);
    report.table("demands", &["what", "asked", "found", ""], demands(worlds));

    let marks = [Mark::Square, Mark::Triangle, Mark::Circle, Mark::Cross];
    let mut series = Vec::new();
    for (n, method) in METHODS.into_iter().enumerate() {
        let points = (1..)
            .map(f64::from)
            .zip(worlds.iter().map(|w| w.columns[n].correct));
        series.push(Series::curve(
            [3, 2, 0, 1][n],
            marks[n],
            names(method).1,
            points.collect(),
        ));
    }
    let seed = |x: f64| {
        let world = worlds.get((x.round() as usize).wrapping_sub(1));
        world.map_or_else(String::new, |w| w.seed.to_string())
    };
    let title = "Right answers by world";
    let (x, y) = ("world (seed)", "correct identifications (%)");
    let figure = Chart {
        x_marks: worlds.len().min(20),
        x_text: &seed,
        named_at_end: true,
        ..Chart::new(title, x, y, (0.7, worlds.len() as f64 + 0.3), series)
    }
    .figure("worlds")?;
    report.figures.insert("worlds", vec![figure]);
    report
        .words
        .insert("worlds", json!({"count": worlds.len()}));
    Ok(())
}

/// The demands on the study over ten worlds, and whether they are met.
fn demands(worlds: &[WorldRow]) -> Rows {
    let n = worlds.len();
    let column = |world: &WorldRow, method: Method, of: fn(&Column) -> f64| {
        let at = METHODS.iter().position(|m| *m == method);
        at.and_then(|at| world.columns.get(at)).map_or(0.0, of)
    };
    let largest_median = |method| {
        let medians = worlds.iter().map(|w| column(w, method, |c| c.median));
        medians.fold(0.0, f64::max)
    };
    let most = (9 * n).div_ceil(10);
    let mut rows = Rows::new();
    let mut demand = |what: &str, wanted: &str, found: String, met: bool| {
        let met = if met { "met" } else { "missed" };
        rows.push(cells![what, wanted, found, met]);
    };
    let correct: fn(&Column) -> f64 = |c| c.correct;
    let converged: fn(&Column) -> f64 = |c| c.converged;
    let bayesian = mean(worlds, |w| column(w, Method::Paper, correct));
    demand(
        "Bayesian exploration, correct",
        "within 2 points of 95.4 %",
        format!("{bayesian:.2} %"),
        (bayesian - published::BAYESIAN.correct).abs() <= 2.0,
    );
    for (what, of) in [("correct", correct), ("correct and converged", converged)] {
        for pair in [
            [Method::Cycle, Method::Random],
            [Method::Random, Method::Paper],
        ] {
            let [a, b] = pair.map(|method| mean(worlds, |w| column(w, method, of)));
            let grows = |w: &&WorldRow| column(w, pair[0], of) < column(w, pair[1], of);
            let count = worlds.iter().filter(grows).count();
            let [less, more] = pair.map(|method| names(method).1);
            demand(
                &format!("{what}: {less} below {more}"),
                &format!("on average, and in {most} of {n} worlds"),
                format!("{a:.1} % and {b:.1} %; in {count} of {n}"),
                a < b && count >= most,
            );
        }
    }
    let median = largest_median(Method::Paper);
    let found = format!("at most {median}");
    demand(
        "Bayesian exploration, median movements",
        "at most 6",
        found,
        median <= 6.0,
    );
    let pairs = mean(worlds, |w| w.pairs);
    demand(
        "pairs, mean",
        "at least 97 %",
        format!("{pairs:.2} %"),
        pairs >= 97.0,
    );
    let fused = mean(worlds, |w| column(w, Method::Fused, correct));
    let median = largest_median(Method::Fused);
    demand(
        "fused",
        "at least 99 %, median at most 2",
        format!("{fused:.2} %, median at most {median}"),
        fused >= 99.0 && median <= 2.0,
    );
    rows
}
