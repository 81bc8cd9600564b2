//! Where the probe is: serial ports, TCP ports, and an emulated board that is started for it.

use std::fmt;
use std::io::{self, BufRead as _, BufReader, Read, Write};
use std::net::{TcpStream, ToSocketAddrs as _};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc;
use std::time::{Duration, SystemTime};

use super::owner::{Owned, Owner};
use crate::cmd::config;
use crate::cmd::output::{Format, print_json};
use clap::Args;
use serde::Serialize;
use serialport::{SerialPortInfo, SerialPortType, UsbPortInfo};

/// The probe's line.
const BAUD: u32 = 921_600;
/// Reads come back after that, so that somebody looks at the keyboard; writes may take as long.
const READ: Duration = Duration::from_millis(50);
/// USB vendor of the NUCLEO's ST-LINK.
const ST: u16 = 0x0483;
/// Longest that the emulator takes to build its world: recordings are read.
const STARTING: Duration = Duration::from_secs(120);

/// Which probe.
#[derive(Args, Clone, Debug, Default)]
pub(crate) struct Where {
    /// Its serial port, or HOST:PORT; that of TACTUS_PORT, of tactus.toml, or the only NUCLEO that is plugged in, unless given
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
    /// Nothing is plugged in.
    #[error(
        "no serial port of a NUCLEO here: plug in the board's USB socket CN1 (LD4 must be lit), give --port, or try --emulated"
    )]
    None,
    /// More than one.
    #[error("several boards are plugged in: choose one with --port\n{}", lines(.0))]
    Several(Vec<Found>),
    /// No such port.
    #[error("{port}: there is no such port. {}", others(.found))]
    NotThere { port: String, found: Vec<Found> },
    /// Another program has it.
    #[error(
        "{0} is busy: another program has it open (another tactus, a terminal such as minicom, ModemManager). Close that; \
         `fuser -v {0}` names it"
    )]
    Busy(String),
    /// Another tactus has it.
    #[error(transparent)]
    Owned(#[from] Owned),
    /// The user may not.
    #[error(
        "{0}: you may not open this port. On Linux: sudo usermod -aG dialout $USER, then log in again"
    )]
    Denied(String),
    /// Something else.
    #[error("{port} cannot be opened: {why}; is it a serial port?")]
    Serial {
        port: String,
        why: serialport::Error,
    },
    /// No such address, or nobody there.
    #[error(
        "{address}: {why}. Is the emulated board running there (`cargo xtask emulate --port N`)?"
    )]
    Tcp { address: String, why: io::Error },
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

/// A serial port of this PC.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Found {
    name: String,
    usb: Option<UsbPortInfo>,
}

impl Found {
    fn is_nucleo(&self) -> bool {
        self.usb.as_ref().is_some_and(|usb| usb.vid == ST)
    }
}

impl From<SerialPortInfo> for Found {
    fn from(port: SerialPortInfo) -> Self {
        let usb = match port.port_type {
            SerialPortType::UsbPort(usb) => Some(usb),
            _ => None,
        };
        Self {
            name: port.port_name,
            usb,
        }
    }
}

impl fmt::Display for Found {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:<16}", self.name)?;
        let Some(usb) = &self.usb else {
            return f.write_str("  no USB device");
        };
        write!(f, "  {:04x}:{:04x}", usb.vid, usb.pid)?;
        let texts = [&usb.manufacturer, &usb.product, &usb.serial_number];
        for text in texts.into_iter().flatten() {
            write!(f, "  {text}")?;
        }
        if self.is_nucleo() {
            f.write_str("  <- a NUCLEO: try this one")?;
        }
        Ok(())
    }
}

fn lines(ports: &[Found]) -> String {
    let lines: Vec<String> = ports.iter().map(|port| format!("  {port}")).collect();
    lines.join("\n")
}

fn others(found: &[Found]) -> String {
    if found.is_empty() {
        "This PC has no serial port now: plug in the board's USB socket CN1, or try --emulated"
            .to_owned()
    } else {
        format!("There are:\n{}", lines(found))
    }
}

/// The serial ports of this PC; boards first. Those of the mainboard that no chip answers at are left out.
pub(crate) fn found() -> Vec<Found> {
    let ports = serialport::available_ports().unwrap_or_default();
    let mut ports: Vec<Found> = ports
        .into_iter()
        .map(Found::from)
        // every Linux has 32 of these, there or not
        .filter(|port| port.usb.is_some() || !port.name.starts_with("/dev/ttyS"))
        .collect();
    ports.sort_by_key(|port| (!port.is_nucleo(), port.name.clone()));
    ports
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

impl<'a> From<&'a Found> for Listed<'a> {
    fn from(found: &'a Found) -> Self {
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

/// What carries bytes to the probe and back; reads come back soon, with or without any.
pub(crate) trait Line: Read + Write + Send {}
impl<T: Read + Write + Send> Line for T {}

/// A line that is open.
pub(crate) struct Open {
    pub(crate) line: Box<dyn Line>,
    pub(crate) name: String,
    /// both end with it
    pub(crate) emulator: Option<Emulator>,
    pub(crate) owner: Option<Owner>,
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
                owner: None,
            });
        }
        let name = match self.port.clone().or_else(config::port) {
            Some(port) => port,
            None => only_nucleo(found())?,
        };
        // however its address was written
        let same = tcp_address(&name).map(|address| format!("tcp:{address}"));
        let owner = Some(Owner::take(same.as_ref().unwrap_or(&name))?);
        let line = match tcp_address(&name) {
            Some(address) => tcp(address)?,
            None => serial(&name)?,
        };
        Ok(Open {
            line,
            name,
            emulator: None,
            owner,
        })
    }
}

fn only_nucleo(found: Vec<Found>) -> Result<String, OpenError> {
    let mut nucleos: Vec<Found> = found.into_iter().filter(Found::is_nucleo).collect();
    match nucleos.len() {
        0 => Err(OpenError::None),
        1 => Ok(nucleos.remove(0).name),
        _ => Err(OpenError::Several(nucleos)),
    }
}

/// The address in "tcp:HOST:PORT" or in "HOST:PORT", which no serial port is called.
fn tcp_address(name: &str) -> Option<&str> {
    name.strip_prefix("tcp:").or_else(|| {
        let (host, port) = name.rsplit_once(':')?;
        let is_address = !host.is_empty() && port.parse::<u16>().is_ok();
        (is_address && !Path::new(name).exists()).then_some(name)
    })
}

fn serial(port: &str) -> Result<Box<dyn Line>, OpenError> {
    use io::ErrorKind as Io;
    use serialport::ErrorKind as Serial;
    let port = port.to_owned();
    let why = match serialport::new(&port, BAUD).timeout(READ).open() {
        Ok(line) => return Ok(Box::new(line)),
        Err(why) => why,
    };
    Err(match why.kind() {
        Serial::Io(Io::PermissionDenied) => OpenError::Denied(port),
        // serialport's word for a port that somebody else has, or one that Windows does not know
        Serial::NoDevice if Path::new(&port).exists() || cfg!(windows) => OpenError::Busy(port),
        Serial::NoDevice | Serial::Io(Io::NotFound) => {
            let found = found();
            OpenError::NotThere { port, found }
        }
        _ => OpenError::Serial { port, why },
    })
}

fn tcp(address: &str) -> Result<Box<dyn Line>, OpenError> {
    let error = |why| OpenError::Tcp {
        address: address.to_owned(),
        why,
    };
    let to = address.to_socket_addrs().map_err(error)?.next();
    let to = to.ok_or_else(|| error(io::ErrorKind::NotFound.into()))?;
    let stream = TcpStream::connect_timeout(&to, Duration::from_secs(5)).map_err(error)?;
    stream
        .set_read_timeout(Some(READ))
        .and_then(|()| stream.set_nodelay(true))
        .map_err(error)?;
    Ok(Box::new(stream))
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
        let program = "emulator/release/tactus-emulator";
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
    use super::*;

    fn port(name: &str, vid: u16) -> Found {
        let usb = UsbPortInfo {
            vid,
            pid: 0x374b,
            serial_number: Some("066EFF".into()),
            manufacturer: None,
            product: Some("STM32 STLink".into()),
        };
        Found {
            name: name.into(),
            usb: Some(usb),
        }
    }

    #[test]
    fn an_address_is_no_serial_port() {
        for (name, address) in [
            ("tcp:127.0.0.1:7429", Some("127.0.0.1:7429")),
            ("127.0.0.1:7429", Some("127.0.0.1:7429")),
            ("bench.local:7429", Some("bench.local:7429")),
            ("[::1]:7429", Some("[::1]:7429")),
            ("/dev/ttyACM0", None),
            ("COM3", None),
            ("COM3:", None),
            (":7429", None),
            ("host:99999", None),
        ] {
            assert_eq!(tcp_address(name), address, "{name}");
        }
    }

    #[test]
    fn the_only_board_is_taken_and_of_two_the_user_chooses() {
        let other = port("/dev/ttyUSB0", 0x1a86);
        let [a, b] = ["/dev/ttyACM0", "/dev/ttyACM1"].map(|name| port(name, ST));
        assert_eq!(
            only_nucleo(vec![other.clone(), a.clone()]).unwrap(),
            "/dev/ttyACM0"
        );
        let none = only_nucleo(vec![other]).unwrap_err().to_string();
        assert!(
            none.contains("CN1") && none.contains("--emulated"),
            "{none}"
        );
        let both = only_nucleo(vec![a, b]).unwrap_err().to_string();
        assert!(
            both.contains("--port") && both.contains("ttyACM0") && both.contains("ttyACM1"),
            "{both}"
        );
    }

    #[test]
    fn a_board_is_pointed_out_in_the_list() {
        assert_eq!(
            port("/dev/ttyACM0", ST).to_string(),
            "/dev/ttyACM0      0483:374b  STM32 STLink  066EFF  <- a NUCLEO: try this one"
        );
        let json = serde_json::to_value(Listed::from(&port("/dev/ttyACM0", ST))).unwrap();
        assert_eq!(json["usb_vendor"], 0x0483);
        assert_eq!(
            (&json["is_nucleo"], &json["serial_number"]),
            (&true.into(), &"066EFF".into())
        );
        let plain = Found {
            name: "/dev/ttyAMA0".into(),
            usb: None,
        };
        assert!(serde_json::to_value(Listed::from(&plain)).unwrap()["usb_vendor"].is_null());
        assert_eq!(plain.to_string(), "/dev/ttyAMA0      no USB device");
    }
}
