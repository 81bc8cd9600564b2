//! The report of a study: one HTML page that needs nothing else, study.json with all numbers, and the learned tables.
//!
//! The words of the page are in its template, `report/page.html`.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, anyhow, ensure};
use serde::Serialize;
use serde_json::{Map, Value, json};
use tactus_core::explorer::Config;
use tactus_core::features::Property;
use tactus_core::rig::most_mn;
use tactus_lab::data::whole::{Lock, NewOutputs, write_whole};
use tactus_lab::eval::evaluate::Method;

use crate::chart::grid::{AVOIDED, Grid, Tile};
use crate::chart::matrix::{SHADES, matrix};
use crate::chart::{COLOURS, Figure};
use crate::identify::{
    Column, Identification, MAX_SLIDES, METHODS, PairRow, of_pair, pairs_mean, short_name,
};
use crate::page::render;
use crate::pilot::{MostUseful, Pilot, PilotMovement};
use crate::published::{self, PILOT_TRIALS, TRIALS};
use crate::slides::VISIBLE_WEAR;
use crate::training::Training;

/// All results of a study: study.json.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Study {
    /// Of this program.
    pub version: &'static str,
    /// The command that makes it again.
    pub command: String,
    /// The world.
    pub seed: u64,
    /// Variation of its trials.
    pub variation: f64,
    /// Virtual explorations of each way of exploring; each pair has an eighth.
    pub simulations: u64,
    /// The pilot study.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pilot: Option<Pilot>,
    /// The training.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub training: Option<Training>,
    /// The eight pairs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pairs: Option<Vec<PairRow>>,
    /// The identification among all textures.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub identification: Option<Identification>,
}

/// The lock in a folder whose study is not whole.
const LOCK: &str = "INCOMPLETE.lock";

/// The folder of one study, which goes if that fails.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    // it goes before what is made, which may be the folder
    _lock: Lock,
    made: NewOutputs,
}

/// Makes the folder of a report, or takes an empty one, or one that a study was killed in; it is this study's until it
/// is dropped. Called before the work, which takes minutes.
pub fn prepare(folder: &Path) -> Result<Folder> {
    let shown = folder.display();
    let unwritable =
        || format!("{shown} cannot be written; give --out a folder that can be written");
    let mut made = NewOutputs::default();
    made.folder(folder).with_context(unwritable)?;
    let lock = folder.join(LOCK);
    let is_taken = fs::read_dir(folder)
        .with_context(unwritable)?
        .next()
        .is_some();
    ensure!(
        !is_taken || lock.is_file(),
        "{shown}: is not empty; give --out a new folder, so that no study is mixed with another"
    );
    let lock = Lock::take(&lock).map_err(|why| match why.kind() {
        io::ErrorKind::ResourceBusy => {
            anyhow!("{shown}: another study is written there now; give --out a new folder")
        }
        _ => anyhow!(why).context(unwritable()),
    })?;
    let path = folder.to_owned();
    Ok(Folder {
        path,
        _lock: lock,
        made,
    })
}

/// Writes everything of a study into its folder, the page last; or nothing, where that fails.
pub fn write(study: &Study, folder: &mut Folder) -> Result<()> {
    let (json, page) = (
        json(study)?,
        render(include_str!("report/page.html"), &contents(study)?)?,
    );
    let tables = study.training.iter().flat_map(|t| &t.tables);
    let tables = tables.map(|table| (table.file.as_str(), table.data.as_slice()));
    let rest = [
        ("study.json", json.as_bytes()),
        ("report.html", page.as_bytes()),
    ];
    for (name, bytes) in tables.chain(rest) {
        let path = folder.path.join(name);
        folder.made.file(path.clone());
        write_whole(&path, bytes).with_context(|| {
            let path = path.display();
            format!("{path} cannot be written; give --out a folder that can be written")
        })?;
    }
    folder.made.keep();
    Ok(())
}

/// study.json.
pub fn json(study: &Study) -> Result<String> {
    Ok(serde_json::to_string(study)? + "\n")
}

/// The contents of a report: the page's template gives the place of each piece and the text about it.
#[derive(Default, Serialize)]
struct Contents {
    tables: Map<String, Value>,
    figures: Map<String, Value>,
    /// values in the text, by section
    #[serde(flatten)]
    words: Map<String, Value>,
}

impl Contents {
    /// Adds a table of rows that are as long as its header.
    fn table(&mut self, id: &str, header: &[String], rows: Vec<Vec<String>>) {
        let cell = |text: String| {
            let number = text.parse::<f64>().is_ok();
            json!({"shown": text, "number": number})
        };
        let rows = rows
            .into_iter()
            .map(|row| row.into_iter().map(cell).collect());
        let rows: Vec<Vec<Value>> = rows.collect();
        let table = json!({"header": header, "rows": rows});
        self.tables.insert(id.to_owned(), table);
    }

    fn figure(&mut self, id: &str, panels: Vec<Figure>) {
        self.figures.insert(id.to_owned(), json!(panels));
    }

    fn words(&mut self, section: &str, words: Value) {
        self.words.insert(section.to_owned(), words);
    }
}

fn contents(study: &Study) -> Result<Contents> {
    let mut all = Contents::default();
    let about = json!({
        "version": study.version,
        "command": study.command,
        "seed": study.seed,
        "variation": study.variation.to_string(),
    });
    all.words("about", about);
    if let Some(found) = &study.pilot {
        pilot(found, &mut all)?;
    }
    if let Some(found) = &study.training {
        training(found, &mut all)?;
    }
    if let Some(found) = &study.pairs {
        pairs(found, &mut all);
        let words = json!({
            "simulations": of_pair(study.simulations),
            "threshold": in_percent(Config::PAIR_THRESHOLD),
            "right": format!("{:.1}", pairs_mean(found)),
            "paper": format!("{:.1}", mean(found, |p| p.paper[1])),
        });
        all.words("pairs", words);
    }
    if let Some(found) = &study.identification {
        identification(found, &mut all);
        let ways = METHODS.into_iter().zip(&found.columns);
        let best = ways.max_by(|a, b| a.1.correct.total_cmp(&b.1.correct));
        let words = json!({
            "simulations": study.simulations,
            "best": best.map(|(method, _)| short_name(method)),
            "right": best.map(|(_, column)| format!("{:.1}", column.correct)),
            "textures": found.textures.len(),
            "trials": TRIALS,
            "threshold": in_percent(Config::default().threshold),
            "most": MAX_SLIDES,
            "starred": published::CYCLING.median,
        });
        all.words("identification", words);
    }
    Ok(all)
}

/// A share in %, without the digits of its binary form.
fn in_percent(share: f32) -> String {
    ((f64::from(share) * 1e4).round() / 1e2).to_string()
}

fn words<const N: usize>(all: [&str; N]) -> [String; N] {
    all.map(str::to_owned)
}

fn movement_name((force_n, speed_mm_s): (f32, f32)) -> String {
    format!("{force_n:.2} N, {speed_mm_s:.1} mm/s")
}

/// The most useful movements, and fig. 7.
fn pilot(pilot: &Pilot, all: &mut Contents) -> Result<()> {
    let useful = |m: &MostUseful| {
        let left = |at: usize| pilot.movements[at].uncertainty[m.property.index()];
        let name = |at: usize| movement_name(pilot.movements[at].at());
        let mut row = vec![m.property.to_string()];
        row.extend(
            [m.movement, m.paper]
                .map(|at| [name(at), format!("{:.3}", left(at))])
                .concat(),
        );
        row
    };
    let header = words([
        "property",
        "here",
        "uncertainty here",
        "paper",
        "uncertainty here at the paper's",
    ]);
    let rows = pilot.most_useful.iter().map(useful).collect();
    all.table("most-useful-movements", &header, rows);
    let fig7 = pilot.most_useful.iter().map(|useful| fig7(pilot, useful));
    all.figure("fig7", fig7.collect::<Result<_, _>>()?);
    let missed = pilot.movements.iter().flat_map(|movement| {
        let at = movement_name(movement.at());
        let of = movement.not_reached.iter();
        of.map(move |m| {
            format!(
                "{at} not reached: T{}, trial {}: {}",
                m.texture, m.trial, m.reason
            )
        })
    });
    let same = pilot.most_useful.iter().filter(|m| m.movement == m.paper);
    let words = json!({
        "textures": pilot.textures.len(),
        "movements": pilot.movements.len(),
        "trials": PILOT_TRIALS,
        "most_n": pilot.movements.iter().map(|m| m.force_n).fold(0.0, f32::max).to_string(),
        "usual_n": (f32::from(most_mn(false)) / 1e3).to_string(),
        "useful": pilot.most_useful.len(),
        "same": same.count(),
        "missed": missed.collect::<Vec<_>>(),
    });
    all.words("pilot", words);
    Ok(())
}

/// Uncertainty by force and speed: the least is framed, movements that wear the skin are grey.
fn fig7(pilot: &Pilot, useful: &MostUseful) -> Result<Figure> {
    let property = useful.property;
    let left = |m: &PilotMovement| f64::from(m.uncertainty[property.index()]);
    let reached = |m: &&PilotMovement| m.not_reached.is_empty();
    let all = pilot.movements.iter().filter(reached).map(left);
    let (low, high) = all.fold((1.0, 0.0), |(l, h): (f64, f64), u| (l.min(u), h.max(u)));
    let tile = |(at, m): (usize, &PilotMovement)| {
        let paper = if at == useful.paper { "*" } else { "" };
        let shade = (high - left(m)) / (high - low).max(1e-9);
        let (text, shade) = match (reached(&m), m.high_wear) {
            (true, false) => (format!("{:.2}{paper}", left(m)), shade),
            (true, true) => (format!("{:.2}{paper}", left(m)), 1.0),
            (false, _) => (format!("none{paper}"), f64::from(u8::from(m.high_wear))),
        };
        Tile {
            text,
            shade,
            colour: if m.high_wear { AVOIDED } else { COLOURS[0] },
            framed: at == useful.movement && reached(&m),
            says: String::new(),
        }
    };
    let mut tiles = pilot.movements.iter().enumerate().map(tile);
    // forces upwards
    let rows = pilot.movements.len().div_ceil(6);
    let mut rows: Vec<Vec<Tile>> = (0..rows)
        .map(|_| tiles.by_ref().take(6).collect())
        .collect();
    rows.reverse();
    let speeds = pilot.movements.iter().take(6);
    let speeds = speeds.map(|m| format!("{:.1}", m.speed_mm_s)).collect();
    let forces = pilot.movements.iter().rev().step_by(6);
    let forces = forces.map(|m| format!("{:.2}", m.force_n)).collect();
    Grid {
        id: format!("fig7-{property}"),
        title: format!("Uncertainty by {property}"),
        about: "",
        x: ("sliding speed (mm/s)", speeds),
        y: ("contact force (N)", forces),
        tiles: rows,
        below: "",
    }
    .figure()
}

/// Table 3, and the geometric means of fig. 9.
fn training(training: &Training, all: &mut Contents) -> Result<()> {
    let mut rows = Vec::new();
    for (c, &movement) in training.correlations.iter().zip(&training.movements) {
        for ((a, b), paper) in [(0, 1), (0, 2), (1, 2)].into_iter().zip(c.paper) {
            let ours = c.ours[a][b];
            rows.push(vec![
                movement_name(movement),
                format!("{}, {}", Property::ALL[a], Property::ALL[b]),
                format!("{ours:.3}"),
                format!("{paper:.3}"),
                format!("{:.3}", ours - paper),
            ]);
        }
    }
    let header = words(["movement", "properties", "here", "paper", "difference"]);
    all.table("table3-correlations", &header, rows);
    let fig9 = [
        (
            "all",
            "geometric mean of all nine",
            &training.geometric_mean,
        ),
        (
            "most-useful",
            "geometric mean of the three most useful",
            &training.geometric_mean_most_useful,
        ),
    ];
    let fig9 = fig9.map(|(id, title, degrees)| {
        let axis = "number of the texture (Table 1)";
        matrix(format!("fig9-{id}"), title, title, axis, degrees)
    });
    all.figure("fig9", fig9.into_iter().collect::<Result<_, _>>()?);
    let changed = training.textures.iter().filter(|t| t.new_skin);
    let changed = changed.map(|t| format!("T{}", t.texture.number));
    let names = training.textures.iter().map(|t| t.texture.name);
    let files = training
        .tables
        .iter()
        .map(|t| format!("{} (CRC-32 {})", t.file, t.crc));
    let words = json!({
        "names": names.collect::<Vec<_>>(),
        "movements": training.movements.len(),
        "trials": TRIALS,
        "matrices": training.confusion.len(),
        "pairs": training.textures.len() * training.textures.len().saturating_sub(1) / 2,
        "slides": training.textures.len() * training.movements.len() * TRIALS as usize,
        "white": SHADES[0].to_string(),
        "black": SHADES[4].to_string(),
        "pairs_confused": training.pairs_confused,
        "changed": changed.collect::<Vec<_>>(),
        "changed_at": format!("{:.0}", 100.0 * VISIBLE_WEAR),
        "tables": files.collect::<Vec<_>>(),
    });
    all.words("training", words);
    Ok(())
}

/// Table 4.
fn pairs(pairs: &[PairRow], all: &mut Contents) {
    let mean = |of: &dyn Fn(&PairRow) -> f64| mean(pairs, of);
    let row = |p: &PairRow| {
        let [a, b] = p
            .textures
            .each_ref()
            .map(|t| format!("{} (T{})", t.name, t.number));
        vec![
            format!("{a} vs. {b}"),
            format!("{:.1}", p.paper[0]),
            format!("{:.1}", p.paper[1]),
            format!("{:.1}", p.correct),
            format!("{:.1}", p.median),
            format!("{:.2}", p.mean),
        ]
    };
    let mut rows: Vec<_> = pairs.iter().map(row).collect();
    rows.push(vec![
        "Mean".to_owned(),
        format!("{:.1}", mean(&|p| p.paper[0])),
        format!("{:.1}", mean(&|p| p.paper[1])),
        format!("{:.1}", pairs_mean(pairs)),
        String::new(),
        format!("{:.2}", mean(&|p| p.mean)),
    ]);
    let header = words([
        "pair",
        "people (paper), %",
        "Bayesian exploration (paper), %",
        "Bayesian exploration here, %",
        "median movements here",
        "mean movements here",
    ]);
    all.table("table4-pairs", &header, rows);
}

fn mean<T>(rows: &[T], of: impl Fn(&T) -> f64) -> f64 {
    rows.iter().map(of).sum::<f64>() / rows.len().max(1) as f64
}

/// A way of exploring in the paper's Table 5.
fn published(method: Method) -> Option<published::Column> {
    match method {
        Method::Cycle => Some(published::CYCLING),
        Method::Random => Some(published::RANDOM),
        Method::Paper => Some(published::BAYESIAN),
        _ => None,
    }
}

/// Table 5: a way of exploring beside the paper's, two columns or one.
fn identification(identification: &Identification, all: &mut Contents) {
    let mut header = words(["%"]).to_vec();
    for method in METHODS {
        let name = short_name(method);
        header.extend(published(method).map(|_| format!("{name}, paper")));
        header.push(format!("{name}, here"));
    }
    type Paper<'a> = &'a dyn Fn(&published::Column) -> String;
    let row = |what: String, paper: Paper<'_>, ours: &dyn Fn(&Column) -> String| {
        let mut row = vec![what];
        for (method, column) in METHODS.into_iter().zip(&identification.columns) {
            row.extend(published(method).map(|column| paper(&column)));
            row.push(ours(column));
        }
        row
    };
    let none: Paper<'_> = &|_| String::new();
    let [correct, converged, wrong, mean] = words([
        "correct identifications",
        "and converged",
        "wrong among the converged",
        "mean number of movements",
    ]);
    let beyond = MAX_SLIDES + 1;
    let median = format!("median number of movements ({beyond}: more than half did not converge)");
    let tenth = |share: f64| format!("{share:.1}");
    let mut rows = vec![
        row(correct, &|p| tenth(p.correct), &|c| tenth(c.correct)),
        row(converged, &|p| tenth(p.converged), &|c| tenth(c.converged)),
        row(wrong, none, &|c| tenth(c.wrong_when_sure)),
        row(median, &|p| p.median.to_owned(), &|c| tenth(c.median)),
        row(mean, none, &|c| format!("{:.2}", c.mean)),
    ];
    for (at, texture) in identification.textures.iter().enumerate() {
        let name = format!("{} (T{})", texture.name, texture.number);
        let ours = |c: &Column| tenth(c.textures.get(at).copied().unwrap_or(0.0));
        rows.push(row(name, &|p| tenth(p.textures[at]), &ours));
    }
    all.table("table5-identification", &header, rows);
}
