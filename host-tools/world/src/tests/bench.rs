//! The bench on which the world is observed: a finger pressed and slid by hand, and an analysis of its signals of its
//! own.

use std::f64::consts::TAU;

use crate::TRIAL_VARIATION;
use crate::conditions::{TICK_S, TICKS_PER_S};
use crate::finger::{Contact, Finger};
use crate::noise::Noise;
use crate::surface::Surface;
use crate::textures::draw;

/// Samples of P_AC a second.
pub(super) const RATE: f64 = 2200.0;
/// Ticks between samples of P_AC.
const SAMPLE_TICKS: u32 = 6;
/// Points of a section of the averaged spectrum; 8.6 Hz a bin.
const SECTION: usize = 256;
/// Approach, mm/s: faster than the rig, to save time.
const APPROACH_MM_S: f64 = 4.0;
/// Distance in which the skin has begun to slip for certain, mm.
const ONSET_MM: f64 = 4.0;
/// Longest steady part of a slide, mm and s.
const STEADY_MM: f64 = 50.0;
const STEADY_S: f64 = 1.0;

/// A locked stepper motor: three tones in the fluid, other ones for each slide (PAPER: its noise differs from trial to
/// trial). About the amplifier's own noise; chosen.
struct Hum([(f64, f64, f64); 3]);

impl Hum {
    fn new(seed: u64) -> Self {
        let mut noise = Noise::new(seed, 10);
        Self(std::array::from_fn(|_| {
            (noise.about(0.3, 0.7), noise.between(60.0, 600.0), 0.0)
        }))
    }

    fn tick(&mut self) -> f64 {
        self.0
            .iter_mut()
            .map(|(pa, hz, turns)| {
                *turns += *hz * TICK_S;
                *pa * (TAU * *turns).sin()
            })
            .sum()
    }
}

/// A slide as it was sampled, and its ground truth.
pub(super) struct Slide {
    /// P_AC in counts while pressed and still, and while sliding
    pub(super) background: Vec<f64>,
    pub(super) pac: Vec<f64>,
    /// mean of the true forces while sliding, N
    pub(super) shear_n: f64,
    pub(super) force_n: f64,
}

/// The three properties as the paper defines them, computed here.
#[derive(Clone, Copy, Debug)]
pub(super) struct Properties {
    pub(super) traction: f64,
    pub(super) roughness: f64,
    pub(super) fineness: f64,
}

/// Presses to `force_n`, slides at `speed` and lifts. The start is drawn by `seed`.
pub(super) fn slide(
    finger: &mut Finger,
    surface: &Surface,
    force_n: f64,
    speed: f64,
    seed: u64,
) -> Slide {
    let steady_mm = STEADY_MM.min(STEADY_S * speed);
    let mut x_mm = Noise::new(seed, 9).between(2.0, 73.0 - ONSET_MM - steady_mm);
    let mut hum = Hum::new(seed);
    let mut contact = Contact {
        indentation_mm: 0.0,
        surface: Some(surface),
        x_mm,
        speed_mm_s: 0.0,
        lever_vibration: 0.0,
    };
    let mut ticks = 0_u32;
    let mut run = |contact: &mut Contact<'_>, finger: &mut Finger| {
        contact.lever_vibration = hum.tick();
        finger.tick(contact);
        x_mm += contact.speed_mm_s * TICK_S;
        contact.x_mm = x_mm;
        ticks += 1;
        ticks
            .is_multiple_of(SAMPLE_TICKS)
            .then(|| f64::from(finger.sample_channel(0, 1.0)))
    };
    while finger.force_n() < force_n {
        contact.indentation_mm += APPROACH_MM_S * TICK_S;
        run(&mut contact, finger);
    }
    for _ in 0..TICKS_PER_S / 4 {
        run(&mut contact, finger);
    }
    let background = (0..TICKS_PER_S / 4)
        .filter_map(|_| run(&mut contact, finger))
        .collect();
    contact.speed_mm_s = speed;
    for _ in 0..(ONSET_MM / speed / TICK_S) as u32 {
        run(&mut contact, finger);
    }
    let steady = (steady_mm / speed / TICK_S) as u32;
    let (mut shear_n, mut mean_n) = (0.0, 0.0);
    let pac = (0..steady)
        .filter_map(|_| {
            shear_n += finger.shear_n.abs() / f64::from(steady);
            mean_n += finger.force_n() / f64::from(steady);
            run(&mut contact, finger)
        })
        .collect();
    contact.indentation_mm = 0.0;
    contact.speed_mm_s = 0.0;
    for _ in 0..TICKS_PER_S / 10 {
        run(&mut contact, finger);
    }
    Slide {
        background,
        pac,
        shear_n,
        force_n: mean_n,
    }
}

impl Slide {
    pub(super) fn properties(&self) -> Properties {
        let spectrum = spectrum(&self.pac);
        let background = band(&self::spectrum(&self.background), 20.0, 700.0);
        // the rest of noise by chance counts as a hundredth of the noise
        let power = (band(&spectrum, 20.0, 700.0) - background).max(0.01 * background);
        Properties {
            traction: self.shear_n,
            roughness: power.ln(),
            fineness: centroid(&spectrum).ln(),
        }
    }
}

pub(super) fn sample(number: u8, seed: u64) -> Surface {
    Surface::new(&draw(number, seed), seed, TRIAL_VARIATION)
}

/// Power of each bin, counts^2, averaged over Hann sections that overlap by half; they add up to the signal's variance.
pub(super) fn spectrum(signal: &[f64]) -> Vec<f64> {
    let mean = signal.iter().sum::<f64>() / signal.len() as f64;
    let table: Vec<(f64, f64)> = (0..SECTION)
        .map(|i| (TAU * i as f64 / SECTION as f64).sin_cos())
        .collect();
    let window: Vec<f64> = table.iter().map(|(_, cos)| 0.5 - 0.5 * cos).collect();
    let mut power = vec![0.0; SECTION / 2];
    let sections: Vec<&[f64]> = signal.windows(SECTION).step_by(SECTION / 2).collect();
    for section in &sections {
        let x: Vec<f64> = section
            .iter()
            .zip(&window)
            .map(|(x, w)| (x - mean) * w)
            .collect();
        for (k, power) in power.iter_mut().enumerate() {
            let (mut re, mut im) = (0.0, 0.0);
            for (i, x) in x.iter().enumerate() {
                let (sin, cos) = table[i * k % SECTION];
                re += x * cos;
                im += x * sin;
            }
            // two sides; 3/8 is the power of the window
            *power += 2.0 * (re * re + im * im) / (SECTION * SECTION) as f64 / 0.375;
        }
    }
    power.iter().map(|p| p / sections.len() as f64).collect()
}

fn hz(bin: usize) -> f64 {
    bin as f64 * RATE / SECTION as f64
}

pub(super) fn band(spectrum: &[f64], from_hz: f64, to_hz: f64) -> f64 {
    (0..spectrum.len())
        .filter(|k| (from_hz..to_hz).contains(&hz(*k)))
        .map(|k| spectrum[k])
        .sum()
}

/// Spectral centroid, Hz (eq. 18).
pub(super) fn centroid(spectrum: &[f64]) -> f64 {
    let moment: f64 = spectrum.iter().enumerate().map(|(k, p)| hz(k) * p).sum();
    moment / spectrum.iter().sum::<f64>()
}

/// Power of the signal at one frequency, counts^2, over all of it (Hann).
pub(super) fn line(signal: &[f64], hz: f64) -> f64 {
    let n = signal.len() as f64;
    let mean = signal.iter().sum::<f64>() / n;
    let (mut re, mut im) = (0.0, 0.0);
    for (i, x) in signal.iter().enumerate() {
        let window = 0.5 - 0.5 * (TAU * i as f64 / n).cos();
        let (sin, cos) = (TAU * hz / RATE * i as f64).sin_cos();
        re += (x - mean) * window * cos;
        im += (x - mean) * window * sin;
    }
    // amplitude a gives a n / 4
    8.0 * (re * re + im * im) / (n * n)
}

pub(super) fn mean(values: impl IntoIterator<Item = f64>) -> f64 {
    let (n, sum) = values
        .into_iter()
        .fold((0.0, 0.0), |(n, sum), x| (n + 1.0, sum + x));
    sum / n
}

pub(crate) fn deviation(values: &[f64]) -> f64 {
    let mean = mean(values.iter().copied());
    let sum: f64 = values.iter().map(|x| (x - mean).powi(2)).sum();
    (sum / (values.len() - 1) as f64).sqrt()
}

pub(crate) fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let (ma, mb) = (mean(a.iter().copied()), mean(b.iter().copied()));
    let product: f64 = a.iter().zip(b).map(|(a, b)| (a - ma) * (b - mb)).sum();
    product / (a.len() - 1) as f64 / deviation(a) / deviation(b)
}
