//! Carriers of bytes to the probe: serial ports and TCP ports, by the names that `--port` takes.

use std::fmt;
use std::io::{self, Read, Write};
use std::net::{TcpStream, ToSocketAddrs as _};
use std::path::Path;
use std::time::Duration;

use serialport::{SerialPortInfo, SerialPortType, UsbPortInfo};

use super::lock::PortLock;

const BAUD: u32 = 921_600;
/// Reads come back after that, so that somebody looks at the keyboard; writes may take as long.
const READ: Duration = Duration::from_millis(50);
/// USB vendor of the NUCLEO's ST-LINK.
const ST: u16 = 0x0483;

/// An error on the way to a line, and what to do.
#[derive(Debug, thiserror::Error)]
pub enum LineError {
    /// The user may not.
    #[error(
        "{0}: you may not open this port. On Linux: sudo usermod -aG dialout $USER, then log in again"
    )]
    Denied(String),
    /// Something else.
    #[error("{0}")]
    Said(String),
}

/// A serial port of this PC.
#[derive(Clone, PartialEq, Debug)]
pub struct PortInfo {
    /// Its name.
    pub name: String,
    /// The USB device's description of itself, if it is one.
    pub(crate) usb: Option<UsbPortInfo>,
}

impl PortInfo {
    fn is_nucleo(&self) -> bool {
        self.usb.as_ref().is_some_and(|usb| usb.vid == ST)
    }
}

impl From<SerialPortInfo> for PortInfo {
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

impl fmt::Display for PortInfo {
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

fn lines<'p>(ports: impl IntoIterator<Item = &'p PortInfo>) -> String {
    let lines = ports.into_iter().map(|port| format!("  {port}"));
    let lines: Vec<String> = lines.collect();
    lines.join("\n")
}

fn others(found: &[PortInfo]) -> String {
    if found.is_empty() {
        "This PC has no serial port now".to_owned()
    } else {
        format!("There are:\n{}", lines(found))
    }
}

/// The serial ports of this PC; boards first. Those of the mainboard that no chip answers at are left out.
pub fn found() -> Vec<PortInfo> {
    let ports = serialport::available_ports().unwrap_or_default();
    let mut ports: Vec<PortInfo> = ports
        .into_iter()
        .map(PortInfo::from)
        // every Linux has 32 of these, there or not
        .filter(|port| port.usb.is_some() || !port.name.starts_with("/dev/ttyS"))
        .collect();
    ports.sort_by_key(|port| (!port.is_nucleo(), port.name.clone()));
    ports
}

/// A carrier of bytes to the probe and back; reads come back soon, with or without any.
pub trait Line: Read + Write + Send {}
impl<T: Read + Write + Send> Line for T {}

/// Opens the probe's port of this name, and keeps other commands from it.
pub fn open(name: &str) -> Result<(Box<dyn Line>, PortLock), LineError> {
    open_at(name, BAUD, READ)
}

/// Opens a port of another baud rate, whose reads come back after this time.
pub fn open_at(
    name: &str,
    baud: u32,
    reads: Duration,
) -> Result<(Box<dyn Line>, PortLock), LineError> {
    // however its address was written
    let same = tcp_address(name).map(|address| format!("tcp:{address}"));
    let lock = PortLock::take(same.as_deref().unwrap_or(name));
    let lock = lock.ok_or_else(|| {
        LineError::Said(format!(
            "{name} is used by another tactus: wait for it or end it, it cannot be watched from a second command"
        ))
    })?;
    let line = match tcp_address(name) {
        Some(address) => tcp_at(address, reads)?,
        None => serial(name, baud, reads)?,
    };
    Ok((line, lock))
}

/// The only NUCLEO among these.
pub fn only_nucleo(found: Vec<PortInfo>) -> Result<String, LineError> {
    let nucleos: Vec<&PortInfo> = found.iter().filter(|port| port.is_nucleo()).collect();
    match nucleos.as_slice() {
        [] => Err(LineError::Said(format!(
            "no NUCLEO here: plug in its USB socket CN1 (LD4 must be lit), or give --port. {}",
            others(&found)
        ))),
        [only] => Ok(only.name.clone()),
        several => Err(LineError::Said(format!(
            "several boards are plugged in: choose one with --port\n{}",
            lines(several.iter().copied())
        ))),
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

fn serial(port: &str, baud: u32, reads: Duration) -> Result<Box<dyn Line>, LineError> {
    use io::ErrorKind as Io;
    use serialport::ErrorKind as Serial;
    let port = port.to_owned();
    let why = match serialport::new(&port, baud).timeout(reads).open() {
        Ok(line) => return Ok(Box::new(line)),
        Err(why) => why,
    };
    Err(match why.kind() {
        Serial::Io(Io::PermissionDenied) => LineError::Denied(port),
        // serialport's word for a port that somebody else has, or one that Windows does not know
        Serial::NoDevice if Path::new(&port).exists() || cfg!(windows) => LineError::Said(format!(
            "{port} is busy: another program has it open (another tactus, a terminal such as minicom, ModemManager). \
             Close that; `fuser -v {port}` names it"
        )),
        Serial::NoDevice | Serial::Io(Io::NotFound) => {
            let others = others(&found());
            LineError::Said(format!("{port}: there is no such port. {others}"))
        }
        _ => LineError::Said(format!(
            "{port} cannot be opened: {why}; is it a serial port?"
        )),
    })
}

/// Opens a TCP port, "HOST:PORT".
pub fn tcp(address: &str) -> Result<Box<dyn Line>, LineError> {
    tcp_at(address, READ)
}

fn tcp_at(address: &str, reads: Duration) -> Result<Box<dyn Line>, LineError> {
    let error = |why: io::Error| {
        LineError::Said(format!(
            "{address}: {why}. Is the emulated board running there (`cargo xtask emulate --port N`)?"
        ))
    };
    let to = address.to_socket_addrs().map_err(error)?.next();
    let to = to.ok_or_else(|| error(io::ErrorKind::NotFound.into()))?;
    let stream = TcpStream::connect_timeout(&to, Duration::from_secs(5)).map_err(error)?;
    stream
        .set_read_timeout(Some(reads))
        .and_then(|()| stream.set_write_timeout(Some(Duration::from_secs(5))))
        .and_then(|()| stream.set_nodelay(true))
        .map_err(error)?;
    Ok(Box::new(stream))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn port(name: &str, vid: u16) -> PortInfo {
        let usb = UsbPortInfo {
            vid,
            pid: 0x374b,
            serial_number: Some("066EFF".into()),
            manufacturer: None,
            product: Some("STM32 STLink".into()),
        };
        PortInfo {
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
        assert!(none.contains("CN1") && none.contains("ttyUSB0"), "{none}");
        let both = only_nucleo(vec![a, b]).unwrap_err().to_string();
        assert!(
            both.contains("--port") && both.contains("ttyACM0") && both.contains("ttyACM1"),
            "{both}"
        );
    }

    #[test]
    fn a_board_is_pointed_out() {
        assert_eq!(
            port("/dev/ttyACM0", ST).to_string(),
            "/dev/ttyACM0      0483:374b  STM32 STLink  066EFF  <- a NUCLEO: try this one"
        );
        let plain = PortInfo {
            name: "/dev/ttyAMA0".into(),
            usb: None,
        };
        assert_eq!(plain.to_string(), "/dev/ttyAMA0      no USB device");
    }
}
