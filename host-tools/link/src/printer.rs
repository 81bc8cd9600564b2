//! A 3D printer that moves a probe's finger: its end of the orders that a probe gives an arm
//! ([`ArmOrder`]), spoken in G-code. Without I/O of its own: [`Carrier::carry`] takes the printer's bytes and the time,
//! and returns bytes for it; [`Printer`] takes orders and force, and has the reports.
//!
//! The printer is never sent more than a step of the way down, or a fifth of a second of a slide (a Klipper, a second):
//! whatever breaks, no more than that goes on. It is not told to heat, to feed filament, or to find the bed.

mod gcode;
mod moves;
#[cfg(feature = "serial")]
mod port;
mod press;
mod setup;
#[cfg(test)]
mod tests;

use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, Waker};
use std::time::Duration;

use tactus_core::rig::arm::{ARM_SAYS_MS, ArmOrder, ArmReport, ArmState, ArmTask};

use super::probe::turn;
use gcode::Dialogue;

pub use gcode::{Dialect, LineError};
#[cfg(feature = "serial")]
pub use port::{OpenError, OpenPrinter};
pub use setup::{Axis, Setup, SetupError, set_up};

/// A probe that says nothing while the finger is down is gone, after so long.
const PROBE_GONE: Duration = Duration::from_millis(600);

/// Errors of a movement.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub enum PrinterError {
    /// See [`LineError`].
    #[error(transparent)]
    Line(#[from] LineError),
    /// The probe asks for something else.
    #[error("the probe asked for something else")]
    Replaced,
    /// The probe says nothing while the finger is down.
    #[error("the probe says nothing any more: the finger was lifted")]
    ProbeGone,
    /// Nothing is felt down to the floor.
    #[error(
        "nothing was felt down to Z {0:.2} mm, the floor of the set-up: is the sample there, and does the finger hang \
         on? If it is thinner than the one of the set-up: `tactus device printer setup`"
    )]
    NoSample(f64),
    /// The sample is not where it was, or its ends are not at one height.
    #[error(
        "the sample is felt {0:.1} mm higher or lower than it should be: does it lie flat below the whole slide, and \
         does the axis move as far as it is told (a move of 50 mm, measured with a ruler)? Then run the command again"
    )]
    Elsewhere(f64),
    /// The force does not become the one that is wanted.
    #[error(
        "the force does not become {0:.2} N: is the finger's holder loose, or the sample soft?"
    )]
    Unsteady(f64),
    /// The force grows while the finger is lifted.
    #[error(
        "the force grows while the finger is lifted: the Z axis goes the wrong way. Switch the printer off, lift the \
         finger by hand, then run `tactus device printer setup`"
    )]
    WrongWay,
    /// The printer is not where it was told to go.
    #[error(
        "the printer says that it is at {is:.2} mm, and was told to go to {told:.2} mm: has it an end stop or a limit \
         there?"
    )]
    Misplaced {
        /// Where it was told to go, mm.
        told: f64,
        /// Where it says it is, mm.
        is: f64,
    },
    /// A slide took another time than its speed says.
    #[error(
        "a slide took {took:.2} s and not {wanted:.2} s: is the printer's speed set to 100 % (M220), and the PC busy?"
    )]
    Slow {
        /// Time that it took, s.
        took: f64,
        /// Time of its length and speed, s.
        wanted: f64,
    },
    /// The slide does not fit on the sample.
    #[error(
        "a slide at {speed:.0} mm/s needs {needs:.0} mm of sample and there are {has:.0}: a longer sample, or a set-up \
         over more of it"
    )]
    TooShort {
        /// Speed, mm/s.
        speed: f64,
        /// Length that it needs with its ramps, mm.
        needs: f64,
        /// Length of the sample by the set-up, mm.
        has: f64,
    },
    /// There is no set-up.
    #[error("the printer is not set up: run `tactus device printer setup`")]
    NotSetUp,
}

type Result<T> = std::result::Result<T, PrinterError>;

/// Acceleration along the sample, mm/s^2, and least and longest time from the first line of a slide to its motion, s.
type Motion = (f64, [f64; 2]);

/// A press as it was measured.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Press {
    /// Stiffness of finger, holder and gantry near the force, N/mm.
    pub stiffness_n_mm: f64,
    /// Way of the axis before the force falls, mm; 0 where it was not measured.
    pub backlash_mm: f64,
    /// Height of a touch at 0 along the sample, mm.
    pub touched_mm: f64,
    /// Rise of the sample for each mm along it.
    pub slope: f64,
}

#[derive(Debug, Default)]
struct State {
    setup: Option<Setup>,
    talk: Dialogue,
    now: Duration,
    /// Contact force, N, when it came, and how many have come.
    force: (f64, Duration, u64),
    order: Option<ArmOrder>,
    taken: Option<u16>,
    report: Option<ArmReport>,
    said: Duration,
    reports: Vec<ArmReport>,
    /// Where it was told to go: along the sample, and Z, mm.
    at: [f64; 2],
    starts: u32,
    ready: bool,
    greeted: bool,
    /// It has started anew: its zero is gone.
    lost: bool,
    down: bool,
    parked: bool,
    path: Option<moves::Path>,
    press: Option<Press>,
    /// When it was lifted after a slide that nothing stopped.
    lifted: Option<Duration>,
    /// The sample is not where it was: it presses no more.
    elsewhere: Option<f64>,
    presses: Vec<Press>,
    measures_backlash: bool,
    /// A person sets it up: orders wait.
    manual: bool,
    /// Its motion is to be measured; what came of it.
    measures_motion: bool,
    motion: Option<Result<Motion>>,
    failure: Option<PrinterError>,
}

impl State {
    /// Has the progress of an order said at once.
    fn reach(&mut self, number: u16, state: ArmState) {
        (self.report, self.said) = (Some(ArmReport { number, state }), Duration::ZERO);
    }
}

/// A printer; its copies are the same one.
#[derive(Clone, Debug)]
pub struct Printer(Arc<Mutex<State>>);

/// Whoever carries a printer's bytes.
pub struct Carrier {
    printer: Printer,
    life: Pin<Box<dyn Future<Output = ()> + Send>>,
}

impl Printer {
    /// A printer of this set-up; without one it can be set up. Its carrier goes to whoever has the port.
    pub fn new(setup: Option<Setup>) -> (Self, Carrier) {
        let state = State {
            manual: setup.is_none(),
            setup,
            ..State::default()
        };
        let printer = Self(Arc::new(Mutex::new(state)));
        let life = Box::pin(live(printer.clone()));
        let carrier = Carrier {
            printer: printer.clone(),
            life,
        };
        (printer, carrier)
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes an order of the probe; a repeated one is the same.
    pub fn order(&self, order: ArmOrder) {
        let mut state = self.state();
        if state.order != Some(order) {
            state.order = Some(order);
            state.reach(order.number, ArmState::Busy);
        }
    }

    /// Takes the probe's force, mN.
    pub fn force(&self, mn: i16) {
        let mut state = self.state();
        state.force = (f64::from(mn) * 1e-3, state.now, state.force.2 + 1);
    }

    /// Returns the reports that are due for the probe.
    pub fn reports(&self) -> Vec<ArmReport> {
        std::mem::take(&mut self.state().reports)
    }

    /// Takes the cause of the last failure, for people.
    pub fn take_failure(&self) -> Option<PrinterError> {
        self.state().failure.take()
    }

    /// Returns the presses since the last call.
    pub fn presses(&self) -> Vec<Press> {
        std::mem::take(&mut self.state().presses)
    }

    /// Returns its set-up, with the place where it was parked.
    pub fn setup(&self) -> Option<Setup> {
        let state = self.state();
        let setup = state.setup.clone()?;
        let parked = match state.greeted {
            true => state.parked.then_some(state.at),
            false => setup.parked,
        };
        Some(Setup { parked, ..setup })
    }

    fn close(&self, why: &str) {
        self.state().talk.close(why.to_owned());
    }

    fn now(&self) -> Duration {
        self.state().now
    }

    /// Says the progress of the order with this number.
    fn reach(&self, number: u16, state: ArmState) {
        let mut here = self.state();
        if here.order.is_some_and(|order| order.number == number) {
            here.reach(number, state);
        }
    }
}

impl Carrier {
    /// The port failed: whatever is under way ends.
    pub fn close(&mut self, why: &str, now: Duration) {
        self.printer.close(why);
        self.carry(&[], now);
    }

    /// Takes what came from the printer, and what time it is since any moment; returns what is to be sent to it.
    pub fn carry(&mut self, received: &[u8], now: Duration) -> Vec<u8> {
        {
            let mut state = self.printer.state();
            state.now = now.max(state.now);
            state.talk.carry(received, now);
        }
        let mut context = Context::from_waker(Waker::noop());
        // it never ends
        let _: Poll<()> = self.life.as_mut().poll(&mut context);
        let mut state = self.printer.state();
        let due = state.now.saturating_sub(state.said);
        if let Some(report) = state.report
            && (state.said == Duration::ZERO || due.as_millis() * 2 >= u128::from(ARM_SAYS_MS))
        {
            state.said = state.now;
            state.reports.push(report);
        }
        state.talk.take_due()
    }
}

/// Greets the printer, then does what the probe orders.
async fn live(printer: Printer) {
    loop {
        let Some(order) = printer.next_order().await else {
            let motion = printer.measure_motion().await;
            printer.state().motion = Some(motion);
            continue;
        };
        let done = printer.obey(order).await;
        let state = match done {
            Ok(state) => state,
            Err(PrinterError::Replaced) => continue,
            Err(why) => {
                if why == PrinterError::ProbeGone {
                    // nobody would ask for it
                    let _ = printer.lift().await;
                }
                let mut state = printer.state();
                state.failure.get_or_insert(why);
                ArmState::Failed
            }
        };
        printer.reach(order.number, state);
    }
}

impl Printer {
    /// The next order; `None` where the motion is to be measured.
    async fn next_order(&self) -> Option<ArmOrder> {
        loop {
            {
                let mut state = self.state();
                if std::mem::take(&mut state.measures_motion) {
                    return None;
                }
                if let Some(order) = state.order
                    && !state.manual
                    && state.taken != Some(order.number)
                {
                    state.taken = Some(order.number);
                    return Some(order);
                }
            }
            turn().await;
        }
    }

    async fn obey(&self, order: ArmOrder) -> Result<ArmState> {
        if !matches!(order.task, ArmTask::Stop | ArmTask::Lift) || !self.state().lost {
            self.greet().await?;
        }
        match order.task {
            ArmTask::Press(movement) => {
                self.press(movement).await?;
                Ok(ArmState::Pressed)
            }
            ArmTask::Slide => self.slide(order.number).await,
            ArmTask::Lift => {
                self.lift().await?;
                let mut state = self.state();
                state.lifted = Some(state.now);
                Ok(ArmState::Lifted)
            }
            ArmTask::Stop => {
                self.stop().await?;
                Ok(ArmState::Lifted)
            }
        }
    }
}
