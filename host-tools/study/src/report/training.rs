//! The training in the report: Table 3, figs. 8 and 9, the wear of the skin, and all matrices as files.

use serde_json::json;
use tactus_core::features::{Movement, Property};

use super::model::{Report, axis, cells, movement_name};
use crate::chart::matrix::{SHADES, matrix};
use crate::chart::{Chart, DrawError, Figure, MARKS, Mark, Series, buffer};
use crate::published::{MOST_USEFUL, TRIALS};
use crate::training::Training;

/// Label of the axes of textures.
const TEXTURES: &str = "number of the texture (Table 1)";

/// Adds the results of the training.
pub(super) fn add(training: &Training, report: &mut Report) -> Result<(), DrawError> {
    let names: Vec<String> = training
        .movements
        .iter()
        .map(|&m| movement_name(m))
        .collect();
    let mut rows = Vec::new();
    for (c, name) in training.correlations.iter().zip(&names) {
        for ((a, b), paper) in [(0, 1), (0, 2), (1, 2)].into_iter().zip(c.paper) {
            rows.push(cells![
                name.as_str(),
                format!("{}, {}", Property::ALL[a], Property::ALL[b]),
                (c.ours[a][b], 3),
                (paper, 3),
                (c.ours[a][b] - paper, 3),
            ]);
        }
    }
    let header = ["movement", "properties", "here", "paper", "difference"];
    report.table("table3-correlations", &header, rows);
    let pairs = training.most_confused.iter().map(|p| {
        let (a, b) = &p.textures;
        cells![a.to_string(), b.to_string(), (p.all, 3), (p.most_useful, 3)]
    });
    let header = ["texture", "texture", "all nine", "the three most useful"];
    report.table("most-confused", &header, pairs.collect());
    let skin = &training.skin;
    let effects = skin.effects.iter().map(|e| {
        let [traction, roughness, fineness] = e.shift.map(|s| (s, 2));
        let movement = names[e.movement].as_str();
        cells![(e.wear, 0), movement, traction, roughness, fineness]
    });
    let header = [
        "ridges lost, %",
        "movement",
        "traction",
        "roughness",
        "fineness",
    ];
    report.table("skin-wear", &header, effects.collect());
    let files = training.tables.iter().map(|t| {
        let [file, contents, crc] = [&t.file, &t.contents, &t.crc].map(String::as_str);
        cells![file, contents, (t.bytes as f64, 0), crc]
    });
    let header = ["file", "contents", "bytes", "CRC-32"];
    report.table("tables-of-the-chip", &header, files.collect());

    let fig8 = MOST_USEFUL.iter().map(|useful| fig8(training, useful));
    report
        .figures
        .insert("fig8", fig8.collect::<Result<_, _>>()?);
    report.figures.insert("fig9", fig9(training)?);
    let skins = vec![wear(training)?, roughness(training)?];
    report.figures.insert("skin", skins);
    let changed = skin.changed_before.iter().map(|t| format!("T{}", t.number));
    let textures = training.textures.iter();
    let names: Vec<String> = textures.map(|t| t.texture.name.to_string()).collect();
    let words = json!({
        "names": names,
        "slides": training.textures.len() * training.movements.len() * TRIALS as usize,
        "between_movements": training.between_movements.map(|c| format!("{c:.2}")),
        "white": SHADES[0].to_string(),
        "black": SHADES[4].to_string(),
        "pairs_confused": training.pairs_confused,
        "changed": changed.collect::<Vec<_>>(),
        "changed_at": format!("{:.0}", skin.changed_at),
        "paper_changes": skin.paper_changes,
    });
    report.words.insert("training", words);
    Ok(())
}

/// A property of all slides at the movement that is most useful for it.
fn fig8(
    training: &Training,
    &(movement, property): &(Movement, Property),
) -> Result<Figure, DrawError> {
    let pair = (movement.force_n(), movement.speed_mm_s());
    let at = training.movements.iter().position(|&m| m == pair);
    let mut values = Vec::new();
    for t in &training.textures {
        let trials = t.properties[at.unwrap_or(0)].iter();
        let number = f64::from(t.texture.number);
        values.extend(trials.map(|p| (number, f64::from(p[property.index()]))));
    }
    let title = format!("{property} at {}", movement_name(pair));
    let series = vec![Series::points(0, Mark::Circle, "", values)];
    Chart {
        x_marks: 7,
        ..Chart::new(title, TEXTURES, axis(property), (0.0, 118.0), series)
    }
    .figure(format!("fig8-{property}"))
}

/// The nine matrices of confusion, and their geometric means.
fn fig9(training: &Training) -> Result<Vec<Figure>, DrawError> {
    let mut panels = Vec::new();
    for c in &training.confusion {
        let title = format!(
            "{}, {}",
            c.property,
            movement_name(training.movements[c.movement])
        );
        let id = format!("fig9-{}-{}", c.movement + 1, c.property);
        let told = format!("Degrees of confusion by {title}");
        panels.push(matrix(id, &title, &told, TEXTURES, &c.matrix)?);
    }
    let (nine, three) = (
        &training.geometric_mean,
        &training.geometric_mean_most_useful,
    );
    let all = "geometric mean of all nine";
    panels.push(matrix("fig9-all", all, all, TEXTURES, nine)?);
    let most_useful = "geometric mean of the three most useful";
    panels.push(matrix(
        "fig9-most-useful",
        most_useful,
        most_useful,
        TEXTURES,
        three,
    )?);
    Ok(panels)
}

/// Wear of the skin while the textures are slid over, one after the other.
fn wear(training: &Training) -> Result<Figure, DrawError> {
    let mut wear = Vec::new();
    for t in &training.textures {
        let x = f64::from(t.texture.number);
        wear.extend([(x - 1.0, t.wear.0), (x, t.wear.1)]);
    }
    let limit = training.skin.changed_at;
    let y_range = buffer(wear.iter().map(|w| w.1).chain([0.0, limit]));
    let line = Series::dashed("changed", vec![(0.0, limit), (117.0, limit)]);
    let series = vec![Series::curve(0, Mark::None, "wear", wear), line];
    let title = "Wear of the skin during the training";
    let (x, y) = ("textures slid over", "ridges lost (%)");
    Chart {
        y_range,
        x_marks: 7,
        ..Chart::new(title, x, y, (0.0, 118.0), series)
    }
    .figure("skin-during-training")
}

/// Effect of wear on roughness, by movement.
fn roughness(training: &Training) -> Result<Figure, DrawError> {
    let mut series = Vec::new();
    for (m, &movement) in training.movements.iter().enumerate() {
        let effects = training.skin.effects.iter().filter(|e| e.movement == m);
        let points = effects.map(|e| (e.wear, e.shift[Property::Roughness.index()]));
        let mark = MARKS[m % MARKS.len()];
        series.push(Series::curve(
            m,
            mark,
            movement_name(movement),
            points.collect(),
        ));
    }
    let title = "Change of roughness with wear";
    let (x, y) = ("ridges lost (%)", "change (standard deviations)");
    Chart::new(title, x, y, (-4.0, 104.0), series).figure("skin-and-roughness")
}
