//! Long work: without the interpreter's lock, and Ctrl-C ends it.

use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

use pyo3::prelude::*;

use crate::error::Raise;

/// Ctrl-C is looked for so often.
const LOOK: Duration = Duration::from_millis(50);
/// Explorers are built on the stack.
const STACK: usize = 16 << 20;

/// Why a worker ended early.
struct Cancelled;

/// Does work on a thread of its own; the work calls what it gets between its pieces, and does not come back from that
/// after Ctrl-C. Other threads of Python go on meanwhile.
///
/// # Errors
/// The work's, or that of a signal's handler: `KeyboardInterrupt`.
pub(crate) fn work<T: Send, E: Raise + Send>(
    py: Python<'_>,
    work: impl FnOnce(&(dyn Fn() + Sync)) -> Result<T, E> + Send,
) -> PyResult<T> {
    let cancelled = AtomicBool::new(false);
    let between = || {
        if cancelled.load(Relaxed) {
            // unwinds through rayon's threads, too, and prints nothing
            resume_unwind(Box::new(Cancelled));
        }
    };
    py.detach(|| {
        thread::scope(|scope| {
            let (tell, told) = channel();
            let (work, between) = (work, &between);
            let worker = thread::Builder::new().stack_size(STACK);
            let worker = worker.spawn_scoped(scope, move || {
                // nobody listens after Ctrl-C
                let _ = tell.send(work(between));
            })?;
            loop {
                match told.recv_timeout(LOOK) {
                    Ok(done) => return done.map_err(|why| why.raise()),
                    Err(RecvTimeoutError::Disconnected) => break,
                    Err(RecvTimeoutError::Timeout) => {
                        if let Err(signal) = Python::attach(|py| py.check_signals()) {
                            cancelled.store(true, Relaxed);
                            // that of a worker that was cancelled is no panic
                            let _ = worker.join();
                            return Err(signal);
                        }
                    }
                }
            }
            match worker.join() {
                Err(panic) => resume_unwind(panic),
                Ok(()) => unreachable!("the worker tells before it ends"),
            }
        })
    })
}
