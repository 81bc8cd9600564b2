//! `tactus device bringup`: a new rig's first evening, with the self-test image.

use std::io::{self, BufRead as _, IsTerminal as _, Read as _, Write};
use std::path::PathBuf;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use anyhow::{Context as _, bail};
use tactus_core::wire::bringup::{Measure, Pin, Saw};
use tactus_core::wire::{Command, Report as ProbeReport, Reset};
use tactus_link::Request;
use tactus_link::bringup::{
    self, Board, Ended, Ends, Entry, Image, Journal, Line, Operator, Person, Probe, Product,
    Report, Step, Trouble, judge,
};

use super::bench::{Bench, BenchError, Interrupt};
use super::line::{Open, Where};
use crate::cmd::output::Format;
use crate::cmd::printed::{prompt as ask_for, say};
use tactus_lab::data::whole::NewOutputs;

/// Bring up a new rig: check its parts and wires step by step, and name what is wrong
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  cargo xtask flash --self-test            the image that measures; it stays on the board until it has passed
  tactus device bringup                    goes on where it stopped last time
  tactus device bringup --report rig2      another rig
  tactus device bringup --bare             a board without a rig: ten minutes, then a MCP3202 on a breadboard
  tactus device bringup --printer PORT     a finger on a 3D printer, up to its first slide

Answers are lines of the standard input: Enter for \"done\", a number, or the number of a choice; q ends it. Each
step that is over is kept in DIR/journal.jsonl; DIR/report.txt and report.json are to be sent to somebody who helps.
Ctrl-C stops whatever moves; the exit code is 130 then. It is 1 while a step has not passed.")]
pub(crate) struct Args {
    /// The board's serial port, or HOST:PORT; that of TACTUS_PORT, or the only NUCLEO that is plugged in, unless given
    #[arg(long, value_name = "PORT")]
    port: Option<String>,
    /// Folder of the journal and of the report
    #[arg(long, value_name = "DIR", default_value = "bringup")]
    report: PathBuf,
    /// Check a board without a rig: clocks, kernels, timers, flash, link, and a converter on a breadboard
    #[arg(long)]
    bare: bool,
    /// Check a handheld: display, button, buzzer and finger
    #[arg(long, conflicts_with = "bare")]
    handheld: bool,
    /// Check a probe on an arm: its finger
    #[arg(long, conflicts_with_all = ["bare", "handheld"])]
    arm: bool,
    /// Check a probe on a 3D printer with this port: its finger, then a slide; that of its set-up unless given
    #[arg(long, value_name = "PORT", num_args = 0..=1, default_missing_value = "")]
    #[arg(conflicts_with_all = ["bare", "handheld", "arm"])]
    printer: Option<String>,
    /// File of the printer's set-up, and not ~/.local/share/tactus/printer.json
    #[arg(long, value_name = "FILE", requires = "printer")]
    printer_setup: Option<PathBuf>,
}

/// A board that starts answers within this.
const STARTS: Duration = Duration::from_secs(60);
/// It asks for a squeeze for 30 s; the lever's longest way takes 8 s.
const ANSWERS: Duration = Duration::from_secs(40);
/// A question that moves nothing is asked again after this, so often.
const AGAIN: Duration = Duration::from_secs(4);
const TRIES: u32 = 3;
/// The board listens for a second when it starts.
const HELLO: Duration = Duration::from_millis(200);

pub(crate) fn run(how: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    let (mut made, path) = (NewOutputs::default(), how.report.join("journal.jsonl"));
    let begun = made.folder(&how.report);
    made.file(path.clone());
    let begun = begun.and_then(|()| Journal::open(&path));
    let mut journal = begun.with_context(|| format!("--report {}", how.report.display()))?;
    let interrupt = Interrupt::catch()?;
    let place = Where {
        port: how.port.clone(),
        printer: how.printer.clone(),
        printer_setup: how.printer_setup.clone(),
        log: None,
    };
    let mut person = Terminal {
        interrupt: interrupt.clone(),
        lines: lines(),
    };
    let product = match how {
        Args { bare: true, .. } => Product::Bare,
        Args { handheld: true, .. } => Product::Handheld,
        Args { arm: true, .. } => Product::Arm,
        Args {
            printer: Some(_), ..
        } => Product::Printer,
        _ => Product::Rig,
    };
    let done = if bringup::next_image(product, &journal) == Some(Image::Rig) {
        let (bench, _) = Bench::open(&place, Format::Text)?;
        let mut linked = Linked(bench);
        bringup::run(product, Ends::Rig(&mut linked), &mut person, &mut journal)
    } else {
        let open = place.open().map_err(BenchError::from)?;
        let mut board = Serial {
            open,
            line: Line::default(),
            interrupt,
            began: Instant::now(),
        };
        say(
            "Looking for the self-test. If nothing comes in a minute, press the board's black button.",
        );
        board
            .hello(STARTS)
            .and_then(|reset| reset.ok_or(Trouble::Silent))
            .and_then(|_| {
                let ends = Ends::SelfTest(&mut board);
                bringup::run(product, ends, &mut person, &mut journal)
            })
    };
    made.keep();
    let report = Report::new(product, &journal);
    report.write(&how.report)?;
    write!(out, "{}", report.text())?;
    out.flush()?;
    let folder = how.report.display();
    say(format_args!(
        "The report is in {folder}: report.txt and report.json."
    ));
    next(product, done.map_err(BenchError::BringUp)?)
}

/// Says what comes next; an error where a step has not passed.
fn next(product: Product, ended: Ended) -> anyhow::Result<()> {
    match ended {
        Ended::Passed if product == Product::Bare => {
            say("All steps have passed: the board is sound. Please send the report");
        }
        Ended::Passed if product == Product::Printer => say(
            "All steps have passed. Next: tactus device record NAME NAME --printer --out mine, for a table of this \
             machine",
        ),
        Ended::Passed if product != Product::Rig => say(
            "All steps have passed. Next: flash its own image (cargo xtask flash --help), then tactus device calibrate",
        ),
        Ended::Passed => {
            say("All steps have passed. Next: tactus device identify, or tactus device train");
        }
        Ended::Flash(_) if product == Product::Printer => say(
            "The self-test has done its part. Next: flash tactus-arm (cargo xtask size names its file, then tactus \
             device flash FILE), tactus device printer setup --printer PORT, and this command again: it slides once",
        ),
        Ended::Flash(_) => say(
            "The self-test has done its part. Next: cargo xtask flash, then the same command: the rig's firmware does \
             the last steps",
        ),
        Ended::Failed => bail!("a step has not passed; the same command runs it again"),
    }
    Ok(())
}

struct Linked(Bench);

impl Probe for Linked {
    fn ask(
        &mut self,
        command: Command,
        each: &mut dyn FnMut(&ProbeReport),
    ) -> Result<Result<(), String>, Trouble> {
        let probe = self.0.probe.clone();
        let done = probe.run(Request::command(command), |report| {
            each(report);
            Ok(())
        });
        match self.0.done(done, &mut io::sink()) {
            Ok(()) => Ok(Ok(())),
            Err(BenchError::Operation(why)) if why.refusal().is_some() => {
                Ok(Err(why.refusal().unwrap_or_default()))
            }
            Err(why) if why.is_interrupt() => Err(Trouble::Quit),
            Err(why) => Err(io::Error::other(why.to_string()).into()),
        }
    }
}

struct Serial {
    open: Open,
    line: Line,
    interrupt: Interrupt,
    began: Instant,
}

impl Serial {
    fn say(&mut self, measure: Measure) -> Result<(), Trouble> {
        let question = self.line.question(measure)?;
        self.open.line.write_all(&question)?;
        Ok(self.open.line.flush()?)
    }

    /// The answer, if it comes in time. Ctrl-C stops what moves.
    fn hear(&mut self, wait: Duration) -> Result<Option<Saw>, Trouble> {
        let until = Instant::now() + wait;
        let mut bytes = [0; 4096];
        while Instant::now() < until {
            if self.interrupt.take() {
                // whatever comes stops a motor
                self.say(Measure::Hello)?;
                return Err(Trouble::Quit);
            }
            match self.open.line.read(&mut bytes) {
                Ok(0) => return Err(io::Error::from(io::ErrorKind::UnexpectedEof).into()),
                Ok(n) => {
                    let received = bytes.get(..n).unwrap_or_default();
                    if let Some(saw) = self.line.receive(received)? {
                        return Ok(Some(saw));
                    }
                }
                Err(why) => match why.kind() {
                    io::ErrorKind::WouldBlock
                    | io::ErrorKind::TimedOut
                    | io::ErrorKind::Interrupted => {}
                    _ => return Err(why.into()),
                },
            }
        }
        Ok(None)
    }

    /// Asks a board that starts who it is, until it answers.
    fn hello(&mut self, wait: Duration) -> Result<Option<Reset>, Trouble> {
        let until = Instant::now() + wait;
        while Instant::now() < until {
            self.say(Measure::Hello)?;
            if let Some(Saw::Hello { reset, .. }) = self.hear(HELLO)? {
                // questions that it has not answered yet: their answers are of other numbers
                return Ok(Some(reset));
            }
        }
        Ok(None)
    }
}

impl Board for Serial {
    fn ask(&mut self, measure: Measure) -> Result<Saw, Trouble> {
        let moves = matches!(
            measure,
            Measure::Squeeze
                | Measure::Lever(_)
                | Measure::LeverTop
                | Measure::Stage(_)
                | Measure::Ramp
        );
        // a second question would stop what moves
        let (tries, wait) = if moves { (1, ANSWERS) } else { (TRIES, AGAIN) };
        for _ in 0..tries {
            self.say(measure)?;
            if let Some(saw) = self.hear(wait)? {
                return Ok(saw);
            }
        }
        Err(Trouble::Silent)
    }

    fn restart(&mut self, measure: Measure) -> Result<Option<Reset>, Trouble> {
        self.say(measure)?;
        self.hello(Duration::from_secs(10))
    }

    fn traffic(&self) -> [u32; 3] {
        self.line.traffic
    }

    fn times_ms(&self) -> [u64; 2] {
        [
            self.line.at_ms.into(),
            self.began.elapsed().as_millis() as u64,
        ]
    }
}

/// Who sits before the terminal.
struct Terminal {
    interrupt: Interrupt,
    lines: Receiver<io::Result<String>>,
}

/// Lines of the standard input, read in a thread of its own: Ctrl-C is seen meanwhile.
fn lines() -> Receiver<io::Result<String>> {
    let (read, lines) = mpsc::channel();
    std::thread::spawn(move || {
        for line in io::stdin().lock().lines() {
            if read.send(line).is_err() {
                break;
            }
        }
    });
    lines
}

impl Terminal {
    fn line(&mut self, prompt: &str) -> Result<String, Trouble> {
        ask_for(format_args!("  {prompt} "));
        loop {
            if self.interrupt.take() {
                return Err(Trouble::Quit);
            }
            match self.lines.recv_timeout(Duration::from_millis(50)) {
                Ok(line) => {
                    let line = line?.trim().to_owned();
                    if !io::stdin().is_terminal() {
                        say(&line);
                    }
                    return if line == "q" {
                        Err(Trouble::Quit)
                    } else {
                        Ok(line)
                    };
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Err(Trouble::Quit),
            }
        }
    }
}

impl Person for Terminal {
    fn done(&mut self, please: &str) -> Result<(), Trouble> {
        self.line(&format!("{please}; then Enter.")).map(|_| ())
    }

    fn watch(&mut self, please: &str) -> Result<(), Trouble> {
        self.line(&format!("{please} Enter starts it.")).map(|_| ())
    }

    fn show(&mut self, value: &str) -> Result<(), Trouble> {
        ask_for(format_args!("\r  {value} "));
        Ok(())
    }

    fn press(&mut self, switch: Pin, pressed: bool) -> Result<(), Trouble> {
        let place = judge::place(switch);
        self.done(&match pressed {
            true => format!("Press {place} by hand, and keep it pressed"),
            false => "Let it go".to_owned(),
        })
    }

    fn squeeze(&mut self) -> Result<(), Trouble> {
        say("  Squeeze the finger once between two fingers and lay it down, within 30 s.");
        Ok(())
    }

    fn choose(&mut self, question: &str, answers: &[&str]) -> Result<usize, Trouble> {
        loop {
            let choices = answers
                .iter()
                .zip(1..)
                .map(|(answer, n)| format!("{n} {answer}"));
            let choices = choices.collect::<Vec<_>>().join(", ");
            let line = self.line(&format!("{question} ({choices}):"))?;
            match line.parse() {
                Ok(n @ 1..) if n <= answers.len() => return Ok(n - 1),
                _ => say(format_args!("  a number from 1 to {}", answers.len())),
            }
        }
    }

    fn number(&mut self, question: &str, unit: &str) -> Result<f64, Trouble> {
        loop {
            let line = self.line(&format!("{question}, {unit}:"))?;
            match line.replace(',', ".").parse() {
                Ok(number) if f64::is_finite(number) => return Ok(number),
                _ => say(format_args!("  a number of {unit}")),
            }
        }
    }
}

impl Operator for Terminal {
    fn found(&mut self, step: &Step, entry: &Entry) -> Result<bool, Trouble> {
        let verdict = if entry.passed { "passed" } else { "FAILED" };
        say(format_args!("{verdict}  {}: {}", step.checks, entry.saw));
        for mistake in &entry.mistakes {
            let (what, remedy) = (&mistake.what, &mistake.remedy);
            say(format_args!("        {what}\n        what to do: {remedy}"));
        }
        Ok(entry.passed)
    }

    fn now(&self) -> String {
        let now = time::OffsetDateTime::now_utc();
        let (year, month, day) = now.to_calendar_date();
        let (hour, minute, second) = now.to_hms();
        let month = u8::from(month);
        format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}Z")
    }
}
