//! The stage's PWM between two looks at its timer.

use tactus_world::ripple::PwmPhase;

/// A timer that counts up and begins again, its output high in the first counts.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Wave {
    /// Time of the reading of its count, ns.
    pub(super) at_ns: u64,
    pub(super) count: u64,
    pub(super) counts: u64,
    /// Counts in a second.
    pub(super) hz: u64,
}

impl Wave {
    /// Its place in its period at a later time; `None` if it stands.
    pub(super) fn phase(&self, now_ns: u64) -> Option<PwmPhase> {
        if self.hz == 0 {
            return None;
        }
        let passed_ns = u128::from(now_ns.saturating_sub(self.at_ns));
        let passed = passed_ns * u128::from(self.hz) / 1_000_000_000;
        let count = (u128::from(self.count) + passed) % u128::from(self.counts.max(1));
        let seconds = |counts: f64| counts / self.hz as f64;
        Some(PwmPhase {
            period_s: seconds(self.counts as f64),
            since_s: seconds(count as f64),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_place_in_the_period_goes_on_without_drift() {
        let wave = Wave {
            at_ns: 500,
            count: 4000,
            counts: 4100,
            hz: 84_000_000,
        };
        let at = |now_ns| (wave.phase(now_ns).unwrap().since_s * 84e6).round();
        assert_eq!(at(500), 4000.0);
        // 84 counts a microsecond
        assert_eq!(at(1_500), 4084.0);
        assert_eq!(at(2_500), 68.0);
        // 4100 s are 84 000 000 periods
        assert_eq!(at(500 + 4_100_000_000_000), 4000.0);
        assert_eq!(Wave { hz: 0, ..wave }.phase(600), None);
    }
}
