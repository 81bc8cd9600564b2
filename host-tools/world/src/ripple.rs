//! Ripple of the current of the stage's motor within each period of the bridge's PWM: with the PWM high towards the
//! supply's final value, with the PWM low towards the back-EMF's, both with the motor's L/R.
//!
//! ```text
//! L di/dt = u - R i - K v     u: the supply while PWM is high; while it is low 0 (slow decay),
//!                             or the supply turned round until i = 0 (fast decay)
//! ```
//! The mean over a period moves the stage, and is the stage's `current_a`. A converter
//! reads the current of an instant.

use super::maths::{exp, ln};

/// A place in a period of PWM that begins with its high part, s.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct PwmPhase {
    /// Length of the period.
    pub period_s: f64,
    /// Time since it began.
    pub since_s: f64,
}

/// Final values of the current of a driven motor, A.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ends {
    pub(super) high_a: f64,
    pub(super) low_a: f64,
    /// True if it stops at 0 on the way to that.
    pub(super) stops: bool,
    /// The motor's L/R, s.
    pub(super) time_constant_s: f64,
}

/// By how much the current at a place is above its mean over the period, A, in the steady state of a duty from 0 to 1.
pub(super) fn above_mean_a(ends: Ends, duty: f64, phase: PwmPhase) -> f64 {
    let Ends {
        high_a,
        low_a,
        stops,
        time_constant_s,
    } = ends;
    if stops && high_a <= 0.0 {
        return 0.0;
    }
    let left = |seconds: f64| exp(-seconds / time_constant_s);
    let (high_s, low_s) = (duty * phase.period_s, (1.0 - duty) * phase.period_s);
    let (after_high, after_low) = (left(high_s), left(low_s));
    // where the end of a period is its beginning
    let swing_a = (high_a - low_a) * (1.0 - after_high) / (1.0 - after_high * after_low);
    let mut begins_a = low_a + swing_a * after_low;
    if stops {
        begins_a = begins_a.max(0.0);
    }
    let peak_a = high_a + (begins_a - high_a) * after_high;
    let falls_s = match stops {
        true => low_s.min(time_constant_s * ln((peak_a - low_a) / -low_a)),
        false => low_s,
    };
    // the charge: the inductance keeps as much at the end as at the beginning
    let mean_a = (high_a * high_s + low_a * falls_s) / phase.period_s;
    let after_s = phase.since_s - high_s;
    let now_a = if after_s < 0.0 {
        high_a + (begins_a - high_a) * left(phase.since_s)
    } else if after_s < falls_s {
        low_a + (peak_a - low_a) * left(after_s)
    } else if stops {
        0.0
    } else {
        begins_a
    };
    now_a - mean_a
}

#[cfg(test)]
mod tests {
    use super::*;

    const TIME_CONSTANT_S: f64 = 35e-6;

    const PERIOD_S: f64 = 50e-6;
    /// 12 V and 7.5 ohm.
    const SUPPLY_A: f64 = 1.6;

    fn at(ends: Ends, duty: f64, since_s: f64) -> f64 {
        let phase = PwmPhase {
            period_s: PERIOD_S,
            since_s,
        };
        above_mean_a(ends, duty, phase)
    }

    /// The motor's equation by small steps, from no current until nothing changes from period to period: the currents
    /// of the last period.
    fn by_steps(ends: Ends, duty: f64) -> Vec<f64> {
        const STEPS: usize = 5000;
        let mut current = 0.0;
        let mut last = Vec::new();
        for _ in 0..30 {
            last.clear();
            for step in 0..STEPS {
                last.push(current);
                let high = (step as f64) < duty * STEPS as f64;
                let to = if high { ends.high_a } else { ends.low_a };
                current += (to - current) * PERIOD_S / STEPS as f64 / TIME_CONSTANT_S;
                if ends.stops && !high {
                    current = f64::max(current, 0.0);
                }
            }
        }
        last
    }

    #[test]
    fn the_current_swings_as_the_motors_equation_says() {
        // standing, at speed, and the same with fast decay
        for (emf_a, stops) in [(0.0, false), (0.1, false), (0.05, true), (0.1, true)] {
            for duty in [0.02, 0.044, 0.1, 0.3, 0.6, 0.9] {
                let ends = Ends {
                    high_a: SUPPLY_A - emf_a,
                    low_a: if stops { -SUPPLY_A - emf_a } else { -emf_a },
                    stops,
                    time_constant_s: TIME_CONSTANT_S,
                };
                let steps = by_steps(ends, duty);
                let mean = steps.iter().sum::<f64>() / steps.len() as f64;
                for (step, current) in steps.iter().enumerate() {
                    let since_s = PERIOD_S * step as f64 / steps.len() as f64;
                    let off = at(ends, duty, since_s) - (current - mean);
                    assert!(off.abs() < 1e-3, "{ends:?}, {duty} at {step}: {off} A");
                }
            }
        }
    }
}
