//! Conclusions from all files: which can be read, their textures, and the gains.

use std::collections::HashMap;

use super::reading::{How, rounded};
use super::{FULL, Found, Source};
use crate::data::import::settings::Settings;
use crate::data::recordings::Result;

/// Largest value that a sample has.
const MOST: f64 = i16::MAX as f64;
/// Smallest change of any sensor, in any unit.
const SMALLEST: f64 = 1e-30;

/// Counts per unit of the vibration, and of the pressure where it changes.
pub(super) fn gains(
    found: &[Found],
    channel: &str,
    settings: &Settings,
) -> std::result::Result<(f64, Option<f64>), String> {
    let peak = found.iter().map(|f| f.peak).fold(0.0, f64::max);
    let pressure = found.iter().map(|f| f.pressure).fold(0.0, f64::max);
    if peak < SMALLEST {
        return Err(format!(
            "channel {channel:?} never changes: is the sensor connected?"
        ));
    }
    let gain = match (settings.gain, settings.unit.as_deref()) {
        (Some(gain), _) if gain.is_normal() && gain > 0.0 => gain,
        (Some(gain), _) => {
            return Err(format!(
                "a gain of {gain} is impossible; give counts per unit"
            ));
        }
        (None, Some("counts")) => 1.0,
        (None, _) => rounded(FULL / peak),
    };
    if peak * gain > MOST {
        return Err(format!(
            "at {gain} counts per unit channel {channel:?} reaches {:.0} counts, and samples have {MOST} at most: give \
             --gain {} or less",
            peak * gain,
            rounded(FULL / peak)
        ));
    }
    let in_counts = settings.unit.as_deref() == Some("counts") && pressure <= MOST;
    let pressure_gain = || {
        if in_counts {
            1.0
        } else {
            rounded(FULL / pressure)
        }
    };
    Ok((gain, (pressure > SMALLEST).then(pressure_gain)))
}

/// Recordings of the files that can be read, and why others are left out.
/// Errors: most files, or any signal in memory, cannot be read.
pub(super) fn readable(
    looked: Vec<Result<Vec<Found>>>,
    source: &Source,
) -> Result<(Vec<Found>, Vec<String>)> {
    let refused = looked.iter().filter(|looked| looked.is_err()).count();
    let (is_memory, all) = (source.is_arrays(), looked.len());
    let (mut found, mut left_out) = (Vec::new(), Vec::new());
    for looked in looked {
        match looked {
            Ok(of_file) => found.extend(of_file),
            Err(why) if is_memory || 2 * refused > all => return Err(why),
            Err(why) => left_out.push(why.to_string()),
        }
    }
    Ok((found, left_out))
}

/// The textures with slides, in the order of their first file, and why others have none.
pub(super) fn textures(found: &[Found]) -> std::result::Result<(Vec<String>, Vec<String>), String> {
    // slides, and a recording that is long enough, else any
    let mut of: HashMap<&str, (usize, &Found)> = HashMap::new();
    let mut order = Vec::new();
    for f in found {
        let (slides, longest) = of.entry(f.texture.as_str()).or_insert_with(|| {
            order.push(f.texture.clone());
            (0, f)
        });
        *slides += f.ranges.slides.len();
        if f.short.is_none() {
            *longest = f;
        }
    }
    let without = |texture: &String| match of[texture.as_str()].1 {
        Found {
            seconds,
            short: Some(least),
            ..
        } => format!(
            "{texture}: recordings of {seconds:.1} s are too short; at this rate a slide takes {least:.1} s"
        ),
        _ => format!(
            "{texture}: no sliding was found in its recordings; say where it is by --window FROM,TO (in Python by \
             cut=False), or leave them out"
        ),
    };
    let (kept, empty): (Vec<_>, Vec<_>) = order.into_iter().partition(|t| of[t.as_str()].0 > 0);
    let mut short: Vec<String> = empty.iter().map(without).collect();
    match kept.is_empty() {
        true if short.is_empty() => Err("no row names a texture".to_owned()),
        true => Err(short.swap_remove(0)),
        false => Ok((kept, short)),
    }
}

/// Sentences about what nothing said, and how it was found.
pub(super) fn notes(how: &How, lively: &[String]) -> Vec<String> {
    let unit = how.unit.as_ref().map(|(column, unit)| {
        format!("column {column} is taken for the time in {unit}; another: --rate HZ")
    });
    let channel = (lively.len() > 1).then(|| {
        let all = lively.join(", ");
        format!(
            "channel {} is the liveliest of {all}; another: --channel COLUMN",
            lively[0]
        )
    });
    unit.into_iter().chain(channel).collect()
}
