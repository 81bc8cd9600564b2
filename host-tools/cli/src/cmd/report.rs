//! `tactus report`: what a table is good for, on one page; without a table, how repeatable slides are.

mod repeatability;

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use serde::Serialize;
use tactus_core::table::Table;
use tactus_lab::data::replay::MeasuredSlide;
use tactus_lab::eval::learned::LeftOut;
use tactus_lab::eval::open_set;
use tactus_lab::eval::report::{RUNS, Report, Slides};
use tactus_lab::eval::samples;
use tactus_lab::eval::show::count;
use tactus_study::page::render;
use tactus_study::pictures::map;

use super::args::{Only, Recordings};
use super::output::{Format, UsageError, about_percent, print_json, verdict_rows};
use super::plot::Plot;
use super::progress::{notice, progress};
use super::table_file::{Force, read_table, spare_input, write_file};
use super::textures::{measure_folder, of_one_finger};

/// Say what a table is good for, or how repeatable recorded slides are by part and operator
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tactus report TABLE                                        textures, nearest pairs, advice
  tactus report TABLE --recordings DIR --out report.html     and what users would be told, as a page
  tactus report TABLE --recordings DIR --only lot=7          what users would be told of one lot
  tactus report --recordings DIR                             variance by part, operator and repetition
  tactus report --recordings ANNA --recordings BEN --plot charts    two operators, and control charts
  tactus device record cork felt --slides 5 --operator Anna --lot 7 --out ANNA

Slides that the table was learned from do not count, wherever they are.
Without a table, a part is a texture, or a lot of it. Operators are compared if each of them touched
every part. Below 10 % of all variation a gauge is usually called good, above 30 % not acceptable; it
should tell at least five classes apart.")]
pub(crate) struct Args {
    /// The table; without it, the variance of the recorded slides is told
    table: Option<PathBuf>,
    /// Recordings to explore with the table; they may hold textures that it does not have. Without a
    /// table it may be given several times, for a study of several operators
    #[arg(long, value_name = "DIR")]
    recordings: Vec<PathBuf>,
    #[command(flatten)]
    only: Only,
    /// Seed of the explorations
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// The page to write
    #[arg(long, value_name = "FILE.html", requires = "table")]
    out: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
    #[command(flatten)]
    plot: Plot,
    /// How to print the report
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

#[derive(Serialize)]
struct Page<'r> {
    name: String,
    version: &'static str,
    command: String,
    report: &'r Report,
    /// Its own figures in a sentence.
    figures: Option<String>,
    map: String,
}

pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    if let Some(table) = &args.table {
        return of_table(table, args, out);
    }
    let mut folders = args.recordings.clone();
    if folders.is_empty() {
        folders.push(
            Recordings {
                recordings: None,
                only: Only::default(),
            }
            .folder()?,
        );
    }
    repeatability::run(&folders, &args.only, &args.plot, args.format, out)
}

fn of_table(file: &Path, args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    if args.recordings.len() > 1 || args.plot.plot.is_some() {
        let say = "with a table, give --recordings once and no --plot";
        return Err(UsageError(say.to_owned()).into());
    }
    for input in args.recordings.iter().chain([&file.to_owned()]) {
        args.out
            .iter()
            .try_for_each(|out| spare_input(out, input))?;
    }
    let mut bytes = Vec::new();
    let table = read_table(file, &mut bytes)?;
    let folder = args.recordings.first();
    let slides = folder
        .map(|folder| unseen(folder, &args.only, table))
        .transpose()?;
    let runs = slides
        .as_ref()
        .map_or(0, |(slides, _)| RUNS * slides.len() as u64);
    let bar = progress(runs, "exploring");
    let (slides, left_out) = slides.unzip();
    let mut report = Report::new(table, slides.as_deref(), args.seed, || bar.inc(1));
    if let (Ok(report), Some(left_out)) = (&mut report, left_out) {
        report.leave_out(left_out);
    }
    bar.finish_and_clear();
    let report = report.with_context(|| file.display().to_string())?;
    if let Some(path) = &args.out {
        let page = Page {
            name: file.display().to_string(),
            version: env!("CARGO_PKG_VERSION"),
            command: command(file, args),
            report: &report,
            figures: report.table.open_set.as_ref().map(open_set::in_words),
            map: map::figure(table, None)?.svg,
        };
        let page = render(include_str!("report/page.html"), &page)?;
        write_file(path, page.as_bytes(), args.force)?;
    }
    match args.format {
        Format::Json => print_json(&report, out)?,
        Format::Text => print(&report, &samples::in_words(table), out)?,
    }
    out.flush()?;
    if let Some(path) = &args.out {
        notice(&format!("wrote {}", path.display()));
    }
    Ok(())
}

fn command(file: &Path, args: &Args) -> String {
    let mut command = format!("tactus report {}", file.display());
    if let Some(folder) = args.recordings.first() {
        command += &format!(" --recordings {} --seed {}", folder.display(), args.seed);
    }
    command
}

/// The slides of a folder that the table was not learned from, and what was left out.
fn unseen(folder: &Path, only: &Only, table: Table<'_>) -> anyhow::Result<(Vec<Slides>, LeftOut)> {
    let (set, measured) = measure_folder(folder, only)?;
    of_one_finger(&set, table)?;
    let mut out = LeftOut::of(table, &mut Vec::new(), |slide: &MeasuredSlide| {
        slide.marks.clone()
    });
    let textures = set.names().into_iter().zip(measured);
    let slides = textures.map(|(name, mut slides)| {
        out.slides += LeftOut::of(table, &mut slides, |slide| slide.marks.clone()).slides;
        Slides { name, slides }
    });
    Ok((slides.collect(), out))
}

/// Textures that are printed, most.
const LISTED: usize = 20;

fn print(report: &Report, samples: &str, out: &mut impl Write) -> anyhow::Result<()> {
    let wide = report.textures.iter().map(|t| t.name.chars().count()).max();
    let wide = wide.unwrap_or(0).max(7);
    writeln!(
        out,
        "{}\n\n{:<wide$}  {:>6}  {:<wide$} {:>12} {:>14}",
        report.verdict, "texture", "slides", "nearest", "taken for it", "slides to tell"
    )?;
    for texture in report.hardest().into_iter().take(LISTED) {
        let learned: u32 = texture.trials.iter().map(|&n| u32::from(n)).sum();
        let (nearest, taken, slides) = match &texture.nearest {
            Some(near) => (
                near.texture.as_str(),
                about_percent(near.taken_for),
                near.slides.map_or("over ten".to_owned(), |n| n.to_string()),
            ),
            None => ("-", "-".to_owned(), "-".to_owned()),
        };
        let name = &texture.name;
        writeln!(
            out,
            "{name:<wide$}  {learned:>6}  {nearest:<wide$} {taken:>12} {slides:>14}"
        )?;
    }
    if let Some(more) = report.textures.len().checked_sub(LISTED + 1) {
        let more = count(more as u64 + 1, "texture");
        writeln!(
            out,
            "and {more} that are easier to tell: --out or --format json lists all"
        )?;
    }
    writeln!(out, "{samples}")?;
    if let Some(figures) = &report.table.open_set {
        writeln!(out, "{}", open_set::in_lines(figures))?;
    }
    if let Some(recorded) = &report.recorded {
        let explorations = count(recorded.explorations as u64, "exploration");
        writeln!(
            out,
            "\nWhat users would be told, by {explorations} of recorded slides, {:.1} slides each in the mean:",
            recorded.mean_slides
        )?;
        if let Some(said) = &recorded.remark {
            writeln!(out, "  {said}")?;
        }
        let unknown = recorded.unknown.as_ref();
        let of = [
            ("textures of the table", Some(&recorded.known)),
            ("others", unknown),
        ];
        for (kind, verdicts) in of.into_iter().filter_map(|(k, v)| Some((k, v?))) {
            let told = verdict_rows(verdicts).into_iter().map(|(name, share)| {
                let share = about_percent(share);
                format!("{} {share}", name.trim())
            });
            let told: Vec<String> = told.collect();
            writeln!(out, "  {kind}: {}", told.join(", "))?;
        }
    }
    match report.advice.is_empty() {
        true => writeln!(
            out,
            "\nNothing stands out: all textures are told apart by a few slides."
        )?,
        false => writeln!(out, "\nWhat would help:\n- {}", report.advice.join("\n- "))?,
    }
    Ok(())
}
