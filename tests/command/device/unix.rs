//! At a pseudo terminal: cables that are pulled, keys, the monitor.

use serialport::{SerialPort as _, TTYPort};

use super::*;

fn interrupt(child: &std::process::Child) {
    let id = child.id().to_string();
    let killed = Command::new("kill").args(["-INT", &id]).status().unwrap();
    assert!(killed.success());
}

/// Waits for a request.
fn wait_for(asked: &Told<wire::Command>, is: impl Fn(&wire::Command) -> bool) {
    let until = Instant::now() + Duration::from_secs(60);
    while let Ok(command) = asked.recv_timeout(until.saturating_duration_since(Instant::now())) {
        if is(&command) {
            return;
        }
    }
    panic!("never asked");
}

#[test]
fn ctrl_c_leaves_the_rig_lifted_and_stopped() {
    // slow enough to be in the middle of it
    let (at, asked) = probe(5);
    let identify = ["identify", "--port", &at];
    let child = device(&identify)
        .stderr(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    wait_for(&asked, |command| {
        matches!(command, wire::Command::Identify(_))
    });
    thread::sleep(Duration::from_millis(300));
    interrupt(&child);
    let out = child.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&out.stderr);
    assert_eq!(out.status.code(), Some(130), "{said}");
    assert_says(
        &said,
        &[
            "lifting the finger",
            "the finger is lifted and the stage stands",
        ],
    );
    wait_for(&asked, |command| *command == wire::Command::Stop);
    // the next host finds it so
    assert_says(
        &printed(&["status", "--port", &at]),
        &["rig             ready"],
    );
}

/// Whenever it comes: between two slides the rig is ready, and the training is not over yet.
#[test]
fn after_ctrl_c_in_a_training_the_probe_takes_the_next_request() {
    let (at, asked) = probe(20);
    for delay_ms in [20, 130, 290, 410, 560, 700] {
        let train = ["train", "cheese", "--trials", "5", "--port", &at];
        let mut command = device(&train);
        command.stderr(Stdio::piped()).stdout(Stdio::null());
        let child = command.spawn().unwrap();
        wait_for(&asked, |command| matches!(command, wire::Command::Train(_)));
        thread::sleep(Duration::from_millis(delay_ms));
        interrupt(&child);
        let out = child.wait_with_output().unwrap();
        let said = String::from_utf8_lossy(&out.stderr);
        assert_eq!(out.status.code(), Some(130), "{delay_ms}: {said}");
        printed(&["home", "--port", &at]);
    }
}

#[test]
fn a_recording_that_is_killed_goes_on_with_the_texture_it_was_at() {
    let (at, asked) = probe(200);
    let temp = tempfile::tempdir().unwrap();
    let folder = temp.path().join("slides");
    let record = ["record", "Burlap", "Silk", "--slides", "2", "--port", &at];
    // Enter, whenever it asks
    let start = || {
        let mut command = device(&record);
        command.args(["--out", path(&folder)]);
        command.stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = command.spawn().unwrap();
        child.stdin.take().unwrap().write_all(b"\n\n").unwrap();
        child
    };
    let mut child = start();
    for _ in 0..2 {
        wait_for(&asked, |command| {
            matches!(command, wire::Command::Identify(_))
        });
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let features = || {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tactus"));
        command.args(["features", "--format", "csv", "--recordings", path(&folder)]);
        command.output().unwrap()
    };
    let said = String::from_utf8(features().stderr).unwrap();
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
    let rows = String::from_utf8(features().stdout).unwrap();
    assert_eq!(rows.lines().count(), 5, "{rows}");
}

#[test]
fn a_second_ctrl_c_says_that_the_finger_may_be_down() {
    let sliding = says(&[
        || {
            Event::Status(Status {
                phase: Phase::Sliding,
                fault: None,
                textures: 3,
                table_bytes: 0,
                table_crc: 0,
                factory: true,
                calibrated: 0,
                counts: Counts::default(),
                skin_mj: (0, 0),
                false_alarm: None,
                high_force: false,
                finger: FingerCode::BIOTAC,
            })
        },
        || Event::Done(0),
    ]);
    let mut stop = device(&["stop", "--port", &sliding]);
    let child = stop.stderr(Stdio::piped()).spawn().unwrap();
    thread::sleep(Duration::from_secs(1));
    interrupt(&child);
    let out = child.wait_with_output().unwrap();
    assert_eq!(out.status.code(), Some(130));
    assert_says(
        &String::from_utf8_lossy(&out.stderr),
        &["may still be down", "emergency stop"],
    );
}

#[test]
fn a_serial_port_opens_and_a_busy_one_is_an_error() {
    known();
    // the other end of the terminal stays open, so that it lives on while nobody else has it
    let (mut master, slave) = TTYPort::pair().unwrap();
    let name = slave.name().unwrap();
    let mut holder = serialport::new(&name, 921_600).open_native().unwrap();
    assert_says(
        &complaint(&["status", "--port", &name]),
        &[&name, "is busy", "fuser"],
    );
    holder.set_exclusive(false).unwrap();
    drop(holder);
    master.set_timeout(Duration::from_millis(1)).unwrap();
    thread::spawn(move || serve(once(master), 1000, mpsc::channel().0));
    let status = printed(&["status", "--port", &name]);
    assert_says(&status, &[&name, "3 textures", "0 frames damaged"]);
}

/// Says why a test is skipped, where xtask looks for it.
fn skip(test: &str, why: &str) {
    eprintln!("SKIPPED {test}: {why}");
    if let Some(log) = std::env::var_os("TACTUS_SKIP_LOG") {
        let mut log = fs::OpenOptions::new()
            .create(true)
            .append(true)
            .open(log)
            .unwrap();
        log.write_all(format!("{test}: {why}\n").as_bytes())
            .unwrap();
    }
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
        let out = Command::new("tmux")
            .args(["-L", &self.0, "-f", "/dev/null"])
            .args(arguments)
            .output()
            .unwrap();
        String::from_utf8_lossy(&out.stdout).into_owned()
    }

    /// Waits until all of these are on the screen.
    fn shows(&self, parts: &[&str]) -> String {
        let until = Instant::now() + Duration::from_secs(60);
        loop {
            let screen = self.run(&["capture-pane", "-p", "-t", "probe"]);
            if parts.iter().all(|part| screen.contains(part)) {
                return screen;
            }
            assert!(Instant::now() < until, "{parts:?} not on\n{screen}");
            thread::sleep(Duration::from_millis(100));
        }
    }
}

#[test]
fn the_monitor_is_driven_in_a_terminal() {
    if Command::new("tmux").arg("-V").output().is_err() {
        return skip(
            "the_monitor_is_driven_in_a_terminal",
            "tmux is not installed",
        );
    }
    let (at, asked) = probe(20);
    let tmux = Tmux(format!("tactus-test-{}", std::process::id()));
    let command = format!(
        "{} device monitor --port {at} --threshold 1 --max-slides 200; echo ended with $?; sleep 60",
        env!("CARGO_BIN_EXE_tactus")
    );
    tmux.run(&[
        "new-session",
        "-d",
        "-s",
        "probe",
        "-x",
        "80",
        "-y",
        "24",
        &command,
    ]);
    let screen = tmux.shows(&[
        "Tactus",
        "phase   ready",
        "i: find out",
        "nothing lost",
        "s  stop",
    ]);
    assert!(
        screen.lines().all(|line| line.chars().count() <= 80),
        "{screen}"
    );
    tmux.run(&["send-keys", "-t", "probe", "i"]);
    tmux.shows(&["P_AC", "sliding"]);
    let screen = tmux.shows(&["slide 2: ", "█", "%", "slide 1: most likely"]);
    assert!(
        screen.contains("Burlap") || screen.contains(" N"),
        "{screen}"
    );
    // the trace has dots
    assert!(
        screen
            .chars()
            .any(|c| ('\u{2801}'..='\u{28ff}').contains(&c)),
        "{screen}"
    );
    tmux.run(&["resize-window", "-t", "probe", "-x", "140", "-y", "40"]);
    let screen = tmux.shows(&["q  quit"]);
    assert!(screen.lines().count() >= 39 && screen.lines().any(|line| line.chars().count() > 130));
    tmux.run(&["send-keys", "-t", "probe", "i"]);
    tmux.shows(&["it is busy: wait, or stop it with s"]);
    tmux.run(&["send-keys", "-t", "probe", "s"]);
    tmux.shows(&["the probe refused", "phase   ready"]);
    tmux.run(&["send-keys", "-t", "probe", "i"]);
    tmux.shows(&["phase   pressing"]);
    tmux.run(&["send-keys", "-t", "probe", "C-c"]);
    tmux.shows(&[
        "the finger is lifted and the stage stands",
        "ended with 130",
    ]);
    let stops = |asked: &Told<wire::Command>| {
        asked
            .try_iter()
            .filter(|command| *command == wire::Command::Stop)
            .count()
    };
    assert!(stops(&asked) >= 2);
    // and so does quitting, which is no failure
    tmux.run(&["respawn-pane", "-k", "-t", "probe", &command]);
    tmux.shows(&["phase   ready"]);
    tmux.run(&["send-keys", "-t", "probe", "q"]);
    tmux.shows(&["the finger is lifted and the stage stands", "ended with 0"]);
    assert!(stops(&asked) >= 1);
    drop(tmux);
}
