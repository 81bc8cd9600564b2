//! Where the probe is: serial ports, TCP ports, and an emulated board that is started for it.

use std::io::{self, BufRead as _, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc;
use std::time::{Duration, SystemTime};

use crate::cmd::environment;
use crate::cmd::output::{Format, print_json};
use clap::Args;
use serde::Serialize;
use tactus_link::line::{Line, LineError, PortInfo, found, lines, only_nucleo, open, tcp};
use tactus_link::lock::PortLock;

/// Longest that the emulator takes to build its world: recordings are read.
const STARTING: Duration = Duration::from_secs(120);

/// Which probe.
#[derive(Args, Clone, Debug, Default)]
pub(crate) struct Where {
    /// Its serial port, or HOST:PORT; that of TACTUS_PORT, or the only NUCLEO that is plugged in, unless given
    #[arg(long, value_name = "PORT", conflicts_with = "emulated")]
    pub(crate) port: Option<String>,
    /// Start the emulated board with the real firmware, and end it afterwards
    #[arg(long)]
    pub(crate) emulated: bool,
    /// What lies under the emulated finger: a texture of Table 1, its name or number
    #[arg(
        long,
        value_name = "NAME",
        requires = "emulated",
        conflicts_with = "recording"
    )]
    pub(crate) texture: Option<String>,
    /// Give the emulated finger the recorded slides of a real BioTac: a material of data/biotac
    #[arg(long, value_name = "MATERIAL", requires = "emulated")]
    pub(crate) recording: Option<String>,
    /// Write all requests and reports to this file, for `tactus device log`
    #[arg(long, value_name = "FILE")]
    pub(crate) log: Option<PathBuf>,
}

/// Why there is no line to the probe, and what to do.
#[derive(Debug, thiserror::Error)]
pub(crate) enum OpenError {
    /// There is none.
    #[error(transparent)]
    Line(#[from] LineError),
    /// The emulator or the firmware is not built; a variable can name it.
    #[error(
        "{what} is not built: run `cargo xtask emulate` once, which builds it (or name it with {variable})"
    )]
    NotBuilt {
        what: &'static str,
        variable: &'static str,
    },
    /// The emulator ended, or did not start.
    #[error("the emulated board does not start: {0}")]
    Emulator(String),
}

/// A port in `device list --format json`.
#[derive(Serialize)]
struct Listed<'a> {
    port: &'a str,
    is_nucleo: bool,
    usb_vendor: Option<u16>,
    usb_product: Option<u16>,
    manufacturer: Option<&'a str>,
    product: Option<&'a str>,
    serial_number: Option<&'a str>,
}

impl<'a> From<&'a PortInfo> for Listed<'a> {
    fn from(found: &'a PortInfo) -> Self {
        let usb = found.usb.as_ref();
        Self {
            port: &found.name,
            is_nucleo: found.is_nucleo(),
            usb_vendor: usb.map(|usb| usb.vid),
            usb_product: usb.map(|usb| usb.pid),
            manufacturer: usb.and_then(|usb| usb.manufacturer.as_deref()),
            product: usb.and_then(|usb| usb.product.as_deref()),
            serial_number: usb.and_then(|usb| usb.serial_number.as_deref()),
        }
    }
}

/// Prints the ports, and what to do with them.
pub(crate) fn list(format: Format, out: &mut impl Write) -> anyhow::Result<()> {
    let found = found();
    if format == Format::Json {
        let listed: Vec<Listed<'_>> = found.iter().map(Listed::from).collect();
        return print_json(&listed, out);
    }
    match found.as_slice() {
        [] => writeln!(
            out,
            "No serial port here. Plug in the board's USB socket CN1 (LD4 must be lit), or try the emulated board:\n  \
             tactus device monitor --emulated"
        )?,
        ports @ [first, ..] => {
            let (ports, name) = (lines(ports), &first.name);
            writeln!(out, "{ports}\n\nTry: tactus device status --port {name}")?;
        }
    }
    Ok(())
}

/// A line that is open.
pub(crate) struct Open {
    pub(crate) line: Box<dyn Line>,
    pub(crate) name: String,
    /// both end with it
    pub(crate) emulator: Option<Emulator>,
    pub(crate) lock: Option<PortLock>,
}

impl Where {
    /// Opens the line.
    pub(crate) fn open(&self) -> Result<Open, OpenError> {
        if self.emulated {
            let emulator = Emulator::start(self)?;
            return Ok(Open {
                line: tcp(&emulator.address)?,
                name: "the emulated board".to_owned(),
                emulator: Some(emulator),
                lock: None,
            });
        }
        let name = match self.port.clone().or_else(environment::port) {
            Some(port) => port,
            None => only_nucleo(found())?,
        };
        let (line, lock) = open(&name)?;
        Ok(Open {
            line,
            name,
            emulator: None,
            lock: Some(lock),
        })
    }
}

/// An emulated board, in a process of its own.
pub(crate) struct Emulator {
    child: Child,
    address: String,
}

impl Drop for Emulator {
    fn drop(&mut self) {
        // it may be gone already
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Emulator {
    fn start(options: &Where) -> Result<Self, OpenError> {
        let program = "debug/tactus-emulator";
        let program = built("the emulator", "TACTUS_EMULATOR", &[program])?;
        let elf = built(
            "the firmware",
            "TACTUS_ELF",
            &[
                "chip/thumbv7em-none-eabihf/firmware/tactus-rig",
                "debian/thumbv7em-none-eabihf/firmware/tactus-rig",
            ],
        )?;
        let mut command = Command::new(&program);
        command.args(["serve", "--port", "0", "--elf"]).arg(&elf);
        for (option, value) in [
            ("--texture", &options.texture),
            ("--recording", &options.recording),
        ] {
            if let Some(value) = value {
                command.arg(option).arg(value);
            }
        }
        command.stdin(Stdio::null());
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        // a Ctrl-C of the terminal is ours alone: the board must live until its finger is lifted
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let error = |why: io::Error| OpenError::Emulator(format!("{}: {why}", program.display()));
        let child = command.spawn().map_err(error)?;
        let mut emulator = Self {
            child,
            address: String::new(),
        };
        emulator.address = emulator.find_address()?;
        Ok(emulator)
    }

    /// Where it serves, as it says; it is read in threads of their own for as long as it lives, so that it never waits.
    fn find_address(&mut self) -> Result<String, OpenError> {
        let (found, address) = mpsc::channel();
        if let Some(stdout) = self.child.stdout.take() {
            std::thread::spawn(move || {
                for line in BufReader::new(stdout).lines().map_while(Result::ok) {
                    if let Some((_, at)) = line.split_once("serial port at ") {
                        let at = at.split(',').next().unwrap_or(at).trim();
                        // nobody waits any more when it has taken too long
                        let _ = found.send(at.to_owned());
                    }
                }
            });
        }
        let stderr = self.child.stderr.take();
        let complaint = std::thread::spawn(move || {
            let lines = stderr
                .into_iter()
                .flat_map(|e| BufReader::new(e).lines().map_while(Result::ok));
            lines
                .filter(|line| !line.trim().is_empty())
                .last()
                .unwrap_or_default()
        });
        match address.recv_timeout(STARTING) {
            Ok(address) => Ok(address),
            Err(mpsc::RecvTimeoutError::Timeout) => Err(OpenError::Emulator(format!(
                "it said nothing for {STARTING:?}; is this machine very busy?"
            ))),
            // it has ended, and so has what it complains
            Err(mpsc::RecvTimeoutError::Disconnected) => {
                let _ = self.child.wait();
                Err(OpenError::Emulator(complaint.join().unwrap_or_default()))
            }
        }
    }
}

/// A program that is built here: named by `variable`, or the newest of these files in a target folder.
fn built(what: &'static str, variable: &'static str, files: &[&str]) -> Result<PathBuf, OpenError> {
    if let Some(named) = std::env::var_os(variable) {
        return Ok(named.into());
    }
    let modified = |path: &PathBuf| {
        std::fs::metadata(path)
            .and_then(|meta| meta.modified())
            .unwrap_or(SystemTime::UNIX_EPOCH)
    };
    let exe = std::env::current_exe().ok();
    let here = std::env::current_dir().ok();
    // target/release/tactus, and wherever in the repository the user stands
    let beside = exe.as_deref().and_then(|exe| exe.ancestors().nth(2));
    let above = here.iter().flat_map(|here| here.ancestors());
    std::env::var_os("CARGO_TARGET_DIR")
        .map(PathBuf::from)
        .into_iter()
        .chain(beside.map(Path::to_owned))
        .chain(above.map(|folder| folder.join("target")))
        .find_map(|target| {
            let there = files.iter().map(|file| target.join(file));
            there.filter(|path| path.is_file()).max_by_key(modified)
        })
        .ok_or(OpenError::NotBuilt { what, variable })
}

#[cfg(test)]
mod tests {
    use serialport::UsbPortInfo;

    use super::*;

    #[test]
    fn a_board_is_pointed_out_in_the_list() {
        let usb = UsbPortInfo {
            vid: 0x0483,
            pid: 0x374b,
            serial_number: Some("066EFF".into()),
            manufacturer: None,
            product: Some("STM32 STLink".into()),
        };
        let found = |name: &str, usb| PortInfo {
            name: name.into(),
            usb,
        };
        let board = found("/dev/ttyACM0", Some(usb));
        let json = serde_json::to_value(Listed::from(&board)).unwrap();
        assert_eq!(json["usb_vendor"], 0x0483);
        assert_eq!(
            (&json["is_nucleo"], &json["serial_number"]),
            (&true.into(), &"066EFF".into())
        );
        let plain = found("/dev/ttyAMA0", None);
        assert!(serde_json::to_value(Listed::from(&plain)).unwrap()["usb_vendor"].is_null());
    }
}
