//! The features of a slide: the spectrum averaged over taxels and frames, its bands, and three properties.
use std::f64::consts::PI;
use std::sync::Arc;

use rustfft::num_complex::Complex;
use rustfft::{Fft, FftPlanner};

/// Taxels of the finger: values in a row.
pub(super) const TAXELS: usize = 16;
/// Bins of the eight bands, half-open, in the spectrum of 256 samples.
pub const BAND_EDGES: [usize; 9] = [2, 3, 5, 8, 13, 21, 34, 55, 90];
pub(super) const ROW_BYTES: usize = 2 * TAXELS;

const FRAME: usize = 256;
/// Samples from one frame to the next.
const HOP: usize = 128;
/// Bins of the single-sided spectrum, both ends included.
const BINS: usize = FRAME / 2 + 1;
/// Fewest samples that are measured: with an eighth of a frame, 11 Hz is the lowest frequency that a spectrum resolves.
pub(super) const SHORTEST: usize = FRAME / 8;
/// Added to the power of a band, in counts^2 (a silent band has a logarithm, and small differences there are noise).
const BAND_FLOOR: f64 = 0.1;
/// Variance below which a taxel shows nothing but a straight line and the rounding of f64. A single step of one count
/// among 2^22 samples has more.
const FLAT: f64 = 1e-9;
/// Smallest decorrelation: taxels that move as one have a logarithm. Those of data/fabricslide are at 0.27 or more.
const RIGID: f64 = 1e-6;

/// ln of the bands' powers, and the properties, as [`super::FabricSlide`] has them.
pub(super) type Measured = ([f32; 8], [f32; 3]);

/// Window and transform, made once.
pub(super) struct Meter {
    window: Vec<f64>,
    fft: Arc<dyn Fft<f64>>,
}

impl Default for Meter {
    fn default() -> Self {
        let hann = |n| 0.5 - 0.5 * (2.0 * PI * n as f64 / FRAME as f64).cos();
        Self {
            window: (0..FRAME).map(hann).collect(),
            fft: FftPlanner::new().plan_fft_forward(FRAME),
        }
    }
}

impl Meter {
    /// Measures a slide: rows of 16 little-endian 16-bit values. Errors: The slide is too short, or no taxel moves.
    pub(super) fn measure(&self, rows: &[u8]) -> Result<Measured, &'static str> {
        let samples = rows.len() / ROW_BYTES;
        if samples < SHORTEST {
            return Err("a slide of fewer than 32 samples is too short");
        }
        let taxels: [Vec<f64>; TAXELS] = std::array::from_fn(|t| detrended(rows, t));
        let variances = taxels
            .each_ref()
            .map(|taxel| taxel.iter().map(|x| x * x).sum::<f64>() / samples as f64);
        if variances.iter().all(|v| *v < FLAT) {
            return Err("no taxel moves: the finger did not touch, or the sensor is dead");
        }
        let spectrum = self.spectrum(&taxels);
        let ln_bands = std::array::from_fn(|b| {
            let band = &spectrum[BAND_EDGES[b]..BAND_EDGES[b + 1]];
            (band.iter().sum::<f64>() / band.len() as f64 + BAND_FLOOR).ln() as f32
        });
        let power = variances.iter().sum::<f64>() / TAXELS as f64;
        let properties = [
            power,
            centroid(&spectrum),
            decorrelation(&taxels, &variances),
        ];
        Ok((ln_bands, properties.map(|x| x.ln() as f32)))
    }

    /// Averaged spectrum: |X|^2 over the sum of the squares of the window, mean over taxels and whole frames. A slide
    /// that is shorter than a frame makes one, with zeros behind it.
    fn spectrum(&self, taxels: &[Vec<f64>; TAXELS]) -> [f64; BINS] {
        let mut sum = [0.0; BINS];
        let mut frames = 0;
        let zero = Complex::new(0.0, 0.0);
        let mut bins = vec![zero; FRAME];
        let mut scratch = vec![zero; self.fft.get_inplace_scratch_len()];
        for taxel in taxels {
            let last = taxel.len().saturating_sub(FRAME);
            for start in (0..=last).step_by(HOP) {
                bins.fill(zero);
                for ((bin, x), w) in bins.iter_mut().zip(&taxel[start..]).zip(&self.window) {
                    bin.re = x * w;
                }
                self.fft.process_with_scratch(&mut bins, &mut scratch);
                for (sum, bin) in sum.iter_mut().zip(&bins) {
                    *sum += bin.norm_sqr();
                }
                frames += 1;
            }
        }
        let squares: f64 = self.window.iter().map(|w| w * w).sum();
        sum.map(|x| x / (squares * f64::from(frames)))
    }
}

/// The samples of one taxel without the straight line that fits them best.
fn detrended(rows: &[u8], taxel: usize) -> Vec<f64> {
    let value = |row: &[u8]| f64::from(u16::from_le_bytes([row[2 * taxel], row[2 * taxel + 1]]));
    let mut samples: Vec<f64> = rows.chunks_exact(ROW_BYTES).map(value).collect();
    let mean = samples.iter().sum::<f64>() / samples.len() as f64;
    let middle = (samples.len() as f64 - 1.0) / 2.0;
    let time = |i: usize| i as f64 - middle;
    let (mut rise, mut run) = (0.0, 0.0);
    for (i, x) in samples.iter().enumerate() {
        rise += time(i) * (x - mean);
        run += time(i) * time(i);
    }
    for (i, x) in samples.iter_mut().enumerate() {
        *x -= mean + time(i) * rise / run;
    }
    samples
}

/// Centroid of a spectrum in bins, without bin 0: the window's leakage of the mean is no texture.
fn centroid(spectrum: &[f64; BINS]) -> f64 {
    let (mut moment, mut power) = (0.0, 0.0);
    for (bin, p) in spectrum.iter().enumerate().skip(1) {
        moment += bin as f64 * p;
        power += p;
    }
    moment / power
}

/// 1 less the mean correlation of two taxels; one that is flat correlates with none.
fn decorrelation(taxels: &[Vec<f64>; TAXELS], variances: &[f64; TAXELS]) -> f64 {
    // the sum of all correlations is the square of the sum of the taxels, each scaled to length 1
    let mut total = vec![0.0; taxels[0].len()];
    let mut alone = 0.0;
    for (taxel, &variance) in taxels.iter().zip(variances) {
        if variance < FLAT {
            continue;
        }
        let scale = 1.0 / (variance * taxel.len() as f64).sqrt();
        for (total, x) in total.iter_mut().zip(taxel) {
            *total += x * scale;
        }
        alone += 1.0;
    }
    let all: f64 = total.iter().map(|x| x * x).sum();
    let pairs = (TAXELS * (TAXELS - 1)) as f64;
    (1.0 - (all - alone) / pairs).max(RIGID)
}
