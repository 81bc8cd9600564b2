//! Texture tables: learned, read, shown, written.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use tactus_core::explorer;
use tactus_core::features::Movement;
use tactus_core::sensor::FingerCode;
use tactus_core::table::{FALSE_ALARM, Table as Read};
use tactus_lab::data::recordings::files::open;
use tactus_lab::data::table_file::{TableFileError, read_table};
use tactus_lab::data::whole::write_whole;
use tactus_lab::eval::evaluate::Method;
use tactus_lab::eval::first::{few, learn_first, taught};
use tactus_lab::eval::learn::{Expected, learn_for};
use tactus_lab::eval::open_set::{all_learned, with_figures};
use tactus_lab::eval::table_summary::TableSummary;

use crate::arguments;
use crate::error::Raise as _;
use crate::features::Features;
use crate::recordings::Recordings;
use crate::rows;
use crate::values::object;
use crate::work::{work, work_on_all_cores};

/// A texture table: what is known of every texture at every movement. `len()` counts its textures, `bytes()` is its
/// file.
#[pyclass(frozen, module = "tactus")]
pub(crate) struct Table {
    pub(crate) bytes: Arc<[u8]>,
}

impl Table {
    /// Of bytes that were learned or checked.
    pub(crate) fn of(bytes: Vec<u8>) -> PyResult<Self> {
        Read::read(&bytes).map_err(|why| why.raise())?;
        Ok(Self {
            bytes: bytes.into(),
        })
    }

    fn read(&self) -> PyResult<Read<'_>> {
        Read::read(&self.bytes).map_err(|why| why.raise())
    }
}

/// What a fused table is to expect.
fn expected(drift: (f32, f32), false_alarm: Option<f32>) -> PyResult<Expected> {
    Ok(Expected {
        drift: Some(arguments::drift(drift)?),
        false_alarm: arguments::false_alarm(false_alarm)?.unwrap_or(FALSE_ALARM),
    })
}

#[pymethods]
impl Table {
    /// Learns a table from the first slides of every texture and movement, as `tactus learn` does, byte for byte.
    ///
    /// recordings: `Recordings`; or features of one's own, of shape (slides, features), 1 to `MAX_FEATURES` of them,
    /// within -31.9 to 31.9, with a label for each slide. train_slides: so many of each, or as many as there are, two
    /// at least; 5, and of features of one's own all, unless given. method: what the table is for. features: of a fused
    /// table, "force", "pressure", "bands" or "properties"; the best that every slide has, unless given.
    /// drift: standard deviations of band powers (ln) and of traction (share) that it expects from session to session;
    /// of features of one's own, in their unit. false_alarm: share of known textures that may be taken for new ones,
    /// 0.0005 to 0.2.
    ///
    /// Raises TableError where the slides make no table, RecordingError where they cannot be read.
    #[staticmethod]
    #[pyo3(signature = (recordings, labels=None, *, train_slides=None, method="fused", features=None,
        drift=(0.12, 0.04), false_alarm=None))]
    #[expect(
        clippy::too_many_arguments,
        reason = "all but the first two have names where it is called"
    )]
    fn learn(
        py: Python<'_>,
        recordings: &Bound<'_, PyAny>,
        labels: Option<&Bound<'_, PyAny>>,
        train_slides: Option<usize>,
        method: &str,
        features: Option<&str>,
        drift: (f32, f32),
        false_alarm: Option<f32>,
    ) -> PyResult<Self> {
        let method = arguments::method(method)?;
        let features = arguments::features(features)?;
        let expected = expected(drift, false_alarm)?;
        let Ok(recordings) = recordings.cast::<Recordings>() else {
            let most = train_slides.unwrap_or(usize::MAX);
            let (names, observed) = rows::to_learn(recordings, labels, most)?;
            return Self::of(work_on_all_cores(py, move |_| {
                let movements = [rows::MOVEMENT];
                let method = method.method();
                let bytes = learn_for(&expected, method, features, &names, &movements, &observed)?;
                with_figures(bytes, &expected, &all_learned(&observed), || ())
            })?);
        };
        let recordings = recordings.get();
        let train_slides = train_slides.unwrap_or(5);
        let (set, measured) = (Arc::clone(&recordings.set), recordings.measured(py)?);
        Self::of(work_on_all_cores(py, move |_| {
            let bytes = learn_first(&set, &measured, train_slides, method, features, &expected)?;
            let taught = taught(&set, &measured, train_slides)?;
            with_figures(bytes, &expected, &taught, || ())
        })?)
    }

    /// Learns a table from features of one's own: a dict from the name of each texture to its list of `Features`. Each
    /// texture needs two slides at least of every movement that occurs. Arguments and errors as of `learn`.
    #[staticmethod]
    #[pyo3(signature = (slides, *, method="fused", features=None, drift=(0.12, 0.04), false_alarm=None))]
    fn learn_slides(
        py: Python<'_>,
        slides: &Bound<'_, PyDict>,
        method: &str,
        features: Option<&str>,
        drift: (f32, f32),
        false_alarm: Option<f32>,
    ) -> PyResult<Self> {
        let method = arguments::method(method)?.method();
        let features = arguments::features(features)?;
        let expected = expected(drift, false_alarm)?;
        let (mut names, mut all) = (Vec::new(), Vec::new());
        for (name, slides) in slides {
            names.push(name.extract::<String>()?);
            all.push(slides.extract::<Vec<Py<Features>>>()?);
        }
        let mut movements: Vec<Movement> = Vec::new();
        for slide in all.iter().flatten().map(|slide| slide.get()) {
            if !movements.contains(&slide.movement) {
                movements.push(slide.movement);
            }
        }
        let of = |slides: &[Py<Features>], movement: Movement| {
            let slides = slides.iter().map(|slide| slide.get());
            let same = slides.filter(|slide| slide.movement == movement);
            same.map(Features::observation).collect::<Vec<_>>()
        };
        let mut observed = Vec::new();
        for (texture, slides) in names.iter().zip(&all) {
            let texture = texture.clone();
            let row: Vec<_> = movements.iter().map(|&m| of(slides, m)).collect();
            if let Some((there, &movement)) = row.iter().zip(&movements).find(|(s, _)| s.len() < 2)
            {
                return Err(few(&texture, movement, there.len()).raise());
            }
            observed.push(row);
        }
        Self::of(work_on_all_cores(py, move |_| {
            let bytes = learn_for(&expected, method, features, &names, &movements, &observed)?;
            with_figures(bytes, &expected, &all_learned(&observed), || ())
        })?)
    }

    /// Reads a file that `save` or `tactus learn` wrote, with every check of it. Raises TableError.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        Self::of(work(py, move |_| {
            let mut bytes = Vec::new();
            read_table(&path, open(&path), &mut bytes)?;
            Ok::<_, TableFileError>(bytes)
        })?)
    }

    /// The table in these bytes, with every check of it. Raises TableError.
    #[staticmethod]
    fn from_bytes(bytes: &[u8]) -> PyResult<Self> {
        let mut read = Vec::new();
        read_table(Path::new("these bytes"), Ok(bytes), &mut read).map_err(|why| why.raise())?;
        Self::of(read)
    }

    /// Writes the table; a file of that name is replaced whole or not at all. Raises OSError.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        let bytes = Arc::clone(&self.bytes);
        work(py, move |_| write_whole(&path, &bytes).map_err(PyErr::from))
    }

    /// What `tactus table FILE --format json` prints, as a dict: movements, textures, and what is known of each.
    fn summary<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        object(py, &TableSummary::new(self.read()?))
    }

    /// Names of the textures, in the order of the table.
    #[getter]
    fn textures(&self) -> PyResult<Vec<String>> {
        Ok(self.read()?.names().map(str::to_owned).collect())
    }

    /// The movements: pairs of force (N) and speed (mm/s); 0 is unknown.
    #[getter]
    fn settings(&self) -> PyResult<Vec<(f32, f32)>> {
        let table = self.read()?;
        let movements = table.movements();
        Ok(movements.map(|m| m.written()).collect())
    }

    /// The best method for what the table holds: "fused" or "student-all", which shares its tables with "paper" and
    /// "student".
    #[getter]
    fn method(&self) -> PyResult<String> {
        let best = explorer::Method::of(self.read()?.contents());
        Ok(arguments::method_name(Method::of(best)))
    }

    /// The finger that the table was learned with; the name of a sensor of one's own.
    #[getter]
    fn finger(&self) -> PyResult<String> {
        let table = self.read()?;
        Ok(match table.finger() {
            FingerCode::OTHER => table.sensor().to_owned(),
            finger => finger.to_string(),
        })
    }

    /// CRC-32 of the table as a probe has it, eight hexadecimal digits.
    #[getter]
    fn checksum(&self) -> PyResult<String> {
        Ok(format!("{:08x}", tactus_link::checksum(&self.read()?)))
    }

    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        let read = py.import("tactus._tactus")?.getattr("_table")?;
        Ok((read, (self.__bytes__(py),)))
    }

    fn __bytes__<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.bytes)
    }

    fn __len__(&self) -> PyResult<usize> {
        Ok(self.read()?.textures().into())
    }

    fn __repr__(&self) -> PyResult<String> {
        let (table, method) = (self.read()?, self.method()?);
        let textures = table.textures();
        let bytes = self.bytes.len();
        Ok(format!(
            "<tactus.Table for {method}: {textures} textures, {bytes} bytes, checksum {:08x}>",
            tactus_link::checksum(&table)
        ))
    }
}

/// The `Table` that was pickled.
#[pyfunction]
fn _table(saved: &[u8]) -> PyResult<Table> {
    Table::from_bytes(saved)
}

pub(crate) fn add(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(_table, module)?)?;
    module.add_class::<Table>()
}
