//! A probe in software: the simulated rig under the core's own probe behind the frames of the link.

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::fs::File;
use std::io::{ErrorKind, Read, Seek as _, Write};
use std::net::{TcpListener, TcpStream};
use std::process::Command;
use std::rc::Rc;
use std::sync::OnceLock;
use std::sync::mpsc::{self, Receiver as Told, Sender};
use std::thread;
use std::time::{Duration, Instant};

use serde_json::Value;
use tactus_core::dsp::Plan;
use tactus_core::explorer::Method;
use tactus_core::probe::seams::{Panel, RigHandle as _};
use tactus_core::probe::servo_rig::Servo as _;
use tactus_core::probe::{RigState, TableInUse, Turn, Watch, receive};
use tactus_core::rig::arm::{ArmOrder, ArmReport};
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::rig::skin::SkinCare;
use tactus_core::sensor::FingerCode;
use tactus_core::wire::{self, Counts, Event, MAX_FRAME, Receiver, Report, Request};
use tactus_lab::sim::collection::{Collection, calibrated};
use tactus_lab::sim::flash::{RamFlash, TABLE};
use tactus_lab::sim::probe::{self, Driven, Host};
use tactus_lab::sim::rig::SimRig;

use crate::Scratch;

/// A probe in software, the commands that it gets, and a folder for commands at its port.
pub(super) struct Bench {
    pub(super) at: Scratch,
    pub(super) port: String,
    asked: Told<wire::Command>,
}

impl Bench {
    /// The probe makes so many ms of its time between two looks at the line.
    pub(super) fn new(hurry: u64) -> Self {
        // before anybody waits for it
        known();
        let (to, asked) = mpsc::channel();
        let (listener, port) = listen();
        thread::spawn(move || {
            let streams = listener.incoming().map(|stream| {
                let stream = stream.unwrap();
                let wait = Some(Duration::from_millis(1));
                stream.set_read_timeout(wait).unwrap();
                Box::new(stream) as Box<dyn Line>
            });
            serve(streams, hurry, to);
        });
        let at = Scratch::new().with("PORT", &port);
        Self { at, port, asked }
    }

    fn line(line: &str) -> String {
        format!("device {line} --port PORT")
    }

    pub(super) fn command(&self, line: &str) -> Command {
        self.at.command(&Self::line(line))
    }

    pub(super) fn printed(&self, line: &str) -> String {
        self.at.printed(&Self::line(line))
    }

    pub(super) fn json(&self, line: &str, code: i32) -> Value {
        self.at.json(&Self::line(line), code)
    }

    pub(super) fn error(&self, line: &str) -> String {
        self.at.error(&Self::line(line), 1)
    }

    /// The commands since the last call.
    pub(super) fn asked(&self) -> Vec<wire::Command> {
        self.asked.try_iter().collect()
    }

    pub(super) fn wait_for(&self, is: impl Fn(&wire::Command) -> bool) {
        let until = Instant::now() + Duration::from_secs(60);
        let left = || until.saturating_duration_since(Instant::now());
        while !is(&self.asked.recv_timeout(left()).expect("never asked")) {}
    }
}

pub(super) const UNKNOWN: u8 = 47;

pub(super) fn world() -> Collection {
    Collection::new(5, vec![10, UNKNOWN, 100], 3)
}

/// Calibration and table of a probe for that world; learned once.
pub(super) fn known() -> &'static (RigCalibration, Vec<u8>) {
    static KNOWN: OnceLock<(RigCalibration, Vec<u8>)> = OnceLock::new();
    KNOWN.get_or_init(|| {
        let calibration = calibrated(world().setup(10, 0)).unwrap();
        let table = world().learn(Method::Fused, calibration, || ()).unwrap();
        (calibration, table)
    })
}

pub(super) trait Line: Read + Write + Send {}
impl<T: Read + Write + Send> Line for T {}

/// The probe's end of the line.
pub(super) struct Wire {
    line: Box<dyn Line>,
    receiver: Receiver,
    number: u16,
    at_ms: u64,
    /// ms of the rig's time between two looks at the line, each of which takes a real one
    hurry: u64,
    watch: Watch,
    rig: RigState,
    table: TableInUse,
    streams: bool,
    /// stop in this millisecond; and until the request is over
    stop: bool,
    stopped: bool,
    busy: bool,
    requests: VecDeque<Request>,
    /// all commands that came, for the test
    asked: Sender<wire::Command>,
    gone: bool,
    /// what is said to the arm that moves its finger, and by it
    pub(super) arm: Option<ToArm>,
}

/// Orders to an arm, and its reports; the rig's time, which goes no faster than a clock, and where it is told: the
/// command goes by it, so that a busy PC makes nothing late.
#[derive(Clone)]
pub(super) struct ToArm {
    pub(super) said: Rc<RefCell<(Vec<ArmOrder>, Vec<ArmReport>)>>,
    began: Rc<Cell<Instant>>,
    clock: Rc<File>,
}

impl ToArm {
    pub(super) fn new(clock: File) -> Self {
        Self {
            said: Rc::default(),
            began: Rc::new(Cell::new(Instant::now())),
            clock: Rc::new(clock),
        }
    }

    fn pace(&self, now: Duration) {
        let ns = now.as_nanos() as u64;
        (&*self.clock).rewind().unwrap();
        (&*self.clock).write_all(&ns.to_le_bytes()).unwrap();
        let elapsed = self.began.get().elapsed();
        match now.checked_sub(elapsed) {
            Some(ahead) => thread::sleep(ahead),
            // what is lost is not caught up
            None => self.began.set(self.began.get() + (elapsed - now)),
        }
    }
}

impl Wire {
    /// Takes in what has come, and answers what can be answered at any time.
    fn look(&mut self) {
        let mut bytes = [0; 1024];
        let length = match self.line.read(&mut bytes) {
            Ok(0) => return self.gone = true,
            Ok(length) => length,
            Err(why) => {
                let nothing = [ErrorKind::WouldBlock, ErrorKind::TimedOut];
                return self.gone |= !nothing.contains(&why.kind());
            }
        };
        for &byte in &bytes[..length] {
            let Some(request) = self.receiver.push::<Request>(byte) else {
                continue;
            };
            let request = request.unwrap();
            let _ = self.asked.send(request.command.clone());
            let busy = self.busy || !self.requests.is_empty();
            if receive(&request, busy, self) == Turn::Queue {
                self.requests.push_back(request);
            }
        }
    }
}

impl Panel for Wire {
    fn finger(&self) -> FingerCode {
        FingerCode::BIOTAC
    }

    fn rig(&self) -> RigState {
        self.rig
    }

    fn table(&self) -> TableInUse {
        self.table
    }

    fn counts(&self) -> Counts {
        Counts {
            slots: (self.at_ms * 22 / 5) as u32,
            ..Counts::default()
        }
    }

    fn stop(&mut self, all: bool) {
        self.stop = true;
        self.stopped |= all;
    }

    fn stream(&mut self, on: bool) {
        self.streams = on;
    }

    fn arm(&mut self, report: ArmReport) -> bool {
        let arm = self.arm.as_ref();
        arm.map(|arm| arm.said.borrow_mut().1.push(report))
            .is_some()
    }

    fn tell(&mut self, tell: Event) {
        let report = Report {
            number: self.number,
            at_ms: self.at_ms as u32,
            event: tell,
        };
        self.number = self.number.wrapping_add(1);
        let mut buffer = [0; MAX_FRAME + 1];
        let frame = wire::encode(&report, &mut buffer).unwrap();
        self.gone |= self.line.write_all(frame).is_err();
    }
}

impl Host for Wire {
    fn tell(&mut self, event: Event) {
        Panel::tell(self, event);
    }

    fn table(&mut self, table: TableInUse) {
        self.table = table;
    }

    fn tick(&mut self, now: Duration, rig: &RigState) {
        self.at_ms = now.as_millis() as u64;
        self.rig = *rig;
        if self.at_ms.is_multiple_of(Watch::EVERY_MS) {
            let mut watch = self.watch;
            match self.arm {
                Some(_) => watch.look_for_arm(rig, |event| Panel::tell(self, event)),
                None => watch.look(rig, |event| Panel::tell(self, event)),
            }
            self.watch = watch;
        }
        if let Some(arm) = self.arm.clone() {
            let orders = std::mem::take(&mut arm.said.borrow_mut().0);
            for order in orders {
                Panel::tell(self, Event::Arm(order));
            }
            self.look();
            return arm.pace(now);
        }
        if self.at_ms.is_multiple_of(self.hurry) {
            self.look();
            thread::sleep(Duration::from_millis(1));
        }
    }

    fn stops(&mut self) -> bool {
        std::mem::take(&mut self.stop)
    }

    fn is_stopped(&self) -> bool {
        self.stopped
    }

    fn streams(&self) -> bool {
        self.streams
    }
}

/// Serves one host after the other.
pub(super) fn serve(
    lines: impl IntoIterator<Item = Box<dyn Line>>,
    hurry: u64,
    asked: Sender<wire::Command>,
) {
    let (calibration, factory) = known();
    let mut rig = SimRig::new(world().setup(UNKNOWN, 100));
    rig.control().calibrate(*calibration).unwrap();
    rig.home().unwrap();
    serve_rig(lines, rig, (factory, hurry), asked, None);
}

/// The same with this rig.
pub(super) fn serve_rig<R: Driven>(
    lines: impl IntoIterator<Item = Box<dyn Line>>,
    mut rig: R,
    (factory, hurry): (&[u8], u64),
    asked: Sender<wire::Command>,
    arm: Option<ToArm>,
) {
    let is_ours = arm.is_none();
    let wire = RefCell::new(Wire {
        arm,
        line: Box::new(std::io::empty()),
        receiver: Receiver::default(),
        number: 0,
        at_ms: 0,
        hurry,
        watch: Watch::default(),
        rig: rig.state(None),
        table: TableInUse::NONE,
        streams: false,
        stop: false,
        stopped: false,
        busy: false,
        requests: VecDeque::new(),
        asked,
        gone: false,
    });
    let (mut buffer, plan) = (vec![0; TABLE], Plan::new());
    let flash = RamFlash::blank();
    let probe = probe::switch_on(rig, flash, factory, &mut buffer, &plan, &wire);
    let mut probe = probe.unwrap();
    if is_ours {
        embassy_futures::block_on(probe.rig.set_skin(SkinCare::after(1.5, 0.25)));
    }
    for line in lines {
        wire.borrow_mut().line = line;
        wire.borrow_mut().gone = false;
        while !wire.borrow().gone {
            wire.borrow_mut().look();
            if is_ours {
                thread::sleep(Duration::from_millis(1));
            }
            let request = wire.borrow_mut().requests.pop_front();
            let Some(request) = request else {
                probe.rig.servo.tick();
                continue;
            };
            wire.borrow_mut().busy = true;
            embassy_futures::block_on(probe.serve(&request));
            let mut wire = wire.borrow_mut();
            (wire.busy, wire.stopped) = (false, false);
            // its finger really is in the air
            assert!(!is_ours || probe.rig.servo.state().force_mn < 50.0);
        }
    }
}

pub(super) fn listen() -> (TcpListener, String) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let at = format!("tcp:{}", listener.local_addr().unwrap());
    (listener, at)
}

/// One host, on this line.
pub(super) fn once(line: impl Line + 'static) -> [Box<dyn Line>; 1] {
    [Box::new(line)]
}

/// Somebody on a TCP port of its own, one host after the other.
pub(super) fn line(answer: impl Fn(TcpStream) + Send + 'static) -> String {
    let (listener, at) = listen();
    thread::spawn(move || {
        for stream in listener.incoming() {
            answer(stream.unwrap());
        }
    });
    at
}
