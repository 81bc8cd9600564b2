//! Folders of recordings, and the slides in them.

use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

use numpy::PyArray1;
use pyo3::IntoPyObjectExt as _;
use pyo3::exceptions::{PyIndexError, PyKeyError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;
use tactus_core::features::{BAND_EDGES, FUSED_BANDS, Property, SlideError};
use tactus_lab::data::import::copy;
use tactus_lab::data::import::settings::Settings;
use tactus_lab::data::recording::{PAC_RATE_HZ, Recording};
use tactus_lab::data::recordings::{Held, RecordingSet};
use tactus_lab::data::replay::{MeasuredSlide, measure, measure_all, trials};

use crate::arrays::{self, Columns, Found};
use crate::error::Raise as _;
use crate::features::{Features, plan};
use crate::values::{Pickled, array, object, pickled, rows, unpickled};
use crate::work::{work, work_on_all_cores};

/// Recorded slides: a folder in the project's own format or that of BioTac_slide_20_50, or arrays (`from_arrays`);
/// `len()` counts the slides.
///
/// Opening a folder reads the manifest only. Raises RecordingError where there is none, or it makes no sense.
#[pyclass(frozen, module = "tactus")]
pub(crate) struct Recordings {
    pub(crate) set: Arc<RecordingSet>,
    measured: OnceLock<Arc<Measured>>,
    /// of arrays
    found: Option<Arc<Found>>,
}

/// What the slides of each texture measure.
pub(crate) type Measured = Vec<Vec<MeasuredSlide>>;

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
    fn of(set: RecordingSet, found: Option<Found>) -> Self {
        Self {
            set: Arc::new(set),
            measured: OnceLock::new(),
            found: found.map(Arc::new),
        }
    }

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

    /// Adds the session and the run of each slide.
    fn labels(&self, columns: &Bound<'_, PyDict>) -> PyResult<()> {
        let textures = 0..self.set.textures().len();
        let keys = textures.flat_map(|index| self.set.slides(index));
        let (sessions, runs): (Vec<&str>, Vec<&str>) = keys
            .map(|key| (key.labels.session.as_str(), key.labels.run.as_str()))
            .unzip();
        let numpy = columns.py().import("numpy")?;
        columns.set_item("session", numpy.call_method1("array", (sessions, "str"))?)?;
        columns.set_item("run", numpy.call_method1("array", (runs, "str"))?)
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
        Ok(Self::of(set, None))
    }

    /// Recordings from arrays of any sensor, by the import of `tactus import`.
    ///
    /// arrays: one recording each, of any real type: of shape (samples,), or (samples, channels). labels: the name of
    /// each one's texture. rate_hz: samples per second, 100 Hz to 192 kHz (slower ones from 1 Hz, too). From 500 Hz on
    /// they are resampled to 2200 Hz, band-limited; a slower clock is taken for one of 2200 Hz.
    ///
    /// cut: where the finger slides is found by energy, and long sliding is divided (True), or each array is one slide
    /// as a whole (False). length_s: the length of slides into which longer sliding is divided. A slide has 1100
    /// samples at least, at 2200 Hz or of the slower clock.
    ///
    /// unit: of the samples, such as "g", "m/s2" or "V"; those in "counts" stay as they are. gain: counts per unit;
    /// what fills 12 bits without clipping is found, unless given, and told by `gain`: give it again for slides that
    /// are to be compared with these. channel, pressure, shear: numbers of the channels, from 0, of the vibration (the
    /// liveliest, unless given), of the contact's pressure (P_DC) and of the tangential force in N (neither, unless
    /// given). sessions, runs: one for each array, where they are known; without runs each array is one. finger: name
    /// of the sensor. force_n, speed_mm_s: the movement, if it is known.
    ///
    /// Slides of a sensor that hangs or is cut off, copies and short ones are left out with a warning. Raises
    /// RecordingError where the arrays give no slides; TypeError and ValueError for what are no real numbers, no
    /// numbers that were measured, or for labels that do not fit.
    #[staticmethod]
    #[pyo3(signature = (arrays, *, rate_hz, labels, unit=None, sessions=None, runs=None, gain=None, channel=None,
        pressure=None, shear=None, finger=None, force_n=None, speed_mm_s=None, length_s=None, cut=true))]
    #[expect(
        clippy::too_many_arguments,
        reason = "all but the first have names where it is called"
    )]
    fn from_arrays(
        arrays: &Bound<'_, PyAny>,
        rate_hz: f64,
        labels: &Bound<'_, PyAny>,
        unit: Option<String>,
        sessions: Option<&Bound<'_, PyAny>>,
        runs: Option<&Bound<'_, PyAny>>,
        gain: Option<f64>,
        channel: Option<usize>,
        pressure: Option<usize>,
        shear: Option<usize>,
        finger: Option<String>,
        force_n: Option<f32>,
        speed_mm_s: Option<f32>,
        length_s: Option<f64>,
        cut: bool,
    ) -> PyResult<Self> {
        let settings = Settings {
            rate: Some(rate_hz),
            channel: arrays::channel(channel),
            unit,
            gain,
            pressure: arrays::channel(pressure),
            shear: arrays::channel(shear),
            finger,
            force: force_n,
            speed: speed_mm_s,
            window: (!cut).then(|| "0,1e9".to_owned()),
            length: length_s,
            ..Settings::default()
        };
        let columns = Columns {
            labels,
            sessions,
            runs,
        };
        let (set, found) = arrays::read(arrays, &columns, settings)?;
        Ok(Self::of(set, Some(found)))
    }

    /// Writes all slides in the project's own format into a folder that is not there yet: `Recordings` and the command
    /// read it. An interrupted one goes on.
    ///
    /// Raises RecordingError where the folder holds recordings already, or cannot be written; KeyboardInterrupt after
    /// Ctrl-C.
    fn write(&self, py: Python<'_>, folder: PathBuf) -> PyResult<()> {
        let (set, found) = (Arc::clone(&self.set), self.found.clone());
        work(py, move |between| {
            let settings = found.as_ref().map(|found| &found.settings);
            let written = copy(&set, &folder, settings, &mut |_, _| between());
            written.map(drop).map_err(|why| why.raise())
        })
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        if let (Some(held), Some(found)) = (self.set.held(), &self.found) {
            return pickled(py, "_recordings", &(held, &**found))?.into_bound_py_any(py);
        }
        // another process may be in another folder
        let folder = std::path::absolute(self.set.folder())?;
        (py.get_type::<Self>(), (folder,)).into_bound_py_any(py)
    }

    /// The folder; None where they are arrays.
    #[getter]
    fn folder(&self) -> Option<PathBuf> {
        self.found.is_none().then(|| self.set.folder().to_owned())
    }

    /// Counts per unit of the arrays that they were made from; None where they are a folder.
    #[getter]
    fn gain(&self) -> Option<f64> {
        self.found.as_ref().map(|found| found.gain)
    }

    /// What `from_arrays` found, as a dict: rate_hz, unit, gain (counts per unit), channel (None where there is one),
    /// left_out (slides, and why), settings. None where they are a folder.
    #[getter]
    fn found<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let found = self.found.as_ref();
        found.map(|found| object(py, &**found)).transpose()
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
        movements.map(|m| m.written()).collect()
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
    /// material, slide, trial (uint32), name (str), force_n, speed_mm_s, traction_n (NaN where it was not measured),
    /// roughness_ln, fineness_unfiltered_ln (float32), roughness_is_bound (bool), each of shape (slides,); ln_psd_bands
    /// of shape (slides, 8) and ln_fused_bands of shape (slides, 26), float32; pdc of shape (slides, 2), mean and
    /// standard deviation of P_DC (about the parabola that fits best), NaN where it was not measured; session and run
    /// (str). See `Features` for units. Slides are read and measured once, on all cores.
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
        let fused = all
            .iter()
            .flat_map(|s| *s.measurement.spectrum.fused_bands());
        let columns = PyDict::new(py);
        columns.set_item("material", array(py, material))?;
        columns.set_item("name", py.import("numpy")?.call_method1("array", (names,))?)?;
        let numbers = all.iter().map(|slide| slide.number).collect();
        columns.set_item("slide", array(py, numbers))?;
        columns.set_item("trial", array(py, trial_numbers))?;
        columns.set_item("roughness_is_bound", array(py, bounds.collect()))?;
        for (name, values) in [
            ("force_n", of(|s| s.movement.known().0.unwrap_or(f32::NAN))),
            (
                "speed_mm_s",
                of(|s| s.movement.known().1.unwrap_or(f32::NAN)),
            ),
            ("traction_n", property(Property::Traction)),
            ("roughness_ln", property(Property::Roughness)),
            ("fineness_unfiltered_ln", property(Property::Fineness)),
        ] {
            columns.set_item(name, array(py, values))?;
        }
        let pdc = all.iter().flat_map(|s| {
            let (mean, sd) = s.measurement.pdc.unwrap_or((f32::NAN, f32::NAN));
            [mean, sd]
        });
        columns.set_item("pdc", rows(py, pdc.collect(), 2)?)?;
        self.labels(&columns)?;
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
        let told = self.found.as_ref().map(|found| {
            let unit = found.unit.as_deref().unwrap_or("unit");
            format!(", {} counts per {unit}", found.gain)
        });
        format!(
            "<tactus.Recordings {folder}: {textures} textures, {} slides{}>",
            self.__len__(),
            told.unwrap_or_default()
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
        self.recording.movement.written().0
    }

    /// Speed of the movement, mm/s.
    #[getter]
    fn speed_mm_s(&self) -> f32 {
        self.recording.movement.written().1
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
    fn pdc_rate_hz(&self) -> f64 {
        self.recording.pdc_rate_hz
    }

    /// int16 of shape (samples,): tangential force in mN; None where the rig cannot measure it.
    #[getter]
    fn shear_mn<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<i16>>> {
        Some(array(py, self.recording.shear_mn()?))
    }

    /// Rate of `shear_mn`, Hz.
    #[getter]
    fn shear_rate_hz(&self) -> f64 {
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

/// The `Recordings` that were pickled.
#[pyfunction]
fn _recordings(saved: &str) -> PyResult<Recordings> {
    let (held, found): (Held, Found) = unpickled("recordings", saved)?;
    let set = RecordingSet::in_memory("arrays".as_ref(), held);
    Ok(Recordings::of(set, Some(found)))
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
    module.add_function(wrap_pyfunction!(_recordings, module)?)?;
    module.add_function(wrap_pyfunction!(features_of, module)?)
}
