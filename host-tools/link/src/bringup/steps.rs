//! The steps of the first evening, in their order.

use tactus_core::sensor::FingerName;
use tactus_core::sensor::pressure::SLOTS_HZ;
use tactus_core::wire::bringup::{
    Look, MAX_POINTS, Measure, POINTS, Pin, Saw, SensorSeen, Stopped, limits,
};

use super::bare::{BARE, HAND};
use super::judge::mounted::{AIR_COUNTS, OFF_LINE, SPEED_SHARE, UNEVEN_MM};
use super::judge::{
    self, BRAKING_MA, CORE_KHZ, COUNTS_PER_MM, Finding, GAIN, LEVER_MM, LOGIC_V, MOTOR_V, SWITCHES,
    TRAVEL_MM, Went,
};
use super::mounted::Mounted;
use super::seams::{Board, Person, Trouble};

/// A step.
pub struct Step {
    /// Its name for programs and for `--from`.
    pub key: &'static str,
    /// The subject of the check.
    pub checks: &'static str,
    /// The work of the person and of the board.
    pub how: &'static str,
    /// The limits of a right result.
    pub limit: fn() -> String,
    pub(super) run: Run,
}

/// The work of a step, and the image that it takes.
pub(super) enum Run {
    SelfTest(fn(&mut Bench<'_>) -> Result<Finding, Trouble>),
    Rig(fn(&mut Mounted<'_>) -> Result<Finding, Trouble>),
}

impl Step {
    /// The image that it takes.
    pub fn image(&self) -> Image {
        match self.run {
            Run::SelfTest(_) => Image::SelfTest,
            Run::Rig(_) => Image::Rig,
        }
    }
}

/// What is brought up.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Product {
    /// A board without anything.
    Bare,
    /// The rig of the paper.
    Rig,
    /// The handheld.
    Handheld,
    /// A probe on an arm.
    Arm,
    /// A probe on a printer, which also slides once.
    Printer,
}

/// The steps of a probe without motors; a handheld has those of [`HAND`], too.
const FINGER: [&str; 8] = [
    "chip", "pins", "sensor", "noise", "finger", "store", "watchdog", "scale",
];

impl Product {
    /// Its steps, in their order.
    pub fn steps(self) -> Vec<&'static Step> {
        let finger = STEPS.iter().filter(|step| FINGER.contains(&step.key));
        match self {
            Self::Bare => BARE.iter().collect(),
            Self::Rig => STEPS.iter().collect(),
            Self::Handheld => HAND.iter().chain(finger).collect(),
            Self::Arm => finger.collect(),
            Self::Printer => {
                let mounted = STEPS
                    .iter()
                    .filter(|step| ["zero", "slide"].contains(&step.key));
                finger.chain(mounted).collect()
            }
        }
    }
}

/// An image of the firmware.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Image {
    /// That which measures.
    SelfTest,
    /// The rig's own.
    Rig,
}

/// The board and the person at it.
pub struct Bench<'b> {
    pub(super) board: &'b mut dyn Board,
    pub(super) person: &'b mut dyn Person,
    /// It is a rig's.
    pub(super) has_motors: bool,
}

macro_rules! ask {
    ($bench:expr, $measure:expr, $saw:ident) => {
        match $bench.board.ask($measure)? {
            Saw::$saw(seen) => seen,
            other => return Err(Trouble::Unexpected(format!("{other:?}"))),
        }
    };
}
pub(super) use ask;

/// Weights that somebody has, and what one g is, mN.
const WEIGHTS_G: [u8; 3] = [50, 100, 150];
const MN_PER_G: f64 = 9.806_65;
/// Time for which the last one stands, s.
const HELD_S: u32 = 4;

fn range((from, to): (f64, f64), unit: &str) -> String {
    format!("{from} to {to} {unit}")
}

/// [`limits::LEVER_PLAY`] at 0.625 um a step.
fn play() -> String {
    format!("{:.1} mm", f64::from(limits::LEVER_PLAY) * 0.625e-3)
}

/// All of them.
pub static STEPS: &[Step] = &[
    Step {
        key: "supply",
        checks: "supplies",
        how: "a multimeter at the board's pin 3V3 and at the motors' drivers",
        limit: || format!("{}, {}", range(LOGIC_V, "V"), range(MOTOR_V, "V")),
        run: Run::SelfTest(|bench| {
            let logic_v = bench.person.number(
                "Measure the voltage at the board's pin 3V3 against GND",
                "V",
            )?;
            let motor_v = bench
                .person
                .number("Measure the supply of the motors' drivers", "V")?;
            Ok(judge::supplies(logic_v, motor_v))
        }),
    },
    Step {
        key: "chip",
        checks: "clocks, PA12, brown-out level, the last reset",
        how: "the board looks",
        limit: || {
            let (khz, off) = CORE_KHZ;
            format!(
                "{khz} +- {off} kHz, by the 8 MHz of the ST-LINK; PA12 low; level 3; no last words"
            )
        },
        run: Run::SelfTest(|bench| {
            let (reset, last_words) = bench.hello()?;
            let seen = ask!(bench, Measure::Chip, Chip);
            Ok(judge::chip(&seen, reset, last_words.as_deref()))
        }),
    },
    Step {
        key: "pins",
        checks: "pins that float or are tied",
        how: "the board pulls each pin up and down",
        limit: || {
            "switches not high; encoder driven; MISO and not MOSI driven by the selected sensor; PD14 high, PE13 and \
                 PC8 low by their resistors".to_owned()
        },
        run: Run::SelfTest(|bench| {
            // the pins are looked at when the board starts, before their drivers have them
            bench.board.restart(Measure::Restart)?;
            let seen = ask!(bench, Measure::Pins, Pins);
            Ok(match bench.has_motors {
                true => judge::pins(&seen),
                false => judge::finger_pins(&seen),
            })
        }),
    },
    Step {
        key: "sensor",
        checks: "the sensor's identity and its words",
        how: "the board reads it for a second",
        limit: || format!("{SLOTS_HZ} words, none garbled, late or silent"),
        run: Run::SelfTest(|bench| Ok(judge::sensor(&bench.sensor()?))),
    },
    Step {
        key: "noise",
        checks: "what the sensor says without contact",
        how: "the finger lies still, nothing touches it",
        limit: || {
            let limits = FingerName::ALL.map(|finger| {
                let at_rest = finger.parts().model.at_rest;
                let ((still, noisy), (low, high)) = (at_rest.pac_noise_counts, at_rest.pdc_counts);
                format!("`{finger}` {still} to {noisy}, {low} to {high}")
            });
            format!("counts of P_AC (rms) and P_DC: {}", limits.join("; "))
        },
        run: Run::SelfTest(|bench| {
            bench
                .person
                .done("Lay the finger down so that nothing touches its tip")?;
            let seen = bench.sensor()?;
            Ok(judge::noise(&seen))
        }),
    },
    Step {
        key: "switches",
        checks: "each switch by hand",
        how: "the person presses one after the other",
        limit: || "closed, open while it is pressed, and no other one with it".to_owned(),
        run: Run::SelfTest(|bench| {
            bench.person.done(
                "Push the stage to its middle by hand; turn the lever's knob until its switch is free; release the \
                     emergency stop",
            )?;
            let mut looks = Vec::new();
            for pin in SWITCHES {
                let let_go = bench.look()?;
                bench.person.press(pin, true)?;
                let pressed = bench.look()?;
                bench.person.press(pin, false)?;
                looks.push([let_go, pressed]);
            }
            let looks = looks
                .try_into()
                .map_err(|_| Trouble::Unexpected("a switch".to_owned()))?;
            Ok(judge::switches(&looks))
        }),
    },
    Step {
        key: "stop",
        checks: "the second contact of the emergency stop",
        how: "the person presses it and looks at the drivers' supply",
        limit: || "both drivers are without supply".to_owned(),
        run: Run::SelfTest(|bench| {
            bench.person.press(Pin::EStop, true)?;
            let seen = bench.look()?.e_stop;
            let gone = bench.person.choose(
                "Is the supply of both motors' drivers gone now (their LED, or a multimeter)?",
                &["yes", "no"],
            )? == 0;
            bench.person.press(Pin::EStop, false)?;
            Ok(judge::stop(seen, gone))
        }),
    },
    Step {
        key: "hand",
        checks: "the encoder's sense and scale, the places of the stage's switches",
        how: "the person pushes the stage from its left switch to its right one",
        limit: || {
            format!(
                "up to the right, {COUNTS_PER_MM} counts a mm: {}; each switch opens at its end",
                range(TRAVEL_MM, "mm")
            )
        },
        run: Run::SelfTest(|bench| {
            bench
                .person
                .done("Push the stage by hand to the left until its switch opens")?;
            let left = bench.look()?;
            bench
                .person
                .done("Push it to the right until its switch opens")?;
            let right = bench.look()?;
            bench.person.done("Push it back to its middle")?;
            Ok(judge::by_hand(&left, &right))
        }),
    },
    Step {
        key: "current",
        checks: "the amplifier of the motor's current at rest",
        how: "the board converts for 80 ms, the bridge off",
        limit: || {
            let (zero, off) = limits::CURRENT_ZERO;
            format!("{zero} +- {off} counts, below {} rms", limits::CURRENT_RMS)
        },
        run: Run::SelfTest(|bench| Ok(judge::rest(&bench.look()?))),
    },
    Step {
        key: "finger",
        checks: "the finger is off its mount, and P_DC lives",
        how: "the person squeezes it in the hand: without that no motor moves",
        limit: || format!("P_DC rises by {} mN, and comes back", limits::SQUEEZED_MN),
        run: Run::SelfTest(|bench| Ok(judge::squeezed(bench.squeeze()?))),
    },
    Step {
        key: "lever-sense",
        checks: "the lever's DIR by 1 mm",
        how: "the motor makes 1600 steps, the person looks",
        limit: || "up where it should go up".to_owned(),
        run: Run::SelfTest(|bench| {
            // at its top it can only go down
            let (steps, way) = match bench.look()?.lever_top {
                true => (1600, "down"),
                false => (-1600, "up"),
            };
            let question = format!(
                "The lever is going 1 mm {way}, in a second or two. Look at it: which way does it go?"
            );
            bench.person.watch(&question)?;
            let seen = bench.lever(Measure::Lever(steps))?;
            let went = bench.went("The lever went", [way, "the other way", "nowhere"])?;
            Ok(judge::lever_sense(&seen, went))
        }),
    },
    Step {
        key: "lever-switch",
        checks: "the lever's switch, and that no step is lost",
        how: "up to the switch, 2 mm down, up again",
        limit: || format!("the switch opens at the same place within {}", play()),
        run: Run::SelfTest(|bench| {
            let up = bench.lever(Measure::LeverTop)?;
            let down = bench.lever(Measure::Lever(3200))?;
            let back = bench.lever(Measure::LeverTop)?;
            Ok(judge::lever_switch(&up, &down, &back))
        }),
    },
    Step {
        key: "lever-scale",
        checks: "the lever's microsteps and lead",
        how: "6400 steps down; the person measures with a caliper",
        limit: || format!("{:.1} +- {:.1} mm", LEVER_MM.0, LEVER_MM.1),
        run: Run::SelfTest(|bench| {
            bench.lever(Measure::LeverTop)?;
            let before = bench.person.number(
                "Measure the height of the finger's mount over the plate with a caliper",
                "mm",
            )?;
            for _ in 0..2 {
                bench.lever(Measure::Lever(3200))?;
            }
            let after = bench
                .person
                .number("The lever went down. Measure that height again", "mm")?;
            bench.lever(Measure::LeverTop)?;
            Ok(judge::lever_scale(before - after))
        }),
    },
    Step {
        key: "foam",
        checks: "the lever against a load",
        how: "a block of foam under the empty mount; three times 4 mm down and up to the switch",
        limit: || format!("no step lost beyond {}", play()),
        run: Run::SelfTest(|bench| {
            bench.person.done("Put a block of soft foam under the empty mount, so that it is pressed by 2 or 3 mm")?;
            let mut ways = Vec::new();
            for _ in 0..3 {
                let first = bench.lever(Measure::Lever(3200))?;
                let mut down = bench.lever(Measure::Lever(3200))?;
                down.steps += first.steps;
                down.ended = first.ended.and(down.ended);
                ways.push([down, bench.lever(Measure::LeverTop)?]);
            }
            bench.person.done("Take the foam away")?;
            Ok(judge::foam(&ways))
        }),
    },
    Step {
        key: "stage-sense",
        checks: "the stage's motor, its DIR, and the encoder with it, by 1 mm",
        how: "the motor goes 1 mm to the right and back, the person looks at the first",
        limit: || "to the right, counted up, with current of the same sign".to_owned(),
        run: Run::SelfTest(|bench| {
            bench.person.watch("The stage is going 1 mm to the right, in a second. Look at it: which way does it go?")?;
            let right = ask_stage(bench, true)?;
            let went = bench.went("The stage went", ["to the right", "to the left", "nowhere"])?;
            let left = ask_stage(bench, false)?;
            Ok(judge::stage_sense(&right, &left, went))
        }),
    },
    Step {
        key: "bridge",
        checks: "the bridge's decay",
        how: "1 mm to each side, then the PWM low while the stage still moves",
        limit: || format!("more than {BRAKING_MA:.0} mA against the movement"),
        run: Run::SelfTest(|bench| {
            let right = ask_stage(bench, true)?;
            let left = ask_stage(bench, false)?;
            Ok(judge::bridge(&right, &left))
        }),
    },
    Step {
        key: "resistor",
        checks: "the amplifier's gain against a known resistor",
        how: "a resistor of 22 ohm, 5 W, in the place of the stage's motor; duties to 0.48 on both sides",
        limit: || range(GAIN, "V/A"),
        run: Run::SelfTest(|bench| {
            let ohm = bench.person.number(
                "Take the wires of the stage's motor off the bridge, put a resistor of \
                 some 22 ohm and 5 W there, and measure it",
                "ohm",
            )?;
            let supply_v = bench
                .person
                .number("Measure the supply of the bridge", "V")?;
            let mut done = bench.board.ask(Measure::Ramp)?;
            if done == Saw::Ramp(Err(Stopped::NotSqueezed)) && bench.squeeze()?.is_ok() {
                done = bench.board.ask(Measure::Ramp)?;
            }
            let Saw::Ramp(done) = done else {
                return Err(Trouble::Unexpected(format!("{done:?}")));
            };
            let points = bench.points()?;
            bench.person.done("Connect the stage's motor again")?;
            Ok(judge::resistor(done, &points, supply_v, ohm))
        }),
    },
    Step {
        key: "store",
        checks: "the store",
        how: "the board writes the skin's record as it is, and reads it",
        limit: || "the same".to_owned(),
        run: Run::SelfTest(|bench| {
            let done = ask!(bench, Measure::Store, Store);
            Ok(judge::store(&done.map_err(|why| why.to_string())))
        }),
    },
    Step {
        key: "watchdog",
        checks: "the watchdog",
        how: "the board hangs on purpose",
        limit: || "it starts again, by the watchdog".to_owned(),
        run: Run::SelfTest(|bench| Ok(judge::watchdog(bench.board.restart(Measure::Watchdog)?))),
    },
    Step {
        key: "scale",
        checks: "the force scale, by weights",
        how: "three weights, one after the other, on the tip of the finger, which lies on its back",
        limit: || {
            format!(
                "a line within {:.0} %, 5.75 to 23 mN a count; back within {AIR_COUNTS} counts",
                100.0 * OFF_LINE
            )
        },
        run: Run::SelfTest(|bench| {
            bench.person.done(
                "Lay the finger down with its tip up, in something that holds it, and let nothing \
                 touch the tip",
            )?;
            let [air, _] = bench.sensor()?.pdc;
            let mut points = Vec::new();
            for grams in WEIGHTS_G {
                let grams = bench.person.number(
                    &format!("Put some {grams} g on its tip so that it stays there by itself, and say how much it is"),
                    "g",
                )?;
                let [pdc, _] = bench.sensor()?.pdc;
                points.push([f64::from(pdc - air), grams * MN_PER_G]);
            }
            let [first, _] = bench.sensor()?.pdc;
            for _ in 1..HELD_S {
                bench.sensor()?;
            }
            let [last, _] = bench.sensor()?.pdc;
            bench.person.done("Take the weight away")?;
            let [after, _] = bench.sensor()?.pdc;
            Ok(Finding {
                points: points.clone(),
                ..judge::mounted::scale(&points, last - first, after - air)
            })
        }),
    },
    Step {
        key: "zero",
        checks: "P_DC in the air, and that the force scale is kept",
        how: "the rig's firmware calibrates twice, the finger on its mount",
        limit: || format!("twice the same within {AIR_COUNTS} counts"),
        run: Run::Rig(|mounted| mounted.zero()),
    },
    Step {
        key: "speed",
        checks: "the stage's speed by its encoder",
        how: "runs at four speeds there and back, the finger in the air",
        limit: || {
            format!(
                "within {:.0} % of 10, 25, 40 and 63 mm/s, even to {UNEVEN_MM} mm",
                100.0 * SPEED_SHARE
            )
        },
        run: Run::Rig(|mounted| mounted.speed()),
    },
    Step {
        key: "slide",
        checks: "the first slide",
        how: "one slide over computer paper",
        limit: || {
            "no fault, no lost word; louder than the still finger, and with traction".to_owned()
        },
        run: Run::Rig(|mounted| mounted.slide()),
    },
];

fn ask_stage(
    bench: &mut Bench<'_>,
    to_the_right: bool,
) -> Result<tactus_core::wire::bringup::StageSeen, Trouble> {
    let mut seen = ask!(bench, Measure::Stage(to_the_right), Stage);
    if seen.ended == Err(Stopped::NotSqueezed) && bench.squeeze()?.is_ok() {
        seen = ask!(bench, Measure::Stage(to_the_right), Stage);
    }
    Ok(seen)
}

impl Bench<'_> {
    pub(super) fn hello(&mut self) -> Result<(tactus_core::wire::Reset, Option<String>), Trouble> {
        match self.board.ask(Measure::Hello)? {
            Saw::Hello {
                reset, last_words, ..
            } => Ok((reset, last_words.map(|words| words.to_string()))),
            other => Err(Trouble::Unexpected(format!("{other:?}"))),
        }
    }

    fn look(&mut self) -> Result<Look, Trouble> {
        Ok(ask!(self, Measure::Look, Look))
    }

    fn sensor(&mut self) -> Result<SensorSeen, Trouble> {
        Ok(ask!(self, Measure::Sensor, Sensor))
    }

    /// True if the person squeezed the finger, which is off its mount.
    fn squeeze(&mut self) -> Result<Result<(), Stopped>, Trouble> {
        // P_DC's rest is that of the last second of words
        self.person.done(match self.has_motors {
            true => "Take the finger off its mount, its cable on, and lay it down",
            false => "Lay the finger down as it is in its handle or holder, its tip free",
        })?;
        self.sensor()?;
        self.look()?;
        self.person.squeeze()?;
        Ok(ask!(self, Measure::Squeeze, Squeeze))
    }

    fn lever(
        &mut self,
        measure: Measure,
    ) -> Result<tactus_core::wire::bringup::LeverSeen, Trouble> {
        let mut seen = ask!(self, measure, Lever);
        if seen.ended == Err(Stopped::NotSqueezed) && self.squeeze()?.is_ok() {
            seen = ask!(self, measure, Lever);
        }
        Ok(seen)
    }

    fn went(&mut self, question: &str, answers: [&str; 3]) -> Result<Went, Trouble> {
        let chosen = self.person.choose(question, &answers)?;
        Ok(Went::ALL.get(chosen).copied().unwrap_or(Went::Nowhere))
    }

    /// The last series.
    fn points(&mut self) -> Result<Vec<[f64; 2]>, Trouble> {
        let mut points = Vec::new();
        while points.len() < MAX_POINTS {
            let part = ask!(self, Measure::Series(points.len() as u16), Series);
            points.extend(part.iter().map(|point| point.map(f64::from)));
            if part.len() < POINTS {
                break;
            }
        }
        Ok(points)
    }
}
