//! One touch by hand, from its sensor words: the moments at which the finger is pressed well and slides, and the
//! quality of the slide.
//!
//! A slide has begun when P_AC is livelier than that of the still finger, or, of a probe with a sensor of motion, when
//! that sees it move; its steady part has a fixed length, and must last to its end at about the same force and pace.

use heapless::{Deque, Vec};

use super::guidance::{Again, Event, Phase, View, Way, ZONE_MN};
use super::judge::MOVEMENT;
use super::speed::{Moved, Speedometer};
use crate::dsp::Plan;
use crate::features::{BLOCK, Block, Blocks, FROZEN, Observation, SamplePhase, Slide, SlideError};
use crate::sensor::pressure::{Calibration, Channel, Pressure, RATE_HZ};

/// Samples of a channel that are looked at together: 10 ms.
const LOOK: usize = 22;
/// Such looks in a second.
const BLOCKS_HZ: u16 = (RATE_HZ as usize / LOOK) as u16;

/// The finger is down from this force on, mN, ...
const DOWN_MN: f32 = 100.0;
/// ... and up below this one.
const UP_MN: f32 = 60.0;
/// Force above any intended press, mN: the relation of P_DC and force bends at 2 N.
const MOST_MN: f32 = 1500.0;
/// Blocks over which the force is taken: 100 ms, a tremor's period.
const STEADY_FORCE: usize = 10;

/// Blocks in the air that give the zero of P_DC and the noise of P_AC.
const ZEROING: u16 = 20;
/// Share of a block in the air that the zero follows: half a second.
const FOLLOW: f32 = 0.02;
/// The zero was taken with the finger down when P_DC falls this far below it, mN.
const BELOW_ZERO_MN: f32 = 57.5;

/// A finger is still while P_AC is at most this many times as lively as in the air: a hand trembles.
const STILL: f32 = 4.0;
/// Still blocks before a slide: they are the background, too.
const STILL_BLOCKS: u16 = BLOCKS_HZ / 4;
/// The latest still blocks may be the slide's first ones, and are no background.
const DELAY: usize = 5;
/// A finger slides when P_AC is this many times as lively as still, ...
const LIVELY: f32 = 2.0;
/// ... for so many blocks, and has stopped when it is less than half of that above still for so many.
const BEGINS: u8 = 3;
const STOPPED: u8 = 8;
/// From where a slide begins to where it is steady, samples: 150 ms to come up to speed.
const COMING_UP: u32 = 15 * LOOK as u32;
/// The steady part, samples: 1.2 s.
const STEADY: u32 = 120 * LOOK as u32;
/// Tenths of a second of the steady part, whose liveliness must agree.
const TENTHS: usize = STEADY as usize / LOOK / 10;
/// Standard deviation of ln(liveliness) of the tenths from which a slide is too uneven.
const UNEVEN: f32 = 0.8;

/// Unreadable words in a row that show that the sensor is silent: 100 ms.
const SILENT: u16 = 440;

/// Samples of a touch as they came with the last word; a slide is measured from them.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Taken {
    /// Blocks of the touch that are full; a block of number 0 begins the touch anew.
    pub blocks: Vec<Block, 2>,
    /// P_DC since the slide began, counts about that of the lifted finger.
    pub pdc: Vec<i16, BLOCK>,
}

/// Follows touches.
pub struct Touch<'p> {
    plan: &'p Plan,
    mn_per_count: f32,
    taken: Taken,
    slide: Slide<'p>,
    blocks: Blocks,
    phase: Phase,
    /// Still blocks since the press, and the sum of their liveliness.
    still: u16,
    still_sum: f32,
    /// Blocks in a row that are livelier than the still ones; then the slide has begun.
    begins: u8,
    /// Of the slide: liveliness of a still block before it, samples so far, blocks in a row as quiet as still ones, and
    /// the sum of the liveliness of this tenth of a second.
    still_mean: f32,
    samples: u32,
    stopped: u8,
    tenth: f32,
    /// The block so far: samples in counts, words that have passed, and those that are missing.
    pac: Vec<i16, LOOK>,
    pdc: Vec<i16, LOOK>,
    words: usize,
    missing: u32,
    /// Unreadable words in a row; equal samples of P_AC, and that sample.
    unreadable: u16,
    equal: u16,
    before: [i16; 2],
    /// P_DC in the air, and the number of whole blocks in its mean.
    zero: f32,
    zeroed: u16,
    /// P_AC in the air: mean and liveliness.
    rest: f32,
    air: f32,
    forces: Deque<f32, STEADY_FORCE>,
    /// Blocks in a row that are down, or up.
    changes: u8,
    /// Still P_AC that is not yet old enough to be background.
    latest: Deque<[i16; LOOK], DELAY>,
    tenths: Vec<f32, TENTHS>,
    speed: Speedometer,
}

impl<'p> Touch<'p> {
    /// No slide yet.
    pub fn new(plan: &'p Plan) -> Self {
        Self {
            plan,
            mn_per_count: Calibration::PAPER.force_mn_per_count,
            taken: Taken::default(),
            slide: Slide::new(plan, MOVEMENT),
            blocks: Blocks::default(),
            phase: Phase::Air,
            still: 0,
            still_sum: 0.0,
            begins: 0,
            still_mean: 0.0,
            samples: 0,
            stopped: 0,
            tenth: 0.0,
            pac: Vec::new(),
            pdc: Vec::new(),
            words: 0,
            missing: 0,
            unreadable: 0,
            equal: 0,
            before: [0; 2],
            zero: 0.0,
            zeroed: 0,
            rest: 0.0,
            air: 0.0,
            forces: Deque::new(),
            changes: 0,
            latest: Deque::new(),
            tenths: Vec::new(),
            speed: Speedometer::default(),
        }
    }

    /// Begins anew after a pause without words: all knowledge of the touch is void.
    pub fn restart(&mut self) {
        *self = Self {
            mn_per_count: self.mn_per_count,
            ..Self::new(self.plan)
        };
    }

    /// Sets the contact force of a count of P_DC, mN.
    pub fn calibrate(&mut self, mn_per_count: f32) {
        self.mn_per_count = mn_per_count;
    }

    /// Takes a reading of the sensor of motion: one every 10 ms. Without them the speed is not known.
    pub fn moved(&mut self, moved: Moved) {
        self.speed.take(moved);
    }

    /// Returns true if the probe moves; `None` if no sensor sees it.
    fn moves(&self) -> Option<bool> {
        self.speed.moves()
    }

    /// The slide that was good last, until the finger is pressed again.
    pub fn slide(&self) -> &Slide<'p> {
        &self.slide
    }

    /// Samples that came with the last word.
    pub fn taken(&self) -> &Taken {
        &self.taken
    }

    /// Mean P_DC of the latest 100 ms in counts above that in the air; `None` before it is known.
    pub(crate) fn counts_above_air(&self) -> Option<f32> {
        let known = self.has_zero() && self.forces.is_full();
        let sum: f32 = self.forces.iter().sum();
        known.then(|| sum / self.forces.len() as f32 - self.zero)
    }

    /// P_DC in the air, counts; `None` before it is known.
    pub fn air_counts(&self) -> Option<f32> {
        self.has_zero().then_some(self.zero)
    }

    pub(crate) fn has_zero(&self) -> bool {
        self.zeroed >= ZEROING
    }

    pub(crate) fn is_down(&self) -> bool {
        self.phase != Phase::Air
    }

    /// The view for the display.
    pub fn view(&self) -> View {
        let progress = match self.phase {
            Phase::Sliding => self.samples as f32 / (COMING_UP + STEADY) as f32,
            Phase::Lift => 1.0,
            Phase::Air | Phase::Press | Phase::Slide => 0.0,
        };
        View {
            phase: self.phase,
            force_mn: self.force_mn().max(0.0),
            progress,
            way: self.way(),
        }
    }

    fn way(&self) -> Way {
        if !self.speed.is_there() {
            return Way::NoSensor;
        }
        let seconds = (COMING_UP + STEADY) as f32 / RATE_HZ as f32;
        let all_mm = MOVEMENT.speed_mm_s() * seconds;
        let way_mm = self.speed.way_mm();
        way_mm.map_or(Way::Unseen, |way_mm| Way::Seen(way_mm / all_mm))
    }

    /// So many words were lost before they came here.
    pub fn lose(&mut self, words: u32) {
        self.missing = self.missing.saturating_add(words);
    }

    /// Takes a word; `None` is a damaged one.
    pub fn word(&mut self, word: Option<Pressure>) -> Option<Event> {
        self.words += 1;
        self.taken.blocks.clear();
        self.taken.pdc.clear();
        let mut event = None;
        match word {
            Some(Pressure { channel, counts }) => {
                self.unreadable = 0;
                let word_at_rail = counts.is_at_rail();
                let counts = counts.get() as i16;
                // a channel that comes too often has taken the other's place
                let pushed = match channel {
                    Channel::Pac => {
                        event = self.hangs(counts, word_at_rail);
                        self.pac.push(counts)
                    }
                    Channel::Pdc => self.pdc.push(counts),
                };
                self.missing = self.missing.saturating_add(pushed.is_err().into());
            }
            None => {
                self.missing = self.missing.saturating_add(1);
                self.unreadable = self.unreadable.saturating_add(1);
                if self.unreadable == SILENT {
                    self.restart();
                    return Some(Event::Silent);
                }
            }
        }
        if event.is_some() {
            self.restart();
            return event;
        }
        if self.words >= 2 * LOOK {
            event = self.block();
            self.pac.clear();
            self.pdc.clear();
            self.words = 0;
            self.missing = 0;
        }
        event
    }

    fn hangs(&mut self, counts: i16, at_rail: bool) -> Option<Event> {
        let [.., last] = self.before;
        let last = self.pac.last().copied().unwrap_or(last);
        self.equal = if counts == last || at_rail {
            self.equal + 1
        } else {
            0
        };
        (self.equal >= FROZEN).then_some(Event::Frozen)
    }

    fn force_mn(&self) -> f32 {
        if self.zeroed < ZEROING || self.forces.is_empty() {
            return 0.0;
        }
        let sum: f32 = self.forces.iter().sum();
        self.newtons(sum / self.forces.len() as f32)
    }

    fn newtons(&self, pdc: f32) -> f32 {
        (pdc - self.zero) * self.mn_per_count
    }

    /// Liveliness of P_AC: mean square of its second difference. It takes the place of a filter: a tremor of 10 Hz
    /// comes through by a millionth, a vibration of 200 Hz by a tenth.
    fn lively(&mut self) -> f32 {
        let mut sum = 0;
        let [mut a, mut b] = self.before;
        for &c in &self.pac {
            let bend = i32::from(c) - 2 * i32::from(b) + i32::from(a);
            sum += i64::from(bend) * i64::from(bend);
            (a, b) = (b, c);
        }
        self.before = [a, b];
        sum as f32 / self.pac.len().max(1) as f32
    }

    /// 10 ms are over.
    fn block(&mut self) -> Option<Event> {
        let first = self.before == [0; 2];
        let lively = self.lively();
        let whole = self.missing == 0 && self.pac.is_full() && self.pdc.is_full();
        if !whole || first {
            return self.broken(first);
        }
        let pdc = mean(&self.pdc);
        if self.forces.is_full() {
            let _ = self.forces.pop_front();
        }
        // one place is free now
        let _ = self.forces.push_back(pdc);
        if !self.has_zero() {
            return self.find_zero(pdc, lively);
        }
        let now_mn = self.newtons(pdc);
        if now_mn < -BELOW_ZERO_MN {
            // it was down when the zero was taken
            self.zero = pdc;
        }
        let up = self.phase != Phase::Air && self.is_up(now_mn);
        match self.phase {
            Phase::Air => self.in_air(pdc, now_mn, lively),
            _ if up => {
                let slid = core::mem::replace(&mut self.phase, Phase::Air) == Phase::Sliding;
                self.changes = 0;
                // a slide that ends in the air was too short; the finger is known to be up by now
                Some(if slid {
                    Event::Again(Again::TooShort)
                } else {
                    Event::Up
                })
            }
            Phase::Press => self.pressing(lively),
            Phase::Slide => self.waiting(lively),
            Phase::Sliding => self.sliding(lively),
            Phase::Lift => None,
        }
    }

    fn broken(&mut self, first: bool) -> Option<Event> {
        match self.phase {
            Phase::Press => {
                self.press();
                None
            }
            Phase::Slide => {
                // the person was asked to slide and may have begun: the still part before the gap is background enough,
                // and no sample of a slide has been taken yet
                self.latest.clear();
                None
            }
            Phase::Sliding if !first => Some(self.again(Again::Disturbed)),
            _ => None,
        }
    }

    fn find_zero(&mut self, pdc: f32, lively: f32) -> Option<Event> {
        let n = f32::from(self.zeroed);
        let mean_with = |mean: f32, x: f32| mean + (x - mean) / (n + 1.0);
        self.zero = mean_with(self.zero, pdc);
        self.rest = mean_with(self.rest, mean(&self.pac));
        self.air = mean_with(self.air, lively);
        self.zeroed += 1;
        self.has_zero().then_some(Event::Zeroed)
    }

    fn in_air(&mut self, pdc: f32, now_mn: f32, lively: f32) -> Option<Event> {
        if now_mn > DOWN_MN {
            self.changes += 1;
            if self.changes >= 2 {
                self.changes = 0;
                self.press();
                return Some(Event::Down);
            }
            return None;
        }
        self.changes = 0;
        if now_mn < UP_MN {
            self.zero += (pdc - self.zero) * FOLLOW;
            self.rest += (mean(&self.pac) - self.rest) * FOLLOW;
            // knocks on the probe are no noise of the sensor
            if lively < STILL * self.air {
                self.air += (lively - self.air) * FOLLOW;
            }
        }
        None
    }

    fn is_up(&mut self, now_mn: f32) -> bool {
        self.changes = if now_mn < UP_MN { self.changes + 1 } else { 0 };
        self.changes >= 2
    }

    /// The finger is to be kept still from now on.
    fn press(&mut self) {
        self.phase = Phase::Press;
        (self.still, self.still_sum) = (0, 0.0);
        self.slide = Slide::new(self.plan, MOVEMENT);
        self.blocks = Blocks::default();
        self.latest.clear();
    }

    fn again(&mut self, why: Again) -> Event {
        self.phase = Phase::Lift;
        Event::Again(why)
    }

    /// P_AC of the block in counts about its rest.
    fn about_rest(&self) -> [i16; LOOK] {
        let rest = libm::roundf(self.rest) as i16;
        let mut about = [0; LOOK];
        for (to, from) in about.iter_mut().zip(&self.pac) {
            *to = from - rest;
        }
        about
    }

    fn put(&mut self, phase: &SamplePhase, pac: &[i16]) {
        if let Some(block) = self.blocks.put(phase, pac, None) {
            self.take(block);
        }
    }

    fn take(&mut self, block: Block) {
        self.slide.take(&block);
        // two places: a word fills a block and ends a slide at most
        let _ = self.taken.blocks.push(block);
    }

    /// A still block: background, once it is old enough.
    fn put_still(&mut self) {
        if self.latest.is_full()
            && let Some(old) = self.latest.pop_front()
        {
            self.put(&SamplePhase::Still, &old);
        }
        // one place is free now
        let _ = self.latest.push_back(self.about_rest());
    }

    fn pressing(&mut self, lively: f32) -> Option<Event> {
        let force_mn = self.force_mn();
        if force_mn > MOST_MN {
            return Some(self.again(Again::TooHard));
        }
        if lively > STILL * self.air || !ZONE_MN.contains(&force_mn) {
            self.press();
            return None;
        }
        self.put_still();
        self.still += 1;
        self.still_sum += lively;
        if self.still < STILL_BLOCKS {
            return None;
        }
        self.phase = Phase::Slide;
        self.begins = 0;
        Some(Event::Still)
    }

    fn waiting(&mut self, lively: f32) -> Option<Event> {
        let mean = self.still_sum / f32::from(self.still.max(1));
        self.begins = if lively > LIVELY * mean {
            self.begins + 1
        } else {
            0
        };
        if self.moves().unwrap_or(self.begins >= BEGINS) {
            self.speed.begin();
            self.tenths.clear();
            self.phase = Phase::Sliding;
            (self.still_mean, self.samples, self.stopped, self.tenth) = (mean, 0, 0, 0.0);
            return None;
        }
        if !ZONE_MN.contains(&self.force_mn()) {
            self.press();
            return None;
        }
        self.put_still();
        if self.begins == 0 && self.still < u16::MAX {
            self.still += 1;
            self.still_sum += lively;
        }
        None
    }

    fn sliding(&mut self, lively: f32) -> Option<Event> {
        let phase = match self.samples {
            0 => SamplePhase::Begin(COMING_UP..COMING_UP + STEADY),
            _ => SamplePhase::Slide,
        };
        self.put(&phase, &self.about_rest());
        let steady = self.samples >= COMING_UP;
        if self.samples == COMING_UP {
            self.speed.steady();
        }
        let force_mn = self.force_mn();
        if steady && force_mn > *ZONE_MN.end() {
            return Some(self.again(Again::TooHard));
        }
        if steady && force_mn < *ZONE_MN.start() {
            return Some(self.again(Again::TooLight));
        }
        let quiet = match self.moves() {
            Some(moves) => !moves,
            None => lively < self.still_mean * (1.0 + (LIVELY - 1.0) / 2.0),
        };
        self.stopped = if quiet { self.stopped + 1 } else { 0 };
        if self.stopped >= STOPPED {
            return Some(self.again(Again::TooShort));
        }
        self.samples += LOOK as u32;
        let zero = libm::roundf(self.zero) as i16;
        self.taken.pdc = self.pdc.iter().map(|counts| counts - zero).collect();
        if steady {
            self.slide.push_pdc(&self.taken.pdc);
            self.tenth += lively;
            if (self.samples - COMING_UP).is_multiple_of(10 * LOOK as u32) {
                // `tenths` has space: for as many as the steady part has
                let _ = self
                    .tenths
                    .push(libm::logf(self.tenth.max(f32::MIN_POSITIVE)));
                self.tenth = 0.0;
            }
        }
        if self.samples < COMING_UP + STEADY {
            return None;
        }
        Some(self.finish())
    }

    fn finish(&mut self) -> Event {
        self.phase = Phase::Lift;
        if deviation(&self.tenths) > UNEVEN {
            return Event::Again(Again::TooUneven);
        }
        let last = core::mem::take(&mut self.blocks).end(0);
        self.take(last);
        let seconds = STEADY as f32 / RATE_HZ as f32;
        self.slide.set_pace(self.speed.pace(seconds, MOVEMENT));
        match self.slide.finish() {
            Ok(measurement) => Event::Slid(Observation::from(&measurement)),
            Err(SlideError::Silent) => Event::Frozen,
            Err(SlideError::Clipped { .. }) => Event::Again(Again::TooHard),
            // all its samples are there: the remaining cause is a gap
            Err(_) => Event::Again(Again::Disturbed),
        }
    }
}

fn mean(samples: &[i16]) -> f32 {
    let sum: i32 = samples.iter().copied().map(i32::from).sum();
    sum as f32 / samples.len().max(1) as f32
}

/// Standard deviation (n - 1).
fn deviation(values: &[f32]) -> f32 {
    let n = values.len() as f32;
    if n < 2.0 {
        return 0.0;
    }
    let mean = values.iter().sum::<f32>() / n;
    let squares: f32 = values.iter().map(|x| (x - mean) * (x - mean)).sum();
    libm::sqrtf(squares / (n - 1.0))
}

#[cfg(test)]
mod tests;
