//! Contents of the display, before they are drawn.

use heapless::Vec;

use super::guidance::{Again, Phase, View, Way};
use super::spelling::{Place, WHEEL};
use crate::explorer::LEADING;
use crate::table::Name;

/// Entries of a list that are shown at once.
pub const LINES: usize = 4;

/// Troubles that keep the probe from working.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Trouble {
    /// No readable word of the sensor.
    Silent,
    /// P_AC, which always has noise, never changes.
    Frozen,
    /// The table or the store.
    Memory(&'static str),
}

/// A texture and its probability.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Row<'a> {
    /// Its name.
    pub name: &'a str,
    /// 0 to 1.
    pub probability: f32,
}

/// A line of a list.
#[derive(Clone, PartialEq, Debug)]
pub enum Entry<'a> {
    /// A texture of the table, or what can be done.
    Text(&'a str),
    /// A new texture, with this name.
    Numbered(Name),
}

/// Facts of the page about the probe.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct About {
    /// Version of the firmware.
    pub version: &'static str,
    /// Share of time that the core was awake while the sensor's words were wanted, 0 to 1.
    pub awake: Option<f32>,
    /// The same while they were not.
    pub awake_at_rest: Option<f32>,
    /// Sensor slots that came too late.
    pub late: u32,
    /// Words that were lost.
    pub lost: u32,
    /// Day on which the force was set by weights, as 20261121; 0 if it was not, 1 if the day is unknown.
    pub calibrated: u32,
    /// Share of the memory for textures that is taken, 0 to 1.
    pub memory: f32,
}

/// The screens.
#[derive(Clone, PartialEq, Debug)]
pub enum Screen<'a> {
    /// The finger is to be held in the air: P_DC's zero is taken.
    Air,
    /// An episode may begin.
    Ready {
        /// Textures that are known.
        textures: u16,
    },
    /// The finger is to be pressed.
    Press {
        /// The slide it is for.
        slide: u8,
        /// Largest number of slides.
        of: u8,
        /// Contact force, mN.
        force_mn: f32,
        /// It is down.
        down: bool,
    },
    /// The finger is to be slid, or slides.
    Slide {
        /// As in `Press`.
        slide: u8,
        /// As in `Press`.
        of: u8,
        /// As in `Press`.
        force_mn: f32,
        /// Part that is done, 0 to 1; `None` before it begins.
        progress: Option<f32>,
        /// The way so far.
        way: Way,
    },
    /// The slide is made: the finger is to be lifted.
    Lift {
        /// Its number.
        slide: u8,
    },
    /// A known weight is to be put on the finger.
    Weigh {
        /// The weight, mN.
        mn: u16,
        /// Contact force, mN.
        force_mn: f32,
    },
    /// The finger is to point straight down, or up, and to be still.
    Turn {
        /// It has been still the first way, and is to be turned over.
        over: bool,
    },
    /// A slide was no good.
    Again {
        /// The reason.
        why: Again,
        /// The finger is still down.
        lift: bool,
    },
    /// The slides are compared.
    Thinking {
        /// Their number.
        slide: u8,
    },
    /// The verdict.
    Verdict {
        /// The leading candidates.
        rows: Vec<Row<'a>, LEADING>,
        /// The first one is 99 % sure.
        sure: bool,
        /// Further slides may decide; then there are two rows at most.
        open: bool,
    },
    /// It is one of those known, but not as it was learned.
    Changed {
        /// The leading candidates, that one first.
        rows: Vec<Row<'a>, LEADING>,
    },
    /// It is none of those known.
    Unknown {
        /// Most similar textures.
        like: Vec<Row<'a>, LEADING>,
    },
    /// Result of a comparison with one texture.
    Compared {
        /// That texture.
        name: &'a str,
        /// True if it is; `None`: not sure.
        same: Option<bool>,
        /// Another slide may decide.
        open: bool,
        /// From how many slides that texture was learned.
        trials: u8,
    },
    /// A list: the texture's name, and others.
    Choose {
        /// Subject of the choice.
        title: &'a str,
        /// Index of the chosen entry.
        at: u16,
        /// Number of entries.
        count: u16,
        /// Those about it.
        entries: Vec<Entry<'a>, LINES>,
    },
    /// A name is spelled.
    Spell {
        /// So far.
        text: &'a str,
        /// The letters about the one that is taken next, in the middle.
        wheel: [Place; WHEEL],
    },
    /// The table is written.
    Saving,
    /// The name that was learned, or the reason why nothing was.
    Learned(Result<&'a Name, &'a str>),
    /// A trouble that keeps the probe from working.
    Fault(&'a Trouble),
    /// The probe.
    About(About),
    /// Nothing: the display is off.
    Dark,
}

impl Screen<'_> {
    /// The screen of a touch that is for slide `slide` of at most `of`.
    pub fn touching(view: &View, slide: u8, of: u8) -> Self {
        let force_mn = view.force_mn;
        match view.phase {
            Phase::Slide | Phase::Sliding => Self::Slide {
                slide,
                of,
                force_mn,
                progress: (view.phase == Phase::Sliding).then_some(view.progress),
                way: view.way,
            },
            phase => Self::Press {
                slide,
                of,
                force_mn,
                down: phase != Phase::Air,
            },
        }
    }
}

/// The first entry that is shown of a list, so that the chosen one is.
pub(crate) fn first_line(at: u16, count: u16) -> u16 {
    let lines = LINES as u16;
    at.saturating_sub(1).min(count.saturating_sub(lines))
}
