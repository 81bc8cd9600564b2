//! The requests of a page to a probe at a line, and the replies.

use serde::{Deserialize, Serialize};
use tactus_core::wire::Phase;
use tactus_link::operations::Training;

use super::operations::Wanted;
use crate::live::{Happening, KnownTable};

#[derive(Deserialize)]
#[serde(tag = "do", rename_all = "kebab-case")]
pub(super) enum Request {
    /// A line is open, and a probe is to be at its other end.
    Connect {
        port: String,
        now_ms: u64,
    },
    /// Time has passed, and bytes may have come.
    Step {
        now_ms: u64,
        #[serde(default)]
        received: Vec<u8>,
    },
    Closed,
    Work {
        work: Work,
    },
    /// Stops the work, and lifts the finger.
    Stop,
    Answer {
        yes: bool,
    },
    /// The log of the session so far, as a file.
    Log,
}

#[derive(Deserialize)]
#[serde(tag = "do", rename_all = "kebab-case")]
pub(super) enum Work {
    Status,
    Home,
    Identify {
        threshold: f32,
        /// the probe's own, unless given
        false_alarm: Option<f32>,
        max_slides: u8,
        seed: u32,
    },
    Teach {
        name: String,
    },
    Train(Training),
    Verify {
        name: String,
        threshold: f32,
        max_slides: u8,
        seed: u32,
    },
    Record(Wanted),
    Rename {
        from: String,
        to: String,
    },
    Forget {
        name: String,
    },
    ForgetTraining {
        name: String,
    },
    ForgetSelfLearned,
    Factory,
    Settings,
    FalseAlarm {
        /// the table's, unless given
        share: Option<f32>,
    },
    HighForce {
        on: bool,
    },
    Pull,
    Push {
        file: String,
        bytes: Vec<u8>,
    },
}

#[derive(Serialize)]
#[serde(tag = "is", rename_all = "kebab-case")]
#[allow(clippy::large_enum_variant)] // one at a time
pub(super) enum Reply {
    Frame(Frame),
    Error { why: String },
}

#[derive(Serialize)]
pub(super) struct Frame {
    pub(super) send: Vec<u8>,
    pub(super) connected: bool,
    pub(super) busy: bool,
    pub(super) phase: Option<Phase>,
    pub(super) force_n: f64,
    pub(super) stage_mm: f64,
    pub(super) speed_mm_s: f64,
    pub(super) at_ms: u32,
    /// counts about the still finger's, at 2200 Hz
    pub(super) pac: Vec<i16>,
    pub(super) spectra: Vec<Vec<i8>>,
    pub(super) happened: Vec<Happening>,
    /// where that has become something else
    pub(super) known: Option<KnownTable>,
    pub(super) said: String,
    pub(super) failed: Option<String>,
    /// must be answered before anything goes on
    pub(super) question: Option<Question>,
    /// to be kept, as the folders
    pub(super) files: Vec<File>,
    pub(super) folders: Vec<Folder>,
}

#[derive(Serialize)]
pub(super) struct Question {
    pub(super) asked: String,
    pub(super) yes: &'static str,
    pub(super) no: &'static str,
}

#[derive(Serialize)]
pub(super) struct File {
    pub(super) name: String,
    pub(super) bytes: Vec<u8>,
}

#[derive(Serialize)]
pub(super) struct Folder {
    pub(super) name: String,
    pub(super) files: Vec<File>,
}
