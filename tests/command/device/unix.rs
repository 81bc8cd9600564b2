//! At a pseudo terminal: cables that are pulled, keys, the monitor.

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::{Shutdown, TcpStream};
use std::process::{Child, Command, Output, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, mpsc};
use std::thread;
use std::time::{Duration, Instant};

use serialport::{SerialPort as _, TTYPort};
use tactus_core::wire;

use super::software::{Bench, known, line, once, serve};
use crate::{Scratch, assert_says};

/// Starts a command, and presses Ctrl-C so long after a request.
fn interrupted(bench: &Bench, line: &str, asks: fn(&wire::Command) -> bool, ms: u64) -> String {
    let mut command = bench.command(line);
    command.stderr(Stdio::piped()).stdout(Stdio::null());
    let child = command.spawn().unwrap();
    bench.wait_for(asks);
    thread::sleep(Duration::from_millis(ms));
    interrupt(child)
}

fn press_ctrl_c(child: &Child) {
    let id = child.id().to_string();
    let killed = Command::new("kill").args(["-INT", &id]).status().unwrap();
    assert!(killed.success());
}

fn interrupt(child: Child) -> String {
    press_ctrl_c(&child);
    let Output { status, stderr, .. } = child.wait_with_output().unwrap();
    let said = String::from_utf8(stderr).unwrap();
    assert_eq!(status.code(), Some(130), "{said}");
    said
}

fn identifies(command: &wire::Command) -> bool {
    matches!(command, wire::Command::Identify(_))
}

#[test]
fn ctrl_c_leaves_the_rig_lifted_and_stopped() {
    // slow enough to be in the middle of it
    let bench = Bench::new(5);
    let said = interrupted(&bench, "identify", identifies, 300);
    assert_says(
        &said,
        &[
            "lifting the finger",
            "the finger is lifted and the stage stands",
        ],
    );
    bench.wait_for(|command| *command == wire::Command::Stop);
    // the next host finds it so
    assert_says(&bench.printed("status"), &["rig             ready"]);
}

/// Whenever it comes: between two slides the rig is ready, and the training is not over yet.
#[test]
fn after_ctrl_c_in_a_training_the_probe_takes_the_next_request() {
    let bench = Bench::new(20);
    for delay_ms in [20, 130, 290, 410, 560, 700] {
        let trains = |command: &wire::Command| matches!(command, wire::Command::Train(_));
        interrupted(&bench, "train cheese --trials 5", trains, delay_ms);
        bench.printed("home");
    }
}

#[test]
fn a_recording_that_is_killed_goes_on_with_the_texture_it_was_at() {
    let bench = Bench::new(200);
    // Enter, whenever it asks
    let start = || {
        let mut command = bench.command("record Burlap Silk --slides 2 --out slides");
        let mut child = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        child.stdin.take().unwrap().write_all(b"\n\n").unwrap();
        child
    };
    let mut child = start();
    bench.wait_for(identifies);
    bench.wait_for(identifies);
    child.kill().unwrap();
    child.wait().unwrap();
    let features = "features --format csv --recordings slides";
    let said = bench.at.run(features).said;
    assert_says(&said, &["not whole, by: tactus device record Burlap Silk"]);
    let out = start().wait_with_output().unwrap();
    assert!(out.status.success());
    let said = String::from_utf8(out.stdout).unwrap();
    assert_says(
        &said,
        &[
            "Burlap: its slides were recorded before",
            "4 slides of 2 textures",
        ],
    );
    assert_eq!(bench.at.printed(features).lines().count(), 5);
}

/// A finger that slides, and a line that then carries nothing any more.
#[test]
fn a_second_ctrl_c_says_that_the_finger_may_be_down() {
    let bench = Bench::new(5);
    let (cut, probe) = (Arc::new(AtomicBool::new(false)), bench.port.clone());
    let is_cut = Arc::clone(&cut);
    let between = line(move |host| {
        let probe = TcpStream::connect(probe.trim_start_matches("tcp:")).unwrap();
        let ends = [(&host, &probe), (&probe, &host)];
        thread::scope(|scope| {
            for (mut from, mut to) in ends {
                let is_cut = Arc::clone(&is_cut);
                scope.spawn(move || {
                    let mut bytes = [0; 1024];
                    while let Ok(length @ 1..) = from.read(&mut bytes) {
                        if !is_cut.load(Ordering::Relaxed) {
                            let _ = to.write_all(&bytes[..length]);
                        }
                    }
                    let _ = to.shutdown(Shutdown::Write);
                });
            }
        });
    });
    let at = Scratch::new().with("PORT", &between);
    let mut command = at.command("device identify --port PORT");
    command.stderr(Stdio::piped()).stdout(Stdio::null());
    let mut child = command.spawn().unwrap();
    bench.wait_for(identifies);
    cut.store(true, Ordering::Relaxed);
    press_ctrl_c(&child);
    // it has taken the first one before the second comes
    let mut said = BufReader::new(child.stderr.take().unwrap()).lines();
    let lifting = said.find(|line| line.as_ref().unwrap().contains("lifting the finger"));
    assert!(lifting.is_some());
    press_ctrl_c(&child);
    let rest: String = said.map(Result::unwrap).collect();
    assert_eq!(child.wait().unwrap().code(), Some(130), "{rest}");
    assert_says(&rest, &["may still be down", "emergency stop"]);
}

#[test]
fn a_serial_port_opens_and_a_busy_one_is_an_error() {
    known();
    // the other end of the terminal stays open, so that it lives on while nobody else has it
    let (mut master, slave) = TTYPort::pair().unwrap();
    let name = slave.name().unwrap();
    let at = Scratch::new().with("PORT", &name);
    let mut holder = serialport::new(&name, 921_600).open_native().unwrap();
    let said = at.error("device status --port PORT", 1);
    assert_says(&said, &[&name, "is busy", "fuser"]);
    holder.set_exclusive(false).unwrap();
    drop(holder);
    master.set_timeout(Duration::from_millis(1)).unwrap();
    thread::spawn(move || serve(once(master), 1000, mpsc::channel().0));
    let status = at.printed("device status --port PORT");
    assert_says(&status, &[&name, "3 textures", "0 frames damaged"]);
}

/// A terminal that is closed without a signal, as of a program in the background: its end is not read for ever.
#[test]
fn a_monitor_whose_terminal_or_probe_is_gone_ends() {
    let bench = Bench::new(20);
    let ends = |mut child: Child| {
        let until = Instant::now() + Duration::from_secs(40);
        loop {
            if let Some(ended) = child.try_wait().unwrap() {
                return ended.code();
            }
            if Instant::now() > until {
                child.kill().unwrap();
                panic!("it goes on");
            }
            thread::sleep(Duration::from_millis(50));
        }
    };
    let monitor = |at: &Scratch| {
        let (inherited, slave) = TTYPort::pair().unwrap();
        let name = slave.name().unwrap();
        // a copy is closed in the command, which would hold its own terminal open
        let master = inherited.try_clone_native().unwrap();
        drop(inherited);
        let open = || {
            let mut options = std::fs::OpenOptions::new();
            options.read(true).write(true).open(&name).unwrap()
        };
        let mut command = at.command("device monitor --port PORT");
        command.stdin(open()).stdout(open()).stderr(open());
        (command.spawn().unwrap(), master)
    };
    for ms in [0, 37, 111] {
        bench.asked();
        let (child, master) = monitor(&bench.at);
        bench.wait_for(|command| *command == wire::Command::Stream(true));
        thread::sleep(Duration::from_millis(ms));
        drop(master);
        assert!(matches!(ends(child), Some(1 | 130)), "{ms}");
    }
    // the cable is pulled
    let wait = Some(Duration::from_millis(1));
    let vanishing = line(move |stream| {
        let (asked, told) = mpsc::channel();
        stream.set_read_timeout(wait).unwrap();
        let cable = stream.try_clone().unwrap();
        thread::spawn(move || {
            while !matches!(told.recv(), Ok(wire::Command::Stream(true)) | Err(_)) {}
            let _ = cable.shutdown(Shutdown::Both);
        });
        serve(once(stream), 10, asked);
    });
    let (child, master) = monitor(&Scratch::new().with("PORT", vanishing));
    assert_eq!(ends(child), Some(1));
    drop(master);
}

/// A terminal that ends with the test.
struct Tmux(String);

impl Drop for Tmux {
    fn drop(&mut self) {
        self.run(&["kill-server"]);
    }
}

impl Tmux {
    fn run(&self, arguments: &[&str]) -> String {
        let mut tmux = Command::new("tmux");
        let out = tmux
            .args(["-L", &self.0, "-f", "/dev/null"])
            .args(arguments)
            .output();
        String::from_utf8_lossy(&out.unwrap().stdout).into_owned()
    }

    /// Waits until all of these are on the screen.
    fn shows(&self, parts: &[&str]) {
        let until = Instant::now() + Duration::from_secs(60);
        loop {
            let screen = self.run(&["capture-pane", "-p", "-t", "probe"]);
            if parts.iter().all(|part| screen.contains(part)) {
                return;
            }
            assert!(Instant::now() < until, "{parts:?} not on\n{screen}");
            thread::sleep(Duration::from_millis(100));
        }
    }

    fn key(&self, key: &str) {
        self.run(&["send-keys", "-t", "probe", key]);
    }
}

#[test]
fn the_monitor_is_driven_in_a_terminal() {
    if Command::new("tmux").arg("-V").output().is_err() {
        return tactus_tests::skipped("tmux is not installed");
    }
    let bench = Bench::new(20);
    let tmux = Tmux(format!("tactus-test-{}", std::process::id()));
    let command = format!(
        "{} device monitor --port {} --threshold 1 --max-slides 200; echo ended with $?; sleep 60",
        env!("CARGO_BIN_EXE_tactus"),
        bench.port
    );
    let size = ["-x", "100", "-y", "30"];
    tmux.run(
        &[
            &["new-session", "-d", "-s", "probe"],
            &size[..],
            &[&command],
        ]
        .concat(),
    );
    tmux.shows(&["Tactus", "phase   ready", "nothing lost"]);
    tmux.key("i");
    tmux.shows(&["sliding"]);
    tmux.shows(&["slide 2: ", "█", "%", "slide 1: most likely"]);
    tmux.key("s");
    tmux.shows(&["the probe refused", "phase   ready"]);
    tmux.key("i");
    tmux.shows(&["phase   pressing"]);
    tmux.key("C-c");
    tmux.shows(&[
        "the finger is lifted and the stage stands",
        "ended with 130",
    ]);
    let stops = |c: &&wire::Command| **c == wire::Command::Stop;
    assert!(bench.asked().iter().filter(stops).count() >= 2);
    // and so does quitting, which is no failure
    tmux.run(&["respawn-pane", "-k", "-t", "probe", &command]);
    tmux.shows(&["phase   ready"]);
    tmux.key("q");
    tmux.shows(&["the finger is lifted and the stage stands", "ended with 0"]);
    assert!(bench.asked().iter().filter(stops).count() >= 1);
}
