//! The line of JSON of an exploration on the emulated board: its verdict, its forces, and what was lost.

use serde_json::{Value, json};

/// How a run ended; those behind `Right` are listed.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Debug)]
pub(super) enum Ending {
    /// It has no verdict to give.
    Done,
    Right,
    Undecided,
    Wrong,
    Failed,
}

/// The report of one run.
pub(super) struct Explored {
    pub(super) ending: Ending,
    /// In words.
    pub(super) said: String,
    /// By how much the force of each slide is off, as a share, by the world.
    force_errors: Vec<f64>,
    /// By hand: from the hand's standing still to the verdict on the display, s; negative where the verdict was first.
    end_to_screen_s: Option<f64>,
    /// Lost, late and damaged.
    wrong: [u64; 3],
}

/// Names of what is counted.
const WRONG: [&str; 3] = ["lost", "late", "damaged"];

impl Explored {
    /// Reads the line of JSON at the end of a run's output; `None` without one.
    pub(super) fn of(stdout: &str) -> Option<Self> {
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
            wrong: WRONG.map(|name| said[name].as_u64().unwrap_or(0)),
        })
    }
}

/// The figures of many: median and worst error of the force of a slide, and sums of what was lost, late and damaged.
/// Nothing of runs without slides.
pub(super) fn figures<'e>(all: impl Iterator<Item = &'e Explored>) -> Option<Value> {
    let (mut errors, mut sums, mut ends) = (Vec::new(), [0; 3], Vec::new());
    for explored in all {
        ends.extend(explored.end_to_screen_s);
        errors.extend(&explored.force_errors);
        for (sum, wrong) in sums.iter_mut().zip(explored.wrong) {
            *sum += wrong;
        }
    }
    let [lost, late, damaged] = sums;
    let (median, worst) = median_and_worst(errors.clone())?;
    let end = median_and_worst(ends);
    Some(json!({
        "slides": errors.len(),
        "force_error_median": median,
        "force_error_worst": worst,
        "lost": lost,
        "late": late,
        "damaged": damaged,
        "slide_end_to_screen_s_median": end.map(|(median, _)| median),
        "slide_end_to_screen_s_worst": end.map(|(_, worst)| worst),
    }))
}

/// The middle value, or the mean of the two, and the highest one; `None` of nothing.
fn median_and_worst(mut values: Vec<f64>) -> Option<(f64, f64)> {
    values.sort_by(f64::total_cmp);
    let upper = values.get(values.len() / 2)?;
    let lower = values.get((values.len() - 1) / 2)?;
    Some(((upper + lower) / 2.0, *values.last()?))
}

/// The same for people.
pub(super) fn sentence(figures: &Value) -> String {
    let percent = |name: &str| 100.0 * figures[name].as_f64().unwrap_or(f64::NAN);
    let seconds = |name: &str| figures[name].as_f64();
    let ends = seconds("slide_end_to_screen_s_median").zip(seconds("slide_end_to_screen_s_worst"));
    let ends = ends.map_or_else(String::new, |(median, worst)| {
        format!(" From the hand's standing still to the verdict: {median:.2} s (median), {worst:.2} s (worst).")
    });
    format!(
        "Force of {} slides off by {:.1} % (median) and {:.1} % (worst); {} lost, {} late, {} damaged.{ends}",
        figures["slides"],
        percent("force_error_median"),
        percent("force_error_worst"),
        figures["lost"],
        figures["late"],
        figures["damaged"]
    )
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
        let all = [
            explored(
                "Right",
                "[0.01,0.04]",
                2,
                "\"slide_end_to_screen_s\":-0.36,",
            ),
            explored("Undecided", "[0.02]", 3, "\"slide_end_to_screen_s\":0.20,"),
        ];
        let all = all.map(Option::unwrap);
        assert_eq!(
            (all[0].ending, all[1].ending),
            (Ending::Right, Ending::Undecided)
        );
        assert_eq!(all[1].said, "Undecided: Silk?; it was Wool.");
        let figures = figures(all.iter()).unwrap();
        assert_eq!(
            sentence(&figures),
            "Force of 3 slides off by 2.0 % (median) and 4.0 % (worst); 2 lost, 5 late, 0 damaged. \
             From the hand's standing still to the verdict: -0.08 s (median), 0.20 s (worst)."
        );
        // the rig has no hand
        let rig = explored("Right", "[0.01,0.01]", 0, "").unwrap();
        assert_eq!(
            sentence(&super::figures([rig].iter()).unwrap()),
            "Force of 2 slides off by 1.0 % (median) and 1.0 % (worst); 1 lost, 0 late, 0 damaged."
        );
        assert!(super::figures([].into_iter()).is_none());
        for other in ["", "Right.\n", "{}\n"] {
            assert!(Explored::of(other).is_none(), "{other}");
        }
    }
}
