//! The simulated world: a rig and a hand that slide over textures of Table 1.

use std::sync::{Arc, Mutex};

use pyo3::exceptions::{PyKeyError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use tactus_core::sensor::FingerName;
use tactus_lab::sim::collection::{Collection, calibrated, texture_name, texture_number};
use tactus_lab::sim::rig::SimRig;
use tactus_world::textures::TEXTURES;

use crate::error::{Raise as _, SimulationError};
use crate::features::movement;
use crate::recordings::Slide;
use crate::values::no_pickle;
use crate::work::{lock, work, work_on_all_cores};

/// A simulated rig with a texture under its finger.
///
/// texture: its name in Table 1 or its number. seed: the world; others have other textures of the same names. trial:
/// where the sample lies, and what its noise is like. finger: "biotac", "analog" or "mems".
///
/// Raises KeyError for a texture that Table 1 does not have, SimulationError where the rig does not start.
#[pyclass(frozen, module = "tactus")]
pub(crate) struct SimulatedRig {
    rig: Arc<Mutex<SimRig>>,
    made_by: u32,
    texture: &'static str,
}

impl SimulatedRig {
    /// Does something with the rig as soon as no other thread does.
    fn with<T: Send + 'static>(
        &self,
        py: Python<'_>,
        done: impl FnOnce(&mut SimRig) -> PyResult<T> + Send + 'static,
    ) -> PyResult<T> {
        let (rig, made_by) = (Arc::clone(&self.rig), self.made_by);
        work(py, move |between| match lock(&rig, made_by, between) {
            Some(mut rig) => done(&mut rig),
            None => Err(SimulationError::new_err(
                "the rig was at work when this process was forked from the one that made it: make another rig here, or \
                 start processes with multiprocessing.get_context(\"spawn\")",
            )),
        })
    }
}

fn number(name: &str) -> PyResult<u8> {
    texture_number(name.trim()).ok_or_else(|| {
        PyKeyError::new_err(format!(
            "{name}: not in Table 1; tactus.TEXTURES has all of them"
        ))
    })
}

fn finger_named(name: &str) -> PyResult<FingerName> {
    name.parse::<FingerName>()
        .map_err(|why| PyValueError::new_err(why.to_string()))
}

/// Those textures, each once, or all.
fn collection(textures: Option<Vec<String>>, trials: u32, seed: u64) -> PyResult<Collection> {
    let mut numbers = match textures {
        Some(names) => names
            .iter()
            .map(|name| number(name))
            .collect::<PyResult<Vec<u8>>>()?,
        None => TEXTURES.iter().map(|texture| texture.number).collect(),
    };
    numbers.sort_unstable();
    numbers.dedup();
    if numbers.is_empty() || !(1..=1000).contains(&trials) {
        return Err(PyValueError::new_err(
            "textures: one at least; trials: 1 to 1000",
        ));
    }
    Ok(Collection::new(seed, numbers, trials))
}

#[pymethods]
impl SimulatedRig {
    #[new]
    #[pyo3(signature = (texture, *, seed=1, trial=1, finger="biotac"))]
    fn new(py: Python<'_>, texture: &str, seed: u64, trial: u64, finger: &str) -> PyResult<Self> {
        let (number, finger) = (number(texture)?, finger_named(finger)?);
        let world = Collection::new(seed, vec![number], 1).touched_by(finger);
        let rig = work(py, move |_| {
            let calibration = calibrated(world.setup(number, 0))?;
            let mut rig = SimRig::new(world.setup(number, trial));
            // these constants are the ones it measured
            rig.control().calibrate(calibration)?;
            rig.home().map(|()| rig)
        })?;
        Ok(Self {
            rig: Arc::new(Mutex::new(rig)),
            made_by: std::process::id(),
            texture: texture_name(number),
        })
    }

    /// Name of the texture under the finger.
    #[getter]
    fn texture(&self) -> &'static str {
        self.texture
    }

    /// Time of the rig, s.
    #[getter]
    fn time_s(&self, py: Python<'_>) -> PyResult<f64> {
        self.with(py, |rig| Ok(rig.now().as_secs_f64()))
    }

    /// Presses with so many newtons, slides with so many mm/s, and lifts: the `Slide`, with its samples.
    ///
    /// Raises SlideError for a movement that no rig makes, SimulationError for a fault of the rig.
    fn slide(&self, py: Python<'_>, force_n: f32, speed_mm_s: f32) -> PyResult<Slide> {
        let movement = movement(force_n, speed_mm_s)?;
        let slide = self.with(py, move |rig| {
            rig.record(movement).map_err(|why| why.raise())
        })?;
        Ok(Slide::new(slide, self.texture))
    }

    fn __reduce__(&self) -> PyResult<()> {
        no_pickle(
            "tactus.SimulatedRig",
            "make another one with the same texture, seed and trial",
        )
    }

    fn __repr__(&self) -> String {
        format!("<tactus.SimulatedRig over {}>", self.texture)
    }
}

/// Records slides on the simulated rig: a dict from the name of each texture to its list of `Slide`, the samples that
/// `tactus simulate` writes.
///
/// textures: names in Table 1 or numbers; all 117, unless given. trials: of each texture at each of the study's three
/// movements. seed: the world. finger: "biotac", "analog" or "mems".
///
/// Raises KeyError for a texture that Table 1 does not have, SimulationError for a fault of the rig, KeyboardInterrupt
/// after Ctrl-C.
#[pyfunction]
#[pyo3(signature = (textures=None, *, trials=5, seed=1, finger="biotac"))]
fn simulate<'py>(
    py: Python<'py>,
    textures: Option<Vec<String>>,
    trials: u32,
    seed: u64,
    finger: &str,
) -> PyResult<Bound<'py, PyDict>> {
    let collection = collection(textures, trials, seed)?.touched_by(finger_named(finger)?);
    let first = collection.textures[0];
    let numbers = collection.textures.clone();
    let recorded = work_on_all_cores(py, move |between| {
        let calibration = calibrated(collection.setup(first, 0)).map_err(|why| why.raise())?;
        let all = collection.record(calibration, between);
        all.map_err(|why| why.raise())
    })?;
    let all = PyDict::new(py);
    for (slides, &number) in recorded.into_iter().zip(&numbers) {
        let name = texture_name(number);
        let slides: Vec<Slide> = slides.into_iter().map(|s| Slide::new(s, name)).collect();
        all.set_item(name, slides)?;
    }
    Ok(all)
}

pub(crate) fn add(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let names: Vec<&str> = TEXTURES.iter().map(|texture| texture.name).collect();
    module.add("TEXTURES", names)?;
    module.add_class::<SimulatedRig>()?;
    module.add_function(wrap_pyfunction!(simulate, module)?)
}
