//! What the report says: the study's numbers as sections of words, tables and figures.

use tactus_core::features::Property;
use tactus_core::movement::Movement;

use super::draw::DrawError;
use super::draw::{COLOURS, Chart, GREY, Line, Mark, PANEL, SHADES, Series, Tile};
use super::draw::{chart, grid, matrix, plain, room};
use super::model::{Block, Cell, Figure, Section, Table};
use crate::eval::evaluate::Method;
use crate::study::identify::{Column, Evolution, Identification, METHODS, PairRow, WorldRow};
use crate::study::pilot::Pilot;
use crate::study::published;
use crate::study::results::{CALIBRATED, Study};
use crate::study::signals::{PAPER_LINE, Signals};
use crate::study::training::Training;

type Drawn<T> = Result<T, DrawError>;

/// The textures of fig. 6 whose centroid rises with speed.
const COARSE: [u8; 4] = [10, 30, 87, 100];

/// All sections of what was studied.
pub(super) fn of(study: &Study) -> Drawn<Vec<Section>> {
    let mut sections = vec![about(study)];
    if let Some(pilot) = &study.pilot {
        sections.push(of_pilot(pilot)?);
    }
    if let Some(training) = &study.training {
        sections.push(of_training(training)?);
    }
    if let Some(pairs) = &study.pairs {
        sections.push(of_pairs(pairs, study.simulations));
    }
    if let Some(identification) = &study.identification {
        sections.push(of_identification(identification)?);
    }
    if let Some(signals) = &study.signals {
        sections.push(of_signals(signals)?);
    }
    if !study.worlds.is_empty() {
        sections.push(of_worlds(&study.worlds)?);
    }
    Ok(sections)
}

fn text(words: impl Into<String>) -> Block {
    Block::Text(words.into())
}

fn header(names: &[&str]) -> Vec<String> {
    names.iter().map(|&name| name.to_owned()).collect()
}

fn figure(id: impl Into<String>, title: impl Into<String>, svg: String) -> Figure {
    Figure {
        id: id.into(),
        title: title.into(),
        svg,
    }
}

fn movement_name((force_n, speed_mm_s): (f32, f32)) -> String {
    format!("{force_n:.2} N, {speed_mm_s:.1} mm/s")
}

/// A property with its unit, for an axis.
fn axis(property: Property) -> &'static str {
    match property {
        Property::Traction => "traction (N)",
        Property::Roughness => "roughness (ln of counts\u{b2})",
        Property::Fineness => "fineness (ln of Hz)",
    }
}

fn points(colour: usize, mark: Mark, name: &str, points: Vec<(f64, f64)>) -> Series {
    Series {
        name: name.to_owned(),
        colour: COLOURS[colour % COLOURS.len()],
        mark,
        line: None,
        points,
    }
}

fn curve(colour: usize, mark: Mark, name: &str, points: Vec<(f64, f64)>) -> Series {
    Series {
        line: Some(Line::Whole),
        ..self::points(colour, mark, name, points)
    }
}

fn about(study: &Study) -> Section {
    Section {
        id: "about",
        title: "What this is".to_owned(),
        blocks: vec![
            text(
                "The experiment of Fishel and Loeb (Bayesian exploration for intelligent identification of textures, \
Front. Neurorobot. 6:4, 2012), made again in software. Every slide is made by the whole simulated rig: the firmware's own \
control presses and slides, the simulated finger answers in the sensor's words, and the firmware's own code decodes them, \
computes traction, roughness and fineness, learns the texture table, decides and chooses.",
            ),
            text(format!(
                "The world is simulated, not measured: the 117 textures are drawn from what their names and the paper say of \
them, and another seed is another collection of such textures. One knob was set by results: how much one touch differs from \
the next. {CALIBRATED} Here it is {}. Cycling and random are taken as they then come.",
                study.variation
            )),
            text(
                "One thing was decided knowing Table 5: textures differ in what load and speed do to them. Friction goes with \
powers of both that are the texture's own, vibrations are damped by load sooner or later and grow with speed more or less. In \
worlds 1 to 10 without that, one movement told nearly all of another, the six pairs of movement and property that cycling leaves \
out had little to add, and cycling was right more often than random choice at every setting of the knob. The paper's order, and \
its remark that textures are confused much more by the three most useful pairs alone, cannot come from such textures.",
            ),
            text(
                "That all signals pass through the chip's code is held by tests: the emulated board's features, posteriors \
and choices are compared with these functions bit by bit (host-tools/src/follow.rs, host-tools/emulator/tests/explore.rs).",
            ),
        ],
    }
}

fn of_pilot(pilot: &Pilot) -> Drawn<Section> {
    let name = |at: usize| {
        let m = &pilot.movements[at];
        movement_name((m.force_n, m.speed_mm_s))
    };
    let useful = Table {
        id: "most-useful-movements",
        title: "The most useful movement for each property, among those that do not wear the skin"
            .to_owned(),
        header: header(&[
            "property",
            "here",
            "uncertainty here",
            "paper",
            "uncertainty here at the paper's",
            "best if wear did not matter",
            "uncertainty there",
        ]),
        rows: pilot
            .most_useful
            .iter()
            .map(|m| {
                let left = |at: usize| {
                    let left = pilot.movements[at].uncertainty[m.property.index()];
                    Cell::single(left, 3)
                };
                vec![
                    Cell::text(m.property),
                    Cell::text(name(m.movement)),
                    left(m.movement),
                    Cell::text(name(m.paper)),
                    left(m.paper),
                    Cell::text(name(m.with_wear)),
                    left(m.with_wear),
                ]
            })
            .collect(),
    };
    let all = Table {
        id: "movements",
        title: "The 36 movements".to_owned(),
        header: header(&[
            "force, N",
            "speed, mm/s",
            "F v, mW",
            "avoided for wear",
            "ridges lost in 100 slides, %",
            "uncertainty by traction",
            "by roughness",
            "by fineness",
        ]),
        rows: pilot
            .movements
            .iter()
            .map(|m| {
                let mut row = vec![
                    Cell::single(m.force_n, 2),
                    Cell::single(m.speed_mm_s, 1),
                    Cell::single(m.power_mw, 1),
                    Cell::text(if m.high_wear { "yes" } else { "no" }),
                    Cell::Number(m.wear, 2),
                ];
                row.extend(m.uncertainty.map(|u| Cell::single(u, 3)));
                row
            })
            .collect(),
    };
    let trials = Table {
        id: "pilot-properties",
        title: "All properties of the pilot study".to_owned(),
        header: header(&[
            "texture",
            "name",
            "force, N",
            "speed, mm/s",
            "trial",
            "traction, N",
            "roughness",
            "fineness",
        ]),
        rows: pilot
            .textures
            .iter()
            .zip(&pilot.properties)
            .flat_map(|(texture, movements)| {
                let of = movements.iter().zip(&pilot.movements);
                of.flat_map(move |(trials, m)| {
                    trials.iter().enumerate().map(move |(n, p)| {
                        let mut row = vec![
                            Cell::Number(texture.number.into(), 0),
                            Cell::text(texture.name),
                            Cell::single(m.force_n, 2),
                            Cell::single(m.speed_mm_s, 1),
                            Cell::Number(n as f64 + 1.0, 0),
                        ];
                        row.extend(p.map(|p| Cell::single(p, 4)));
                        row
                    })
                })
            })
            .collect(),
    };
    let same = pilot
        .most_useful
        .iter()
        .filter(|m| m.movement == m.paper)
        .count();
    let found = if same == 3 {
        "All three are the paper's.".to_owned()
    } else {
        format!(
            "{same} of the three are the paper's. Ten textures and six trials leave neighbouring movements close together: \
compare the two columns of uncertainties. The study goes on with the paper's three, so that every table can be compared."
        )
    };
    Ok(Section {
        id: "pilot",
        title: "Pilot study: which movements".to_owned(),
        blocks: vec![
            text(format!(
                "Ten textures (Table 2), 36 movements, {} slides each. The uncertainty is eq. 11 with equal priors: what one \
slide leaves open among the ten, 0 nothing, 1 everything. The probe itself never presses so hard as these movements do, up to \
2 N: here its guard of the force does not watch, as the paper's rig had none. {found}",
                published::PILOT_TRIALS
            )),
            Block::Table(useful),
            Block::Figure(fig5(pilot)?, fig5_caption(pilot)),
            Block::Figure(
                vec![fig6(pilot)?],
                "Fig. 6: spectral centroid against speed at 0.2 N, mean of six slides. In the paper only the coarse textures \
(T10, T30, T87, T100; orange crosses) rise with speed throughout."
                    .to_owned(),
            ),
            Block::Figure(
                fig7(pilot)?,
                "Fig. 7: uncertainty that one slide leaves; darker is better. Grey with white figures: avoided, for their \
sliding power wears the skin. The most useful one is framed, the paper's is marked with a *."
                    .to_owned(),
            ),
            Block::Table(all),
            Block::File(trials),
        ],
    })
}

fn fig5_caption(pilot: &Pilot) -> String {
    let names: Vec<String> = pilot
        .textures
        .iter()
        .map(|t| format!("T{} {}", t.number, t.name))
        .collect();
    format!(
        "Fig. 5: the properties at their most useful movements, six slides of each texture. {}.",
        names.join(", ")
    )
}

fn fig5(pilot: &Pilot) -> Drawn<Vec<Figure>> {
    let of = |useful: &crate::study::pilot::MostUseful| {
        let property = useful.property;
        let values: Vec<(f64, f64)> = pilot
            .properties
            .iter()
            .enumerate()
            .flat_map(|(t, movements)| {
                let trials = movements[useful.movement].iter();
                trials.map(move |p| (t as f64 + 1.0, f64::from(p[property.index()])))
            })
            .collect();
        let m = &pilot.movements[useful.movement];
        let title = format!("{property} at {}", movement_name((m.force_n, m.speed_mm_s)));
        let number = |x: f64| {
            let texture = pilot.textures.get((x.round() as usize).wrapping_sub(1));
            texture.map_or_else(String::new, |t| format!("T{}", t.number))
        };
        let svg = chart(&Chart {
            title: title.clone(),
            x: "texture",
            y: axis(property),
            x_range: (0.4, pilot.textures.len() as f64 + 0.6),
            y_range: room(values.iter().map(|v| v.1)),
            x_marks: pilot.textures.len(),
            x_text: &number,
            named_at_end: false,
            size: PANEL,
            series: vec![points(0, Mark::Circle, "", values)],
        })?;
        Ok(figure(format!("fig5-{property}"), title, svg))
    };
    pilot.most_useful.iter().map(of).collect()
}

fn fig6(pilot: &Pilot) -> Drawn<Figure> {
    let lightest = Movement::grid().next().map_or(0.0, Movement::force_n);
    let series: Vec<Series> = pilot
        .textures
        .iter()
        .zip(&pilot.properties)
        .map(|(texture, movements)| {
            let at_lightest = movements.iter().zip(&pilot.movements);
            let at_lightest = at_lightest.filter(|(_, m)| m.force_n == lightest);
            let centroid = at_lightest.map(|(trials, m)| {
                let sum: f64 = trials.iter().map(|p| f64::from(p[2])).sum();
                let hz = (sum / trials.len().max(1) as f64).exp();
                (f64::from(m.speed_mm_s).log10(), hz)
            });
            let (colour, mark) = if COARSE.contains(&texture.number) {
                (1, Mark::Cross)
            } else {
                (0, Mark::Circle)
            };
            curve(
                colour,
                mark,
                &format!("T{}", texture.number),
                centroid.collect(),
            )
        })
        .collect();
    let all = series.iter().flat_map(|s| &s.points).map(|p| p.1);
    let title = "Spectral centroid by speed at 0.2 N";
    let svg = chart(&Chart {
        title: title.to_owned(),
        x: "sliding speed (mm/s)",
        y: "spectral centroid (Hz)",
        y_range: room(all),
        x_range: (0.96, 2.04),
        x_marks: 6,
        x_text: &|x| format!("{:.0}", 10f64.powf(x)),
        named_at_end: true,
        size: (560, 420),
        series,
    })?;
    Ok(figure("fig6", title, svg))
}

fn fig7(pilot: &Pilot) -> Drawn<Vec<Figure>> {
    let of = |useful: &crate::study::pilot::MostUseful| {
        let property = useful.property;
        let left =
            |m: &crate::study::pilot::PilotMovement| f64::from(m.uncertainty[property.index()]);
        let (low, high) = pilot
            .movements
            .iter()
            .map(left)
            .fold((1.0, 0.0), |(l, h): (f64, f64), u| (l.min(u), h.max(u)));
        // forces upwards
        let tiles: Vec<Vec<Tile>> = (0..6)
            .rev()
            .map(|force| {
                let row = (6 * force)..(6 * force + 6);
                row.filter_map(|at| Some((at, pilot.movements.get(at)?)))
                    .map(|(at, m)| Tile {
                        text: format!(
                            "{:.2}{}",
                            left(m),
                            if at == useful.paper { "*" } else { "" }
                        ),
                        shade: (high - left(m)) / (high - low).max(1e-9),
                        avoided: m.high_wear,
                        framed: at == useful.movement,
                    })
                    .collect()
            })
            .collect();
        let speeds: Vec<String> = pilot.movements[..6]
            .iter()
            .map(|m| format!("{:.1}", m.speed_mm_s))
            .collect();
        let forces = pilot.movements.iter().rev().step_by(6);
        let forces: Vec<String> = forces.map(|m| format!("{:.2}", m.force_n)).collect();
        let title = format!("Uncertainty by {property}");
        let svg = grid(
            &title,
            ("sliding speed (mm/s)", &speeds),
            ("contact force (N)", &forces),
            &tiles,
        )?;
        Ok(figure(format!("fig7-{property}"), title, svg))
    };
    pilot.most_useful.iter().map(of).collect()
}

fn of_training(training: &Training) -> Drawn<Section> {
    let names: Vec<String> = training
        .movements
        .iter()
        .map(|&m| movement_name(m))
        .collect();
    let correlations = Table {
        id: "table3-correlations",
        title: "Table 3: correlations of the properties over the 117 textures".to_owned(),
        header: header(&["movement", "properties", "here", "paper", "difference"]),
        rows: training
            .correlations
            .iter()
            .zip(&names)
            .flat_map(|(c, name)| {
                [(0, 1), (0, 2), (1, 2)]
                    .into_iter()
                    .zip(c.paper)
                    .map(move |((a, b), paper)| {
                        vec![
                            Cell::text(name),
                            Cell::text(format!("{}, {}", Property::ALL[a], Property::ALL[b])),
                            Cell::Number(c.ours[a][b], 3),
                            Cell::Number(paper, 3),
                            Cell::Number(c.ours[a][b] - paper, 3),
                        ]
                    })
            })
            .collect(),
    };
    let confused = Table {
        id: "most-confused",
        title: "The pairs that are hardest to tell apart: geometric mean of the degrees of confusion (eq. 7)".to_owned(),
        header: header(&["texture", "texture", "all nine", "the three most useful"]),
        rows: training
            .most_confused
            .iter()
            .map(|p| {
                vec![
                    Cell::text(format!("T{} {}", p.textures.0.number, p.textures.0.name)),
                    Cell::text(format!("T{} {}", p.textures.1.number, p.textures.1.name)),
                    Cell::single(p.all, 3),
                    Cell::single(p.most_useful, 3),
                ]
            })
            .collect(),
    };
    let skin = &training.skin;
    let effects = Table {
        id: "skin-wear",
        title: "What a worn skin changes, in standard deviations of the trials of a texture (mean over ten textures)".to_owned(),
        header: header(&["ridges lost, %", "movement", "traction", "roughness", "fineness"]),
        rows: skin
            .effects
            .iter()
            .map(|e| {
                let mut row = vec![Cell::Number(e.wear, 0), Cell::text(&names[e.movement])];
                row.extend(e.shift.map(|s| Cell::Number(s, 2)));
                row
            })
            .collect(),
    };
    let files = Table {
        id: "tables-of-the-chip",
        title: "The tables that were learned, as files in the chip's format".to_owned(),
        header: header(&["file", "contents", "bytes", "CRC-32"]),
        rows: training
            .tables
            .iter()
            .map(|t| {
                vec![
                    Cell::text(&t.file),
                    Cell::text(&t.contents),
                    Cell::Number(t.bytes as f64, 0),
                    Cell::text(&t.crc),
                ]
            })
            .collect(),
    };
    let changes: Vec<String> = skin
        .changed_before
        .iter()
        .map(|t| format!("T{}", t.number))
        .collect();
    let when = match changes.as_slice() {
        [] => "never".to_owned(),
        before => format!("before {}", before.join(", ")),
    };
    let (all, useful) = training.pairs_confused;
    let mut blocks = vec![
        text(format!(
            "117 textures, three movements, five slides each: {} slides by one finger, texture after texture.",
            training.textures.len() * training.movements.len() * 5
        )),
        Block::Figure(
            fig8(training)?,
            "Fig. 8: the properties of all textures at the most useful movements, all five slides.".to_owned(),
        ),
        Block::Table(correlations),
        text(format!(
            "What two movements say of one property goes together over the textures: correlations of {:.2} (traction), {:.2} \
(roughness) and {:.2} (fineness), mean over the pairs of movements. The paper does not give these.",
            training.between_movements[0], training.between_movements[1], training.between_movements[2]
        )),
        Block::Figure(
            fig9(training)?,
            format!(
                "Fig. 9: degrees of confusion, for each movement and property, and geometric means. White is below {}, black \
{} and more. Over one half by the geometric mean of all nine: {all} of the 6786 pairs; by that of the three most useful: {useful}. \
In the paper, too, the three leave more dark spots than the nine.",
                SHADES[0], SHADES[4]
            ),
        ),
        Block::Table(confused),
        text(format!(
            "The skin was changed {} times ({when}), each time that {:.0} % of its ridges were gone; the paper changed it {} \
times, at any visible sign of wear.",
            changes.len(),
            skin.changed_at,
            skin.paper_changes
        )),
        Block::Figure(
            skin_figures(training)?,
            "Wear of the skin during the training, and what wear does to roughness: with fewer ridges vibrations are weaker. The \
dashed line is where the skin is changed."
                .to_owned(),
        ),
        Block::Table(effects),
        Block::Table(files),
    ];
    blocks.push(Block::File(trained_table(training)));
    blocks.extend(training.confusion.iter().map(|c| {
        let title = format!(
            "Degrees of confusion by {} at {}",
            c.property, names[c.movement]
        );
        Block::File(matrix_table(
            confusion_id(c.movement, c.property),
            title,
            &c.matrix,
        ))
    }));
    blocks.push(Block::File(matrix_table(
        "confusion-geometric-mean",
        "Their geometric mean".to_owned(),
        &training.geometric_mean,
    )));
    blocks.push(Block::File(matrix_table(
        "confusion-geometric-mean-most-useful",
        "Geometric mean of the three most useful".to_owned(),
        &training.geometric_mean_most_useful,
    )));
    Ok(Section {
        id: "training",
        title: "Training: 117 textures".to_owned(),
        blocks,
    })
}

/// Names of the files of the nine matrices.
fn confusion_id(movement: usize, property: Property) -> &'static str {
    const IDS: [[&str; 3]; 3] = [
        [
            "confusion-1-traction",
            "confusion-1-roughness",
            "confusion-1-fineness",
        ],
        [
            "confusion-2-traction",
            "confusion-2-roughness",
            "confusion-2-fineness",
        ],
        [
            "confusion-3-traction",
            "confusion-3-roughness",
            "confusion-3-fineness",
        ],
    ];
    IDS[movement][property.index()]
}

fn matrix_table(id: &'static str, title: String, of: &[Vec<f32>]) -> Table {
    Table {
        id,
        title,
        header: (1..=of.len()).map(|n| format!("T{n}")).collect(),
        rows: of
            .iter()
            .map(|row| row.iter().map(|&c| Cell::single(c, 3)).collect())
            .collect(),
    }
}

fn trained_table(training: &Training) -> Table {
    let mut names = header(&["texture", "name"]);
    for m in 1..=training.movements.len() {
        for property in Property::ALL {
            names.extend([format!("{property} {m} mean"), format!("{property} {m} sd")]);
        }
    }
    names.extend(header(&["ridges lost before, %", "after, %", "new skin"]));
    Table {
        id: "trained-properties",
        title: "Mean and standard deviation of every texture, movement and property, as the chip's table has them".to_owned(),
        header: names,
        rows: training
            .textures
            .iter()
            .map(|t| {
                let mut row = vec![Cell::Number(t.texture.number.into(), 0), Cell::text(t.texture.name)];
                for (mean, sd) in t.gaussians.iter().flatten() {
                    row.extend([Cell::single(*mean, 4), Cell::single(*sd, 4)]);
                }
                row.extend([
                    Cell::Number(t.wear.0, 2),
                    Cell::Number(t.wear.1, 2),
                    Cell::text(if t.new_skin { "yes" } else { "no" }),
                ]);
                row
            })
            .collect(),
    }
}

fn fig8(training: &Training) -> Drawn<Vec<Figure>> {
    let of = |&(movement, property): &(Movement, Property)| {
        let pair = (movement.force_n(), movement.speed_mm_s());
        let at = training
            .movements
            .iter()
            .position(|&m| m == pair)
            .unwrap_or(0);
        let values: Vec<(f64, f64)> = training
            .textures
            .iter()
            .flat_map(|t| {
                let trials = t.properties[at].iter();
                trials.map(|p| (f64::from(t.texture.number), f64::from(p[property.index()])))
            })
            .collect();
        let title = format!("{property} at {}", movement_name(pair));
        let svg = chart(&Chart {
            title: title.clone(),
            x: "number of the texture (Table 1)",
            y: axis(property),
            x_range: (0.0, 118.0),
            y_range: room(values.iter().map(|v| v.1)),
            x_marks: 7,
            x_text: &plain,
            named_at_end: false,
            size: (480, 300),
            series: vec![points(0, Mark::Circle, "", values)],
        })?;
        Ok(figure(format!("fig8-{property}"), title, svg))
    };
    published::MOST_USEFUL.iter().map(of).collect()
}

fn fig9(training: &Training) -> Drawn<Vec<Figure>> {
    let axis = "number of the texture (Table 1)";
    let mut panels = Vec::new();
    for c in &training.confusion {
        let movement = movement_name(training.movements[c.movement]);
        let title = format!("{}, {movement}", c.property);
        let svg = matrix(&title, axis, &c.matrix)?;
        panels.push(figure(
            format!("fig9-{}-{}", c.movement + 1, c.property),
            format!("Degrees of confusion by {title}"),
            svg,
        ));
    }
    for (id, title, of) in [
        (
            "fig9-all",
            "geometric mean of all nine",
            &training.geometric_mean,
        ),
        (
            "fig9-most-useful",
            "geometric mean of the three most useful",
            &training.geometric_mean_most_useful,
        ),
    ] {
        panels.push(figure(id, title, matrix(title, axis, of)?));
    }
    Ok(panels)
}

fn skin_figures(training: &Training) -> Drawn<Vec<Figure>> {
    let mut wear = Vec::new();
    for t in &training.textures {
        let x = f64::from(t.texture.number);
        wear.extend([(x - 1.0, t.wear.0), (x, t.wear.1)]);
    }
    let limit = training.skin.changed_at;
    let line = Series {
        name: "changed".to_owned(),
        colour: GREY,
        mark: Mark::None,
        line: Some(Line::Dashed),
        points: vec![(0.0, limit), (117.0, limit)],
    };
    let title = "Wear of the skin during the training";
    let worn = chart(&Chart {
        title: title.to_owned(),
        x: "textures slid over",
        y: "ridges lost (%)",
        x_range: (0.0, 118.0),
        y_range: room(wear.iter().map(|w| w.1).chain([0.0, limit])),
        x_marks: 7,
        x_text: &plain,
        named_at_end: false,
        size: PANEL,
        series: vec![curve(0, Mark::None, "wear", wear), line],
    })?;
    let roughness = Property::Roughness.index();
    let marks = [Mark::Circle, Mark::Triangle, Mark::Square];
    let series: Vec<Series> = training
        .movements
        .iter()
        .enumerate()
        .map(|(m, &movement)| {
            let effects = training.skin.effects.iter().filter(|e| e.movement == m);
            let points = effects.map(|e| (e.wear, e.shift[roughness])).collect();
            curve(m, marks[m % marks.len()], &movement_name(movement), points)
        })
        .collect();
    let shift_title = "Change of roughness with wear";
    let (low, high) = room(series.iter().flat_map(|s| &s.points).map(|p| p.1));
    let shift = chart(&Chart {
        title: shift_title.to_owned(),
        x: "ridges lost (%)",
        y: "change (standard deviations)",
        x_range: (-4.0, 104.0),
        // room for the legend
        y_range: (low, high + 0.25 * (high - low)),
        x_marks: 6,
        x_text: &plain,
        named_at_end: false,
        size: PANEL,
        series,
    })?;
    Ok(vec![
        figure("skin-during-training", title, worn),
        figure("skin-and-roughness", shift_title, shift),
    ])
}

fn of_pairs(pairs: &[PairRow], simulations: u64) -> Section {
    let mean = |of: &dyn Fn(&PairRow) -> f64| {
        pairs.iter().map(of).sum::<f64>() / pairs.len().max(1) as f64
    };
    let mut rows: Vec<Vec<Cell>> = pairs
        .iter()
        .map(|p| {
            let name = |n: usize| format!("{} (T{})", p.textures[n].name, p.textures[n].number);
            vec![
                Cell::text(format!("{} vs. {}", name(0), name(1))),
                Cell::Number(p.paper[0], 1),
                Cell::Number(p.paper[1], 1),
                Cell::Number(p.correct, 1),
                Cell::Number(p.median, 1),
                Cell::Number(p.mean, 2),
            ]
        })
        .collect();
    rows.push(vec![
        Cell::text("Mean"),
        Cell::Number(mean(&|p| p.paper[0]), 1),
        Cell::Number(mean(&|p| p.paper[1]), 1),
        Cell::Number(mean(&|p| p.correct), 1),
        Cell::Empty,
        Cell::Number(mean(&|p| p.mean), 2),
    ]);
    Section {
        id: "pairs",
        title: "Pairs of similar textures".to_owned(),
        blocks: vec![
            text(format!(
                "{} simulations of each pair, of which the two textures are unknown in turn; the explorer knows that it is one \
of the two, and goes on until one is more probable than 99.9 %.",
                crate::study::identify::of_pair(simulations)
            )),
            Block::Table(Table {
                id: "table4-pairs",
                title: "Table 4: right answers".to_owned(),
                header: header(&[
                    "pair",
                    "people (paper), %",
                    "Bayesian exploration (paper), %",
                    "Bayesian exploration here, %",
                    "median movements here",
                    "mean movements here",
                ]),
                rows,
            }),
        ],
    }
}

/// What a way of exploring is called.
fn name(method: Method) -> &'static str {
    match method {
        Method::Cycle => "uninformed cycling",
        Method::Random => "random selection",
        Method::Paper => "Bayesian exploration",
        _ => "fused (not in the paper)",
    }
}

fn published_column(method: Method) -> Option<published::Column> {
    match method {
        Method::Cycle => Some(published::CYCLING),
        Method::Random => Some(published::RANDOM),
        Method::Paper => Some(published::BAYESIAN),
        _ => None,
    }
}

/// A way of exploring beside the paper's: two columns, or one.
fn table5(identification: &Identification) -> Table {
    let mut names = header(&["%"]);
    for method in METHODS {
        let paper = published_column(method).map(|_| format!("{}, paper", name(method)));
        names.extend(paper);
        names.push(format!("{}, here", name(method)));
    }
    type Of<'a> = (
        &'a dyn Fn(&published::Column) -> Cell,
        &'a dyn Fn(&Column) -> Cell,
    );
    let row = |what: String, (paper, ours): Of<'_>| {
        let mut row = vec![Cell::Text(what)];
        for (method, column) in METHODS.into_iter().zip(&identification.columns) {
            row.extend(published_column(method).map(|c| paper(&c)));
            row.push(ours(column));
        }
        row
    };
    let mut rows = vec![
        row(
            "correct identifications".to_owned(),
            (&|p| Cell::Number(p.correct, 1), &|c| {
                Cell::Number(c.correct, 1)
            }),
        ),
        row(
            "and converged".to_owned(),
            (&|p| Cell::Number(p.converged, 1), &|c| {
                Cell::Number(c.converged, 1)
            }),
        ),
        row(
            "wrong among the converged".to_owned(),
            (&|_| Cell::Empty, &|c| Cell::Number(c.wrong_when_sure, 1)),
        ),
        row(
            "median number of movements (11: more than half did not converge)".to_owned(),
            (&|p| Cell::text(p.median), &|c| Cell::Number(c.median, 1)),
        ),
        row(
            "mean number of movements".to_owned(),
            (&|_| Cell::Empty, &|c| Cell::Number(c.mean, 2)),
        ),
    ];
    for (at, texture) in identification.textures.iter().enumerate() {
        rows.push(row(
            format!("{} (T{})", texture.name, texture.number),
            (&|p| Cell::Number(p.textures[at], 1), &|c| {
                Cell::Number(c.textures.get(at).copied().unwrap_or(0.0), 1)
            }),
        ));
    }
    Table {
        id: "table5-identification",
        title: "Table 5: identification among 117 textures at 99 %".to_owned(),
        header: names,
        rows,
    }
}

fn of_identification(identification: &Identification) -> Drawn<Section> {
    let cycled: Vec<String> = identification
        .cycled
        .iter()
        .map(|&(movement, property)| {
            let movement = crate::sim::collection::Collection::MOVEMENTS[movement];
            format!("{property} at {movement}")
        })
        .collect();
    let mut blocks = vec![
        text(format!(
            "{} simulations of each way of exploring: one of 16 textures is unknown, in turn; each slide is one of the five new \
ones (validation, with a new skin) of that texture and movement. An exploration ends at 99 %, or after ten movements with the \
most probable texture. Cycling goes through {}.",
            identification.simulations,
            cycled.join("; ")
        )),
        Block::Table(table5(identification)),
    ];
    if let (Some(ours), Some(random), Some(bayesian)) = (
        identification.column(Method::Cycle),
        identification.column(Method::Random),
        identification.column(Method::Paper),
    ) {
        blocks.push(text(format!(
            "Against the paper: Bayesian exploration {:+.1} points, random {:+.1}, cycling {:+.1}.",
            bayesian.correct - published::BAYESIAN.correct,
            random.correct - published::RANDOM.correct,
            ours.correct - published::CYCLING.correct
        )));
    }
    let panels = identification
        .evolutions
        .iter()
        .enumerate()
        .map(|(n, e)| fig10(n, e));
    blocks.push(Block::Figure(
        panels.collect::<Drawn<_>>()?,
        "Fig. 10: how the probabilities evolve, one exploration in each panel. Below each step, the movement (M1: 1.26 N, \
10 mm/s; M2: 0.50 N, 25.1 mm/s; M3: 0.20 N, 63.1 mm/s) and what was looked at (T traction, R roughness, F fineness). Dashed: \
the 99 % that end it."
            .to_owned(),
    ));
    Ok(Section {
        id: "identification",
        title: "Identification among 117 textures".to_owned(),
        blocks,
    })
}

fn fig10(n: usize, evolution: &Evolution) -> Drawn<Figure> {
    let steps = evolution.steps.len() as f64;
    let step = |x: f64| {
        let at = x.round() as usize;
        match evolution.steps.get(at.wrapping_sub(1)) {
            Some((movement, property)) => {
                let property = property.name()[..1].to_uppercase();
                format!("M{} {property}", movement + 1)
            }
            None => String::new(),
        }
    };
    let marks = [Mark::Circle, Mark::Triangle, Mark::Square, Mark::Cross];
    // the unknown one first: it keeps its colour in all panels
    let (unknown, others): (Vec<_>, Vec<_>) = evolution
        .probabilities
        .iter()
        .partition(|(texture, _)| *texture == evolution.unknown);
    let mut series: Vec<Series> = unknown
        .into_iter()
        .chain(others)
        .enumerate()
        .map(|(n, (texture, probabilities))| {
            let points = (0..)
                .map(f64::from)
                .zip(probabilities.iter().map(|&p| p.into()));
            let name = format!("T{}", texture.number);
            curve(n, marks[n % marks.len()], &name, points.collect())
        })
        .collect();
    series.push(Series {
        name: String::new(),
        colour: GREY,
        mark: Mark::None,
        line: Some(Line::Dashed),
        points: vec![(0.0, 0.99), (steps, 0.99)],
    });
    let title = format!(
        "T{} {}: {}",
        evolution.unknown.number, evolution.unknown.name, evolution.example
    );
    let svg = chart(&Chart {
        title: title.clone(),
        x: "movement and property",
        y: "probability",
        x_range: (-0.2, steps + 0.2),
        y_range: (0.0, 1.04),
        x_marks: evolution.steps.len() + 1,
        x_text: &step,
        named_at_end: true,
        size: (520, 320),
        series,
    })?;
    let told = format!(
        "{title}; the answer was T{} {}",
        evolution.identified.number, evolution.identified.name
    );
    Ok(figure(format!("fig10-{}", n + 1), told, svg))
}

fn of_signals(signals: &Signals) -> Drawn<Section> {
    let press = &signals.press;
    let both = press.loading.iter().chain(&press.unloading);
    let end = both.clone().map(|p| p.0).fold(0.0, f64::max);
    let line_end = 2.0 / (press.mn_per_count * 1e-3);
    let title = "Force against P_DC";
    let fig3 = chart(&Chart {
        title: title.to_owned(),
        x: "change of P_DC (counts)",
        y: "normal force (N)",
        x_range: (-0.02 * end, 1.05 * end),
        y_range: room(both.map(|p| p.1).chain([0.0])),
        x_marks: 6,
        x_text: &plain,
        named_at_end: false,
        size: PANEL,
        series: vec![
            points(0, Mark::Circle, "loading", press.loading.clone()),
            points(4, Mark::Cross, "unloading", press.unloading.clone()),
            Series {
                name: "line below 2 N".to_owned(),
                colour: COLOURS[1],
                mark: Mark::None,
                line: Some(Line::Whole),
                points: vec![(0.0, 0.0), (line_end, 2.0)],
            },
        ],
    })?;
    let line = Table {
        id: "fig3-line",
        title: "Fig. 3: force against P_DC below 2 N".to_owned(),
        header: header(&["", "here", "paper"]),
        rows: vec![
            vec![
                Cell::text("slope, mN a count"),
                Cell::Number(press.mn_per_count, 2),
                Cell::single(PAPER_LINE.0, 1),
            ],
            vec![
                Cell::text("R\u{b2}"),
                Cell::Number(press.r_squared, 4),
                Cell::Number(PAPER_LINE.1, 3),
            ],
        ],
    };
    let mut panels = Vec::new();
    for example in &signals.slides {
        let texture = &example.texture;
        let second = |n: usize| example.from_s + n as f64 / 2200.0;
        let trace = |signal: &[f64]| {
            (0..)
                .map(second)
                .zip(signal.iter().copied())
                .collect::<Vec<_>>()
        };
        let (raw, filtered) = (trace(&example.pac_pa), trace(&example.filtered_pa));
        let title = format!("T{} {}: P_AC, and filtered", texture.number, texture.name);
        let svg = chart(&Chart {
            title: title.clone(),
            x: "time from the begin of the slide (s)",
            y: "dynamic pressure (Pa)",
            x_range: (second(0), second(example.pac_pa.len())),
            y_range: room(example.pac_pa.iter().chain(&example.filtered_pa).copied()),
            x_marks: 6,
            x_text: &plain,
            named_at_end: false,
            size: PANEL,
            series: vec![
                curve(4, Mark::None, "P_AC", raw),
                curve(1, Mark::None, "20\u{2013}700 Hz", filtered),
            ],
        })?;
        panels.push(figure(
            format!("fig4-signal-T{}", texture.number),
            title,
            svg,
        ));
        let bins = (0..).map(|k| f64::from(k) * f64::from(example.bin_hz));
        let spectrum: Vec<(f64, f64)> = bins
            .zip(example.spectrum_pa2.iter().map(|p| (p + 1e-4).log10()))
            .collect();
        let range = room(spectrum.iter().map(|p| p.1));
        let centroid = f64::from(example.centroid_hz);
        let title = format!("T{} {}: spectrum", texture.number, texture.name);
        let svg = chart(&Chart {
            title: title.clone(),
            x: "frequency (Hz)",
            y: "power per bin (log of Pa\u{b2})",
            x_range: (0.0, 1100.0),
            y_range: range,
            x_marks: 6,
            x_text: &plain,
            named_at_end: false,
            size: PANEL,
            series: vec![
                curve(0, Mark::None, "", spectrum),
                Series {
                    name: format!("centroid {centroid:.0} Hz"),
                    colour: COLOURS[1],
                    mark: Mark::None,
                    line: Some(Line::Dashed),
                    points: vec![(centroid, range.0), (centroid, range.1)],
                },
            ],
        })?;
        panels.push(figure(
            format!("fig4-spectrum-T{}", texture.number),
            title,
            svg,
        ));
        let shear: Vec<(f64, f64)> = (0..)
            .map(|n| example.steady_from_s + 0.02 * f64::from(n))
            .zip(example.shear_n.iter().copied())
            .collect();
        let title = format!("T{} {}: traction", texture.number, texture.name);
        let svg = chart(&Chart {
            title: title.clone(),
            x: "time from the begin of the slide (s)",
            y: "traction (N)",
            x_range: room(shear.iter().map(|p| p.0)),
            y_range: (0.0, 1.2 * shear.iter().map(|p| p.1).fold(0.0, f64::max)),
            x_marks: 6,
            x_text: &plain,
            named_at_end: false,
            size: PANEL,
            series: vec![curve(2, Mark::None, "", shear)],
        })?;
        panels.push(figure(
            format!("fig4-traction-T{}", texture.number),
            title,
            svg,
        ));
    }
    Ok(Section {
        id: "signals",
        title: "What the sensor says".to_owned(),
        blocks: vec![
            Block::Figure(
                vec![figure("fig3", title, fig3)],
                "Fig. 3: a press on a hard plate at 0.5 mm/s and back, P_DC as the firmware's decoder reads it. Over 2 N the skin \
touches the core."
                    .to_owned(),
            ),
            Block::Table(line),
            Block::Figure(
                panels,
                "Fig. 4: slides at 0.50 N and 25.1 mm/s: P_AC before and behind the band-pass, its averaged spectrum, and traction \
from motor current (mean of 20 ms)."
                    .to_owned(),
            ),
        ],
    })
}

fn of_worlds(worlds: &[WorldRow]) -> Drawn<Section> {
    let mut rows: Vec<Vec<Cell>> = worlds
        .iter()
        .map(|world| {
            let mut row = vec![Cell::text(world.seed)];
            for c in &world.columns {
                row.extend([
                    Cell::Number(c.correct, 1),
                    Cell::Number(c.converged, 1),
                    Cell::Number(c.median, 1),
                ]);
            }
            row.push(Cell::Number(world.pairs, 1));
            row
        })
        .collect();
    let mean =
        |of: &dyn Fn(&WorldRow) -> f64| worlds.iter().map(of).sum::<f64>() / worlds.len() as f64;
    let mut last = vec![Cell::text("mean")];
    for n in 0..METHODS.len() {
        last.extend([
            Cell::Number(mean(&|w| w.columns[n].correct), 2),
            Cell::Number(mean(&|w| w.columns[n].converged), 2),
            Cell::Number(mean(&|w| w.columns[n].median), 1),
        ]);
    }
    last.push(Cell::Number(mean(&|w| w.pairs), 2));
    rows.push(last);
    let mut names = header(&["world"]);
    for method in METHODS {
        names.extend(
            ["correct, %", "and converged, %", "median movements"]
                .map(|n| format!("{}: {n}", name(method))),
        );
    }
    names.push("pairs, %".to_owned());
    let marks = [Mark::Square, Mark::Triangle, Mark::Circle, Mark::Cross];
    let series: Vec<Series> = METHODS
        .into_iter()
        .enumerate()
        .map(|(n, method)| {
            let at = (1..).map(f64::from);
            let points = at
                .zip(worlds.iter().map(|w| w.columns[n].correct))
                .collect();
            curve([3, 2, 0, 1][n], marks[n], short(method), points)
        })
        .collect();
    let (low, high) = room(series.iter().flat_map(|s| &s.points).map(|p| p.1));
    let seed = |x: f64| {
        let world = worlds.get((x.round() as usize).wrapping_sub(1));
        world.map_or_else(String::new, |w| w.seed.to_string())
    };
    let title = "Right answers by world";
    let svg = chart(&Chart {
        title: title.to_owned(),
        x: "world (seed)",
        y: "correct identifications (%)",
        x_range: (0.7, worlds.len() as f64 + 0.3),
        y_range: (low, high),
        x_marks: worlds.len().min(20),
        x_text: &seed,
        named_at_end: true,
        size: (600, 360),
        series,
    })?;
    Ok(Section {
        id: "worlds",
        title: "Several worlds".to_owned(),
        blocks: vec![
            text(
                "Each seed is another collection of 117 textures, another finger and rig. What was asked of the study, and what \
came out:",
            ),
            Block::Table(demands(worlds)),
            Block::Figure(
                vec![figure("worlds", title, svg)],
                "Right answers of each way of exploring in each world.".to_owned(),
            ),
            Block::Table(Table {
                id: "worlds",
                title: "World by world".to_owned(),
                header: names,
                rows,
            }),
        ],
    })
}

fn short(method: Method) -> &'static str {
    match method {
        Method::Cycle => "cycling",
        Method::Random => "random",
        Method::Paper => "Bayesian",
        _ => "fused",
    }
}

/// What the study is to show over ten worlds, and whether it does.
fn demands(worlds: &[WorldRow]) -> Table {
    let n = worlds.len();
    let mean = |of: &dyn Fn(&WorldRow) -> f64| worlds.iter().map(of).sum::<f64>() / n as f64;
    let column = |world: &WorldRow, method: Method, of: fn(&Column) -> f64| {
        let at = METHODS.iter().position(|m| *m == method);
        at.and_then(|at| world.columns.get(at)).map_or(0.0, of)
    };
    let most = (9 * n).div_ceil(10);
    let mut rows = Vec::new();
    let mut demand = |what: &str, wanted: String, found: String, met: bool| {
        let met = if met { "met" } else { "missed" };
        rows.push([what, &wanted, &found, met].map(Cell::text).to_vec());
    };
    let correct: fn(&Column) -> f64 = |c| c.correct;
    let converged: fn(&Column) -> f64 = |c| c.converged;
    let bayesian = mean(&|w| column(w, Method::Paper, correct));
    demand(
        "Bayesian exploration, correct",
        "within 2 points of 95.4 %".to_owned(),
        format!("{bayesian:.2} %"),
        (bayesian - published::BAYESIAN.correct).abs() <= 2.0,
    );
    for (what, of) in [("correct", correct), ("correct and converged", converged)] {
        for (less, more) in [
            (Method::Cycle, Method::Random),
            (Method::Random, Method::Paper),
        ] {
            let [a, b] = [less, more].map(|method| mean(&|w| column(w, method, of)));
            let worlds = worlds.iter();
            let count = worlds
                .filter(|w| column(w, less, of) < column(w, more, of))
                .count();
            demand(
                &format!("{what}: {} below {}", short(less), short(more)),
                format!("on average, and in {most} of {n} worlds"),
                format!("{a:.1} % and {b:.1} %; in {count} of {n}"),
                a < b && count >= most,
            );
        }
    }
    let median = worlds
        .iter()
        .map(|w| column(w, Method::Paper, |c| c.median))
        .fold(0.0, f64::max);
    demand(
        "Bayesian exploration, median movements",
        "at most 6".to_owned(),
        format!("at most {median}"),
        median <= 6.0,
    );
    let pairs = mean(&|w| w.pairs);
    demand(
        "pairs, mean",
        "at least 97 %".to_owned(),
        format!("{pairs:.2} %"),
        pairs >= 97.0,
    );
    let fused = mean(&|w| column(w, Method::Fused, correct));
    let fused_median = worlds
        .iter()
        .map(|w| column(w, Method::Fused, |c| c.median))
        .fold(0.0, f64::max);
    demand(
        "fused",
        "at least 99 %, median at most 2".to_owned(),
        format!("{fused:.2} %, median at most {fused_median}"),
        fused >= 99.0 && fused_median <= 2.0,
    );
    Table {
        id: "demands",
        title: format!("What was asked of {n} worlds"),
        header: header(&["what", "asked", "found", ""]),
        rows,
    }
}
