//! From the samples of one slide to its properties: traction (eq. 14), roughness (eq. 15, 16) and fineness (eq. 18,
//! 19).
//!
//! Everything streams: a slide is taken in blocks of any size, and nothing but the final logarithms waits for its end.

use core::ops::Range;

use serde::{Deserialize, Serialize};

use super::block::{BLOCK, Block};
use super::movement::Movement;
use super::property::Properties;
use super::signal::Signal;
use crate::dsp::{BandPower, FRAME, FUSED_BANDS, FUSED_EDGES, Plan, Spectrum, SpectrumSum, TAPS};

/// Edges of eight bands from 20 to 1000 Hz in equal ratios, as half-open ranges of bins.
pub const BAND_EDGES: [usize; 9] = [5, 8, 13, 21, 33, 54, 88, 143, 233];

/// Least share of the background power that a texture's power can be told from it.
///
/// The power of noise measured over one second scatters by about 4 % (1360 degrees of freedom in the band), so what is
/// left after the subtraction means nothing below that: 1/16 is one and a half standard deviations.
const LEAST_OF_BACKGROUND: f32 = 1.0 / 16.0;
/// Least power at all in counts^2: what rounding to whole counts adds.
const LEAST_POWER: f32 = 1.0 / 12.0;

/// Roughness (eq. 16) from the mean band-passed power of the slide and of the still finger, both in counts^2, and
/// whether it is only an upper bound.
///
/// A smooth texture's power can come out below the background, where eq. 16 has no value. Power above the background is
/// therefore taken to be at least a 16th of the background and at least 1/12 counts^2, the least that can be measured.
pub fn roughness(power: f32, background: f32) -> (f32, bool) {
    let least = (background * LEAST_OF_BACKGROUND).max(LEAST_POWER);
    let above = power - background;
    (libm::logf(above.max(least)), above < least)
}

/// The reasons why a slide has no properties. A rig repeats such a slide.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, thiserror::Error)]
#[allow(missing_docs)] // their texts say it
pub enum SlideError {
    #[error("the slide never reached its steady part")]
    NotStarted,
    #[error("only {got} of {wanted} samples of the steady part arrived")]
    Unfinished { got: u32, wanted: u32 },
    #[error(
        "the steady part is too short, {0} of the {FRAME} samples that the spectrum needs: slide longer or slower"
    )]
    TooShort(u32),
    #[error("the background of the still finger was not measured")]
    NoBackground,
    #[error("P_AC never changed, or stands at an end of its range: is the sensor connected?")]
    Silent,
    #[error("samples were lost: {0}")]
    Gap(u32),
    #[error(
        "P_AC is cut off at an end of its range in {clipped} of {of} samples: press less, slide slower, or check the \
         sensor"
    )]
    Clipped { clipped: u32, of: u32 },
}

/// One slide while its samples arrive, as [`Block`]s: the movement that makes it, what has come, and what was lost.
#[derive(Clone, Debug)]
pub struct Slide<'p> {
    plan: &'p Plan,
    movement: Movement,
    next: u16,
    still: BandPower,
    still_samples: usize,
    background: Option<f32>,
    steady: Range<u32>,
    position: u32,
    power: BandPower,
    spectrum: SpectrumSum,
    /// P_AC of the still finger, and at constant speed.
    signals: [Signal; 2],
    shear_mn: i64,
    shears: u32,
    pub(super) pdc: Pdc,
    pace: Option<i16>,
    bands: usize,
    lost: u32,
}

impl<'p> Slide<'p> {
    /// The slide of a movement, of which nothing has happened yet.
    pub fn new(plan: &'p Plan, movement: Movement) -> Self {
        Self {
            plan,
            movement,
            next: 0,
            still: BandPower::default(),
            still_samples: 0,
            background: None,
            steady: 0..0,
            position: 0,
            power: BandPower::default(),
            spectrum: SpectrumSum::default(),
            signals: Default::default(),
            shear_mn: 0,
            shears: 0,
            pdc: Pdc::default(),
            pace: None,
            bands: FUSED_BANDS,
            lost: 0,
        }
    }

    /// The movement that makes it.
    pub fn movement(&self) -> Movement {
        self.movement
    }

    /// Number of the block that is to come next.
    pub fn next_block(&self) -> u16 {
        self.next
    }

    /// Takes over all that another slide of the same movement has measured, by a plan of its own.
    pub(crate) fn adopt(&mut self, other: &Slide<'_>) {
        self.next = other.next;
        self.still = other.still.clone();
        self.still_samples = other.still_samples;
        self.background = other.background;
        self.steady = other.steady.clone();
        self.position = other.position;
        self.power = other.power.clone();
        self.spectrum = other.spectrum.clone();
        self.signals = other.signals.clone();
        (self.shear_mn, self.shears) = (other.shear_mn, other.shears);
        self.pdc = other.pdc;
        self.pace = other.pace;
        self.bands = other.bands;
        self.lost = other.lost;
    }

    /// Takes the next block of the movement: of the still finger, then of the slide, the first of which says which
    /// samples are at constant speed. What a block says is lost has nothing in its place, nor has a block that does not
    /// come: the slide has no properties then.
    // one function on the chip: what moves samples in it is judged under its own name (xtask's reasons.rs)
    #[inline(never)]
    pub fn take(&mut self, block: &Block) {
        let missing = u32::from(block.number.wrapping_sub(self.next)) * BLOCK as u32;
        self.next = block.number.wrapping_add(1);
        self.lose(missing.saturating_add(block.lost));
        if let Some((from, to)) = block.steady {
            self.start(from..to);
        }
        if block.still {
            self.push_still(&block.pac);
        } else {
            self.push(&block.pac);
            self.push_shear(&block.shear_mn);
        }
    }

    /// So many samples were lost: the slide has no properties then.
    pub fn lose(&mut self, samples: u32) {
        self.lost = self.lost.saturating_add(samples);
    }

    /// P_AC of the pressed, still finger, in counts about its baseline: the background of eq. 16.
    fn push_still(&mut self, samples: &[i16]) {
        let [signal, _] = &mut self.signals;
        signal.push(samples);
        // the filter must have filled before its power counts
        let fill = (TAPS - 1)
            .saturating_sub(self.still_samples)
            .min(samples.len());
        let (fill, rest) = samples.split_at_checked(fill).unwrap_or((samples, &[]));
        if !fill.is_empty() {
            self.still.prime(self.plan, fill);
        }
        self.still.push(self.plan, rest);
        self.still_samples = self.still_samples.saturating_add(samples.len());
    }

    /// The background in counts^2, where it is known from elsewhere.
    pub fn set_background(&mut self, power: f32) {
        self.background = Some(power);
    }

    /// The slide begins: the next P_AC sample has number 0, and those in `steady` are at constant speed.
    fn start(&mut self, steady: Range<u32>) {
        self.steady = steady;
        self.position = 0;
    }

    /// P_AC of the slide in counts about the baseline of the still finger, gap-free from its start.
    fn push(&mut self, samples: &[i16]) {
        let end = self.position.saturating_add(samples.len() as u32);
        let cut = |at: u32| at.clamp(self.position, end) - self.position;
        let before = cut(self.steady.start) as usize;
        let inside = cut(self.steady.end) as usize;
        let steady = samples.get(before..inside).unwrap_or_default();
        let before = samples.get(..before).unwrap_or_default();
        if !before.is_empty() {
            self.power.prime(self.plan, before);
        }
        self.power.push(self.plan, steady);
        self.spectrum.push(self.plan, steady);
        let [_, signal] = &mut self.signals;
        signal.push(steady);
        self.position = end;
    }

    /// Tangential force at constant speed in mN; a rig without force sensing has none.
    fn push_shear(&mut self, samples_mn: &[i16]) {
        self.shear_mn += samples_mn.iter().copied().map(i64::from).sum::<i64>();
        self.shears += samples_mn.len() as u32;
    }

    /// P_DC at constant speed in counts about that of the lifted finger.
    pub fn push_pdc(&mut self, samples: &[i16]) {
        self.pdc.push(samples);
    }

    /// Sets the measured speed, if any: see [`Observation::pace`](super::observation::Observation::pace).
    pub fn set_pace(&mut self, pace: Option<i16>) {
        self.pace = pace;
    }

    /// Leaves out the bands that reach over the highest frequency that was measured, Hz.
    pub fn set_highest(&mut self, hz: f32) {
        let highest = hz * FRAME as f32 / crate::sensor::pressure::RATE_HZ as f32;
        let upper = FUSED_EDGES.iter().skip(1);
        self.bands = upper.take_while(|edge| **edge as f32 <= highest).count();
    }

    /// The properties, when the steady part is over.
    pub fn finish(&mut self) -> Result<Measurement, SlideError> {
        self.look(self.steady.end.saturating_sub(self.steady.start))
    }

    /// Samples of P_AC at constant speed that have come.
    pub fn samples(&self) -> u32 {
        self.spectrum.samples()
    }

    /// The properties of what has come so far, as of a slide whose steady part was not longer; of it so many samples of
    /// P_AC must be there. The slide goes on as if nobody had looked.
    pub fn look(&mut self, wanted: u32) -> Result<Measurement, SlideError> {
        let got = self.spectrum.samples();
        if self.lost > 0 {
            return Err(SlideError::Gap(self.lost));
        }
        if wanted == 0 {
            return Err(SlideError::NotStarted);
        }
        if got < wanted {
            return Err(SlideError::Unfinished { got, wanted });
        }
        let [still, steady] = &self.signals;
        still.check()?;
        let clipped = steady.check()?;
        if steady.is_flat() {
            return Err(SlideError::Silent);
        }
        let plan = self.plan;
        let (Some(power), Some(spectrum)) = (self.power.mean(plan), self.spectrum.finish()) else {
            return Err(SlideError::TooShort(got));
        };
        let background = self
            .background
            .or_else(|| self.still.mean(plan))
            .ok_or(SlideError::NoBackground)?;
        let centroid_hz = spectrum.centroid_hz().ok_or(SlideError::Silent)?;
        let (roughness, roughness_is_bound) = roughness(power, background);
        let traction =
            (self.shears > 0).then(|| (self.shear_mn as f64 / f64::from(self.shears) / 1e3) as f32);
        Ok(Measurement {
            properties: Properties::new([traction, Some(roughness), Some(libm::logf(centroid_hz))]),
            roughness_is_bound,
            clipped,
            pdc: self.pdc.mean_and_sd(),
            pace: self.pace,
            bands: self.bands,
            background,
            spectrum,
        })
    }
}

/// P_DC during a slide: sums of it, of its products with the number of the sample and with the square of that, and of
/// its squares.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Pdc {
    samples: u16,
    moments: [i64; 3],
    squares: i64,
}

impl Pdc {
    /// Takes the next samples; those beyond 65,535 do not count.
    fn push(&mut self, samples: &[i16]) {
        for &counts in samples {
            let (x, at) = (i64::from(counts), i64::from(self.samples));
            let Some(next) = self.samples.checked_add(1) else {
                return;
            };
            self.samples = next;
            let [sum, once, twice] = &mut self.moments;
            *sum += x;
            *once += x * at;
            *twice += x * at * at;
            self.squares += x * x;
        }
    }

    /// Mean, and standard deviation about the parabola that fits best (n - 3): what a track does slowly, and a rig that
    /// settles, are no texture. `None` of fewer than four.
    pub(super) fn mean_and_sd(self) -> Option<(f32, f32)> {
        if self.samples < 4 {
            return None;
        }
        let n = f64::from(self.samples);
        let [sum, once, twice] = self.moments.map(|moment| moment as f64);
        // along 1, u and u^2 less its mean, which are at right angles; u is the number of the sample from the middle
        let middle = (n - 1.0) / 2.0;
        let mean_square = (n * n - 1.0) / 12.0;
        let slope = once - middle * sum;
        let bend = twice - 2.0 * middle * once + (middle * middle - mean_square) * sum;
        let rest = self.squares as f64
            - sum * sum / n
            - slope * slope / (n * mean_square)
            - bend * bend / (n * (n * n - 1.0) * (n * n - 4.0) / 180.0);
        let sd = libm::sqrt((rest / (n - 3.0)).max(0.0));
        Some(((sum / n) as f32, sd as f32))
    }
}

/// The measurements of one slide.
#[derive(Clone, PartialEq, Debug)]
pub struct Measurement {
    /// The paper's three properties.
    pub properties: Properties,
    /// The texture is at most this rough: its power is lost in the background (see [`roughness`]).
    pub roughness_is_bound: bool,
    /// [`SlideError::Clipped`] where that is to be told, though the slide counts: see [`Signal::check`].
    pub clipped: Option<SlideError>,
    /// Mean of P_DC during the slide in counts about the lifted finger's, and standard deviation about the parabola
    /// that fits best; `None` if it was not given.
    pub pdc: Option<(f32, f32)>,
    /// See [`Observation::pace`](super::observation::Observation::pace).
    pub pace: Option<i16>,
    /// Number of the bands of [`FUSED_EDGES`], from the lowest, that were measured.
    pub bands: usize,
    /// Power of the still finger in counts^2.
    pub background: f32,
    /// Averaged spectrum of the unfiltered P_AC, window mean removed.
    pub spectrum: Spectrum,
}

impl Measurement {
    /// Natural logarithms of the eight band powers of [`BAND_EDGES`] in counts^2 per bin, each with 0.001 added so that
    /// silence has a value.
    pub fn ln_bands(&self) -> [f32; BAND_EDGES.len() - 1] {
        let mut bands = [0.0; BAND_EDGES.len() - 1];
        for (band, edges) in bands.iter_mut().zip(BAND_EDGES.windows(2)) {
            if let &[low, high] = edges {
                *band = libm::logf(self.spectrum.band(low..high) + 1e-3);
            }
        }
        bands
    }
}

#[cfg(test)]
mod tests {
    use super::super::property::{Property, PropertySet};
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    /// Noise with a sine in it, as from a texture.
    fn texture(n: usize) -> Vec<i16> {
        let mut x = 7u32;
        (0..n)
            .map(|n| {
                x = x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                ((x >> 26) as i16 - 32) + (200.0 * (n as f64 * 0.4).sin()) as i16
            })
            .collect()
    }

    fn measure(
        samples: &[i16],
        steady: Range<u32>,
        cuts: &[usize],
    ) -> Result<Measurement, SlideError> {
        let plan = Plan::new();
        let mut slide = Slide::new(&plan, Movement::FOR_FINENESS);
        slide.set_background(2.0);
        slide.start(steady);
        let mut rest = samples;
        for &n in cuts.iter().cycle() {
            if rest.is_empty() {
                break;
            }
            let (now, later) = rest.split_at(n.min(rest.len()));
            slide.push(now);
            rest = later;
        }
        slide.finish()
    }

    #[test]
    fn a_look_is_the_slide_that_ends_there_and_changes_nothing() {
        let samples = texture(6000);
        let plan = Plan::new();
        let mut slide = Slide::new(&plan, Movement::FOR_FINENESS);
        slide.set_background(2.0);
        slide.start(300..6000);
        for end in [1400, 2500, 2777] {
            slide.push(&samples[slide.position as usize..end]);
            let steady = end as u32 - 300;
            let ended = measure(&samples, 300..end as u32, &[6000]);
            assert!(ended.is_ok());
            assert_eq!(slide.look(steady), ended);
            let unfinished = SlideError::Unfinished {
                got: steady,
                wanted: steady + 1,
            };
            assert_eq!(slide.look(steady + 1), Err(unfinished));
        }
        slide.push(&samples[2777..]);
        assert_eq!(slide.finish(), measure(&samples, 300..6000, &[100]));
    }

    #[test]
    fn band_edges_are_the_bins_of_equal_ratios() {
        for (q, edge) in BAND_EDGES.into_iter().enumerate() {
            let f = 20.0 * 50f64.powf(q as f64 / 8.0);
            assert_eq!(edge, (f / (2200.0 / FRAME as f64)).ceil() as usize);
        }
    }

    #[test]
    fn roughness_below_the_background_is_a_bound() {
        assert_eq!(roughness(102.0, 2.0), (libm::logf(100.0), false));
        assert_eq!(
            roughness(33.0, 32.0),
            (libm::logf(2.0), true),
            "a 16th of the background"
        );
        assert_eq!(roughness(1.0, 32.0), (libm::logf(2.0), true));
        assert_eq!(roughness(34.0, 32.0), (libm::logf(2.0), false));
        assert_eq!(roughness(0.0, 0.0), (libm::logf(1.0 / 12.0), true));
        assert!(!roughness(0.1, 0.0).1);
    }

    #[test]
    fn traction_is_the_mean_shear_and_missing_without_a_force_sensor() {
        let samples = texture(1000);
        assert_eq!(
            measure(&samples, 100..900, &[100])
                .unwrap()
                .properties
                .get(Property::Traction),
            None
        );
        let plan = Plan::new();
        let mut slide = Slide::new(&plan, Movement::FOR_FINENESS);
        slide.set_background(0.0);
        slide.start(0..1000);
        slide.push(&samples);
        slide.push_shear(&[100, 200]);
        slide.push_shear(&[-30, 0]);
        let p = slide.finish().unwrap().properties;
        assert_eq!(p.get(Property::Traction), Some(0.0675));
        assert_eq!(p.measured(), PropertySet::ALL);
    }

    #[test]
    fn still_finger_gives_the_background_without_the_filters_start() {
        let still = texture(2000);
        let plan = Plan::new();
        let background = |blocks: &[&[i16]]| {
            let mut slide = Slide::new(&plan, Movement::FOR_FINENESS);
            for block in blocks {
                slide.push_still(block);
            }
            slide.start(0..1000);
            slide.push(&texture(1000));
            slide.finish().map(|m| m.background)
        };
        let whole = background(&[&still]).unwrap();
        // the definition: outputs of the filter from the 67th sample on
        let mut power = BandPower::default();
        power.prime(&plan, &still[..66]);
        power.push(&plan, &still[66..]);
        assert_eq!(Some(whole), power.mean(&plan));
        assert_eq!(
            background(&[&still[..20], &still[20..50], &still[50..]]),
            Ok(whole)
        );
        assert_eq!(background(&[&still[..66]]), Err(SlideError::NoBackground));
        assert_eq!(background(&[]), Err(SlideError::NoBackground));
    }

    /// Samples that arrive tick by tick and are gathered into blocks give the same slide as the samples one by one.
    #[test]
    fn a_slide_of_blocks_is_that_of_its_samples() {
        use super::super::block::{Blocks, SamplePhase};
        let (still, moving) = (texture(500), texture(2000));
        let plan = Plan::new();
        let mut by_hand = Slide::new(&plan, Movement::FOR_FINENESS);
        by_hand.push_still(&still);
        by_hand.start(100..1900);
        by_hand.push(&moving);
        by_hand.push_shear(&(0..900).map(|n| n - 300).collect::<Vec<i16>>());
        let (mut blocks, mut slide) =
            (Blocks::default(), Slide::new(&plan, Movement::FOR_FINENESS));
        let ticks = still.chunks(2).map(|pac| (SamplePhase::Still, pac, None));
        let slid = moving.chunks(2).zip(0..).map(|(pac, ms)| match ms {
            0 => (SamplePhase::Begin(100..1900), pac, None),
            _ => (
                SamplePhase::Slide,
                pac,
                (50..950).contains(&ms).then_some(ms - 350),
            ),
        });
        for (phase, pac, shear_mn) in ticks.chain(slid) {
            if let Some(block) = blocks.put(&phase, pac, shear_mn) {
                slide.take(&block);
            }
        }
        let mut lossy = slide.clone();
        lossy.take(&blocks.clone().end(3));
        slide.take(&blocks.end(0));
        let whole = by_hand.finish();
        assert_eq!(slide.finish(), whole);
        assert_eq!(lossy.finish(), Err(SlideError::Gap(3)));
        // as are those that are cut afterwards
        let shear: Vec<i16> = (0..900).map(|n| n - 300).collect();
        let of = |missing| {
            let mut slide = Slide::new(&plan, Movement::FOR_FINENESS);
            let blocks = Block::cut(&still, 100..1900, &moving, &shear);
            for block in blocks.filter(|block| Some(block.number) != missing) {
                slide.take(&block);
            }
            (slide.next_block(), slide.finish())
        };
        assert_eq!(of(None), (40, whole));
        assert_eq!(of(Some(20)), (40, Err(SlideError::Gap(64))));
    }

    #[test]
    fn an_incomplete_slide_has_no_properties() {
        let samples = texture(2000);
        assert_eq!(
            measure(&samples, 100..2001, &[2000]),
            Err(SlideError::Unfinished {
                got: 1900,
                wanted: 1901
            })
        );
        assert_eq!(
            measure(&samples, 100..611, &[2000]),
            Err(SlideError::TooShort(511))
        );
        assert!(measure(&samples, 100..612, &[2000]).is_ok());
        assert_eq!(
            measure(&samples, 0..0, &[2000]),
            Err(SlideError::NotStarted)
        );
        assert_eq!(
            measure(&[0; 2000], 0..2000, &[2000]),
            Err(SlideError::Silent)
        );
    }

    #[test]
    fn what_lies_outside_the_steady_part_only_fills_the_filter() {
        let mut samples = texture(3000);
        let clean = measure(&samples, 500..2500, &[3000]).unwrap();
        samples[..434].fill(2000);
        samples[2500..].fill(-2000);
        assert_eq!(measure(&samples, 500..2500, &[3000]).unwrap(), clean);
        samples[434] = 2000;
        assert_ne!(
            measure(&samples, 500..2500, &[3000]).unwrap().properties,
            clean.properties,
            "66 samples of memory"
        );
    }

    proptest! {
        #[test]
        fn properties_do_not_depend_on_the_blocks(cuts in proptest::collection::vec(1usize..700, 1..12),
            start in 0u32..600, length in 512u32..1400) {
            let samples = texture(2000);
            let whole = measure(&samples, start..start + length, &[2000]);
            prop_assert!(whole.is_ok());
            prop_assert_eq!(measure(&samples, start..start + length, &cuts), whole);
        }
    }
}
