//! A probe at a serial or a TCP port.

use std::collections::VecDeque;
use std::path::PathBuf;
use std::pin::Pin;
use std::sync::{Mutex, PoisonError};
use std::task::Poll;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use pyo3::exceptions::{PyKeyError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use tactus_core::table::{Name, Table as Read};
use tactus_core::wire::{ArmReport, ArmState, Command, Event, Identify, Report, Train};
use tactus_lab::data::recordings::files;
use tactus_lab::remote::operations::{Wanted, record};
use tactus_link::lifting::Stopped;
use tactus_link::line::{Line, found, only_nucleo, open};
use tactus_link::lock::PortLock;
use tactus_link::log::{self, Log};
use tactus_link::operations::{self, Sample};
use tactus_link::{OperationError, Port, PortError, PushTable, Request, Transaction};
use tactus_link::{Probe as Linked, say};

use crate::arguments;
use crate::error::{ProbeError, Raise as _};
use crate::recordings::Slide;
use crate::table::Table;
use crate::values::{no_pickle, object};
use crate::work::work;

/// A probe. port: its serial port, or tcp:HOST:PORT; the only NUCLEO that is plugged in, unless given. timeout_s: a
/// probe that says nothing for so long is taken for gone; its longest silence is 2 s. log: a new file for all requests
/// and reports, as
/// `tactus device --log FILE` writes it, for `read_log`, `tactus device log` and `tactus convert`.
///
/// Raises ProbeError where there is no such port, or somebody else has it; OSError where there is such a file, or it
/// cannot be written.
#[pyclass(frozen, module = "tactus")]
pub(crate) struct Probe {
    name: String,
    pub(crate) linked: Linked,
    opened_by: u32,
    inner: Mutex<Option<Inner>>,
}

/// A request under way.
type Job = Pin<Box<dyn Future<Output = Result<(), OperationError>> + Send>>;

struct Inner {
    port: Port<Box<dyn Line>>,
    log: Option<Log>,
    /// what is under way, and the reports of it that nobody has taken yet
    job: Option<Job>,
    reports: VecDeque<Report>,
    _lock: PortLock,
}

impl Inner {
    /// Polls an operation once, and keeps what came.
    fn poll<F: Future>(&mut self, operation: Pin<&mut F>) -> PyResult<Poll<F::Output>> {
        let polled = self.port.poll(operation);
        for line in self.port.probe().said() {
            if let Some(log) = &mut self.log {
                log.line(&line);
            }
            if let log::Line::Report(report) = line {
                self.reports.push_back(report.into_owned());
            }
        }
        // a program has the results
        self.port.probe().take_words();
        // what was said is in the file before it is believed
        self.log.as_mut().map_or(Ok(()), Log::flush)?;
        Ok(polled)
    }

    /// Reads once for what is under way; ready where nothing is.
    fn step(&mut self) -> PyResult<Poll<Result<(), OperationError>>> {
        let Some(mut job) = self.job.take() else {
            return Ok(Poll::Ready(Ok(())));
        };
        let polled = self.poll(Pin::new(&mut job))?;
        if polled.is_pending() {
            self.job = Some(job);
        }
        Ok(polled)
    }
}

impl Probe {
    /// Does something with the port, without the interpreter's lock.
    fn with<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut Inner) -> PyResult<T> + Send,
    ) -> PyResult<T> {
        // two processes that read one port take each other's answers
        if self.opened_by != std::process::id() {
            return Err(ProbeError::new_err(
                "this probe was opened by the process from which this one was forked: close it there and open it here, \
                 or start processes with multiprocessing.get_context(\"spawn\")",
            ));
        }
        py.detach(|| {
            let mut inner = self.inner.lock().unwrap_or_else(PoisonError::into_inner);
            let inner = inner.as_mut();
            work(inner.ok_or_else(|| ProbeError::new_err("the probe was closed"))?)
        })
    }

    /// Stops what is under way, and waits until the finger is lifted; Ctrl-C ends the wait.
    fn halt(&self, py: Python<'_>) -> PyResult<()> {
        let is_at_work = self.with(py, |inner| {
            if inner.job.is_some() {
                inner.port.probe().stop();
            }
            Ok(inner.job.is_some())
        })?;
        if !is_at_work {
            return Ok(());
        }
        let stopped = loop {
            match self.with(py, Inner::step) {
                Ok(Poll::Pending) => {}
                Ok(Poll::Ready(done)) => break Ok(done),
                Err(why) => break Err(why),
            }
            if let Err(signal) = py.check_signals() {
                break Err(signal);
            }
        };
        self.linked.clear_stop();
        self.with(py, |inner| {
            inner.reports.clear();
            // after Ctrl-C it has been told to stop, and nobody waits for it a second time
            inner.job = None;
            Ok(())
        })?;
        match stopped? {
            Ok(())
            | Err(
                OperationError::Stopped(Stopped::Lifted)
                | OperationError::Port {
                    why: PortError::Link(_),
                    ..
                },
            ) => Ok(()),
            Err(why) => Err(why.raise()),
        }
    }

    /// Does an operation. Ctrl-C stops it, and the rig with it; once more, and nobody waits for that either.
    fn complete<T: Send>(
        &self,
        py: Python<'_>,
        operation: impl Future<Output = Result<T, OperationError>> + Send,
    ) -> PyResult<T> {
        self.idle(py)?;
        let mut operation = std::pin::pin!(operation);
        let mut signal = Ok(());
        let done = loop {
            let polled = self.with(py, |inner| inner.poll(operation.as_mut()))?;
            if let Poll::Ready(done) = polled {
                break done;
            }
            if let Err(why) = py.check_signals() {
                if signal.is_err() {
                    self.linked.clear_stop();
                    return Err(why);
                }
                self.linked.stop();
                signal = Err(why);
            }
        };
        if signal.is_err() {
            self.linked.clear_stop();
        }
        signal.and_then(|()| done.map_err(|why| why.raise()))
    }

    /// Does one request.
    fn get<E: Transaction + Send>(&self, py: Python<'_>, request: E) -> PyResult<E::Outcome>
    where
        E::Outcome: Send,
    {
        self.complete(py, self.linked.get(request))
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
        let linked = probe.linked.clone();
        let job = async move { linked.get(Request::command(command)).await };
        probe.with(py, |inner| {
            inner.reports.clear();
            inner.job = Some(Box::pin(job));
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
                if let Poll::Ready(done) = inner.step()? {
                    done.map_err(|why| why.raise())?;
                }
                let report = inner.reports.pop_front();
                Ok((report, inner.job.is_some() || !inner.reports.is_empty()))
            })?;
            if report.is_some() || !goes_on {
                return Ok(report);
            }
            if let Err(signal) = py.check_signals() {
                self.halt(py)?;
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
        self.probe.get().halt(py)
    }

    fn __reduce__(&self) -> PyResult<()> {
        no_pickle(
            "tactus.Events",
            "take its reports, which are dicts, and pickle those",
        )
    }
}

/// Another number every time.
fn seed_of_now() -> u32 {
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    now.map_or(1, |now| now.as_secs() as u32 ^ now.subsec_nanos())
}

fn name_of(name: &str) -> PyResult<Name> {
    say::name_of(name).map_err(|why| PyValueError::new_err(why.to_string()))
}

/// "Busy", "Pressed", ..., or {"Slid": {"length_um": ..., "speed_um_s": ...}}, as on the link.
fn state_of(state: &Bound<'_, PyAny>) -> PyResult<ArmState> {
    let text = state.py().import("json")?.call_method1("dumps", (state,))?;
    let state = serde_json::from_str(&text.extract::<String>()?);
    state.map_err(|_| PyValueError::new_err(format!("{text}: no arm's state")))
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
        let (name, line, lock) = work(py, move |_| {
            let name = port.map_or_else(|| only_nucleo(found()), Ok)?;
            open(&name).map(|(line, lock)| (name, line, lock))
        })?;
        let log = log.map(|path| Log::create(&path, &name)).transpose()?;
        let linked = Linked::new(&name, timeout, timeout);
        Ok(Self {
            name,
            linked: linked.clone(),
            opened_by: std::process::id(),
            inner: Mutex::new(Some(Inner {
                port: Port::new(line, linked),
                log,
                job: None,
                reports: VecDeque::new(),
                _lock: lock,
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
        object(py, &self.get(py, Request::status())?)
    }

    /// The `Table` in use.
    fn table(&self, py: Python<'_>) -> PyResult<Table> {
        Table::of(self.complete(py, self.linked.table())?.to_vec())
    }

    /// Gives the probe a `Table`, which it keeps and uses from now on.
    fn write_table(&self, py: Python<'_>, table: &Table) -> PyResult<()> {
        let push = PushTable::new(&table.bytes).map_err(|why| why.raise())?;
        self.get(py, push)
    }

    /// Says how far an arm is with an order, while something is under way: see `Rig`.
    fn _tell_arm(&self, number: u16, state: &Bound<'_, PyAny>) -> PyResult<()> {
        let state: ArmState = state_of(state)?;
        let report = ArmReport { number, state };
        // whoever reads the port sends it
        let sent = self.linked.send(Command::Arm(report));
        sent.map_err(|why| why.raise())
    }

    /// Whether the probe sends raw samples (events `Block` and `Pdc`) from now on.
    fn stream(&self, py: Python<'_>, on: bool) -> PyResult<()> {
        self.get(py, Request::command(Command::Stream(on)))
    }

    /// Has the rig find its limit switches: an iterator of events.
    fn home(slf: &Bound<'_, Self>) -> PyResult<Events> {
        Self::begin(slf, Command::Home)
    }

    /// Has the probe find out what lies under its finger: an iterator of its reports, dicts with number, at_ms (its
    /// clock) and event as on the link: Chosen, SlideReport (with a `posterior` of one probability for each texture),
    /// Rejected, Verdict and others. Ctrl-C and `close()` stop the rig and lift the finger.
    ///
    /// among: names of the textures that it may be. Other arguments as of `Explorer`. learn: whether the probe learns
    /// from a verdict that is certain. seed: where slides begin, and random choices; drawn anew, unless given. Into a
    /// log go the table first and raw samples, too: with them `tactus device log replay` computes every decision again.
    ///
    /// Raises ProbeError where the probe refuses or is gone, KeyError for a texture that it does not know.
    #[pyo3(signature = (*, among=None, method=None, threshold=0.99, max_slides=10, open=true, learn=false,
        false_alarm=None, seed=None))]
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

    /// Has the probe learn what lies under its finger, by this name: an iterator of its reports, as of `identify`;
    /// TrainingSlide comes with each slide. trials: of each movement in the end, those of an unfinished training
    /// included. pilot: all movements of the grid.
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
        Ok(self.get(py, Request::label(name_of(name)?))?.slides)
    }

    /// Records slides of what lies under the finger, movements of the probe's table in turn: a list of `Slide` of that
    /// texture. Slides that did not arrive whole are left out. Ctrl-C stops the rig and lifts the finger.
    #[pyo3(signature = (texture, *, slides=15, seed=None))]
    fn record(
        &self,
        py: Python<'_>,
        texture: &str,
        slides: u8,
        seed: Option<u32>,
    ) -> PyResult<Vec<Slide>> {
        let wanted = Wanted {
            name: texture.to_owned(),
            index: 0,
            slides,
            sample: Sample::Noted(None),
            seed: seed.unwrap_or_else(seed_of_now),
        };
        let recorded = self.complete(py, record(&self.linked, &wanted))?;
        let slides = recorded.slides.into_iter();
        Ok(slides
            .map(|(slide, _)| Slide::new(slide, texture))
            .collect())
    }

    /// Stops what is under way and lifts the finger.
    fn stop(&self, py: Python<'_>) -> PyResult<()> {
        self.halt(py)?;
        self.complete(py, operations::stop(&self.linked))
    }

    /// Frames that were damaged, and reports that were lost on the line so far.
    #[getter]
    fn losses(&self) -> (u64, u64) {
        self.linked.losses()
    }

    /// Stops what is under way, and gives the port back.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        let stopped = self.halt(py);
        // in a process that was forked from the one that opened it, the port is not ours to give back
        if self.opened_by == std::process::id() {
            py.detach(|| *self.inner.lock().unwrap_or_else(PoisonError::into_inner) = None);
        }
        // a line that failed cannot be told to stop
        stopped.or_else(|why| match why.is_instance_of::<ProbeError>(py) {
            true => Ok(()),
            false => Err(why),
        })
    }

    fn __reduce__(&self) -> PyResult<()> {
        no_pickle(
            "tactus.Probe",
            "one process has a port: close it there, and open it in the other one",
        )
    }

    fn __enter__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    #[pyo3(signature = (*_error))]
    fn __exit__(&self, py: Python<'_>, _error: &Bound<'_, pyo3::types::PyTuple>) -> PyResult<()> {
        self.close(py)
    }

    fn __repr__(&self) -> String {
        format!("<tactus.Probe at {}>", self.name)
    }
}

/// Reads a log that `tactus device --log FILE` wrote: a list of dicts, one for each line, each with one key: "session"
/// (who wrote it), "command" (what the probe was asked for) or "report" (number, at_ms and event, as `Probe.identify`
/// gives them).
///
/// Raises ProbeError where it is no log, or of another version, OSError where it cannot be read.
#[pyfunction]
fn read_log(py: Python<'_>, path: PathBuf) -> PyResult<Vec<Bound<'_, PyAny>>> {
    let lines = work(py, move |_| {
        let (mut lines, file) = (Vec::new(), files::open(&path)?);
        let read = log::read(file, |line| lines.push(line));
        read.map_err(|why| why.raise_of(path.display().to_string()))?;
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

/// A report as a dictionary. Its posterior is one probability for each texture; on the line and in a log only those are
/// that are not negligible, with their places.
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
