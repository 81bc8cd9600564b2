//! What each second of an exploration goes to, medians over many seeds: `cargo xtask emulate --timeline`.
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context as _, Result, ensure};
use serde_json::{Value, json};

use crate::seeds::board::median_and_worst;
use crate::shell::{self, target};
use crate::{emulate, firmware};

/// Seeds of a timeline.
const SEEDS: u64 = 20;
/// The parts in their order, whether they are of the way to ready, and their colours.
const PARTS: [(&str, bool, &str); 12] = [
    ("boot", true, "#8d99ae"),
    ("self-check", true, "#6c7a89"),
    ("homing", true, "#457b9d"),
    ("stage", false, "#a8dadc"),
    ("zero", false, "#e9c46a"),
    ("approach", false, "#f4a261"),
    ("settle", false, "#e76f51"),
    ("still", false, "#b56576"),
    ("reaction", false, "#cdb4db"),
    ("slide", false, "#2a9d8f"),
    ("lift", false, "#90be6d"),
    ("decision", false, "#264653"),
];

/// One kind of probe: its name, the emulator's run and the firmware.
struct Probe {
    name: &'static str,
    run: &'static str,
    image: &'static str,
    since: &'static str,
}

const PROBES: [Probe; 2] = [
    Probe {
        name: "rig",
        run: "identify",
        image: emulate::RIG,
        since: "command",
    },
    Probe {
        name: "handheld",
        run: "handheld",
        image: emulate::HANDHELD,
        since: "touch",
    },
];

/// `cargo xtask emulate`: a timeline where one is asked for, or a run.
pub(crate) fn emulate(options: &[OsString]) -> Result<()> {
    let Some(file) = emulate::value(options, "--timeline") else {
        return emulate::emulate(options);
    };
    let others = options.iter().filter(|option| {
        let option = option.to_string_lossy();
        !option.starts_with("--timeline") && option != file
    });
    timeline(&file, &others.cloned().collect::<Vec<_>>())
}

/// Runs the seeds of both probes; draws the medians into `file`, and writes them beside it as JSON.
pub(crate) fn timeline(file: &str, options: &[OsString]) -> Result<()> {
    ensure!(
        options.is_empty(),
        "--timeline runs seeds 1 to {SEEDS} of rig and handheld, and takes no other option"
    );
    let file = Path::new(file);
    shell::run(&mut emulate::build())?;
    let mut all = serde_json::Map::new();
    for probe in &PROBES {
        let image = firmware::image_for(probe.image, None)?;
        let elf = firmware::compile(&[&image])?.remove(0);
        let runs = run(probe, &elf)?;
        all.insert(probe.name.to_owned(), summary(&runs)?);
    }
    let all = Value::Object(all);
    let beside = file.with_extension("json");
    std::fs::write(file, draw(&all)).with_context(|| file.display().to_string())?;
    std::fs::write(&beside, format!("{all:#}\n")).with_context(|| beside.display().to_string())?;
    for probe in &PROBES {
        println!("{}", sentence(probe, &all[probe.name]));
    }
    println!("{} {}", file.display(), beside.display());
    Ok(())
}

/// What every seed says.
fn run(probe: &Probe, elf: &Path) -> Result<Vec<Value>> {
    println!("{}, seeds 1 to {SEEDS}", probe.name);
    let program = PathBuf::from(emulate::program(probe.run).get_program());
    let seeds: Vec<u64> = (1..=SEEDS).collect();
    let said = shell::each_of(&seeds, shell::cores(), |seed| {
        let mut command = Command::new(&program);
        command
            .args([probe.run, "--format", "json", "--elf"])
            .arg(elf)
            .args(["--seed", &seed.to_string()]);
        command.env("RAYON_NUM_THREADS", "1").current_dir(target());
        let output = command.output().context("cannot start the emulator")?;
        let stdout = String::from_utf8_lossy(&output.stdout);
        let line = stdout.lines().last().unwrap_or_default();
        serde_json::from_str(line).with_context(|| {
            let why = String::from_utf8_lossy(&output.stderr);
            format!("{} of seed {seed} failed: {why}", probe.name)
        })
    });
    said.into_iter().collect()
}

/// Medians and worst of the runs that one slide decided, of the parts and of both times; a part that a run does not have took none.
fn summary(runs: &[Value]) -> Result<Value> {
    let one: Vec<&Value> = runs.iter().filter(|run| run["slides"] == 1).collect();
    let of = |runs: &[&Value], key: &str| -> Vec<f64> {
        runs.iter().filter_map(|run| run[key].as_f64()).collect()
    };
    let all: Vec<&Value> = runs.iter().collect();
    let ready = of(&all, "seconds_to_ready");
    let verdict = of(&one, "seconds_to_verdict");
    ensure!(
        ready.len() == runs.len() && !verdict.is_empty(),
        "no run came from power-up to a verdict with one slide"
    );
    for part in runs
        .iter()
        .filter_map(|run| run["timeline"].as_object())
        .flat_map(|parts| parts.keys())
    {
        ensure!(
            PARTS.iter().any(|(known, ..)| known == part),
            "the emulator says what {part} took, which has no place in the picture: add it to PARTS"
        );
    }
    let times = |seconds| {
        let (median, worst) = median_and_worst(seconds)?;
        Some(json!({"median": round(median), "worst": round(worst)}))
    };
    let parts = PARTS.iter().filter_map(|(part, to_ready, _)| {
        let runs = if *to_ready { &all } else { &one };
        let each = runs.iter().map(|run| run["timeline"][part].as_f64());
        let (seconds, _) = median_and_worst(each.map(Option::unwrap_or_default).collect())?;
        (seconds > 0.0).then(|| ((*part).to_owned(), round(seconds)))
    });
    let parts: BTreeMap<String, f64> = parts.collect();
    Ok(json!({
        "seeds": runs.len(),
        "with_one_slide": one.len(),
        "seconds_to_ready": times(ready),
        "seconds_to_verdict": times(verdict),
        "parts": parts,
    }))
}

/// To a hundredth.
fn round(seconds: f64) -> f64 {
    (seconds * 100.0).round() / 100.0
}

fn sentence(probe: &Probe, summary: &Value) -> String {
    let [ready, verdict] = ["seconds_to_ready", "seconds_to_verdict"].map(|key| &summary[key]);
    format!(
        "{}: ready {} s after power-up (worst {} s); with one slide, verdict {} s after the {} (worst {} s), median over {} of {} seeds",
        probe.name,
        ready["median"],
        ready["worst"],
        verdict["median"],
        probe.since,
        verdict["worst"],
        summary["with_one_slide"],
        summary["seeds"],
    )
}

/// A bar for each probe and each of the two times, a second everywhere as wide, with the parts named below.
fn draw(all: &Value) -> String {
    const LEFT: f64 = 170.0;
    const WIDTH: f64 = 530.0;
    const BAR: f64 = 22.0;
    let bars = PROBES.iter().flat_map(|probe| {
        let parts = &all[probe.name]["parts"];
        [true, false].map(|to_ready| {
            let name = if to_ready {
                format!("{}: power-up to ready", probe.name)
            } else {
                format!("{}: {} to verdict", probe.name, probe.since)
            };
            let of = PARTS.iter().filter(|part| part.1 == to_ready);
            let of =
                of.filter_map(|(part, _, colour)| Some((*part, *colour, parts[*part].as_f64()?)));
            (name, of.collect::<Vec<_>>())
        })
    });
    let bars: Vec<_> = bars.collect();
    let length =
        |parts: &[(&str, &str, f64)]| parts.iter().map(|(_, _, seconds)| seconds).sum::<f64>();
    let longest = bars
        .iter()
        .map(|(_, parts)| length(parts))
        .fold(1.0, f64::max);
    let every = if longest > 12.0 { 2.0 } else { 1.0 };
    let end = (longest / every).ceil() * every;
    let x = |seconds: f64| LEFT + seconds / end * WIDTH;
    let bottom = 30.0 + 34.0 * bars.len() as f64;
    let mut svg = format!(
        r##"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 760 {:.0}" font-family="sans-serif" font-size="12">
<title>What each second goes to</title>
<style>.g{{stroke:#ddd}}.a{{font-size:10px;text-anchor:middle}}.w{{font-size:10px;text-anchor:middle;fill:#fff;stroke:#000;stroke-width:2px;paint-order:stroke}}</style>
<rect width="760" height="{:.0}" fill="#fff"/>
<text x="8" y="18">What each second goes to: medians over {SEEDS} seeds, to the verdict of those that one slide decided</text>
"##,
        bottom + 64.0,
        bottom + 64.0
    );
    let mut second = 0.0;
    while second <= end {
        let at = x(second);
        let _ = writeln!(
            svg,
            r#"<path class="g" d="M{at:.1} 26V{bottom:.0}"/><text class="a" x="{at:.1}" y="{:.0}">{second} s</text>"#,
            bottom + 12.0
        );
        second += every;
    }
    for ((name, parts), row) in bars.iter().zip(0u8..) {
        let top = 32.0 + 34.0 * f64::from(row);
        let middle = top + BAR / 2.0 + 4.0;
        let _ = writeln!(svg, r#"<text x="8" y="{middle:.0}">{name}</text>"#);
        let mut from = 0.0;
        for (part, colour, seconds) in parts {
            let (left, right) = (x(from), x(from + seconds));
            let _ = writeln!(
                svg,
                r#"<rect x="{left:.1}" y="{top:.0}" width="{:.1}" height="{BAR}" fill="{colour}"><title>{part} {seconds} s</title></rect>"#,
                right - left
            );
            if right - left > 24.0 {
                let _ = writeln!(
                    svg,
                    r#"<text class="w" x="{:.1}" y="{middle:.0}">{seconds}</text>"#,
                    (left + right) / 2.0
                );
            }
            from += seconds;
        }
        let _ = writeln!(
            svg,
            r#"<text x="{:.1}" y="{middle:.0}" font-size="11">{:.1} s</text>"#,
            x(from) + 4.0,
            from
        );
    }
    for ((part, _, colour), n) in PARTS.iter().zip(0u8..) {
        let (column, row) = (f64::from(n % 6), f64::from(n / 6));
        let (left, top) = (20.0 + 120.0 * column, bottom + 24.0 + 18.0 * row);
        let _ = writeln!(
            svg,
            r#"<rect x="{left}" y="{top:.0}" width="12" height="12" fill="{colour}"/><text x="{:.0}" y="{:.0}">{part}</text>"#,
            left + 17.0,
            top + 10.0
        );
    }
    svg.push_str("</svg>\n");
    svg
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(slides: u32, ready: f64, verdict: f64, settle: Option<f64>) -> Value {
        let mut run = json!({
            "slides": slides, "seconds_to_ready": ready, "seconds_to_verdict": verdict,
            "timeline": {"boot": ready, "slide": 3.0},
        });
        if let Some(settle) = settle {
            run["timeline"]["settle"] = settle.into();
        }
        run
    }

    #[test]
    fn medians_are_of_the_runs_that_one_slide_decided() {
        let runs = [
            run(1, 1.0, 8.0, Some(2.0)),
            run(3, 9.0, 30.0, Some(9.0)),
            run(1, 3.0, 9.0, None),
        ];
        let summary = summary(&runs).unwrap();
        assert_eq!(summary["with_one_slide"], 2);
        assert_eq!(
            summary["seconds_to_ready"],
            json!({"median": 3.0, "worst": 9.0})
        );
        assert_eq!(
            summary["seconds_to_verdict"],
            json!({"median": 8.5, "worst": 9.0})
        );
        // no time at all is the least
        assert_eq!(
            summary["parts"],
            json!({"boot": 3.0, "settle": 1.0, "slide": 3.0})
        );
        let svg = draw(&json!({"rig": summary, "handheld": {"parts": {}}}));
        for seen in ["rig: command to verdict", "settle 1 s", "4.0 s</text>"] {
            assert!(svg.contains(seen), "{seen}");
        }
        assert!(super::summary(&runs[1..2]).is_err());
        // a part that the picture would leave out
        let mut other = runs;
        other[0]["timeline"]["nap"] = 1.0.into();
        assert!(
            super::summary(&other)
                .unwrap_err()
                .to_string()
                .contains("nap")
        );
    }
}
