//! A map of the textures of a table: their distances, as well as a plane can show them.

use tactus_core::table::Table;

use crate::chart::{Chart, Figure, MARKS, Mark, Series, WIDTH, buffer};
use tactus_core::features::Observation;
use tactus_lab::eval::places::{Plane, distances, off, slide_distances};

/// More textures than this have numbers in the map and a list of names below it.
const NAMED: usize = 40;

/// Slides of a movement among a table's textures.
pub struct Sample {
    /// Its name.
    pub name: String,
    /// The table's movement.
    pub movement: u8,
    /// Number and features of each slide.
    pub slides: Vec<(u32, Observation)>,
}

/// The map of a table's textures, and that of a movement with the slides of a sample.
pub fn figure(table: Table<'_>, sample: Option<&Sample>) -> anyhow::Result<Figure> {
    let movement = sample.map(|sample| sample.movement);
    let distances = distances(table, movement);
    let names: Vec<&str> = table.names().collect();
    let plane = Plane::of(&distances);
    let places = plane.places.clone();
    let slides = sample.into_iter().flat_map(|sample| {
        sample.slides.iter().filter_map(|(number, slide)| {
            let from_all = slide_distances(table, sample.movement, slide)?;
            let says = format!("{}, slide {number}", sample.name);
            Some((says, plane.place(&from_all)))
        })
    });
    let (says, slides): (Vec<String>, Vec<(f64, f64)>) = slides.unzip();
    let many = names.len() > NAMED;
    let nearest = nearest(&distances);
    let mut textures = Series::points(0, MARKS[0], "", places.clone());
    let mut series = Vec::new();
    for (n, name) in names.iter().enumerate() {
        textures.labels.push(if many {
            (n + 1).to_string()
        } else {
            (*name).to_owned()
        });
        let near = nearest[n].map_or_else(String::new, |(other, sd)| {
            format!("; nearest {}, {sd:.1} standard deviations", names[other])
        });
        textures.says.push(format!("{name}{near}"));
        // a pair that is nearest to each other has one line
        if let Some((other, _)) = nearest[n]
            && (other > n || nearest[other].is_none_or(|(back, _)| back != n))
        {
            series.push(Series {
                width: 1,
                ..Series::dashed("", vec![places[n], places[other]])
            });
        }
    }
    series.push(textures);
    if let Some(sample) = sample {
        let name = format!("{}, each slide", sample.name);
        series.push(Series {
            says,
            ..Series::points(1, Mark::Cross, name, slides.clone())
        });
    }
    let below = format!(
        "Distance: in standard deviations between slides of one texture. In a plane distances are not quite right: \
         here they are off by {:.0} % (root mean square). Dashed: to the texture that is nearest in truth.",
        100.0 * off(&distances, &places)
    );
    let list: Vec<String> = names
        .iter()
        .zip(1..)
        .map(|(name, n)| format!("{n}\u{a0}{}", name.replace(' ', "\u{a0}")))
        .collect();
    let below = if many {
        format!("{below} {}", list.join(", "))
    } else {
        below
    };
    let (x_range, y_range, tall) = ranges(&[&places[..], &slides].concat());
    let axis = "distance (standard deviations)";
    let at = movement.and_then(|at| table.movement(at));
    let title = match at {
        Some(movement) => format!("Textures and slides at {movement}"),
        None => "Map of the table's textures".to_owned(),
    };
    Chart {
        y_range,
        // the space above and below the axes, and as many lines as the chart makes of the words
        size: (WIDTH, tall + 88 + Chart::height_of(&below)),
        below: &below,
        ..Chart::new(title, axis, axis, x_range, series)
    }
    .figure("map")
}

/// The nearest other texture of each, and its distance.
fn nearest(distances: &[Vec<f64>]) -> Vec<Option<(usize, f64)>> {
    let nearest = distances.iter().enumerate().map(|(n, row)| {
        let others = row
            .iter()
            .copied()
            .enumerate()
            .filter(|&(other, _)| other != n);
        others.min_by(|a, b| a.1.total_cmp(&b.1))
    });
    nearest.collect()
}

/// Width of the area between the axes, and its least and greatest height, px.
const INSIDE: (f64, f64, f64) = (388.0, 360.0, 460.0);

/// Ranges of the axes with all places and a margin for names, and the height between the axes at which both have the
/// same scale.
fn ranges(places: &[(f64, f64)]) -> ((f64, f64), (f64, f64), u32) {
    let ends = |of: fn(&(f64, f64)) -> f64| {
        let (low, high) = buffer(places.iter().map(of));
        let (middle, half) = ((low + high) / 2.0, (high - low) / 2.0);
        (middle, 1.15 * half.max(0.5))
    };
    let ((x, wide), (y, high)) = (ends(|p| p.0), ends(|p| p.1));
    let (width, least, most) = INSIDE;
    let tall = (width * high / wide).clamp(least, most);
    // the wider of the two in its own direction sets the scale
    let scale = (wide / width).max(high / tall);
    let (wide, high) = (scale * width, scale * tall);
    ((x - wide, x + wide), (y - high, y + high), tall as u32)
}
