//! The arguments of `tactus device`.

use std::ffi::OsString;
use std::path::PathBuf;

use clap::{Args, Subcommand};
use tactus::evaluate::Method;

use super::port::Where;
use crate::cli::{Format, Stop};

pub(crate) const EXAMPLES: &str = "\
Try first:
  tactus device list                         the serial ports, and which of them is a board
  tactus device monitor --emulated           the emulated board, live (cargo xtask emulate builds it)
  tactus device status                       how the probe is that is plugged in
  tactus device identify --log visit.jsonl   what lies under its finger
  tactus device log replay visit.jsonl       the same decisions, computed again on this PC

Ctrl-C stops the rig and waits until the finger is lifted; the exit code is 130 then.";

#[derive(Subcommand)]
pub(crate) enum Device {
    /// List the serial ports, boards first
    List,
    /// Say how the probe is: rig, faults, table, counters
    Status {
        #[command(flatten)]
        at: Where,
        /// How to print it
        #[arg(long, value_enum, default_value_t = Format::Text)]
        format: Format,
    },
    /// Watch the probe live, and have it identify, home or stop by a key
    Monitor {
        #[command(flatten)]
        at: Where,
        #[command(flatten)]
        how: Exploration,
    },
    /// Have the probe find out what lies under its finger, and show every step
    Identify {
        #[command(flatten)]
        at: Where,
        #[command(flatten)]
        how: Exploration,
    },
    /// Have the probe learn the texture under its finger from new slides; an unfinished training goes on where it stood
    Train {
        #[command(flatten)]
        at: Where,
        /// What lies under the finger
        name: String,
        /// How often each movement is to have been made in the end
        #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u8).range(1..))]
        trials: u8,
        /// All movements of the grid up to 1.26 N instead of the table's: to find out which tell textures apart
        #[arg(long)]
        pilot: bool,
        /// Where on the sample slides begin; drawn anew unless given
        #[arg(long)]
        seed: Option<u32>,
    },
    /// Tell the probe what it felt in its last exploration; it learns that
    Teach {
        #[command(flatten)]
        at: Where,
        /// What lies under the finger: a texture that it knows, or a new one
        name: String,
    },
    /// Give a texture of the probe another name
    Rename {
        #[command(flatten)]
        at: Where,
        /// Its name
        from: String,
        /// Its new name
        to: String,
    },
    /// Have the probe forget a texture, an unfinished training, or all that it learned by itself
    Forget {
        #[command(flatten)]
        at: Where,
        #[command(flatten)]
        what: What,
    },
    /// Record slides in the project's format, for `tactus learn` and `tactus evaluate`
    Record {
        #[command(flatten)]
        at: Where,
        /// The textures to record, in the order in which they are laid under the finger
        #[arg(required = true)]
        textures: Vec<String>,
        /// The folder to write; it must not hold recordings yet
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
        /// Slides of each texture; movements of the probe's table take turns
        #[arg(long, value_name = "N", default_value_t = 15, value_parser = clap::value_parser!(u8).range(1..=254))]
        slides: u8,
        /// Where on the sample slides begin; drawn anew unless given
        #[arg(long)]
        seed: Option<u32>,
    },
    /// Look at the probe's texture table, fetch it, give it another
    #[command(subcommand)]
    Table(TableCommand),
    /// Measure what differs from rig to rig, or show and set it
    #[command(after_help = "\
Examples:
  tactus device calibrate                   measures the motor's current without load; the date is today's
  tactus device calibrate --show            what is in use
  tactus device calibrate --drifted         for a finger that says in the air that it is not: forgets the old date first
  tactus device calibrate --newton-per-ampere 16.2 --force-mn-per-count 11.4
                                            also takes what was measured on an incline and on a scale")]
    Calibrate {
        #[command(flatten)]
        at: Where,
        #[command(flatten)]
        how: Constants,
    },
    /// End a fault and find the limit switches
    Home {
        #[command(flatten)]
        at: Where,
    },
    /// Stop what is being done and lift the finger
    Stop {
        #[command(flatten)]
        at: Where,
    },
    /// Flash a firmware image with probe-rs
    #[command(after_help = "\
Examples:
  tactus device flash target/debian/thumbv7em-none-eabihf/firmware/tactus-rig
  tactus device flash ELF -- --probe 0483:374b:SER   if there are several: `probe-rs list` names them
`cargo xtask flash` builds the firmware and flashes it.")]
    Flash(Flash),
    /// Look into the log of a session (--log)
    #[command(subcommand)]
    Log(LogCommand),
}

/// How to explore.
#[derive(Args, Clone)]
pub(crate) struct Exploration {
    #[command(flatten)]
    pub(super) stop: Stop,
    /// How to decide and to choose the next movement; the best for the probe's table unless given
    #[arg(long, value_enum)]
    pub(super) method: Option<Method>,
    /// The textures that it may be; all unless given
    #[arg(long, value_name = "T,T,...", value_delimiter = ',')]
    pub(super) among: Vec<String>,
    /// It is one of the textures known: never answer that it is none
    #[arg(long)]
    pub(super) closed: bool,
    /// Let the probe learn from an answer that it is certain of
    #[arg(long)]
    pub(super) learn: bool,
    /// Where on the sample slides begin, and random choices; drawn anew unless given
    #[arg(long)]
    pub(super) seed: Option<u32>,
}

#[derive(Args)]
#[group(required = true, multiple = false)]
pub(crate) struct What {
    /// A texture, whoever taught it
    #[arg(long, value_name = "NAME", id = "forgotten")]
    pub(super) name: Option<String>,
    /// An unfinished training
    #[arg(long, value_name = "NAME")]
    pub(super) training: Option<String>,
    /// All that the probe has learned by itself: its table is again as it was taught
    #[arg(long)]
    pub(super) self_taught: bool,
}

#[derive(Subcommand)]
pub(crate) enum TableCommand {
    /// Print what the probe's table holds
    Show {
        #[command(flatten)]
        at: Where,
    },
    /// Write the probe's table to a file
    Pull {
        #[command(flatten)]
        at: Where,
        /// The file to write
        file: PathBuf,
    },
    /// Check a table, give it to the probe, and compare what it holds then
    Push {
        #[command(flatten)]
        at: Where,
        /// The table, as `tactus learn` or `table pull` wrote it
        file: PathBuf,
    },
    /// Go back to the table that came with the firmware
    Factory {
        #[command(flatten)]
        at: Where,
    },
}

#[derive(Args)]
pub(crate) struct Constants {
    /// Print what is in use, and change nothing
    #[arg(long, conflicts_with_all = ["drifted", "date", "newton_per_ampere", "force_mn_per_count"])]
    pub(super) show: bool,
    /// The finger has drifted further than the probe believes: forget what P_DC was in the air, and measure it anew
    #[arg(long)]
    pub(super) drifted: bool,
    /// The day of the calibration, as 20261121; today unless given
    #[arg(long, value_name = "YYYYMMDD", value_parser = clap::value_parser!(u32).range(20_000_101..=29_991_231))]
    pub(super) date: Option<u32>,
    /// Shear per motor current, N/A, from pulls on an inclined stage
    #[arg(long, value_name = "X")]
    pub(super) newton_per_ampere: Option<f32>,
    /// Contact force per count of P_DC, mN, from presses on a scale
    #[arg(long, value_name = "X")]
    pub(super) force_mn_per_count: Option<f32>,
}

#[derive(Args)]
pub(crate) struct Flash {
    /// The image: what `cargo xtask build` names
    pub(super) elf: PathBuf,
    /// Stay attached and show the image's log until Ctrl-C
    #[arg(long)]
    pub(super) attach: bool,
    /// Print what would be run
    #[arg(long)]
    pub(super) dry_run: bool,
    /// Options for probe-rs
    #[arg(last = true)]
    pub(super) options: Vec<OsString>,
}

#[derive(Subcommand)]
pub(crate) enum LogCommand {
    /// Compute every decision of the session again, and compare
    Replay {
        /// The log
        file: PathBuf,
    },
    /// Show the session's explorations as they were shown live
    Show {
        /// The log
        file: PathBuf,
    },
}
