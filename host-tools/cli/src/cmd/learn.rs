//! `tactus learn` and `tactus learn-by-hand`: tables of textures from slides.

use std::io::Write;
use std::path::PathBuf;

use anyhow::{Context as _, bail, ensure};
use tactus_core::features::Movement;
use tactus_core::sensor::FingerName;
use tactus_core::table::{FALSE_ALARM, MAX_LEARNED, Table};
use tactus_lab::data::recordings::RecordingSet;
use tactus_lab::data::replay::{CutSlide, MeasuredSlide, measure_cut};
use tactus_lab::eval::basis;
use tactus_lab::eval::evaluate::Method;
use tactus_lab::eval::first::{learn_first, learned_textures, taught};
use tactus_lab::eval::learn::{Expected, know_lengths};
use tactus_lab::eval::open_set;
use tactus_lab::eval::show::count;
use tactus_lab::sim::collection::texture_name;

use super::args::{Expecting, Features, Recordings, false_alarm, length, rising};
use super::progress::with_progress;
use super::table_file::{Force, beside, spare_input, write_file};
use super::textures::{collection, measure_folder};

/// Learn a texture table from the first slides of every texture
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tactus learn --recordings DIR --out table
  tactus learn --recordings DIR --method paper --out table     the table of the paper's method
  tactus learn --recordings DIR --lengths 1,2,3 --out table    and what slides say after 1, 2 and 3 s
  tactus device table push table                               gives it to the probe
  tactus learn --recordings DIR --out - | tactus device table push - --yes")]
pub(crate) struct Args {
    #[command(flatten)]
    from: Recordings,
    /// Slides to learn from, per texture and movement: the first ones of the session, or as many as there are, two at
    /// least
    #[arg(long, value_name = "N", default_value_t = 5)]
    train_slides: usize,
    /// The way of deciding that the table is for: fused, or the others, which share one kind of table
    #[arg(long, value_enum, default_value_t = Method::Fused)]
    method: Method,
    /// What a fused table is learned from; the best that every slide has, unless given
    #[arg(long, value_enum)]
    features: Option<Features>,
    #[command(flatten)]
    expecting: Expecting,
    /// Share of the known textures that may be taken for new ones, unless `identify` says otherwise
    #[arg(long, value_name = "SHARE", default_value_t = FALSE_ALARM, value_parser = false_alarm)]
    false_alarm: f32,
    /// Learn the first parts of the slides too, of these lengths, s at constant speed, such as 1,2,3: slides may end
    /// early then. The image tactus-rig takes such a table, the others refuse it
    #[arg(long, value_name = "S,S,...", value_delimiter = ',', value_parser = length)]
    lengths: Vec<u16>,
    /// Leave out what only a PC needs, the note of the slides, and how the table does with new textures: a shorter
    /// table, which tells names without asking whether a new texture would get them
    #[arg(long)]
    plain: bool,
    /// The file to write; "-": standard output
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    #[command(flatten)]
    force: Force,
}

/// Learn a handheld probe's table from slides of a simulated hand
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tactus learn-by-hand --out table
  tactus learn-by-hand --textures burlap,47,'silk satin' --out table")]
pub(crate) struct ByHand {
    /// The file to write; "-": standard output
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    #[command(flatten)]
    force: Force,
    /// Textures of Table 1, by number or name; all 117 unless given
    #[arg(long, value_name = "T,T,...", value_delimiter = ',')]
    textures: Vec<String>,
    /// Slides per texture
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(2..=255))]
    trials: u32,
    /// Another seed is another world, and another hand
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// The finger that slides: biotac, analog or mems
    #[arg(long, value_name = "NAME", default_value_t = FingerName::Biotac)]
    finger: FingerName,
}

/// The folder, in which no file of recordings is replaced.
fn recordings_of(args: &Args) -> anyhow::Result<PathBuf> {
    let folder = args.from.folder()?;
    spare_input(&args.out, &folder)?;
    Ok(folder)
}

pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    let folder = recordings_of(args)?;
    let (set, mut measured) = measure_folder(&folder, &args.from.only)?;
    if !args.lengths.is_empty() {
        // the first parts have few frames
        let slides = measured.iter_mut().flatten();
        slides.for_each(MeasuredSlide::with_coarse_bands);
    }
    let features = args.features.map(Features::set);
    let expected = Expected {
        drift: Some(args.expecting.drift),
        false_alarm: args.false_alarm,
    };
    let bytes = learn_first(
        &set,
        &measured,
        args.train_slides,
        args.method,
        features,
        &expected,
    )
    .with_context(|| folder.display().to_string())?;
    let bytes = with_lengths(args, &set, bytes, &expected)?;
    let taught = taught(&set, &measured, args.train_slides)?;
    let tables = open_set::tables(&taught) as u64;
    let bytes = if args.plain {
        tactus_link::for_probe(&Table::read(&bytes)?)
    } else {
        with_progress(tables, "leaving textures out", |done| {
            open_set::with_figures(bytes, &expected, &taught, done)
        })?
    };
    write_file(&args.out, &bytes, args.force)?;
    let out = &mut beside(&args.out, out);
    let learned = learned_textures(&set, &measured)?;
    writeln!(
        out,
        "{}: {} learned from the first {} of each, {} bytes",
        args.out.display(),
        count(learned.textures.len() as u64, "texture"),
        count(args.train_slides as u64, "slide"),
        bytes.len()
    )?;
    for note in &learned.notes {
        writeln!(out, "{note}")?;
    }
    let observed = taught
        .iter()
        .map(|row| open_set::select(row, |s| s.learned));
    let observed: Vec<_> = observed.collect();
    writeln!(out, "{}", basis::in_words(Table::read(&bytes)?, &observed))?;
    if let Some(figures) = Table::read(&bytes)?.open_set() {
        writeln!(out, "{}", open_set::in_lines(&figures))?;
        if let Some(missing) = open_set::not_known(&taught) {
            writeln!(out, "{missing}")?;
        }
    }
    let fewest = |texture: &usize| {
        let of = |movement: &Movement| {
            let slides = measured[*texture].iter();
            slides.filter(|s| s.movement == *movement).count()
        };
        learned.movements.iter().map(of).min().unwrap_or(0)
    };
    let there: Vec<usize> = learned.textures.iter().map(fewest).collect();
    let short = there.iter().filter(|n| **n < args.train_slides).count();
    if let Some(fewest) = there.into_iter().min().filter(|_| short > 0) {
        let (short, wanted) = (count(short as u64, "texture"), args.train_slides);
        writeln!(
            out,
            "Fewer than {wanted} slides at a movement have {short}, {fewest} at least: all of them are learned from."
        )?;
    }
    if !args.plain && !Table::read(&bytes)?.learned_slides().all {
        writeln!(
            out,
            "It notes {MAX_LEARNED} of the slides that it was learned from, and not the others."
        )?;
    }
    Ok(())
}

/// The table with what the first parts of its slides say, if that was asked for.
fn with_lengths(
    args: &Args,
    set: &RecordingSet,
    bytes: Vec<u8>,
    expected: &Expected,
) -> anyhow::Result<Vec<u8>> {
    if args.lengths.is_empty() {
        return Ok(bytes);
    }
    let lengths_ms = rising(&args.lengths)?;
    let table = Table::read(&bytes)?;
    ensure!(
        !table.is_paced(),
        "--lengths: these slides have speeds of their own, as those of a hand; a table knows speeds or lengths, not \
         both"
    );
    let textures = set.textures().len() as u64;
    let slides = with_progress(textures, "measuring first parts", |done| {
        measure_cut(set, &lengths_ms, |_| done())
    })?;
    let features = args.features.map(Features::set);
    let shorter = (0..).zip(&lengths_ms).map(|(n, &ms)| {
        let mut of_length = of_length(&slides, n);
        let all = of_length.iter_mut().flatten();
        all.for_each(MeasuredSlide::with_coarse_bands);
        let movements = (0..).zip(table.movements());
        let longer = movements.filter(|(_, movement)| is_longer(&slides, *movement, n));
        let movements = longer.map(|(at, _)| 1_u64 << at).sum();
        let (slides, method) = (args.train_slides, args.method);
        let table = learn_first(set, &of_length, slides, method, features, expected)?;
        Ok((ms, table, movements))
    });
    let shorter = shorter.collect::<anyhow::Result<Vec<_>>>()?;
    if let Some((ms, ..)) = shorter.iter().find(|(.., movements)| *movements == 0) {
        bail!(
            "--lengths: no movement's slides are all longer than {} s",
            f64::from(*ms) / 1e3
        );
    }
    Ok(know_lengths(&bytes, &shorter)?)
}

pub(crate) fn by_hand(args: &ByHand, out: &mut impl Write) -> anyhow::Result<()> {
    let collection = collection(&args.textures, args.trials, args.seed)?.touched_by(args.finger);
    let textures = collection.textures.len() as u64;
    let (bytes, left_out) = with_progress(textures, "sliding by hand", |done| {
        tactus_lab::sim::handheld::learn(&collection, done)
    })?;
    write_file(&args.out, &bytes, args.force)?;
    let out = &mut beside(&args.out, out);
    writeln!(
        out,
        "{}: {} learned from {} of each by hand, {} bytes",
        args.out.display(),
        count(
            (collection.textures.len() - left_out.len()) as u64,
            "texture"
        ),
        count(args.trials, "slide"),
        bytes.len()
    )?;
    for number in left_out {
        let name = texture_name(number);
        writeln!(out, "left out, no good slide of it: {name}")?;
    }
    Ok(())
}

/// Returns the slides as their first parts of the `n`th length. What stands for one that is not longer says nothing:
/// see [`is_longer`].
fn of_length(slides: &[Vec<CutSlide>], n: usize) -> Vec<Vec<MeasuredSlide>> {
    let cut = |slide: &CutSlide| {
        let mut cut = slide.whole.clone();
        if let Some(first) = &slide.first[n] {
            cut.measurement.clone_from(first);
        }
        cut
    };
    let rows = slides.iter();
    rows.map(|row| row.iter().map(cut).collect()).collect()
}

/// Says whether all slides of a movement last longer than the `n`th length.
fn is_longer(slides: &[Vec<CutSlide>], movement: Movement, n: usize) -> bool {
    let mut all = slides.iter().flatten();
    all.all(|slide| slide.whole.movement != movement || slide.first[n].is_some())
}
