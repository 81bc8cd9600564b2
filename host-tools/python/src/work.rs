//! Long work: without the interpreter's lock, in any process, and Ctrl-C ends it.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, TryLockError};
use std::thread;
use std::time::Duration;

use pyo3::exceptions::PyOSError;
use pyo3::prelude::*;
use rayon::ThreadPoolBuilder;

use crate::error::Raise;

/// Ctrl-C is looked for so often.
const LOOK: Duration = Duration::from_millis(50);
/// A value that another thread uses is asked for so often.
const ASK: Duration = Duration::from_millis(1);
/// Explorers are built on the stack.
const STACK: usize = 16 << 20;

/// Why a worker ended early.
struct Cancelled;

/// What work calls between its pieces: it does not come back from that after Ctrl-C.
pub(crate) type Between<'a> = &'a (dyn Fn() + Sync);

/// Does work on a thread of its own. Other threads of Python go on meanwhile. After Ctrl-C nobody waits for the work:
/// it owns what it uses, and ends at its next call of [`Between`], or when it is done.
///
/// # Errors
/// The work's, or that of a signal's handler: `KeyboardInterrupt`.
pub(crate) fn work<T: Send + 'static, E: Raise + Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce(Between<'_>) -> Result<T, E> + Send + 'static,
) -> PyResult<T> {
    let cancelled = Arc::new(AtomicBool::new(false));
    let seen = Arc::clone(&cancelled);
    // one that was cancelled tells nobody, and does not wait for it
    let (tell, told) = sync_channel(1);
    let run = move || {
        let between = || {
            if seen.load(Relaxed) {
                // unwinds through rayon's threads, too, and prints nothing
                resume_unwind(Box::new(Cancelled));
            }
        };
        let done = catch_unwind(AssertUnwindSafe(|| work(&between)));
        let _ = tell.send(done);
    };
    py.detach(move || {
        thread::Builder::new().stack_size(STACK).spawn(run)?;
        loop {
            match told.recv_timeout(LOOK) {
                Ok(Ok(done)) => return done.map_err(|why| why.raise()),
                Ok(Err(panic)) => resume_unwind(panic),
                Err(RecvTimeoutError::Disconnected) => resume_unwind(gone()),
                Err(RecvTimeoutError::Timeout) => {
                    if let Err(signal) = Python::attach(|py| py.check_signals()) {
                        cancelled.store(true, Relaxed);
                        return Err(signal);
                    }
                }
            }
        }
    })
}

fn gone() -> Box<dyn Any + Send> {
    Box::new("the worker ended without a word")
}

/// Does work that uses all cores, by threads of its own: those of rayon's own pool are not there in a process that was
/// forked after they were made, and whoever waits for them waits for ever.
///
/// # Errors
/// As [`work`]; `OSError` where there are no threads.
pub(crate) fn work_on_all_cores<T: Send + 'static, E: Raise + Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce(Between<'_>) -> Result<T, E> + Send + 'static,
) -> PyResult<T> {
    let pool = ThreadPoolBuilder::new().stack_size(STACK).build();
    let pool = pool.map_err(|why| PyOSError::new_err(format!("no threads to work on: {why}")))?;
    self::work(py, move |between| pool.install(|| work(between)))
}

/// Locks a value that another thread may use for long; Ctrl-C ends the wait.
///
/// `None`: this process was forked from the one that made the value while a thread was using it, which does not exist
/// here.
pub(crate) fn lock<'a, T>(
    value: &'a Mutex<T>,
    made_by: u32,
    between: Between<'_>,
) -> Option<MutexGuard<'a, T>> {
    loop {
        match value.try_lock() {
            Ok(guard) => return Some(guard),
            Err(TryLockError::Poisoned(poisoned)) => return Some(poisoned.into_inner()),
            Err(TryLockError::WouldBlock) if made_by != std::process::id() => return None,
            Err(TryLockError::WouldBlock) => {
                between();
                thread::sleep(ASK);
            }
        }
    }
}
