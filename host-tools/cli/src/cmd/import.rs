//! `tactus import`: recordings of others in the project's format.

use std::collections::{BTreeSet, HashMap};
use std::io::Write;
use std::path::PathBuf;

use anyhow::{Context as _, ensure};
use tactus_lab::data::import::foreign::{Found, Survey};
use tactus_lab::data::import::settings::{SETTINGS, Settings};
use tactus_lab::data::import::{self, is_known};
use tactus_lab::eval::show::count;

use super::progress::progress;

/// Most files that are drawn.
const DRAWN: usize = 8;

/// Bring recordings of any sensor: WAV, tables, numpy arrays, MCAP of a probe, or a published data set
#[derive(clap::Args)]
#[command(after_help = "\
What the files do not say is found by looking at them, and told. What cannot be found is asked for; give it as an
option, or in the file import.toml beside the data, which a first look writes with --template.

The texture is the folder of a file, or its name without the number at the end, or what --texture says; folders such
as day2 or session-1 are sessions. Long sliding is divided into slides, which are marked as of one run. A file that
cannot be read is left out and named, where most others can.

Examples:
  tactus import my-wavs recordings                      # cotton/1.wav, cotton/2.wav, silk/1.wav ...
  tactus import log.csv recordings --texture material   # a column names the texture
  tactus import slides.npz recordings                   # X with a row for each slide, y its texture, fs the rate
  tactus import data recordings --rate 1000 --channel z --texture '{session}/{texture}_*.csv'
  tactus import data recordings --dry-run               # shows what was found, and writes nothing
  tactus import day2 more --like recordings             # another day, to be compared with the first
  git clone https://github.com/dexrob/BioTac_slide_20_50
  tactus import BioTac_slide_20_50 recordings")]
pub(crate) struct Args {
    /// A file, a folder of files, or a published data set
    from: PathBuf,
    /// The folder to write; it must not hold recordings yet
    #[arg(required_unless_present_any = ["dry_run", "template"])]
    to: Option<PathBuf>,
    /// Show what was found, and write nothing
    #[arg(long)]
    dry_run: bool,
    /// Write import.toml with what was found, to be corrected, and nothing else
    #[arg(long, conflicts_with = "dry_run")]
    template: bool,
    /// Take rate, channel, gain and all else that is not given from recordings that were imported before: slides are
    /// comparable at the same gain only
    #[arg(long, value_name = "RECORDINGS")]
    like: Option<PathBuf>,
    #[command(flatten)]
    settings: Settings,
}

pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    match &args.to {
        Some(to) if is_known(&args.from) => known(args, to, out),
        _ => signals(args, out),
    }
}

/// A layout that says everything itself.
fn known(args: &Args, to: &std::path::Path, out: &mut impl Write) -> anyhow::Result<()> {
    ensure!(
        args.settings == Settings::default() && args.like.is_none(),
        "{}: these recordings say all themselves: leave out --finger, --rate and whatever else describes them",
        args.from.display()
    );
    let bar = progress(0, "importing slides");
    let imported = import::import(&args.from, to, &mut |done, all| {
        bar.set_length(all as u64);
        bar.set_position(done as u64);
    })?;
    bar.finish_and_clear();
    let textures = count(imported.textures as u64, "texture");
    let slides = count(imported.slides as u64, "slide");
    writeln!(out, "{}: {textures}, {slides}", to.display())?;
    for slide in &imported.left_out {
        writeln!(out, "left out: {slide}")?;
    }
    for slide in &imported.clipped {
        writeln!(out, "kept: {slide}")?;
    }
    Ok(())
}

fn signals(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    let mut settings = args.settings.clone();
    if let Some(folder) = &args.like {
        let of = folder.join(SETTINGS);
        ensure!(
            of.is_file(),
            "{}: no such file; --like takes a folder that `tactus import` wrote",
            of.display()
        );
        settings = settings.with_file(folder)?;
    }
    let bar = progress(0, "looking at files");
    let survey = Survey::of(&args.from, settings, &|done, all| {
        bar.set_length(all as u64);
        bar.set_position(done as u64);
    });
    bar.finish_and_clear();
    let survey = survey?;
    tell(&survey, out)?;
    if args.template {
        let path = survey.folder().join(SETTINGS);
        ensure!(
            !path.exists(),
            "{} is there already; change it, or remove it first",
            path.display()
        );
        tactus_lab::data::whole::write_whole(&path, survey.settings().template())
            .with_context(|| path.display().to_string())?;
        writeln!(out, "{}: correct it, then import again", path.display())?;
        return Ok(());
    }
    let Some(to) = args.to.as_ref().filter(|_| !args.dry_run) else {
        writeln!(out, "nothing is written (--dry-run)")?;
        return Ok(());
    };
    let bar = progress(survey.slides() as u64, "writing slides");
    let left_out = survey.write(to, &|done, _| bar.set_position(done as u64))?;
    bar.finish_and_clear();
    for slide in &left_out {
        writeln!(out, "left out: {slide}")?;
    }
    let cut: usize = survey.found.iter().map(|found| found.slides.len()).sum();
    let slides = count(cut.saturating_sub(left_out.len()) as u64, "slide");
    writeln!(out, "{}: written, {slides}", to.display())?;
    Ok(())
}

/// What was found, as a picture and a table.
fn tell(survey: &Survey, out: &mut impl Write) -> anyhow::Result<()> {
    let files = count(survey.found.len() as u64, "recording");
    writeln!(
        out,
        "{files} ({}), {} Hz",
        survey.kind,
        figures(survey.rate_hz)
    )?;
    if survey.is_stretched() {
        writeln!(
            out,
            "  too slow for vibration of a fingertip: its clock is taken for one of 2200 Hz, frequencies appear {} \
             times as high",
            figures(2200.0 / survey.rate_hz)
        )?;
    } else if survey.rate_hz < 2200.0 {
        let highest = survey.rate_hz / 2.0;
        writeln!(
            out,
            "  nothing over {} Hz was measured; bands above are left out",
            figures(highest)
        )?;
    }
    channels(survey, out)?;
    let still = survey.found.iter().filter(|found| found.still).count();
    match still {
        0 => writeln!(
            out,
            "  no still part in any: the sensor's background is not measured"
        )?,
        n => writeln!(out, "  a still part, the background, in {n} of them")?,
    }
    let gaps: Vec<&Found> = survey.found.iter().filter(|found| found.gaps > 0).collect();
    for found in &gaps {
        let slides = count(found.gaps as u64, "slide");
        writeln!(
            out,
            "  {}: {slides} left out, samples are missing in the middle",
            found.path
        )?;
    }
    for found in survey.found.iter().take(DRAWN) {
        writeln!(out, "{} ({:.1} s)", found.path, found.seconds)?;
        writeln!(out, "  {}", envelope(found))?;
        writeln!(out, "  {}", marks(found))?;
    }
    if survey.found.len() > DRAWN {
        writeln!(out, "... and {} more", survey.found.len() - DRAWN)?;
    }
    writeln!(
        out,
        "{:<40} {:>10} {:>8} {:>8}",
        "texture", "recordings", "slides", "sessions"
    )?;
    let mut of: HashMap<&str, (usize, usize, BTreeSet<&str>)> = HashMap::new();
    for found in &survey.found {
        let (files, slides, sessions) = of.entry(&found.texture).or_default();
        *files += 1;
        *slides += found.slides.len();
        sessions.extend([found.session.as_str()].iter().filter(|s| !s.is_empty()));
    }
    for texture in &survey.textures {
        let (files, slides, sessions) = of.remove(texture.as_str()).unwrap_or_default();
        let sessions = sessions.len();
        writeln!(out, "{texture:<40} {files:>10} {slides:>8} {sessions:>8}")?;
    }
    Ok(())
}

/// The channels and their gains, and what nothing said.
fn channels(survey: &Survey, out: &mut impl Write) -> anyhow::Result<()> {
    let (channel, gain) = (&survey.channel, figures(survey.gain));
    match survey.unit() {
        "counts" if survey.gain == 1.0 => writeln!(out, "  channel {channel}, in counts")?,
        unit => writeln!(out, "  channel {channel}, {gain} counts per {unit}")?,
    }
    match (survey.pressure(), survey.pressure_gain) {
        (Some(column), Some(gain)) => {
            let gain = figures(gain);
            writeln!(out, "  P_DC from {column}, {gain} counts per unit")?;
        }
        (Some(column), None) => writeln!(out, "  no P_DC: {column} never changes")?,
        (None, _) => {}
    }
    for note in &survey.notes {
        writeln!(out, "  {note}")?;
    }
    for why in &survey.left_out {
        writeln!(out, "  left out: {why}")?;
    }
    Ok(())
}

/// Three figures.
fn figures(x: f64) -> String {
    match x.abs() {
        100.0.. => format!("{x:.0}"),
        1.0.. => format!("{x:.1}"),
        _ => format!("{x:.3}"),
    }
}

fn envelope(found: &Found) -> String {
    const STEPS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
    let step = |x: &f32| STEPS[((x * 8.0) as usize).min(7)];
    found.envelope.iter().map(step).collect()
}

fn marks(found: &Found) -> String {
    let width = found.envelope.len();
    let mut line = vec![' '; width];
    for (from, to) in &found.slides {
        let at = |part: &f32| ((part * width as f32) as usize).min(width);
        let (from, to) = (at(from), at(to));
        for (place, mark) in line.iter_mut().enumerate().take(to).skip(from) {
            *mark = if place == from { '|' } else { '-' };
        }
    }
    line.into_iter().collect::<String>().trim_end().to_owned()
}
