//! State of the probe: pages of the display, the button, the buzzer, and the jobs on the table.

use heapless::Vec;

mod asked;
mod lists;
mod pressed;

pub use self::lists::Choice;
use self::lists::{Entries, List};

use super::button::Button;
use super::guidance::{Again, Event};
use super::judge::{ASK_AFTER, JudgeError, Judgement, MAX_SLIDES, trials};
use super::screen::{About, Row, Screen, Trouble};
use super::speed::Moved;
use super::spelling::Spelling;
use super::touch::Touch;
use crate::dsp::Plan;
use crate::explorer::LEADING;
use crate::features::Observation;
use crate::sensor::pressure::Pressure;
use crate::table::{Name, Table};

/// Ticks in a second.
pub const TICKS_HZ: u32 = 100;
/// Slides that a texture is learned from when the person began with training.
const TRAINING_SLIDES: usize = 3;
/// Textures that a verdict shows if further slides may change it.
const OPEN_ROWS: usize = 2;
/// Idle time after which the display goes dark and the sensor rests, ticks.
const DARK_AFTER: u32 = 60 * TICKS_HZ;
/// "Again" is shown at least this long, ticks.
const AGAIN: u32 = 3 * TICKS_HZ / 2;
/// Time for which a learned name is shown, ticks.
const LEARNED: u32 = 3 * TICKS_HZ;
/// Time without a word that is a fault, ticks: the sensor needs 10 to start.
const NO_WORDS: u32 = 50;

/// A job on the table, for the task that owns it.
#[derive(Clone, PartialEq, Debug)]
#[allow(clippy::large_enum_variant)] // no allocation here, and only one at a time
pub enum Job {
    /// Compare these slides with the table ([`judge`](super::judge())), and call [`Handheld::judged`].
    Judge {
        /// The slides of this episode.
        slides: Vec<Observation, MAX_SLIDES>,
        /// The only texture to compare them with.
        reference: Option<u16>,
    },
    /// Learn the episode that was judged last as this texture, and call [`Handheld::learned`].
    Teach(Choice),
}

/// The slide that the host wants.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct RequestedSlide {
    /// Its number, from 1.
    pub slide: u8,
    /// Largest number of slides; 0 if unknown.
    pub of: u8,
}

/// The result of the host's request.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Answer {
    /// The slide was made, and is good.
    Slid,
    /// The person has declined.
    GivenUp,
    /// Nothing was touched for a minute.
    Nobody,
    /// Sensor or memory fail.
    Trouble,
}

#[derive(Clone, PartialEq, Debug)]
enum Page {
    /// Nothing begun.
    Ready,
    /// An episode: the finger is to be pressed and slid.
    Touching,
    /// The host's slide is made: the finger is to be lifted.
    Lift,
    /// The host requests P_DC in the air.
    Air,
    /// The host requests P_DC under a weight of so many mN.
    Weigh(u16),
    /// The finger is to be turned over; true if it has been still the first way.
    Turn(bool),
    /// A slide was no good; the slides before it stand.
    Again(Again),
    /// The job is being done.
    Thinking,
    /// The verdict of the slides: `judgement`.
    Verdict,
    /// An entry of a list.
    Choose(List, u16),
    Spell(Spelling),
    Saving,
    Learned(Result<Name, &'static str>),
    Fault(Trouble),
    About,
    Dark,
}

/// A step of a melody: Hz, 0 for silence, and ticks.
type Note = (u16, u8);

/// The probe.
pub struct Handheld<'p> {
    touch: Touch<'p>,
    button: Button,
    page: Page,
    /// Ticks since the page began, and since anything happened.
    shown: u32,
    idle: u32,
    silent: u32,
    episode: Vec<Observation, MAX_SLIDES>,
    judgement: Option<Judgement>,
    /// The slides are for learning, not for identifying.
    training: bool,
    reference: Option<u16>,
    /// The go / no-go output is to be set.
    go: Option<bool>,
    textures: u16,
    job: Option<Job>,
    melody: &'static [Note],
    note: u8,
    fresh: bool,
    /// The host's slide, and the result of its request.
    asked: Option<RequestedSlide>,
    answer: Option<Answer>,
}

const CLICK: &[Note] = &[(2000, 2)];
const SLIDE: &[Note] = &[(2700, 8)];
const GOOD: &[Note] = &[(2000, 6), (2700, 10)];
const BAD: &[Note] = &[(900, 12), (0, 6), (900, 12)];
const SURE_IT_IS: &[Note] = &[(2000, 8), (2400, 8), (2700, 16)];
const NOT_KNOWN: &[Note] = &[(1800, 10), (0, 4), (1400, 16)];
const ALARM: &[Note] = &[(700, 30), (0, 10), (700, 30)];

impl<'p> Handheld<'p> {
    /// A probe that was just switched on, with a table of so many textures.
    pub fn new(plan: &'p Plan, textures: u16) -> Self {
        Self {
            touch: Touch::new(plan),
            button: Button::default(),
            page: Page::Ready,
            shown: 0,
            idle: 0,
            silent: 0,
            episode: Vec::new(),
            judgement: None,
            training: false,
            reference: None,
            go: None,
            textures,
            job: None,
            melody: &[],
            note: 0,
            fresh: true,
            asked: None,
            answer: None,
        }
    }

    /// A sensor word, 4400 a second while [`Handheld::listens`]; `None` is a damaged or late one.
    pub fn word(&mut self, word: Option<Pressure>) {
        if !self.listens() {
            return;
        }
        self.silent = 0;
        if let Some(event) = self.touch.word(word) {
            self.on_touch(event);
        }
    }

    /// A reading of the sensor of motion, every 10 ms.
    pub fn moved(&mut self, moved: Moved) {
        self.touch.moved(moved);
    }

    /// So many words were lost on the way.
    pub fn lose(&mut self, words: u32) {
        self.touch.lose(words);
    }

    fn end(&mut self, answer: Answer) {
        self.answer = Some(answer);
        self.asked = None;
        self.begin();
    }

    /// Takes the job on the table; each is given once.
    pub fn job(&mut self) -> Option<Job> {
        self.job.take()
    }

    /// Takes the result of [`Job::Judge`].
    pub fn judged(&mut self, judged: Result<Judgement, JudgeError>) {
        if !matches!(self.page, Page::Thinking) {
            return;
        }
        let judgement = match judged {
            Ok(judgement) => judgement,
            Err(why) => {
                return self.fail(Trouble::Memory(match why {
                    JudgeError::NoLimits => "These textures cannot be compared. Learn them anew.",
                    _ => "These textures are not for a handheld. Load others.",
                }));
            }
        };
        let go_on = if self.training {
            self.episode.len() < TRAINING_SLIDES
        } else {
            judgement.open && self.reference.is_none() && self.episode.len() < ASK_AFTER
        };
        if go_on {
            self.judgement = Some(judgement);
            self.sound(GOOD);
            self.show(Page::Touching);
        } else if self.training {
            self.judgement = Some(judgement);
            self.sound(SURE_IT_IS);
            self.show(Page::Choose(List::Name, 0));
        } else {
            self.show_verdict(judgement);
        }
    }

    fn show_verdict(&mut self, judgement: Judgement) {
        self.sound(if judgement.unknown {
            NOT_KNOWN
        } else if judgement.sure {
            SURE_IT_IS
        } else {
            GOOD
        });
        if self.reference.is_some() {
            self.go = Some(judgement.sure);
        }
        self.judgement = Some(judgement);
        self.show(Page::Verdict);
    }

    fn compare(&mut self, reference: u16) {
        self.clear_episode();
        self.reference = Some(reference);
        self.go = Some(false);
        self.show(Page::Touching);
    }

    /// Takes the new level of the go / no-go output: on where it is the same, and off when the next comparison begins.
    pub fn go(&mut self) -> Option<bool> {
        self.go.take()
    }

    /// Takes the result of [`Job::Teach`]: the name that was learned, or the reason why none was. The table now has
    /// `textures` textures.
    pub fn learned(&mut self, learned: Result<Name, &'static str>, textures: u16) {
        self.textures = textures;
        if !matches!(self.page, Page::Saving) {
            return;
        }
        self.sound(if learned.is_ok() { SURE_IT_IS } else { ALARM });
        self.show(Page::Learned(learned));
    }

    /// The store or the table cannot be used.
    pub fn memory_failed(&mut self, why: &'static str) {
        self.fail(Trouble::Memory(why));
    }

    /// Returns true if the sensor's words are wanted.
    pub fn listens(&self) -> bool {
        match &self.page {
            Page::Ready
            | Page::Touching
            | Page::Lift
            | Page::Air
            | Page::Weigh(_)
            | Page::Turn(_)
            | Page::Again(_)
            | Page::Thinking
            | Page::Verdict => true,
            // it may come back
            Page::Fault(trouble) => !matches!(trouble, Trouble::Memory(_)),
            Page::Choose(..)
            | Page::Spell(_)
            | Page::Saving
            | Page::Learned(_)
            | Page::About
            | Page::Dark => false,
        }
    }

    /// Returns true if the finger is on something.
    pub fn is_touched(&self) -> bool {
        self.touch.is_down()
    }

    /// Tone of the buzzer, Hz.
    pub fn tone(&self) -> Option<u16> {
        let (hz, _) = self.melody.first()?;
        (*hz > 0).then_some(*hz)
    }

    /// Returns true if the display has changed since the last call.
    pub fn is_new(&mut self) -> bool {
        let moves = matches!(
            self.page,
            Page::Ready | Page::Touching | Page::Lift | Page::Weigh(_) | Page::Again(_)
        );
        core::mem::take(&mut self.fresh) || moves
    }

    /// Number of textures in the table.
    pub fn textures(&self) -> u16 {
        self.textures
    }

    /// Returns true if the display names textures, so that [`Handheld::screen`] needs the table.
    pub(crate) fn names_textures(&self) -> bool {
        matches!(self.page, Page::Verdict | Page::Choose(..))
    }

    /// The screen to draw.
    pub fn screen<'s>(&'s self, table: Option<&Table<'s>>, about: &About) -> Screen<'s> {
        let name = |texture: u16| table.and_then(|table| table.name(texture)).unwrap_or("?");
        let rows = |judgement: &Judgement| {
            let rows = if judgement.open { OPEN_ROWS } else { LEADING };
            let leading = judgement.leading.iter();
            leading
                .take(rows)
                .map(|(texture, probability)| Row {
                    name: name(*texture),
                    probability: *probability,
                })
                .collect()
        };
        let (slide, of) = self.slide_number();
        match &self.page {
            Page::Ready if !self.touch.has_zero() => Screen::Air,
            Page::Ready => Screen::Ready {
                textures: self.textures,
            },
            Page::Touching => Screen::touching(&self.touch.view(), slide, of),
            Page::Lift => Screen::Lift { slide },
            Page::Air => Screen::Air,
            Page::Weigh(mn) => Screen::Weigh {
                mn: *mn,
                force_mn: self.touch.view().force_mn,
            },
            Page::Again(why) => Screen::Again {
                why: *why,
                lift: self.touch.is_down(),
            },
            Page::Thinking => Screen::Thinking { slide: slide - 1 },
            Page::Verdict => match (&self.judgement, self.reference) {
                // there is one
                (None, _) => Screen::Dark,
                (Some(judgement), Some(reference)) => Screen::Compared {
                    name: name(reference),
                    same: (judgement.sure || judgement.unknown).then_some(judgement.sure),
                    open: judgement.open,
                    trials: table.map_or(0, |table| trials(table, reference)),
                },
                (Some(judgement), None) if judgement.unknown => Screen::Unknown {
                    like: rows(judgement),
                },
                (Some(judgement), None) if judgement.changed => Screen::Changed {
                    rows: rows(judgement),
                },
                (Some(judgement), None) => Screen::Verdict {
                    rows: rows(judgement),
                    sure: judgement.sure,
                    open: judgement.open,
                },
            },
            Page::Choose(list, at) => {
                let entries = self.entries(*list);
                Screen::Choose {
                    title: list.title(),
                    at: *at,
                    count: entries.count(),
                    entries: entries.around(*at, table),
                }
            }
            Page::Spell(spelling) => Screen::Spell {
                text: spelling.text(),
                wheel: spelling.wheel(),
            },
            Page::Saving => Screen::Saving,
            Page::Learned(learned) => Screen::Learned(learned.as_ref().map_err(|why| *why)),
            Page::Fault(trouble) => Screen::Fault(trouble),
            Page::About => Screen::About(about.clone()),
            Page::Turn(over) => Screen::Turn { over: *over },
            Page::Dark => Screen::Dark,
        }
    }

    /// The slide that is made next, and the largest number of slides.
    fn slide_number(&self) -> (u8, u8) {
        match &self.asked {
            Some(asked) => (asked.slide, asked.of),
            None if self.training => (self.episode.len() as u8 + 1, TRAINING_SLIDES as u8),
            None => {
                let goes_on = self.episode.len() >= ASK_AFTER && self.reference.is_none();
                let of = if goes_on { MAX_SLIDES } else { ASK_AFTER };
                (self.episode.len() as u8 + 1, of as u8)
            }
        }
    }

    fn entries(&self, list: List) -> Entries<'_> {
        Entries {
            list,
            judgement: self.judgement.as_ref(),
            textures: self.textures,
        }
    }

    fn show(&mut self, page: Page) {
        let listened = self.listens();
        self.page = page;
        self.fresh = true;
        self.shown = 0;
        self.silent = 0;
        if self.listens() && !listened {
            // the finger may have been put down meanwhile, and its words begin anew
            self.touch.restart();
        }
    }

    fn fail(&mut self, trouble: Trouble) {
        if !matches!(&self.page, Page::Fault(shown) if *shown == trouble) {
            self.sound(ALARM);
            self.clear_episode();
            self.job = None;
            if self.asked.take().is_some() {
                self.answer = Some(Answer::Trouble);
            }
            self.show(Page::Fault(trouble));
        }
    }

    fn clear_episode(&mut self) {
        self.episode.clear();
        self.judgement = None;
        self.training = false;
    }

    fn begin(&mut self) {
        self.clear_episode();
        self.reference = None;
        self.show(Page::Ready);
    }

    fn sound(&mut self, melody: &'static [Note]) {
        self.melody = melody;
        self.note = 0;
    }

    fn play(&mut self) {
        let Some((_, ticks)) = self.melody.first() else {
            return;
        };
        self.note += 1;
        if self.note >= *ticks {
            self.note = 0;
            self.melody = self.melody.get(1..).unwrap_or_default();
        }
    }

    fn on_touch(&mut self, event: Event) {
        if event != Event::Still {
            self.idle = 0;
        }
        match event {
            Event::Silent => return self.fail(Trouble::Silent),
            Event::Frozen => return self.fail(Trouble::Frozen),
            _ => {}
        }
        if let Page::Fault(_) = self.page {
            // words again, and good ones
            return self.begin();
        }
        match event {
            Event::Zeroed | Event::Silent | Event::Frozen => {}
            Event::Down => match self.page {
                Page::Ready | Page::Touching | Page::Again(_) => self.show(Page::Touching),
                Page::Verdict if self.judgement.as_ref().is_some_and(|j| j.open) => {
                    self.show(Page::Touching);
                }
                Page::Verdict => match self.reference {
                    // another sample, compared with the same texture
                    Some(reference) => self.compare(reference),
                    None => {
                        self.clear_episode();
                        self.show(Page::Touching);
                    }
                },
                _ => {}
            },
            Event::Still if matches!(self.page, Page::Touching) => self.sound(SLIDE),
            Event::Still => {}
            Event::Up => match self.page {
                Page::Touching if self.asked.is_some() => {}
                Page::Touching
                    if self.episode.is_empty() && !self.training && self.reference.is_none() =>
                {
                    self.begin();
                }
                Page::Again(_) if self.shown >= AGAIN => self.show(Page::Touching),
                _ => {}
            },
            Event::Again(why) => {
                if matches!(self.page, Page::Touching) {
                    self.sound(BAD);
                    self.show(Page::Again(why));
                }
            }
            Event::Slid(_) if self.asked.is_some() => {
                if matches!(self.page, Page::Touching) {
                    self.sound(GOOD);
                    self.answer = Some(Answer::Slid);
                    self.show(Page::Lift);
                }
            }
            Event::Slid(observation) => {
                // the episode has space: it ends with its last slide
                if matches!(self.page, Page::Touching) && self.episode.push(observation).is_ok() {
                    self.job = Some(Job::Judge {
                        slides: self.episode.clone(),
                        reference: self.reference,
                    });
                    self.show(Page::Thinking);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
