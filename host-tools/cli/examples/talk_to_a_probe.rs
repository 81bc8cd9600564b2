//! Talk to a probe: ask how it is.
//!
//! `TACTUS_PROBE=127.0.0.1:7429 cargo run --release -p tactus-probe --example talk_to_a_probe`, with the address of
//! `cargo xtask emulate --port 7429`. Without it, the other end is played by a thread that knows one answer.

use std::io::{Read as _, Write as _};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::time::Duration;

use tactus_core::sensor::FingerCode;
use tactus_core::wire::{self, Counts, Event, Phase, Receiver, Report, Status};
use tactus_link::{Port, Probe, Request};

pub(crate) fn main() {
    let address = match std::env::var("TACTUS_PROBE") {
        Ok(address) => address.parse().expect("HOST:PORT"),
        Err(_) => pretend(),
    };
    let line = TcpStream::connect(address).expect("somebody listens");
    line.set_read_timeout(Some(Duration::from_millis(100)))
        .expect("a time");
    let timeout = Duration::from_secs(5);
    let probe = Probe::new("the probe", timeout, timeout);
    let mut port = Port::new(line, probe.clone());
    // each report that comes on the way is shown to the closure
    let status = probe.run(Request::status(), |report| {
        println!("{report:?}");
        Ok(())
    });
    let status = port.run(status).expect("an answer");
    println!(
        "{:?}, {} textures, table {:08x}",
        status.phase, status.textures, status.table_crc
    );
}

/// The other end of the line: a probe that knows how it is, and no more.
fn pretend() -> SocketAddr {
    let listener = TcpListener::bind(("127.0.0.1", 0)).expect("a free port");
    let address = listener.local_addr().expect("it has an address");
    std::thread::spawn(move || {
        let (mut line, _) = listener.accept().expect("somebody asks");
        let mut receiver = Receiver::new();
        let mut number = 0;
        let mut say = |line: &mut TcpStream, event| {
            let report = Report {
                number,
                at_ms: 1000,
                event,
            };
            number += 1;
            let mut frame = [0; wire::MAX_FRAME + 1];
            let frame = wire::encode(&report, &mut frame).expect("it fits");
            line.write_all(frame).expect("somebody listens");
        };
        let mut byte = [0];
        while line.read_exact(&mut byte).is_ok() {
            if let Some(Ok(request)) = receiver.push::<wire::Request>(byte[0]) {
                let status = Status {
                    phase: Phase::Ready,
                    fault: None,
                    textures: 117,
                    table_bytes: 12_816,
                    table_crc: 0x7ac7_0005,
                    factory: true,
                    calibrated: 0,
                    counts: Counts::default(),
                    skin_mj: (0, 0),
                    false_alarm: None,
                    high_force: false,
                    finger: FingerCode::BIOTAC,
                };
                say(&mut line, Event::Status(status));
                say(&mut line, Event::Done(request.id));
            }
        }
    });
    address
}
