//! One run of the stage, under the finger or without load: its path, the time of its constant speed, and the phase of
//! its samples. It knows nothing of the rest of the rig.

use core::ops::Range;

use super::phase::Ended;
use super::pins::{Inputs, Outputs};
use super::slide_path::SlidePath;
use super::stage::{MARGIN_MM, StageConstants};
use crate::features::{Movement, SamplePhase};
use crate::sensor::pressure::{Channel, RATE_HZ};

/// Longest slide at constant speed, s.
const STEADY_S: f32 = 3.0;
/// After the ramp the servo has this long to settle before samples count, s.
const STEADY_MARGIN_S: f32 = 0.2;
/// Longest delay of an arm's report on the link, ms: it is cut off the end of a slide over the link.
pub(super) const LINK_MS: u32 = 150;
/// Largest difference between the P_AC words of a slide and the number that its time holds.
const WORDS_OFF: u32 = 4;

#[derive(Clone, Debug)]
pub(super) struct Run {
    movement: Movement,
    path_mm: (f32, f32),
    /// Constant speed, as ms since the run began.
    steady_ms: Range<u32>,
    /// Sum and number of P_AC words since the lever last moved: the baseline.
    pac: (u32, u32),
    baseline: i32,
    /// Words that were damaged or missing, from the background on.
    damaged: u32,
    words: u32,
    current: (f32, u32),
}

impl Run {
    pub(super) const NONE: Self = Self {
        movement: Movement::FOR_ROUGHNESS,
        path_mm: (0.0, 0.0),
        steady_ms: 0..0,
        pac: (0, 0),
        baseline: 0,
        damaged: 0,
        words: 0,
        current: (0.0, 0),
    };

    /// The slide of a movement, beginning at `start`: 0 to 1 of the length that the sample leaves. `None` if it does
    /// not fit on the sample.
    pub(super) fn slide(movement: Movement, start: f32, stage: &StageConstants) -> Option<Self> {
        let speed = movement.speed_mm_s();
        let sample = SlidePath::SAMPLE_MM.min(stage.travel_mm - 2.0 * MARGIN_MM);
        let ramps = speed * speed / stage.acceleration_mm_s2;
        let length = (speed * STEADY_S)
            .min(SlidePath::LONGEST_MM)
            .min(sample - ramps);
        let path = SlidePath {
            acceleration_mm_s2: stage.acceleration_mm_s2,
            ..SlidePath::new(movement, length)
        };
        let margin = path.start_room_mm(sample)?;
        // not-a-number clamps to itself, and is no start
        let start = if start >= 0.0 { start.min(1.0) } else { 0.0 };
        let from = MARGIN_MM + start * margin;
        let begin_s = path.ramp_s() + STEADY_MARGIN_S.min(0.2 * path.steady_s());
        let end_s = path.ramp_s() + path.steady_s();
        Some(Self {
            movement,
            path_mm: (from, from + path.travel_mm()),
            steady_ms: libm::ceilf(begin_s * 1e3) as u32..libm::floorf(end_s * 1e3) as u32,
            ..Self::NONE
        })
    }

    /// The slide of a movement that an arm makes, and its length at constant speed, mm. Its time begins with the arm's
    /// report that the speed is constant, and ends before it would be over if that came late.
    pub(super) fn over_link(movement: Movement) -> (Self, f32) {
        let length_mm = (movement.speed_mm_s() * STEADY_S).min(SlidePath::LONGEST_MM);
        let path = SlidePath::new(movement, length_mm);
        let begin_s = STEADY_MARGIN_S.min(0.2 * path.steady_s());
        let end_ms = libm::floorf(path.steady_s() * 1e3) as u32;
        let run = Self {
            movement,
            steady_ms: libm::ceilf(begin_s * 1e3) as u32..end_ms.saturating_sub(LINK_MS),
            ..Self::NONE
        };
        (run, length_mm)
    }

    /// Ms at constant speed of a slide over the link.
    pub(super) fn slide_ms(&self) -> u32 {
        self.steady_ms.end + LINK_MS
    }

    /// A run with the finger lifted, which takes so many s at this speed.
    pub(super) fn unloaded(speed_mm_s: f32, duration_s: f32, stage: &StageConstants) -> Self {
        let ramp_s = speed_mm_s / stage.acceleration_mm_s2;
        let (begin_s, end_s) = (ramp_s + STEADY_MARGIN_S, duration_s - ramp_s);
        Self {
            steady_ms: (begin_s * 1e3) as u32..(end_s * 1e3) as u32,
            ..Self::NONE
        }
    }

    pub(super) fn movement(&self) -> Movement {
        self.movement
    }

    pub(super) fn path_mm(&self) -> (f32, f32) {
        self.path_mm
    }

    /// P_AC while the finger is pressed; the baseline is its mean since the finger last moved.
    pub(super) fn press(&mut self, inputs: &Inputs, moves: bool) {
        if moves {
            self.pac = (0, 0);
        }
        for counts in pac(inputs) {
            self.pac.0 = self.pac.0.saturating_add(u32::from(counts));
            self.pac.1 = self.pac.1.saturating_add(1);
        }
    }

    /// The finger is pressed well: from here on P_AC is taken about the baseline.
    pub(super) fn hold(&mut self) {
        let (sum, samples) = self.pac;
        self.baseline = ((sum + samples / 2) / samples.max(1)) as i32;
    }

    pub(super) fn still(&mut self, inputs: &Inputs, outputs: &mut Outputs) {
        self.feel(inputs, outputs);
        outputs.sample_phase = SamplePhase::Still;
        // those of the slide are counted from its first tick on
        self.words = 0;
    }

    /// The tick `ms` of the slide, from 1; `shear_n` is the tangential force.
    pub(super) fn slid(&mut self, ms: u32, shear_n: f32, inputs: &Inputs, outputs: &mut Outputs) {
        self.feel(inputs, outputs);
        // the stage started with the tick before the first one of the slide
        outputs.sample_phase = if ms == 1 {
            SamplePhase::Begin(samples(self.steady_ms.start)..samples(self.steady_ms.end))
        } else {
            SamplePhase::Slide
        };
        self.weigh_current(ms, inputs);
        if self.steady_ms.contains(&ms) {
            outputs.shear_mn = Some((shear_n * 1e3) as i16);
        }
    }

    /// The tick `ms` of a run: its current counts where the speed is constant.
    pub(super) fn weigh_current(&mut self, ms: u32, inputs: &Inputs) {
        if self.steady_ms.contains(&ms) {
            self.current.0 += inputs.current_a;
            self.current.1 += 1;
        }
    }

    pub(super) fn mean_current_a(&self) -> Option<f32> {
        let (sum, ticks) = self.current;
        (ticks > 0).then(|| sum / ticks as f32)
    }

    /// The constant speed ends with the tick `ms` of the slide.
    pub(super) fn cut(&mut self, ms: u32) {
        self.steady_ms.end = self.steady_ms.end.min(ms.saturating_add(1));
    }

    pub(super) fn ended(&mut self, ms: u32) -> Ended {
        let missing = samples(ms).abs_diff(self.words);
        self.damaged += if missing > WORDS_OFF { missing } else { 0 };
        match self.damaged {
            0 => Ended::Whole,
            damaged => Ended::Gap(damaged),
        }
    }

    /// P_AC of this tick about the baseline. The servo does this each millisecond: once over the words, in place.
    fn feel(&mut self, inputs: &Inputs, outputs: &mut Outputs) {
        outputs.pac.clear();
        for word in &inputs.words {
            match word {
                None => self.damaged += 1,
                Some(word) if word.channel == Channel::Pac => {
                    self.words = self.words.saturating_add(1);
                    let about = i32::from(word.counts.get()) - self.baseline;
                    // the vector holds as many as there are words
                    let _ = outputs.pac.push(about as i16);
                }
                Some(_) => {}
            }
        }
    }
}

fn pac(inputs: &Inputs) -> impl Iterator<Item = u16> {
    let words = inputs.words.iter().flatten();
    words
        .filter(|word| word.channel == Channel::Pac)
        .map(|word| word.counts.get())
}

fn samples(ms: u32) -> u32 {
    (u64::from(ms) * u64::from(RATE_HZ) / 1000) as u32
}
