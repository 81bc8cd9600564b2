//! `tactus device printer` and `--printer`: a person sets up a printer and has it move the finger, over two ports.

use std::fs::File;
use std::io::{ErrorKind, Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::process::Stdio;
use std::sync::mpsc;
use std::thread;

use tactus_core::explorer::Method;
use tactus_core::features::FeatureSet;
use tactus_core::rig::arm::{ArmOrder, ArmReport};
use tactus_core::rig::guard::Unguarded;
use tactus_lab::sim::collection::{Collection, calibrated};
use tactus_lab::sim::over_link::Mover;
use tactus_lab::sim::printer::rig;
use tactus_world::printer::Kind;
use tactus_world::world::World;

use super::software::{Line, ToArm, listen, serve_rig, world};
use crate::{Scratch, assert_says};

const MARLIN: Kind = Kind::Marlin {
    emergency_parser: true,
};

/// The printer's end of its line. A person brings the finger to the other end of the sample before it is asked where
/// it is for the third time.
struct PrinterLine {
    to: ToArm,
    listener: TcpListener,
    client: Option<TcpStream>,
    heard: String,
    jogged: bool,
}

impl PrinterLine {
    fn exchange(&mut self, said: &[u8]) -> Vec<u8> {
        if let Ok((stream, _)) = self.listener.accept() {
            stream.set_nonblocking(true).unwrap();
            stream.set_nodelay(true).unwrap();
            self.client = Some(stream);
        }
        let mut bytes = [0; 1024];
        let Some(client) = &mut self.client else {
            return Vec::new();
        };
        let written = client.write_all(said);
        let came = match client.read(&mut bytes) {
            Err(why) if why.kind() == ErrorKind::WouldBlock => Ok(0),
            Ok(0) => Err(ErrorKind::UnexpectedEof.into()),
            came => came,
        };
        match written.and(came) {
            Ok(length) => bytes[..length].to_vec(),
            Err(_) => {
                self.client = None;
                Vec::new()
            }
        }
    }
}

impl Mover for PrinterLine {
    fn order(&mut self, order: ArmOrder) {
        self.to.said.borrow_mut().0.push(order);
    }

    fn force(&mut self, _newton: f64) {}

    fn tick(&mut self, world: &mut World) -> Vec<ArmReport> {
        let machine = world.printer().unwrap();
        let came = self.exchange(&machine.said());
        self.heard += &String::from_utf8_lossy(&came);
        if !self.jogged && self.heard.matches("M400").count() == 4 {
            self.jogged = true;
            machine.jog([74.0, 0.0, 0.3]);
        }
        machine.receive(&came);
        std::mem::take(&mut self.to.said.borrow_mut().1)
    }

    fn permit(&mut self, _world: &mut World, _permitted: bool) {}
}

/// Serves a probe whose finger hangs on a printer: its port, and the printer's. The rig's time goes into `clock`.
fn served(clock: File) -> (String, String) {
    let (probe, port) = listen();
    let (printer, printer_port) = listen();
    printer.set_nonblocking(true).unwrap();
    thread::spawn(move || {
        let bands = (Method::Fused, Some(FeatureSet::Bands));
        let setup = world().setup(10, 0);
        let calibration = calibrated(setup).unwrap();
        let table = world()
            .learn_at(&Collection::MOVEMENTS, bands, &[], calibration, || ())
            .unwrap();
        let to = ToArm::new(clock);
        let line = PrinterLine {
            to: to.clone(),
            listener: printer,
            client: None,
            heard: String::new(),
            jogged: false,
        };
        let rig = rig(world().setup(10, 3), MARLIN, Unguarded::default(), line);
        let streams = probe.incoming().map(|stream| {
            let stream = stream.unwrap();
            // the rig's time goes on while nothing comes
            stream.set_nodelay(true).unwrap();
            stream.set_nonblocking(true).unwrap();
            Box::new(stream) as Box<dyn Line>
        });
        let (asked, _told) = mpsc::channel();
        serve_rig(streams, rig, (&table, 1), asked, Some(to));
    });
    (port, printer_port)
}

#[test]
fn a_person_sets_a_printer_up_and_it_moves_the_finger() {
    let at = Scratch::new();
    let clock = at.path("clock");
    let (port, printer) = served(File::create(&clock).unwrap());
    let at = at.with("PORT", &port).with("PRINTER", &printer);
    let refused = at.error(
        "device identify --port PORT --printer PRINTER --printer-setup mine.json",
        1,
    );
    assert_says(
        &refused,
        &[
            "mine.json: no printer is set up yet",
            "tactus device printer setup",
        ],
    );
    let answered = |line: &str, answers: &str| {
        let mut command = at.command(line);
        let mut running = command
            .env("TACTUS_CLOCK", &clock)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        running
            .stdin
            .take()
            .unwrap()
            .write_all(answers.as_bytes())
            .unwrap();
        let ended = running.wait_with_output().unwrap();
        (
            ended.status.code(),
            String::from_utf8(ended.stdout).unwrap(),
        )
    };
    let setup = |answers| {
        let line = "device printer setup --port PORT --printer PRINTER --printer-setup mine.json";
        answered(line, answers)
    };
    // nothing moves, and nothing is kept, before the way is free
    let (code, said) = setup("n\n");
    assert!(
        code == Some(1) && !said.contains("It slides along"),
        "{said}"
    );
    assert!(!at.path("mine.json").exists() && !at.path("mine.json.part").exists());
    // the finger did not go up: it is mended, and the set-up goes on with the sample's place
    let (code, said) = setup("y\ny\nn\n");
    assert!(
        code == Some(1) && said.contains("It slides along X over 74 mm"),
        "{said}"
    );
    let (code, said) = setup("y\ny\ny\n");
    println!("{said}");
    assert_eq!(code, Some(0), "{said}");
    assert_says(
        &said,
        &[
            "Marlin with its emergency parser",
            "was left after step 3: the sample lies along X from 0.0 to 74.0 mm",
            "It has moved 5 mm",
            "Stiffness",
            "Kept in",
        ],
    );
    let shown = at.printed("device printer show --printer-setup mine.json");
    assert_says(
        &shown,
        &["slides along    X, 0.0 to 74.0 mm", "parked at       X"],
    );
    let json: serde_json::Value =
        serde_json::from_str(&at.printed("device printer show --json --printer-setup mine.json"))
            .unwrap();
    let of = |name: &str| json[name].as_f64().unwrap();
    // those of the world's printer
    assert!((of("acceleration_mm_s2") - 500.0).abs() < 60.0, "{json}");
    assert!((0.3..3.0).contains(&of("stiffness_n_mm")), "{json}");
    assert!(of("backlash_mm") < 0.2, "{json}");
    let line =
        "device identify --format json --seed 1 --port PORT --printer --printer-setup mine.json";
    let (code, said) = answered(line, "");
    // a table of another machine knows nothing of this one
    assert!(matches!(code, Some(0 | 3 | 4)), "{said}");
    let verdict: serde_json::Value = serde_json::from_str(&said).unwrap();
    assert!(
        verdict["verdict"]["slides"].as_u64() >= Some(1),
        "{verdict}"
    );
    let kept = std::fs::read_to_string(at.path("mine.json")).unwrap();
    assert!(kept.contains("\"parked\": ["), "{kept}");
    // the self-test has found nothing wrong; what is left of the first evening is by the printer
    let passed = |key: &str, points: &str| {
        format!(
            "{{\"step\":\"{key}\",\"at\":\"2026-11-29T19:30:00Z\",\"passed\":true,\"saw\":\"\",\
             \"mistakes\":[],\"points\":[{points}]}}\n"
        )
    };
    let journal: String = [
        "chip", "pins", "sensor", "noise", "finger", "store", "watchdog",
    ]
    .map(|key| passed(key, ""))
    .concat();
    let weighed = passed("scale", "[43,494.5],[85,977.5],[128,1472.0]");
    std::fs::create_dir(at.path("first")).unwrap();
    std::fs::write(at.path("first/journal.jsonl"), journal + &weighed).unwrap();
    let (code, said) = answered(
        "device bringup --report first --port PORT --printer --printer-setup mine.json",
        "\n\n",
    );
    println!("{said}");
    assert_eq!(code, Some(0), "{said}");
    assert_says(
        &said,
        &[
            "passed  zero",
            "force scale 11.50 mN a count",
            "passed  slide",
        ],
    );
}

#[test]
fn a_damaged_set_up_is_refused_before_anything_moves() {
    let at = Scratch::new();
    for (text, said) in [
        ("{}", "it is no set-up of a printer"),
        (
            "{\"version\": 1, \"port\": 3}",
            "it is no set-up of a printer",
        ),
        ("\u{0}\u{1}", "it is no set-up of a printer"),
    ] {
        std::fs::write(at.path("mine.json"), text).unwrap();
        let refused = at.error("device printer show --printer-setup mine.json", 1);
        assert_says(
            &refused,
            &["mine.json", said, "tactus device printer setup"],
        );
    }
}
