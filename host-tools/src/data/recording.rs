//! One recorded slide: its samples, the movement that made it, and its steady part.

use std::ops::Range;

use tactus_core::features::Movement;
use tactus_core::sensor::pressure::RATE_HZ;

use crate::data::content::ContentError;
use crate::data::recordings::npy::MAX_SAMPLES;

/// Rate of P_AC in every recording: the BioTac's 2200 Hz.
pub const PAC_RATE_HZ: u32 = RATE_HZ;

/// One slide over one texture.
#[derive(Clone, PartialEq, Debug)]
pub struct Slide {
    /// Index of the texture in [`RecordingSet::textures`](crate::data::recordings::RecordingSet::textures).
    pub texture: usize,
    /// Number of the slide; slides of a texture were made in the order of their numbers.
    pub number: u32,
    /// The movement that made it.
    pub movement: Movement,
    /// P_AC at [`PAC_RATE_HZ`] in counts about the still baseline, from the start of the record.
    pub pac: Vec<i16>,
    /// P_DC in counts about the still baseline.
    pub pdc: Vec<i16>,
    /// Rate of [`pdc`](Self::pdc) in Hz.
    pub pdc_rate_hz: u32,
    /// Tangential force in mN, positive against the motion; `None` if the rig could not measure it.
    pub shear_mn: Option<Vec<i16>>,
    /// Rate of [`shear_mn`](Self::shear_mn) in Hz, also where there is none.
    pub shear_rate_hz: u32,
    /// Start and end of the steady part, in seconds from the start of the record.
    pub window: (f32, f32),
    /// What P_AC shows without any texture.
    pub background: Background,
}

/// P_AC of a still finger: what is subtracted from the power of a slide.
#[derive(Clone, PartialEq, Debug)]
pub enum Background {
    /// Its power in counts^2 after the band-pass, measured elsewhere.
    Power(f32),
    /// P_AC of the finger at rest before this slide, like [`Slide::pac`].
    Still(Vec<i16>),
}

/// One texture of a set.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Texture {
    /// The number that the recordings give it.
    pub id: u32,
    /// Its name.
    pub name: String,
}

/// What is known of a slide before its samples are read.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct SlideKey {
    /// As [`Slide::number`].
    pub number: u32,
    /// As [`Slide::movement`].
    pub movement: Movement,
}

impl Slide {
    /// The steady window as sample numbers of a stream with `rate_hz`.
    pub fn steady(&self, rate_hz: u32) -> Range<usize> {
        // `as` saturates and turns not-a-number into 0
        let sample = |s: f32| (f64::from(s) * f64::from(rate_hz)).round() as usize;
        sample(self.window.0)..sample(self.window.1)
    }

    /// Refuses a slide that cannot be used: every reader and writer asks.
    ///
    /// # Errors
    /// What is wrong with it.
    pub(crate) fn check(&self) -> Result<(), ContentError> {
        let (start, end) = self.window;
        if !(start.is_finite() && end.is_finite() && 0.0 <= start && start < end) {
            return Err(ContentError::Window(start, end));
        }
        let streams = [
            ("P_AC", PAC_RATE_HZ, Some(&self.pac)),
            ("P_DC", self.pdc_rate_hz, Some(&self.pdc)),
            ("shear", self.shear_rate_hz, self.shear_mn.as_ref()),
        ];
        for (stream, rate_hz, samples) in streams {
            let Some(samples) = samples.map(Vec::len) else {
                continue;
            };
            if rate_hz == 0 || rate_hz > 100_000 {
                return Err(ContentError::Rate(rate_hz, stream));
            }
            if samples > MAX_SAMPLES {
                return Err(ContentError::Samples(samples, stream));
            }
            if samples < self.steady(rate_hz).end {
                return Err(ContentError::EndsEarly {
                    stream,
                    samples,
                    rate_hz,
                    end_s: end,
                });
            }
        }
        match &self.background {
            Background::Power(power) if !power.is_finite() || *power < 0.0 => {
                Err(ContentError::BackgroundPower(*power))
            }
            Background::Still(still) if still.is_empty() => Err(ContentError::NoStill),
            _ => Ok(()),
        }
    }
}
