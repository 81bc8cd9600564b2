//! What the host asks of the probe.

use heapless::Vec;
use serde::{Deserialize, Serialize};

use crate::explorer::{Config, Method, Strategy};
use crate::rig::arm::ArmReport;
use crate::table::{Contents, MAX_TEXTURES, Name, is_false_alarm};

/// Bytes of a table in one message.
pub const PART: usize = 256;

/// From the host.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Request {
    /// Comes back in the answer.
    pub id: u16,
    /// What is asked for.
    pub command: Command,
}

/// What the host may ask for. The probe ends every request with [`super::Event::Done`] or [`super::Event::Refused`]; it
/// sends what it does in between, and the data that was asked for, before that.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum Command {
    /// Asks how the probe is: [`super::Event::Status`].
    Status,
    /// Ends a fault, then finds the limit switches.
    Home,
    /// Stops what is being done and lifts the finger.
    Stop,
    /// Finds out what lies under the finger.
    Identify(Identify),
    /// The label of the texture in the last exploration: one of the textures known, or a new one. The probe learns it
    /// from the slides of that exploration.
    Label(Name),
    /// Learns what lies under the finger.
    Train(Train),
    /// Gives a texture another name.
    Rename {
        /// Its name.
        from: Name,
        /// Its new name.
        to: Name,
    },
    /// Deletes what was learned.
    Forget(Forget),
    /// Measures the motor's current without load, uses and stores it, and reports the constants:
    /// [`super::Event::Calibration`].
    Calibrate,
    /// Asks for the constants in use: [`super::Event::Calibration`].
    ReadCalibration,
    /// Takes and keeps these constants: [`crate::rig::calibration::RigCalibration::to_bytes`].
    WriteCalibration(Vec<u8, 64>),
    /// True if the probe sends raw samples: [`super::Event::Block`].
    Stream(bool),
    /// Asks for the table in use from this byte on: [`super::Event::TablePart`].
    ReadTable(u32),
    /// A table of so many bytes follows.
    BeginTable(u32),
    /// The next bytes of it.
    WriteTable {
        /// Where they belong.
        offset: u32,
        /// The bytes.
        bytes: Vec<u8, PART>,
    },
    /// The table is complete: from now on it is the one in use, if it is whole.
    CommitTable,
    /// Goes back to the table that came with the firmware.
    FactoryTable,
    /// Measures P_DC under a weight of so many mN that a person puts on the finger: [`super::Event::Weighed`].
    Weigh(u16),
    /// Finds out whether what lies under the finger is the one texture it is among: [`super::Event::Verified`] after
    /// every slide, and no verdict.
    Verify(Identify),
    /// Keeps the share of false alarms that limits are for, where a request does not say otherwise; `None`: each
    /// table's own.
    SetFalseAlarm(Option<f32>),
    /// Keeps whether movements may press with up to 2 N: only for a finger whose mount yields, or whose lever is
    /// stopped, before 2.2 N.
    SetHighForce(bool),
    /// Measures gravity along a finger with an accelerometer, which a person turns over: [`super::Event::Turned`].
    TurnOver,
    /// An arm that moves the finger says how far it has come with what [`super::Event::Arm`] asked for: whenever that
    /// changes, and at least every 100 ms while it is open. Only a probe that an arm moves takes it, at any time.
    Arm(ArmReport),
}

/// An exploration.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Identify {
    /// Indices of the textures that it may be; none stands for all.
    pub among: Vec<u16, MAX_TEXTURES>,
    /// A texture more probable than this is the answer.
    pub threshold: f32,
    /// After this many slides the most probable texture is the answer.
    pub max_slides: u8,
    /// How slides are compared with the table; the best one for the table, unless given.
    pub method: Option<Method>,
    /// How the next movement is chosen.
    pub strategy: Strategy,
    /// True if the answer may be that it is none of them.
    pub open: bool,
    /// True if the probe learns from a verdict that is certain.
    pub learn: bool,
    /// For random choices, and for where on the sample slides begin.
    pub seed: u32,
    /// Share of the known textures that may be taken for new ones; that of the probe's settings, or the
    /// table's own, unless given.
    pub false_alarm: Option<f32>,
}

impl Default for Identify {
    /// Among all textures, by the table's own method: until one is more probable than 0.99, with at most 10 slides
    /// (PAPER).
    fn default() -> Self {
        Self {
            among: Vec::new(),
            threshold: 0.99,
            max_slides: 10,
            method: None,
            strategy: Strategy::default(),
            open: true,
            learn: false,
            seed: 0,
            false_alarm: None,
        }
    }
}

impl Identify {
    /// What it means for a table of such contents.
    pub fn config(&self, contents: Contents) -> Config {
        Config {
            method: self.method.unwrap_or(Method::of(contents)),
            strategy: self.strategy,
            threshold: self.threshold,
            max_slides: self.max_slides,
            open: self.open,
            false_alarm: self.false_alarm.filter(|share| is_false_alarm(*share)),
            learn: self.learn,
            ..Config::default()
        }
    }
}

/// What is to be deleted.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum Forget {
    /// A texture, whether the probe learned it from the user or by itself.
    Texture(Name),
    /// All that the probe has learned by itself: the table is again as the user trained it.
    SelfLearned,
    /// The unfinished training of a texture, or a finished pilot.
    Training(Name),
}

/// A texture to learn.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Train {
    /// Its name. One that is known already goes on where it stood.
    pub name: Name,
    /// How often each movement is to have been made in the end.
    pub trials: u8,
    /// All movements of the grid up to 1.26 N, or 2 N where [`Command::SetHighForce`] allows it, instead of those of
    /// the table.
    pub pilot: bool,
    /// For where on the sample slides begin.
    pub seed: u32,
}
