//! What a page asks of a probe at a line, and what it gets.

use serde::{Deserialize, Serialize};
use tactus_core::wire::Phase;
use tactus_link::operations::Training;

use super::operations::Wanted;
use crate::live::{Happening, KnownTable};

/// What is asked for.
#[derive(Clone, PartialEq, Debug, Deserialize)]
#[serde(tag = "do", rename_all = "kebab-case")]
pub enum Request {
    /// A line is open, and a probe is to be at its other end.
    Connect {
        /// What the line is called.
        port: String,
        /// Now, ms since any moment.
        now_ms: u64,
    },
    /// Time has passed, and bytes may have come.
    Step {
        /// Now, ms since that moment.
        now_ms: u64,
        /// What came since the last step.
        #[serde(default)]
        received: Vec<u8>,
    },
    /// The line is closed.
    Closed,
    /// Something is to be done with the probe.
    Work {
        /// What.
        work: Work,
    },
    /// Stops what is being done, and lifts the finger.
    Stop,
    /// Answers the question of the last [`Frame`].
    Answer {
        /// Whether to go on.
        yes: bool,
    },
    /// The log of the session so far, as a file.
    Log,
    /// Files that were [given](super::Remote::give), in this order: a session's log, or recordings. A session is heard as if the probe said it now.
    Open {
        /// What they are called, with the folders that they lie in.
        files: Vec<String>,
    },
    /// The samples of a slide of the recordings that were opened last: [`Frame::streams`].
    Recorded {
        /// Which of them, from 0.
        at: usize,
    },
}

/// What is to be done with a probe.
#[derive(Clone, PartialEq, Debug, Deserialize)]
#[serde(tag = "do", rename_all = "kebab-case")]
pub enum Work {
    /// How it is.
    Status,
    /// Ends a fault, and finds the limit switches.
    Home,
    /// What lies under its finger.
    Identify {
        /// A texture more probable than this is the answer.
        threshold: f32,
        /// Share of the known textures that may be taken for new ones; the probe's own, unless given.
        false_alarm: Option<f32>,
        /// After so many slides the most probable texture is the answer.
        max_slides: u8,
        /// For where on the sample slides begin.
        seed: u32,
    },
    /// What it explored last is called so.
    Teach {
        /// The name.
        name: String,
    },
    /// It learns what lies under its finger from new slides.
    Train(Training),
    /// Whether what lies under its finger is this texture.
    Verify {
        /// One of its textures.
        name: String,
        /// "The same" has to be more probable than this.
        threshold: f32,
        /// After so many slides it stays unsure.
        max_slides: u8,
        /// For where on the sample slides begin.
        seed: u32,
    },
    /// Slides in the project's format.
    Record(Wanted),
    /// A texture gets another name.
    Rename {
        /// One of its textures.
        from: String,
        /// The new name.
        to: String,
    },
    /// It forgets a texture; its table is kept in a file first.
    Forget {
        /// One of its textures.
        name: String,
    },
    /// It forgets an unfinished training; its table is kept in a file first.
    ForgetTraining {
        /// The name.
        name: String,
    },
    /// It forgets what it learned by itself; its table is kept in a file first.
    ForgetSelfLearned,
    /// It goes back to the table that came with its firmware; the one before is kept in a file first.
    Factory,
    /// What it keeps besides its table and its calibration.
    Settings,
    /// For which share of false alarms its limits are.
    FalseAlarm {
        /// The share; that of its table, unless given.
        share: Option<f32>,
    },
    /// Whether its movements may press with up to 2 N.
    HighForce {
        /// Whether.
        on: bool,
    },
    /// A copy of its table.
    Pull,
    /// It uses another table from now on; the one before is kept in a file first.
    Push {
        /// What the table's file is called.
        file: String,
        /// The table.
        bytes: Vec<u8>,
    },
}

/// The answer.
#[derive(Clone, PartialEq, Debug, Serialize)]
#[serde(tag = "is", rename_all = "kebab-case")]
#[allow(clippy::large_enum_variant)] // one at a time
pub enum Reply {
    /// What has been since the last one.
    Frame(Frame),
    /// The request makes no sense, and why.
    Error {
        /// A sentence.
        why: String,
    },
}

/// A moment, and what has been since the last one.
#[derive(Clone, PartialEq, Debug, Serialize, Default)]
pub struct Frame {
    /// To be sent to the probe.
    pub send: Vec<u8>,
    /// Whether a probe is at the other end.
    pub connected: bool,
    /// Whether something is being done.
    pub busy: bool,
    /// What the rig does.
    pub phase: Option<Phase>,
    /// Contact force, N.
    pub force_n: f64,
    /// Place of the stage, mm.
    pub stage_mm: f64,
    /// Speed of the stage, mm/s.
    pub speed_mm_s: f64,
    /// Time of the probe, ms.
    pub at_ms: u32,
    /// P_AC of still finger and slide, counts about the still finger's, at 2200 Hz.
    pub pac: Vec<i16>,
    /// Spectra, as those of [`live::Frame`](crate::live::Frame).
    pub spectra: Vec<Vec<i8>>,
    /// What the probe said.
    pub happened: Vec<Happening>,
    /// What it knows, where that has become something else.
    pub known: Option<KnownTable>,
    /// In a log: what it knew from each of these places in `happened` on.
    pub tables: Vec<(usize, KnownTable)>,
    /// What `tactus device` prints.
    pub said: String,
    /// What went wrong, and what to do.
    pub failed: Option<String>,
    /// A question that has to be answered before anything goes on.
    pub question: Option<Question>,
    /// Of recordings: the samples of a slide that was asked for.
    pub streams: Option<Streams>,
    /// Files to be kept.
    pub files: Vec<File>,
    /// Folders to be kept.
    pub folders: Vec<Folder>,
}

/// A question, and what can be said to it.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Question {
    /// The question.
    pub asked: String,
    /// What goes on.
    pub yes: &'static str,
    /// What does not, or goes on otherwise.
    pub no: &'static str,
}

/// The samples of a recorded slide.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Streams {
    /// So many samples of P_AC are of the still finger, and come first.
    pub still: usize,
    /// P_AC, counts about the still finger's, at 2200 Hz.
    pub pac: Vec<i16>,
    /// Its spectra, as those of [`live::Frame`](crate::live::Frame).
    pub spectra: Vec<Vec<i8>>,
    /// P_DC, counts about the still finger's.
    pub pdc: Vec<i16>,
    /// Of these, Hz.
    pub pdc_rate_hz: u32,
    /// Tangential force, mN; none where it was not measured.
    pub shear_mn: Vec<i16>,
    /// Of these, Hz.
    pub shear_rate_hz: u32,
}

/// A file.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct File {
    /// Its name.
    pub name: String,
    /// What is in it.
    pub bytes: Vec<u8>,
}

/// A folder of files.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Folder {
    /// Its name.
    pub name: String,
    /// What is in it.
    pub files: Vec<File>,
}
