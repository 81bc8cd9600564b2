//! Whoever connects to the emulator's TCP port talks to the firmware.

use std::io::{BufRead as _, BufReader};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use tactus_core::table::Table;
use tactus_link::{Port, Probe};

use crate::common::elf;

/// Ends the emulator, however the test ends.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn the_probe_answers_on_the_tcp_port() {
    let Some(elf) = elf() else { return };
    let child = Command::new(env!("CARGO_BIN_EXE_tactus-emulator"))
        .args(["serve", "--elf"])
        .arg(elf)
        .args(["--texture", "5", "--port", "0"])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut running = Running(child);
    let mut lines = BufReader::new(running.0.stdout.take().unwrap()).lines();
    let address = lines
        .find_map(|line| {
            let line = line.unwrap();
            let (_, at) = line.split_once("serial port at ")?;
            Some(at.split(',').next()?.to_owned())
        })
        .unwrap();
    let stream = TcpStream::connect(address).unwrap();
    stream
        .set_read_timeout(Some(Duration::from_millis(100)))
        .unwrap();
    let timeout = Duration::from_secs(20);
    let probe = Probe::new("the board", timeout, timeout);
    let mut port = Port::new(stream, probe.clone());
    // it had its power just now, and opens its store first
    let status = port.run(probe.hello()).unwrap();
    assert!(status.factory, "{status:?}");
    let bytes = port.run(probe.table()).unwrap();
    let table = Table::read(&bytes).unwrap();
    assert_eq!((table.crc(), table.textures()), (status.table_crc, 117));
    assert_eq!(probe.losses().0, 0);
}
