//! A thread that carries a printer's bytes, since its lines shall not wait for a screen, a file or the probe; and the
//! file of its set-up.

use std::io::{self, Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering::Relaxed;
use std::thread::JoinHandle;
use std::time::Duration;

use super::{Carrier, Printer, Setup, SetupError};
use crate::clock::Clock;
use crate::line::{Line, LineError, open_at};
use crate::lock::PortLock;
use crate::whole::write_whole;

/// A look at the line takes so long.
const READS: Duration = Duration::from_millis(2);

/// Why there is no printer.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// There is no set-up.
    #[error("{}: no printer is set up yet: run `tactus device printer setup --printer PORT`", .0.display())]
    NotSetUp(PathBuf),
    /// Its file cannot be read or written.
    #[error("{}: {why}", .file.display())]
    File {
        /// The file.
        file: PathBuf,
        /// The cause.
        why: io::Error,
    },
    /// Its file is none.
    #[error("{}: {why}", .file.display())]
    Setup {
        /// The file.
        file: PathBuf,
        /// The cause.
        why: SetupError,
    },
    /// Its port cannot be opened.
    #[error(transparent)]
    Line(#[from] LineError),
}

impl Setup {
    /// Reads the set-up in a file.
    pub fn read_file(file: &Path) -> Result<Self, OpenError> {
        let named = |why: io::Error| OpenError::File {
            file: file.to_owned(),
            why,
        };
        let text = std::fs::read_to_string(file).map_err(|why| match why.kind() {
            io::ErrorKind::NotFound => OpenError::NotSetUp(file.to_owned()),
            _ => named(why),
        })?;
        Self::read(&text).map_err(|why| OpenError::Setup {
            file: file.to_owned(),
            why,
        })
    }

    /// Writes it into a file, whole or not at all.
    pub fn write_file(&self, file: &Path) -> Result<(), OpenError> {
        write_whole(file, self.write()).map_err(|why| OpenError::File {
            file: file.to_owned(),
            why,
        })
    }
}

/// A printer at its port. Its set-up's file says where the finger is parked once it is closed.
#[derive(Debug)]
pub struct OpenPrinter {
    /// The printer.
    pub printer: Printer,
    file: Option<PathBuf>,
    port: Option<PrinterPort>,
}

impl OpenPrinter {
    /// The printer of a set-up's file, at this port or, where that is empty, at the set-up's own.
    pub fn of_file(port: &str, file: &Path) -> Result<Self, OpenError> {
        let setup = Setup::read_file(file)?;
        let port = match port {
            "" => setup.port.clone(),
            port => port.to_owned(),
        };
        let (printer, carrier) = Printer::new(Some(setup.clone()));
        let port = PrinterPort::open(&port, setup.baud, carrier)?;
        // until it is parked again, its place in the file would be wrong
        let moving = Setup {
            parked: None,
            ..setup
        };
        moving.write_file(file)?;
        Ok(Self {
            printer,
            file: Some(file.to_owned()),
            port: Some(port),
        })
    }

    /// A printer that is to be set up, with what a set-up before has left of it.
    pub fn bare(port: &str, baud: u32, left: Option<Setup>) -> Result<Self, OpenError> {
        let (printer, carrier) = Printer::new(left);
        Ok(Self {
            printer,
            file: None,
            port: Some(PrinterPort::open(port, baud, carrier)?),
        })
    }

    /// Closes its port, and keeps where it is parked. Errors: its file cannot be written.
    pub fn close(&mut self) -> Result<(), OpenError> {
        // the port first: nothing moves any more
        self.port = None;
        match (self.file.take(), self.printer.setup()) {
            (Some(file), Some(setup)) => setup.write_file(&file),
            _ => Ok(()),
        }
    }
}

impl Drop for OpenPrinter {
    fn drop(&mut self) {
        // whoever wants to know has closed it
        let _ = self.close();
    }
}

/// The port of a printer, until it is dropped.
#[derive(Debug)]
struct PrinterPort {
    ends: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    _lock: PortLock,
}

impl PrinterPort {
    /// Opens the port of this name, and carries the bytes of a printer from now on.
    fn open(name: &str, baud: u32, carrier: Carrier) -> Result<Self, LineError> {
        let (line, lock) = open_at(name, baud, READS)?;
        let ends = Arc::new(AtomicBool::new(false));
        let stops = Arc::clone(&ends);
        let thread = std::thread::spawn(move || carry(line, carrier, &stops));
        Ok(Self {
            ends,
            thread: Some(thread),
            _lock: lock,
        })
    }
}

impl Drop for PrinterPort {
    fn drop(&mut self) {
        self.ends.store(true, Relaxed);
        if let Some(thread) = self.thread.take() {
            // it has nothing left to say
            let _ = thread.join();
        }
    }
}

fn carry(mut line: Box<dyn Line>, mut carrier: Carrier, ends: &AtomicBool) {
    let clock = Clock::start();
    let mut bytes = [0; 1024];
    while !ends.load(Relaxed) {
        let came = match line.read(&mut bytes) {
            Ok(0) => Err(io::Error::from(io::ErrorKind::UnexpectedEof)),
            Err(why) => match why.kind() {
                io::ErrorKind::WouldBlock
                | io::ErrorKind::TimedOut
                | io::ErrorKind::Interrupted => Ok(0),
                _ => Err(why),
            },
            came => came,
        };
        let sent = came.and_then(|length| {
            let received = bytes.get(..length).unwrap_or_default();
            let send = carrier.carry(received, clock.elapsed());
            if send.is_empty() {
                return Ok(());
            }
            line.write_all(&send).and_then(|()| line.flush())
        });
        if let Err(why) = sent {
            carrier.close(&why.to_string(), clock.elapsed());
            std::thread::sleep(READS);
        }
    }
}
