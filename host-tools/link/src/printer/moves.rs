//! The movements of a printer that holds a finger: a greeting, a straight way, a slide in pieces, a stop.

use std::time::Duration;

use tactus_core::rig::arm::ArmState;

use super::gcode::{Dialect, LineError};
use super::{PROBE_GONE, Press, Printer, PrinterError, Result, State};
use crate::probe::turn;

/// Speeds in the air, mm/s: along the sample, and up and down (Marlin's usual limit of a screw).
pub(super) const MOVES_MM_S: f64 = 60.0;
pub(super) const LIFTS_MM_S: f64 = 5.0;
/// Excess over a force that ends a press, as a share and N: below the probe's own limit.
pub(super) const TOO_HARD: (f64, f64) = (1.15, 0.1);
/// Reports of the force, 100 a second, that pass before one is of a finger that stands.
const LATE_FORCES: u64 = 4;
/// Force at which a slide is ended without the probe's order, N.
const HARDEST_N: f64 = 1.9;
/// The force of a slide is a mean over as many of its reports, a tenth of a second: the texture's own is not followed.
const MEAN_FORCES: f64 = 10.0;
/// From a piece's line until its force is known, beside what is sent ahead, s.
const FELT_S: f64 = 0.17;
/// A slide's height follows the force by as much in a piece, and in all, mm.
const FOLLOWS_MM: (f64, f64) = (0.01, 0.1);
/// A piece of a slide, and what is sent ahead of the motion beside its ramp, s: an answer by a USB cable takes up to
/// 0.02. Klipper plans so far ahead by itself.
const PIECE_S: f64 = 0.05;
const AHEAD_S: f64 = 0.08;
const KLIPPER_AHEAD_S: f64 = 0.8;
/// A printer waits for so many of them before it moves (Marlin: get_current_block).
const FIRST_PIECES: u32 = 3;
/// A line is answered within this time beside its motion.
const ANSWERS: Duration = Duration::from_millis(1500);
/// It is sent again twice before.
const AGAIN: Duration = Duration::from_millis(500);
/// A line's number is set within this time.
const SETTLES: Duration = Duration::from_millis(60);
/// A printer that has just been switched on, or whose port was opened, is waited for.
const STARTS: Duration = Duration::from_secs(5);
/// The time of a slide may be off by this share and s.
const TIME_OFF: (f64, f64) = (0.02, 0.04);
/// A printer that stands farther from where it was parked has another zero, or was moved, mm.
const MOVED_MM: f64 = 0.5;
/// A place that it says may be off by its rounding, mm.
pub(super) const PLACE_OFF_MM: f64 = 0.02;

/// The way of a slide: from where to where along the sample, mm.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Path {
    pub(super) from_mm: f64,
    pub(super) to_mm: f64,
    pub(super) speed: f64,
    /// Time from its begin until its speed is constant for certain, s.
    pub(super) steady_s: f64,
    /// Length at constant speed from then on, mm.
    pub(super) length_mm: f64,
    /// Force to be held, N.
    pub(super) newton: f64,
}

/// A slide under way. Its height follows the force: two touches tell the tilt of a smooth sample, not of a coarse one.
pub(super) struct Slide {
    number: u16,
    path: Path,
    stiffness_n_mm: f64,
    steady: bool,
    /// Force, N, mean over some reports, and the last of them.
    mean: f64,
    heard: u64,
    /// Height over the line, mm.
    off_mm: f64,
}

impl Slide {
    fn new(number: u16, path: Path, press: Press) -> Self {
        Self {
            number,
            path,
            stiffness_n_mm: press.stiffness_n_mm,
            steady: false,
            mean: path.newton,
            heard: 0,
            off_mm: 0.0,
        }
    }

    /// Errors: the force is too high.
    fn look(&mut self, state: &mut State, since_s: f64) -> Result<()> {
        // the probe's own limit is lower
        let newton = state.felt()?;
        if newton > HARDEST_N {
            return Err(PrinterError::Unsteady(HARDEST_N));
        }
        if since_s < self.path.steady_s {
            return Ok(());
        }
        if self.heard != state.force.2 {
            self.heard = state.force.2;
            self.mean += (newton - self.mean) / MEAN_FORCES;
        }
        if !self.steady {
            self.steady = true;
            state.reach(self.number, ArmState::Steady);
        }
        Ok(())
    }

    /// Height of the next piece over the line, mm, where so much is sent ahead, s: slower than what is told is late.
    fn follow(&mut self, ahead_s: f64) -> f64 {
        let (step, most) = FOLLOWS_MM;
        let gain = PIECE_S / (2.0 * (ahead_s + FELT_S));
        let off = gain * (self.mean - self.path.newton) / self.stiffness_n_mm;
        self.off_mm = (self.off_mm + off.clamp(-step, step)).clamp(-most, most);
        self.off_mm
    }
}

impl State {
    /// Errors: anything that ends what is under way.
    fn go_on(&mut self) -> Result<()> {
        if let Some(why) = self.talk.take_error() {
            if matches!(why, LineError::Said(_)) {
                self.parked = false;
            }
            return Err(why.into());
        }
        if self.talk.starts() != self.starts && self.ready {
            (self.ready, self.lost, self.parked) = (false, true, false);
            return Err(LineError::Reset.into());
        }
        Ok(())
    }

    fn is_replaced(&self) -> bool {
        let other = self.order.map(|order| order.number) != self.taken;
        other && !self.manual
    }

    /// Force, N. Errors: the probe says nothing any more.
    pub(super) fn felt(&self) -> Result<f64> {
        let (newton, at, _) = self.force;
        if self.now.saturating_sub(at) > PROBE_GONE {
            return Err(PrinterError::ProbeGone);
        }
        Ok(newton)
    }

    fn dialect(&self) -> Option<Dialect> {
        self.setup.as_ref().map(|setup| setup.dialect)
    }
}

impl Printer {
    /// Waits until `ready` makes something of the state; an order that replaces the one under way ends that.
    async fn until<T>(&self, mut ready: impl FnMut(&mut State) -> Option<T>) -> Result<T> {
        loop {
            {
                let mut state = self.state();
                state.go_on()?;
                if let Some(ready) = ready(&mut state) {
                    return Ok(ready);
                }
            }
            turn().await;
        }
    }

    pub(super) async fn pause(&self, time: Duration) -> Result<()> {
        let begun = self.now();
        self.until(|state| (state.now.saturating_sub(begun) >= time).then_some(()))
            .await
    }

    /// Sends a line that takes so many s, and waits for its answer.
    pub(super) async fn line(&self, code: &str, seconds: f64) -> Result<()> {
        let longest = Duration::from_secs_f64(seconds);
        let mut tries = 0;
        self.answered(longest, &mut tries).await?;
        {
            let mut state = self.state();
            let now = state.now;
            state.talk.send(code, now);
        }
        self.answered(longest, &mut tries).await
    }

    async fn answered(&self, longest: Duration, tries: &mut u32) -> Result<()> {
        self.until(|state| {
            if state.talk.is_answered() {
                return Some(Ok(()));
            }
            let now = state.now;
            let numbered = matches!(state.dialect(), Some(Dialect::Marlin { .. }) | None);
            if state.talk.waited(now) > longest + AGAIN {
                *tries += 1;
                if *tries > 2 || !numbered {
                    return Some(Err(LineError::Silent.into()));
                }
                state.talk.repeat(now);
            }
            None
        })
        .await?
    }

    /// Waits until the printer has done all, which takes so many s, and says where it is.
    pub(super) async fn done(&self, seconds: f64) -> Result<[f64; 3]> {
        self.line("M400", seconds + ANSWERS.as_secs_f64()).await?;
        // an answer, or the line itself, may have been lost
        for _ in 0..2 {
            self.line("M114", ANSWERS.as_secs_f64()).await?;
            let begun = self.now();
            let place = self.until(|state| {
                let late = state.now.saturating_sub(begun) > AGAIN;
                match state.talk.place() {
                    Some(place) => Some(Some(place)),
                    None => late.then_some(None),
                }
            });
            if let Some(place) = place.await? {
                return Ok(place);
            }
        }
        Err(LineError::Silent.into())
    }

    /// The axis along the sample by its number, and its letter.
    fn along(&self) -> (usize, char) {
        let state = self.state();
        state
            .setup
            .as_ref()
            .map_or((0, 'X'), |s| (s.axis as usize, s.axis.letter()))
    }

    /// Greets a printer that was opened: what it is, and what it shall not do by itself.
    pub(super) async fn greet(&self) -> Result<()> {
        if self.state().ready {
            return Ok(());
        }
        if self.state().lost {
            return Err(LineError::Reset.into());
        }
        let dialect = self.identify().await?;
        let (setup, parked) = {
            let mut state = self.state();
            let parked = state.setup.as_mut().and_then(|setup| setup.parked.take());
            state.greeted = true;
            if let Some(setup) = &mut state.setup {
                setup.dialect = dialect;
            }
            (state.setup.clone(), parked)
        };
        let marlin = matches!(dialect, Dialect::Marlin { .. });
        // millimetres, absolute; motors that stay on, no mesh, the speed that is asked for, and no fan
        let lines: &[&str] = match marlin {
            true => &["G21", "G90", "M84 S0", "M420 S0", "M220 S100", "M107"],
            false => &["G90", "M220 S100"],
        };
        for line in lines {
            self.line(line, 1.0).await?;
        }
        let place = self.done(1.0).await?;
        if let Some(setup) = setup {
            let here = [place[setup.axis as usize], place[2]];
            let reset = marlin && here.iter().all(|mm| mm.abs() < PLACE_OFF_MM);
            self.state().at = here;
            match parked {
                // its zero is where it was parked: it stands there since
                Some([along, z]) if reset => {
                    let letter = setup.axis.letter();
                    self.line(&format!("G92 {letter}{along:.3} Z{z:.3}"), 1.0)
                        .await?;
                    let mut state = self.state();
                    (state.at, state.parked) = ([along, z], true);
                }
                // in another frame than then: it was homed, or moved by hand
                Some(parked) if (parked[0] - here[0]).hypot(parked[1] - here[1]) > MOVED_MM => {
                    return Err(LineError::Reset.into());
                }
                Some(_) => self.state().parked = true,
                None if reset => return Err(PrinterError::NotSetUp),
                _ => {}
            }
        }
        let mut state = self.state();
        state.starts = state.talk.starts();
        state.ready = true;
        Ok(())
    }

    /// Lifts the finger of a printer that has started anew: only up is known.
    pub(super) async fn rescue(&self) -> Result<()> {
        if self.identify().await? == Dialect::Klipper {
            return Err(LineError::Reset.into());
        }
        for line in ["G91", "G1 Z4 F300", "M400", "G90"] {
            self.line(line, 4.0).await?;
        }
        self.state().down = false;
        Ok(())
    }

    /// What the printer is, once it has started.
    pub(super) async fn identify(&self) -> Result<Dialect> {
        let begun = self.now();
        loop {
            {
                // what it is told while it starts is lost; some firmware takes no line without number and checksum
                let mut state = self.state();
                state.talk.forget();
                state.talk.raw("N0 M110 N0*125\n");
                state.talk.number();
            }
            self.pause(SETTLES).await?;
            {
                let mut state = self.state();
                let now = state.now;
                state.talk.send("M115", now);
            }
            let sent = self.now();
            // some firmware says ok before its answer
            let said = self
                .until(|state| {
                    let late = state.now.saturating_sub(sent) > AGAIN;
                    let said = state.talk.heard();
                    let whole = state.talk.is_answered() && said.contains("FIRMWARE_NAME");
                    match whole || (late && state.talk.is_answered()) {
                        true => Some(Some(said.to_owned())),
                        false => late.then_some(None),
                    }
                })
                .await?;
            let is_late = self.now().saturating_sub(begun) > STARTS;
            if let Some(said) = said {
                let Some(dialect) = Dialect::of(&said) else {
                    let said = said.trim().replace('\n', " / ");
                    return Err(LineError::Said(format!(
                        "\"{said}\": neither Marlin nor Klipper, which are all that is known here"
                    ))
                    .into());
                };
                if dialect == Dialect::Klipper {
                    // it checks neither numbers nor sums
                    self.state().talk.forget();
                }
                return Ok(dialect);
            }
            if is_late {
                return Err(LineError::Silent.into());
            }
        }
    }

    /// Goes straight to a place along the sample and in Z, mm, and waits until it is there.
    pub(super) async fn go(&self, along: f64, z: f64, mm_s: f64) -> Result<()> {
        let (axis, letter) = self.along();
        let from = self.state().at;
        let way = (along - from[0]).hypot(z - from[1]);
        self.state().parked = false;
        let code = format!("G1 {letter}{along:.3} Z{z:.4} F{:.1}", mm_s * 60.0);
        self.state().at = [along, z];
        // an axis comes to its speed and from it
        let seconds = way / mm_s + mm_s / 50.0;
        let mut elsewhere = None;
        // a line of which nothing but its number came is sent again
        for _ in 0..2 {
            self.line(&code, ANSWERS.as_secs_f64()).await?;
            let place = self.done(seconds).await?;
            let ends = [(along, place[axis]), (z, place[2])];
            let off = ends
                .into_iter()
                .find(|(told, is)| (told - is).abs() > PLACE_OFF_MM);
            elsewhere = off.map(|(told, is)| PrinterError::Misplaced { told, is });
            if elsewhere.is_none() {
                break;
            }
        }
        elsewhere.map_or(Ok(()), Err)?;
        self.replaced()
    }

    /// Errors: the probe asks for something else now.
    fn replaced(&self) -> Result<()> {
        match self.state().is_replaced() {
            true => Err(PrinterError::Replaced),
            false => Ok(()),
        }
    }

    /// The force of the finger, once it stands, N.
    pub(super) async fn feel(&self) -> Result<f64> {
        let from = self.state().force.2;
        let begun = self.now();
        let felt = self.until(|state| {
            if state.is_replaced() {
                return Some(Err(PrinterError::Replaced));
            }
            if state.force.2 >= from + LATE_FORCES {
                return Some(Ok(state.force.0));
            }
            let late = state.now.saturating_sub(begun) > PROBE_GONE;
            late.then_some(Err(PrinterError::ProbeGone))
        });
        felt.await?
    }

    pub(super) fn set_up(&self) -> Result<super::Setup> {
        self.state().setup.clone().ok_or(PrinterError::NotSetUp)
    }

    /// Makes the slide of the last press.
    pub(super) async fn slide(&self, number: u16) -> Result<ArmState> {
        let Some(path) = self.state().path else {
            return Err(PrinterError::NotSetUp);
        };
        let setup = self.set_up()?;
        let Some(press) = self.state().press else {
            return Err(PrinterError::NotSetUp);
        };
        let to_z = self.state().at[1] + press.slope * (path.to_mm - path.from_mm);
        let took = self
            .glide(
                [path.to_mm, to_z],
                path.speed,
                Some(Slide::new(number, path, press)),
            )
            .await?;
        let wanted = setup.seconds(path.to_mm - path.from_mm, path.speed);
        let late = took - wanted;
        let (share, seconds) = TIME_OFF;
        let off = share * wanted + seconds;
        let [soonest, latest] = setup.start_s;
        if late < soonest - off || late > latest + off {
            return Err(PrinterError::Slow { took, wanted });
        }
        let middle = (soonest + latest) / 2.0;
        let speed = path.speed * wanted / (wanted + late - middle);
        Ok(ArmState::Slid {
            // a slower one is at constant speed sooner
            length_um: (path.length_mm * 1e3) as u32,
            speed_um_s: (speed * 1e3) as u32,
        })
    }

    /// Goes straight to a place in pieces, of which little is sent ahead; the time that it took, s. It reports the
    /// constant speed, and ends where the force is too high.
    pub(super) async fn glide(
        &self,
        to: [f64; 2],
        speed: f64,
        mut slide: Option<Slide>,
    ) -> Result<f64> {
        let (axis, letter) = self.along();
        let (from, dialect) = {
            let mut state = self.state();
            state.parked = false;
            (state.at, state.dialect())
        };
        let length = to[0] - from[0];
        let pieces = (length.abs() / (speed * PIECE_S)).ceil().max(1.0) as u32;
        let (ahead, soonest): (f64, f64) = match dialect {
            Some(Dialect::Klipper) => (KLIPPER_AHEAD_S, 0.25),
            _ => (AHEAD_S, 0.0),
        };
        let begun = self.now();
        let mut moves_s = 0.0;
        let look = |state: &mut State, slide: &mut Option<Slide>| -> Result<f64> {
            if state.is_replaced() {
                return Err(PrinterError::Replaced);
            }
            let since = state.now.saturating_sub(begun).as_secs_f64();
            if let Some(slide) = slide {
                slide.look(state, since)?;
            }
            Ok(since)
        };
        for piece in 1..=pieces {
            let share = f64::from(piece) / f64::from(pieces);
            let before_s = f64::from(piece - 1) / f64::from(pieces) * length.abs() / speed;
            let due = self.until(|state| match look(state, &mut slide) {
                Ok(since) => (since >= before_s - ahead).then_some(Ok(())),
                Err(why) => Some(Err(why)),
            });
            due.await??;
            let [along, line] = [0, 1].map(|n| from[n] + share * (to[n] - from[n]));
            let z = line + slide.as_mut().map_or(0.0, |slide| slide.follow(ahead));
            let code = format!("G1 {letter}{along:.3} Z{z:.4} F{:.1}", speed * 60.0);
            self.state().at = [along, z];
            self.line(&code, 0.0).await?;
            let since = self.now().saturating_sub(begun).as_secs_f64();
            if piece <= FIRST_PIECES {
                moves_s = since + soonest;
            } else if since > moves_s + before_s {
                // the motion may have slowed down before this piece came
                return Err(PrinterError::Slow {
                    took: since,
                    wanted: moves_s + before_s,
                });
            }
        }
        let seconds = length.abs() / speed;
        let deadline = begun + Duration::from_secs_f64(seconds + 2.0);
        {
            let mut state = self.state();
            let now = state.now;
            state.talk.send("M400", now);
        }
        let moved = self.until(|state| {
            if let Err(why) = look(state, &mut slide) {
                return Some(Err(why));
            }
            if state.talk.is_answered() {
                return Some(Ok(()));
            }
            (state.now > deadline).then_some(Err(LineError::Silent.into()))
        });
        moved.await??;
        let took = self.now().saturating_sub(begun).as_secs_f64();
        let place = self.done(0.5).await?;
        if (place[axis] - to[0]).abs() > PLACE_OFF_MM {
            return Err(PrinterError::Misplaced {
                told: to[0],
                is: place[axis],
            });
        }
        Ok(took)
    }

    /// Has whatever moves stand, then lifts the finger.
    pub(super) async fn stop(&self) -> Result<()> {
        if self.state().lost {
            return self.rescue().await;
        }
        // what is on its way is a step down, or a fifth of a second of a slide
        let place = match self.done(1.0).await {
            Err(PrinterError::Line(LineError::Silent)) => {
                {
                    let mut state = self.state();
                    let code = match state.dialect() {
                        Some(Dialect::Klipper) => "M112\n",
                        // without a number, it is carried out before it is that line's turn
                        _ => "M410\n",
                    };
                    state.talk.raw(code);
                }
                self.done(2.0).await?
            }
            place => place?,
        };
        let (axis, _) = self.along();
        {
            let mut state = self.state();
            state.at = [place[axis], place[2]];
        }
        self.lift().await
    }
}
