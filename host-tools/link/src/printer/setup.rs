//! The set-up of a printer: where the sample lies, how deep the finger may go, how the machine answers. Measured once
//! with a person beside it, and kept in a file.

use std::io::Write as _;

use serde::{Deserialize, Serialize};
use tactus_core::explorer::Strategy;
use tactus_core::rig::arm::ArmMovement;
use tactus_core::wire::Identify;

use super::gcode::Dialect;
use super::moves::Path;
use super::{Motion, Press, Printer, PrinterError};
use crate::error::OperationError;
use crate::person::{Question, QuestionKind};
use crate::probe::{Probe, turn};
use crate::request::Request;
use crate::say::Prompts;

/// Version of the file.
const VERSION: u8 = 1;
/// Height of a lifted finger over the highest touch, and depth of the floor below the lowest, mm.
const LIFTED_MM: f64 = 3.0;
const FLOOR_MM: f64 = 3.0;
/// Depth below the finger's place at set-up to which it looks for the sample, mm.
const SEARCHES_MM: f64 = 8.0;
/// First approach, um/s: the person looks on.
const FIRST_UM_S: u32 = 500;
const APPROACH_UM_S: u32 = 1000;
/// Speeds of the slides in the air by which acceleration and delay are measured, mm/s.
const AIR_MM_S: [f64; 2] = [10.0, 50.0];
/// The delay of a slide's begin varies by as much beside what was measured, s.
const START_OFF_S: f64 = 0.02;
/// Constant speed before the window begins and behind its report, s.
const MARGIN_S: f64 = 0.03;
/// Shortest sample, mm, and ranges of what is measured of a machine that can be right.
const SHORTEST_MM: f64 = 40.0;
const ACCELERATIONS: (f64, f64) = (100.0, 20_000.0);
const STIFFNESSES: (f64, f64) = (0.2, 6.0);

/// An axis along which a finger slides.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum Axis {
    /// Along X.
    X = 0,
    /// Along Y.
    Y = 1,
}

impl Axis {
    /// Its letter in G-code.
    pub fn letter(self) -> char {
        ['X', 'Y'][self as usize]
    }
}

/// What was measured and said of a printer. Places are of its own frame, mm.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Setup {
    /// Version of this file.
    pub version: u8,
    /// Its port.
    pub port: String,
    /// Its baud rate.
    pub baud: u32,
    /// Its firmware.
    pub dialect: Dialect,
    /// The axis that slides.
    pub axis: Axis,
    /// Where the sample begins and ends along it.
    pub sample_mm: [f64; 2],
    /// Height of a lifted finger.
    pub lifted_mm: f64,
    /// Height that it never goes below.
    pub floor_mm: f64,
    /// Acceleration along the sample, mm/s^2.
    pub acceleration_mm_s2: f64,
    /// Least and longest time from the first line of a slide to its motion, s.
    pub start_s: [f64; 2],
    /// Stiffness of finger, holder and gantry, N/mm; play of the Z axis, mm.
    pub stiffness_n_mm: Option<f64>,
    /// Play of the Z axis, mm.
    pub backlash_mm: Option<f64>,
    /// Where it was left with its finger lifted; none while it works.
    pub parked: Option<[f64; 2]>,
}

/// Why a file is no set-up.
#[derive(Debug, thiserror::Error)]
pub enum SetupError {
    /// It cannot be read.
    #[error("it is no set-up of a printer ({0}): run `tactus device printer setup`")]
    Json(#[from] serde_json::Error),
    /// Something in it cannot be.
    #[error("its {0} cannot be: run `tactus device printer setup`")]
    Value(&'static str),
}

impl Setup {
    /// Reads a file. Errors: it is damaged, or of another version.
    pub fn read(text: &str) -> Result<Self, SetupError> {
        let setup: Self = serde_json::from_str(text)?;
        let wrong = |wrong: bool, what| match wrong {
            true => Err(SetupError::Value(what)),
            false => Ok(()),
        };
        let [from, to] = setup.sample_mm;
        let [soonest, latest] = setup.start_s;
        let (slowest, fastest) = ACCELERATIONS;
        wrong(setup.version != VERSION, "version")?;
        wrong(!(9600..=2_000_000).contains(&setup.baud), "baud")?;
        wrong(
            !((to - from).abs() >= SHORTEST_MM && from.is_finite()),
            "sample_mm",
        )?;
        wrong(
            !(to - from).is_finite() || (to - from).abs() > 1000.0,
            "sample_mm",
        )?;
        let depth = setup.lifted_mm - setup.floor_mm;
        wrong(!(1.0..=40.0).contains(&depth), "floor_mm")?;
        wrong(
            !(slowest..=fastest).contains(&setup.acceleration_mm_s2),
            "acceleration_mm_s2",
        )?;
        wrong(
            !(soonest >= -0.1 && latest >= soonest && latest < 2.0),
            "start_s",
        )?;
        let parked = setup.parked.unwrap_or_default();
        wrong(
            parked.iter().any(|mm| mm.abs() > 2000.0 || mm.is_nan()),
            "parked",
        )?;
        Ok(setup)
    }

    /// Returns the text of its file.
    pub fn write(&self) -> String {
        // numbers, names and lists: nothing in it can fail
        serde_json::to_string_pretty(self).unwrap_or_default() + "\n"
    }

    /// Direction along the sample from its begin to its end.
    fn sign(&self) -> f64 {
        (self.sample_mm[1] - self.sample_mm[0]).signum()
    }

    pub(super) fn approach_um_s(&self) -> u32 {
        match self.stiffness_n_mm {
            Some(_) => APPROACH_UM_S,
            None => FIRST_UM_S,
        }
    }

    /// Time of a way from rest to rest at this speed, s.
    pub(super) fn seconds(&self, length_mm: f64, mm_s: f64) -> f64 {
        length_mm.abs() / mm_s + mm_s / self.acceleration_mm_s2
    }

    /// The way of a movement's slide on the sample.
    pub(super) fn path(&self, movement: &ArmMovement) -> Result<Path, PrinterError> {
        let speed = f64::from(movement.speed_um_s) * 1e-3;
        let length = f64::from(movement.length_um) * 1e-3;
        let [begin, end] = self.sample_mm;
        let has = (end - begin).abs();
        let [soonest, latest] = self.start_s;
        let steady_s = latest + MARGIN_S + speed / self.acceleration_mm_s2;
        let unsure_mm = speed * (latest - soonest + 2.0 * MARGIN_S);
        let ramps = speed * speed / self.acceleration_mm_s2;
        let travel = (ramps + unsure_mm + length).min(has);
        let length_mm = travel - ramps - unsure_mm;
        // the probe takes a slide that is a twentieth shorter
        if length_mm < 0.96 * length {
            let needs = ramps + unsure_mm + length;
            return Err(PrinterError::TooShort { speed, needs, has });
        }
        let start = f64::from(movement.start.min(1000)) * 1e-3;
        let from_mm = begin + self.sign() * (has - travel) * start;
        Ok(Path {
            from_mm,
            to_mm: from_mm + self.sign() * travel,
            speed,
            steady_s,
            length_mm,
            newton: f64::from(movement.force_mn) * 1e-3,
        })
    }
}

async fn consents(probe: &Probe, said: &str, asked: &str) -> Result<(), OperationError> {
    let question = Question {
        said: said.to_owned(),
        asked: asked.to_owned(),
        kind: QuestionKind::Consent,
    };
    match probe.ask(question).await? {
        true => Ok(()),
        false => Err(OperationError::said(
            "stopped: run the same command again when it is mended",
        )),
    }
}

fn failed(why: PrinterError) -> OperationError {
    OperationError::said(why)
}

/// What the printer is: the first step of its set-up.
async fn greet(probe: &Probe, printer: &Printer, port: &str) -> Result<Dialect, OperationError> {
    let dialect = printer.identify().await.map_err(failed)?;
    let named = match dialect {
        Dialect::Marlin {
            emergency_parser: true,
        } => "Marlin with its emergency parser: it can be stopped at once",
        Dialect::Marlin { .. } => {
            "Marlin without emergency parser: it stops within a fifth of a second"
        }
        Dialect::Klipper => "Klipper: home it by its own screen first; it stops within a second",
    };
    writeln!(probe.words(), "1. The printer at {port} is {named}.")?;
    printer.greet().await.map_err(failed)?;
    Ok(dialect)
}

/// The set-up that a run before has left, where nothing has moved since.
async fn left(probe: &Probe, printer: &Printer) -> Result<Option<Setup>, OperationError> {
    let Some(setup) = printer.setup() else {
        return Ok(None);
    };
    let [begin, end] = setup.sample_mm;
    let stands = Question {
        said: format!(
            "   The set-up was left after step 3: the sample lies along {} from {begin:.1} to {end:.1} mm.",
            setup.axis.letter()
        ),
        asked: "Do printer, finger and sample stand as they did, and is the way free".to_owned(),
        kind: QuestionKind::Consent,
    };
    let stands = probe.ask(stands).await?;
    if !stands {
        printer.state().setup = None;
    }
    Ok(stands.then_some(setup))
}

/// Where the sample lies on the printer: steps 2 and 3 of its set-up.
async fn lies(
    probe: &Probe,
    printer: &Printer,
    dialect: Dialect,
    port: &str,
    baud: u32,
) -> Result<Setup, OperationError> {
    consents(
        probe,
        "2. With the printer's own screen (Move axis), bring the finger over one end of the sample, 5 mm inside, so \
         that it hangs 2 to 4 mm above it.",
        "Is it there, and is the way over the sample free",
    )
    .await?;
    let begin = printer.done(10.0).await.map_err(failed)?;
    consents(
        probe,
        "3. Now bring it over the other end in the same way, at the same height; only X or only Y.",
        "Is it there",
    )
    .await?;
    let end = printer.done(10.0).await.map_err(failed)?;
    let ways = [end[0] - begin[0], end[1] - begin[1]];
    let axis = match ways[0].abs() >= ways[1].abs() {
        true => Axis::X,
        false => Axis::Y,
    };
    let (along, across) = (ways[axis as usize].abs(), ways[1 - axis as usize].abs());
    if along < SHORTEST_MM || across > 0.05 * along {
        return Err(OperationError::said(format!(
            "the finger went {along:.0} mm along the sample and {across:.0} mm across: it needs {SHORTEST_MM:.0} mm or \
             more along X or Y alone"
        )));
    }
    let hangs = begin[2].min(end[2]);
    let setup = Setup {
        version: VERSION,
        port: port.to_owned(),
        baud,
        dialect,
        axis,
        sample_mm: [begin[axis as usize], end[axis as usize]],
        lifted_mm: begin[2].max(end[2]),
        floor_mm: hangs - SEARCHES_MM,
        acceleration_mm_s2: 500.0,
        start_s: [0.0, 0.4],
        stiffness_n_mm: None,
        backlash_mm: None,
        parked: None,
    };
    printer.begin_setup(setup.clone(), [end[axis as usize], end[2]]);
    writeln!(
        probe.words(),
        "   It slides along {} over {along:.0} mm.",
        axis.letter()
    )?;
    Ok(setup)
}

/// Sets a printer up with a person beside it: says at each step what it does next, and moves nothing before the person
/// has said that the way is free. Goes on with the set-up that the printer has, if a run before has left one. Returns
/// what is to be kept.
pub async fn set_up(
    probe: &Probe,
    printer: &Printer,
    port: &str,
    baud: u32,
) -> Result<Setup, OperationError> {
    let mut words = probe.words();
    let dialect = greet(probe, printer, port).await?;
    let mut setup = match left(probe, printer).await? {
        Some(setup) => setup,
        None => lies(probe, printer, dialect, port, baud).await?,
    };
    let along = (setup.sample_mm[1] - setup.sample_mm[0]).abs();
    printer.park(printer.at()[1] + 5.0).await.map_err(failed)?;
    consents(
        probe,
        "4. It has moved 5 mm by the screw of Z.",
        "Did the finger go up by about 5 mm",
    )
    .await?;
    let measured = printer.motion().await.map_err(failed)?;
    (setup.acceleration_mm_s2, setup.start_s) = measured;
    consents(
        probe,
        &format!(
            "5. It has slid to and fro in the air over {along:.0} mm: {:.0} mm/s^2, {:.0} to {:.0} ms from a line to \
             its motion.",
            setup.acceleration_mm_s2,
            setup.start_s[0] * 1e3,
            setup.start_s[1] * 1e3
        ),
        "Did it stay over the sample, and do its ends lie where you had put them",
    )
    .await?;
    printer.begin_setup(setup.clone(), printer.at());
    writeln!(
        words,
        "6. It comes down at {:.1} mm/s until the finger feels the sample, three times. Keep a hand at the switch.",
        f64::from(FIRST_UM_S) * 1e-3
    )?;
    printer.set_manual(false);
    let presses = three_presses(probe, printer).await;
    printer.set_manual(true);
    let presses = presses?;
    finish(&mut setup, &presses)?;
    writeln!(
        words,
        "   Stiffness {:.2} N/mm, play of Z {:.2} mm; the sample is felt at Z {:.2} mm and rises by {:.2} mm to its \
         end. The finger never goes below Z {:.2} mm.",
        setup.stiffness_n_mm.unwrap_or_default(),
        setup.backlash_mm.unwrap_or_default(),
        presses[0].touched_mm + presses[0].slope * setup.sample_mm[0],
        presses[0].slope * (setup.sample_mm[1] - setup.sample_mm[0]),
        setup.floor_mm
    )?;
    printer.begin_setup(setup.clone(), printer.at());
    printer.park(setup.lifted_mm).await.map_err(failed)?;
    printer
        .setup()
        .ok_or_else(|| failed(PrinterError::NotSetUp))
}

async fn three_presses(probe: &Probe, printer: &Printer) -> Result<Vec<Press>, OperationError> {
    let wanted = Identify {
        threshold: 1.0,
        max_slides: 3,
        open: false,
        strategy: Strategy::Cycling,
        ..Identify::default()
    };
    let (mut prompts, mut words) = (Prompts::default(), probe.words());
    let made = probe
        .run(Request::identify(wanted), |report| {
            prompts.show(report, &mut words)
        })
        .await;
    if let Some(why) = printer.take_failure() {
        return Err(failed(why));
    }
    made?;
    Ok(printer.presses())
}

fn finish(setup: &mut Setup, presses: &[Press]) -> Result<(), OperationError> {
    let mean =
        |of: fn(&Press) -> f64| presses.iter().map(of).sum::<f64>() / presses.len().max(1) as f64;
    let stiffness = mean(|press| press.stiffness_n_mm);
    let (softest, stiffest) = STIFFNESSES;
    if presses.is_empty() || !(softest..=stiffest).contains(&stiffness) {
        return Err(OperationError::said(format!(
            "the force grows by {stiffness:.2} N/mm, and a finger on a sample has {softest} to {stiffest}: are the \
             steps/mm of Z right (a move of 5 mm, measured with a ruler), and is the holder tight?"
        )));
    }
    let [begin, end] = setup.sample_mm;
    let heights = presses
        .iter()
        .flat_map(|press| [begin, end].map(|x| press.touched_mm + press.slope * x));
    let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), z| {
        (low.min(z), high.max(z))
    });
    setup.stiffness_n_mm = Some(stiffness);
    setup.backlash_mm = Some(mean(|press| press.backlash_mm));
    setup.lifted_mm = high + LIFTED_MM;
    setup.floor_mm = low - FLOOR_MM;
    Ok(())
}

impl Printer {
    /// Where it is told to be: along the sample, and Z.
    fn at(&self) -> [f64; 2] {
        self.state().at
    }

    fn set_manual(&self, manual: bool) {
        self.state().manual = manual;
    }

    fn begin_setup(&self, setup: Setup, at: [f64; 2]) {
        let mut state = self.state();
        state.measures_backlash = setup.stiffness_n_mm.is_none();
        (state.setup, state.at, state.parked) = (Some(setup), at, true);
    }

    async fn park(&self, z: f64) -> Result<(), PrinterError> {
        let [along, _] = self.at();
        self.go(along, z, 5.0).await?;
        self.state().parked = true;
        Ok(())
    }

    /// Has its motion measured by whoever carries its bytes: nobody else looks often enough.
    async fn motion(&self) -> Result<Motion, PrinterError> {
        self.state().measures_motion = true;
        loop {
            if let Some(motion) = self.state().motion.take() {
                return motion;
            }
            turn().await;
        }
    }

    /// Slides to and fro in the air at two speeds.
    pub(super) async fn measure_motion(&self) -> Result<Motion, PrinterError> {
        let [begin, end] = self.set_up()?.sample_mm;
        let z = self.at()[1];
        self.go(begin, z, 50.0).await?;
        let length = (end - begin).abs();
        let mut over = [[0.0; 4]; 2];
        for (speed, over) in AIR_MM_S.into_iter().zip(&mut over) {
            let way = (end - begin).signum() * length.min(2.0 * speed);
            for (n, over) in over.iter_mut().enumerate() {
                let to = if n % 2 == 0 { begin + way } else { begin };
                let took = self.glide([to, z], speed, None).await?;
                *over = took - way.abs() / speed;
            }
        }
        let mean = |over: &[f64; 4]| over.iter().sum::<f64>() / 4.0;
        let [slow, fast] = AIR_MM_S;
        let steeper = (mean(&over[1]) - mean(&over[0])) / (fast - slow);
        let (least, most) = ACCELERATIONS;
        let acceleration = (1.0 / steeper.max(1.0 / most)).clamp(least, most);
        let starts = [0, 1].map(|n| over[n].map(|s| s - AIR_MM_S[n] / acceleration));
        let starts = starts.iter().flatten();
        let (soonest, latest) = starts
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), s| {
                (low.min(*s), high.max(*s))
            });
        Ok((acceleration, [soonest - START_OFF_S, latest + START_OFF_S]))
    }
}
