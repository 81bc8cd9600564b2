//! The campaign of faults: many cases, each by its seed, side by side, on the simulated rig of the PC.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};

use clap::Args as Arguments;
use rayon::prelude::*;
use tactus_core::table::factory;
use tactus_lab::eval::show::count;
use tactus_lab::sim::fault_case::naming::Naming;
use tactus_lab::sim::fault_case::{Bench, Case, Outcome};

use crate::host::progress;

/// Breaks one to three things at any moment of whatever the probe does, case by case, on the simulated rig of the PC.
///
/// The probe homes, identifies, learns, calibrates or rests meanwhile. Then bits of its flash change while its power is
/// off, everything is repaired, and it works again. Limits: never more than 2.2 N on the finger, a rig at rest with its
/// motors off and its finger lifted, nothing of the store lost without a word, and a repaired rig that homes and
/// identifies. The exit code is 1 if a case misses one. How well the fault that is named fits what broke is counted.
#[derive(Arguments)]
pub(crate) struct Args {
    /// Number of cases
    #[arg(long, value_name = "N")]
    faults: u64,
    /// The seed of the first one; those of the others follow
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Without the spring of the finger's mount, which the list of parts asks for
    #[arg(long)]
    stiff: bool,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<bool> {
    let bar = progress::bar("cases", args.faults, ", {eta} left");
    let bench = Bench::new(factory::RIG)?;
    let seeds = args.seed..args.seed.saturating_add(args.faults);
    let cases = seeds.into_par_iter().map(|seed| {
        let case = Case {
            stiff: args.stiff,
            ..Case::draw(seed)
        };
        let ended = catch_unwind(AssertUnwindSafe(|| bench.run(&case)));
        let ended = ended.map_err(|_| "it panicked".to_owned());
        let ended = ended.and_then(|ended| ended.map_err(|why| why.to_string()));
        let wrong = match &ended {
            Ok(outcome) => outcome.wrong.join("; "),
            Err(why) => why.clone(),
        };
        if !wrong.is_empty() {
            bar.suspend(|| println!("  seed {seed} FAILED: {wrong}\n    {case:?}"));
        }
        bar.inc(1);
        ended
    });
    let cases: Vec<Result<Outcome, String>> = cases.collect();
    bar.finish_and_clear();
    let (text, met) = summary(&cases);
    println!("{text}");
    Ok(met)
}

/// Counts the cases by what they named, and those that failed; true if none did.
fn summary(cases: &[Result<Outcome, String>]) -> (String, bool) {
    let sound = |case: &&Result<Outcome, String>| case.as_ref().is_ok_and(|o| o.wrong.is_empty());
    let failed = cases.len() - cases.iter().filter(sound).count();
    let outcomes = || cases.iter().flatten();
    let most = outcomes().map(|o| o.force_max_n).fold(0.0, f64::max);
    let mut namings: BTreeMap<String, u32> = BTreeMap::new();
    for outcome in outcomes() {
        let naming: Naming = outcome.naming;
        *namings.entry(naming.to_string()).or_default() += 1;
    }
    let namings = namings.into_iter();
    let namings: Vec<String> = namings.map(|(name, n)| format!("{n} {name}")).collect();
    let text = format!(
        "{}, {failed} failed; at most {most:.3} N on the finger; faults named: {}",
        count(cases.len() as u64, "case"),
        namings.join(", ")
    );
    (text, failed == 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_case_with_something_wrong_fails_the_run() {
        let outcome = |wrong: &[&str]| Outcome {
            case: Case::draw(1),
            force_max_n: 1.5,
            refused: None,
            named: Vec::new(),
            naming: Naming::Right,
            wrong: wrong.iter().map(|what| (*what).to_owned()).collect(),
        };
        let (text, met) = summary(&[Ok(outcome(&[]))]);
        assert!(
            met && text.starts_with("1 case, 0 failed; at most 1.500 N"),
            "{text}"
        );
        assert!(!summary(&[Ok(outcome(&[])), Ok(outcome(&["2.3 N"]))]).1);
        assert!(!summary(&[Err("it panicked".into())]).1);
    }
}
