//! The pilot study in the report: the 36 movements, and figs. 5 to 7.

use serde_json::json;
use tactus_core::features::Movement;

use super::model::{Cell, Report, axis, cells, movement_name};
use crate::chart::grid::{AVOIDED, Grid, Tile};
use crate::chart::{COLOURS, Chart, DrawError, Figure, Mark, PANEL, Series};
use crate::pilot::{Missed, MostUseful, Pilot, PilotMovement};
use crate::published::PILOT_TRIALS;

/// The textures of fig. 6 whose centroid rises with speed.
const COARSE: [u8; 4] = [10, 30, 87, 100];

/// Adds the results of the pilot study.
pub(super) fn add(pilot: &Pilot, report: &mut Report) -> Result<(), DrawError> {
    let useful = |m: &MostUseful| {
        let left = |at: usize| (pilot.movements[at].uncertainty[m.property.index()], 3);
        let name = |at: usize| name(&pilot.movements[at]);
        cells![
            m.property.name(),
            name(m.movement),
            left(m.movement),
            name(m.paper),
            left(m.paper),
            name(m.with_wear),
            left(m.with_wear),
        ]
    };
    report.table(
        "most-useful-movements",
        &[
            "property",
            "here",
            "uncertainty here",
            "paper",
            "uncertainty here at the paper's",
            "best if wear did not matter",
            "uncertainty there",
        ],
        pilot.most_useful.iter().map(useful).collect(),
    );
    let movement = |m: &PilotMovement| {
        let [traction, roughness, fineness] = match not_reached(m) {
            Some(why) => [why, String::new(), String::new()].map(Cell::from),
            None => m.uncertainty.map(|u| Cell::from((u, 3))),
        };
        cells![
            (m.force_n, 2),
            (m.speed_mm_s, 1),
            (m.power_mw, 1),
            m.high_wear,
            (m.wear, 2),
            traction,
            roughness,
            fineness,
        ]
    };
    report.table(
        "movements",
        &[
            "force, N",
            "speed, mm/s",
            "F v, mW",
            "avoided for wear",
            "ridges lost in 100 slides, %",
            "uncertainty by traction",
            "by roughness",
            "by fineness",
        ],
        pilot.movements.iter().map(movement).collect(),
    );
    let drawn = |of: fn(&Pilot, &MostUseful) -> Result<Figure, DrawError>| {
        let figures = pilot.most_useful.iter().map(|useful| of(pilot, useful));
        figures.collect::<Result<Vec<_>, _>>()
    };
    report.figures.insert("fig5", drawn(fig5)?);
    report.figures.insert("fig6", vec![fig6(pilot)?]);
    report.figures.insert("fig7", drawn(fig7)?);
    let textures = pilot.textures.iter().map(ToString::to_string);
    let same = pilot.most_useful.iter().filter(|m| m.movement == m.paper);
    let words = json!({"trials": PILOT_TRIALS, "same": same.count(), "textures": textures.collect::<Vec<_>>()});
    report.words.insert("pilot", words);
    Ok(())
}

/// Text in place of the uncertainty of a movement that the rig could not make on every texture.
fn not_reached(m: &PilotMovement) -> Option<String> {
    let missed = |m: &Missed| format!("T{}, trial {}: {}", m.texture, m.trial, m.reason);
    let missed: Vec<String> = m.not_reached.iter().map(missed).collect();
    (!missed.is_empty()).then(|| format!("not reached: {}", missed.join("; ")))
}

fn name(m: &PilotMovement) -> String {
    movement_name((m.force_n, m.speed_mm_s))
}

/// The property of all trials at the movement that is most useful for it.
fn fig5(pilot: &Pilot, useful: &MostUseful) -> Result<Figure, DrawError> {
    let property = useful.property;
    let mut values = Vec::new();
    for (texture, movements) in (1_u8..).zip(&pilot.properties) {
        let trials = movements[useful.movement].iter();
        values.extend(trials.map(|p| (f64::from(texture), f64::from(p[property.index()]))));
    }
    let number = |x: f64| {
        let texture = pilot.textures.get((x.round() as usize).wrapping_sub(1));
        texture.map_or_else(String::new, |t| format!("T{}", t.number))
    };
    let title = format!("{property} at {}", name(&pilot.movements[useful.movement]));
    let x_range = (0.4, pilot.textures.len() as f64 + 0.6);
    let series = vec![Series::points(0, Mark::Circle, "", values)];
    Chart {
        x_marks: pilot.textures.len(),
        x_text: &number,
        ..Chart::new(title, "texture", axis(property), x_range, series)
    }
    .figure(format!("fig5-{property}"))
}

/// Spectral centroid by speed at the lightest force.
fn fig6(pilot: &Pilot) -> Result<Figure, DrawError> {
    let lightest = Movement::grid().next().map_or(0.0, Movement::force_n);
    let mut series = Vec::new();
    for (texture, movements) in pilot.textures.iter().zip(&pilot.properties) {
        let at_lightest = movements.iter().zip(&pilot.movements);
        let at_lightest = at_lightest.filter(|(_, m)| m.force_n == lightest);
        let at_lightest = at_lightest.filter(|(trials, _)| !trials.is_empty());
        let centroid = at_lightest.map(|(trials, m)| {
            let sum: f64 = trials.iter().map(|p| f64::from(p[2])).sum();
            let hz = (sum / trials.len().max(1) as f64).exp();
            (f64::from(m.speed_mm_s).log10(), hz)
        });
        let coarse = COARSE.contains(&texture.number);
        let mark = if coarse { Mark::Cross } else { Mark::Circle };
        let name = format!("T{}", texture.number);
        series.push(Series::curve(coarse.into(), mark, name, centroid.collect()));
    }
    let title = "Spectral centroid by speed at 0.2 N";
    let (x, y) = ("sliding speed (mm/s)", "spectral centroid (Hz)");
    Chart {
        x_text: &|x| format!("{:.0}", 10f64.powf(x)),
        named_at_end: true,
        size: (PANEL.0, 420),
        ..Chart::new(title, x, y, (0.96, 2.04), series)
    }
    .figure("fig6")
}

/// Uncertainty by force and speed: the least is framed, movements that wear the skin are grey.
fn fig7(pilot: &Pilot, useful: &MostUseful) -> Result<Figure, DrawError> {
    let property = useful.property;
    let left = |m: &PilotMovement| f64::from(m.uncertainty[property.index()]);
    let reached = |m: &&PilotMovement| m.not_reached.is_empty();
    let (low, high) = pilot
        .movements
        .iter()
        .filter(reached)
        .map(left)
        .fold((1.0, 0.0), |(l, h): (f64, f64), u| (l.min(u), h.max(u)));
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
    let mut rows: Vec<Vec<Tile>> = Vec::new();
    loop {
        let row: Vec<Tile> = tiles.by_ref().take(6).collect();
        if row.is_empty() {
            break;
        }
        rows.push(row);
    }
    // forces upwards
    rows.reverse();
    let none = if pilot.movements.iter().all(|m| reached(&m)) {
        ""
    } else {
        " (none: not reached on every texture)"
    };
    let speeds = pilot.movements.iter().take(6);
    let speeds: Vec<String> = speeds.map(|m| format!("{:.1}", m.speed_mm_s)).collect();
    let forces = pilot.movements.iter().rev().step_by(6);
    let forces: Vec<String> = forces.map(|m| format!("{:.2}", m.force_n)).collect();
    Grid {
        id: format!("fig7-{property}"),
        title: format!("Uncertainty by {property}{none}"),
        about: "",
        x: ("sliding speed (mm/s)", speeds),
        y: ("contact force (N)", forces),
        tiles: rows,
        below: "",
    }
    .figure()
}
