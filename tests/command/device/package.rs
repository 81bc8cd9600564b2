//! The Python package at the probe in software. `cargo xtask test --step python` says which Python has it; without one
//! there is nothing to test here.

use std::process::{Command, Output};

use tactus_lab::sim::collection::texture_name;

use super::software::{Bench, UNKNOWN};

/// A user's session: everything that moves, at a probe of three textures with the second one under its finger.
const SESSION: &str = "
import json, sys
import numpy, tactus
with tactus.Probe(sys.argv[1], log=sys.argv[2]) as probe:
    assert probe.status()['phase'] == 'Ready', probe.status()
    events = [report['event'] for report in probe.identify(seed=7)]
    verdict = next(event['Verdict'] for event in events if 'Verdict' in event)
    table = probe.table()
    assert len(table) == 3 == probe.status()['textures']
    slides = probe.record('unknown', slides=2, seed=3)
    assert len(slides) == 2 and slides[0].texture == 'unknown', slides
    for slide in slides:
        features = slide.features()
        explorer = tactus.Explorer(table)
        explorer.update(features)
        assert explorer.best()['texture'] == verdict['name'], explorer
    for report in probe.identify(seed=8):
        if 'Chosen' in report['event']:
            break
    probe.stop()
    assert probe.status()['phase'] == 'Ready'
    assert probe.losses == (0, 0), probe.losses
    events = [report['event'] for report in probe.train('new one', trials=2, seed=4)]
    trained = [event['TrainingSlide']['left'] for event in events if 'TrainingSlide' in event]
    assert trained == list(range(len(table.settings) * 2))[::-1], trained
    assert probe.table().textures == [*table.textures, 'new one']
    print(json.dumps(verdict))
with_samples = [line['report']['event'] for line in tactus.read_log(sys.argv[2]) if 'report' in line]
assert any('SlideReport' in event for event in with_samples) and any('Block' in event for event in with_samples)
try:
    tactus.Probe(sys.argv[1], log=sys.argv[2])
except FileExistsError:
    pass
else:
    raise AssertionError('a log was written over')
";

#[test]
fn a_session_in_python_is_that_of_the_command() {
    let Some(python) = std::env::var_os("TACTUS_PYTHON") else {
        return;
    };
    let bench = Bench::new(1000);
    // before the session, for it teaches what lies under the finger by a second name
    let found = bench.json("identify --seed 7", 0);
    let mut session = Command::new(python);
    session
        .args(["-c", SESSION, &bench.port])
        .arg(bench.at.path("log"));
    session.env("XDG_RUNTIME_DIR", env!("CARGO_TARGET_TMPDIR"));
    let Output { stdout, stderr, .. } = session.output().unwrap();
    let said = String::from_utf8_lossy(&stderr);
    let verdict: serde_json::Value = serde_json::from_slice(&stdout).expect(&said);
    assert_eq!(verdict["name"], found["verdict"]["texture"]);
    assert_eq!(verdict["name"], texture_name(UNKNOWN));
    // the command reads what the package wrote
    bench.at.printed("device log log");
}

#[test]
fn the_live_example_plots_a_probe_while_it_explores() {
    let Some(python) = std::env::var_os("TACTUS_PYTHON") else {
        return;
    };
    let has = Command::new(&python)
        .args(["-c", "import matplotlib"])
        .output();
    if !has.is_ok_and(|has| has.status.success()) {
        tactus_tests::skipped("no matplotlib: pip install matplotlib");
        return;
    }
    let bench = Bench::new(1000);
    let example = concat!(env!("CARGO_MANIFEST_DIR"), "/../python/examples/live.py");
    let mut live = Command::new(python);
    live.args([example, &bench.port]);
    live.args(["live.png", "session.jsonl"].map(|name| bench.at.path(name)));
    live.env("XDG_RUNTIME_DIR", env!("CARGO_TARGET_TMPDIR"));
    let Output { stdout, stderr, .. } = live.output().unwrap();
    let said = String::from_utf8(stdout).unwrap();
    let why = String::from_utf8_lossy(&stderr);
    assert!(said.starts_with("slide 1 comes\n"), "{said}{why}");
    assert!(said.contains(texture_name(UNKNOWN)), "{said}{why}");
    assert!(bench.at.read("live.png").starts_with(b"\x89PNG"));
    let log = String::from_utf8(bench.at.read("session.jsonl"));
    assert!(log.unwrap().contains("Verdict"));
}
