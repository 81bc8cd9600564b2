//! The table of faults, [`FAULTS`]: how each is detected and how the rig answers. The book's table is made from it.
//!
//! At every fault the stage's motor is braked and the finger lifts before anything is reported.

use serde::{Deserialize, Serialize};

/// A row of the fault table.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Row {
    /// The fault.
    pub fault: Fault,
    /// Its name on the link and on the display.
    pub name: &'static str,
    /// Its detection.
    pub detected: &'static str,
    /// Longest time in ms from the moment it can be detected until the motors have their new outputs.
    pub deadline_ms: u32,
    /// The outputs that stop.
    pub stops: &'static str,
    /// The commands that are refused until it is over.
    pub refused: &'static str,
    /// The user's remedy.
    pub recovery: &'static str,
}

const BOTH: &str = "stage motor braked, finger lifted to the limit switch";
const ARM: &str = "the probe orders the arm to stop and to lift the finger, repeatedly; if the arm does not obey, its \
    line of permission falls";
const ALL: &str = "every movement, until reset";

macro_rules! faults {
    ($($(#[$doc:meta])* $fault:ident, $name:literal, $detected:literal, $deadline:literal,
        $stops:expr, $refused:expr, $recovery:literal;)*) => {
        /// A fault of the rig. Messages and logs number them in this order.
        #[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
        pub enum Fault {
            $($(#[$doc])* $fault),*
        }

        /// Every fault, once, in the order of [`Fault`].
        pub const FAULTS: &[Row] = &[$(Row {
            fault: Fault::$fault,
            name: $name,
            detected: $detected,
            deadline_ms: $deadline,
            stops: $stops,
            refused: $refused,
            recovery: $recovery,
        }),*];

        const NAMES: &[&str] = &[$($name),*];
        const RECOVERIES: &[&str] = &[$($recovery),*];
    };
}

// the fault, its name, its detection, the deadline in ms, the outputs that stop, the commands that are refused, the
// remedy
faults! {
    /// The finger is pressed too hard.
    ForceHigh, "force too high",
        "P_DC above 2.05 N, mean of 10 ms corrected for its lag: a true 2.1 N, since P_DC bends. While a rig that \
         allows high forces presses more than 1.26 N, above 2.1 N: a true 2.18 N. Or P_DC rises by 8 counts while the \
         lever looks for its switch, or while the stage moves under a lifted finger; or by 40 while the rig waits with \
         its finger lifted", 12, "lever driver off at once, then finger lifted; stage motor braked", ALL,
        "look at the lever and the sample; if the finger still presses, turn the lever's knob until it is free; then \
         reset";
    /// The emergency stop is pressed.
    EStop, "emergency stop", "its input, open for 3 ms", 5,
        "both motors by its second contact; finger lifted as soon as there is supply, freed only by the lever's knob \
         before", ALL, "release it, then reset";
    /// The limit switch of the lever is pressed while the finger presses.
    LeverLimit, "lever at its limit", "upper limit switch closed more than 1 mm below it, 3 ms", 5, BOTH, ALL,
        "check the switch and its wire, then reset";
    /// The stage is at a limit switch while it should not be.
    StageLimit, "stage at its limit", "the limit switch ahead of the moving stage closed for 3 ms, except while homing",
        5, BOTH, ALL, "clear the stage's way, then reset";
    /// The motor of the stage is driven and does not turn.
    StageStall, "stage blocked", "less than a tenth of the way made in 30 ms, and the motor has no back-EMF", 35, BOTH,
        ALL, "clear the stage's way, then reset";
    /// The motor of the stage turns, and the encoder does not count.
    EncoderSilent, "encoder silent",
        "less than a tenth of the way made in 30 ms, and the motor's back-EMF shows that it turns", 35, BOTH, ALL,
        "check the encoder's wires, then reset";
    /// The stage does not follow its profile.
    StageOff, "stage off its path",
        "more than 1 mm plus the way of 40 ms off the profile, or not arrived 0.3 s after its end", 2, BOTH, ALL,
        "check load, supply and encoder, then reset";
    /// No readable word from the sensor.
    SensorSilent, "sensor silent", "no readable word of P_AC or of P_DC for 10 ms", 12, BOTH, ALL,
        "look whether the finger is up, and turn the lever's knob until it is: without the sensor only switch and \
         steps show it; check the sensor's cable and power, then reset";
    /// Too many words are damaged.
    SensorErrors, "sensor link bad", "23 damaged words within a second: half a percent", 2, BOTH, ALL,
        "check cable length, ground and clock phase, then reset";
    /// The sensor repeats the same word.
    SensorFrozen, "sensor frozen", "P_AC the same for 100 ms, which always has noise, or at an end of its range", 102,
        BOTH, ALL, "switch the probe and its sensor off and on";
    /// Samples of a slide are missing.
    SlideGap, "gap in a slide", "a damaged or late word between the background and the end of the slide", 2,
        "nothing: the slide is finished", "the slide: it is repeated", "none";
    /// Six slides in a row were rejected.
    Rejected, "six slides rejected", "counted", 2, "the exploration ends, finger lifted", "nothing",
        "look at the reasons given";
    /// The lever came down all the way without contact.
    NoContact, "no contact", "lever at its lower end, P_DC unchanged", 2, BOTH, ALL,
        "put a sample under the finger, then reset";
    /// The lever steps and the force does not follow.
    LeverSlips, "lever slips",
        "after contact, steps raise P_DC less than the finger's and the sample's compliance so far predicts; or the \
         lever is at its lower end before the force is reached; or the finger is still in contact when lifted, or not \
         lifted at the beginning of a press", 2, BOTH, ALL, "check the lever's motor and its current, then reset";
    /// The contact force does not stay where it was put.
    Unsteady, "force unsteady",
        "six trims and still more than 1 count and 5 % off, trims that add up to 15 %, a zero that has moved by 8 \
         counts, P_DC in the air that moves by 20 counts while the rig is calibrated, contact within 0.1 mm of where \
         the zero was taken, or a slide whose mean force is 3 counts and a quarter off that of the still finger", 2,
        BOTH, ALL, "check that sample and lever are fixed, then reset";
    /// The probe's own tasks no longer run.
    TasksHung, "tasks hung",
        "the firmware's tasks have not checked in for 2 s, or a request makes no progress for 30 s", 2, BOTH, ALL,
        "none: the watchdog restarts the probe once the finger is lifted";
    /// The lever did not find its limit switch.
    LeverNotHome, "lever not home",
        "limit switch not reached in 1.25 times the travel, or released for 20 ms under a lever that stands at it, \
         P_DC still as high as it had risen on the last way up, or P_DC there or at the first zero more than 40 counts \
         off the calibration's", 2, "lever motor off, stage motor braked", ALL,
        "turn the lever's knob until the finger is free, check its driver, the switch and that DIR is not inverted; \
         calibrate a finger that has drifted, then reset";
    /// The stage did not find its limit switch.
    StageNotHome, "stage not home",
        "limit switch not reached: the stage falls behind, or has gone 1.25 times the travel, or 3 mm where it touches \
         it again, or is still in the switch 7 mm from where it closed", 2, BOTH, ALL,
        "clear the stage's way and check the switch, then reset";
    /// The finger presses, and P_DC does not show it.
    PressureDead, "pressure dead",
        "P_AC shows contact and P_DC does not rise within 0.5 mm, or stops rising while P_AC shows that the pressure \
         rises, or no contact 1 mm below that of the last press on this sample", 2, BOTH, ALL,
        "look whether the finger is up, and turn the lever's knob until it is; check the fingertip and the sensor's \
         P_DC, then reset";
    /// The arm that moves the finger sends no reports any more.
    ArmSilent, "arm silent", "no report of the arm about its open order for 0.5 s", 502, ARM, ALL,
        "look whether the finger is up, and move the arm away by its own controls; check that its program runs, then \
         reset";
    /// The arm does not stop when ordered to.
    ArmRuns, "arm does not stop",
        "the force is still over the limit 0.2 s after a stop, or the finger still presses after 2 s", 202, ARM, ALL,
        "press the arm's own emergency stop, and move it away by its controls; then reset";
    /// The arm did something other than its order.
    ArmOff, "arm off its order",
        "the arm reports a press and P_DC is more than 2 counts and 10 % off the force; it reports a lifted finger and \
         P_DC disagrees; its slide was 5 % shorter, longer, slower or faster than ordered, by its report or by the \
         probe's clock; it exceeded its time; or it reports a failure", 2, ARM, ALL,
        "check the arm, the sample and the messages of the arm's program; then reset";
}

impl Fault {
    /// Its name on the link and on the display. It has a list of its own, so that the chip's flash need not hold the
    /// whole table.
    pub fn name(self) -> &'static str {
        NAMES.get(self as usize).copied().unwrap_or("unknown fault")
    }

    /// The user's remedy; from a list of its own, too.
    pub fn recovery(self) -> &'static str {
        RECOVERIES.get(self as usize).copied().unwrap_or("reset")
    }

    /// Returns true if one movement can cause it or if it can pass by itself: a rig that has homed after it may
    /// continue without a person. Each press begins with its checks of the zero, and every guard stays on.
    pub const fn is_of_the_movement(self) -> bool {
        if matches!(self, Self::ArmOff) {
            return true;
        }
        matches!(self, Self::Unsteady | Self::LeverSlips | Self::StageOff)
    }

    /// The fault's row of the table.
    pub fn row(self) -> Option<&'static Row> {
        FAULTS.iter().find(|row| row.fault == self)
    }

    pub(super) const fn bit(self) -> u32 {
        1 << self as u32
    }
}

impl core::fmt::Display for Fault {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(self.name())
    }
}

impl core::error::Error for Fault {}
