//! Step pulses from a timer of fixed period: each period either has a pulse or has none.
//!
//! The lever's rates (3200, 800 and 200 steps/s) come out even, any other with a jitter of one period. No ramps: the
//! fastest rate is 200 full steps a second, at which every stepper of this size starts.

/// Periods, and at most steps, per second.
pub const BASE_HZ: u32 = 3200;

/// The next period's pulse.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Period {
    /// A pulse, at its beginning.
    pub pulse: bool,
    /// Level of DIR: down. Where it changes it does so now, a whole period before the next pulse can come.
    pub down: bool,
    /// Neither this period nor the next has a pulse, and none is wanted: the timer may rest.
    pub rests: bool,
}

/// Which periods have a pulse, and how many steps that makes.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Steps {
    steps: i32,
    phase: u32,
    down: bool,
    pulse: bool,
}

impl Steps {
    /// No step made, DIR up.
    pub const fn new() -> Self {
        Self {
            steps: 0,
            phase: 0,
            down: false,
            pulse: false,
        }
    }

    /// Steps made, that of the period under way included; downwards positive.
    pub const fn made(&self) -> i32 {
        self.steps
    }

    /// Begins a period; returns the next one, at a rate in steps/s, downwards positive.
    pub fn begin(&mut self, rate: i32) -> Period {
        let pulses_now = self.pulse;
        if pulses_now {
            self.steps = self.steps.wrapping_add(if self.down { 1 } else { -1 });
        }
        if rate == 0 {
            // the next rate begins with a step
            self.phase = BASE_HZ;
        } else if (rate > 0) != self.down && !pulses_now {
            self.down = rate > 0;
        }
        self.pulse = false;
        if rate != 0 && (rate > 0) == self.down {
            self.phase = (self.phase + rate.unsigned_abs()).min(2 * BASE_HZ);
            if self.phase >= BASE_HZ {
                self.phase -= BASE_HZ;
                self.pulse = true;
            }
        }
        Period {
            pulse: self.pulse,
            down: self.down,
            rests: rate == 0 && !pulses_now,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::lever::{APPROACH_STEPS_S, RETRACT_STEPS_S};
    use proptest::prelude::*;
    use std::vec;
    use std::vec::Vec;

    /// Numbers of the periods that have a pulse.
    fn pulses(steps: &mut Steps, rate: i32, periods: usize) -> Vec<usize> {
        (0..periods).filter(|_| steps.begin(rate).pulse).collect()
    }

    #[test]
    fn the_levers_rates_are_even() {
        for rate in [APPROACH_STEPS_S, RETRACT_STEPS_S, 200, -200] {
            let mut steps = Steps::new();
            let at = pulses(&mut steps, rate, BASE_HZ as usize);
            let every = (BASE_HZ / rate.unsigned_abs()) as usize;
            assert!(at.windows(2).all(|w| w[1] - w[0] == every), "{rate}");
            // the last one is made when its period begins
            steps.begin(0);
            assert_eq!(steps.made().unsigned_abs() as usize, at.len());
            assert_eq!(steps.made().signum(), rate.signum());
        }
    }

    #[test]
    fn a_rate_begins_with_a_step_and_ends_at_once() {
        let mut steps = Steps::new();
        steps.begin(0);
        assert!(steps.begin(200).pulse);
        assert!(!steps.begin(0).pulse);
    }

    #[test]
    fn the_timer_rests_when_the_last_pulse_is_over() {
        let mut steps = Steps::new();
        while !steps.begin(800).pulse {}
        let pulse_under_way = steps.begin(0);
        assert!(!pulse_under_way.pulse && !pulse_under_way.rests);
        assert!(steps.begin(0).rests);
    }

    proptest! {
        #[test]
        fn direction_is_stable_for_a_period_about_every_pulse(
            rates in proptest::collection::vec((-4000i32..4000, 1usize..40), 1..30),
        ) {
            let mut steps = Steps::new();
            let mut made = 0;
            // DIR before the period, whether it has a pulse
            let mut now = (false, false);
            for (rate, periods) in rates {
                for _ in 0..periods {
                    let (down, pulse) = now;
                    if pulse { made += if down { 1 } else { -1 } }
                    let next = steps.begin(rate);
                    prop_assert_eq!(steps.made(), made);
                    if pulse {
                        // held while STEP is high
                        prop_assert_eq!(next.down, down);
                    }
                    now = (next.down, next.pulse);
                }
            }
        }

        #[test]
        fn any_rate_comes_out_on_average(rate in 1i32..=3200) {
            let mut steps = Steps::new();
            steps.begin(0);
            let many = pulses(&mut steps, rate, 2 * BASE_HZ as usize).len() as i32;
            prop_assert!((many - 2 * rate).abs() <= 1, "{} of {}", many, 2 * rate);
        }
    }

    #[test]
    fn a_turn_costs_an_idle_period() {
        let mut steps = Steps::new();
        let mut seen = vec![];
        for rate in [3200, 3200, -3200, -3200, -3200] {
            let next = steps.begin(rate);
            seen.push((next.down, next.pulse));
        }
        assert_eq!(
            seen,
            [
                (true, true),
                (true, true),
                (true, false),
                (false, true),
                (false, true)
            ]
        );
    }
}
