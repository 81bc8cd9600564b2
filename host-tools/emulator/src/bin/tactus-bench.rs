//! `cargo xtask bench` asks this program what the kernels cost: it gives the bench image its work, reads the instructions that
//! it counted, and does the same with the plain kernels on this PC.

#[path = "../../../../firmware/src/workload.rs"]
pub mod workload;

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context as _, bail, ensure};
use clap::{Parser, ValueEnum};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};
use tactus::learn;
use tactus::recordings::{PAC_RATE_HZ, RecordingSet};
use tactus::study::report;
use tactus_core::explorer::{Config, Explorer, Method, Strategy};
use tactus_core::features::{Plan, Properties, Property, PropertySet};
use tactus_core::fused::{FeatureSet, MAX_FEATURES, Observation};
use tactus_core::kernels::Plain;
use tactus_core::movement::Movement;
use tactus_core::rig::lever::RETRACT_STEPS_S;
use tactus_core::table::{Action, Contents, Table};
use tactus_core::wire::{Ask, Identify, Phase, Tell};
use tactus_emulator::talk::Talk;
use tactus_emulator::{Emulator, Options, Output, Setup, cycles};
use workload::{Counter, Felt, Workload};

/// Counts the instructions of the core's kernels on the emulated chip
#[derive(Parser)]
struct Cli {
    /// The bench image
    elf: PathBuf,
    /// The rig's image, whose acquisition, load and latency are measured during a slide
    #[arg(long)]
    rig: Option<PathBuf>,
    /// For people, or JSON for programs
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    /// Tell on stderr which functions each kernel spends its instructions in
    #[arg(long)]
    profile: bool,
    /// Tell how table and decision grow with the number of textures instead
    #[arg(long)]
    growth: bool,
    /// With --growth, draw that as SVG, too
    #[arg(long, value_name = "FILE", requires = "growth")]
    plot: Option<PathBuf>,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    Text,
    Json,
}

/// Samples of a slide of 3 s.
const SLIDE: usize = 6600;
/// Textures of the paper, and of the table that comes with the firmware.
const TEXTURES: usize = 117;
/// Less probable textures are left out of a choice: the core's own limit.
const NEGLIGIBLE: f32 = 1e-6;
/// Exit code when gates are missed and every result is right. `cargo xtask test` knows it.
const MISSED: u8 = 2;

fn main() -> ExitCode {
    match run(&Cli::parse()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(MISSED),
        Err(why) => {
            eprintln!("error: {why:#}");
            ExitCode::FAILURE
        }
    }
}

/// A kernel and what it is held against, all per unit.
struct Row {
    kernel: String,
    unit: &'static str,
    instructions: f64,
    cycles: Option<f64>,
    gate: Option<f64>,
    /// CMSIS-DSP in an expert's hands, and the floor of the instruction set (facts/performance.md).
    cmsis: Option<f64>,
    floor: Option<f64>,
    /// The chip's result is the plain kernels' to the bit.
    equal: bool,
}

impl Row {
    fn ok(&self) -> bool {
        self.equal && self.gate.is_none_or(|gate| self.instructions <= gate)
    }
}

fn run(cli: &Cli) -> anyhow::Result<bool> {
    let mut bench = Bench::start(cli)?;
    if cli.growth {
        return growth(&mut bench, cli.plot.as_deref());
    }
    let model = std::mem::take(&mut bench.model);
    corners(&mut bench)?;
    bench.model = model;
    let mut rows = rows(&mut bench)?;
    if let Some(rig) = &cli.rig {
        rows.extend(on_the_rig(rig)?);
    }
    match cli.format {
        Format::Text => print(&rows, bench.source),
        Format::Json => println!("{}", Value::from_iter(rows.iter().map(json))),
    }
    let different: Vec<_> = rows.iter().filter(|row| !row.equal).collect();
    for row in &different {
        eprintln!("error: {}: not what the plain kernels give", row.kernel);
    }
    ensure!(different.is_empty(), "the chip's kernels are wrong");
    Ok(rows.iter().all(Row::ok))
}

fn json(row: &Row) -> Value {
    json!({
        "kernel": row.kernel,
        "unit": row.unit,
        "instructions": row.instructions,
        "gate": row.gate,
        "ok": row.ok(),
    })
}

fn print(rows: &[Row], source: &str) {
    let number = |number: Option<f64>| match number {
        None => "-".into(),
        Some(n) if n < 1000.0 => format!("{n:.1}"),
        Some(n) => format!("{n:.0}"),
    };
    println!(
        "{:48} {:16} {:>12} {:>9} {:>9} {:>9} {:>6}  {:>9}",
        "kernel", "unit", "instructions", "cycles", "CMSIS", "floor", "ratio", "gate"
    );
    for row in rows {
        let ratio = row.floor.or(row.cmsis).map(|to| row.instructions / to);
        let verdict = match (row.gate, row.equal) {
            (_, false) => "  DIFFERS from the plain kernels",
            (None, true) => "",
            (Some(_), true) if row.ok() => "  ok",
            (Some(_), true) => "  MISSED",
        };
        println!(
            "{:48} {:16} {:>12} {:>9} {:>9} {:>9} {:>6}  {:>9}{verdict}",
            row.kernel,
            row.unit,
            number(Some(row.instructions)),
            number(row.cycles),
            number(row.cmsis),
            number(row.floor),
            ratio.map_or("-".into(), |ratio| format!("{ratio:.2}")),
            number(row.gate),
        );
    }
    println!(
        "\nInstructions by the core's counter on the emulated board; the slide is {source}; results compared with the plain\n\
         kernels on this PC, to the bit. Ratio: to the floor where one is known, else to CMSIS-DSP. Cycles are a model."
    );
}

fn rows(bench: &mut Bench) -> anyhow::Result<Vec<Row>> {
    let mut rows = Vec::new();
    let mut count = |kernel: &str,
                     unit: &'static str,
                     units: usize,
                     gate: Option<f64>,
                     cmsis: Option<f64>,
                     floor: Option<f64>,
                     workload: Workload,
                     table: &[u8],
                     words: &[i16]|
     -> anyhow::Result<()> {
        let counted = bench
            .count(workload, table, words)
            .with_context(|| kernel.to_owned())?;
        if bench.profile {
            bench.tell_profile(kernel);
        }
        let units = units as f64;
        rows.push(Row {
            kernel: kernel.into(),
            unit,
            instructions: counted.instructions as f64 / units,
            cycles: counted.cycles.map(|cycles| cycles / units),
            gate,
            cmsis,
            floor,
            equal: counted.equal,
        });
        Ok(())
    };
    let slide = slide()?;
    let samples = slide.0.as_slice();
    let none: &[u8] = &[];
    count(
        "band-pass FIR with mean power",
        "sample",
        SLIDE,
        Some(60.0),
        Some(96.5 + 1.8),
        Some(45.0),
        Workload::BandPower,
        none,
        samples,
    )?;
    count(
        "window, FFT, power accumulated",
        "512 points",
        1,
        Some(24_000.0),
        Some(2.0 * 14_162.0),
        None,
        Workload::Frame,
        none,
        samples,
    )?;
    count(
        "all features of a slide",
        "slide of 3 s",
        1,
        Some(1_100_000.0),
        Some(1_650_000.0),
        None,
        Workload::Slide,
        none,
        samples,
    )?;
    let factory =
        std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../firmware/factory.tact"))
            .context("firmware/factory.tact")?;
    let paper = synthetic(Method::Paper, TEXTURES)?;
    for (name, table, method, gates) in [
        (
            "paper",
            &paper,
            Method::Paper,
            [2500.0, 2000.0, 450_000.0, 500_000.0],
        ),
        (
            "fused",
            &factory,
            Method::Fused,
            [12_000.0, 2000.0, 250_000.0, 300_000.0],
        ),
    ] {
        let [posterior, first, choice, decision] = gates;
        let is_paper = method == Method::Paper;
        let felt = felt(table, method, 50)?;
        count(
            &format!("posterior, {name}"),
            "117 textures",
            1,
            Some(posterior),
            is_paper.then_some(23_412.0),
            None,
            Workload::Observe,
            table,
            &felt.words,
        )?;
        count(
            &format!("first choice, {name}"),
            "choice",
            1,
            Some(first),
            None,
            None,
            Workload::FirstChoice,
            table,
            &felt.words,
        )?;
        count(
            &format!("choice among {} live textures, {name}", felt.live),
            "choice",
            1,
            Some(choice),
            is_paper.then_some(251_000.0),
            is_paper.then_some(154_000.0),
            Workload::Choice,
            table,
            &felt.words,
        )?;
        if !is_paper {
            let fewer = self::felt(table, method, 20)?;
            count(
                &format!("choice among {} live textures, {name}", fewer.live),
                "choice",
                1,
                Some(45_000.0),
                None,
                None,
                Workload::Choice,
                table,
                &fewer.words,
            )?;
        }
        let words = [&felt.words[..], &samples[..SLIDE]].concat();
        count(
            &format!("last sample to decision, {name}"),
            "decision",
            1,
            Some(decision),
            None,
            None,
            Workload::Decision,
            table,
            &words,
        )?;
        count(
            &format!("an explorer begins, {name}"),
            "exploration",
            1,
            None,
            None,
            None,
            Workload::Begin,
            table,
            &felt.words,
        )?;
    }
    bench.source = slide.1;
    Ok(rows)
}

/// Table bytes, and instructions of a fused decision of three movements after a typical slide.
fn growth(bench: &mut Bench, plot: Option<&Path>) -> anyhow::Result<bool> {
    bench.model = false;
    println!(
        "{:>8} {:>12} {:>12} {:>6} {:>12}",
        "textures", "table bytes", "posterior", "live", "choice"
    );
    let mut equal = true;
    let mut curves = [
        "table, KB",
        "posterior, thousands of instructions",
        "choice among up to 50 live, thousands",
    ]
    .map(|name| (name, Vec::new()));
    for textures in [20, 117, 500, workload::MOST_ROOM, 2000] {
        let table = synthetic(Method::Fused, textures)?;
        curves[0]
            .1
            .push((textures as f64, table.len() as f64 / 1024.0));
        if textures > workload::MOST_ROOM {
            println!(
                "{textures:>8} {:>12}   more than the chip's RAM has room for",
                table.len()
            );
            continue;
        }
        let felt = felt(&table, Method::Fused, textures.min(50))?;
        let posterior = bench.count(Workload::Observe, &table, &felt.words)?;
        let choice = bench.count(Workload::Choice, &table, &felt.words)?;
        equal &= posterior.equal && choice.equal;
        println!(
            "{textures:>8} {:>12} {:>12} {:>6} {:>12}",
            table.len(),
            posterior.instructions,
            felt.live,
            choice.instructions
        );
        let counts = [posterior, choice].map(|counted| counted.instructions as f64 * 1e-3);
        for ((_, points), y) in curves.iter_mut().skip(1).zip(counts) {
            points.push((textures as f64, y));
        }
    }
    if let Some(file) = plot {
        let title = "A fused decision after a slide, three movements";
        let svg = report::curves(title, "textures of the table", "", &curves)?;
        std::fs::write(file, svg).with_context(|| format!("cannot write {}", file.display()))?;
    }
    ensure!(equal, "the chip's kernels are wrong");
    Ok(true)
}

/// Longest that the rig takes for anything, virtual seconds.
const PATIENCE_S: f64 = 120.0;
const CORE_HZ: f64 = 168e6;

/// The last sample is up to a tick of 1 ms old when the servo has the lever step up, and the first step comes a period of its rate
/// later.
const BEFORE_STEP_NS: u64 = 1_000_000 + 1_000_000_000 / RETRACT_STEPS_S.unsigned_abs() as u64;

/// When the lever's driver got its first step since the slide began: the end of the slide, as the pins show it.
fn first_step_up(board: &mut Emulator, since_ns: u64) -> Option<u64> {
    let rig = board.rig();
    rig.trace().find_map(|&(at_ns, output)| {
        (output == Output::LeverStep(true) && at_ns > since_ns).then_some(at_ns)
    })
}

/// Load and latency of the rig's image while it makes a slide.
fn on_the_rig(elf: &Path) -> anyhow::Result<Vec<Row>> {
    let options = Options {
        trace_s: 2,
        ..Options::default()
    };
    let emulator = Emulator::start(elf, Setup::default(), options)?;
    let handlers = ["TIM2", "UART4"].map(|name| emulator.symbol(name).map(|(address, _)| address));
    let handlers = handlers.into_iter().collect::<Result<Vec<_>, _>>()?;
    let mut talk = Talk::new(emulator);
    talk.ready(|_, _| ())?;
    let identify = Identify {
        among: Default::default(),
        threshold: 1.0,
        max_slides: 1,
        method: None,
        strategy: Strategy::Bayesian,
        open: false,
        learn: false,
        seed: 1,
    };
    // times in ns and instructions so far
    let (mut begun, mut over, mut told) = (None, None, None);
    let mut lifts_ns = None;
    let mut failed = None;
    talk.ask(Ask::Identify(identify), PATIENCE_S, |board, report| {
        let mut now = |board: &mut Emulator| {
            let instructions = board.instructions();
            let instructions = instructions.map_err(|why| failed = Some(why)).unwrap_or(0);
            Some((board.now_ns(), instructions))
        };
        match report.map(|report| &report.tell) {
            Some(Tell::Phase(Phase::Sliding)) if begun.is_none() => {
                begun = now(board);
                let counted = board.count_handlers(handlers.clone());
                failed = counted.err();
            }
            Some(Tell::Phase(Phase::Lifting)) if over.is_none() => over = now(board),
            Some(Tell::Verdict { .. }) => {
                told = now(board);
                lifts_ns = begun.and_then(|(from_ns, _)| first_step_up(board, from_ns));
            }
            _ => {}
        }
    })?;
    if let Some(why) = failed {
        return Err(why.into());
    }
    let spent = talk.board().handlers()?;
    let [timer, executor] = spent[..] else {
        bail!("the handlers were not counted");
    };
    let begun = begun.context("the rig says nothing of a slide")?;
    let over = over.context("the slide does not end")?;
    let (told_ns, _) = told.context("there is no verdict")?;
    let lifts_ns = lifts_ns.context("the finger is not lifted before the verdict")?;
    // the timer's update and its compare
    let slots = timer.runs as f64 / 2.0;
    let seconds = (over.0 - begun.0) as f64 * 1e-9;
    let busy = (over.1 - begun.1) as f64 / (seconds * CORE_HZ);
    let row = |kernel: &str, unit, measured, gate| Row {
        kernel: kernel.into(),
        unit,
        instructions: measured,
        cycles: None,
        gate: Some(gate),
        cmsis: None,
        floor: None,
        equal: true,
    };
    let slot = (timer.instructions + executor.instructions) as f64 / slots;
    Ok(vec![
        row("acquisition, bus waiting included", "slot", slot, 2500.0),
        row(
            "core busy during a slide",
            "% at 168 MHz",
            100.0 * busy,
            10.0,
        ),
        row(
            "last sample to the verdict on the link",
            "ms",
            (told_ns + BEFORE_STEP_NS - lifts_ns) as f64 * 1e-6,
            5.0,
        ),
    ])
}

/// 3 s of a slide of a real finger, or of a synthetic one where there are no recordings; and which.
fn slide() -> anyhow::Result<(Vec<i16>, &'static str)> {
    let root = std::env::var_os("TACTUS_DATA").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
        PathBuf::from,
    );
    let folder = root.join("biotac");
    if folder.is_dir() {
        let slides = RecordingSet::open(&folder)?.load_texture(0)?;
        let slide = slides.first().context("the first material has no slide")?;
        let steady = slide.pac.get(slide.steady(PAC_RATE_HZ)).unwrap_or_default();
        let samples = steady.get(..SLIDE).context("its slide is too short")?;
        return Ok((samples.to_vec(), "a real finger's"));
    }
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let samples = (0..SLIDE).map(|n| {
        let noise: f64 = random.random_range(-40.0..40.0);
        (300.0 * (n as f64 * 0.3).sin() + noise) as i16
    });
    Ok((samples.collect(), "synthetic: there are no recordings"))
}

const MOVEMENTS: [Movement; 3] = [
    Movement::FOR_TRACTION,
    Movement::FOR_FINENESS,
    Movement::FOR_ROUGHNESS,
];

/// A table of so many textures, neighbours hard to tell apart, each learned from 5 slides of 3 movements.
fn synthetic(method: Method, textures: usize) -> anyhow::Result<Vec<u8>> {
    let mut random = ChaCha8Rng::seed_from_u64(2);
    let names: Vec<String> = (1..=textures).map(|t| format!("texture {t}")).collect();
    let slides: Vec<Vec<Vec<Observation>>> = names
        .iter()
        .map(|_| {
            let mut slides_of = |_: &Movement| {
                let mut around =
                    |centre: f32, reach: f32| random.random_range(centre - reach..centre + reach);
                let centre = [around(1.0, 0.8), around(8.0, 3.0), around(4.0, 1.0)];
                let bands: Vec<f32> = (0..12).map(|_| around(3.0, 3.0)).collect();
                let mut slide = |_| {
                    let properties = Properties::new(centre.map(|c| Some(around(c, 0.2))));
                    let bands = bands
                        .iter()
                        .filter_map(|b| tactus_core::fused::fixed(around(*b, 0.5)));
                    Observation {
                        bands: bands.collect(),
                        ..Observation::from(properties)
                    }
                };
                (0..5).map(&mut slide).collect()
            };
            MOVEMENTS.iter().map(&mut slides_of).collect()
        })
        .collect();
    Ok(learn::learn(method, None, &names, &MOVEMENTS, &slides)?)
}

/// Posteriors that the figures below do not go through: few textures and odd numbers of them, all numbers of features, textures
/// too far away for the chip's short way, learned from different numbers of slides, or not at all, and values far from all.
fn corners(bench: &mut Bench) -> anyhow::Result<()> {
    let mut random = ChaCha8Rng::seed_from_u64(4);
    for textures in [3, 8, 21] {
        for (set, far) in FeatureSet::ALL
            .into_iter()
            .zip([false, true].iter().cycle())
        {
            for uneven in [false, true] {
                let slides = corner(&mut random, textures, set, *far || uneven, uneven);
                let what = format!("{textures} textures by {}, uneven: {uneven}", set.name());
                for method in [Method::Fused, Method::Paper] {
                    let names: Vec<String> = (0..textures).map(|t| format!("t{t}")).collect();
                    let set = (method == Method::Fused).then_some(set);
                    if set.is_none()
                        && slides
                            .iter()
                            .flatten()
                            .flatten()
                            .any(|s| s.properties == Properties::default())
                    {
                        continue;
                    }
                    let table = learn::learn(method, set, &names, &MOVEMENTS, &slides)?;
                    for _ in 0..3 {
                        // where one was never felt, the paper's method does not look
                        let movement = match (uneven, method) {
                            (true, Method::Fused) => 1,
                            (true, _) => 0,
                            (false, _) => random.random_range(0..3),
                        };
                        let texture = random.random_range(0..textures);
                        let felt = slides[texture][movement].first();
                        let mut slide = felt.or(slides[0][0].first()).context("no slide")?.clone();
                        if set.is_none() && random.random() {
                            slide.properties = Properties::new([Some(1e6), Some(-1e6), Some(0.0)]);
                        }
                        let action = Action {
                            movement: movement as u8,
                            property: set
                                .is_none()
                                .then_some(Property::ALL[random.random_range(0..3)]),
                        };
                        let mut words = Vec::new();
                        Felt {
                            method,
                            action,
                            slide,
                        }
                        .write(|word| words.push(word));
                        let counted = bench.count(Workload::Observe, &table, &words);
                        let counted = counted.with_context(|| what.clone())?;
                        ensure!(
                            counted.equal,
                            "{what}: {method:?} is not what the plain kernels give"
                        );
                    }
                }
            }
        }
    }
    Ok(())
}

/// Slides of textures, movement by movement; some from fewer where they are `uneven`, one from none.
fn corner(
    random: &mut ChaCha8Rng,
    textures: usize,
    set: FeatureSet,
    far: bool,
    uneven: bool,
) -> Vec<Vec<Vec<Observation>>> {
    let (reach, scatter) = if far { (15.0, 0.02) } else { (3.0, 0.5) };
    let mut texture = |texture: usize| {
        let mut slides_at = |movement: usize| {
            let centres: Vec<f32> = (0..17)
                .map(|_| random.random_range(-reach..reach))
                .collect();
            let slides = match (uneven, movement, texture) {
                (true, 1, 1) => 0,
                (true, _, _) => 2 + texture % 3,
                _ => 5,
            };
            let mut slide = |_| {
                let felt: Vec<f32> = centres
                    .iter()
                    .map(|c| c + random.random_range(-scatter..scatter))
                    .collect();
                let fixed = |x: &f32| tactus_core::fused::fixed(*x).unwrap_or(0);
                let properties = match set {
                    FeatureSet::Pressure | FeatureSet::Bands => [None; 3],
                    _ => [
                        Some(felt[0] / 4.0),
                        Some(felt[1] / 2.0),
                        Some(felt[2] / 4.0),
                    ],
                };
                Observation {
                    properties: Properties::new(properties),
                    pressure: (set == FeatureSet::Pressure)
                        .then(|| [fixed(&felt[3]), fixed(&felt[4])]),
                    bands: felt[5..].iter().map(fixed).collect(),
                }
            };
            (0..slides).map(&mut slide).collect()
        };
        (0..MOVEMENTS.len()).map(&mut slides_at).collect()
    };
    (0..textures).map(&mut texture).collect()
}

/// What was felt, as words, and how many textures it leaves.
struct Wanted {
    words: Vec<i16>,
    live: usize,
}

/// A slide after which so many textures are still likely, or as nearly as can be found.
fn felt(table: &[u8], method: Method, live: usize) -> anyhow::Result<Wanted> {
    let table = Table::read(table).ok().context("the table is broken")?;
    let mut random = ChaCha8Rng::seed_from_u64(live as u64);
    let config = Config {
        method,
        ..Config::default()
    };
    let mut explorer = Explorer::<2000>::new(table, PropertySet::ALL, config)
        .ok()
        .context("the table does not suit")?;
    let mut best: Option<(usize, Felt)> = None;
    for _ in 0..20_000 {
        let felt = match table.contents() {
            Contents::Gaussians(_) => by_property(&table, method, &mut random),
            Contents::Fused(set, features) => by_bands(&table, set, features, &mut random),
        };
        let Some(felt) = felt else { continue };
        explorer.restart();
        if explorer.observe(felt.action, &felt.slide).is_err() {
            continue;
        }
        let left = explorer.posterior().iter().filter(|p| **p >= NEGLIGIBLE);
        let left = left.count();
        if best
            .as_ref()
            .is_none_or(|(best, _)| left.abs_diff(live) < best.abs_diff(live))
        {
            best = Some((left, felt));
        }
        if left == live {
            break;
        }
    }
    let (live, felt) = best.context("no slide suits")?;
    let mut words = Vec::new();
    felt.write(|word| words.push(word));
    Ok(Wanted { words, live })
}

/// A slide of one of the textures, looked at by one property.
fn by_property(table: &Table<'_>, method: Method, random: &mut ChaCha8Rng) -> Option<Felt> {
    let texture = random.random_range(0..table.textures());
    let movement = random.random_range(0..table.movements().len() as u8);
    let looked_at = Property::ALL[random.random_range(0..3)];
    let values = Property::ALL.map(|property| {
        let property = Some(property);
        let known = table.gaussian(texture, Action { movement, property })?;
        Some(known.mean + known.sd * random.random_range(-2.0..2.0))
    });
    Some(Felt {
        method,
        action: Action {
            movement,
            property: Some(looked_at),
        },
        slide: Properties::new(values).into(),
    })
}

/// A slide somewhere between all textures, the farther out the more of them it leaves.
fn by_bands(
    table: &Table<'_>,
    set: FeatureSet,
    features: u8,
    random: &mut ChaCha8Rng,
) -> Option<Felt> {
    if set != FeatureSet::Force {
        return None;
    }
    let movement = random.random_range(0..table.movements().len() as u8);
    let whitening = table.whitening(movement)?;
    let mean: Vec<i16> = whitening
        .as_bytes()
        .chunks_exact(2)
        .take(features.into())
        .map(|pair| i16::from_le_bytes([pair[0], pair[1]]))
        .collect();
    let reach = random.random_range(0.0..3000.0f32);
    let values: heapless::Vec<i16, MAX_FEATURES> = mean
        .iter()
        .map(|mean| mean.saturating_add((reach * random.random_range(-1.0..1.0)) as i16))
        .collect();
    let (traction, bands) = values.split_first()?;
    let properties = [Some(f32::from(*traction) / 1024.0), Some(8.0), Some(4.0)];
    Some(Felt {
        method: Method::Fused,
        action: Action {
            movement,
            property: None,
        },
        slide: Observation {
            properties: Properties::new(properties),
            bands: bands.iter().copied().collect(),
            pressure: None,
        },
    })
}

/// What the chip found.
struct Counted {
    instructions: u64,
    cycles: Option<f64>,
    equal: bool,
}

struct Bench {
    emulator: Emulator,
    desk: u64,
    /// Where the chip says that it counts.
    counts: u64,
    /// Functions that samples of what was running fell into.
    running: HashMap<String, usize>,
    plan: Plan,
    overhead: u64,
    source: &'static str,
    /// Whether cycles are estimated, and for whom the functions are told where the time goes.
    model: bool,
    profile: bool,
}

/// Offsets in the bench image's `Desk`.
const STATE: u64 = 0;
const WORKLOAD: u64 = 4;
const INSTRUCTIONS: u64 = 16;
const INPUT: u64 = 24;
const INPUT_BYTES: u64 = 2 * 8192;
const TABLE_AT: u64 = 0x0812_0000;
const CHIPS_TURN: u32 = 1;
const DONE: u32 = 2;
/// Samples of what is running, of which the cycles are estimated: their error is 1 to 2 %.
const SAMPLES: usize = 2000;
/// Longest that a workload takes, virtual ns.
const PATIENCE_NS: u64 = 60_000_000_000;

/// The plain kernels on this PC are not counted.
struct Uncounted;

impl Counter for Uncounted {
    fn count<T>(&mut self, work: impl FnOnce() -> T) -> T {
        work()
    }
}

impl Bench {
    fn start(cli: &Cli) -> anyhow::Result<Self> {
        let mut emulator = Emulator::start(&cli.elf, Setup::default(), Options::default())?;
        let (desk, _) = emulator.symbol("BENCH_DESK")?;
        let (counts, _) = emulator.symbol("BENCH_COUNTS")?;
        // the clocks are up by then
        emulator.run_ms(20)?;
        let mut bench = Self {
            emulator,
            desk,
            counts,
            running: HashMap::new(),
            plan: Plan::new(),
            overhead: 0,
            source: "",
            model: false,
            profile: cli.profile,
        };
        bench.overhead = bench.ask(Workload::Nothing, &[], &[])?.0;
        bench.model = cli.format == Format::Text;
        Ok(bench)
    }

    fn word(&mut self, offset: u64) -> anyhow::Result<u32> {
        self.word_at(self.desk + offset)
    }

    fn word_at(&mut self, address: u64) -> anyhow::Result<u32> {
        let bytes = self.emulator.read(address, 4)?;
        Ok(u32::from_le_bytes(bytes.try_into().unwrap_or_default()))
    }

    /// Lets the chip begin with a workload.
    fn begin(&mut self, workload: Workload, table: &[u8], words: &[i16]) -> anyhow::Result<()> {
        ensure!(
            2 * words.len() as u64 <= INPUT_BYTES,
            "more samples than the chip has room for"
        );
        self.emulator.write(TABLE_AT, table)?;
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        self.emulator.write(self.desk + INPUT, &bytes)?;
        let code = Workload::ALL.iter().position(|w| *w == workload);
        let code = code.context("a workload without a code")? as u32;
        let head = [code, table.len() as u32, words.len() as u32];
        let head: Vec<u8> = head.iter().flat_map(|word| word.to_le_bytes()).collect();
        self.emulator.write(self.desk + WORKLOAD, &head)?;
        let turn = CHIPS_TURN.to_le_bytes();
        Ok(self.emulator.write(self.desk + STATE, &turn)?)
    }

    /// Runs the chip for so long; whether it is done.
    fn step(&mut self, ns: u64) -> anyhow::Result<bool> {
        self.emulator.run_until(self.emulator.now_ns() + ns)?;
        match self.word(STATE)? {
            CHIPS_TURN => Ok(false),
            DONE => Ok(true),
            _ => bail!("the chip does not understand it"),
        }
    }

    /// Instructions of a workload on the chip, and its results.
    fn ask(
        &mut self,
        workload: Workload,
        table: &[u8],
        words: &[i16],
    ) -> anyhow::Result<(u64, Vec<u8>)> {
        self.begin(workload, table, words)?;
        let until = self.emulator.now_ns() + PATIENCE_NS;
        while !self.step(200_000)? {
            ensure!(
                self.emulator.now_ns() < until,
                "the chip does not come to an end"
            );
        }
        let instructions = self.word(INSTRUCTIONS)?;
        let results = self.word(INSTRUCTIONS + 4)?;
        let output = self.desk + INPUT + INPUT_BYTES;
        let results = self.emulator.read(output, results.into())?;
        Ok((instructions.into(), results))
    }

    /// Cycles that an instruction of a workload takes in the mean, by samples of what is running.
    fn cycles_per_instruction(
        &mut self,
        workload: Workload,
        table: &[u8],
        words: &[i16],
        instructions: u64,
    ) -> anyhow::Result<f64> {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        // 6 ns an instruction
        let lasts_ns = 6 * instructions;
        let (mut samples, mut cycles) = (0, 0);
        self.running.clear();
        while samples < SAMPLES {
            self.begin(workload, table, words)?;
            loop {
                let counts = self.word_at(self.counts)? != 0;
                let step = if counts {
                    if let Some(address) = self.emulator.program_counter()? {
                        let code = self.emulator.read(address.into(), 4)?;
                        let half = |at| u16::from_le_bytes([code[at], code[at + 1]]);
                        cycles += cycles::cycles(half(0), half(2));
                        samples += 1;
                        let function = self.emulator.function_at(address.into());
                        let function = function.unwrap_or("?").to_owned();
                        *self.running.entry(function).or_default() += 1;
                    }
                    let mean = (lasts_ns / SAMPLES as u64).clamp(60, 20_000);
                    random.random_range(mean / 2..mean * 3 / 2)
                } else {
                    // not over it
                    (lasts_ns / 4).clamp(1000, 100_000)
                };
                if self.step(step)? {
                    break;
                }
            }
        }
        Ok(f64::from(cycles) / samples as f64)
    }

    fn tell_profile(&self, kernel: &str) {
        let mut running: Vec<_> = self.running.iter().collect();
        running.sort_by(|a, b| b.1.cmp(a.1));
        let all: usize = self.running.values().sum();
        eprintln!("{kernel}");
        for (function, samples) in running.iter().take(8) {
            let percent = 100.0 * **samples as f64 / all.max(1) as f64;
            eprintln!("{percent:6.1} %  {function}");
        }
    }

    fn count(
        &mut self,
        workload: Workload,
        table: &[u8],
        words: &[i16],
    ) -> anyhow::Result<Counted> {
        let (instructions, results) = self.ask(workload, table, words)?;
        let mut expected = Vec::new();
        let mut put = |bytes: &[u8]| expected.extend_from_slice(bytes);
        workload::run::<Plain>(workload, &self.plan, table, words, &mut Uncounted, &mut put)
            .context("the workload makes no sense")?;
        let instructions = instructions.saturating_sub(self.overhead);
        let cycles = if self.model {
            let each = self.cycles_per_instruction(workload, table, words, instructions)?;
            Some(each * instructions as f64)
        } else {
            None
        };
        Ok(Counted {
            instructions,
            cycles,
            equal: results == expected,
        })
    }
}
