//! `tactus device identify`: an exploration of the probe, shown step by step.

use std::io::Write;

use anyhow::bail;
use tactus::evaluate::Method;
use tactus::link::{Found, Question};
use tactus::show::Show;
use tactus_core::table::Table;
use tactus_core::wire::{Ask, Identify};

use super::bench::Bench;
use super::line::Where;
use super::train::seed_of_now;
use crate::cmd::args::Stop;

/// Have the probe find out what lies under its finger, and show every step
#[derive(clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    at: Where,
    #[command(flatten)]
    how: Exploration,
}

/// How to explore.
#[derive(clap::Args, Clone)]
pub(crate) struct Exploration {
    #[command(flatten)]
    stop: Stop,
    /// How to decide and to choose the next movement; the best for the probe's table unless given
    #[arg(long, value_enum)]
    method: Option<Method>,
    /// The textures that it may be; all unless given
    #[arg(long, value_name = "T,T,...", value_delimiter = ',')]
    among: Vec<String>,
    /// It is one of the textures known: never answer that it is none
    #[arg(long)]
    closed: bool,
    /// Let the probe learn from an answer that it is certain of
    #[arg(long)]
    learn: bool,
    /// Where on the sample slides begin, and random choices; drawn anew unless given
    #[arg(long)]
    seed: Option<u32>,
}

impl Exploration {
    /// The request, for a probe that knows these textures.
    pub(crate) fn wanted(&self, names: &[String]) -> anyhow::Result<Identify> {
        let mut among = Vec::new();
        for wanted in &self.among {
            let wanted = wanted.trim();
            let index = names.iter().position(|n| n.eq_ignore_ascii_case(wanted));
            let Some(index) = index else {
                bail!(
                    "--among {wanted}: the probe does not know it. It knows: {}",
                    names.join(", ")
                );
            };
            among.push(u16::try_from(index)?);
        }
        Ok(Identify {
            among: among.into_iter().collect(),
            threshold: self.stop.threshold,
            max_slides: self.stop.max_slides,
            method: self.method.map(Method::method),
            strategy: self.method.map(Method::strategy).unwrap_or_default(),
            open: !self.closed,
            learn: self.learn,
            seed: self.seed.unwrap_or_else(seed_of_now),
        })
    }
}

/// Has the probe explore.
pub(crate) fn run(Args { at, how }: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    let (mut bench, _) = Bench::open(at)?;
    // it is in the log then, too
    let bytes = bench.table()?;
    let table = Table::read(&bytes)?;
    let names: Vec<String> = table.names().map(str::to_owned).collect();
    let wanted = how.wanted(&names)?;
    let among = match wanted.among.len() {
        0 => names.len(),
        among => among,
    };
    writeln!(
        out,
        "An unknown texture, one of {among} (seed {}).",
        wanted.seed
    )?;
    out.flush()?;
    // for the log: with its samples every slide can be felt again
    bench.run(Question::command(Ask::Stream(true)), |_| Ok(()))?;
    let mut show = Show::new(table, &mut *out);
    let found: Found = bench.run(Question::identify(wanted), |report| show.tell(&report.tell))?;
    bench.run(Question::command(Ask::Stream(false)), |_| Ok(()))?;
    if found.learned > 0 {
        writeln!(
            out,
            "It has learned from {} of these slides.",
            found.learned
        )?;
    }
    if found.asks {
        writeln!(
            out,
            "It is not certain. If you know what it is: tactus device teach NAME"
        )?;
    }
    let (damaged, missing) = bench.losses();
    if damaged + missing > 0 {
        writeln!(
            out,
            "On the line {damaged} frames were damaged and {missing} reports lost."
        )?;
    }
    Ok(())
}
