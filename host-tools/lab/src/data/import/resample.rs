//! Band-limited change of a signal's rate.

use rubato::audioadapter_buffers::direct::SequentialSlice;
use rubato::{Fft, FixedSync, Resampler as _};

/// Rates that are resampled, Hz; slower ones are taken for a slower clock.
pub(super) const RATES_HZ: std::ops::RangeInclusive<f64> = 500.0..=192_000.0;

/// The signal at another rate, both in whole Hz; as long as it was, to a sample. What the new rate cannot carry is
/// taken out before.
pub(super) fn resample(samples: &[f64], from_hz: u32, to_hz: u32) -> Vec<f64> {
    if from_hz == to_hz {
        return samples.to_vec();
    }
    // a second at a time, so that the filter's edge is a few hertz wide
    let resampler = Fft::<f64>::new(
        from_hz as usize,
        to_hz as usize,
        from_hz as usize,
        1,
        FixedSync::Both,
    );
    let input = SequentialSlice::new(samples, 1, samples.len());
    let (Ok(mut resampler), Ok(input)) = (resampler, input) else {
        return Vec::new();
    };
    let output = resampler.process_all(&input, samples.len(), None);
    output.map_or_else(|_| Vec::new(), |output| output.take_data())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// The spectrum's value of a frequency by the definition, over the middle half of the signal with Hann's window.
    fn amplitude(signal: &[f64], rate_hz: f64, hz: f64) -> f64 {
        let (from, to) = (signal.len() / 4, signal.len() * 3 / 4);
        let (mut re, mut im, mut weight) = (0.0, 0.0, 0.0);
        for (n, x) in signal.iter().enumerate().take(to).skip(from) {
            let place = (n - from) as f64 / (to - from) as f64;
            let hann = 0.5 - 0.5 * (TAU * place).cos();
            let phase = TAU * hz * n as f64 / rate_hz;
            re += hann * x * phase.cos();
            im += hann * x * phase.sin();
            weight += hann;
        }
        2.0 * re.hypot(im) / weight
    }

    #[test]
    fn the_band_is_kept_and_nothing_is_folded_into_it() {
        for from_hz in [500, 999, 1000, 2205, 3333, 8000, 44_100, 48_000, 192_000] {
            let seconds = 4;
            let tone = |hz: f64| -> Vec<f64> {
                let wave = |n: u32| (TAU * hz * f64::from(n) / f64::from(from_hz)).sin();
                (0..seconds * from_hz).map(wave).collect()
            };
            let band = f64::from(from_hz.min(2200)) / 2.0;
            for part in [0.02, 0.3, 0.7, 0.93] {
                let hz = part * band;
                let out = resample(&tone(hz), from_hz, 2200);
                assert!(
                    (out.len() as i64 - i64::from(seconds * 2200)).abs() <= 1,
                    "{}",
                    out.len()
                );
                let got = amplitude(&out, 2200.0, hz);
                assert!(
                    (got - 1.0).abs() < 0.01,
                    "{from_hz} Hz, tone of {hz} Hz: {got}"
                );
                // and where it was, to a sample
                let late = |n: usize| (out[n] - (TAU * hz * n as f64 / 2200.0).sin()).abs();
                let worst = (2200..6600).map(late).fold(0.0, f64::max);
                let sample = TAU * hz / 2200.0;
                assert!(
                    worst < 1.1 * sample + 0.01,
                    "{from_hz} Hz, tone of {hz} Hz: off by {worst}"
                );
            }
            for hz in [1200.0, 1500.0, 2100.0, 3300.0] {
                if hz < f64::from(from_hz) / 2.0 {
                    let out = resample(&tone(hz), from_hz, 2200);
                    let rms = (out[2200..6600].iter().map(|x| x * x).sum::<f64>() / 4400.0).sqrt();
                    assert!(rms < 1e-4, "{from_hz} Hz, tone of {hz} Hz leaves {rms}");
                }
            }
        }
    }
}
