//! Folders of recordings, and the slides in them.

use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

use numpy::PyArray1;
use pyo3::exceptions::{PyIndexError, PyKeyError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;
use tactus_core::features::{BAND_EDGES, FUSED_BANDS, Property, SlideError};
use tactus_lab::data::recording::{PAC_RATE_HZ, Recording};
use tactus_lab::data::recordings::RecordingSet;
use tactus_lab::data::replay::{MeasuredSlide, measure, measure_all, trials};

use crate::error::Raise as _;
use crate::features::{Features, plan};
use crate::values::{Pickled, array, pickled, rows, unpickled};
use crate::work::{work, work_on_all_cores};

/// A folder of recorded slides, in the project's own format or that of BioTac_slide_20_50; `len()` counts its slides.
///
/// Opening reads the manifest only. Raises RecordingError where there is none, or it makes no sense.
#[pyclass(frozen, module = "tactus")]
pub(crate) struct Recordings {
    pub(crate) set: Arc<RecordingSet>,
    measured: OnceLock<Arc<Measured>>,
}

/// What the slides of each texture measure.
type Measured = Vec<Vec<MeasuredSlide>>;

/// One recorded slide with its samples.
#[pyclass(frozen, module = "tactus")]
pub(crate) struct Slide {
    recording: Arc<Recording>,
    texture: String,
}

impl Slide {
    /// A slide over a texture of this name.
    pub(crate) fn new(recording: Recording, texture: &str) -> Self {
        Self {
            recording: Arc::new(recording),
            texture: texture.to_owned(),
        }
    }
}

/// A texture by its name or its number.
#[derive(FromPyObject)]
pub(crate) enum Wanted {
    Number(u32),
    Name(String),
}

impl Recordings {
    /// What all slides measure, per texture and in the order of time. They are read and measured once.
    pub(crate) fn measured(&self, py: Python<'_>) -> PyResult<Arc<Measured>> {
        if let Some(measured) = self.measured.get() {
            return Ok(Arc::clone(measured));
        }
        let set = Arc::clone(&self.set);
        let all = work_on_all_cores(py, move |between| {
            let folder = set.folder().display();
            set.sensor()
                .map_err(|why| why.raise_of(folder.to_string()))?;
            let all = measure_all(&set, |_| between());
            all.map_err(|why| why.raise_of(format!("recordings in {folder}")))
        })?;
        // who was first is as good
        Ok(Arc::clone(self.measured.get_or_init(|| Arc::new(all))))
    }

    fn find(&self, wanted: &Wanted) -> PyResult<usize> {
        let textures = self.set.textures();
        let found = textures.iter().position(|texture| match wanted {
            Wanted::Number(number) => texture.id == *number,
            Wanted::Name(name) => texture.name.eq_ignore_ascii_case(name),
        });
        found.ok_or_else(|| {
            let wanted = match wanted {
                Wanted::Number(number) => number.to_string(),
                Wanted::Name(name) => name.clone(),
            };
            let known = textures.iter().map(|t| format!("{} {}", t.id, t.name));
            let known = known.collect::<Vec<_>>().join(", ");
            let folder = self.set.folder().display();
            PyKeyError::new_err(format!("{wanted}: not in {folder}, which has: {known}"))
        })
    }
}

#[pymethods]
impl Recordings {
    #[new]
    fn new(py: Python<'_>, folder: PathBuf) -> PyResult<Self> {
        let set = work(py, move |_| RecordingSet::open(&folder))?;
        Ok(Self {
            set: Arc::new(set),
            measured: OnceLock::new(),
        })
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (PathBuf,))> {
        // another process may be in another folder
        let folder = std::path::absolute(self.set.folder())?;
        Ok((py.get_type::<Self>().into_any(), (folder,)))
    }

    /// The folder.
    #[getter]
    fn folder(&self) -> PathBuf {
        self.set.folder().to_owned()
    }

    /// Names of the textures, in the order of the manifest.
    #[getter]
    fn textures(&self) -> Vec<String> {
        self.set.names()
    }

    /// Numbers of the textures, in the same order.
    #[getter]
    fn numbers(&self) -> Vec<u32> {
        self.set.textures().iter().map(|t| t.id).collect()
    }

    /// The movements, in the order in which they are first seen: pairs of force (N) and speed (mm/s).
    #[getter]
    fn settings(&self) -> Vec<(f32, f32)> {
        let movements = self.set.movements().into_iter();
        movements.map(|m| (m.force_n(), m.speed_mm_s())).collect()
    }

    /// The finger, and the day of its calibration as 20261121 (0: not known). Raises RecordingError where there are two
    /// fingers.
    #[getter]
    fn finger(&self) -> PyResult<(String, u32)> {
        let sensor = self.set.sensor().map_err(|why| why.raise())?;
        Ok((sensor.to_string(), sensor.calibrated))
    }

    /// Reads the slides of a texture (its name or its number) with their samples, in the order of time: a list of
    /// `Slide`.
    ///
    /// Raises KeyError where there is no such texture, RecordingError where a file cannot be read or is not what the
    /// manifest says.
    fn slides(&self, py: Python<'_>, texture: Wanted) -> PyResult<Vec<Slide>> {
        let index = self.find(&texture)?;
        let set = Arc::clone(&self.set);
        let slides = work(py, move |_| set.load_texture(index))?;
        let texture = &self.set.textures()[index].name;
        let slides = slides.into_iter().map(|slide| Slide::new(slide, texture));
        Ok(slides.collect())
    }

    /// The `Features` of the slides of a texture (its name or its number), in the order of time.
    ///
    /// Raises KeyError and RecordingError as `slides` does.
    fn measured_slides(&self, py: Python<'_>, texture: Wanted) -> PyResult<Vec<Features>> {
        let index = self.find(&texture)?;
        let measured = self.measured(py)?;
        let slides = measured.get(index);
        let slides = slides.ok_or_else(|| PyIndexError::new_err(index))?;
        Ok(slides.iter().map(Features::from).collect())
    }

    /// The features of all slides, as columns of a dict, a row for each slide: what `tactus features` prints.
    ///
    /// material, slide, trial (uint32), name (str), force_n, speed_mm_s, traction_n (NaN where it cannot be measured),
    /// roughness_ln, fineness_unfiltered_ln (float32), roughness_is_bound (bool), each of shape (slides,); ln_psd_bands
    /// of shape (slides, 8) and ln_fused_bands of shape (slides, 12), float32. See `Features` for units. Slides are
    /// read and measured once, on all cores.
    ///
    /// Raises RecordingError where a file cannot be read, or a slide has no features; KeyboardInterrupt after Ctrl-C.
    fn features<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let measured = self.measured(py)?;
        let textures = self.set.textures().iter().zip(&*measured);
        let mut material = Vec::new();
        let mut names = Vec::new();
        let mut trial_numbers = Vec::new();
        for (texture, slides) in textures {
            for trial in trials(slides) {
                trial_numbers.push(trial as u32);
                material.push(texture.id);
                names.push(texture.name.as_str());
            }
        }
        let all: Vec<&MeasuredSlide> = measured.iter().flatten().collect();
        let of = |value: fn(&MeasuredSlide) -> f32| -> Vec<f32> {
            all.iter().map(|slide| value(slide)).collect()
        };
        let property = |property| -> Vec<f32> {
            let values = all.iter().map(|slide| {
                let value = slide.measurement.properties.get(property);
                value.unwrap_or(f32::NAN)
            });
            values.collect()
        };
        let bounds = all.iter().map(|s| s.measurement.roughness_is_bound);
        let bands = all.iter().flat_map(|s| s.measurement.ln_bands()).collect();
        let fused = all.iter().flat_map(|s| s.measurement.fused_bands());
        let columns = PyDict::new(py);
        columns.set_item("material", array(py, material))?;
        columns.set_item("name", py.import("numpy")?.call_method1("array", (names,))?)?;
        let numbers = all.iter().map(|slide| slide.number).collect();
        columns.set_item("slide", array(py, numbers))?;
        columns.set_item("trial", array(py, trial_numbers))?;
        columns.set_item("roughness_is_bound", array(py, bounds.collect()))?;
        for (name, values) in [
            ("force_n", of(|s| s.movement.force_n())),
            ("speed_mm_s", of(|s| s.movement.speed_mm_s())),
            ("traction_n", property(Property::Traction)),
            ("roughness_ln", property(Property::Roughness)),
            ("fineness_unfiltered_ln", property(Property::Fineness)),
        ] {
            columns.set_item(name, array(py, values))?;
        }
        columns.set_item("ln_psd_bands", rows(py, bands, BAND_EDGES.len() - 1)?)?;
        columns.set_item("ln_fused_bands", rows(py, fused.collect(), FUSED_BANDS)?)?;
        Ok(columns)
    }

    fn __len__(&self) -> usize {
        let textures = 0..self.set.textures().len();
        textures.map(|index| self.set.slides(index).len()).sum()
    }

    fn __repr__(&self) -> String {
        let folder = self.set.folder().display();
        let textures = self.set.textures().len();
        format!(
            "<tactus.Recordings {folder}: {textures} textures, {} slides>",
            self.__len__()
        )
    }
}

#[pymethods]
impl Slide {
    /// Name of the texture.
    #[getter]
    fn texture(&self) -> &str {
        &self.texture
    }

    /// Number of the slide; slides of a texture were made in the order of their numbers.
    #[getter]
    fn number(&self) -> u32 {
        self.recording.number
    }

    /// Contact force of the movement, N.
    #[getter]
    fn force_n(&self) -> f32 {
        self.recording.movement.force_n()
    }

    /// Speed of the movement, mm/s.
    #[getter]
    fn speed_mm_s(&self) -> f32 {
        self.recording.movement.speed_mm_s()
    }

    /// Start and end of the part at constant speed, s from the start of the record.
    #[getter]
    fn window_s(&self) -> (f32, f32) {
        self.recording.window
    }

    /// int16 of shape (samples,): P_AC in counts about the still baseline. Read-only.
    #[getter]
    fn pac<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i16>> {
        array(py, self.recording.pac())
    }

    /// Rate of `pac` and `still`: 2200 Hz.
    #[getter]
    fn pac_rate_hz(&self) -> u32 {
        PAC_RATE_HZ
    }

    /// int16 of shape (samples,): P_AC of the finger at rest, in counts; empty where its power is known.
    #[getter]
    fn still<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i16>> {
        array(py, self.recording.still())
    }

    /// Power of the still finger, counts^2, where its samples were not recorded; else None.
    #[getter]
    fn background(&self) -> Option<f32> {
        self.recording.background
    }

    /// int16 of shape (samples,): P_DC in counts about the still baseline.
    #[getter]
    fn pdc<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i16>> {
        array(py, self.recording.pdc.clone())
    }

    /// Rate of `pdc`, Hz.
    #[getter]
    fn pdc_rate_hz(&self) -> u32 {
        self.recording.pdc_rate_hz
    }

    /// int16 of shape (samples,): tangential force in mN; None where the rig cannot measure it.
    #[getter]
    fn shear_mn<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<i16>>> {
        Some(array(py, self.recording.shear_mn()?))
    }

    /// Rate of `shear_mn`, Hz.
    #[getter]
    fn shear_rate_hz(&self) -> u32 {
        self.recording.shear_rate_hz
    }

    /// The `Features` of the slide. Raises SlideError where it has none.
    fn features(&self, py: Python<'_>) -> PyResult<Features> {
        let recording = Arc::clone(&self.recording);
        work(py, move |_| features_in(&recording))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Pickled<'py>> {
        pickled(py, "_slide", &(&self.texture, &*self.recording))
    }

    fn __repr__(&self) -> String {
        let (number, movement) = (self.recording.number, self.recording.movement);
        format!(
            "<tactus.Slide {number} of {}, {movement}: {} samples>",
            self.texture,
            self.recording.pac().len()
        )
    }
}

/// The `Features` of many slides, in their order, computed on all cores.
///
/// Raises SlideError where one has none, KeyboardInterrupt after Ctrl-C.
#[pyfunction]
fn features_of(py: Python<'_>, slides: Vec<Py<Slide>>) -> PyResult<Vec<Features>> {
    let recordings = slides.iter().map(|slide| &slide.get().recording);
    let recordings: Vec<Arc<Recording>> = recordings.map(Arc::clone).collect();
    work_on_all_cores(py, move |between| {
        let of = |recording: &Arc<Recording>| {
            between();
            features_in(recording)
        };
        recordings.par_iter().panic_fuse().map(of).collect()
    })
}

fn features_in(recording: &Recording) -> Result<Features, SlideError> {
    Ok(Features {
        movement: recording.movement,
        measurement: measure(plan(), recording)?,
    })
}

/// The `Slide` that was pickled.
#[pyfunction]
fn _slide(saved: &str) -> PyResult<Slide> {
    let (texture, recording): (String, Recording) = unpickled("samples of a slide", saved)?;
    Ok(Slide::new(recording, &texture))
}

pub(crate) fn add(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Recordings>()?;
    module.add_class::<Slide>()?;
    module.add_function(wrap_pyfunction!(_slide, module)?)?;
    module.add_function(wrap_pyfunction!(features_of, module)?)
}
