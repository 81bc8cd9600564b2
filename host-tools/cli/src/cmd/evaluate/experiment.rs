//! The arguments of `tactus evaluate`, and the experiment that they describe.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, ensure};
use clap::ValueEnum;
use serde::Serialize;
use tactus_lab::data::import::settings::Settings;
use tactus_lab::data::properties::PropertyTable;
use tactus_lab::eval::evaluate::Method;
use tactus_lab::eval::experiment::{Experiment, Protocol};
use tactus_lab::eval::learn::Expected;

use crate::cmd::args::{Expecting, Features, Only, Recordings, Stop};
use crate::cmd::output::Format;
use crate::cmd::plot::Plot;
use crate::cmd::textures::measure_folder;

/// Play thousands of virtual explorations and count the right answers
#[derive(clap::Args, Clone)]
#[command(after_help = "\
Every run learns from slides drawn anew (--protocol says from which), takes one texture as unknown and lets the
method choose; each slide it asks for is drawn from the test slides of that texture. It stops when a texture is more
probable than --threshold, or after --max-slides.

First comes what a user would have been told by `tactus identify`: a name as sure, which is right or wrong, \"none
of those I know\", \"most like\" a name where the table would be sure of a wrong one for too many new textures, or
\"not sure\", which is undecided. There the texture may be none of the known ones, no slide comes twice, and the
exploration ends when the recordings run out. Then come the figures of explorations in which it must be one of the
known ones and slides are drawn with replacement, as in the paper.

With --properties FILE, slides are rows of texture,movement,trial,set,traction,roughness,fineness, where set is
train or validate, and an action is any (movement, property) pair.

leave-one-session-out and leave-one-run-out test one session, or run of the machine, after the other, and learn from
the others: the figure for another day. Textures with too few slides are left out and named; where these are half or
more of them, all are learned from fewer slides.

--novelty leaves one texture after the other out of the table and counts how often it is noticed, and how often a
known one is taken for new. --verify holds the slides of each texture against its own reference and against those of
three others, as `tactus verify` does, and counts the errors: at the limits, and where both are equal. These need the
method fused.

--plot draws what is told of each texture (confusion), or with --verify one error against the other (trade-off).

Examples:
  tactus evaluate --recordings DIR --protocol drift
  tactus evaluate --recordings DIR --protocol leave-one-session-out
  tactus evaluate --recordings DIR --method paper
  tactus evaluate --recordings DIR --novelty leave-one-out
  tactus evaluate --recordings DIR --plot pictures
  tactus evaluate --recordings DIR --verify --protocol blocked")]
pub(crate) struct Args {
    #[command(flatten)]
    pub(crate) from: Recordings,
    /// CSV file of properties in place of recordings
    #[arg(long, value_name = "FILE", conflicts_with = "recordings")]
    pub(crate) properties: Option<PathBuf>,
    /// Folder to take the test slides from; training slides still come from --recordings
    #[arg(long, value_name = "DIR", conflicts_with = "properties")]
    pub(crate) test: Option<PathBuf>,
    /// How to decide and to choose the next movement
    #[arg(long, value_enum, default_value_t = Method::Fused)]
    pub(crate) method: Method,
    /// What the method fused looks at; the best that every slide has, unless given
    #[arg(long, value_enum)]
    pub(crate) features: Option<Features>,
    /// Count how textures that were not learned are noticed
    #[arg(long, value_enum, conflicts_with = "plot")]
    pub(crate) novelty: Option<Novelty>,
    /// Count how often slides are rightly called the same as a reference, and how often wrongly
    #[arg(long, conflicts_with = "novelty")]
    pub(crate) verify: bool,
    /// It is one of the textures known, and the explorer knows it: nothing is told to be new, and names are told as
    /// sure
    #[arg(long, conflicts_with_all = ["novelty", "verify"])]
    pub(crate) closed: bool,
    /// As with `identify --learn`: two slides at least; count how often the probe would learn by itself, and wrongly
    #[arg(long, conflicts_with_all = ["verify", "closed"])]
    pub(crate) learn: bool,
    /// Slides to learn from, per texture and movement: 5 unless given, or all training rows of --properties
    #[arg(long, value_name = "N")]
    pub(crate) train_slides: Option<usize>,
    /// Which slides to learn from and which to test on; --properties says so itself, in its column set
    #[arg(long, value_enum, default_value_t = Protocol::Interleaved)]
    pub(crate) protocol: Protocol,
    /// Number of virtual explorations, 8000 unless given
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..=10_000_000))]
    pub(crate) runs: Option<u64>,
    #[command(flatten)]
    pub(crate) expecting: Expecting,
    #[command(flatten)]
    pub(crate) stop: Stop,
    /// The same seed gives the same figures, whatever the number of cores
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    /// How to print the figures
    #[arg(long, value_enum, default_value_t = Format::Text)]
    pub(crate) format: Format,
    #[command(flatten)]
    pub(crate) plot: Plot,
}

impl Args {
    pub(crate) fn runs(&self) -> u64 {
        self.runs.unwrap_or(8000)
    }
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Novelty {
    /// One texture after the other is left out of the table, or one group after the other with --left-out
    LeaveOneOut,
}

/// Figures of a kind, with the conditions that they were measured under.
#[derive(Serialize)]
pub(crate) struct Figures<'n, T> {
    method: Method,
    pub(crate) protocol: &'static str,
    pub(crate) train_slides: usize,
    pub(crate) notes: &'n [String],
    pub(crate) runs: u64,
    pub(crate) seed: u64,
    #[serde(flatten)]
    pub(crate) of: &'n T,
}

impl<'n, T> Figures<'n, T> {
    pub(crate) fn new(
        args: &Args,
        from: &'n Experiment,
        protocol: &'static str,
        of: &'n T,
    ) -> Self {
        Self {
            method: args.method,
            protocol,
            train_slides: from.train_slides,
            notes: &from.notes,
            runs: args.runs(),
            seed: args.seed,
            of,
        }
    }
}

pub(crate) fn open(args: &Args) -> anyhow::Result<(Experiment, &'static str)> {
    let (experiment, name) = if let Some(file) = &args.properties {
        let set = PropertyTable::read(file)?;
        let experiment = Experiment::given(&set, args.train_slides, args.seed)
            .with_context(|| file.display().to_string())?;
        (experiment, "properties")
    } else {
        let folder = args.from.folder()?;
        let (set, measured) = measure_folder(&folder, &args.from.only)?;
        let test = args.test.as_deref();
        let test = test
            .map(|test| measure_folder(test, &Only::default()))
            .transpose()?;
        if let Some((test, _)) = &test {
            let gain = |of: &Path| anyhow::Ok(Settings::default().with_file(of)?.gain);
            if let (Some(here), Some(there)) = (gain(&folder)?, gain(test.folder())?) {
                ensure!(
                    here == there,
                    "{} was imported at {there} counts per unit, and {} at {here}: import it again with `--like {}`",
                    test.folder().display(),
                    folder.display(),
                    folder.display()
                );
            }
            let [here, there] = [set.sensor()?, test.sensor()?];
            ensure!(
                (here.finger, &here.name) == (there.finger, &there.name),
                "--test has slides of the sensor {there}, and the others are of {here}: they cannot be compared"
            );
        }
        let test = test.map(|(set, measured)| (set.names(), measured));
        let test = test
            .as_ref()
            .map(|(names, measured)| (names.as_slice(), measured.as_slice()));
        let (names, slides) = (set.names(), args.train_slides.unwrap_or(5));
        let experiment =
            Experiment::recorded(names, &measured, test, args.protocol, slides, args.seed)?;
        (experiment, args.protocol.name())
    };
    let features = args.features.map(Features::set);
    let experiment = experiment.expecting(expected(args));
    Ok((experiment.with_features(features), name))
}

pub(super) fn expected(args: &Args) -> Expected {
    Expected {
        drift: Some(args.expecting.drift),
        ..Expected::default()
    }
}
