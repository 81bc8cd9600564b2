//! Band-limited change of a signal's rate.

use rubato::audioadapter_buffers::direct::SequentialSlice;
use rubato::{Fft, FixedSync, Resampler as _};

/// Rates that are resampled, Hz; slower ones are taken for a slower clock.
pub(crate) const RATES_HZ: std::ops::RangeInclusive<f64> = 500.0..=192_000.0;

/// The signal at another rate, both in whole Hz; as long as it was, to a sample. What the new rate cannot carry is
/// taken out before.
pub(crate) fn resample(samples: &[f64], from_hz: u32, to_hz: u32) -> Vec<f64> {
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

    const SECONDS: u32 = 4;

    fn tone(hz: f64, rate_hz: u32) -> Vec<f64> {
        let wave = |n: u32| (TAU * hz * f64::from(n) / f64::from(rate_hz)).sin();
        (0..SECONDS * rate_hz).map(wave).collect()
    }

    /// Amplitude and delay, in samples, of a tone: the spectrum's value by the definition, over the middle half of the
    /// signal with Hann's window.
    fn response(signal: &[f64], rate_hz: f64, hz: f64) -> (f64, f64) {
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
        let delay = -re.atan2(im) / (TAU * hz / rate_hz);
        (2.0 * re.hypot(im) / weight, delay)
    }

    #[test]
    fn the_band_is_kept_and_nothing_is_folded_into_it() {
        for from_hz in [
            500, 999, 1000, 2205, 3333, 8000, 44_100, 48_000, 96_000, 192_000,
        ] {
            let band = f64::from(from_hz.min(2200)) / 2.0;
            // ripple of a thousandth, 0.01 dB, and one delay of all tones, about a sample at most, where a second has
            // an odd number of samples
            let mut late = None;
            for part in [0.02, 0.11, 0.3, 0.5, 0.7, 0.85, 0.93] {
                let hz = part * band;
                let out = resample(&tone(hz, from_hz), from_hz, 2200);
                let wanted = i64::from(SECONDS * 2200);
                assert!((out.len() as i64 - wanted).abs() <= 1, "{}", out.len());
                let (amplitude, delay) = response(&out, 2200.0, hz);
                assert!(
                    (amplitude - 1.0).abs() < 1e-3,
                    "{from_hz} Hz, tone of {hz} Hz: {amplitude}"
                );
                let late = *late.get_or_insert(delay);
                assert!(
                    delay.abs() < 1.2 && (delay - late).abs() < 0.01,
                    "{from_hz} Hz, tone of {hz} Hz: {delay} samples late"
                );
            }
            // 80 dB from a little above the band on
            for hz in [
                1115.0, 1200.0, 1500.0, 2100.0, 3300.0, 4399.0, 17_600.0, 88_000.0,
            ] {
                if hz < 0.499 * f64::from(from_hz) {
                    let out = resample(&tone(hz, from_hz), from_hz, 2200);
                    let rms = (out[2200..6600].iter().map(|x| x * x).sum::<f64>() / 4400.0).sqrt();
                    assert!(rms < 1e-4, "{from_hz} Hz, tone of {hz} Hz leaves {rms}");
                }
            }
            // what comes out of a slow sensor has nothing over its own band
            let hz = 0.4 * f64::from(from_hz);
            if from_hz < 2200 {
                let out = resample(&tone(hz, from_hz), from_hz, 2200);
                let (image, _) = response(&out, 2200.0, f64::from(from_hz) - hz);
                assert!(image < 1e-4, "{from_hz} Hz: an image of {image}");
            }
        }
    }

    #[test]
    fn noise_is_what_the_series_of_sinc_makes_of_it() {
        // a sum of tones that the band of both rates carries has one value at every instant
        for (from_hz, top) in [
            (700, 300.0),
            (1600, 700.0),
            (6000, 1000.0),
            (44_100, 1000.0),
        ] {
            let tones: Vec<(f64, f64)> = (1..40)
                .map(|n| (f64::from(n) * top / 40.0, f64::from(n * n)))
                .collect();
            let value = |t: f64| {
                tones
                    .iter()
                    .map(|(hz, phase)| (TAU * hz * t + phase).sin())
                    .sum::<f64>()
            };
            let at = |rate_hz: u32| move |n: u32| f64::from(n) / f64::from(rate_hz);
            let samples: Vec<f64> = (0..3 * from_hz).map(at(from_hz)).map(value).collect();
            let out = resample(&samples, from_hz, 2200);
            for n in 2200..4400 {
                let wrong = out[n as usize] - value(at(2200)(n));
                assert!(
                    wrong.abs() < 0.02,
                    "{from_hz} Hz, sample {n}: off by {wrong}"
                );
            }
        }
    }
}
