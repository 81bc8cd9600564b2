//! Whoever connects to the emulator's TCP port talks to the firmware.

use std::io::{BufRead as _, BufReader};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use tactus_core::table::Table;
use tactus_core::wire::Status;
use tactus_link::{LinkError, Port, PortError, ReadTable, Request};

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
    let mut port = Port::new(stream, Duration::from_secs(20));
    let status = loop {
        match port.run(Request::status(), |_| ()) {
            // it had its power just now
            Err(PortError::Link(LinkError::Rebooted { .. })) => {}
            // nor has it opened its store yet
            Ok(Status { textures: 0, .. }) => std::thread::sleep(Duration::from_millis(100)),
            answered => break answered.unwrap(),
        }
    };
    assert!(status.factory, "{status:?}");
    let bytes = port.run(ReadTable::default(), |_| ()).unwrap();
    let table = Table::read(&bytes).unwrap();
    assert_eq!((table.crc(), table.textures()), (status.table_crc, 117));
    assert_eq!(port.session().damaged(), 0);
}
