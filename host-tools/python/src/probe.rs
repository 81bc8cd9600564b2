//! A probe at a serial or a TCP port.

use std::collections::VecDeque;
use std::fs::File;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};
use std::task::Poll;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use pyo3::exceptions::{PyKeyError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use tactus_core::table::{Name, Table as Read};
use tactus_core::wire::{ArmReport, ArmState, Command, Event, Identify, Report, Train};
use tactus_lab::data::recorder::Recorder;
use tactus_link::line::{Line, found, only_nucleo, open};
use tactus_link::log::{self, Log};
use tactus_link::owner::Owner;
use tactus_link::{Job, Port, PortError, PushTable, ReadTable, Request, Transaction};

use crate::arguments;
use crate::error::{ProbeError, Raise as _};
use crate::recordings::Slide;
use crate::table::Table;
use crate::values::object;

/// Longest that a request takes to end after it was stopped: the way up, and what may be stored first.
const STOPPING: Duration = Duration::from_secs(35);

/// A probe. port: its serial port, or tcp:HOST:PORT; the only NUCLEO that is plugged in, unless given. timeout_s: a probe that says
/// nothing for so long is taken for gone; its longest silence is 2 s. log: a new file for all requests and reports, as
/// `tactus device --log FILE` writes it, for `read_log`, `tactus device log` and `tactus convert`.
///
/// Raises ProbeError where there is no such port, or somebody else has it; OSError where there is such a file, or it cannot be written.
#[pyclass(frozen, module = "tactus")]
pub(crate) struct Probe {
    name: String,
    /// What is to be sent while something is under way: whoever reads the port sends it.
    outgoing: Mutex<Vec<Command>>,
    inner: Mutex<Option<Inner>>,
}

struct Inner {
    port: Port<Box<dyn Line>>,
    log: Option<Log>,
    /// what is under way, and the reports of it that nobody has taken yet
    job: Option<Job<Request<()>>>,
    reports: VecDeque<Report>,
    _owner: Owner,
}

impl Inner {
    fn asks(&mut self, command: &Command) {
        if let Some(log) = &mut self.log {
            log.asked(command);
        }
    }

    /// Begins a transaction; its first request is in the log.
    fn begin<E: Transaction>(&mut self, transaction: E) -> Result<Job<E>, PortError> {
        let job = self.port.begin(transaction)?;
        if let Some(command) = job.command() {
            self.asks(&command.clone());
        }
        Ok(job)
    }

    /// Reads once, and keeps what came.
    fn step(&mut self) -> Result<(), PortError> {
        let Some(job) = &mut self.job else {
            return Ok(());
        };
        let (reports, log) = (&mut self.reports, &mut self.log);
        let stepped = self.port.step(job, |report| {
            if let Some(log) = log {
                log.told(report);
            }
            reports.push_back(report.clone());
        });
        if !matches!(stepped, Ok(Poll::Pending)) {
            self.job = None;
        }
        stepped.map(|_| ())
    }

    /// Stops what is under way, and waits until the finger is lifted.
    fn stop(&mut self) -> Result<(), PortError> {
        if self.job.is_none() {
            return Ok(());
        }
        self.asks(&Command::Stop);
        self.port.send(Command::Stop)?;
        let began = Instant::now();
        while self.job.is_some() && began.elapsed() < STOPPING {
            match self.step() {
                // a request that was stopped is refused
                Err(PortError::Link(_)) | Ok(()) => {}
                Err(why) => return Err(why),
            }
        }
        self.reports.clear();
        Ok(())
    }
}

impl Probe {
    /// Does something with the port, without the interpreter's lock.
    fn with<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut Inner) -> Result<T, PortError> + Send,
    ) -> PyResult<T> {
        py.detach(|| {
            let mut inner = self.inner.lock().unwrap_or_else(PoisonError::into_inner);
            let inner = inner.as_mut();
            let inner = inner.ok_or_else(|| ProbeError::new_err("the probe was closed"))?;
            let done = work(inner).map_err(|why| why.raise_of(&self.name))?;
            // what was said is in the file before it is believed
            inner.log.as_mut().map_or(Ok(()), Log::flush)?;
            Ok(done)
        })
    }

    /// Runs a transaction that moves nothing to its end.
    fn complete<E: Transaction + Send>(
        &self,
        py: Python<'_>,
        transaction: E,
    ) -> PyResult<E::Outcome>
    where
        E::Outcome: Send,
    {
        self.idle(py)?;
        let mut job = self.with(py, |inner| inner.begin(transaction))?;
        loop {
            let stepped = self.with(py, |inner| {
                let log = &mut inner.log;
                inner.port.step(&mut job, |report| {
                    if let Some(log) = log {
                        log.told(report);
                    }
                })
            })?;
            if let Poll::Ready(outcome) = stepped {
                return Ok(outcome);
            }
            py.check_signals()?;
        }
    }

    fn idle(&self, py: Python<'_>) -> PyResult<()> {
        if self.with(py, |inner| Ok(inner.job.is_some()))? {
            return Err(ProbeError::new_err(
                "the probe is at something: take its events to their end, or call stop()",
            ));
        }
        Ok(())
    }

    fn begin(slf: &Bound<'_, Self>, command: Command) -> PyResult<Events> {
        let (probe, py) = (slf.get(), slf.py());
        probe.idle(py)?;
        probe.with(py, |inner| {
            inner.reports.clear();
            inner.job = Some(inner.begin(Request::command(command))?);
            Ok(())
        })?;
        Ok(Events {
            probe: slf.clone().unbind(),
        })
    }

    /// The next report of what is under way; none at its end. Ctrl-C stops the rig.
    fn next(&self, py: Python<'_>) -> PyResult<Option<Report>> {
        loop {
            let (report, goes_on) = self.with(py, |inner| {
                if let Some(report) = inner.reports.pop_front() {
                    return Ok((Some(report), true));
                }
                let mut outgoing = self.outgoing.lock().unwrap_or_else(PoisonError::into_inner);
                for command in outgoing.drain(..) {
                    inner.port.send(command)?;
                }
                drop(outgoing);
                inner.step()?;
                let report = inner.reports.pop_front();
                Ok((report, inner.job.is_some() || !inner.reports.is_empty()))
            })?;
            if report.is_some() || !goes_on {
                return Ok(report);
            }
            if let Err(signal) = py.check_signals() {
                self.with(py, Inner::stop)?;
                return Err(signal);
            }
        }
    }
}

/// What a probe says while it is at something: an iterator of dicts, which ends when that is over. `close()` stops it.
#[pyclass(frozen, module = "tactus")]
pub(crate) struct Events {
    probe: Py<Probe>,
}

#[pymethods]
impl Events {
    fn __iter__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __next__<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let report = self.probe.get().next(py)?;
        report.map(|report| reported(py, &report)).transpose()
    }

    /// Stops what is under way, and waits until the finger is lifted.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        self.probe.get().with(py, Inner::stop)
    }
}

/// Another number every time.
fn seed_of_now() -> u32 {
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    now.map_or(1, |now| now.as_secs() as u32 ^ now.subsec_nanos())
}

fn name_of(name: &str) -> PyResult<Name> {
    let name = Name::try_from(name.trim()).ok().filter(|n| !n.is_empty());
    name.ok_or_else(|| PyValueError::new_err("the name of a texture has 1 to 40 bytes"))
}

/// "Busy", "Pressed", ..., or {"Slid": {"length_um": ..., "speed_um_s": ...}}, as on the link.
fn state_of(state: &Bound<'_, PyAny>) -> PyResult<ArmState> {
    if let Ok(slid) = state.get_item("Slid") {
        return Ok(ArmState::Slid {
            length_um: slid.get_item("length_um")?.extract()?,
            speed_um_s: slid.get_item("speed_um_s")?.extract()?,
        });
    }
    match state.extract::<String>()?.as_str() {
        "Busy" => Ok(ArmState::Busy),
        "Pressed" => Ok(ArmState::Pressed),
        "Steady" => Ok(ArmState::Steady),
        "Lifted" => Ok(ArmState::Lifted),
        "Failed" => Ok(ArmState::Failed),
        other => Err(PyValueError::new_err(format!("{other}: no arm's state"))),
    }
}

#[pymethods]
impl Probe {
    #[new]
    #[pyo3(signature = (port=None, *, timeout_s=5.0, log=None))]
    fn new(
        py: Python<'_>,
        port: Option<String>,
        timeout_s: f64,
        log: Option<PathBuf>,
    ) -> PyResult<Self> {
        let timeout = Duration::try_from_secs_f64(timeout_s)
            .map_err(|why| PyValueError::new_err(format!("timeout_s: {why}")))?;
        let (name, line, owner) = py
            .detach(|| {
                let name = port.map_or_else(|| only_nucleo(found()), Ok)?;
                open(&name).map(|(line, owner)| (name, line, owner))
            })
            .map_err(|why| why.raise())?;
        let log = log.map(|path| Log::create(&path, &name)).transpose()?;
        Ok(Self {
            name,
            outgoing: Mutex::default(),
            inner: Mutex::new(Some(Inner {
                port: Port::new(line, timeout),
                log,
                job: None,
                reports: VecDeque::new(),
                _owner: owner,
            })),
        })
    }

    /// The port.
    #[getter]
    fn port(&self) -> &str {
        &self.name
    }

    /// How the probe is: a dict with phase, fault, textures, table_crc, finger, counts and so on, as on the link.
    fn status<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        object(py, &self.complete(py, Request::status())?)
    }

    /// The `Table` in use.
    fn table(&self, py: Python<'_>) -> PyResult<Table> {
        Table::of(self.complete(py, ReadTable::default())?)
    }

    /// Gives the probe a `Table`, which it keeps and uses from now on.
    fn write_table(&self, py: Python<'_>, table: &Table) -> PyResult<()> {
        let push = PushTable::new(&table.bytes).map_err(|why| why.raise())?;
        self.complete(py, push)
    }

    /// Says how far an arm is with an order, while something is under way: see `Rig`.
    fn _tell_arm(&self, number: u16, state: &Bound<'_, PyAny>) -> PyResult<()> {
        let state: ArmState = state_of(state)?;
        let report = ArmReport { number, state };
        let mut outgoing = self.outgoing.lock().unwrap_or_else(PoisonError::into_inner);
        outgoing.push(Command::Arm(report));
        Ok(())
    }

    /// Whether the probe sends raw samples (events `Block` and `Pdc`) from now on.
    fn stream(&self, py: Python<'_>, on: bool) -> PyResult<()> {
        self.complete(py, Request::command(Command::Stream(on)))
    }

    /// Has the rig find its limit switches: an iterator of events.
    fn home(slf: &Bound<'_, Self>) -> PyResult<Events> {
        Self::begin(slf, Command::Home)
    }

    /// Has the probe find out what lies under its finger: an iterator of its reports, dicts with number, at_ms (its clock) and event
    /// as on the link: Chosen, SlideReport (with a `posterior` of one probability for each texture), Rejected, Verdict and others. Ctrl-C
    /// and `close()` stop the rig and lift the finger.
    ///
    /// among: names of the textures that it may be. Other arguments as of `Explorer`. learn: whether the probe learns from a verdict
    /// that is certain. seed: where slides begin, and random choices; drawn anew, unless given. Into a log go the table first and raw
    /// samples, too: with them `tactus device log replay` computes every decision again.
    ///
    /// Raises ProbeError where the probe refuses or is gone, KeyError for a texture that it does not know.
    #[pyo3(signature = (*, among=None, method=None, threshold=0.99, max_slides=10, open=true, learn=false, false_alarm=None, seed=None))]
    #[expect(
        clippy::too_many_arguments,
        reason = "all have names where it is called"
    )]
    fn identify(
        slf: &Bound<'_, Self>,
        among: Option<Vec<String>>,
        method: Option<&str>,
        threshold: f32,
        max_slides: u8,
        open: bool,
        learn: bool,
        false_alarm: Option<f32>,
        seed: Option<u32>,
    ) -> PyResult<Events> {
        let mut wanted = Identify {
            threshold,
            max_slides,
            open,
            learn,
            seed: seed.unwrap_or_else(seed_of_now),
            false_alarm: arguments::false_alarm(false_alarm)?,
            ..Identify::default()
        };
        if let Some(method) = method.map(arguments::method).transpose()? {
            wanted.method = Some(method.method());
            wanted.strategy = method.strategy();
        }
        let (probe, py) = (slf.get(), slf.py());
        let logs = probe.with(py, |inner| Ok(inner.log.is_some()))?;
        let table = (logs || among.is_some()).then(|| probe.table(py));
        let table = table.transpose()?;
        if logs {
            probe.stream(py, true)?;
        }
        if let (Some(names), Some(table)) = (among, &table) {
            let table = Read::read(&table.bytes).map_err(|why| why.raise())?;
            for name in names {
                let texture = table.find(&name);
                let texture = texture.and_then(|texture| wanted.among.push(texture).ok());
                texture.ok_or_else(|| {
                    PyKeyError::new_err(format!("{name}: the probe does not know it"))
                })?;
            }
        }
        Self::begin(slf, Command::Identify(wanted))
    }

    /// Has the probe learn what lies under its finger, by this name: an iterator of its reports, as of `identify`; TrainingSlide
    /// comes with each slide. trials: of each movement in the end, those of an unfinished training included. pilot: all movements of
    /// the grid.
    #[pyo3(signature = (name, *, trials=5, pilot=false, seed=None))]
    fn train(
        slf: &Bound<'_, Self>,
        name: &str,
        trials: u8,
        pilot: bool,
        seed: Option<u32>,
    ) -> PyResult<Events> {
        let wanted = Train {
            name: name_of(name)?,
            trials,
            pilot,
            seed: seed.unwrap_or_else(seed_of_now),
        };
        Self::begin(slf, Command::Train(wanted))
    }

    /// Tells the probe which texture it explored last: it learns from those slides.
    fn teach(&self, py: Python<'_>, name: &str) -> PyResult<u8> {
        Ok(self.complete(py, Request::label(name_of(name)?))?.slides)
    }

    /// Records slides of what lies under the finger, movements of the probe's table in turn: a list of `Slide` of that texture. Slides
    /// that did not arrive whole are left out. Ctrl-C stops the rig and lifts the finger.
    #[pyo3(signature = (texture, *, slides=15, seed=None))]
    fn record(
        slf: &Bound<'_, Self>,
        texture: &str,
        slides: u8,
        seed: Option<u32>,
    ) -> PyResult<Vec<Slide>> {
        let (probe, py) = (slf.get(), slf.py());
        let calibration = probe.complete(py, Request::read_calibration())?;
        probe.stream(py, true)?;
        let wanted = Recorder::wanted(0, slides, seed.unwrap_or_else(seed_of_now));
        Self::begin(slf, Command::Identify(wanted))?;
        let (mut recorder, mut made) = (Recorder::new(calibration.pressure), Vec::new());
        while let Some(report) = probe.next(py)? {
            if let Some(Ok(slide)) = recorder.hear(0, &report) {
                made.push(Slide::new(slide, texture));
            }
        }
        probe.stream(py, false)?;
        Ok(made)
    }

    /// Stops what is under way and lifts the finger.
    fn stop(&self, py: Python<'_>) -> PyResult<()> {
        self.with(py, Inner::stop)?;
        self.complete(py, Request::command(Command::Stop))
    }

    /// Frames that were damaged, and reports that were lost on the line so far.
    #[getter]
    fn losses(&self, py: Python<'_>) -> PyResult<(u64, u64)> {
        self.with(py, |inner| {
            let session = inner.port.session();
            Ok((session.damaged(), session.missing()))
        })
    }

    /// Stops what is under way, and gives the port back.
    fn close(&self, py: Python<'_>) {
        py.detach(|| {
            let mut inner = self.inner.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(mut inner) = inner.take() {
                // a line that failed cannot be told to stop
                let _ = inner.stop();
            }
        });
    }

    fn __enter__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    #[pyo3(signature = (*_error))]
    fn __exit__(&self, py: Python<'_>, _error: &Bound<'_, pyo3::types::PyTuple>) {
        self.close(py);
    }

    fn __repr__(&self) -> String {
        format!("<tactus.Probe at {}>", self.name)
    }
}

/// Reads a log that `tactus device --log FILE` wrote: a list of dicts, one for each line, each with one key: "session" (who wrote it),
/// "command" (what the probe was asked for) or "report" (number, at_ms and event, as `Probe.identify` gives them).
///
/// Raises ProbeError where it is no log, or of another version, OSError where it cannot be read.
#[pyfunction]
fn read_log(py: Python<'_>, path: PathBuf) -> PyResult<Vec<Bound<'_, PyAny>>> {
    let lines = py.detach(|| {
        let (mut lines, file) = (Vec::new(), File::open(&path)?);
        let read = log::read(file, |line| lines.push(line));
        read.map_err(|why| why.raise_of(&path.display().to_string()))?;
        Ok::<_, PyErr>(lines)
    })?;
    let lines = lines.iter().map(|line| match line {
        log::Line::Report(report) => {
            let line = PyDict::new(py);
            line.set_item("report", reported(py, report)?)?;
            Ok(line.into_any())
        }
        other => object(py, other),
    });
    lines.collect()
}

/// A report as a dictionary. Its posterior is one probability for each texture; on the line and in a log only those are that are not
/// negligible, with their places.
fn reported<'py>(py: Python<'py>, report: &Report) -> PyResult<Bound<'py, PyAny>> {
    let dict = object(py, report)?;
    if let Event::SlideReport { posterior, .. } = &report.event {
        let slide = dict.get_item("event")?.get_item("SlideReport")?;
        slide.set_item("posterior", object(py, posterior)?)?;
    }
    Ok(dict)
}

pub(crate) fn add(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Probe>()?;
    module.add_class::<Events>()?;
    module.add_function(wrap_pyfunction!(read_log, module)?)
}
