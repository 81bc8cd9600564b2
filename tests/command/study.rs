//! The paper's study: its slides, its arithmetic against f64, and the report that people read.

use std::collections::{BTreeMap, HashSet};
use std::fs;
use std::sync::OnceLock;

use rand::{Rng, RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use tactus_core::features::{Movement, Observation, Properties};
use tactus_core::rig::Fault;
use tactus_core::table::Table;
use tactus_lab::eval::evaluate::Method;
use tactus_study::identify::{Identification, experiment, pairs};
use tactus_study::pilot::Pilot;
use tactus_study::published::{IDENTIFIED, PILOT_TEXTURES};
use tactus_study::report::{self, Study};
use tactus_study::slides::{
    NotReached, Recorded, Session, StudyWorld, TextureTrials, VARIATION, VISIBLE_WEAR,
};
use tactus_study::training::Training;

const MOVEMENTS: [Movement; 3] = [
    Movement::FOR_TRACTION,
    Movement::FOR_FINENESS,
    Movement::FOR_ROUGHNESS,
];

fn normal(random: &mut impl Rng) -> f64 {
    (0..12).map(|_| random.random_range(0.0..1.0)).sum::<f64>() - 6.0
}

/// Trials that no rig made: textures with means and deviations of their own, drawn by the seed.
fn invented(textures: &[u8], movements: usize, trials: usize, seed: u64) -> Vec<TextureTrials> {
    let of = |&texture: &u8| {
        // what a texture is like does not depend on the seed
        let mut like = ChaCha8Rng::seed_from_u64(texture.into());
        let mut random = ChaCha8Rng::seed_from_u64(1000 * seed + u64::from(texture));
        let slides = (0..movements).map(|_| {
            let mean: [f64; 15] = std::array::from_fn(|_| 2.0 + 0.6 * normal(&mut like));
            let slide = |_| {
                let observed = mean.map(|mean| mean + 0.1 * normal(&mut random));
                let [traction, roughness, fineness, bands @ ..] = observed;
                Observation {
                    properties: Properties::new(
                        [traction, roughness, fineness].map(|p| Some(p as f32)),
                    ),
                    bands: bands.iter().map(|b| (1024.0 * b) as i16).collect(),
                    pressure: None,
                    pace: None,
                }
            };
            (0..trials).map(slide).collect()
        });
        TextureTrials {
            texture,
            slides: slides.collect(),
            wear: (0..=movements).map(|m| 0.001 * m as f64).collect(),
            new_skin: texture == 60,
            not_reached: Vec::new(),
        }
    };
    textures.iter().map(of).collect()
}

fn recorded() -> Recorded {
    Recorded {
        training: invented(&(1..=117).collect::<Vec<_>>(), 3, 5, 1),
        validation: invented(&IDENTIFIED, 3, 5, 2),
    }
}

fn world() -> StudyWorld {
    StudyWorld {
        seed: 5,
        variation: VARIATION,
    }
}

/// A whole study, of invented trials.
fn study(simulations: u64) -> Study {
    let recorded = recorded();
    let grid: Vec<Movement> = Movement::grid().collect();
    let experiment = experiment(&recorded, 5).unwrap();
    Study {
        version: "0.0.0-test",
        command: "tactus study all --seed 5 --out <here> & now".to_owned(),
        seed: 5,
        variation: VARIATION,
        simulations,
        pilot: Some(Pilot::of(&grid, &invented(&PILOT_TEXTURES, 36, 6, 3)).unwrap()),
        training: Some(Training::of(&recorded.training).unwrap()),
        pairs: Some(pairs(&experiment, 20, || ()).unwrap()),
        identification: Some(Identification::run(&experiment, simulations, || ()).unwrap()),
    }
}

/// The same study for all tests that only look at it.
fn shared() -> &'static Study {
    static STUDY: OnceLock<Study> = OnceLock::new();
    STUDY.get_or_init(|| study(160))
}

fn on_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
    pool.build().unwrap().install(work)
}

/// All files of a study, by their names.
fn files(study: &Study) -> BTreeMap<String, Vec<u8>> {
    let folder = tempfile::tempdir().unwrap();
    report::write(study, &mut report::prepare(folder.path()).unwrap()).unwrap();
    let all = fs::read_dir(folder.path()).unwrap().map(|entry| {
        let entry = entry.unwrap();
        (
            entry.file_name().into_string().unwrap(),
            fs::read(entry.path()).unwrap(),
        )
    });
    all.collect()
}

#[test]
fn a_study_is_the_same_on_any_number_of_threads() {
    let [one, two] = [1, 2].map(|threads| on_threads(threads, || files(&study(160))));
    assert!(one.len() > 2 && one.keys().eq(two.keys()));
    for (name, bytes) in one {
        assert!(two[&name] == bytes, "{name} differs");
    }
    // and another seed is another study
    let other = Identification::run(&experiment(&recorded(), 6).unwrap(), 160, || ()).unwrap();
    assert_ne!(Some(&other), shared().identification.as_ref());
    // its slides, too, and they differ between sessions
    let calibration = world().calibration().unwrap();
    let textures = [100, 46];
    let record = |number| {
        let session = session(&textures, number);
        world().record(&session, calibration, || ()).unwrap()
    };
    let one = on_threads(1, || record(1));
    assert_eq!(one, on_threads(2, || record(1)));
    assert!(
        one.iter()
            .zip(&record(2))
            .all(|(a, b)| a.slides != b.slides)
    );
}

fn session<'a>(textures: &'a [u8], number: u64) -> Session<'a> {
    Session {
        textures,
        movements: &MOVEMENTS,
        trials: 2,
        number,
        pilot: false,
    }
}

#[test]
fn the_wear_that_is_planned_is_the_wear_that_comes() {
    let calibration = world().calibration().unwrap();
    // sticky ones, slippery ones, soft ones
    let textures = [46, 43, 30, 100, 84];
    let trials = world()
        .record(&session(&textures, 1), calibration, || ())
        .unwrap();
    let mut worn = 0.0;
    for (before, after) in trials.iter().zip(&trials[1..]) {
        let (came, planned) = (
            before.wear.last().unwrap() - before.wear[0],
            after.wear[0] - before.wear[0],
        );
        assert!(before.wear.is_sorted() && came > 0.0);
        assert!(
            (planned / came - 1.0).abs() < 0.12,
            "T{}: {came:.5} came, {planned:.5} was planned",
            before.texture
        );
        worn += planned;
    }
    assert!(worn < VISIBLE_WEAR && trials.iter().all(|t| !t.new_skin));

    // so often over the same one that the skin has to be changed
    let many = vec![46; 60];
    let skins = world().skins(&session(&many, 1));
    let changed: Vec<usize> = (0..many.len()).filter(|&n| skins[n].2).collect();
    assert!(!changed.is_empty());
    for (n, (_, wear, new)) in skins.iter().enumerate() {
        assert_eq!(*new, n > 0 && *wear == 0.0);
        assert!(*wear < VISIBLE_WEAR);
    }
}

fn mean(of: &[f64]) -> f64 {
    of.iter().sum::<f64>() / of.len() as f64
}

fn deviation(of: &[f64]) -> f64 {
    let squares: f64 = of.iter().map(|x| (x - mean(of)).powi(2)).sum();
    (squares / (of.len() - 1) as f64).sqrt()
}

fn values(trials: &[[f32; 3]], property: usize) -> Vec<f64> {
    trials.iter().map(|p| p[property].into()).collect()
}

/// Eq. 7 in f64.
fn confusion(a: (f64, f64), b: (f64, f64)) -> f64 {
    let variances = a.1 * a.1 + b.1 * b.1;
    (2.0 * a.1 * b.1 / variances).sqrt() * (-(a.0 - b.0).powi(2) / (4.0 * variances)).exp()
}

/// Checks that a movement that is not reached is shown as that, and nothing else changes.
#[test]
fn a_movement_that_is_not_reached_is_a_result() {
    let grid: Vec<Movement> = Movement::grid().collect();
    let mut trials = invented(&PILOT_TEXTURES, 36, 6, 3);
    let all = Pilot::of(&grid, &trials).unwrap();
    let foam = trials.iter_mut().find(|t| t.texture == 30).unwrap();
    foam.slides[30].truncate(2);
    foam.not_reached.push(NotReached {
        movement: 30,
        trial: 3,
        why: Fault::LeverSlips.into(),
    });
    let pilot = Pilot::of(&grid, &trials).unwrap();
    for (movement, (without, with)) in pilot.movements.iter().zip(&all.movements).enumerate() {
        if movement == 30 {
            assert_eq!(without.uncertainty, [1.0; 3]);
            assert_eq!(without.not_reached.len(), 1);
        } else {
            assert_eq!(without, with);
        }
    }
    let study = Study {
        pilot: Some(pilot),
        training: None,
        pairs: None,
        identification: None,
        ..shared().clone()
    };
    let page = String::from_utf8(files(&study)["report.html"].clone()).unwrap();
    assert!(page.contains("not reached: T30, trial 3: lever slips"));
    let json: serde_json::Value = serde_json::from_str(&report::json(&study).unwrap()).unwrap();
    let missed = &json["pilot"]["movements"][30]["not_reached"][0];
    assert_eq!(
        (&missed["texture"], &missed["trial"]),
        (&30.into(), &3.into())
    );
}

#[test]
fn uncertainty_of_the_pilot_is_eq_11_in_f64() {
    let pilot = shared().pilot.as_ref().unwrap();
    for (m, movement) in pilot.movements.iter().enumerate() {
        for property in 0..3 {
            let normals: Vec<(f64, f64)> = pilot
                .properties
                .iter()
                .map(|texture| values(&texture[m], property))
                .map(|values| (mean(&values), deviation(&values)))
                .collect();
            let p = 1.0 / normals.len() as f64;
            let left: f64 = normals
                .iter()
                .map(|a| p * p / normals.iter().map(|b| confusion(*a, *b) * p).sum::<f64>())
                .sum();
            let found = f64::from(movement.uncertainty[property]);
            // the table rounds means and deviations
            assert!(
                (found - (1.0 - left)).abs() < 2e-3,
                "{m} {property}: {found} {left}"
            );
        }
    }
    for useful in &pilot.most_useful {
        let property = useful.property.index();
        let best = pilot.movements.iter().filter(|m| !m.high_wear);
        let best = best.map(|m| m.uncertainty[property]).fold(1.0, f32::min);
        assert_eq!(pilot.movements[useful.movement].uncertainty[property], best);
        assert!(!pilot.movements[useful.movement].high_wear);
    }
    assert_eq!(pilot.movements.iter().filter(|m| m.high_wear).count(), 21);
}

#[test]
fn confusion_and_its_geometric_mean_are_those_of_f64() {
    let training = shared().training.as_ref().unwrap();
    assert_eq!(training.confusion.len(), 9);
    let gaussian = |texture: usize, c: &tactus_study::training::Confusion| {
        let trials = &training.textures[texture].properties[c.movement];
        let values = values(trials, c.property.index());
        (mean(&values), deviation(&values))
    };
    for (a, b) in [(0, 0), (0, 2), (49, 53), (116, 3), (56, 57)] {
        let (mut nine, mut three) = (0.0, 0.0);
        for c in &training.confusion {
            let degree = confusion(gaussian(a, c), gaussian(b, c));
            let found = f64::from(c.matrix[a][b]);
            assert!((found - degree).abs() < 5e-3, "{a} {b}: {found} {degree}");
            assert_eq!(c.matrix[a][b], c.matrix[b][a]);
            nine += found.ln() / 9.0;
            let useful = [(0, "traction"), (1, "fineness"), (2, "roughness")];
            if useful.contains(&(c.movement, c.property.name())) {
                three += found.ln() / 3.0;
            }
        }
        let [all, useful] = [
            &training.geometric_mean,
            &training.geometric_mean_most_useful,
        ]
        .map(|m| f64::from(m[a][b]));
        assert!((all - nine.exp()).abs() < 1e-6 && (useful - three.exp()).abs() < 1e-6);
    }
    let over = (0..117).flat_map(|i| (0..i).map(move |j| (i, j)));
    let over = over.filter(|&(i, j)| training.geometric_mean[i][j] > 0.5);
    assert_eq!(over.count(), training.pairs_confused.0);
}

#[test]
fn correlations_are_those_of_f64() {
    let training = shared().training.as_ref().unwrap();
    for (m, correlations) in training.correlations.iter().enumerate() {
        let means = |property| -> Vec<f64> {
            let of = training.textures.iter();
            of.map(|t| mean(&values(&t.properties[m], property)))
                .collect()
        };
        for (a, b) in [(0, 0), (0, 1), (0, 2), (2, 1)] {
            let (x, y) = (means(a), means(b));
            // by the products of standard scores
            let (sx, sy) = (deviation(&x), deviation(&y));
            let scores = x
                .iter()
                .zip(&y)
                .map(|(p, q)| (p - mean(&x)) / sx * ((q - mean(&y)) / sy));
            let expected = scores.sum::<f64>() / 116.0;
            let found = correlations.ours[a][b];
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
    }
}

#[test]
fn the_tables_are_the_chips() {
    let training = shared().training.as_ref().unwrap();
    for file in &training.tables {
        let table = Table::read(&file.data).unwrap();
        assert_eq!((table.textures(), table.movements().len()), (117, 3));
        assert_eq!(format!("{:08x}", table.crc()), file.crc);
        assert_eq!(table.name(99), Some("Burlap"));
    }
}

#[test]
fn columns_add_up() {
    let identification = shared().identification.as_ref().unwrap();
    for column in &identification.columns {
        // each of the 16 is unknown as often
        assert!((mean(&column.textures) - column.correct).abs() < 1e-9);
        assert!(column.converged <= column.correct);
        assert!(column.mean <= 10.0 && column.median <= 11.0);
    }
    let fused = identification.column(Method::Fused).unwrap();
    assert!(fused.correct > 99.0, "{fused:?}");
}

#[test]
fn the_page_is_whole() {
    let files = files(shared());
    let page = str::from_utf8(&files["report.html"]).unwrap();
    let options = roxmltree::ParsingOptions {
        allow_dtd: true,
        nodes_limit: u32::MAX,
        ..Default::default()
    };
    let document = roxmltree::Document::parse_with_options(page, options).unwrap();
    let elements = || document.descendants().filter(|n| n.is_element());
    let named = |name: &'static str| elements().filter(move |n| n.tag_name().name() == name);
    let ids: Vec<&str> = elements().filter_map(|n| n.attribute("id")).collect();
    let different: HashSet<&&str> = ids.iter().collect();
    assert_eq!(ids.len(), different.len(), "an id comes twice");
    // nothing is fetched, nothing runs, and links lead somewhere
    for name in ["script", "img", "iframe", "object"] {
        assert_eq!(named(name).count(), 0, "{name}");
    }
    assert!(!page.contains("@import") && !page.contains("url(") && !page.contains("NaN"));
    for to in elements().filter_map(|n| n.attribute("href")) {
        let is_there = match to.strip_prefix('#') {
            Some(id) => ids.contains(&id),
            None => to == "data:," || files.contains_key(to),
        };
        assert!(is_there, "{to} leads nowhere");
    }
    let panels = elements().filter(|n| n.attribute("class") == Some("panel"));
    assert_eq!(panels.count(), 5);
    // rows as long as the header
    assert_eq!(named("table").count(), 4);
    for table in named("table") {
        let of = |name: &'static str| {
            table
                .descendants()
                .filter(move |n| n.tag_name().name() == name)
        };
        let header = of("th").count();
        let rows = of("tr").map(|row| row.children().filter(|n| n.is_element()).count());
        assert!(rows.clone().all(|length| length == header), "{header}");
    }
    let words: String = document
        .descendants()
        .filter(|n| n.is_text())
        .filter_map(|n| n.text())
        .collect();
    let command = "tactus study all --seed 5 --out <here> & now";
    crate::assert_says(&words, &["0.0.0-test", command, "world 5", "95.4"]);
}

/// The words of results on the page: the template's own have no figures but those of tables, pictures and equations,
/// and what it takes from the study is what the tables beside it show.
#[test]
fn no_sentence_of_the_report_can_be_stale() {
    let template = include_str!("../../host-tools/study/src/report/page.html");
    let results = template.split("<section id=\"pilot\">").nth(1).unwrap();
    let results = results.split("<section id=\"about\">").next().unwrap();
    let own = words_of_its_own(results);
    let counts = [
        "three", "four", "five", "six", "seven", "eight", "nine", "ten", "sixteen",
    ];
    for pair in own.windows(2) {
        let is_reference =
            ["Table", "Fig.", "fig.", "eq."].contains(&pair[0].trim_start_matches('('));
        let has_figure = pair[1].contains(|c: char| c.is_ascii_digit());
        assert!(
            is_reference || !has_figure,
            "{pair:?}: let the study say it"
        );
        assert!(
            !counts.contains(&&pair[1].to_lowercase()[..]),
            "{pair:?}: let the study say it"
        );
    }

    let files = files(shared());
    let page = str::from_utf8(&files["report.html"]).unwrap();
    let page = page.replacen("<!DOCTYPE html>", "", 1);
    let page = roxmltree::Document::parse(page.trim()).unwrap();
    let text = |node: roxmltree::Node<'_, '_>| -> String {
        let texts = node
            .descendants()
            .filter(|n| n.is_text())
            .filter_map(|n| n.text());
        texts
            .collect::<String>()
            .split_whitespace()
            .collect::<Vec<_>>()
            .join(" ")
    };
    let rows = |id: &str| -> Vec<Vec<String>> {
        let table = page
            .descendants()
            .find(|n| n.attribute("id") == Some(id))
            .unwrap();
        let rows = table.descendants().filter(|n| n.tag_name().name() == "tr");
        let cells = |row: roxmltree::Node<'_, '_>| {
            row.children()
                .filter(|n| n.is_element())
                .map(text)
                .collect()
        };
        rows.map(cells).collect()
    };
    let words = text(page.root());
    let study = shared();
    let useful = &rows("table-most-useful-movements")[1..];
    let same = useful.iter().filter(|row| row[1] == row[3]).count();
    let said = format!(
        "Most useful movements that are the paper's: {same} of {}.",
        useful.len()
    );
    crate::assert_says(
        &words,
        &[&said, "10 textures (Table 2), 36 movements, 6 slides each."],
    );
    crate::assert_says(&words, &["up to 2 N. A probe presses with 1.262 N at most"]);
    let training = study.training.as_ref().unwrap();
    let movements = (rows("table-table3-correlations").len() - 1) / 3;
    let changed = training.textures.iter().filter(|t| t.new_skin).count();
    let (nine, few) = training.pairs_confused;
    crate::assert_says(
        &words,
        &[
            &format!(
                "117 textures, {movements} movements, 5 slides each: {} slides",
                117 * 5 * movements
            ),
            &format!("The skin was changed {changed} time (before T60)"),
            &format!(
                "mean of all {}: {nine} of the {} pairs;",
                3 * movements,
                117 * 116 / 2
            ),
            &format!("by that of the most useful: {few}."),
        ],
    );
    let pairs = rows("table-table4-pairs");
    let mean = pairs.last().unwrap();
    let said = format!(
        "right in {} % here, and in {} % in the paper. 20 simulations",
        mean[3], mean[2]
    );
    crate::assert_says(&words, &[&said, "more probable than 99.9 %"]);
    let ways = rows("table-table5-identification");
    let best = ways[0].iter().zip(&ways[1]).filter_map(|(name, right)| {
        Some((name.strip_suffix(", here")?, right.parse::<f64>().unwrap()))
    });
    let best = best.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
    let said = format!(
        "Most often right here is {}, in {:.1} %. 160 simulations",
        best.0, best.1
    );
    let textures = format!("one of {} textures is unknown", ways.len() - 6);
    crate::assert_says(
        &words,
        &[&said, &textures, "ends at 99 %, or after 10 movements"],
    );
}

/// The words that a template has of its own: without tags and statements, of expressions the texts only.
fn words_of_its_own(template: &str) -> Vec<String> {
    let mut own = String::new();
    for part in template.split("{{") {
        let (expression, rest) = part.split_once("}}").unwrap_or(("", part));
        let texts = expression.split('"').skip(1).step_by(2);
        texts
            .filter(|text| text.contains(' '))
            .for_each(|text| own += text);
        own += " X ";
        for part in rest.split("{%") {
            let plain = part.split_once("%}").map_or(part, |(_, plain)| plain);
            for part in plain.split('<') {
                own += part.split_once('>').map_or(part, |(_, plain)| plain);
                own += " ";
            }
        }
    }
    own.split_whitespace().map(str::to_owned).collect()
}
