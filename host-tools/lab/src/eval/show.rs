//! Explorations and tables for people to look at.

use std::io::{self, Write};

use tactus_core::explorer::{ExpectedOutcome, Verdict, VerdictKind};
use tactus_core::features::{Properties, Property};
use tactus_core::table::{Action, Contents, Table, white};
use tactus_core::wire::{Event, Prompt};

use crate::eval::open_set;
use crate::eval::samples;
use crate::eval::table_summary::TableSummary;
pub use tactus_link::say::{about_percent, count, day, percent};

const BAR: usize = 24;
/// Most candidates listed after a slide.
const LISTED: usize = 5;
/// Candidates less probable than this are not listed.
const WORTH_LISTING: f32 = 0.001;

/// Shows an exploration slide by slide.
#[derive(Debug)]
pub struct Show<'t, W> {
    table: Table<'t>,
    out: W,
    slides: u32,
    prompt: Option<Prompt>,
    answered: Option<(Verdict, u8)>,
}

impl<'t, W: Write> Show<'t, W> {
    /// Shows an exploration with `table`.
    pub fn new(table: Table<'t>, out: W) -> Self {
        Self {
            table,
            out,
            slides: 0,
            prompt: None,
            answered: None,
        }
    }

    fn early(&mut self, ms: u16) -> io::Result<()> {
        let seconds = f64::from(ms) / 1e3;
        self.line(&format!(
            "  ended after {seconds} s at constant speed: that is certain"
        ))
    }

    /// Shows the next action and its reason.
    pub fn chosen(&mut self, action: Action, expected: &[ExpectedOutcome]) -> io::Result<()> {
        writeln!(
            self.out,
            "\nSlide {}: {}",
            self.slides + 1,
            self.name(action)
        )?;
        if let Some(chosen) = expected.iter().find(|o| o.action == action) {
            writeln!(self.out, "  because {}", self.reason(chosen, expected))?;
        }
        self.out.flush()
    }

    /// Shows the features of a slide, and the textures that remain after it.
    pub(crate) fn slide_report(
        &mut self,
        action: Action,
        properties: &Properties,
        roughness_is_bound: bool,
        posterior: &[f32],
    ) -> io::Result<()> {
        self.slides += 1;
        let observed: Vec<String> = Property::ALL
            .into_iter()
            .filter(|&property| {
                action
                    .property
                    .is_none_or(|looked_at| looked_at == property)
            })
            .filter_map(|property| {
                let value = properties.get(property)?;
                let unit = if property == Property::Traction {
                    " N"
                } else {
                    ""
                };
                let bound = roughness_is_bound && property == Property::Roughness;
                let at_most = if bound { "at most " } else { "" };
                Some(format!("{property} {at_most}{value:.3}{unit}"))
            })
            .collect();
        if !observed.is_empty() {
            writeln!(self.out, "  measured {}", observed.join(", "))?;
        }
        self.candidates(posterior)?;
        self.out.flush()
    }

    /// Shows a line of something else in between.
    pub fn line(&mut self, line: &str) -> io::Result<()> {
        writeln!(self.out, "{line}")?;
        self.out.flush()
    }

    /// Shows a probe's event of an exploration, up to its answer; shows nothing for any other.
    pub fn event(&mut self, event: &Event) -> io::Result<()> {
        match event {
            Event::Chosen {
                action, expected, ..
            } => self.chosen(*action, expected),
            Event::SlideReport {
                action,
                observed,
                posterior,
                ..
            } => {
                if let Some(pace) = observed.pace {
                    let percent = 100.0 * (f64::from(pace) / 1024.0).exp();
                    self.line(&format!("  speed: {percent:.0} % of the movement's"))?;
                }
                self.slide_report(
                    *action,
                    &observed.properties(),
                    observed.roughness_is_bound,
                    posterior,
                )
            }
            Event::Early(ms) => self.early(*ms),
            Event::Rejected { why, .. } => self.line(&format!("  rejected: {why}")),
            Event::Fault(fault) => self.line(&format!("  fault: {fault}")),
            Event::Trouble(why) => self.line(&format!("  trouble: {why}")),
            Event::Prompt(prompt) if self.prompt.replace(*prompt) != Some(*prompt) => {
                self.line(&format!("  the display says: {prompt}"))
            }
            Event::Verdict(verdict) => self.answer(verdict.into(), verdict.slides),
            _ => Ok(()),
        }
    }

    /// The verdict that was shown, and the slides that it took.
    pub fn answered(&self) -> Option<(Verdict, u8)> {
        self.answered
    }

    /// The measured quantity of an action: "fineness", "all features".
    fn looked_at(&self, action: Action) -> &'static str {
        match (action.property, self.table.contents()) {
            (Some(property), _) => property.name(),
            (None, Contents::Fused(..)) => "all features",
            (None, Contents::Gaussians(_)) => "all properties",
        }
    }

    /// An action in words: "fineness at 0.80 N, 25.0 mm/s".
    pub fn name(&self, action: Action) -> String {
        let looked_at = self.looked_at(action);
        match self.table.movement(action.movement) {
            Some(movement) => format!("{looked_at} at {movement}"),
            None => looked_at.to_owned(),
        }
    }

    fn reason(&self, chosen: &ExpectedOutcome, expected: &[ExpectedOutcome]) -> String {
        let left = |o: &ExpectedOutcome| format!("{:.1} %", o.uncertainty * 100.0);
        let mut others: Vec<&ExpectedOutcome> = expected
            .iter()
            .filter(|o| o.action != chosen.action)
            .collect();
        others.sort_by(|a, b| b.benefit.total_cmp(&a.benefit));
        let single = self.table.movements().len() == 1;
        let name =
            |o: &ExpectedOutcome| match (o.action.property, self.table.movement(o.action.movement))
            {
                (Some(property), _) if single => property.to_string(),
                (None, Some(movement)) => movement.to_string(),
                _ => self.name(o.action),
            };
        let rest: Vec<String> = others
            .iter()
            .take(2)
            .map(|o| {
                // an action that would leave less was made before, and its benefit is lower for that
                let worn = if o.uncertainty < chosen.uncertainty {
                    ", but it was made before"
                } else {
                    ""
                };
                format!("{} {}{worn}", name(o), left(o))
            })
            .collect();
        let rest = if rest.is_empty() {
            String::new()
        } else {
            format!("\n    (next best: {})", rest.join("; "))
        };
        format!(
            "{} should leave {} uncertainty{rest}",
            chosen.action.property.map_or("it", Property::name),
            left(chosen)
        )
    }

    fn candidates(&mut self, posterior: &[f32]) -> io::Result<()> {
        let mut ranked: Vec<(f32, &str)> =
            posterior.iter().copied().zip(self.table.names()).collect();
        ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
        let listed = ranked
            .iter()
            .take(LISTED)
            .filter(|(p, _)| *p >= WORTH_LISTING)
            .count();
        let (listed, others) = ranked.split_at(listed);
        for (probability, name) in listed {
            let full = (probability * BAR as f32).round() as usize;
            let bar = format!(
                "{}{}",
                "█".repeat(full.min(BAR)),
                "░".repeat(BAR.saturating_sub(full))
            );
            writeln!(self.out, "  {bar} {:5.1} %  {name}", probability * 100.0)?;
        }
        let rest: f32 = others.iter().map(|(p, _)| p).sum();
        if rest >= WORTH_LISTING {
            writeln!(
                self.out,
                "  {:BAR$} {:5.1} %  {} others",
                "",
                rest * 100.0,
                others.len()
            )?;
        }
        Ok(())
    }

    /// Shows the answer, and whether it is right.
    pub fn finish(mut self, verdict: Verdict, slides: u8, truth: &str) -> io::Result<()> {
        self.answer(verdict, slides)?;
        match is_right(verdict, truth, self.table) {
            Some(true) => writeln!(self.out, "Right."),
            Some(false) => writeln!(self.out, "Wrong: it was {truth}."),
            None => writeln!(self.out, "Undecided: it was {truth}."),
        }
    }

    /// Shows the answer.
    pub fn answer(&mut self, verdict: Verdict, slides: u8) -> io::Result<()> {
        self.answered = Some((verdict, slides));
        let name = self.table.name(verdict.texture).unwrap_or("?");
        let p = verdict.probability * 100.0;
        let slides = count(slides, "slide");
        match verdict.kind() {
            VerdictKind::New => {
                let odds = verdict
                    .log_odds
                    .map_or(String::new(), |odds| format!(" (log-odds {odds:+.1})"));
                writeln!(
                    self.out,
                    "\nIt is not one of the {} I know{odds} after {slides}; it is most like {name}.",
                    count(self.table.textures(), "texture")
                )
            }
            VerdictKind::Changed => writeln!(
                self.out,
                "\nIt is {name}, but not as I learned it: sure to {p:.1} % after {slides}. It is worn, or has drifted, \
                 or is something much like it."
            ),
            VerdictKind::Sure => {
                writeln!(self.out, "\nIt is {name}: sure to {p:.1} % after {slides}.")
            }
            VerdictKind::MostLike => writeln!(
                self.out,
                "\nIt is most like {name}: {p:.1} % among those I know, after {slides}. I am not sure of names, as too \
                 many new textures would get one; if nothing new can come, say so with --closed."
            ),
            VerdictKind::Undecided => writeln!(
                self.out,
                "\nNot sure after {slides}; most likely {name}, {p:.1} %."
            ),
        }
    }
}

/// Returns true if a verdict is right about the texture of this name; `None` if it claims nothing.
pub fn is_right(verdict: Verdict, truth: &str, table: Table<'_>) -> Option<bool> {
    match verdict.kind() {
        VerdictKind::Sure | VerdictKind::Changed => {
            Some(table.name(verdict.texture) == Some(truth))
        }
        VerdictKind::New => Some(table.find(truth).is_none()),
        VerdictKind::MostLike | VerdictKind::Undecided => None,
    }
}

/// Prints what a table holds.
pub fn show_table(table: Table<'_>, out: &mut impl Write) -> io::Result<()> {
    writeln!(
        out,
        "{}, {}, {} bytes, checksum {:08x}",
        count(table.textures(), "texture"),
        count(table.movements().len() as u64, "movement"),
        table.as_bytes().len(),
        tactus_link::checksum(&table)
    )?;
    let calibrated = day(table.calibrated()).unwrap_or_else(|| "not said".to_owned());
    writeln!(
        out,
        "finger: {}; day of its force calibration: {calibrated}",
        table.finger()
    )?;
    let lengths: Vec<String> = table
        .lengths_ms()
        .map(|ms| (f64::from(ms) / 1e3).to_string())
        .collect();
    if !lengths.is_empty() {
        writeln!(
            out,
            "it knows slides that end early, after {} s",
            lengths.join(", ")
        )?;
    }
    if let Contents::Fused(set, features) = table.contents() {
        let features = count(features, "feature");
        writeln!(out, "{features}: {}", set.name())?;
        let share = |share: f32| format!("{:.1} %", 100.0 * share);
        match table.drift() {
            None => writeln!(out, "it has neither drift nor limits")?,
            Some(drift) if drift.is_none() => writeln!(out, "no drift is expected")?,
            Some(drift) => writeln!(
                out,
                "drift: band powers {:.2} (ln), traction {} of its mean",
                drift.bands,
                share(drift.traction)
            )?,
        }
        match (table.limits(), table.drift()) {
            (Some(limits), _) => {
                writeln!(out, "limits for {} false alarms", share(limits.false_alarm))?
            }
            (None, Some(_)) => writeln!(out, "no limits: it had fewer than three textures")?,
            (None, None) => {}
        }
        if let Some(figures) = table.open_set() {
            writeln!(out, "{}", open_set::in_lines(&figures))?;
        }
        show_samples(table, out)?;
        return show_whitened(table, out);
    }
    show_samples(table, out)?;
    for (movement, index) in table.movements().zip(0..) {
        writeln!(out, "\nmovement {}: {movement}", index + 1)?;
        write!(out, "{:>4} {:<24} {:>6}", "no.", "texture", "trials")?;
        for property in table.measured().iter() {
            write!(out, "  {property:>10} {:>8}", "sd")?;
        }
        writeln!(out)?;
        for (name, texture) in table.names().zip(0..) {
            write!(
                out,
                "{:>4} {name:<24} {:>6}",
                texture + 1,
                table.trials(texture, index)
            )?;
            for property in table.measured().iter() {
                match table.gaussian(
                    texture,
                    Action {
                        movement: index,
                        property: Some(property),
                    },
                ) {
                    Some(g) => write!(out, "  {:>10.4} {:>8.4}", g.mean, g.sd)?,
                    None => write!(out, "  {:>10} {:>8}", "-", "-")?,
                }
            }
            writeln!(out)?;
        }
    }
    Ok(())
}

/// Prints whether samples were moved between trials, and advice if they never were.
fn show_samples(table: Table<'_>, out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "{}", samples::in_words(table))?;
    let stayed = (0..table.textures()).filter(|&texture| table.moved(texture) == Some(false));
    let stayed: Vec<&str> = stayed.filter_map(|texture| table.name(texture)).collect();
    match samples::advice(&stayed) {
        Some(advice) => writeln!(out, "{advice}"),
        None => Ok(()),
    }
}

/// Prints a fused table: whitened means are meaningless to people, distances between them are not.
fn show_whitened(table: Table<'_>, out: &mut impl Write) -> io::Result<()> {
    let textures = TableSummary::new(table).textures;
    for (movement, index) in table.movements().zip(0..) {
        writeln!(out, "\nmovement {}: {movement}", index + 1)?;
        writeln!(
            out,
            "{:>4} {:<24} {:>6}  {:>7} {:>6} {:>6}  {:>6}  most like",
            "no.", "texture", "trials", "learned", "taught", "itself", "sd off"
        )?;
        for (number, texture) in (1..).zip(&textures) {
            let (name, known) = (&texture.name, &texture.movements[index]);
            write!(
                out,
                "{number:>4} {name:<24} {:>6}  {:>7} {:>6} {:>6}",
                known.trials, texture.slides_factory, texture.slides_user, texture.slides_itself
            )?;
            match known.nearest_sd.zip(known.nearest.as_ref()) {
                Some((sd, other)) => writeln!(out, "  {sd:>6.1}  {other}")?,
                None => writeln!(out, "  {:>6}  -", "-")?,
            }
        }
    }
    Ok(())
}

/// Distance of the means of two textures at a movement, in standard deviations within a texture.
pub fn apart(table: Table<'_>, movement: u8, textures: [u16; 2]) -> Option<f32> {
    if textures
        .iter()
        .any(|&texture| table.trials(texture, movement) == 0)
    {
        return None;
    }
    let [a, b] = textures.map(|texture| table.white_mean(texture, movement));
    let squares = a.zip(b).map(|(a, b)| (white(a) - white(b)).powi(2));
    Some(squares.sum::<f32>().sqrt())
}

#[cfg(test)]
mod tests {
    use super::percent;

    #[test]
    fn a_share_is_written_without_the_digits_of_its_binary_form() {
        let written =
            [0.3_f32, 0.99, 0.999, 1.0, 0.0, 0.123_456].map(|share| percent(share.into()));
        assert_eq!(
            written,
            ["30 %", "99 %", "99.9 %", "100 %", "0 %", "12.3456 %"]
        );
    }
}
