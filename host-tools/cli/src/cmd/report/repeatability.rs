//! `tactus report` without a table: how repeatable probe and operators are.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use serde::Serialize;
use tactus_core::features::{Movement, Property};
use tactus_lab::data::recording::Labels;
use tactus_lab::eval::gauge::{Reading, Study, distinct, study};
use tactus_lab::eval::show::count;
use tactus_study::chart::Figure;
use tactus_study::pictures::control;

use crate::cmd::args::Only;
use crate::cmd::output::{Format, UsageError, about_percent, print_json};
use crate::cmd::plot::Plot;
use crate::cmd::textures::measure_folder;

#[derive(Serialize)]
struct Gauged {
    parts: usize,
    operators: Vec<String>,
    slides: usize,
    movements: Vec<AtMovement>,
}

#[derive(Serialize)]
struct AtMovement {
    force_n: Option<f32>,
    speed_mm_s: Option<f32>,
    #[serde(skip)]
    movement: Movement,
    properties: Vec<Gauge>,
}

#[derive(Serialize)]
struct Gauge {
    property: &'static str,
    unit: &'static str,
    #[serde(flatten)]
    study: Study,
    /// Readings outside the control limits, in words.
    outside_slides: Vec<String>,
    #[serde(skip)]
    readings: Vec<Reading>,
}

struct Taken {
    movement: Movement,
    part: String,
    labels: Labels,
    number: u32,
    values: [Option<f32>; 3],
}

pub(super) fn run(
    folders: &[PathBuf],
    only: &Only,
    plot: &Plot,
    format: Format,
    out: &mut impl Write,
) -> anyhow::Result<()> {
    let canvas = plot.open()?;
    let mut slides = Vec::new();
    for (n, folder) in folders.iter().enumerate() {
        if folders[..n].contains(folder) {
            let say = format!(
                "--recordings {}: this folder was given before",
                folder.display()
            );
            return Err(UsageError(say).into());
        }
        take(folder, only, &mut slides)?;
    }
    let gauged = gauge(&slides)?;
    match format {
        Format::Json => print_json(&gauged, out)?,
        Format::Text => print(&gauged, out)?,
    }
    if let Some(canvas) = canvas {
        canvas.write(&charts(&gauged)?, out)?;
    }
    Ok(())
}

fn charts(gauged: &Gauged) -> anyhow::Result<Vec<Figure>> {
    let mut figures = Vec::new();
    for (at, movement) in (1..).zip(&gauged.movements) {
        for gauge in &movement.properties {
            let property = gauge.property;
            let id = match gauged.movements.len() {
                1 => format!("control-{property}"),
                _ => format!("control-{property}-{at}"),
            };
            let title = format!("{property}, {}", movement.movement);
            let unit = format!(" ({})", gauge.unit);
            let (readings, study) = (&gauge.readings, &gauge.study);
            figures.push(control::figure(&id, &title, &unit, readings, study)?);
        }
    }
    Ok(figures)
}

fn take(folder: &Path, only: &Only, slides: &mut Vec<Taken>) -> anyhow::Result<()> {
    let (set, measured) = measure_folder(folder, only)?;
    for (index, (texture, measured)) in set.textures().iter().zip(&measured).enumerate() {
        for (slide, key) in measured.iter().zip(set.slides(index)) {
            let labels = key.labels.clone();
            let part = match labels.lot.as_str() {
                "" => texture.name.clone(),
                lot => format!("{}, lot {lot}", texture.name),
            };
            let properties = &slide.measurement.properties;
            slides.push(Taken {
                movement: slide.movement,
                part,
                labels,
                number: slide.number,
                values: Property::ALL.map(|property| properties.get(property)),
            });
        }
    }
    Ok(())
}

fn gauge(slides: &[Taken]) -> anyhow::Result<Gauged> {
    let mut movements = Vec::new();
    for movement in distinct(slides.iter().map(|s| s.movement)) {
        let of = || slides.iter().filter(|s| s.movement == movement);
        let mut properties = Vec::new();
        for (n, property) in Property::ALL.into_iter().enumerate() {
            let readings: Option<Vec<Reading>> = of()
                .map(|s| {
                    Some(Reading {
                        part: s.part.clone(),
                        operator: s.labels.operator.clone(),
                        slide: s.number,
                        value: s.values[n]?.into(),
                    })
                })
                .collect();
            // a rig without force sensing measures no traction
            let Some(readings) = readings else { continue };
            let study = study(&readings).with_context(|| movement.to_string())?;
            let outside = study.outside.iter().map(|&n| {
                let Reading {
                    part,
                    operator,
                    slide,
                    ..
                } = &readings[n];
                let by = if operator.is_empty() { "" } else { ", " };
                format!("{part}{by}{operator}, slide {slide}")
            });
            properties.push(Gauge {
                property: property.name(),
                unit: if property == Property::Traction {
                    "N"
                } else {
                    "ln"
                },
                outside_slides: outside.collect(),
                study,
                readings,
            });
        }
        movements.push(AtMovement {
            force_n: movement.known().0,
            speed_mm_s: movement.known().1,
            movement,
            properties,
        });
    }
    let operators = slides.iter().map(|s| s.labels.operator.clone());
    Ok(Gauged {
        parts: distinct(slides.iter().map(|s| &s.part)).len(),
        operators: distinct(operators.filter(|name| !name.is_empty())),
        slides: slides.len(),
        movements,
    })
}

/// Rows and slides outside the limits that are printed, most.
const ROWS: usize = 20;
const OUTSIDE: usize = 5;

/// What a gauge with this share of all variation is usually called.
fn called(share: f64) -> &'static str {
    match share {
        ..0.1 => "good",
        ..0.3 => "of use for coarse differences",
        _ => "not acceptable",
    }
}

/// The answer in a sentence: the reading that separates parts best.
fn verdict(rows: &[(Movement, &Gauge)]) -> Option<String> {
    let (movement, best) = rows.first()?;
    let share = best.study.gauge_share;
    let classes = match best.study.distinct_categories {
        Some(n) => format!("; it tells {} of parts apart", count(n, "kind")),
        None => String::new(),
    };
    Some(format!(
        "The gauge is {} by {} ({movement}): {} of all variation is its own{classes}.",
        called(share),
        best.property,
        about_percent(share)
    ))
}

fn print(gauged: &Gauged, out: &mut impl Write) -> anyhow::Result<()> {
    let all = gauged.movements.iter().flat_map(|at| {
        let properties = at.properties.iter();
        properties.map(|gauge| (at.movement, gauge))
    });
    let mut rows: Vec<(Movement, &Gauge)> = all.collect();
    rows.sort_by(|(_, a), (_, b)| a.study.gauge_share.total_cmp(&b.study.gauge_share));
    if let Some(verdict) = verdict(&rows) {
        writeln!(out, "{verdict}")?;
    }
    let by = match gauged.operators.len() {
        0 => "nobody named as operator".to_owned(),
        n => count(n as u64, "operator"),
    };
    writeln!(
        out,
        "{}, {by}, {}; standard deviations, the best first:\n\n{:<34} {:>13} {:>10} {:>10} {:>10} {:>8} {:>8}",
        count(gauged.parts as u64, "part"),
        count(gauged.slides as u64, "slide"),
        "property",
        "repeatability",
        "operators",
        "by part",
        "parts",
        "gauge",
        "classes"
    )?;
    for (movement, gauge) in rows.iter().take(ROWS) {
        let sd = &gauge.study.sd;
        let dash = |value: Option<f64>| value.map_or("-".to_owned(), |v| format!("{v:.4}"));
        let classes = gauge.study.distinct_categories;
        writeln!(
            out,
            "{:<34} {:>13.4} {:>10} {:>10} {:>10.4} {:>8} {:>8}",
            format!("{} ({}), {movement}", gauge.property, gauge.unit),
            sd.repeatability,
            dash(sd.operator),
            dash(sd.operator_by_part),
            sd.part,
            about_percent(gauge.study.gauge_share),
            classes.map_or("-".to_owned(), |n| n.to_string())
        )?;
    }
    if let Some(more) = rows.len().checked_sub(ROWS + 1) {
        writeln!(out, "and {more} more that separate less, in --format json")?;
    }
    let outside: Vec<String> = rows
        .iter()
        .flat_map(|(_, gauge)| {
            let slides = gauge.outside_slides.iter();
            slides.map(|slide| format!("{slide} ({})", gauge.property))
        })
        .collect();
    if !outside.is_empty() {
        let more = match outside.len().saturating_sub(OUTSIDE) {
            0 => String::new(),
            more => format!(", and {more} more: --plot draws them"),
        };
        let first = outside[..outside.len().min(OUTSIDE)].join("; ");
        writeln!(out, "\nOutside the control limits: {first}{more}")?;
    }
    Ok(())
}
