//! What one slide says: from samples to properties, band powers and spectrum.

use std::sync::OnceLock;

use numpy::PyArray1;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use serde::{Deserialize, Serialize};
use tactus_core::dsp::{BIN_HZ, BINS, FUSED_BANDS, Plan, Spectrum};
use tactus_core::features::{Measurement, Movement, Observation, Properties, Property};
use tactus_lab::data::recording::Recording;
use tactus_lab::data::replay::{MeasuredSlide, measure, observation};

use crate::error::{Raise as _, SlideError};
use crate::samples::samples;
use crate::values::{Pickled, array, pickled, unpickled};
use crate::work::work;

/// What one slide measures.
#[pyclass(frozen, module = "tactus")]
pub(crate) struct Features {
    pub(crate) movement: Movement,
    pub(crate) measurement: Measurement,
}

impl From<&MeasuredSlide> for Features {
    fn from(slide: &MeasuredSlide) -> Self {
        Self {
            movement: slide.movement,
            measurement: slide.measurement.clone(),
        }
    }
}

impl Features {
    /// What an exploration makes of it.
    pub(crate) fn observation(&self) -> Observation {
        observation(&self.measurement)
    }

    fn property(&self, property: Property) -> Option<f32> {
        self.measurement.properties.get(property)
    }
}

#[pymethods]
impl Features {
    /// Contact force of the movement, N; 0 where it is unknown.
    #[getter]
    fn force_n(&self) -> f32 {
        self.movement.written().0
    }

    /// Speed of the movement, mm/s; 0 where it is unknown.
    #[getter]
    fn speed_mm_s(&self) -> f32 {
        self.movement.written().1
    }

    /// Mean tangential force at constant speed, N (eq. 14); None where the rig cannot measure it.
    #[getter]
    fn traction_n(&self) -> Option<f32> {
        self.property(Property::Traction)
    }

    /// Natural logarithm of the band-passed power above the background, counts^2 (eq. 16).
    #[getter]
    fn roughness_ln(&self) -> Option<f32> {
        self.property(Property::Roughness)
    }

    /// Whether the texture is at most this rough: its power is lost in the background.
    #[getter]
    fn roughness_is_bound(&self) -> bool {
        self.measurement.roughness_is_bound
    }

    /// Natural logarithm of the spectral centroid, Hz (eq. 19).
    #[getter]
    fn fineness_unfiltered_ln(&self) -> Option<f32> {
        self.property(Property::Fineness)
    }

    /// float32 of shape (8,): natural logarithms of band powers from 20 to 1000 Hz, counts^2 per bin.
    #[getter]
    fn ln_psd_bands<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f32>> {
        array(py, self.measurement.ln_bands().to_vec())
    }

    /// float32 of shape (12,): those of the fused way of deciding, from 17 to 1000 Hz.
    #[getter]
    fn ln_fused_bands<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f32>> {
        array(py, self.measurement.spectrum.fused_bands().to_vec())
    }

    /// float32 of shape (257,): mean power spectrum of P_AC at constant speed, counts^2 per bin.
    #[getter]
    fn spectrum<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f32>> {
        array(py, self.measurement.spectrum.psd().to_vec())
    }

    /// float32 of shape (257,): the frequency of each bin of `spectrum`, Hz.
    #[getter]
    fn frequencies_hz<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f32>> {
        array(py, (0..BINS).map(|bin| bin as f32 * BIN_HZ).collect())
    }

    /// Power of the still finger after the band-pass, counts^2.
    #[getter]
    fn background(&self) -> f32 {
        self.measurement.background
    }

    /// Mean and standard deviation of P_DC at constant speed, counts; None where it was not given.
    #[getter]
    fn pdc(&self) -> Option<(f32, f32)> {
        self.measurement.pdc
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Pickled<'py>> {
        let measured = &self.measurement;
        let saved = Saved {
            movement: self.movement.into(),
            properties: measured.properties,
            roughness_is_bound: measured.roughness_is_bound,
            pdc: measured.pdc,
            pace: measured.pace,
            bands: measured.bands,
            clipped: measured.clipped,
            background: measured.background,
            spectrum: measured.spectrum.psd().to_vec(),
            fused_bands: *measured.spectrum.fused_bands(),
            frames: measured.spectrum.frames(),
        };
        pickled(py, "_features", &saved)
    }

    fn __repr__(&self) -> String {
        let values = Property::ALL.map(|property| match self.property(property) {
            Some(value) => format!("{property} {value:.3}"),
            None => format!("no {property}"),
        });
        format!("<tactus.Features {}: {}>", self.movement, values.join(", "))
    }
}

/// What every slide needs and no slide changes.
pub(crate) fn plan() -> &'static Plan {
    static PLAN: OnceLock<Plan> = OnceLock::new();
    PLAN.get_or_init(Plan::new)
}

pub(crate) fn movement(force_n: f32, speed_mm_s: f32) -> PyResult<Movement> {
    // 0 is what an unknown one is told as
    let known = |value: f32| (value != 0.0).then_some(value);
    Movement::partly(known(force_n), known(speed_mm_s)).map_err(|why| why.raise())
}

/// The `Features` of a slide of which the samples are here.
///
/// pac: P_AC at 2200 Hz in counts about the still baseline, from the start of the record: an array of shape (samples,)
/// or a list of whole numbers that 16 bits hold; it is copied before other threads run, and so are the other samples.
/// window_s: start and end of the part at constant speed, s. What follows is None where it is unknown. force_n,
/// speed_mm_s: the movement. still: P_AC of the finger at rest (2200 Hz), or background: its power after the band-pass,
/// counts^2. shear_mn: tangential force, mN, at shear_rate_hz. pdc: P_DC, counts, at pdc_rate_hz. Both from the same
/// start.
///
/// Raises SlideError where there are no features in it; TypeError for samples that are no whole numbers; ValueError for
/// another shape, masked samples, and numbers beyond 16 bits; KeyboardInterrupt after Ctrl-C.
#[pyfunction]
#[pyo3(signature = (pac, *, window_s, force_n=None, speed_mm_s=None, still=None, background=None, shear_mn=None,
    shear_rate_hz=100.0, pdc=None, pdc_rate_hz=100.0))]
#[expect(
    clippy::too_many_arguments,
    reason = "all but the first have names where it is called"
)]
fn features(
    py: Python<'_>,
    pac: &Bound<'_, PyAny>,
    window_s: (f32, f32),
    force_n: Option<f32>,
    speed_mm_s: Option<f32>,
    still: Option<&Bound<'_, PyAny>>,
    background: Option<f32>,
    shear_mn: Option<&Bound<'_, PyAny>>,
    shear_rate_hz: f64,
    pdc: Option<&Bound<'_, PyAny>>,
    pdc_rate_hz: f64,
) -> PyResult<Features> {
    let of = |name, given: Option<&Bound<'_, PyAny>>| {
        given.map(|given| samples(name, given)).transpose()
    };
    let movement = Movement::partly(force_n, speed_mm_s).map_err(|why| why.raise())?;
    let (still, pdc) = (of("still", still)?, of("pdc", pdc)?);
    let (shear, pac) = (of("shear_mn", shear_mn)?, samples("pac", pac)?);
    work(py, move |_| {
        let recording = Recording {
            texture: 0,
            number: 0,
            movement,
            window: window_s,
            blocks: Vec::new(),
            // 0: it was not measured
            background: background.or(still.is_none().then_some(0.0)),
            // a slide without it has none of its features
            pdc: pdc.unwrap_or_default(),
            pdc_rate_hz,
            outside_mn: None,
            pace: None,
            shear_rate_hz,
            highest_hz: None,
        };
        let cut = recording.cut(&still.unwrap_or_default(), &pac, shear.as_deref());
        let cut = cut.map_err(SlideError::new_err)?;
        let measurement = measure(plan(), &cut).map_err(|why| why.raise())?;
        Ok::<_, PyErr>(Features {
            movement,
            measurement,
        })
    })
}

/// All that [`Features`] holds, pickled.
#[derive(Serialize, Deserialize)]
struct Saved {
    /// mN and um/s
    movement: (u16, u32),
    properties: Properties,
    roughness_is_bound: bool,
    pdc: Option<(f32, f32)>,
    pace: Option<i16>,
    bands: usize,
    clipped: Option<tactus_core::features::SlideError>,
    background: f32,
    spectrum: Vec<f32>,
    fused_bands: [f32; FUSED_BANDS],
    frames: u32,
}

/// The `Features` that were pickled.
#[pyfunction]
fn _features(saved: &str) -> PyResult<Features> {
    let saved: Saved = unpickled("Features", saved)?;
    let spectrum: Result<[f32; BINS], _> = saved.spectrum.try_into();
    let bins = |found: Vec<f32>| PyValueError::new_err(format!("{} bins, not {BINS}", found.len()));
    Ok(Features {
        movement: Movement::stored(saved.movement.0, saved.movement.1)
            .map_err(|why| why.raise())?,
        measurement: Measurement {
            properties: saved.properties,
            roughness_is_bound: saved.roughness_is_bound,
            pdc: saved.pdc,
            pace: saved.pace,
            bands: saved.bands,
            clipped: saved.clipped,
            background: saved.background,
            spectrum: Spectrum::new(saved.frames, spectrum.map_err(bins)?, saved.fused_bands),
        },
    })
}

pub(crate) fn add(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Features>()?;
    // a fork that comes while it is made would leave it half made
    plan();
    module.add_function(wrap_pyfunction!(_features, module)?)?;
    module.add_function(wrap_pyfunction!(features, module)?)
}
