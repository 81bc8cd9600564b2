//! What every command does.

use std::io::{self, Write};
use std::path::Path;
use std::time::Duration;

use anyhow::{Context as _, bail};
use clap::{Parser as _, ValueEnum as _};
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use tactus::collection::{Collection, calibrated, texture_name, texture_number};
use tactus::evaluate::{Method, Summary, evaluate};
use tactus::experiment::{Experiment, Protocol};
use tactus::fabricslide::FabricSet;
use tactus::handheld;
use tactus::learn;
use tactus::lifelong::{Learning, Lifelong, lifelong};
use tactus::novelty::{After, leave_one_out};
use tactus::properties::PropertyTable;
use tactus::recordings::{RecordingSet, RecordingWriter, Slide as Recorded, Texture};
use tactus::replay::{Felt, feel};
use tactus::show::show_table;
use tactus::sim::textures::TEXTURES;
use tactus_core::explorer::Config;
use tactus_core::features::{BAND_EDGES, Property};
use tactus_core::fused::{FeatureSet, Observation};
use tactus_core::table::Table;

use crate::cli::{Command, Evaluate, Features, Format, Rows, TableCommand, Tactus};
use crate::identify::{demonstrate, identify, identify_simulated};
use crate::study_command::study;

/// Runs what the arguments ask for.
pub(crate) fn run() -> anyhow::Result<()> {
    let out = &mut io::BufWriter::new(io::stdout().lock());
    match Tactus::parse().command {
        None => demonstrate(out)?,
        Some(Command::Features { from, format }) => features(&from.recordings, format, out)?,
        Some(Command::Learn {
            from,
            train_slides,
            method,
            features,
            out: file,
        }) => {
            let (set, felt) = feel_folder(&from.recordings)?;
            let features = features.map(Features::set);
            let bytes = learn_first(&set, &felt, train_slides, method, features)?;
            write_table(&file, &bytes)?;
            writeln!(
                out,
                "{}: {} textures learned from the first {train_slides} slides of each, {} bytes",
                file.display(),
                set.textures().len(),
                bytes.len()
            )?;
        }
        Some(Command::LearnByHand {
            out: file,
            textures,
            trials,
            seed,
        }) => {
            let collection = collection(&textures, trials, seed)?;
            let (bytes, left_out) = handheld::learn(&collection)?;
            write_table(&file, &bytes)?;
            writeln!(
                out,
                "{}: {} textures learned from {trials} slides of each by hand, {} bytes",
                file.display(),
                collection.textures.len() - left_out.len(),
                bytes.len()
            )?;
            for number in left_out {
                writeln!(out, "not felt: {}", texture_name(number))?;
            }
        }
        Some(Command::Table(TableCommand::Show { file })) => {
            show_table(read_table(&file, &mut Vec::new())?, out)?
        }
        Some(Command::Table(TableCommand::Check { file })) => {
            let mut bytes = Vec::new();
            let table = read_table(&file, &mut bytes)?;
            writeln!(
                out,
                "{}: good; {} textures, {} movements, {} bytes, checksum {:08x}",
                file.display(),
                table.textures(),
                table.movements().len(),
                table.as_bytes().len(),
                table.crc()
            )?;
        }
        Some(Command::Identify(args)) => match (&args.recordings, &args.material) {
            (Some(folder), Some(material)) => identify(&args, folder, material, out)?,
            _ => identify_simulated(&args, out)?,
        },
        Some(Command::Simulate {
            out: folder,
            textures,
            trials,
            seed,
        }) => {
            simulate(&folder, &textures, trials, seed, out)?;
        }
        Some(Command::Evaluate(args)) => run_evaluation(&args, out)?,
        Some(Command::Study(args)) => study(&args, out)?,
        Some(Command::Import { from, to }) => import(&from, &to, out)?,
        Some(Command::Device(device)) => crate::device::run(&device, out)?,
        Some(Command::Completions { shell }) => crate::manual::completions(shell, out),
        Some(Command::Man { out: folder }) => crate::manual::pages(folder.as_deref(), out)?,
    }
    out.flush()?;
    Ok(())
}

/// A bar on the terminal; nothing where there is none.
pub(crate) fn progress(length: u64, what: &'static str) -> ProgressBar {
    let style = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len}, {eta} left")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    let bar = ProgressBar::new(length)
        .with_style(style)
        .with_message(what);
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}

/// Opens a folder and feels all of its slides.
pub(crate) fn feel_folder(folder: &Path) -> anyhow::Result<(RecordingSet, Vec<Vec<Felt>>)> {
    let set = RecordingSet::open(folder)?;
    let bar = progress(set.textures().len() as u64, "feeling slides");
    let felt = feel(&set, |_| bar.inc(1))
        .with_context(|| format!("recordings in {}", folder.display()))?;
    bar.finish_and_clear();
    Ok((set, felt))
}

pub(crate) fn names(set: &RecordingSet) -> Vec<String> {
    set.textures().iter().map(|t| t.name.clone()).collect()
}

fn features(folder: &Path, format: Rows, out: &mut impl Write) -> anyhow::Result<()> {
    let (set, felt) = feel_folder(folder)?;
    let rows = set
        .textures()
        .iter()
        .zip(&felt)
        .flat_map(|(texture, slides)| slides.iter().map(move |s| (texture, s)));
    match format {
        Rows::Csv => {
            write!(
                out,
                "material,slide,traction_n,roughness_ln,fineness_unfiltered_ln"
            )?;
            for band in 0..BAND_EDGES.len() - 1 {
                write!(out, ",ln_psd_band{band}")?;
            }
            writeln!(out)?;
            for (texture, slide) in rows {
                write!(out, "{},{}", texture.id, slide.number)?;
                for property in Property::ALL {
                    match slide.measurement.properties.get(property) {
                        Some(value) => write!(out, ",{value:.6}")?,
                        None => write!(out, ",")?,
                    }
                }
                for band in slide.measurement.ln_bands() {
                    write!(out, ",{band:.6}")?;
                }
                writeln!(out)?;
            }
        }
        Rows::Text => {
            writeln!(
                out,
                "{:>3} {:<24} {:>5}  {:<20} {:>10} {:>10} {:>10}  ln of eight bands, 20 to 1000 Hz",
                "no.", "texture", "slide", "movement", "traction N", "roughness", "fineness"
            )?;
            for (texture, slide) in rows {
                write!(
                    out,
                    "{:>3} {:<24} {:>5}  {:<20}",
                    texture.id,
                    texture.name,
                    slide.number,
                    slide.movement.to_string()
                )?;
                for property in Property::ALL {
                    match slide.measurement.properties.get(property) {
                        Some(value) => write!(out, " {value:>10.3}")?,
                        None => write!(out, " {:>10}", "-")?,
                    }
                }
                write!(out, " ")?;
                for band in slide.measurement.ln_bands() {
                    write!(out, " {band:>5.1}")?;
                }
                writeln!(
                    out,
                    "{}",
                    if slide.measurement.roughness_is_bound {
                        "  (not rougher than this)"
                    } else {
                        ""
                    }
                )?;
            }
        }
    }
    Ok(())
}

/// The first slides of every texture and movement, and the table that they teach.
pub(crate) fn learn_first(
    set: &RecordingSet,
    felt: &[Vec<Felt>],
    slides: usize,
    method: Method,
    features: Option<FeatureSet>,
) -> anyhow::Result<Vec<u8>> {
    if slides < 2 {
        bail!(
            "--train-slides {slides}: how slides of one texture differ takes at least two slides"
        );
    }
    let movements = set.movements();
    let mut first: Vec<Vec<Vec<Observation>>> = Vec::new();
    for (texture, felt) in set.textures().iter().zip(felt) {
        let mut of_texture = Vec::new();
        for &movement in &movements {
            let same = felt.iter().filter(|s| s.movement == movement);
            let trials: Vec<Observation> = same
                .take(slides)
                .map(|s| Observation::from(&s.measurement))
                .collect();
            if trials.len() < slides {
                bail!(
                    "{}, {movement}: there are {} slides, and --train-slides is {slides}",
                    texture.name,
                    trials.len()
                );
            }
            of_texture.push(trials);
        }
        first.push(of_texture);
    }
    let names = names(set);
    Ok(learn::learn(
        method.method(),
        features,
        &names,
        &movements,
        &first,
    )?)
}

/// An old table is replaced whole or not at all.
pub(crate) fn write_table(file: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    let mut part = file.as_os_str().to_owned();
    part.push(".part");
    std::fs::write(&part, bytes)
        .and_then(|()| std::fs::rename(&part, file))
        .with_context(|| file.display().to_string())
}

pub(crate) fn read_table<'b>(file: &Path, bytes: &'b mut Vec<u8>) -> anyhow::Result<Table<'b>> {
    *bytes = std::fs::read(file).with_context(|| file.display().to_string())?;
    let table = Table::read(bytes).with_context(|| file.display().to_string())?;
    let behind = bytes.len() - table.as_bytes().len();
    if behind > 0 {
        bail!(
            "{}: {behind} bytes follow the table; the file is not what `tactus learn` wrote",
            file.display()
        );
    }
    Ok(table)
}

/// The textures asked for, by name or number; without any, all.
pub(crate) fn find_textures(wanted: &[String]) -> anyhow::Result<Vec<u8>> {
    if wanted.is_empty() {
        return Ok(TEXTURES.iter().map(|t| t.number).collect());
    }
    wanted
        .iter()
        .map(|name| {
            texture_number(name.trim()).with_context(|| {
                let known: Vec<&str> = TEXTURES.iter().map(|t| t.name).collect();
                format!(
                    "no texture {name} in Table 1, which has: {}",
                    known.join(", ")
                )
            })
        })
        .collect()
}

/// The textures that are named, each once.
fn collection(wanted: &[String], trials: u32, seed: u64) -> anyhow::Result<Collection> {
    let mut textures = find_textures(wanted)?;
    textures.sort_unstable();
    textures.dedup();
    Ok(Collection {
        seed,
        textures,
        trials,
    })
}

fn simulate(
    folder: &Path,
    wanted: &[String],
    trials: u32,
    seed: u64,
    out: &mut impl Write,
) -> anyhow::Result<()> {
    let collection = collection(wanted, trials, seed)?;
    let named = collection.textures.iter().map(|&number| Texture {
        id: number.into(),
        name: texture_name(number).to_owned(),
    });
    let mut writer = RecordingWriter::create(folder, named.collect())?;
    let bar = progress(collection.textures.len() as u64, "sliding over textures");
    let calibration = calibrated(collection.setup(collection.textures[0], 0))?;
    let (mut done, mut slides) = (0, 0);
    // a few textures at a time: a large set does not fit into memory
    for textures in collection.textures.chunks(8) {
        let part = Collection {
            textures: textures.to_vec(),
            ..collection.clone()
        };
        for (index, recorded) in part
            .record(calibration, || bar.inc(1))?
            .into_iter()
            .enumerate()
        {
            for slide in recorded {
                let texture = done + index;
                writer.write(&Recorded { texture, ..slide })?;
                slides += 1;
            }
        }
        done += textures.len();
    }
    writer.finish()?;
    bar.finish_and_clear();
    writeln!(
        out,
        "{}: {} textures, {} slides, world {seed}",
        folder.display(),
        collection.textures.len(),
        slides
    )?;
    Ok(())
}

/// What `evaluate` prints.
#[derive(Serialize)]
struct Evaluation {
    method: Method,
    protocol: &'static str,
    train_slides: usize,
    runs: u64,
    textures: usize,
    threshold: f32,
    max_slides: u8,
    seed: u64,
    #[serde(flatten)]
    summary: Summary,
}

/// What `evaluate --novelty` prints.
#[derive(Serialize)]
struct NoveltyFigures {
    method: Method,
    protocol: &'static str,
    train_slides: usize,
    runs: u64,
    seed: u64,
    novelty: Vec<After>,
}

/// What `evaluate --lifelong` prints.
#[derive(Serialize)]
struct LifelongFigures {
    method: Method,
    train_slides: usize,
    sessions: u64,
    seed: u64,
    lifelong: Vec<Lifelong>,
}

/// Most sessions of `--lifelong`; they differ in the order of the textures only.
const SESSIONS: u64 = 50;

fn run_evaluation(args: &Evaluate, out: &mut impl Write) -> anyhow::Result<()> {
    if args.lifelong && args.protocol != Protocol::Drift {
        // the first slides are learned from, all others come after them
        let drift = Evaluate {
            protocol: Protocol::Drift,
            ..args.clone()
        };
        return run_evaluation(&drift, out);
    }
    if (args.lifelong || args.novelty.is_some()) && args.method.method() != FUSED {
        bail!(
            "--novelty and --lifelong need --method fused: the others cannot tell what they do not know"
        );
    }
    let (experiment, protocol) = experiment(args)?;
    let experiment = experiment.with_features(args.features.map(Features::set));
    let config = args.stop.config(args.method);
    if args.lifelong {
        return run_lifelong(args, &experiment, config, out);
    }
    if args.novelty.is_some() {
        return run_novelty(args, &experiment, protocol, config, out);
    }
    let bar = progress(args.runs, "exploring");
    let outcomes = evaluate(&experiment, config, args.runs, || bar.inc(1))?;
    bar.finish_and_clear();
    let evaluation = Evaluation {
        method: args.method,
        protocol,
        train_slides: experiment.train_slides(),
        runs: args.runs,
        textures: experiment.names().len(),
        threshold: args.stop.threshold,
        max_slides: args.stop.max_slides,
        seed: args.seed,
        summary: Summary::new(&outcomes, experiment.names(), args.stop.max_slides),
    };
    match args.format {
        Format::Json => print_json(&evaluation, out)?,
        Format::Text => print_evaluation(&evaluation, out)?,
    }
    Ok(())
}

const FUSED: tactus_core::explorer::Method = tactus_core::explorer::Method::Fused;

/// What is to be evaluated, and its name.
fn experiment(args: &Evaluate) -> anyhow::Result<(Experiment, &'static str)> {
    if let Some(folder) = &args.fabrics {
        let set = FabricSet::open(folder)?;
        let experiment = Experiment::fabrics(&set, args.repetition - 1, args.seed)?;
        return Ok((experiment, "fabrics"));
    }
    if let Some(file) = &args.properties {
        let set = PropertyTable::read(file)?;
        let experiment = Experiment::given(&set, args.train_slides, args.seed)
            .with_context(|| file.display().to_string())?;
        return Ok((experiment, "properties"));
    }
    let Some(folder) = &args.recordings else {
        bail!("give --recordings, --properties or --fabrics");
    };
    let (set, felt) = feel_folder(folder)?;
    let test = args.test.as_deref().map(feel_folder).transpose()?;
    let test = test.map(|(set, felt)| (names(&set), felt));
    let test = test
        .as_ref()
        .map(|(names, felt)| (names.as_slice(), felt.as_slice()));
    let experiment = Experiment::recorded(
        names(&set),
        &felt,
        test,
        args.protocol,
        args.train_slides.unwrap_or(5),
        args.seed,
    )?;
    let protocol = match args.protocol {
        Protocol::Interleaved => "interleaved",
        Protocol::Blocked => "blocked",
        Protocol::Drift => "drift",
    };
    Ok((experiment, protocol))
}

pub(crate) fn print_json(figures: &impl Serialize, out: &mut impl Write) -> anyhow::Result<()> {
    writeln!(out, "{}", serde_json::to_string_pretty(figures)?)?;
    Ok(())
}

fn run_novelty(
    args: &Evaluate,
    experiment: &Experiment,
    protocol: &'static str,
    config: Config,
    out: &mut impl Write,
) -> anyhow::Result<()> {
    if experiment.names().len() < 4 {
        bail!("leaving one out takes four textures or more");
    }
    let bar = progress(args.runs, "presenting new textures");
    let novelty = leave_one_out(experiment, config, args.runs, || bar.inc(1))?;
    bar.finish_and_clear();
    let figures = NoveltyFigures {
        method: args.method,
        protocol,
        train_slides: experiment.train_slides(),
        runs: args.runs,
        seed: args.seed,
        novelty,
    };
    if args.format == Format::Json {
        return print_json(&figures, out);
    }
    writeln!(
        out,
        "Every texture left out in turn, {protocol}, {} training slides, {} runs, seed {}",
        figures.train_slides, figures.runs, figures.seed
    )?;
    for after in &figures.novelty {
        writeln!(
            out,
            "  after {} slide{}  noticed {:5.1} %, known ones taken for new {:4.1} %",
            after.slides,
            if after.slides == 1 { " " } else { "s" },
            after.detections * 100.0,
            after.false_alarms * 100.0
        )?;
    }
    Ok(())
}

fn run_lifelong(
    args: &Evaluate,
    experiment: &Experiment,
    config: Config,
    out: &mut impl Write,
) -> anyhow::Result<()> {
    let sessions = args.runs.min(SESSIONS);
    let bar = progress(3 * sessions, "living through sessions");
    let figures = LifelongFigures {
        method: args.method,
        train_slides: experiment.train_slides(),
        sessions,
        seed: args.seed,
        lifelong: lifelong(experiment, config, sessions, args.seed, || bar.inc(1))?,
    };
    bar.finish_and_clear();
    if args.format == Format::Json {
        return print_json(&figures, out);
    }
    writeln!(
        out,
        "A session in time order: {} slides to learn from, then visits of one slide; {sessions} orders of the textures, seed {}",
        figures.train_slides, figures.seed
    )?;
    for life in &figures.lifelong {
        let (who, uncertain) = match life.learning {
            Learning::None => ("learning nothing      ", "uncertain"),
            Learning::Itself => ("learning by itself    ", "uncertain"),
            Learning::Asking => ("asking where uncertain", "asked"),
        };
        writeln!(
            out,
            "  {who}  right at first {:5.1} %, worst {:5.1} % ({}), {uncertain} {:4.1} %, wrong lessons {:.2} %",
            life.accuracy * 100.0,
            life.worst.0 * 100.0,
            life.worst.1,
            life.uncertain * 100.0,
            life.wrong_lessons * 100.0
        )?;
    }
    Ok(())
}

fn print_evaluation(e: &Evaluation, out: &mut impl Write) -> io::Result<()> {
    let method = e
        .method
        .to_possible_value()
        .map_or_else(String::new, |v| v.get_name().to_owned());
    writeln!(
        out,
        "{method}, {}, {} training slides: {} runs over {} textures, threshold {} %, at most {} slides, seed {}",
        e.protocol,
        e.train_slides,
        e.runs,
        e.textures,
        e.threshold * 100.0,
        e.max_slides,
        e.seed
    )?;
    let s = &e.summary;
    writeln!(
        out,
        "  right answers              {:5.1} %",
        s.accuracy * 100.0
    )?;
    writeln!(
        out,
        "  sure                       {:5.1} %",
        s.converged * 100.0
    )?;
    writeln!(
        out,
        "  wrong among the sure       {:5.1} %",
        s.wrong_when_sure * 100.0
    )?;
    writeln!(
        out,
        "  slides                     median {}, mean {:.2}",
        s.median_slides, s.mean_slides
    )?;
    if e.method.method() == FUSED {
        writeln!(
            out,
            "  most like a new texture    {:5.1} %",
            s.like_unknown * 100.0
        )?;
    }
    if !s.confused.is_empty() {
        writeln!(out, "  most confused")?;
    }
    for pair in &s.confused {
        writeln!(
            out,
            "    {:4.1} %  {} taken for {}",
            pair.share * 100.0,
            pair.texture,
            pair.identified
        )?;
    }
    Ok(())
}

fn import(from: &Path, to: &Path, out: &mut impl Write) -> anyhow::Result<()> {
    let bar = progress(0, "importing slides");
    let imported = tactus::import::import(from, to, &mut |done, all| {
        bar.set_length(all as u64);
        bar.set_position(done as u64);
    })?;
    bar.finish_and_clear();
    writeln!(
        out,
        "{}: {} textures, {} slides",
        to.display(),
        imported.textures,
        imported.slides
    )?;
    if imported.lost_rows > 0 {
        writeln!(
            out,
            "{} rows of 10 ms are missing from the publisher's files; what lies before and after them was joined",
            imported.lost_rows
        )?;
    }
    Ok(())
}
