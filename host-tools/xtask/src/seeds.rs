//! Many seeds of what draws from one: none may fail, and wrong verdicts are counted.
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::Instant;

use anyhow::{Context as _, Result, bail, ensure};
use clap::{Args, ValueEnum};
use serde_json::{Value, json};

use crate::shell::{self, cargo, target};
use crate::{emulate, firmware};

pub(crate) mod board;
use board::{Ending, Explored};

pub(crate) const EXAMPLES: &str = "Examples:
  cargo xtask seeds study                     seeds 1 to 100 of the whole study, with few simulations
  cargo xtask seeds study --seeds 1-10 -- --simulations 8000
  cargo xtask seeds identify --seeds 200-330  every method
  cargo xtask seeds rig --jobs 1              on the emulated board
  cargo xtask seeds rig --finger mems         with another finger
  cargo xtask seeds handheld                  the handheld, in a hand that differs from seed to seed
  cargo xtask seeds verify                    the same texture, and another one, held against what was learned
  cargo xtask seeds press --seeds 63          all presses of a world, with P_DC sound, dead, dying and leaking";

#[derive(Args)]
pub(crate) struct Options {
    /// What is run
    #[arg(value_enum)]
    what: What,
    /// Which seeds; unless given, those that a release is judged by
    #[arg(long, value_name = "A-B", value_parser = range)]
    seeds: Option<RangeInclusive<u64>>,
    /// How many at a time; all cores unless given
    #[arg(long, value_name = "N")]
    jobs: Option<usize>,
    /// The summary to write
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// The finger of the emulated board: biotac, analog or mems
    #[arg(long, value_name = "NAME", default_value = "biotac")]
    finger: String,
    /// Further options of what is run
    #[arg(last = true)]
    options: Vec<String>,
}

/// What draws from a seed.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum What {
    /// `tactus study all`
    Study,
    /// `tactus identify --simulated`, by every method
    Identify,
    /// `tactus simulate`
    Simulate,
    /// `tactus learn-by-hand`
    LearnByHand,
    /// `tactus verify --simulated`: a texture against itself, and the next one against it
    Verify,
    /// An exploration on the emulated board
    Rig,
    /// An exploration by the handheld on the emulated board
    Handheld,
    /// All presses of a world; every n-th rig with TACTUS_PRESSES_EVERY
    Press,
}

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

/// One run: what it is called, and its arguments.
struct Run {
    name: String,
    arguments: Vec<String>,
    /// A variable of its environment.
    variable: Option<(&'static str, String)>,
    /// How the line begins that is right, where the program does not know that itself.
    right: Option<&'static str>,
}

impl What {
    fn name(self) -> String {
        let value = self.to_possible_value();
        value.map_or_else(String::new, |value| value.get_name().to_owned())
    }

    fn seeds(self) -> RangeInclusive<u64> {
        match self {
            Self::Study | Self::Press => 1..=100,
            Self::Identify | Self::Simulate | Self::LearnByHand | Self::Verify => 1..=50,
            Self::Rig | Self::Handheld => 1..=20,
        }
    }

    /// The runs of a seed; what they write goes into `scratch`, and is deleted after the run.
    fn runs(self, seed: u64, scratch: &Path) -> Vec<Run> {
        let out = scratch.join(seed.to_string());
        let run = |name: String, command: &[&str]| Run {
            name,
            arguments: command.iter().map(|a| (*a).to_owned()).collect(),
            variable: None,
            right: None,
        };
        let (number, out) = (seed.to_string(), out.to_string_lossy());
        let seeded = |command: &[&str]| {
            let with_seed = [command, &["--seed", &number]].concat();
            run(format!("seed {seed}"), &with_seed)
        };
        match self {
            // the worlds, the rig and the report are those of the whole study; only virtual explorations are fewer
            Self::Study => vec![seeded(&[
                "study",
                "all",
                "--simulations",
                "200",
                "--out",
                &out,
            ])],
            Self::Identify => METHODS
                .iter()
                .map(|method| {
                    let arguments = [
                        "identify",
                        "--simulated",
                        "--method",
                        method,
                        "--seed",
                        &number,
                    ];
                    run(format!("seed {seed}, {method}"), &arguments)
                })
                .collect(),
            Self::Simulate => vec![seeded(&["simulate", "--trials", "2", "--out", &out])],
            Self::LearnByHand => vec![seeded(&["learn-by-hand", "--out", &out])],
            Self::Verify => {
                // in steps that reach all 117
                let texture = |n: u64| format!("T{}", 1 + n * 37 % 117);
                let (reference, other) = (texture(seed), texture(seed + 1));
                [
                    ("itself", &reference, "The same as"),
                    ("another", &other, "Different from"),
                ]
                .map(|(name, material, right)| {
                    let under = ["--texture", &reference, "--material", material];
                    let arguments = [&["verify", "--simulated", "--seed", &number], &under[..]];
                    Run {
                        right: Some(right),
                        ..run(format!("seed {seed}, {name}"), &arguments.concat())
                    }
                })
                .into()
            }
            Self::Rig => vec![seeded(&["identify", "--format", "json"])],
            Self::Handheld => vec![seeded(&["handheld", "--format", "json"])],
            Self::Press => {
                let test = ["the_whole_campaign", "--ignored", "--nocapture"];
                vec![Run {
                    variable: Some(("TACTUS_PRESSES_WORLD", number)),
                    ..run(format!("world {seed}"), &test)
                }]
            }
        }
    }
}

/// `A-B`, or one seed.
fn range(text: &str) -> Result<RangeInclusive<u64>, String> {
    let (from, to) = text.split_once('-').unwrap_or((text, text));
    match (from.parse(), to.parse()) {
        (Ok(from), Ok(to)) if from <= to => Ok(from..=to),
        _ => Err("two numbers are wanted, the lower first: 1-50".into()),
    }
}

/// What a run's output says of its end, or what is right by the caller. An exit code of 3 is "not identified": no failure.
fn ending(code: Option<i32>, stdout: &str, right: Option<&str>) -> Ending {
    if !matches!(code, Some(0 | 3)) {
        return Ending::Failed;
    }
    let says = |word: &str| stdout.lines().any(|line| line.starts_with(word));
    match right {
        Some(right) if says(right) => return Ending::Right,
        Some(_) if says("Not sure") => return Ending::Undecided,
        Some(_) => return Ending::Wrong,
        None => {}
    }
    match () {
        () if says("Wrong") => Ending::Wrong,
        () if says("Undecided") => Ending::Undecided,
        () if says("Right") => Ending::Right,
        () => Ending::Done,
    }
}

/// Runs all seeds; an error if one failed.
pub(crate) fn seeds(options: &Options) -> Result<()> {
    let what = options.what;
    let program = build(what, &options.finger)?;
    let scratch = target().join("seeds").join(what.name());
    std::fs::create_dir_all(&scratch).with_context(|| scratch.display().to_string())?;
    let seeds = options.seeds.clone().unwrap_or_else(|| what.seeds());
    let runs: Vec<Run> = seeds
        .clone()
        .flat_map(|seed| what.runs(seed, &scratch))
        .collect();
    let jobs = options.jobs.unwrap_or_else(shell::cores);
    let began = Instant::now();
    let ended = shell::each_of(&runs, jobs, |run| {
        let result = perform(&program, run, &options.options, &scratch);
        if let Some(line) = result.line() {
            println!("{line}");
        }
        result
    });
    let count = |wanted| ended.iter().filter(|r| r.ending == wanted).count();
    let listed = |wanted| {
        let of = ended.iter().filter(|r| r.ending == wanted);
        of.map(|r| json!({"run": r.name, "repeat": r.repeat, "said": r.said}))
            .collect::<Vec<Value>>()
    };
    let failed = count(Ending::Failed);
    let board = board::figures(ended.iter().filter_map(|r| r.explored.as_ref()));
    let summary = json!({
        "what": what.name(),
        "seeds": [seeds.start(), seeds.end()],
        "runs": ended.len(),
        "failed": listed(Ending::Failed),
        "wrong": listed(Ending::Wrong),
        "undecided": listed(Ending::Undecided),
        "right": count(Ending::Right),
        "seconds": began.elapsed().as_secs(),
        "board": board,
    });
    let file = options
        .out
        .clone()
        .unwrap_or_else(|| scratch.with_extension("json"));
    std::fs::write(&file, format!("{summary:#}\n")).with_context(|| file.display().to_string())?;
    println!(
        "{}, seeds {} to {}: of {} {failed} failed; {} right, {} wrong, {} undecided. {}",
        what.name(),
        seeds.start(),
        seeds.end(),
        ended.len(),
        count(Ending::Right),
        count(Ending::Wrong),
        count(Ending::Undecided),
        file.display()
    );
    if let Some(board) = board {
        println!("{}", board::sentence(&board));
    }
    ensure!(
        failed == 0,
        "runs that failed: {failed} of {}; they are listed above",
        ended.len()
    );
    Ok(())
}

/// A run that is over.
struct Ended {
    name: String,
    ending: Ending,
    /// How to run it again.
    repeat: String,
    /// The last thing that it said.
    said: String,
    /// What it says for programs, on the emulated board.
    explored: Option<Explored>,
}

impl Ended {
    /// The line for it, unless all is well.
    fn line(&self) -> Option<String> {
        let word = match self.ending {
            Ending::Failed => "FAILED",
            Ending::Wrong => "wrong",
            Ending::Undecided => "undecided",
            Ending::Right | Ending::Done => return None,
        };
        Some(format!(
            "{}: {word}: {}\n    again: {}",
            self.name, self.said, self.repeat
        ))
    }
}

/// Runs one on a single core, and removes what it wrote.
fn perform(program: &Program, run: &Run, further: &[String], scratch: &Path) -> Ended {
    let mut command = Command::new(&program.path);
    command
        .args(&run.arguments)
        .args(&program.arguments)
        .args(further);
    command.env("RAYON_NUM_THREADS", "1").env("NO_COLOR", "1");
    let set = run
        .variable
        .as_ref()
        .map(|(name, value)| format!("{name}={value}"));
    command.envs(run.variable.clone());
    let parts = std::iter::once(command.get_program()).chain(command.get_args());
    let parts = parts.map(|part| part.to_string_lossy().into_owned());
    let repeat = set.into_iter().chain(parts).collect::<Vec<_>>().join(" ");
    let (ending, said, explored) = match command.output() {
        Err(why) => (Ending::Failed, format!("cannot be started: {why}"), None),
        Ok(Output {
            status,
            stdout,
            stderr,
        }) => {
            let (stdout, stderr) = (
                String::from_utf8_lossy(&stdout),
                String::from_utf8_lossy(&stderr),
            );
            let explored = Explored::of(&stdout);
            let ending = match (ending(status.code(), &stdout, run.right), &explored) {
                (Ending::Done, Some(explored)) => explored.ending,
                (ending, _) => ending,
            };
            let told = if ending == Ending::Failed {
                stderr
            } else {
                stdout
            };
            // what a test that fails says is in the line after that
            let mut panicked = told.lines().skip_while(|l| !l.contains("panicked at"));
            let panicked = panicked.nth(1);
            let mut lines = told
                .lines()
                .rev()
                .map(str::trim)
                .filter(|line| !line.is_empty());
            let says = |line: &&str| {
                [
                    "error",
                    "Wrong",
                    "Undecided",
                    "The same",
                    "Different",
                    "Not sure",
                ]
                .iter()
                .any(|word| line.starts_with(word))
            };
            let of_board = explored.as_ref().filter(|_| ending != Ending::Failed);
            let of_board = of_board.map(|explored| explored.said.as_str());
            let said = panicked
                .or(of_board)
                .or_else(|| lines.clone().find(says))
                .or_else(|| lines.next());
            (
                ending,
                said.map_or_else(|| status.to_string(), ToOwned::to_owned),
                explored,
            )
        }
    };
    if let Some(at) = run.arguments.iter().position(|a| a == "--out") {
        let written = run.arguments.get(at + 1).map(PathBuf::from);
        let written = written.filter(|path| path.starts_with(scratch));
        // a folder or a file, whole, half or not there
        let _ = written
            .map(|path| std::fs::remove_dir_all(&path).or_else(|_| std::fs::remove_file(&path)));
    }
    Ended {
        name: run.name.clone(),
        ending,
        repeat,
        said,
        explored,
    }
}

/// What is run, and what is said to it each time.
struct Program {
    path: PathBuf,
    arguments: Vec<String>,
}

fn build(what: What, finger: &str) -> Result<Program> {
    let image = match what {
        What::Rig => Some(emulate::RIG),
        What::Handheld => Some(emulate::HANDHELD),
        _ => None,
    };
    if let Some(image) = image {
        shell::run(&mut emulate::build())?;
        let image = firmware::image_for(image, Some(finger))?;
        let elf = firmware::compile(&[&image])?.remove(0);
        let path = PathBuf::from(emulate::program("identify").get_program());
        let elf = elf.to_string_lossy().into_owned();
        let arguments = vec!["--elf".into(), elf, "--finger".into(), finger.into()];
        return Ok(Program { path, arguments });
    }
    ensure!(
        finger == "biotac",
        "--finger is for the emulated board: rig or handheld"
    );
    if what == What::Press {
        return Ok(Program {
            path: test_program("tactus-tests", "presses")?,
            arguments: Vec::new(),
        });
    }
    shell::run(cargo().args(["build", "--release", "--package", "tactus-probe"]))?;
    let path = target().join("release/tactus");
    if !path.is_file() {
        bail!("{} was built and is not there", path.display());
    }
    Ok(Program {
        path,
        arguments: Vec::new(),
    })
}

/// Builds a test of a package, and finds its program.
fn test_program(package: &str, test: &str) -> Result<PathBuf> {
    let mut build = cargo();
    build.args([
        "test",
        "--release",
        "--no-run",
        "--package",
        package,
        "--test",
        test,
    ]);
    build.arg("--message-format=json-render-diagnostics");
    let built = build.stderr(Stdio::inherit()).output();
    let built = built.context("cannot start cargo")?;
    ensure!(built.status.success(), "the test {test} does not build");
    let messages = String::from_utf8_lossy(&built.stdout);
    let mut programs = messages.lines().filter_map(|line| {
        let message: Value = serde_json::from_str(line).ok()?;
        let is_it = message["target"]["name"] == test && message["profile"]["test"] == true;
        is_it.then(|| message["executable"].as_str().map(PathBuf::from))?
    });
    programs
        .next()
        .with_context(|| format!("cargo does not say where the test {test} is"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_of_seeds_is_two_numbers_or_one() {
        assert_eq!(range("3-7"), Ok(3..=7));
        assert_eq!(range("5"), Ok(5..=5));
        for wrong in ["7-3", "", "a", "1-", "-1"] {
            assert!(range(wrong).is_err(), "{wrong}");
        }
    }

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

    /// A program that ends so for some seeds, in the place of the real one.
    #[test]
    fn a_run_that_fails_says_how_to_repeat_it_and_leaves_nothing() {
        let scratch = tempfile::tempdir().unwrap();
        let program = Program {
            path: "/bin/sh".into(),
            arguments: Vec::new(),
        };
        let out = scratch.path().join("7");
        let script = format!(
            "mkdir {0}; echo 'error: force unsteady' >&2; exit 1",
            out.display()
        );
        let arguments = ["-c", &script, "sh", "--out", &out.to_string_lossy()];
        let run = Run {
            name: "seed 7".into(),
            arguments: arguments.map(ToOwned::to_owned).to_vec(),
            variable: None,
            right: None,
        };
        let ended = perform(&program, &run, &[], scratch.path());
        let line = ended.line().unwrap();
        assert!(
            line.starts_with("seed 7: FAILED: error: force unsteady"),
            "{line}"
        );
        assert!(line.contains("again: /bin/sh -c"), "{line}");
        assert!(!out.exists());
        // a test that fails, in an environment of its own
        let script = "echo \"thread panicked at x.rs:1\n$SEED too hard\nnote\" >&2; exit 101";
        let run = Run {
            arguments: ["-c", script].map(ToOwned::to_owned).to_vec(),
            variable: Some(("SEED", "63".into())),
            ..run
        };
        let line = perform(&program, &run, &[], scratch.path()).line().unwrap();
        assert!(line.contains("FAILED: 63 too hard"), "{line}");
        assert!(line.contains("again: SEED=63 /bin/sh"), "{line}");
    }

    #[test]
    fn every_seed_has_its_runs() {
        let runs = What::Identify.runs(9, Path::new("x"));
        assert_eq!(runs.len(), METHODS.len());
        assert!(
            runs.iter()
                .all(|run| run.arguments.ends_with(&["--seed".into(), "9".into()]))
        );
        for what in [What::Study, What::Handheld, What::Press] {
            assert_eq!(what.runs(9, Path::new("x")).len(), 1);
        }
    }
}
