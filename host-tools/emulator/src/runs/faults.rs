//! The campaign of faults: many cases, each by its seed, side by side, on the simulated rig of the PC or on emulated boards.

pub mod board;

use std::collections::BTreeMap;
use std::fs::{self, OpenOptions};
use std::io::Write as _;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use clap::Args as Arguments;
use serde_json::{Value, json};
use tactus_core::rig::Fault as Named;
use tactus_core::table::factory;
use tactus_lab::eval::show::count;
use tactus_lab::sim::fault_case::{Bench, Case};

use self::board::{BoardBench, BoardCase};
use super::error::RunError;
use super::soak::day::DayError;
use crate::host::progress;

/// The table that comes with the firmware.
const FACTORY: &[u8] = factory::RIG;

/// Breaks one to three things at any moment of whatever the probe does, case by case: on the simulated rig of the PC, or with
/// --board on emulated boards, whose link, supply and debugger break, too.
///
/// The probe homes, identifies, learns, calibrates or rests meanwhile. Then bits of its flash change while its power is off,
/// everything is repaired, and it works again. Bars: never more than 2.2 N on the finger, a rig at rest with its motors off and
/// its finger lifted, nothing of the store lost without a word, and a repaired rig that homes and identifies. The exit code is
/// 1 if a case misses one. How well the fault that is named fits what broke is counted.
///
/// Each case is written as it ends; those that are written already are not run again.
#[derive(Arguments)]
#[command(after_help = "Examples:
  cargo xtask campaign faults --seeds 1-2000              seeds 1 to 2000, or what is left of them
  cargo xtask campaign faults --seeds 17 -- --again       one of them once more")]
pub(crate) struct Args {
    /// How many cases
    #[arg(long, value_name = "N")]
    faults: u64,
    /// The seed of the first one; those of the others follow
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Run cases that are written already, too
    #[arg(long)]
    again: bool,
    /// Without the spring of the finger's mount, which the list of parts asks for; write these cases into another file
    #[arg(long)]
    stiff: bool,
    /// On emulated boards, with the real firmware; write these cases into another file
    #[arg(long, requires = "elf")]
    board: bool,
    /// The firmware of the boards: what `cargo xtask size` names
    #[arg(long, value_name = "PATH")]
    elf: Option<PathBuf>,
    /// How many cases at once; as many as there are cores unless given
    #[arg(long, value_name = "N")]
    jobs: Option<usize>,
    /// Where the cases are written, as JSON Lines
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

/// Whether all cases are as they must be.
pub(crate) fn run(args: &Args) -> Result<bool, RunError> {
    let seeds = args.seed..args.seed.saturating_add(args.faults);
    let mut cases = written(&args.out);
    cases.retain(|seed, _| seeds.contains(seed));
    let left: Vec<u64> = seeds
        .clone()
        .filter(|seed| args.again || !cases.contains_key(seed))
        .collect();
    if let Some(folder) = args.out.parent() {
        fs::create_dir_all(folder)?;
    }
    let file = OpenOptions::new()
        .create(true)
        .append(true)
        .open(&args.out)?;
    let bar = progress::bar("cases", args.faults, ", {eta} left");
    bar.set_position(args.faults - left.len() as u64);
    bar.reset_eta();
    let ended = Mutex::new((file, cases));
    let next = AtomicUsize::new(0);
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let cores = args.jobs.unwrap_or(cores).max(1);
    let bench = Bench::new(FACTORY).map_err(DayError::from)?;
    let elf = args.elf.as_ref().filter(|_| args.board);
    let board = elf.map(|elf| BoardBench::new(elf, &bench.calibration));
    let board = board.transpose()?;
    std::thread::scope(|scope| {
        for _ in 0..cores.min(left.len()) {
            scope.spawn(|| {
                while let Some(&seed) = left.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let line = match &board {
                        Some(board) => perform_on_board(board, seed, args.stiff),
                        None => perform(&bench, seed, args.stiff),
                    };
                    let mut ended = ended.lock().unwrap_or_else(|e| e.into_inner());
                    if let Some(said) = failed(&line) {
                        bar.suspend(|| println!("{said}"));
                    }
                    // a line at a time: what is written is whole, or is run again
                    if let Err(why) = writeln!(ended.0, "{line}") {
                        bar.suspend(|| eprintln!("{}: {why}", args.out.display()));
                    }
                    ended.1.insert(seed, line);
                    bar.inc(1);
                }
            });
        }
    });
    bar.finish_and_clear();
    let (_, cases) = ended.into_inner().unwrap_or_else(|e| e.into_inner());
    print!("{}", summary(&cases));
    println!("{}", args.out.display());
    Ok(cases.values().all(|line| failed(line).is_none()))
}

/// The cases that a file holds; a line that is not whole is none.
fn written(file: &Path) -> BTreeMap<u64, Value> {
    let text = fs::read_to_string(file).unwrap_or_default();
    text.lines()
        .filter_map(|line| serde_json::from_str(line).ok())
        .filter_map(|line: Value| Some((line["seed"].as_u64()?, line)))
        .collect()
}

/// The line of a case, of which the outcome is not known yet.
fn line(case: &Case, broke: Vec<String>, board: bool) -> Value {
    json!({
        "seed": case.seed,
        "activity": format!("{:?}", case.activity),
        "texture": case.texture,
        "faults": broke,
        "bits": case.bits,
        "stiff": case.stiff,
        "board": board,
    })
}

/// What breaks, and when.
fn broken<T: std::fmt::Debug>(what: &[(u64, T)]) -> impl Iterator<Item = String> {
    what.iter().map(|(ms, what)| format!("{ms} ms {what:?}"))
}

fn names(named: &[Named]) -> Value {
    json!(named.iter().map(|f| format!("{f:?}")).collect::<Vec<_>>())
}

/// Runs the case of a seed; its line.
fn perform(bench: &Bench<'_>, seed: u64, stiff: bool) -> Value {
    let case = Case {
        stiff,
        ..Case::draw(seed)
    };
    let ended = catch_unwind(AssertUnwindSafe(|| bench.run(&case)));
    let mut line = line(&case, broken(&case.faults).collect(), false);
    match ended {
        Ok(Ok(outcome)) => {
            line["force_max_n"] = outcome.force_max_n.into();
            line["named"] = names(&outcome.named);
            line["naming"] = outcome.naming.to_string().into();
            line["refused"] = json!(outcome.refused);
            line["virtual_s"] = outcome.took.as_secs_f64().into();
            line["wrong"] = json!(outcome.wrong);
        }
        Ok(Err(why)) => line["wrong"] = json!([why.to_string()]),
        Err(_) => line["wrong"] = json!(["it panicked"]),
    }
    line
}

/// The same on a board.
fn perform_on_board(bench: &BoardBench<'_>, seed: u64, stiff: bool) -> Value {
    let mut drawn = BoardCase::draw(seed);
    drawn.case.stiff = stiff;
    let broke = broken(&drawn.case.faults).chain(broken(&drawn.upsets));
    let mut line = line(&drawn.case, broke.collect(), true);
    match bench.run(&drawn) {
        Ok(outcome) => {
            line["force_max_n"] = outcome.force_max_n.into();
            line["named"] = names(&outcome.named);
            line["naming"] = outcome.naming.to_string().into();
            line["refused"] = json!(outcome.refused);
            line["resets"] = outcome.resets.into();
            line["virtual_s"] = outcome.virtual_s.into();
            line["wrong"] = json!(outcome.wrong);
        }
        Err(why) => line["wrong"] = json!([why.to_string()]),
    }
    line
}

/// What is wrong with a case, and how it is run again.
fn failed(line: &Value) -> Option<String> {
    let wrong = line["wrong"].as_array()?;
    let wrong: Vec<&str> = wrong.iter().filter_map(Value::as_str).collect();
    (!wrong.is_empty()).then(|| {
        format!(
            "seed {seed}: {}, {}: FAILED: {}\n    again: cargo xtask campaign {}faults --seeds {seed} -- --again{}",
            line["activity"].as_str().unwrap_or_default(),
            line["faults"],
            wrong.join("; "),
            if line["board"] == true { "board-" } else { "" },
            if line["stiff"] == true { " --stiff" } else { "" },
            seed = line["seed"],
        )
    })
}

/// What the namings of cases mean.
const NAMINGS: [(&str, &str); 4] = [
    ("right", "named faults that fit what broke"),
    ("other", "stopped with a name that leads elsewhere"),
    (
        "refused",
        "refused what was asked for, with a reason of its own",
    ),
    ("unnoticed", "named nothing, and did what was asked for"),
];

/// How many cases there were, what they were asked for, and what they named.
fn summary(cases: &BTreeMap<u64, Value>) -> String {
    let mut by: BTreeMap<&str, (u32, u32, u32)> = BTreeMap::new();
    for line in cases.values() {
        let (all, named, wrong) = by
            .entry(line["activity"].as_str().unwrap_or_default())
            .or_default();
        *all += 1;
        *named += u32::from(
            line["named"]
                .as_array()
                .is_some_and(|named| !named.is_empty()),
        );
        *wrong += u32::from(failed(line).is_some());
    }
    let forces = cases
        .values()
        .filter_map(|line| line["force_max_n"].as_f64());
    let most = forces.fold(0.0, f64::max);
    let wrong: u32 = by.values().map(|(.., wrong)| wrong).sum();
    let mut text = format!(
        "{}, {wrong} failed; at most {most:.3} N on the finger\n",
        count(cases.len() as u64, "case")
    );
    for (naming, what) in NAMINGS {
        let all = cases.values().filter(|line| line["naming"] == naming);
        text += &format!("  {} {what}\n", all.count());
    }
    for (activity, (all, named, wrong)) in by {
        text += &format!("  {activity}: {all}, of which {named} named a fault, {wrong} failed\n");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cases_that_are_written_are_not_run_again() {
        let name = format!("tactus-faults-{}", std::process::id());
        let out = std::env::temp_dir().join(name).join("cases.jsonl");
        fs::create_dir_all(out.parent().unwrap()).unwrap();
        // of the first one half a line was written
        fs::write(
            &out,
            "{\"seed\": 1, \"wro\n{\"seed\": 2, \"activity\": \"Idle\", \"wrong\": [\"x\"]}\n",
        )
        .unwrap();
        assert_eq!(written(&out).into_keys().collect::<Vec<_>>(), [2]);
        let args = |again| Args {
            faults: 2,
            seed: 1,
            again,
            stiff: false,
            board: false,
            elf: None,
            jobs: None,
            out: out.clone(),
        };
        assert!(!run(&args(false)).unwrap(), "seed 2 has failed");
        assert_eq!(fs::read_to_string(&out).unwrap().lines().count(), 3);
        assert!(run(&args(true)).unwrap());
        assert_eq!(fs::read_to_string(&out).unwrap().lines().count(), 5);
        fs::remove_dir_all(out.parent().unwrap()).unwrap();
    }
}
