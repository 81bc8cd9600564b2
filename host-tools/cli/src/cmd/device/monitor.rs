//! `tactus device monitor`: the probe live on a terminal.
//!
//! [`Monitor`] is all that is known, from the reports alone; [`view`] draws it; [`run`] brings keys, reports and time
//! together.

mod state;
mod view;

use std::io::{self, IsTerminal as _};
use std::pin::Pin;
use std::sync::mpsc::{self, Receiver};
use std::task::Poll;
use std::time::{Duration, Instant};

use ratatui::DefaultTerminal;
use ratatui::crossterm::event::{self, KeyCode, KeyEvent, KeyModifiers};
use tactus_core::table::Table;
use tactus_core::wire::{Command, Identify, Report};
use tactus_link::lifting::Stopped;
use tactus_link::{LinkError, OperationError, PortError, Probe, Request};

use self::state::{Monitor, Weight};
use super::bench::{Bench, BenchError};
use super::identify::Args;
use crate::cmd::output::Format;
use crate::cmd::say;

/// Interval of the screen's drawings and of the status requests.
const DRAWN: Duration = Duration::from_millis(100);
const ASKED: Duration = Duration::from_secs(1);
/// The monitor asks for the status every second, and shows a probe as silent that says nothing for so long.
const SILENT: Duration = Duration::from_secs(3);
/// A probe that says nothing for so long is gone.
const GONE: Duration = Duration::from_secs(60);

/// The keys, in a word each.
const KEYS: [(&str, &str); 4] = [
    ("i", "identify"),
    ("h", "home"),
    ("s", "stop"),
    ("q", "quit"),
];

type Doing = Pin<Box<dyn Future<Output = Result<(), OperationError>>>>;

fn begin(probe: Probe, command: Command) -> Doing {
    Box::pin(async move { probe.get(Request::command(command)).await })
}

/// The command of a key; `Stop` may be given at any time.
fn command_of(key: KeyEvent, wanted: &Identify) -> Option<Command> {
    match key.code {
        KeyCode::Char('s') | KeyCode::Esc => Some(Command::Stop),
        KeyCode::Char('i') => Some(Command::Identify(wanted.clone())),
        KeyCode::Char('h') => Some(Command::Home),
        _ => None,
    }
}

/// The way in which a key ends the monitor.
fn end_of(key: KeyEvent) -> Option<End> {
    match key.code {
        KeyCode::Char('c') if key.modifiers.contains(KeyModifiers::CONTROL) => Some(End::Interrupt),
        KeyCode::Char('q') => Some(End::Quit),
        _ => None,
    }
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum End {
    Quit,
    Interrupt,
}

/// Watches until the user has enough of it; the rig is stopped and lifted then.
pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let (mut bench, status) = Bench::open(&args.at, Format::Text)?;
    let table = bench.table()?;
    let names = Table::read(&table)?.names().map(str::to_owned);
    let names: Vec<String> = names.collect();
    let wanted = args.wanted(&names, &status)?;
    if !io::stdout().is_terminal() {
        return Err(io::Error::other(
            "the monitor needs a terminal; `tactus device identify` writes lines, `--log FILE` a record",
        )
        .into());
    }
    let mut monitor = Monitor::new(&bench.name, status, names);
    // whatever happens, a panic too, the terminal is given back as it was
    let mut terminal = ratatui::try_init()?;
    let ended = watch(&mut bench, &mut monitor, &mut terminal, &wanted);
    // it may be gone; its drop would tell that on standard error, and panic where that is gone, too
    if terminal.show_cursor().is_err() {
        std::mem::forget(terminal);
    }
    let _ = ratatui::try_restore();
    let end = match ended {
        Ok(end) => end,
        Err(why @ BenchError::Operation(OperationError::Port { .. })) => return Err(why.into()),
        Err(why) => {
            // the line is good
            let _ = bench.lift();
            return Err(why.into());
        }
    };
    say("Stopping and lifting the finger (Ctrl-C: do not wait) ...");
    match (bench.lift()?, end) {
        (Stopped::Lifted, End::Quit) => {
            say("Stopped: the finger is lifted and the stage stands.");
            Ok(())
        }
        (came, _) => Err(BenchError::Operation(came.into()).into()),
    }
}

fn watch(
    bench: &mut Bench,
    monitor: &mut Monitor,
    terminal: &mut DefaultTerminal,
    wanted: &Identify,
) -> Result<End, BenchError> {
    let mut wanted = wanted.clone();
    let mut doing: Option<Doing> = None;
    let mut drawn: Option<Instant> = None;
    let mut asked: Option<Instant> = None;
    let mut heard = Instant::now();
    let probe = bench.probe.clone();
    let keys = keys();
    probe.send(Command::Stream(true))?;
    loop {
        if bench.interrupt.take() || is_gone(&io::stdout()) {
            return Ok(End::Interrupt);
        }
        let mut hear = |report: &Report| {
            heard = Instant::now();
            monitor.hear(report);
        };
        let polled = match &mut doing {
            Some(job) => bench.poll(job.as_mut(), &mut io::sink(), &mut hear),
            None => bench
                .listen(&mut hear)
                .map_or_else(|why| Poll::Ready(Err(why)), |()| Poll::Pending),
        };
        match polled {
            Poll::Ready(Ok(())) => doing = None,
            Poll::Pending => {}
            Poll::Ready(Err(BenchError::Operation(OperationError::Port {
                why: PortError::Link(why),
                ..
            }))) if !matches!(why, LinkError::Protocol(_) | LinkError::Foreign) => {
                // the probe said why, and goes on
                doing = None;
                monitor.note(Weight::Message, why.to_string());
            }
            Poll::Ready(Err(why)) => return Err(why),
        }
        if let Some(protocol) = monitor.protocol {
            let why = OperationError::Port {
                name: bench.name.clone(),
                why: PortError::Link(LinkError::Protocol(protocol)),
                moving: false,
            };
            return Err(why.into());
        }
        if std::mem::take(&mut monitor.rebooted) {
            probe.send(Command::Stream(true))?;
        }
        if asked.is_none_or(|at| at.elapsed() >= ASKED) {
            asked = Some(Instant::now());
            probe.send(Command::Status)?;
        }
        let silent = heard.elapsed();
        if silent >= GONE {
            let (name, why, moving) = (bench.name.clone(), PortError::Silent(GONE), false);
            return Err(OperationError::Port { name, why, moving }.into());
        }
        monitor.silent = Some(silent).filter(|silent| *silent >= SILENT);
        monitor.losses = probe.losses();
        if drawn.is_none_or(|at| at.elapsed() >= DRAWN) {
            drawn = Some(Instant::now());
            terminal.draw(|frame| view::draw(monitor, frame))?;
        }
        for key in keys.try_iter() {
            let key = key?;
            if let Some(end) = end_of(key) {
                return Ok(end);
            }
            match command_of(key, &wanted) {
                None => {}
                Some(Command::Stop) => {
                    probe.send(Command::Stop)?;
                    monitor.asked(&Command::Stop);
                }
                Some(_) if doing.is_some() => {
                    monitor.note(Weight::Message, "it is busy: wait, or stop it with s");
                }
                Some(command) => {
                    monitor.asked(&command);
                    doing = Some(begin(probe.clone(), command));
                    // the next one begins elsewhere on the sample
                    wanted.seed = wanted.seed.wrapping_add(1);
                }
            }
        }
    }
}

/// Keys, read in a thread of their own: where the terminal is gone, crossterm reads its end for ever.
fn keys() -> Receiver<io::Result<KeyEvent>> {
    let (pressed, keys) = mpsc::channel();
    std::thread::spawn(move || {
        let mut goes_on = true;
        while goes_on {
            let read = event::read();
            goes_on = read.is_ok();
            let key = read.map(|event| event.as_key_press_event()).transpose();
            goes_on &= key.is_none_or(|key| pressed.send(key).is_ok());
        }
    });
    keys
}

/// Returns true if the terminal has been closed.
#[cfg(unix)]
fn is_gone(terminal: &impl std::os::fd::AsFd) -> bool {
    use rustix::event::{PollFd, PollFlags, Timespec, poll};
    let mut polled = [PollFd::new(terminal, PollFlags::IN)];
    let now = Timespec::default();
    poll(&mut polled, Some(&now)).is_ok() && polled[0].revents().intersects(PollFlags::HUP)
}

#[cfg(not(unix))]
fn is_gone(_: &io::Stdout) -> bool {
    false
}

#[cfg(test)]
mod tests;
