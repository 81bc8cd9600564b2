//! Explorations on the emulated board, one for each seed in a process of its own, on one core. Wrong verdicts are
//! counted; none may fail.
use std::ops::RangeInclusive;
use std::path::Path;
use std::process::Command;

use anyhow::{Result, ensure};
use serde_json::Value;

use super::Options;
use crate::shell::{self, cargo};
use crate::{emulate, firmware};

const WORLD: &str = "TACTUS_PRESSES_WORLD";

/// Verdict of a run; those behind `Right` are listed.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Debug)]
enum Ending {
    Right,
    Undecided,
    Wrong,
    Failed,
}

#[derive(Debug)]
struct Explored {
    ending: Ending,
    said: String,
    /// By how much the force of each slide is off, as a share, by the world.
    force_errors: Vec<f64>,
    /// By hand: from the hand's standing still to the verdict on the display, s; negative where the verdict was first.
    end_to_screen_s: Option<f64>,
    wrong: [u64; 3],
}

impl Explored {
    fn of(stdout: &str) -> Option<Self> {
        let said: Value = serde_json::from_str(stdout.lines().last()?).ok()?;
        let verdict = said["verdict"].as_str()?;
        let ending = match verdict {
            "Right" => Ending::Right,
            "Wrong" => Ending::Wrong,
            _ => Ending::Undecided,
        };
        let either = |names: [&str; 2]| names.into_iter().find_map(|name| said[name].as_str());
        let found = either(["says", "texture_identified"])?.trim_end_matches('.');
        let truth = either(["truth", "texture_true"])?;
        let force_errors = said["force_errors"].as_array()?;
        Some(Self {
            ending,
            said: format!("{verdict}: {found}; it was {truth}."),
            force_errors: force_errors.iter().filter_map(Value::as_f64).collect(),
            end_to_screen_s: said["slide_end_to_screen_s"].as_f64(),
            wrong: ["lost", "late", "damaged"].map(|name| said[name].as_u64().unwrap_or(0)),
        })
    }

    /// The result of a command; one without a line of JSON has failed, and says why at its end.
    fn by(command: &mut Command) -> Self {
        let (stdout, said) = match command.output() {
            Ok(output) if matches!(output.status.code(), Some(0 | 3 | 4)) => {
                let text = String::from_utf8_lossy(&output.stdout).into_owned();
                (text, "it prints no line of JSON".to_owned())
            }
            Ok(output) => {
                let text = String::from_utf8_lossy(&output.stderr).into_owned();
                let last = text.lines().rfind(|line| !line.trim().is_empty());
                let last = last.map(str::to_owned);
                let status = output.status.to_string();
                (String::new(), last.unwrap_or(status))
            }
            Err(why) => (String::new(), format!("cannot be started: {why}")),
        };
        Self::of(&stdout).unwrap_or(Self {
            ending: Ending::Failed,
            said,
            force_errors: Vec::new(),
            end_to_screen_s: None,
            wrong: [0; 3],
        })
    }
}

/// The figures of many in a sentence: median and worst error of the force of a slide, and what was lost.
fn figures(all: &[Explored]) -> String {
    let errors: Vec<f64> = all.iter().flat_map(|e| e.force_errors.clone()).collect();
    let (slides, Some((median, worst))) = (errors.len(), median_and_worst(errors)) else {
        return String::new();
    };
    let [lost, late, damaged] = [0, 1, 2].map(|at| all.iter().map(|e| e.wrong[at]).sum::<u64>());
    let ends = median_and_worst(all.iter().filter_map(|e| e.end_to_screen_s).collect());
    let ends = ends.map_or_else(String::new, |(median, worst)| {
        format!(" From the hand's standing still to the verdict: {median:.2} s (median), {worst:.2} s (worst).")
    });
    format!(
        "Force of {slides} slides off by {:.1} % (median) and {:.1} % (worst); {lost} lost, {late} late, {damaged} \
         damaged.{ends}",
        100.0 * median,
        100.0 * worst
    )
}

/// The middle value, or the mean of the two, and the highest one; `None` of nothing.
fn median_and_worst(mut values: Vec<f64>) -> Option<(f64, f64)> {
    values.sort_by(f64::total_cmp);
    let upper = values.get(values.len() / 2)?;
    let lower = values.get((values.len() - 1) / 2)?;
    Some(((upper + lower) / 2.0, *values.last()?))
}

/// Runs all seeds with the image of this run; an error if one failed.
pub(super) fn run(run: &str, seeds: &RangeInclusive<u64>, options: &Options) -> Result<String> {
    shell::run(&mut emulate::build())?;
    let elf = firmware::compile(&[emulate::image_of(run)])?.remove(0);
    if run == "printer" {
        shell::run(&mut emulate::command_line())?;
    }
    let all: Vec<u64> = seeds.clone().collect();
    let ended = shell::each_of(&all, shell::cores(), |seed| {
        let mut command = command(run, *seed, &elf, options);
        let explored = Explored::by(&mut command);
        if explored.ending > Ending::Right {
            println!("seed {seed}: {}\n    again: {command:?}", explored.said);
        }
        explored
    });
    let count = |wanted| ended.iter().filter(|ended| ended.ending == wanted).count();
    let [failed, wrong, undecided, right] = [
        Ending::Failed,
        Ending::Wrong,
        Ending::Undecided,
        Ending::Right,
    ]
    .map(count);
    let sentence = format!(
        "Seeds {} to {}: of {} {failed} failed; {right} right, {wrong} wrong, {undecided} undecided. {}",
        seeds.start(),
        seeds.end(),
        ended.len(),
        figures(&ended)
    );
    println!("{sentence}");
    ensure!(failed == 0, "{sentence}");
    Ok(sentence.trim_end().to_owned())
}

fn command(run: &str, seed: u64, elf: &Path, options: &Options) -> Command {
    let mut command = emulate::program(run);
    command.args(["--format", "json", "--seed", &seed.to_string()]);
    command.arg("--elf").arg(elf);
    command
        .args(options.finger.iter().flat_map(|name| ["--finger", name]))
        .args(&options.options);
    if run == "printer" {
        command.arg("--tactus").arg(emulate::tactus());
    }
    command.envs([("RAYON_NUM_THREADS", "1"), ("NO_COLOR", "1")]);
    command
}

pub(super) fn presses(seeds: &RangeInclusive<u64>) -> Result<String> {
    for seed in seeds.clone() {
        let mut test = cargo();
        test.args(["test", "--quiet", "--release", "--package", "tactus-tests"]);
        test.args(["--test", "core_and_lab", "--"]);
        test.args(["presses::the_whole_campaign", "--ignored", "--nocapture"]);
        shell::run(test.env(WORLD, seed.to_string()))?;
    }
    let (first, last) = (seeds.start(), seeds.end());
    Ok(format!("Worlds {first} to {last}: all limits are met."))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn explored(verdict: &str, force_errors: &str, late: u32, end: &str) -> Option<Explored> {
        Explored::of(&format!(
            "An ELF.\n{{{end}\"verdict\":\"{verdict}\",\"says\":\"Silk?\",\"truth\":\"Wool\",\"lost\":1,\
             \"force_errors\":{force_errors},\"late\":{late},\"damaged\":0}}\n"
        ))
    }

    #[test]
    fn forces_and_losses_of_all_runs_are_summed_up() {
        let hand = |s: &str| format!("\"slide_end_to_screen_s\":{s},");
        let all = [
            explored("Right", "[0.01,0.04]", 2, &hand("-0.36")),
            explored("Undecided", "[0.02]", 3, &hand("0.20")),
        ];
        let all = all.map(Option::unwrap);
        let endings = all.each_ref().map(|one| one.ending);
        assert_eq!(endings, [Ending::Right, Ending::Undecided]);
        assert_eq!(all[1].said, "Undecided: Silk?; it was Wool.");
        assert_eq!(
            figures(&all),
            "Force of 3 slides off by 2.0 % (median) and 4.0 % (worst); 2 lost, 5 late, 0 damaged. \
             From the hand's standing still to the verdict: -0.08 s (median), 0.20 s (worst)."
        );
        // the rig has no hand
        let rig = explored("Right", "[0.01,0.01]", 0, "").unwrap();
        assert!(figures(&[rig]).ends_with("1 lost, 0 late, 0 damaged."));
        assert_eq!(figures(&[]), "");
        for other in ["", "Right.\n", "{}\n"] {
            assert!(Explored::of(other).is_none(), "{other}");
        }
    }

    #[test]
    fn a_run_that_fails_says_why() {
        let run = |script: &str| Explored::by(Command::new("/bin/sh").args(["-c", script]));
        let ended = run("echo 'error: force unsteady' >&2; exit 1");
        assert_eq!(ended.said, "error: force unsteady");
        assert_eq!(run("exit 1").said, "exit status: 1");
        assert_eq!(run("echo Right.").ending, Ending::Failed);
    }
}
