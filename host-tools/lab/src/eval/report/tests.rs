use super::*;
use crate::data::recordings::RecordingSet;
use crate::data::replay::measure_all;
use crate::eval::learn::learn;

/// The repository's recordings: names, and slides of each.
fn recorded() -> (Vec<String>, Vec<Vec<MeasuredSlide>>) {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../recordings/simulated");
    let set = RecordingSet::open(folder.as_ref()).unwrap();
    let names = set.textures().iter().map(|t| t.name.clone()).collect();
    (names, measure_all(&set, |_| ()).unwrap())
}

/// The table of these textures, learned from their first two slides of every movement, and the slides that are left of
/// all.
fn table_of(wanted: &[&str], twin: bool) -> (Vec<u8>, Vec<Slides>) {
    let (names, measured) = recorded();
    let mut movements = Vec::new();
    for slide in measured.iter().flatten() {
        if !movements.contains(&slide.movement) {
            movements.push(slide.movement);
        }
    }
    let of = |slides: &[MeasuredSlide], movement| -> Vec<MeasuredSlide> {
        slides
            .iter()
            .filter(|s| s.movement == movement)
            .cloned()
            .collect()
    };
    let mut learned = Vec::new();
    let mut left = Vec::new();
    for (name, slides) in names.iter().zip(&measured) {
        let by_movement = movements.iter().map(|&m| of(slides, m));
        let by_movement: Vec<Vec<MeasuredSlide>> = by_movement.collect();
        if wanted.contains(&name.as_str()) {
            let first = |slides: &Vec<MeasuredSlide>| {
                let first = slides.iter().take(2);
                first
                    .map(|s| Observation::from(&s.measurement))
                    .collect::<Vec<_>>()
            };
            learned.push(by_movement.iter().map(first).collect::<Vec<_>>());
        }
        left.push(Slides {
            name: name.clone(),
            slides: by_movement
                .into_iter()
                .flat_map(|slides| slides[2..].to_vec())
                .collect(),
        });
    }
    let mut names: Vec<String> = wanted.iter().map(|&name| name.to_owned()).collect();
    if twin {
        names.push("Twin".to_owned());
        learned.push(learned[0].clone());
    }
    let bytes = learn(explorer::Method::Fused, None, &names, &movements, &learned).unwrap();
    (bytes, left)
}

#[test]
fn the_same_texture_under_two_names_is_told_once() {
    let (bytes, _) = table_of(&["Burlap", "Corduroy", "Terry cloth"], true);
    let report = Report::new(Table::read(&bytes).unwrap(), None, 1, || ()).unwrap();
    assert_eq!(report.textures[0].nearest.as_ref().unwrap().texture, "Twin");
    assert_eq!(report.textures[0].nearest.as_ref().unwrap().slides, None);
    let told = report
        .advice
        .iter()
        .filter(|a| a.contains("cannot be told apart"));
    let told: Vec<_> = told
        .filter(|a| a.contains("Burlap") && a.contains("Twin"))
        .collect();
    assert_eq!(told.len(), 1, "{:?}", report.advice);
    // and that two slides are few, of each
    let few = "Learned from 2 slides of a movement: Burlap, Corduroy, Terry cloth, Twin.";
    assert!(
        report.advice.iter().any(|a| a.starts_with(few)),
        "{:?}",
        report.advice
    );
    assert!(report.recorded.is_none());
}

#[test]
fn recorded_slides_say_what_users_would_be_told() {
    let known = [
        "Computer paper",
        "Coarse suede",
        "Burlap",
        "Denim twill",
        "Corduroy",
    ];
    let (bytes, left) = table_of(&known, false);
    let table = Table::read(&bytes).unwrap();
    let report = Report::new(table, Some(&left), 1, || ()).unwrap();
    let recorded = report.recorded.as_ref().unwrap();
    assert_eq!(recorded.not_in_table, ["Terry cloth"]);
    assert_eq!(recorded.explorations as u64, 5 * RUNS);
    let sum = |v: &Verdicts| v.right + v.new + v.wrong + v.undecided;
    assert!((sum(&recorded.known) - 1.0).abs() < 1e-9);
    // a texture that the table does not have is never right
    assert_eq!(recorded.unknown.unwrap().right, 0.0);
    // as the textures' own figures add up
    let rights = report
        .textures
        .iter()
        .map(|t| t.recorded.unwrap().verdicts.right);
    assert!((rights.sum::<f64>() / 5.0 - recorded.known.right).abs() < 1e-9);
    // the slides of one texture in place of another's: no verdict would be right, and the report calls it changed
    let mut swapped = left.clone();
    swapped[0].slides.clone_from(&left[4].slides);
    let swapped = Report::new(table, Some(&swapped), 1, || ()).unwrap();
    let paper = swapped.textures[0].recorded.unwrap();
    assert_eq!(paper.verdicts.right, 0.0);
}

#[test]
fn slides_that_moved_and_slides_that_scatter_are_told_apart() {
    let (names, measured) = recorded();
    let movement = measured[0][0].movement;
    let of = |t: usize| -> Vec<Observation> {
        let same = measured[t].iter().filter(|s| s.movement == movement);
        same.map(|s| Observation::from(&s.measurement)).collect()
    };
    let learned: Vec<_> = (0..names.len()).map(|t| vec![of(t)]).collect();
    let bytes = learn(explorer::Method::Fused, None, &names, &[movement], &learned).unwrap();
    let table = Table::read(&bytes).unwrap();
    // the very slides that it was learned from have not moved; all together scatter as expected
    let scattered: Vec<(f64, f64)> = (0..6)
        .map(|t| scatter(table, t, &[of(t.into())]).unwrap())
        .collect();
    assert!(
        scattered.iter().all(|(_, moved)| *moved < 0.05),
        "{scattered:?}"
    );
    let mean: f64 = scattered
        .iter()
        .map(|(spread, _)| spread * spread)
        .sum::<f64>()
        / 6.0;
    assert!((0.5..1.5).contains(&mean), "{mean}");
    // another one's slides have moved
    let (_, moved) = scatter(table, 0, &[of(4)]).unwrap();
    assert!(moved > MOVED, "{moved}");
    // slides of two textures taken for one scatter
    let both = [of(0), of(4)].concat();
    assert!(scatter(table, 0, &[both]).unwrap().0 > WIDE);
    assert_eq!(scatter(table, 0, &[of(0)[..1].to_vec()]), None);
}
