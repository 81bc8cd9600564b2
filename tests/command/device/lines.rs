//! Lines at whose other end is no probe, a slow one, or one that goes away.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::mpsc;
use std::thread;
use std::time::Duration;

use tactus_core::sensor::FingerCode;
use tactus_core::wire::{self, Event, MAX_FRAME, Report, Reset};

use super::software::{known, line, once, serve};
use crate::{Scratch, assert_says};

/// Answers whatever comes with these frames.
fn says<T: serde::Serialize + 'static>(message: impl Fn(u16) -> T + Send + 'static) -> String {
    line(move |mut stream| {
        let (mut bytes, mut number) = ([0; 256], 0);
        while stream.read(&mut bytes).is_ok_and(|length| length > 0) {
            let mut buffer = [0; MAX_FRAME + 1];
            let _ = stream.write_all(wire::encode(&message(number), &mut buffer).unwrap());
            number += 1;
        }
    })
}

#[test]
fn a_port_without_a_probe_is_an_error_that_says_what_to_do() {
    let garbage = line(|mut stream| {
        let noise = |n: u32| (n.wrapping_mul(2_654_435_761) >> 13) as u8;
        let noise: Vec<u8> = (0..4000).map(noise).collect();
        while stream.write_all(&noise).is_ok() {
            thread::sleep(Duration::from_millis(5));
        }
    });
    // a terminal's greeting, without any 0
    let greeting = line(|mut stream| {
        let _ = stream.write_all(b"login: ");
        thread::sleep(Duration::from_secs(30));
    });
    let silent = line(|_stream| thread::sleep(Duration::from_secs(30)));
    let booted = says(|number| Report {
        number,
        at_ms: 0,
        event: Event::Booted {
            protocol: 2,
            version: Default::default(),
            reset: Reset::Power,
            last_words: None,
            finger: FingerCode::BIOTAC,
        },
    });
    // whole frames with a message that nobody knows
    let foreign = says(|_| [250u8; 30]);
    for (port, words) in [
        (garbage, ["not one report", "not the probe's port"]),
        (greeting, ["7 bytes came and not one report", "port"]),
        (silent, ["said nothing", "has power"]),
        (line(drop), ["port", "open it again"]),
        (booted, ["version 2", "tactus device flash"]),
        (foreign, ["another version", "tactus device flash"]),
    ] {
        let at = Scratch::new().with("PORT", port);
        assert_says(&at.error("device status --port PORT", 1), &words);
    }
}

#[test]
fn a_slow_line_works_and_a_vanished_one_is_an_error() {
    known();
    /// Gives its bytes one at a time.
    struct Slow(TcpStream);
    impl Read for Slow {
        fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
            self.0.read(&mut bytes[..1])
        }
    }
    impl Write for Slow {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            thread::sleep(Duration::from_micros(300));
            self.0.write(&bytes[..1])
        }
        fn flush(&mut self) -> std::io::Result<()> {
            self.0.flush()
        }
    }
    let wait = Some(Duration::from_millis(1));
    let slow = line(move |stream| {
        stream.set_read_timeout(wait).unwrap();
        serve(once(Slow(stream)), 1000, mpsc::channel().0);
    });
    let at = Scratch::new().with("PORT", slow);
    assert_says(&at.printed("device status --port PORT"), &["3 textures"]);

    // the cable is pulled while the finger slides
    let vanishing = line(move |stream| {
        let (asked, told) = mpsc::channel();
        stream.set_read_timeout(wait).unwrap();
        let cable = stream.try_clone().unwrap();
        thread::spawn(move || {
            while !matches!(told.recv(), Ok(wire::Command::Identify(_)) | Err(_)) {}
            thread::sleep(Duration::from_millis(100));
            let _ = cable.shutdown(std::net::Shutdown::Both);
        });
        serve(once(stream), 10, asked);
    });
    let at = Scratch::new().with("PORT", vanishing);
    let said = at.error("device identify --port PORT", 1);
    assert_says(&said, &["port", "The rig was moving", "emergency stop"]);
}
