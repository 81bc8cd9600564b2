//! Plot a posterior: explore recordings slide by slide, and draw the probabilities as an SVG file.
//!
//! `cargo run --release -p tactus-probe --example plot_posterior`

use std::fmt::Write as _;
use std::path::Path;

use tactus_core::explorer::{Config, Explorer, Method};
use tactus_core::features::{Observation, PropertySet};
use tactus_core::table::Table;
use tactus_lab::data::recordings::RecordingSet;
use tactus_lab::data::replay::measure_all;
use tactus_lab::eval::learn::learn;

/// The texture that is presented, and its slides that are not learned from: the last of each movement.
const UNKNOWN: usize = 3;
const LEARNED: usize = 2;

pub(crate) fn main() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../recordings/simulated");
    let set = RecordingSet::open(&folder).expect("a folder of recordings");
    let slides = measure_all(&set, |_| ()).expect("slides with features");
    let names: Vec<String> = set.textures().iter().map(|t| t.name.clone()).collect();
    let movements = set.movements();

    // the slides of a texture at a movement
    let trials = |texture: usize, movement| -> Vec<Observation> {
        let made = slides[texture]
            .iter()
            .filter(|slide| slide.movement == movement);
        made.map(|slide| Observation::from(&slide.measurement))
            .collect()
    };
    let first = |texture| {
        let at = movements.iter().map(|&movement| trials(texture, movement));
        at.map(|mut trials| {
            trials.truncate(LEARNED);
            trials
        })
        .collect()
    };
    let first: Vec<Vec<_>> = (0..names.len()).map(first).collect();
    let bytes = learn(Method::Paper, None, &names, &movements, &first).expect("a table");
    let table = Table::read(&bytes).expect("it was just written");

    let mut explorer =
        Explorer::<'_, 8>::new(table, PropertySet::ALL, Config::default()).expect("it can begin");
    let mut rows = vec![explorer.posterior().to_vec()];
    while explorer.verdict().is_none() {
        let action = explorer.choose(&explorer.expected_outcomes(), 0);
        let slide = &trials(UNKNOWN, movements[usize::from(action.movement)])[LEARNED];
        explorer
            .observe(action, slide)
            .expect("it has the property");
        rows.push(explorer.posterior().to_vec());
    }

    let mut svg = String::from("<svg xmlns='http://www.w3.org/2000/svg' height='120'>");
    for (column, row) in rows.iter().enumerate() {
        for (texture, probability) in row.iter().enumerate() {
            let (x, height) = (120 * column + 18 * texture, 100.0 * probability);
            let (y, name) = (110.0 - height, &names[texture]);
            let place = format!("x='{x}' y='{y:.1}' width='14' height='{height:.1}'");
            let _ = write!(svg, "<rect {place}><title>{name}</title></rect>");
        }
    }
    svg += "</svg>";
    let file = std::env::temp_dir().join("tactus-posterior.svg");
    std::fs::write(&file, svg).expect("a folder for temporary files");
    let verdict = explorer.best();
    println!(
        "{} after {} slides: {}",
        names[usize::from(verdict.texture)],
        explorer.slides(),
        file.display()
    );
}
