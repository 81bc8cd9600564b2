//! Parts that draw from a seed: each run is a process of its own, on one core. Wrong verdicts are counted; none may
//! fail.
use std::ops::RangeInclusive;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

use anyhow::{Context as _, Result, ensure};
use serde_json::{Value, json};

use super::board::{self, Ending, Explored};
use super::{Options, Part};
use crate::shell::{self, cargo, target};
use crate::{emulate, firmware};

/// The methods of `tactus identify`.
const METHODS: [&str; 8] = [
    "fused",
    "fused-cycle",
    "fused-random",
    "student-all",
    "student",
    "paper",
    "cycle",
    "random",
];
/// Names the world of the test of presses.
const WORLD: &str = "TACTUS_PRESSES_WORLD";

/// One run: its name, its words for the program, and how the line begins that is right if the program does not know
/// that.
struct Run {
    name: String,
    seed: u64,
    words: Vec<String>,
    right: Option<&'static str>,
}

/// The runs of a seed; what they write goes to `scratch`, and is deleted after the run.
fn runs(part: Part, seed: u64, scratch: &Path) -> Vec<Run> {
    let run = |name: &str, words: &str, right| {
        let words = words.split(' ').map(|word| match word {
            "SEED" => seed.to_string(),
            "OUT" => scratch.join(seed.to_string()).display().to_string(),
            word => word.to_owned(),
        });
        let (name, words) = (format!("seed {seed}{name}"), words.collect());
        Run {
            name,
            seed,
            words,
            right,
        }
    };
    let one = |words: &str| vec![run("", words, None)];
    match part {
        // the worlds, the rig and the report are those of the whole study; only virtual explorations are fewer
        Part::Study => one("study all --simulations 200 --out OUT --seed SEED"),
        Part::Simulate => one("simulate --trials 2 --out OUT --seed SEED"),
        Part::LearnByHand => one("learn-by-hand --out OUT --seed SEED"),
        Part::Rig => one("identify --format json --seed SEED"),
        Part::Handheld => one("handheld --format json --seed SEED"),
        Part::Press => one("presses::the_whole_campaign --ignored --nocapture"),
        Part::Verify => {
            // in steps that reach all 117
            let texture = |n: u64| format!("T{}", 1 + n * 37 % 117);
            let (reference, other) = (texture(seed), texture(seed + 1));
            let verify = "verify --simulated --seed SEED --texture";
            let with = |material: &str| format!("{verify} {reference} --material {material}");
            vec![
                run(", itself", &with(&reference), Some("The same as")),
                run(", another", &with(&other), Some("Different from")),
            ]
        }
        _ => {
            let by = |method| {
                let words = format!("identify --simulated --method {method} --seed SEED");
                run(&format!(", {method}"), &words, None)
            };
            METHODS.map(by).into()
        }
    }
}

/// Runs all seeds, writes a summary, and returns it in a sentence; an error if one failed.
pub(super) fn run(part: Part, seeds: &RangeInclusive<u64>, options: &Options) -> Result<String> {
    let (program, arguments) = program(part, &options.finger)?;
    let mut file = target().join("campaign").join(part.name());
    std::fs::create_dir_all(&file).with_context(|| file.display().to_string())?;
    let all: Vec<Run> = seeds
        .clone()
        .flat_map(|seed| runs(part, seed, &file))
        .collect();
    let began = Instant::now();
    let ended = shell::each_of(&all, options.jobs.unwrap_or_else(shell::cores), |run| {
        let mut command = Command::new(&program);
        let (first, then) = match part {
            Part::Press => (&arguments, &run.words),
            _ => (&run.words, &arguments),
        };
        command
            .args(first)
            .args(then)
            .args(&options.options)
            .envs([("RAYON_NUM_THREADS", "1"), ("NO_COLOR", "1")]);
        let repeat = repeated(&command);
        command.env(WORLD, run.seed.to_string());
        let variable = if part == Part::Press {
            format!("{WORLD}={} ", run.seed)
        } else {
            String::new()
        };
        let ended = Ended::of(run, &mut command, variable + &repeat);
        if ended.ending > Ending::Right {
            println!(
                "{}: {:?}: {}\n    again: {}",
                run.name, ended.ending, ended.said, ended.repeat
            );
        }
        // a folder or a file, whole, half or not there
        let written = file.join(run.seed.to_string());
        let _ = std::fs::remove_dir_all(&written).or_else(|_| std::fs::remove_file(&written));
        ended
    });
    let count = |wanted| ended.iter().filter(|ended| ended.ending == wanted).count();
    let [failed, wrong, undecided, right] = [
        Ending::Failed,
        Ending::Wrong,
        Ending::Undecided,
        Ending::Right,
    ]
    .map(count);
    let board = board::figures(ended.iter().filter_map(|ended| ended.explored.as_ref()));
    let listed = ended.iter().filter(|ended| ended.ending > Ending::Right);
    let listed = listed.map(|e| {
        let ending = format!("{:?}", e.ending);
        json!({"run": e.name, "ending": ending, "repeat": e.repeat, "said": e.said})
    });
    let summary = json!({
        "part": part.name(), "finger": options.finger, "seeds": [seeds.start(), seeds.end()],
        "runs": ended.len(), "right": right, "wrong": wrong, "undecided": undecided, "failed": failed,
        "not_right": listed.collect::<Vec<Value>>(), "seconds": began.elapsed().as_secs(), "board": board,
    });
    file.set_file_name(format!("{}-{}.json", part.name(), options.finger));
    std::fs::write(&file, format!("{summary:#}\n")).with_context(|| file.display().to_string())?;
    let sentence = format!(
        "Seeds {} to {}: of {} {failed} failed; {right} right, {wrong} wrong, {undecided} undecided. {}",
        seeds.start(),
        seeds.end(),
        ended.len(),
        board.as_ref().map_or_else(String::new, board::sentence)
    );
    println!("{sentence}\n{}", file.display());
    ensure!(failed == 0, "{sentence}");
    Ok(sentence.trim_end().to_owned())
}

/// A run that is over.
struct Ended {
    name: String,
    ending: Ending,
    /// The command that runs it again.
    repeat: String,
    said: String,
    explored: Option<Explored>,
}

impl Ended {
    fn of(run: &Run, command: &mut Command, repeat: String) -> Self {
        let name = run.name.clone();
        let output = match command.output() {
            Ok(output) => output,
            Err(why) => {
                let said = format!("cannot be started: {why}");
                return Self {
                    name,
                    ending: Ending::Failed,
                    repeat,
                    said,
                    explored: None,
                };
            }
        };
        let [stdout, stderr] = [&output.stdout, &output.stderr]
            .map(|bytes| String::from_utf8_lossy(bytes).into_owned());
        let explored = Explored::of(&stdout);
        let mut ending = ending(output.status.code(), &stdout, run.right);
        let mut said = last_words(if ending == Ending::Failed {
            &stderr
        } else {
            &stdout
        });
        if let Some(explored) = explored.as_ref().filter(|_| ending != Ending::Failed) {
            (ending, said) = (explored.ending, explored.said.clone());
        }
        if said.is_empty() {
            said = output.status.to_string();
        }
        Self {
            name,
            ending,
            repeat,
            said,
            explored,
        }
    }
}

/// A command as a shell takes it.
fn repeated(command: &Command) -> String {
    let words = std::iter::once(command.get_program()).chain(command.get_args());
    words
        .map(|word| word.to_string_lossy())
        .collect::<Vec<_>>()
        .join(" ")
}

/// How a run ended by its output, or by `right`. An exit code of 3 is "not identified": no failure.
fn ending(code: Option<i32>, stdout: &str, right: Option<&str>) -> Ending {
    let says = |word: &str| stdout.lines().any(|line| line.starts_with(word));
    match right {
        _ if !matches!(code, Some(0 | 3)) => Ending::Failed,
        Some(right) if says(right) => Ending::Right,
        Some(_) if says("Not sure") => Ending::Undecided,
        Some(_) => Ending::Wrong,
        None if says("Wrong") => Ending::Wrong,
        None if says("Undecided") => Ending::Undecided,
        None if says("Right") => Ending::Right,
        None => Ending::Done,
    }
}

/// The line that says what happened: of a panic the one behind its place, a verdict, or the last one.
fn last_words(output: &str) -> String {
    const VERDICTS: [&str; 6] = [
        "error",
        "Wrong",
        "Undecided",
        "The same",
        "Different",
        "Not sure",
    ];
    let mut panic = output
        .lines()
        .skip_while(|line| !line.contains("panicked at"));
    let mut lines = output
        .lines()
        .rev()
        .map(str::trim)
        .filter(|line| !line.is_empty());
    let verdict = lines
        .clone()
        .find(|line| VERDICTS.iter().any(|word| line.starts_with(word)));
    panic
        .nth(1)
        .or(verdict)
        .or_else(|| lines.next())
        .unwrap_or_default()
        .to_owned()
}

/// Builds a part's program, and returns it with what it is told each time.
fn program(part: Part, finger: &str) -> Result<(std::ffi::OsString, Vec<String>)> {
    let words = |words: &str| words.split(' ').map(str::to_owned).collect::<Vec<_>>();
    let image = match part {
        Part::Rig => emulate::RIG,
        Part::Handheld => emulate::HANDHELD,
        Part::Press => {
            let tests = "test --quiet --release --package tactus-tests --test core_and_lab";
            shell::run(cargo().args(words(tests)).arg("--no-run"))?;
            return Ok((
                cargo().get_program().to_owned(),
                words(&format!("{tests} --")),
            ));
        }
        _ => {
            shell::run(cargo().args(words("build --release --package tactus-probe")))?;
            return Ok((target().join("release/tactus").into(), Vec::new()));
        }
    };
    shell::run(&mut emulate::build())?;
    let elf = firmware::compile(&[image])?.remove(0);
    let elf = elf.to_string_lossy().into_owned();
    let program = emulate::program("identify").get_program().to_owned();
    Ok((
        program,
        vec!["--elf".into(), elf, "--finger".into(), finger.into()],
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_ending_is_what_the_run_says() {
        assert_eq!(
            ending(Some(0), "Slide 1\nRight.\n3 s\n", None),
            Ending::Right
        );
        assert_eq!(
            ending(Some(3), "Undecided: it was felt.\n", None),
            Ending::Undecided
        );
        assert_eq!(
            ending(Some(0), "Wrong: it was felt.\n", None),
            Ending::Wrong
        );
        assert_eq!(ending(Some(0), "117 textures\n", None), Ending::Done);
        assert_eq!(ending(Some(1), "Right.\n", None), Ending::Failed);
        assert_eq!(ending(None, "", None), Ending::Failed);
        let other = |stdout| ending(Some(3), stdout, Some("Different from"));
        assert_eq!(other("Slide 1\nDifferent from Silk.\n"), Ending::Right);
        assert_eq!(other("The same as Silk.\n"), Ending::Wrong);
        assert_eq!(
            other("Not sure yet whether it is Silk.\n"),
            Ending::Undecided
        );
    }

    #[test]
    fn a_run_that_fails_says_why() {
        let run = |script: &str| {
            let run = Run {
                name: "seed 7".into(),
                seed: 7,
                words: Vec::new(),
                right: None,
            };
            Ended::of(
                &run,
                Command::new("/bin/sh").args(["-c", script]),
                String::new(),
            )
        };
        let ended = run("echo 'error: force unsteady' >&2; exit 1");
        assert_eq!(
            (ended.ending, &*ended.said),
            (Ending::Failed, "error: force unsteady")
        );
        let ended = run("echo \"thread panicked at x.rs:1\n63 too hard\nnote\" >&2; exit 101");
        assert_eq!(
            (ended.ending, &*ended.said),
            (Ending::Failed, "63 too hard")
        );
        assert_eq!(run("exit 1").said, "exit status: 1");
        assert_eq!(
            repeated(Command::new("tactus").args(["verify", "--seed"])),
            "tactus verify --seed"
        );
    }

    #[test]
    fn every_seed_has_its_runs() {
        let all = runs(Part::Identify, 9, Path::new("x"));
        assert_eq!(all.len(), METHODS.len());
        assert!(
            all.iter()
                .all(|run| run.words.ends_with(&["--seed".into(), "9".into()]))
        );
        let study = &runs(Part::Study, 9, Path::new("x"))[0].words;
        assert_eq!(study[5], Path::new("x").join("9").to_string_lossy());
        assert_eq!(
            runs(Part::Verify, 9, Path::new("x"))[1].words[5..],
            ["T100", "--material", "T20"]
        );
    }
}
