//! Wires that do not lead where they should, and parts that are others than in the list: what a rig may have on its
//! first evening. What breaks later is a [`Fault`](super::faults::Fault).

/// A mistake in building the rig. Each shows only at the pins.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Miswired {
    /// The sensor's MISO and MOSI are exchanged: it receives no command, and drives the chip's MOSI while it is
    /// selected.
    DataExchanged,
    /// The sensor's chip select leads nowhere: it is never selected.
    SelectOpen,
    /// The wires of the stage's limit switches are exchanged.
    LimitsExchanged,
    /// A limit switch of the stage opens where it should close, and the other way round.
    LimitNormallyOpen {
        /// The upper or the lower one.
        upper: bool,
    },
    /// The lever's limit switch likewise.
    TopNormallyOpen,
    /// The first contact of the emergency stop is bridged: the firmware never sees it pressed.
    EStopBridged,
    /// The second contact of the emergency stop is not in the motors' supply.
    EStopKeepsSupply,
    /// The stage's motor is connected the other way round.
    MotorReversed,
    /// PWM and DIR of the stage's bridge are exchanged: DIR switches it, and PWM sets the direction.
    PwmDirExchanged,
    /// The enable of the stage's bridge leads nowhere: the bridge is off.
    BridgeEnableOpen,
    /// The amplifier of the motor current has this gain of the right one's; with exchanged inputs it is negative.
    CurrentGain(f64),
    /// The amplifier's output leads nowhere, and the converter's input floats at 0.3 V (chosen).
    CurrentOpen,
    /// A coil of the lever's motor is not connected: it does not turn.
    LeverCoilOpen,
    /// The lever's driver makes so many sixteenths of a step of each pulse.
    LeverMicrosteps(i64),
    /// The encoder has this share of the lines that it should have.
    EncoderLines(f64),
}

/// Reading of a floating input of the converter, counts.
const FLOATING_COUNTS: f64 = 372.0;
/// Reading of the converter without current, counts.
const MIDDLE_COUNTS: f64 = 2048.0;

/// The mistakes in the wires of a rig; those of the lever and of the encoder are theirs.
#[derive(Clone, Default, Debug)]
pub(super) struct Wires(Vec<Miswired>);

impl Wires {
    pub(super) fn take(&mut self, mistake: Miswired) {
        self.0.push(mistake);
    }

    pub(super) fn have(&self, mistake: Miswired) -> bool {
        self.0.contains(&mistake)
    }

    /// Returns true if the sensor hears the chip.
    pub(super) fn reach_sensor(&self) -> bool {
        !self.have(Miswired::DataExchanged) && !self.have(Miswired::SelectOpen)
    }

    /// The stage's switches at the chip, of those at its lower and at its upper end.
    pub(super) fn limits(&self, (lower, upper): (bool, bool)) -> (bool, bool) {
        let is_open = |upper| self.have(Miswired::LimitNormallyOpen { upper });
        let (lower, upper) = (lower != is_open(false), upper != is_open(true));
        match self.have(Miswired::LimitsExchanged) {
            true => (upper, lower),
            false => (lower, upper),
        }
    }

    /// Duty of the bridge by the PWM's share and by DIR, positive where it drives to higher positions.
    pub(super) fn duty(&self, pwm: f64, dir: bool) -> f64 {
        match (self.have(Miswired::PwmDirExchanged), dir) {
            (false, true) => pwm,
            (false, false) => -pwm,
            // always on, and to and fro with the PWM
            (true, true) => 2.0 * pwm - 1.0,
            // never on
            (true, false) => 0.0,
        }
    }

    /// The motor's share of that.
    pub(super) fn motor_duty(&self, duty: f64) -> f64 {
        match self.have(Miswired::MotorReversed) {
            true => -duty,
            false => duty,
        }
    }

    /// Reading of the converter where the book's wires would give `reading`.
    pub(super) fn amplified(&self, reading: u16) -> u16 {
        if self.have(Miswired::CurrentOpen) {
            return FLOATING_COUNTS as u16;
        }
        // the bridge's current, and not the motor's
        let gain = self.0.iter().find_map(|mistake| match mistake {
            Miswired::CurrentGain(gain) => Some(*gain),
            _ => None,
        });
        let gain = self.motor_duty(gain.unwrap_or(1.0));
        let reading = MIDDLE_COUNTS + gain * (f64::from(reading) - MIDDLE_COUNTS);
        reading.round().clamp(0.0, 4095.0) as u16
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wires(mistake: Miswired) -> Wires {
        let mut wires = Wires::default();
        wires.take(mistake);
        wires
    }

    #[test]
    fn a_bridge_with_exchanged_inputs_runs_away_one_way_and_stands_the_other() {
        let right = Wires::default();
        assert_eq!((right.duty(0.1, true), right.duty(0.1, false)), (0.1, -0.1));
        let wrong = wires(Miswired::PwmDirExchanged);
        assert_eq!((wrong.duty(0.1, true), wrong.duty(0.1, false)), (-0.8, 0.0));
    }

    #[test]
    fn a_reversed_motor_turns_back_and_its_bridge_has_the_same_current() {
        let wrong = wires(Miswired::MotorReversed);
        assert_eq!(wrong.motor_duty(0.1), -0.1);
        // the motor has -100 counts: the bridge +100
        assert_eq!(wrong.amplified(1948), 2148);
        assert_eq!(wires(Miswired::CurrentGain(2.5)).amplified(2148), 2298);
        assert_eq!(wires(Miswired::CurrentGain(-1.0)).amplified(2148), 1948);
    }

    #[test]
    fn switches_that_are_exchanged_or_of_the_other_kind() {
        let closed_above = (false, true);
        assert_eq!(
            wires(Miswired::LimitsExchanged).limits(closed_above),
            (true, false)
        );
        let other = wires(Miswired::LimitNormallyOpen { upper: true });
        assert_eq!(other.limits(closed_above), (false, false));
        assert_eq!(other.limits((false, false)), (false, true));
    }
}
