//! One exploration, step by step: the posterior, the next movement, the verdict.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use numpy::PyArray1;
use pyo3::exceptions::{PyKeyError, PyValueError};
use pyo3::prelude::*;
use serde::Serialize;
use tactus_core::explorer::{self, ExpectedOutcome};
use tactus_core::features::{Movement, Property, PropertySet};
use tactus_core::probe::explore::Random;
use tactus_core::table::{Action, MAX_TEXTURES, Table as Read};
use tactus_lab::eval::evaluate::{Method, explorer};
use tactus_lab::eval::transcript::Answer;
use tactus_lab::eval::verify;

use crate::arguments;
use crate::error::Raise as _;
use crate::features::{Features, movement};
use crate::rows;
use crate::table::Table;
use crate::values::{array, no_pickle, object};

type Core = explorer::Explorer<'static, MAX_TEXTURES>;

/// An exploration of one unknown texture with a table, as the probe makes it.
///
/// among: names of the textures that it may be; all, unless given. method: how to decide and to choose; the best for
/// the table, unless given. threshold: a texture more probable than this is the answer. max_slides: after so many the
/// most probable one is. open: whether the answer may be that it is none of them. false_alarm: share of known textures
/// that may be taken for new ones; the table's own, unless given. measures: what the rig measures of "traction",
/// "roughness" and "fineness"; all, unless given. seed: for methods that choose at random.
///
/// Raises TableError where the table cannot be explored so, KeyError for a name that it does not have, ValueError for
/// an argument.
#[pyclass(frozen, module = "tactus")]
pub(crate) struct Explorer {
    inner: Mutex<Inner>,
}

struct Inner {
    // its table lies in `bytes`, which end after it
    core: Box<Core>,
    bytes: Arc<[u8]>,
    random: Random,
    /// what was chosen last, until a slide of it came
    chosen: Option<Action>,
}

/// A movement that may come next.
#[derive(Serialize)]
struct Choice {
    force_n: f32,
    speed_mm_s: f32,
    property: Option<String>,
    uncertainty: Option<f32>,
    benefit: Option<f32>,
}

impl Inner {
    fn choice(&self, action: Action, expected: &[ExpectedOutcome]) -> Choice {
        let movement = self.core.table().movement(action.movement);
        let expected = expected.iter().find(|outcome| outcome.action == action);
        Choice {
            force_n: movement.map_or(f32::NAN, |m| m.written().0),
            speed_mm_s: movement.map_or(f32::NAN, |m| m.written().1),
            property: action.property.map(|property| property.to_string()),
            uncertainty: expected.map(|outcome| outcome.uncertainty),
            benefit: expected.map(|outcome| outcome.benefit),
        }
    }

    fn place(&self, wanted: Movement) -> PyResult<u8> {
        let table = self.core.table();
        let mut known = (0..).zip(table.movements());
        let at = known.find_map(|(at, other)| (other == wanted).then_some(at));
        at.ok_or_else(|| {
            PyValueError::new_err(format!("the table does not have the movement {wanted}"))
        })
    }

    fn answer(&self, verdict: explorer::Verdict) -> Answer {
        Answer::new(verdict, self.core.slides(), self.core.table())
    }
}

impl Explorer {
    fn inner(&self) -> MutexGuard<'_, Inner> {
        // held for less than a millisecond, and never while the interpreter's lock is waited for
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn property(name: &str) -> PyResult<Property> {
    let found = Property::ALL.into_iter().find(|p| p.to_string() == name);
    found.ok_or_else(|| {
        PyValueError::new_err(format!("{name:?} is none of traction, roughness, fineness"))
    })
}

#[pymethods]
impl Explorer {
    #[new]
    #[pyo3(signature = (table, *, among=None, method=None, threshold=0.99, max_slides=10, open=true, false_alarm=None,
        measures=None, seed=1))]
    #[expect(
        clippy::too_many_arguments,
        reason = "all but the first have names where it is called"
    )]
    fn new(
        table: &Table,
        among: Option<Vec<String>>,
        method: Option<&str>,
        threshold: f32,
        max_slides: u8,
        open: bool,
        false_alarm: Option<f32>,
        measures: Option<Vec<String>>,
        seed: u32,
    ) -> PyResult<Self> {
        let bytes = Arc::clone(&table.bytes);
        // SAFETY: these bytes neither move nor change nor end before `bytes` does, which lives beside what borrows them
        // and is dropped after it; nothing that borrows them for longer leaves this module.
        let lasting: &'static [u8] = unsafe { &*Arc::as_ptr(&bytes) };
        let read = Read::read(lasting).map_err(|why| why.raise())?;
        let best = Method::of(explorer::Method::of(read.contents()));
        let method = method.map_or(Ok(best), arguments::method)?;
        let config = arguments::config(method, threshold, max_slides, false_alarm, open)?;
        let find = |name: String| {
            read.find(&name)
                .ok_or_else(|| PyKeyError::new_err(format!("{name}: the table does not have it")))
        };
        let among: Option<Vec<u16>> = among
            .map(|names| names.into_iter().map(find).collect())
            .transpose()?;
        let measured: PropertySet = match measures {
            Some(names) => {
                let all = names.iter().map(|name| property(name));
                all.collect::<PyResult<Vec<_>>>()?.into_iter().collect()
            }
            None => PropertySet::ALL,
        };
        let core = explorer(lasting, measured, config, among.as_deref());
        Ok(Self {
            inner: Mutex::new(Inner {
                core: core.map_err(|why| why.raise())?,
                bytes,
                random: Random::new(seed),
                chosen: None,
            }),
        })
    }

    /// Starts the next exploration, with the same candidates equally probable.
    fn restart(&self) {
        let mut inner = self.inner();
        inner.core.restart();
        inner.chosen = None;
    }

    /// Chooses the movement that should tell the remaining candidates apart, by the method: a dict with force_n,
    /// speed_mm_s, property (the one looked at; None for all), uncertainty (expected after it, 0 to 1, eq. 11) and
    /// benefit (eq. 12), which are None where the method does not look ahead.
    fn next_movement<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let mut inner = self.inner();
        let expected = inner.core.expected_outcomes();
        let random = inner.random.next_u32();
        let action = inner.core.choose(&expected, random);
        inner.chosen = Some(action);
        object(py, &inner.choice(action, &expected))
    }

    /// What is expected of every action now: a list of dicts as of `next_movement`.
    fn expected<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let inner = self.inner();
        let expected = inner.core.expected_outcomes();
        let all = expected.iter().map(|o| inner.choice(o.action, &expected));
        object(py, &all.collect::<Vec<_>>())
    }

    /// Takes in what a slide measured: its `Features`, or its row of features where the table was learned from such.
    /// property: which one is looked at, for methods that look at one; that of the last `next_movement`, unless given.
    ///
    /// Raises ValueError where the table does not have the slide's movement, TableError where the slide lacks what is
    /// compared.
    #[pyo3(signature = (slide, property=None))]
    fn update(&self, slide: &Bound<'_, PyAny>, property: Option<&str>) -> PyResult<()> {
        let (movement, observation) = match slide.cast::<Features>() {
            Ok(slide) => (slide.get().movement, slide.get().observation()),
            Err(_) => (rows::MOVEMENT, rows::one(slide)?),
        };
        let mut inner = self.inner();
        let movement = inner.place(movement)?;
        let chosen = inner.chosen.filter(|chosen| chosen.movement == movement);
        let property = match property {
            Some(name) => Some(self::property(name)?),
            None => chosen.and_then(|chosen| chosen.property),
        };
        let action = Action { movement, property };
        let taken = inner.core.observe(action, &observation);
        taken.map_err(|why| why.raise())?;
        inner.chosen = None;
        Ok(())
    }

    /// Says that the movement (N, mm/s) came to nothing: it is chosen once more, then another one. False: none is left.
    fn reject(&self, force_n: f32, speed_mm_s: f32) -> PyResult<bool> {
        let mut inner = self.inner();
        let movement = inner.place(movement(force_n, speed_mm_s)?)?;
        let property = inner.chosen.take().and_then(|chosen| chosen.property);
        Ok(inner.core.reject(Action { movement, property }))
    }

    /// float32 of shape (textures,): the posterior probability of every texture of the table (eq. 3).
    #[getter]
    fn posterior<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f32>> {
        array(py, self.inner().core.posterior().to_vec())
    }

    /// Names of the textures, in the order of `posterior`.
    #[getter]
    fn textures(&self) -> Vec<String> {
        let inner = self.inner();
        inner.core.table().names().map(str::to_owned).collect()
    }

    /// Slides taken in.
    #[getter]
    fn slides(&self) -> u8 {
        self.inner().core.slides()
    }

    /// The answer as soon as there is one, else None: a dict with told ("sure", "most-like", "changed", "new" or
    /// "undecided"), texture (the most probable one), probability, log_odds (that it is none of those known; None where
    /// that cannot be told) and slides.
    fn verdict<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let inner = self.inner();
        let verdict = inner.core.verdict();
        let answer = verdict.map(|verdict| object(py, &inner.answer(verdict)));
        answer.transpose()
    }

    /// What would be answered now: as of `verdict`.
    fn best<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let inner = self.inner();
        object(py, &inner.answer(inner.core.best()))
    }

    /// With one candidate: whether the slides are of it. A dict with score (ln of how much likelier they are of another
    /// texture), limit (above it they are) and answer ("Same", "Different" or "Unsure"). None before the first slide,
    /// and with a table without limits.
    fn verification<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let now = self.inner().core.verification();
        now.map(|now| object(py, &now)).transpose()
    }

    /// With one candidate: the share of other textures that would pass as well as these slides, 0 to 1 (what
    /// `tactus verify` calls false_accept); None where no other texture of the table has slides of their movements.
    fn false_accept(&self) -> Option<f64> {
        let inner = self.inner();
        let reference = inner.core.best().texture;
        verify::false_accept(&inner.core, reference)
    }

    fn __reduce__(&self) -> PyResult<()> {
        let instead = "pickle its Table and the Features of its slides, and update another Explorer with them";
        no_pickle("tactus.Explorer", instead)
    }

    fn __repr__(&self) -> String {
        let inner = self.inner();
        let best = inner.answer(inner.core.best());
        format!(
            "<tactus.Explorer with a table of {} bytes, after {} slides: {} {:.3}>",
            inner.bytes.len(),
            best.slides,
            best.texture,
            best.probability
        )
    }
}

pub(crate) fn add(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Explorer>()
}
