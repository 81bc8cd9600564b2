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
use tactus::experiment::{self, Experiment, Protocol};
use tactus::properties::PropertyTable;
use tactus::recordings::{RecordingSet, RecordingWriter, Slide as Recorded, Texture};
use tactus::replay::{Felt, feel};
use tactus::show::show_table;
use tactus::sim::textures::TEXTURES;
use tactus_core::features::{BAND_EDGES, Property, PropertySet};
use tactus_core::table::{Experience, Table};

use crate::cli::{Command, Evaluate, Format, Rows, TableCommand, Tactus};
use crate::identify::{demonstrate, identify, identify_simulated};

/// Runs what the arguments ask for.
pub(crate) fn run() -> anyhow::Result<()> {
    let out = &mut io::BufWriter::new(io::stdout().lock());
    match Tactus::parse().command {
        None => demonstrate(out)?,
        Some(Command::Features { from, format }) => features(&from.recordings, format, out)?,
        Some(Command::Learn {
            from,
            train_slides,
            out: file,
        }) => {
            learn(&from.recordings, train_slides, &file, out)?;
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
        Some(Command::Import { from, to }) => import(&from, &to, out)?,
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
) -> anyhow::Result<Vec<u8>> {
    if slides < 2 {
        bail!("--train-slides {slides}: a standard deviation takes at least two slides");
    }
    let movements = set.movements();
    let measured = felt
        .iter()
        .flatten()
        .fold(PropertySet::ALL, |measured, slide| {
            measured.and(slide.measurement.properties.measured())
        });
    let mut experience: Vec<Vec<Experience>> = Vec::new();
    for (texture, felt) in set.textures().iter().zip(felt) {
        let mut of_texture = Vec::new();
        for &movement in &movements {
            let same = felt.iter().filter(|s| s.movement == movement);
            let trials: Vec<_> = same
                .take(slides)
                .map(|s| s.measurement.properties)
                .collect();
            if trials.len() < slides {
                bail!(
                    "{}, {movement}: there are {} slides, and --train-slides is {slides}",
                    texture.name,
                    trials.len()
                );
            }
            of_texture.push(experiment::learned(measured, &trials));
        }
        experience.push(of_texture);
    }
    Ok(experiment::encode(
        measured,
        &movements,
        &names(set),
        &experience,
    )?)
}

fn learn(folder: &Path, slides: usize, file: &Path, out: &mut impl Write) -> anyhow::Result<()> {
    let (set, felt) = feel_folder(folder)?;
    let bytes = learn_first(&set, &felt, slides)?;
    // an old table is replaced whole or not at all
    let mut part = file.as_os_str().to_owned();
    part.push(".part");
    std::fs::write(&part, &bytes)
        .and_then(|()| std::fs::rename(&part, file))
        .with_context(|| file.display().to_string())?;
    writeln!(
        out,
        "{}: {} textures learned from the first {slides} slides of each, {} bytes",
        file.display(),
        set.textures().len(),
        bytes.len()
    )?;
    Ok(())
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

fn simulate(
    folder: &Path,
    wanted: &[String],
    trials: u32,
    seed: u64,
    out: &mut impl Write,
) -> anyhow::Result<()> {
    let mut textures = find_textures(wanted)?;
    textures.sort_unstable();
    textures.dedup();
    let collection = Collection {
        seed,
        textures,
        trials,
    };
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

fn run_evaluation(args: &Evaluate, out: &mut impl Write) -> anyhow::Result<()> {
    let (experiment, protocol) = if let Some(folder) = &args.recordings {
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
        (experiment, protocol)
    } else if let Some(file) = &args.properties {
        (
            Experiment::given(&PropertyTable::read(file)?, args.train_slides, args.seed)
                .with_context(|| file.display().to_string())?,
            "properties",
        )
    } else {
        bail!("give --recordings or --properties");
    };
    let bar = progress(args.runs, "exploring");
    let outcomes = evaluate(
        &experiment,
        args.stop.config(args.method),
        args.runs,
        || bar.inc(1),
    )?;
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
        Format::Json => writeln!(out, "{}", serde_json::to_string_pretty(&evaluation)?)?,
        Format::Text => print_evaluation(&evaluation, out)?,
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
