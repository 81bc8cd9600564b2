//! Recorded slides of a real finger, played where the simulated one slides.
//!
//! A recording takes the place of the simulated texture: the vibration that P_AC shows and the tangential force that
//! the stage has to overcome. The press, and so P_DC, stays the simulated finger's, and so does everything while it is
//! still.

use super::conditions::{TICK_S, TICKS_PER_S};
use super::noise::Noise;

/// P_AC of a recording, Hz.
pub(crate) const PAC_HZ: u32 = 2200;
/// Tangential force of a recording, Hz.
pub const SHEAR_HZ: u32 = 100;

/// A stage that is faster than this moves on purpose, mm/s (chosen: a tenth of the slowest slide's, more than holding a
/// place takes).
const MOVING_MM_S: f64 = 1.0;
/// Stream of the seed that the order is drawn from.
const STREAM: u64 = 700;

/// A recorded slide, from where the finger is pressed and moves.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Played {
    /// P_AC at 2200 Hz, counts about the still finger's.
    pub pac: Vec<i16>,
    /// Tangential force against the motion at [`SHEAR_HZ`], mN.
    pub shear_mn: Vec<i16>,
}

/// Counts of the slides and samples played so far.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct PlayCounts {
    /// Slides that were begun.
    pub slides: u32,
    /// P_AC samples beyond 12 bits; they were clipped.
    pub clipped: u32,
    /// P_AC samples that were read after a recording had ended; they show the sensor's noise.
    pub over: u32,
}

struct Playing {
    slide: usize,
    /// since the movement began
    ticks: u64,
    /// when P_AC was sampled first, ticks
    sampled_at: Option<f64>,
}

pub(super) struct Playback {
    slides: Vec<Played>,
    next: usize,
    /// since this contact began to move
    playing: Option<Playing>,
    moving: bool,
    counts: PlayCounts,
}

impl Playback {
    /// These slides in an order that `seed` gives, over and over.
    pub(super) fn new(mut slides: Vec<Played>, seed: u64) -> Self {
        let mut noise = Noise::new(seed, STREAM);
        for left in (1..slides.len()).rev() {
            let other = (noise.uniform() * (left + 1) as f64) as usize;
            slides.swap(left, other.min(left));
        }
        Self {
            slides,
            next: 0,
            playing: None,
            moving: false,
            counts: PlayCounts::default(),
        }
    }

    /// A tick of the finger: whether it touches, and the stage's speed. The first movement of a contact begins a slide.
    pub(super) fn tick(&mut self, touching: bool, speed_mm_s: f64) {
        self.moving = touching && speed_mm_s.abs() > MOVING_MM_S;
        match &mut self.playing {
            _ if !touching => self.playing = None,
            Some(playing) => playing.ticks += 1,
            None if self.moving && !self.slides.is_empty() => {
                self.playing = Some(Playing {
                    slide: self.next,
                    ticks: 0,
                    sampled_at: None,
                });
                self.next = (self.next + 1) % self.slides.len();
                self.counts.slides += 1;
            }
            None => {}
        }
    }

    /// Tangential force now, N; `None` before the movement. Between samples it is interpolated, after the last it
    /// stays.
    pub(super) fn shear_n(&self) -> Option<f64> {
        let playing = self.playing.as_ref()?;
        let forces = &self.slides[playing.slide].shear_mn;
        let at = playing.ticks as f64 * TICK_S * f64::from(SHEAR_HZ);
        let mn = |n: usize| forces.get(n).or(forces.last()).map(|&mn| f64::from(mn));
        let before = mn(at as usize)?;
        let after = mn(at as usize + 1)?;
        Some((before + (after - before) * at.fract()) * 1e-3)
    }

    /// P_AC `fraction` of a tick after the last but one, counts about the still finger's, where the recording has not
    /// ended; `None` while nothing is played.
    ///
    /// The first sample of a movement is the recording's first, and later ones are those nearest in time: at the rate
    /// of the recording, each of its samples once and unaltered.
    pub(super) fn pac(&mut self, fraction: f64) -> Option<Option<f64>> {
        let playing = self.playing.as_mut().filter(|_| self.moving)?;
        let now = playing.ticks as f64 + fraction;
        let first = *playing.sampled_at.get_or_insert(now);
        let at = ((now - first) * f64::from(PAC_HZ) / f64::from(TICKS_PER_S)).round() as usize;
        let sample = self.slides[playing.slide].pac.get(at);
        self.counts.over += u32::from(sample.is_none());
        Some(sample.map(|&counts| counts.into()))
    }

    /// A sample did not fit into 12 bits.
    pub(super) fn clipped(&mut self) {
        self.counts.clipped += 1;
    }

    pub(super) fn counts(&self) -> PlayCounts {
        self.counts
    }
}
