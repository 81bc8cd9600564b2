//! A table from the first slides of a folder of recordings: the work of `tactus learn`.

use tactus_core::features::{FeatureSet, Movement, Observation};

use crate::data::recordings::RecordingSet;
use crate::data::replay::MeasuredSlide;
pub use crate::eval::enough::Enough;
use crate::eval::enough::LEAST;
use crate::eval::evaluate::Method;
use crate::eval::learn::{Expected, TableError, learn_for, name_finger};
use crate::eval::learned::note_learned;
use crate::eval::open_set::TaughtSlide;
use crate::eval::samples::{note, of_all};
use crate::eval::show::count;

/// So few slides of one texture and movement.
pub fn few(texture: &str, movement: Movement, there: usize) -> TableError {
    let there = count(there as u64, "slide");
    TableError::Said(format!(
        "{texture}, {movement}: {there}; the spread of a texture's slides takes at least two"
    ))
}

/// Checks that there are enough slides to learn from.
pub fn at_least_two(slides: usize) -> Result<(), TableError> {
    if slides < 2 {
        return Err(TableError::Said(format!(
            "--train-slides {slides}: the spread of a texture's slides takes at least two slides"
        )));
    }
    Ok(())
}

/// The textures that [`learn_first`] learns, and from which movements.
/// Errors: none has two slides.
pub fn learned_textures(
    set: &RecordingSet,
    measured: &[Vec<MeasuredSlide>],
) -> Result<Enough, TableError> {
    let (names, movements) = (set.names(), set.movements());
    let has = |texture: usize, movement| {
        let slides = measured.get(texture).into_iter().flatten();
        slides.filter(|s| s.movement == movement).count()
    };
    Enough::of(&names, &movements, LEAST, has).ok_or_else(|| {
        let most = |&m: &Movement| (0..names.len()).map(|t| has(t, m)).max().unwrap_or(0);
        let (name, movement) = (names.first(), movements.first());
        let none = (String::new(), Movement::UNKNOWN);
        let (name, movement) = (name.unwrap_or(&none.0), movement.unwrap_or(&none.1));
        few(name, *movement, most(movement))
    })
}

/// All slides of what [`learn_first`] learns, and whether it learns from them.
/// Errors: as of [`learned_textures`].
pub fn taught(
    set: &RecordingSet,
    measured: &[Vec<MeasuredSlide>],
    slides: usize,
) -> Result<Vec<Vec<Vec<TaughtSlide>>>, TableError> {
    let Enough {
        textures,
        movements,
        ..
    } = learned_textures(set, measured)?;
    let of = |texture: usize, movement: Movement| {
        let same = measured[texture].iter().filter(|s| s.movement == movement);
        let slide = |(n, s): (usize, &MeasuredSlide)| TaughtSlide {
            slide: s.observation(),
            part: s.session.clone(),
            learned: n < slides,
        };
        same.enumerate().map(slide).collect()
    };
    let row = |texture: usize| movements.iter().map(|m| of(texture, *m)).collect();
    Ok(textures.into_iter().map(row).collect())
}

/// The table learned from the first slides of every texture and movement: so many, or all where there are fewer; the
/// table notes which. A texture with less than two is left out: see [`learned_textures`].
pub fn learn_first(
    set: &RecordingSet,
    measured: &[Vec<MeasuredSlide>],
    slides: usize,
    method: Method,
    features: Option<FeatureSet>,
    expected: &Expected,
) -> Result<Vec<u8>, TableError> {
    at_least_two(slides)?;
    let Enough {
        textures,
        movements,
        ..
    } = learned_textures(set, measured)?;
    let of_texture = |texture: &usize| -> Vec<Vec<&MeasuredSlide>> {
        let of = |movement: &Movement| {
            let same = measured[*texture]
                .iter()
                .filter(|s| s.movement == *movement);
            same.take(slides).collect()
        };
        movements.iter().map(of).collect()
    };
    let first: Vec<Vec<Vec<&MeasuredSlide>>> = textures.iter().map(of_texture).collect();
    let observed = |slides: &Vec<&MeasuredSlide>| -> Vec<Observation> {
        let slides = slides.iter();
        slides.map(|s| s.observation()).collect()
    };
    let rows = first.iter();
    let observed: Vec<Vec<Vec<Observation>>> =
        rows.map(|row| row.iter().map(observed).collect()).collect();
    let all = set.names();
    let names: Vec<String> = textures
        .iter()
        .map(|&texture| all[texture].clone())
        .collect();
    let bytes = learn_for(
        expected,
        method.method(),
        features,
        &names,
        &movements,
        &observed,
    )?;
    // the recordings' notes of the slides that were learned from
    let moved = |at: usize| {
        let keys = set.slides(textures[at]);
        let used = first[at].iter().flatten();
        let labels = used.map(|s| keys.iter().find(|key| key.number == s.number));
        of_all(labels.map(|key| key.and_then(|key| key.labels.moved)))
    };
    let noted = note(&bytes, |texture| moved(texture.into()))?;
    let sensor = set.sensor()?;
    let named = name_finger(&noted, sensor.finger, sensor.calibrated, &sensor.name)?;
    let used = first.iter().flatten().flatten();
    let used: Vec<_> = used.map(|slide| &slide.marks).collect();
    Ok(note_learned(&named, true, &used)?)
}
