//! The firmware of a printer: lines of G-code in, words out, and a planner that it fills. Marlin with or without its
//! emergency parser, or Klipper behind its pseudo-terminal.

use std::collections::VecDeque;

use super::PrinterFault;
use super::planner::Planner;
use crate::conditions::TICKS_PER_S;
use crate::noise::Noise;

/// Time of a byte at 115,200 baud in ticks, and of a packet on USB, ms: least and most (chosen).
const BYTE_TICKS: f64 = 10.0 / 115_200.0 * TICKS_PER_S as f64;
const USB_MS: (f64, f64) = (0.3, 3.0);
/// Lines that wait to be carried out (Marlin: BUFSIZE).
const LINES: usize = 4;
/// Time between two words "busy" (Marlin: HOST_KEEPALIVE_INTERVAL), s.
const BUSY_S: f64 = 2.0;
/// Time that a first move waits for others behind it, ms (Marlin: BLOCK_DELAY_FOR_1ST_MOVE).
const FIRST_MOVE_MS: f64 = 100.0;
/// Time that a Klipper waits before a first move, ms: PRIMING_CMD_TIME and BUFFER_TIME_START, and some for its
/// processes (chosen). With `M400` behind it the former is left out.
const KLIPPER_MS: (f64, f64) = (350.0, 370.0);
/// It looks so often whether all is done, s.
const KLIPPER_LOOKS_S: f64 = 0.1;
/// Time for which a Marlin that was stopped refuses to move (cleaning_buffer_counter), s.
const CLEANS_S: f64 = 1.0;
/// Time for which one that was killed goes on (minkill), s.
const DIES_S: f64 = 0.6;

/// Kinds of firmware.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Kind {
    /// Marlin.
    Marlin {
        /// It looks for `M410` in what comes before it is that line's turn.
        emergency_parser: bool,
    },
    /// Klipper.
    Klipper,
    /// Something else, which says so.
    Unknown,
}

#[derive(Clone, Debug)]
pub(super) struct Firmware {
    kind: Kind,
    to_it: VecDeque<(u64, u8)>,
    from_it: VecDeque<(u64, u8)>,
    line: Vec<u8>,
    lines: VecDeque<String>,
    last: u32,
    absolute: bool,
    feed_mm_s: f64,
    offset: [f64; 3],
    /// A line whose answer comes when the planner is done.
    waits: bool,
    /// A move that found the planner full.
    moves: Option<String>,
    busy_until: u64,
    says_busy_at: u64,
    halted: bool,
    /// Tick at which the motors lose their current, and until which moves are refused.
    dies_at: u64,
    cleans_until: u64,
    pub(super) fan: bool,
    pub(super) misused: u32,
    lost: bool,
    resends: u32,
    ok_lost: f64,
    ok_twice: f64,
    damages: f64,
    ignores_stop: bool,
    late_ms: f64,
}

impl Firmware {
    pub(super) fn new(kind: Kind) -> Self {
        let mut firmware = Self {
            kind,
            to_it: VecDeque::new(),
            from_it: VecDeque::new(),
            line: Vec::new(),
            lines: VecDeque::new(),
            last: 0,
            absolute: true,
            feed_mm_s: 20.0,
            offset: [0.0; 3],
            waits: false,
            moves: None,
            busy_until: 0,
            says_busy_at: 0,
            halted: false,
            dies_at: u64::MAX,
            cleans_until: 0,
            fan: true,
            misused: 0,
            lost: false,
            resends: 0,
            ok_lost: 0.0,
            ok_twice: 0.0,
            damages: 0.0,
            ignores_stop: false,
            late_ms: 0.0,
        };
        firmware.greet(0);
        firmware
    }

    fn greet(&mut self, now: u64) {
        if self.kind != Kind::Klipper {
            self.say_at(now, "start\necho:Marlin bugfix-2.1.x\n");
        }
    }

    pub(super) fn reset(&mut self, now: u64) {
        let (kind, fan, misused, lost) = (self.kind, self.fan, self.misused, self.lost);
        *self = Self::new(kind);
        (self.fan, self.misused, self.lost) = (fan, misused, lost);
        self.from_it.clear();
        // the boot loader
        self.greet(now + u64::from(TICKS_PER_S));
    }

    pub(super) fn break_now(&mut self, fault: PrinterFault) {
        match fault {
            PrinterFault::LineLost => self.lost = true,
            PrinterFault::Resends(lines) => self.resends = lines,
            PrinterFault::OkLost(share) => self.ok_lost = share,
            PrinterFault::OkTwice(share) => self.ok_twice = share,
            PrinterFault::Damages(share) => self.damages = share,
            PrinterFault::IgnoresStop => self.ignores_stop = true,
            PrinterFault::Halts => (self.halted, self.dies_at) = (true, 0),
            PrinterFault::Late(ms) => self.late_ms = ms,
            _ => {}
        }
    }

    pub(super) fn busy_until(&mut self, tick: u64) {
        self.busy_until = tick;
    }

    fn arrives(&self, now: u64, noise: &mut Noise) -> f64 {
        let ms = noise.between(USB_MS.0, USB_MS.1) + self.late_ms;
        now as f64 + ms * 1e-3 * f64::from(TICKS_PER_S)
    }

    pub(super) fn receive(&mut self, bytes: &[u8], now: u64, noise: &mut Noise) {
        let last = self.to_it.back().map_or(0.0, |(at, _)| *at as f64);
        let mut at = self.arrives(now, noise).max(last);
        for &byte in bytes {
            at += BYTE_TICKS;
            let damaged = self.damages > 0.0 && noise.uniform() < self.damages;
            if !self.lost {
                self.to_it.push_back((at as u64, byte ^ u8::from(damaged)));
            }
        }
    }

    pub(super) fn said(&mut self, now: u64) -> Vec<u8> {
        let mut said = Vec::new();
        while let Some((_, byte)) = self.from_it.pop_front_if(|(at, _)| *at <= now) {
            if !self.lost {
                said.push(byte);
            }
        }
        said
    }

    fn say_at(&mut self, now: u64, text: &str) {
        let late = self.late_ms * 1e-3 * f64::from(TICKS_PER_S);
        let last = self.from_it.back().map_or(0, |(at, _)| *at) as f64;
        let mut at = (now as f64 + late).max(last);
        for byte in text.bytes() {
            at += BYTE_TICKS;
            self.from_it.push_back((at as u64, byte));
        }
    }

    fn ok(&mut self, now: u64, noise: &mut Noise) {
        if self.ok_lost > 0.0 && noise.uniform() < self.ok_lost {
            return;
        }
        self.say_at(now, "ok\n");
        if self.ok_twice > 0.0 && noise.uniform() < self.ok_twice {
            self.say_at(now, "ok\n");
        }
    }

    pub(super) fn tick(&mut self, now: u64, planner: &mut Planner, noise: &mut Noise) {
        while let Some((_, byte)) = self.to_it.pop_front_if(|(at, _)| *at <= now) {
            match byte {
                b'\n' | b'\r' => {
                    let line = std::mem::take(&mut self.line);
                    let line = String::from_utf8_lossy(&line).trim().to_owned();
                    if !line.is_empty() {
                        self.take(now, line, planner, noise);
                    }
                }
                byte => self.line.push(byte),
            }
        }
        planner.held = now < self.busy_until;
        if !self.halted {
            self.work(now, planner, noise);
        }
        planner.tick();
        if now >= self.dies_at {
            planner.stop();
        }
    }

    /// A whole line has come.
    fn take(&mut self, now: u64, line: String, planner: &mut Planner, noise: &mut Noise) {
        // what a byte stream is searched for; else a line that has no number, if there is room for it
        let early = match self.kind {
            Kind::Marlin { emergency_parser } => {
                emergency_parser || (line.starts_with('M') && self.lines.len() < LINES)
            }
            _ => true,
        };
        if early && line.contains("M112") {
            self.kill(now);
        } else if early && line.contains("M410") {
            self.quick_stop(now, planner);
        }
        if self.halted {
            return;
        }
        let Some(code) = self.checked(now, &line, noise) else {
            return;
        };
        if self.lines.len() < LINES || self.kind == Kind::Klipper {
            self.lines.push_back(code);
        }
    }

    fn kill(&mut self, now: u64) {
        (self.halted, self.waits) = (true, false);
        let goes_on_s = if self.kind == Kind::Klipper {
            0.0
        } else {
            DIES_S
        };
        self.dies_at = now + (goes_on_s * f64::from(TICKS_PER_S)) as u64;
        self.say_at(now, "Error:Printer halted. kill() called!\n");
    }

    fn quick_stop(&mut self, now: u64, planner: &mut Planner) {
        if !self.ignores_stop && self.kind != Kind::Klipper {
            planner.stop();
            self.cleans_until = now + (CLEANS_S * f64::from(TICKS_PER_S)) as u64;
        }
    }

    /// The line without number and checksum; `None` if it is asked for again.
    fn checked(&mut self, now: u64, line: &str, noise: &mut Noise) -> Option<String> {
        let (text, sum) = match line.rsplit_once('*') {
            Some((text, sum)) => (text, Some(sum.trim().parse::<u8>().ok())),
            None => (line, None),
        };
        let Some(rest) = text.strip_prefix('N') else {
            return Some(text.trim().to_owned());
        };
        let digits = rest
            .find(|c: char| !c.is_ascii_digit())
            .unwrap_or(rest.len());
        let (number, code) = rest.split_at(digits);
        let number: u32 = number.parse().unwrap_or(0);
        let code = code.trim().to_owned();
        if self.kind == Kind::Klipper {
            return Some(code);
        }
        let xor = text.bytes().fold(0, |sum, byte| sum ^ byte);
        let why = match sum.flatten() {
            None => Some("No Checksum with line number"),
            Some(sum) if sum != xor => Some("checksum mismatch"),
            _ if code.starts_with("M110") => None,
            _ if number != self.last + 1 => Some("Line Number is not Last Line Number+1"),
            _ if self.resends > 0 => Some("checksum mismatch"),
            _ => None,
        };
        match why {
            None => {
                self.last = number;
                Some(code)
            }
            Some(why) => {
                self.resends = self.resends.saturating_sub(1);
                let last = self.last;
                self.say_at(
                    now,
                    &format!("Error:{why}, Last Line: {last}\nResend: {}\n", last + 1),
                );
                // older ones, without the parser
                if matches!(
                    self.kind,
                    Kind::Marlin {
                        emergency_parser: false
                    }
                ) {
                    self.ok(now, noise);
                }
                None
            }
        }
    }

    fn work(&mut self, now: u64, planner: &mut Planner, noise: &mut Noise) {
        let blocked = self.waits || self.moves.is_some() || now < self.busy_until;
        if blocked && now >= self.says_busy_at {
            if self.says_busy_at > 0 && self.kind != Kind::Klipper {
                self.say_at(now, "echo:busy: processing\n");
            }
            self.says_busy_at = now + (BUSY_S * f64::from(TICKS_PER_S)) as u64;
        }
        if now < self.busy_until {
            return;
        }
        if self.waits {
            let looks = (KLIPPER_LOOKS_S * f64::from(TICKS_PER_S)) as u64;
            let looks_now = self.kind != Kind::Klipper || now.is_multiple_of(looks);
            if !planner.is_done() || !looks_now {
                return;
            }
            self.waits = false;
            self.ok(now, noise);
        }
        if let Some(line) = self.moves.take()
            && !self.go(now, &line, planner, noise)
        {
            self.moves = Some(line);
            return;
        }
        if blocked {
            self.says_busy_at = 0;
        }
        if let Some(line) = self.lines.pop_front() {
            self.carry_out(now, line, planner, noise);
        }
    }

    fn carry_out(&mut self, now: u64, line: String, planner: &mut Planner, noise: &mut Noise) {
        let klipper = self.kind == Kind::Klipper;
        let code = line.split_whitespace().next().unwrap_or_default();
        match code {
            "G0" | "G1" => {
                if !self.go(now, &line, planner, noise) {
                    self.moves = Some(line);
                }
                return;
            }
            "G4" | "M400" => {
                self.waits = true;
                if klipper && planner.waits > 0 {
                    planner.waits = planner.waits.saturating_sub(u64::from(TICKS_PER_S) / 10);
                }
                self.says_busy_at = now + (BUSY_S * f64::from(TICKS_PER_S)) as u64;
                return;
            }
            "G90" => self.absolute = true,
            "G91" => self.absolute = false,
            "G92" => {
                let end = planner.end();
                for (axis, to) in words(&line, ["X", "Y", "Z"]).into_iter().enumerate() {
                    self.offset[axis] = to.map_or(self.offset[axis], |to| to - end[axis]);
                }
            }
            "M114" => {
                let [x, y, z] = self.place(planner);
                self.say_at(
                    now,
                    &format!("X:{x:.2} Y:{y:.2} Z:{z:.2} E:0.00 Count X:0 Y:0 Z:0\n"),
                );
            }
            "M115" => {
                self.say_at(now, &self.identity());
                // its answer is in one line
                if klipper {
                    return;
                }
            }
            "M106" => self.fan = true,
            "M107" => self.fan = false,
            "M104" | "M109" | "M140" | "M190" | "G28" | "G29" => self.misused += 1,
            "M410" if klipper => self.say_at(now, "// Unknown command:\"M410\"\n"),
            // with the parser it was done already; else it is done again in its turn
            "M410"
                if matches!(
                    self.kind,
                    Kind::Marlin {
                        emergency_parser: true
                    }
                ) => {}
            "M410" => self.quick_stop(now, planner),
            "M112" => self.kill(now),
            "M110" => self.last = words(&line, ["N"])[0].unwrap_or_default() as u32,
            "M220" | "M204" | "M17" | "M18" | "M84" | "G21" | "M155" | "M82" | "M83" => {}
            other if klipper => self.say_at(now, &format!("// Unknown command:\"{other}\"\n")),
            other => self.say_at(now, &format!("echo:Unknown command: \"{other}\"\n")),
        }
        self.ok(now, noise);
    }

    fn identity(&self) -> String {
        match self.kind {
            Kind::Marlin { emergency_parser } => format!(
                "FIRMWARE_NAME:Marlin 2.1.2.4 (Nov 17 2023 12:00:00) SOURCE_CODE_URL:github.com/MarlinFirmware/Marlin \
                 PROTOCOL_VERSION:1.0 MACHINE_TYPE:Ender-3 EXTRUDER_COUNT:1 UUID:cede2a2f\n\
                 Cap:SERIAL_XON_XOFF:0\nCap:EMERGENCY_PARSER:{}\n",
                u8::from(emergency_parser)
            ),
            Kind::Klipper => {
                "ok FIRMWARE_NAME:Klipper FIRMWARE_VERSION:v0.12.0-85-gd785b396\n".into()
            }
            Kind::Unknown => "FIRMWARE_NAME:LaserWeb 3 (grbl)\n".into(),
        }
    }

    /// Where it will be, in its own frame.
    fn place(&self, planner: &Planner) -> [f64; 3] {
        let end = planner.end();
        [0, 1, 2].map(|axis| end[axis] + self.offset[axis])
    }

    /// Gives a move to the planner; false if that is full.
    fn go(&mut self, now: u64, line: &str, planner: &mut Planner, noise: &mut Noise) -> bool {
        if (planner.is_full() && self.kind != Kind::Klipper) || now < self.cleans_until {
            return false;
        }
        let place = self.place(planner);
        let mut to = place;
        for (axis, word) in words(line, ["X", "Y", "Z"]).into_iter().enumerate() {
            to[axis] = match (word, self.absolute) {
                (None, _) => place[axis],
                (Some(mm), true) => mm,
                (Some(mm), false) => place[axis] + mm,
            };
        }
        let [feed, extruded] = words(line, ["F", "E"]);
        self.misused += u32::from(extruded.is_some());
        self.feed_mm_s = feed.map_or(self.feed_mm_s, |mm_min| mm_min / 60.0);
        let first = planner.is_done();
        let to = [0, 1, 2].map(|axis| to[axis] - self.offset[axis]);
        planner.push(to, self.feed_mm_s);
        let wait_ms = match self.kind {
            Kind::Klipper => noise.between(KLIPPER_MS.0, KLIPPER_MS.1),
            _ => FIRST_MOVE_MS,
        };
        if first {
            planner.waits = (wait_ms * 1e-3 * f64::from(TICKS_PER_S)) as u64;
        } else if self.kind != Kind::Klipper && planner.blocks() >= 3 {
            planner.waits = planner.waits.min(1);
        }
        self.ok(now, noise);
        true
    }
}

/// The numbers behind these letters.
fn words<const N: usize>(line: &str, letters: [&str; N]) -> [Option<f64>; N] {
    letters.map(|letter| {
        let mut each = line.split_whitespace().skip(1);
        each.find_map(|word| word.strip_prefix(letter)?.parse().ok())
    })
}
