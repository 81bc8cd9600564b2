//! The sensor's signals while it is pressed (fig. 3) and while it slides (fig. 4).

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use tactus_core::dsp::{BAND_PASS, BIN_HZ, Plan, TAPS};
use tactus_core::features::Movement;
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::sensor::FingerName;
use tactus_core::sensor::pressure::{Calibration, RATE_HZ};

use super::error::StudyError;
use super::slides::{Named, StudyWorld, properties};
use super::training::correlation;
use tactus_lab::data::replay::measure;
use tactus_lab::sim::collection::{Trial, TrialError};
use tactus_lab::sim::rig::SimError;
use tactus_world::finger::PAC_PA_PER_COUNT;
use tactus_world::slot::Reader;

/// Numbers of the sessions: see [`super::slides::Session::number`].
const PRESS: u64 = 5;
const EXAMPLES: u64 = 6;
/// Texture that is pressed on: acrylic, hard and flat as a force plate is.
const PLATE: u8 = 41;
/// Largest force of the line, N (paper, fig. 3).
const LINEAR_N: f64 = 2.0;
/// Force at which the press turns round, N: beyond the line, as in the paper.
const TURN_N: f64 = 2.6;
/// Speed of the press, microsteps a second: the paper's 0.5 mm/s.
const STEPS_PER_S: u64 = 800;
/// The slot that gives P_DC.
const PDC: u64 = 1;
/// P_DC is averaged over so many words for a point of the figure.
const WORDS: usize = 22;
/// Words in the air before contact, for P_DC without force.
const AIR_WORDS: usize = 220;
/// The textures whose slides are shown.
const SHOWN: [(u8, Movement); 3] = [
    (100, Movement::FOR_FINENESS),
    (84, Movement::FOR_FINENESS),
    (46, Movement::FOR_FINENESS),
];
/// Length of the signal that is shown, s.
const SHOWN_S: f32 = 0.25;

/// Figs. 3 and 4.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Signals {
    /// Force against P_DC.
    pub press: Press,
    /// Slides.
    pub slides: Vec<Example>,
}

/// A press and a release on a hard plate.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Press {
    /// Change of P_DC in counts and force in N while the force grows.
    pub loading: Vec<(f64, f64)>,
    /// The same while it falls.
    pub unloading: Vec<(f64, f64)>,
    /// Slope of the line below 2 N, mN a count; the paper has 11.5.
    pub mn_per_count: f64,
    /// Squared correlation below 2 N; the paper has 0.995.
    pub r_squared: f64,
}

/// A slide as it was sampled.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Example {
    /// The texture.
    pub texture: Named,
    /// Force in N, speed in mm/s.
    pub movement: (f32, f32),
    /// Begin of the shown part of P_AC, s from the slide's begin.
    pub from_s: f64,
    /// P_AC, Pa, 2200 a second.
    pub pac_pa: Vec<f64>,
    /// The same behind the 20-700 Hz band-pass.
    pub filtered_pa: Vec<f64>,
    /// Traction, N, mean of each 20 ms of the steady part.
    pub shear_n: Vec<f64>,
    /// Begin of those, s from the slide's begin.
    pub steady_from_s: f64,
    /// Power of each bin of the averaged spectrum, Pa^2.
    pub spectrum_pa2: Vec<f64>,
    /// Width of a bin, Hz.
    pub bin_hz: f32,
    /// Spectral centroid, Hz.
    pub centroid_hz: f32,
    /// Traction in N, roughness and fineness of the slide.
    pub properties: [f32; 3],
}

/// ms whose shear is averaged for a point.
const SHEAR_MS: usize = 20;

impl Signals {
    /// Presses and slides.
    ///
    /// # Errors
    /// See [`StudyError`].
    pub fn run(world: StudyWorld) -> Result<Self, StudyError> {
        let calibration = world.calibration()?;
        let slide = |(texture, movement)| example(world, calibration, texture, movement);
        let slides = || SHOWN.into_par_iter().map(slide).collect::<Result<_, _>>();
        let (press, slides) = rayon::join(|| press(world), slides);
        Ok(Self {
            press,
            slides: slides?,
        })
    }
}

/// Presses at 0.5 mm/s until [`TURN_N`], and lifts again.
fn press(world: StudyWorld) -> Press {
    let mut rig = world.rig(PLATE, PRESS, 0.0);
    let world = rig.world();
    let step_ns = 1_000_000_000 / STEPS_PER_S;
    // the sensor needs 100 ms before it answers
    let mut now_ns = 200_000_000;
    world.lever_enable(now_ns, true);
    world.lever_dir(now_ns, true);
    let (mut loading, mut unloading, mut air) = (Vec::new(), Vec::new(), Vec::new());
    let mut point = (Vec::new(), 0.0);
    let mut down = true;
    let mut reader = Reader::new(FingerName::Biotac);
    loop {
        now_ns += step_ns;
        world.lever_step(now_ns, true);
        world.lever_step(now_ns + step_ns / 2, false);
        let at_ns = now_ns + step_ns / 2 + 5_000;
        let word = reader.word_of_slot(PDC, at_ns, |transfer, mosi, miso| {
            world.transfer(transfer, mosi, miso);
        });
        let Some(word) = word else { continue };
        let (counts, force_n) = (f64::from(word.counts.get()), world.truth().force_n);
        if force_n == 0.0 {
            if !down {
                break;
            }
            air.push(counts);
            continue;
        }
        point.0.push(counts);
        point.1 += force_n;
        if point.0.len() == WORDS {
            let rest = &air[air.len().saturating_sub(AIR_WORDS)..];
            let rest = rest.iter().sum::<f64>() / rest.len().max(1) as f64;
            let mean = point.0.iter().sum::<f64>() / WORDS as f64;
            let list = if down { &mut loading } else { &mut unloading };
            list.push((mean - rest, point.1 / WORDS as f64));
            point = (Vec::new(), 0.0);
        }
        if down && force_n > TURN_N {
            down = false;
            now_ns += step_ns;
            world.lever_dir(now_ns, false);
        }
    }
    let line: Vec<(f64, f64)> = loading
        .iter()
        .chain(&unloading)
        .copied()
        .filter(|(_, force_n)| *force_n < LINEAR_N)
        .collect();
    let (counts, forces): (Vec<f64>, Vec<f64>) = line.into_iter().unzip();
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len().max(1) as f64;
    let (of_counts, of_forces) = (mean(&counts), mean(&forces));
    let both = counts.iter().zip(&forces);
    let covariance: f64 = both.map(|(c, f)| (c - of_counts) * (f - of_forces)).sum();
    let variance: f64 = counts.iter().map(|c| (c - of_counts).powi(2)).sum();
    Press {
        mn_per_count: 1e3 * covariance / variance,
        r_squared: correlation(&counts, &forces).powi(2),
        loading,
        unloading,
    }
}

fn example(
    world: StudyWorld,
    calibration: RigCalibration,
    texture: u8,
    movement: Movement,
) -> Result<Example, StudyError> {
    let mut rig = world.rig(texture, EXAMPLES, 0.0);
    let at = Trial {
        world: world.seed,
        texture,
        slide: Some((movement, 1)),
    };
    let calibrated = rig.control().calibrate(calibration).map_err(SimError::from);
    let slide = calibrated
        .and_then(|()| rig.home())
        .and_then(|()| rig.record(movement));
    let slide = slide.map_err(|source| TrialError::Rig { at, source })?;
    let measured =
        measure(&Plan::new(), &slide).map_err(|source| TrialError::Slide { at, source })?;
    let (steady, pac) = (slide.steady(RATE_HZ), slide.pac());
    let length = (SHOWN_S * RATE_HZ as f32) as usize;
    let shown = steady.start..(steady.start + length).min(steady.end);
    let filtered = |at: usize| -> f64 {
        let newest_first = pac[at + 1 - TAPS..=at].iter().rev();
        let products = newest_first.zip(&BAND_PASS);
        let sum: f64 = products.map(|(x, h)| f64::from(*x) * f64::from(*h)).sum();
        sum / 32768.0
    };
    let of_ms = slide.steady(slide.shear_rate_hz);
    let shear = slide.shear_mn();
    let shear = shear.as_ref().and_then(|s| s.get(of_ms.clone()));
    let mean =
        |mn: &[i16]| mn.iter().map(|&mn| f64::from(mn)).sum::<f64>() / (1e3 * mn.len() as f64);
    Ok(Example {
        texture: Named::new(texture),
        movement: (movement.force_n(), movement.speed_mm_s()),
        from_s: shown.start as f64 / f64::from(RATE_HZ),
        pac_pa: shown
            .clone()
            .map(|at| f64::from(pac[at]) * PAC_PA_PER_COUNT)
            .collect(),
        filtered_pa: shown.map(|at| filtered(at) * PAC_PA_PER_COUNT).collect(),
        shear_n: shear
            .unwrap_or_default()
            .chunks_exact(SHEAR_MS)
            .map(mean)
            .collect(),
        steady_from_s: of_ms.start as f64 / f64::from(slide.shear_rate_hz),
        spectrum_pa2: measured
            .spectrum
            .psd()
            .iter()
            .map(|p| f64::from(*p) * PAC_PA_PER_COUNT * PAC_PA_PER_COUNT)
            .collect(),
        bin_hz: BIN_HZ,
        centroid_hz: measured.spectrum.centroid_hz().unwrap_or(0.0),
        properties: properties(&[vec![(&measured).into()]])[0][0],
    })
}

/// Force of one count of P_DC in the paper, mN, and the R^2 of its line.
pub const PAPER_LINE: (f32, f64) = (Calibration::PAPER.force_mn_per_count, 0.995);
