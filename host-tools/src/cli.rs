//! The arguments of every command, and what `--help` teaches.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};
use tactus::evaluate::Method;
use tactus::experiment::Protocol;
use tactus_core::explorer::Config;
use tactus_core::fused::FeatureSet;

/// Tactus tells what a surface is by touching it.
#[derive(Parser)]
#[command(version, about = "Tactus tells what a surface is by touching it", long_about = "Tactus tells what a surface is by touching it: it slides a BioTac fingertip, measures traction, roughness and \
fineness, and chooses each next movement so as to tell the remaining candidates apart (Bayesian exploration, Fishel & \
Loeb 2012).\n\nThis command runs the core of the firmware, the same code, on recordings and on a simulated rig.", after_help = FIRST_STEPS)]
pub(crate) struct Tactus {
    #[command(subcommand)]
    pub(crate) command: Option<Command>,
}

pub(crate) const FIRST_STEPS: &str = "\
Try first:
  tactus                                           a simulated probe recognises an unknown texture
  tactus identify --simulated --texture burlap     another one
With a folder of recordings, such as ../shared/data/biotac:
  tactus identify --recordings DIR --material 3    a real texture is recognised from its slides
  tactus features --recordings DIR                 what was felt of every slide
  tactus evaluate --recordings DIR                 how often the answers are right, and how sure
With a probe, or with the emulated board that `cargo xtask emulate` builds:
  tactus device list                               which port it is at
  tactus device monitor [--emulated]               what it feels, live

No recordings are shipped. The publisher of the BioTac's has them at
https://github.com/dexrob/BioTac_slide_20_50; `tactus import` reads them. `tactus simulate` makes some.";

#[derive(Subcommand)]
pub(crate) enum Command {
    /// Print the properties and band powers of every recorded slide
    Features {
        #[command(flatten)]
        from: Recordings,
        /// How to print them
        #[arg(long, value_enum, default_value_t = Rows::Text)]
        format: Rows,
    },
    /// Learn a texture table from the first slides of every texture
    Learn {
        #[command(flatten)]
        from: Recordings,
        /// Slides to learn from, per texture and movement: the first ones of the session
        #[arg(long, value_name = "N", default_value_t = 5)]
        train_slides: usize,
        /// The way of deciding that the table is for: fused, or the others, which share one kind of table
        #[arg(long, value_enum, default_value_t = Method::Fused)]
        method: Method,
        /// What a fused table is learned from; the best that every slide has, unless given
        #[arg(long, value_enum)]
        features: Option<Features>,
        /// The file to write
        #[arg(long, value_name = "FILE")]
        out: PathBuf,
    },
    /// Look into a texture table
    #[command(subcommand)]
    Table(TableCommand),
    /// Recognise an unknown texture from its slides, and show every step
    Identify(Identify),
    /// Play thousands of virtual explorations and count the right answers
    #[command(after_help = "\
Every run learns from slides drawn anew (--protocol says from which), takes one texture as unknown and lets the method
choose; each slide it asks for is drawn from the test slides of that texture. It stops when a texture is more probable
than --threshold, or after --max-slides.

With --properties FILE, slides are rows of texture,movement,trial,set,traction,roughness,fineness, where set is train or
validate, and an action is any (movement, property) pair.

With --fabrics DIR, the folder is one of FabricSlide: fabrics at many movements, learned from one repetition and tested on
the other.

--novelty leaves one texture after the other out of the table and counts how often it is noticed, and how often a known one
is taken for new. --lifelong plays a session in time order: the first slides are learned, and every later one is a visit.
Both need the method fused.

Try:
  tactus evaluate --recordings DIR --protocol drift
  tactus evaluate --recordings DIR --method paper
  tactus evaluate --recordings DIR --novelty leave-one-out
  tactus evaluate --recordings DIR --lifelong")]
    Evaluate(Evaluate),
    /// Record slides on the simulated rig, in the project's format
    Simulate {
        /// The folder to write; it must not hold recordings yet
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
        /// Textures of Table 1, by number or name; all 117 unless given
        #[arg(long, value_name = "T,T,...", value_delimiter = ',')]
        textures: Vec<String>,
        /// Trials per texture and movement
        #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
        trials: u32,
        /// Another seed is another world: other textures of the same names
        #[arg(long, default_value_t = 1)]
        seed: u64,
    },
    /// Learn a handheld probe's table from slides of a simulated hand
    LearnByHand {
        /// The file to write
        #[arg(long, value_name = "FILE")]
        out: PathBuf,
        /// Textures of Table 1, by number or name; all 117 unless given
        #[arg(long, value_name = "T,T,...", value_delimiter = ',')]
        textures: Vec<String>,
        /// Slides per texture
        #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(2..=255))]
        trials: u32,
        /// Another seed is another world, and another hand
        #[arg(long, default_value_t = 1)]
        seed: u64,
    },
    /// Make the paper's whole study on the simulated rig, and report it beside the published numbers
    #[command(after_help = "\
pilot     ten textures, 36 movements: which three movements are most useful (figs. 5, 6, 7)
train     117 textures, three movements: the table, correlations, confusion, wear of the skin (Table 3, figs. 8, 9)
pairs     eight pairs of similar textures at 99.9 % (Table 4)
identify  16 textures among 117 at 99 %: cycling, random, Bayesian exploration, fused (Table 5, figs. 3, 4, 10)
all       all of it

The folder gets report.html, which needs nothing else, every figure as .svg, every table as .csv, the tables in the chip's
format, and study.json. The same command gives the same files on any number of cores.

Try:
  tactus study all --out study
  tactus study identify --seeds 11-20 --out worlds     the same in ten worlds")]
    Study(Study),
    /// Work with a probe at its serial port, or with the emulated board
    #[command(subcommand, after_help = crate::device::EXAMPLES)]
    Device(crate::device::Device),
    /// Print completions for a shell
    #[command(after_help = crate::manual::COMPLETIONS)]
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
    /// Write the manual pages
    Man {
        /// The folder to write; without it the first page is printed
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
    },
    /// Convert recordings into the project's format (.npy files and a CSV manifest)
    Import {
        /// A folder in the layout of data/biotac, or the publisher's folders of CSV files
        from: PathBuf,
        /// The folder to write; it must not hold recordings yet
        to: PathBuf,
    },
}

#[derive(Args)]
pub(crate) struct Recordings {
    /// Folder of recordings
    #[arg(long, value_name = "DIR")]
    pub(crate) recordings: PathBuf,
}

#[derive(Subcommand)]
pub(crate) enum TableCommand {
    /// Print what the table holds
    Show {
        /// The table
        file: PathBuf,
    },
    /// Check the table, and say which check fails
    Check {
        /// The table
        file: PathBuf,
    },
}

#[derive(Args)]
pub(crate) struct Study {
    /// Which part of it
    #[arg(value_enum)]
    pub(crate) stage: Stage,
    /// The folder to write: new, or empty
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Another seed is another world: other textures of the same names, another finger and rig
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    /// Pairs and identification in these worlds, too
    #[arg(long, value_name = "A-B", value_parser = seeds)]
    pub(crate) seeds: Option<Seeds>,
    /// Virtual explorations of each way of exploring; each of the eight pairs has an eighth of them
    #[arg(long, value_name = "N", default_value_t = 8000, value_parser = clap::value_parser!(u64).range(16..=1_000_000))]
    pub(crate) simulations: u64,
    /// How much one touch of a texture differs from the next, 0 to 3: the world's one free knob
    #[arg(long, value_name = "X", default_value_t = tactus::study::VARIATION, value_parser = variation)]
    pub(crate) variation: f64,
    /// How to print the figures; json is what study.json holds
    #[arg(long, value_enum, default_value_t = Format::Text)]
    pub(crate) format: Format,
}

/// Parts of the study.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
pub(crate) enum Stage {
    Pilot,
    Train,
    Pairs,
    Identify,
    All,
}

/// Worlds from the first to the last.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Seeds(pub(crate) u64, pub(crate) u64);

/// Most worlds of one study: each takes minutes.
const MAX_WORLDS: u64 = 100;

fn seeds(text: &str) -> Result<Seeds, String> {
    let (first, last) = text.split_once('-').unwrap_or((text, text));
    match (first.parse(), last.parse()) {
        (Ok(first), Ok(last)) if first <= last && last - first < MAX_WORLDS => {
            Ok(Seeds(first, last))
        }
        _ => Err(format!(
            "the first and the last seed, at most {MAX_WORLDS} of them, such as 11-20"
        )),
    }
}

fn variation(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(x) if (0.0..=3.0).contains(&x) => Ok(x),
        _ => Err("a factor from 0 to 3, such as 1".to_owned()),
    }
}

#[derive(Args)]
pub(crate) struct Identify {
    /// Folder of recordings
    #[arg(
        long,
        value_name = "DIR",
        required_unless_present = "simulated",
        conflicts_with = "simulated"
    )]
    pub(crate) recordings: Option<PathBuf>,
    /// The recorded texture to present as unknown: its number or its name
    #[arg(
        long,
        value_name = "M",
        required_unless_present = "simulated",
        conflicts_with = "simulated"
    )]
    pub(crate) material: Option<String>,
    /// Explore live on the simulated rig, in place of recordings
    #[arg(long)]
    pub(crate) simulated: bool,
    /// The texture to put under the simulated finger: its name in Table 1 or its number; drawn by the seed unless given
    #[arg(long, value_name = "NAME", requires = "simulated")]
    pub(crate) texture: Option<String>,
    /// How many textures the simulated probe knows; the unknown one is among them
    #[arg(long, value_name = "N", default_value_t = 20, requires = "simulated", value_parser = clap::value_parser!(u8).range(2..=117))]
    pub(crate) among: u8,
    /// Texture table to use; without it one is learned from slides drawn at random, and the rest are presented
    #[arg(long, value_name = "FILE", conflicts_with = "simulated")]
    pub(crate) table: Option<PathBuf>,
    /// Slides per texture to learn from, where no table is given
    #[arg(long, value_name = "N", default_value_t = 5)]
    pub(crate) train_slides: usize,
    /// How to decide, and how the next movement is chosen: fused, or what the table is for
    #[arg(long, value_enum)]
    pub(crate) method: Option<Method>,
    #[command(flatten)]
    pub(crate) stop: Stop,
    /// Another seed draws other slides; with --simulated also another world, and another texture unless one is given
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
}

#[derive(Args, Clone)]
pub(crate) struct Stop {
    /// Stop when a texture is more probable than this
    #[arg(long, default_value_t = 0.99, value_parser = probability)]
    pub(crate) threshold: f32,
    /// Stop after this many slides
    #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(u8).range(1..=254))]
    pub(crate) max_slides: u8,
}

impl Stop {
    pub(crate) fn config(&self, method: Method) -> Config {
        Config {
            method: method.method(),
            strategy: method.strategy(),
            threshold: self.threshold,
            max_slides: self.max_slides,
            open: false,
        }
    }
}

fn probability(text: &str) -> Result<f32, String> {
    match text.parse() {
        Ok(p) if 0.0 < p && p <= 1.0 => Ok(p),
        _ => Err("a probability between 0 and 1, such as 0.99; 1 is never exceeded".to_owned()),
    }
}

#[derive(Args, Clone)]
pub(crate) struct Evaluate {
    /// Folder of recordings
    #[arg(
        long,
        value_name = "DIR",
        required_unless_present_any = ["properties", "fabrics"],
        conflicts_with_all = ["properties", "fabrics"]
    )]
    pub(crate) recordings: Option<PathBuf>,
    /// CSV file of properties in place of recordings
    #[arg(long, value_name = "FILE")]
    pub(crate) properties: Option<PathBuf>,
    /// Folder of FabricSlide in place of recordings
    #[arg(long, value_name = "DIR", conflicts_with = "properties")]
    pub(crate) fabrics: Option<PathBuf>,
    /// The repetition of the fabrics to learn from, 1 or 2; the other one is tested
    #[arg(long, value_name = "N", default_value_t = 1, requires = "fabrics", value_parser = clap::value_parser!(u8).range(1..=2))]
    pub(crate) repetition: u8,
    /// Folder to take the test slides from; training slides still come from --recordings
    #[arg(long, value_name = "DIR", requires = "recordings")]
    pub(crate) test: Option<PathBuf>,
    /// How to decide and to choose the next movement
    #[arg(long, value_enum, default_value_t = Method::Fused)]
    pub(crate) method: Method,
    /// What the method fused looks at; the best that every slide has, unless given
    #[arg(long, value_enum)]
    pub(crate) features: Option<Features>,
    /// Count how textures that were not learned are noticed
    #[arg(long, value_enum, conflicts_with = "lifelong")]
    pub(crate) novelty: Option<Novelty>,
    /// Play a session in time order, in which the probe goes on learning
    #[arg(long)]
    pub(crate) lifelong: bool,
    /// Slides to learn from, per texture and movement: 5 unless given, or all training rows of --properties
    #[arg(long, value_name = "N")]
    pub(crate) train_slides: Option<usize>,
    /// Which slides to learn from and which to test on; --properties says so itself, in its column set
    #[arg(long, value_enum, default_value_t = Protocol::Interleaved)]
    pub(crate) protocol: Protocol,
    /// Number of virtual explorations
    #[arg(long, default_value_t = 8000, value_parser = clap::value_parser!(u64).range(1..=10_000_000))]
    pub(crate) runs: u64,
    #[command(flatten)]
    pub(crate) stop: Stop,
    /// The same seed gives the same figures, whatever the number of cores
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    /// How to print the figures
    #[arg(long, value_enum, default_value_t = Format::Text)]
    pub(crate) format: Format,
}

/// How novelty is tried.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Novelty {
    /// One texture after the other is left out of the table
    LeaveOneOut,
}

/// What a fused table is learned from.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Features {
    /// Traction and twelve band powers
    Force,
    /// Mean and standard deviation of P_DC, and the band powers: for a rig without force sensing
    Pressure,
    /// The band powers alone
    Bands,
    /// The three properties of the paper
    Properties,
}

impl Features {
    pub(crate) fn set(self) -> FeatureSet {
        match self {
            Self::Force => FeatureSet::Force,
            Self::Pressure => FeatureSet::Pressure,
            Self::Bands => FeatureSet::Bands,
            Self::Properties => FeatureSet::Properties,
        }
    }
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Rows {
    /// Comma-separated, for programs
    Csv,
    /// Aligned, for people
    Text,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Format {
    /// For people
    Text,
    /// One object, for programs
    Json,
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    #[test]
    fn the_command_line_is_consistent() {
        super::Tactus::command().debug_assert();
    }
}
