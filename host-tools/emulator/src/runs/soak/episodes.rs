//! What the day and the hour share: episodes, drawn by the seed, and what becomes of them.
//!
//! Both explore texture after texture; the probe learns and deletes textures, and in one of four episodes something breaks.
//! The seed draws what lies under the finger, what breaks and when, and what is learned.

use std::collections::BTreeMap;

use rand::RngExt as _;
use rand::seq::IndexedRandom as _;
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};
use tactus_core::table::factory;
use tactus_core::wire::Identify;
use tactus_lab::eval::show::count;
pub(super) use tactus_lab::sim::fault_case::{HOMINGS, world};
use tactus_world::faults::Fault;

/// More force than this is never on the finger, N: see the guard of the core's `rig`.
pub(crate) const MOST_N: f64 = 2.2;
/// One of so many episodes has a fault.
const FAULTS_IN: u32 = 4;
/// Latest time of a fault, ns after the episode began: an episode takes some 15 s.
const LATEST_NS: u64 = 15_000_000_000;

/// The table that comes with the firmware.
pub(super) const FACTORY: &[u8] = factory::RIG;

/// What the seed draws for an episode.
pub(super) struct Plan {
    pub(super) texture: u8,
    pub(super) identify: Identify,
    /// What breaks, and when, ns after the episode began.
    pub(super) fault: Option<(u64, Fault)>,
    /// The user gives the probe the label.
    pub(super) answer: bool,
}

impl Plan {
    pub(super) fn draw(random: &mut ChaCha8Rng) -> Self {
        let breaks = random.random_range(0..FAULTS_IN) == 0;
        let at_ns = random.random_range(0..LATEST_NS);
        let fault = Fault::EXAMPLES.choose(random).copied();
        Self {
            texture: random.random_range(1..=117),
            identify: Identify {
                // the draws in this order
                learn: random.random(),
                seed: random.random(),
                ..Identify::default()
            },
            fault: fault.filter(|_| breaks).map(|fault| (at_ns, fault)),
            answer: random.random_range(0..4) == 0,
        }
    }
}

/// What became of episodes.
#[derive(Clone, Debug, Default)]
pub(crate) struct Episodes {
    /// Explorations that were begun.
    pub(crate) made: u32,
    /// Those in which nothing broke.
    pub(crate) sound: u32,
    /// Of these the ones of textures that the probe knew, and the right verdicts on them.
    pub(crate) known: (u32, u32),
    /// Those of textures that had been deleted, and how often the probe said that it does not know them.
    pub(crate) unknown: (u32, u32),
    /// What was taken for what, and when, virtual s.
    pub(crate) wrong: Vec<String>,
    /// Wrong verdicts of which the probe was sure, on textures that it knew and on others.
    pub(crate) sure_and_wrong: (u32, u32),
    /// Slides that were made again, and why, in episodes in which nothing broke.
    pub(crate) rejected: Vec<String>,
    /// Episodes that the probe learned from: labelled by the user, and by itself.
    pub(crate) learned: (u32, u32),
    /// How often something was deleted.
    pub(crate) forgotten: u32,
    /// What broke, by its name.
    pub(crate) faults: BTreeMap<String, Broken>,
}

/// What became of a kind of fault.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Broken {
    /// How often it came.
    pub(crate) came: u32,
    /// It ended the episode.
    pub(crate) noticed: u32,
}

impl Episodes {
    /// Takes a verdict in: the texture that was named, unless it is said to be unknown, and whether the probe is sure.
    pub(super) fn judge(
        &mut self,
        at_s: f64,
        truth: &str,
        known: bool,
        found: Option<&str>,
        sure: bool,
    ) {
        self.sound += 1;
        let right = found.map_or(!known, |name| name == truth);
        let (all, good) = if known {
            &mut self.known
        } else {
            &mut self.unknown
        };
        *all += 1;
        *good += u32::from(right);
        if !right {
            let surely = if sure { "surely " } else { "" };
            let forgotten = if known {
                ""
            } else {
                ", which it had forgotten,"
            };
            let found = found.unwrap_or("an unknown one");
            let wrong = format!("{at_s:.0} s: {truth}{forgotten} was {surely}taken for {found}");
            self.wrong.push(wrong);
            let (of_known, of_others) = &mut self.sure_and_wrong;
            *if known { of_known } else { of_others } += u32::from(sure);
        }
    }

    pub(super) fn broke(&mut self, fault: Fault, noticed: bool) {
        let kind = self.faults.entry(format!("{fault:?}")).or_default();
        kind.came += 1;
        kind.noticed += u32::from(noticed);
    }

    /// All faults together.
    pub(crate) fn broken(&self) -> Broken {
        let sum = |of: fn(&Broken) -> u32| self.faults.values().map(of).sum();
        Broken {
            came: sum(|kind| kind.came),
            noticed: sum(|kind| kind.noticed),
        }
    }

    pub(crate) fn json(&self) -> Value {
        let kind = |(name, kind): (&String, &Broken)| {
            (
                name.clone(),
                json!({ "came": kind.came, "noticed": kind.noticed }),
            )
        };
        json!({
            "episodes": self.made,
            "without_fault": self.sound,
            "known": { "episodes": self.known.0, "right": self.known.1, "sure_and_wrong": self.sure_and_wrong.0 },
            "forgotten": { "episodes": self.unknown.0, "noticed": self.unknown.1, "sure_and_wrong": self.sure_and_wrong.1 },
            "wrong": self.wrong,
            "slides_rejected": self.rejected,
            "labelled": self.learned.0,
            "self_learned": self.learned.1,
            "forgot": self.forgotten,
            "faults": self.faults.iter().map(kind).collect::<serde_json::Map<_, _>>(),
        })
    }

    pub(crate) fn text(&self) -> String {
        let broken = self.broken();
        format!(
            "{}, {} without a fault; of textures that it knew {} of {} right, {} wrong though sure; of those it had forgotten {} \
             of {} noticed, {} wrong though sure; {} made again\n  {}, {} ended the episode; {} learned from the user, {} by itself, \
             {} forgotten",
            count(self.made, "episode"),
            self.sound,
            self.known.1,
            self.known.0,
            self.sure_and_wrong.0,
            self.unknown.1,
            self.unknown.0,
            self.sure_and_wrong.1,
            count(self.rejected.len() as u64, "slide"),
            count(broken.came, "fault"),
            broken.noticed,
            count(self.learned.0, "texture"),
            self.learned.1,
            self.forgotten
        )
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng as _;

    use super::*;

    #[test]
    fn an_unknown_texture_is_right_only_where_the_table_lacks_it() {
        let mut episodes = Episodes::default();
        episodes.judge(1.0, "elm", true, Some("elm"), true);
        episodes.judge(2.0, "elm", false, None, false);
        assert_eq!(episodes.wrong, [""; 0]);
        episodes.judge(3.0, "elm", true, None, false);
        episodes.judge(4.0, "elm", true, Some("oak"), true);
        episodes.judge(5.0, "elm", false, Some("oak"), true);
        assert_eq!((episodes.known, episodes.unknown), ((3, 1), (2, 1)));
        assert_eq!(episodes.sure_and_wrong, (1, 1));
        assert!(episodes.wrong[1].contains("elm was surely taken for oak"));
        assert!(episodes.wrong[2].contains("forgotten"));
    }

    #[test]
    fn a_quarter_of_the_episodes_has_a_fault_and_every_fault_comes() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let plans: Vec<Plan> = (0..2000).map(|_| Plan::draw(&mut random)).collect();
        let mut episodes = Episodes::default();
        for (_, fault) in plans.iter().filter_map(|plan| plan.fault) {
            episodes.broke(fault, true);
        }
        assert!((400..600).contains(&episodes.broken().came));
        assert_eq!(episodes.faults.len(), Fault::EXAMPLES.len());
    }
}
