//! Checks of recorded samples before anything is learned from them: a sensor that is dead is no texture.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use tactus_core::features::{Signal, SlideError};

use super::recording::{PAC_RATE_HZ, Recording};
use super::recordings::files::sha256;
use super::recordings::npy;

/// The streams of a slide begin and end together, but for a sample and the time that a recorder takes to stop, s.
const STOPPING_S: f64 = 0.1;

/// The reasons why the samples of a slide cannot be those of a sensor that works.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub(crate) enum SampleFault {
    /// The signal hangs, or is cut off.
    #[error(transparent)]
    Signal(#[from] SlideError),
    #[error(
        "its P_AC is that of slide {0}, sample for sample: a copy, or a recorder that repeats itself"
    )]
    Repeats(u32),
    #[error("P_AC lasts {pac:.2} s and {stream} {other:.2} s: samples are missing")]
    Missing {
        pac: f64,
        stream: &'static str,
        other: f64,
    },
}

/// The slides of one texture, one after the other.
#[derive(Debug, Default)]
pub(crate) struct SlideChecks {
    /// SHA-256 of P_AC, and the number of its slide.
    seen: HashMap<String, u32>,
}

impl SlideChecks {
    /// Checks the next slide; what is told of a signal that is cut off a little.
    /// Errors: the first fault of its samples.
    pub(crate) fn check(&mut self, slide: &Recording) -> Result<Option<SlideError>, SampleFault> {
        let pac = slide.pac();
        let steady = pac.get(slide.steady(PAC_RATE_HZ)).unwrap_or_default();
        let signal = |samples: &[i16]| {
            let mut signal = Signal::default();
            signal.push(samples);
            signal.check()
        };
        signal(&slide.still())?;
        let clipped = signal(steady)?;
        let seconds = |samples: usize, rate_hz: u32| samples as f64 / f64::from(rate_hz);
        let lasts = seconds(pac.len(), PAC_RATE_HZ);
        let shear = slide.shear_mn().map(|mn| (mn.len(), slide.shear_rate_hz));
        // without samples it was not measured
        let pdc = Some((slide.pdc.len(), slide.pdc_rate_hz)).filter(|(samples, _)| *samples > 0);
        for (stream, of) in [("P_DC", pdc), ("shear", shear)] {
            let Some((samples, rate_hz)) = of else {
                continue;
            };
            let other = seconds(samples, rate_hz);
            if (lasts - other).abs() > STOPPING_S + seconds(1, rate_hz) {
                return Err(SampleFault::Missing {
                    pac: lasts,
                    stream,
                    other,
                });
            }
        }
        match self.seen.entry(sha256(&npy::write(&pac))) {
            Entry::Occupied(other) => Err(SampleFault::Repeats(*other.get())),
            Entry::Vacant(new) => {
                new.insert(slide.number);
                Ok(clipped)
            }
        }
    }
}
