//! The probe in a hand as a [`Rig`]: a person makes its movements, prompted on the display. So the core's [`Probe`]
//! serves a host as a rig with motors does; between two requests the person uses it as if there were no host.

use embedded_storage_async::nor_flash::NorFlash;

use super::jobs::{Outcome, work};
use super::judge::MOVEMENT;
use super::screen::{About, Screen};
use super::speed::Moved;
use super::states::{Answer, Handheld, RequestedSlide, TICKS_HZ};
use crate::features::{Property, PropertySet, Slide};
use crate::probe::seams::{Events, RigHandle, StoredBytes, UnloadedRun};
use crate::probe::{Probe, RigState, Watch};
use crate::rig::calibration::RigCalibration;
use crate::rig::skin::SkinCare;
use crate::rig::turning::{Turned, Turning};
use crate::rig::weigh::{LOOKS_HZ, Weighing};
use crate::rig::{Fault, Refused, Rig, RigError};
use crate::sensor::pressure::Pressure;
use crate::store::Store;
use crate::table::{MAX_TEXTURES, Name, Table};
use crate::wire::{Command, Event, Failure, Prompt, Request};

/// Ticks from one picture to the next: 20 a second.
const PICTURE: u32 = TICKS_HZ / 20;
/// Ticks between two reminders to the host of the person's task: it takes a silent probe for gone.
const REMIND: u32 = TICKS_HZ;
/// The host waits this long for a finger to be lifted, or a weight to be put on, ticks.
const PATIENCE: u32 = 60 * TICKS_HZ;
/// Ticks in the air over which P_DC's zero is taken, which follows it within half a second.
const AIR: u32 = 2 * TICKS_HZ;
// a look at a weight is a tick
const _: () = assert!(LOOKS_HZ == TICKS_HZ);
/// Longest time until a sensor that works again is noticed, ticks.
const CLEARED: u32 = TICKS_HZ;

/// Parts of a handheld probe, on the chip or in a test.
#[allow(async_fn_in_trait)] // no executor of this project moves tasks between threads
pub trait Hand {
    /// True if its finger feels gravity.
    fn feels_gravity(&self) -> bool {
        false
    }

    /// Waits for the next hundredth of a second.
    async fn wait(&mut self);

    /// Takes the oldest word of the sensor.
    fn word(&mut self) -> Option<Option<Pressure>>;

    /// Motion since the last call, by its sensor of motion, if there is one: see [`Handheld::moved`].
    fn moved(&mut self) -> Option<Moved> {
        None
    }

    /// Gravity along the finger, counts of P_AC, see [`crate::sensor::AnyFinger::gravity`].
    fn gravity(&self) -> Option<f32> {
        None
    }

    /// Returns true if the button is pressed.
    fn is_pressed(&mut self) -> bool;

    /// Turns the sensor's words on or off. Time may have passed without ticks before they come again.
    fn listen(&mut self, on: bool);

    /// Sounds a tone, Hz, or none.
    fn sound(&mut self, tone: Option<u16>);

    /// Shows a screen.
    fn show(&mut self, screen: &Screen<'_>);

    /// Facts of the page about the probe, without the calibration.
    fn about(&self) -> About;

    /// Publishes the state of the probe, which is answered at any time.
    fn publish(&mut self, state: &RigState);

    /// Returns true if the host has stopped its request.
    fn is_stopped(&self) -> bool;

    /// Returns true if the host wants raw samples.
    fn streams(&self) -> bool;

    /// Sends an event to the host.
    fn tell(&mut self, event: Event);
}

/// A rig that is a person with a probe in the hand.
pub struct ByHand<'p, H> {
    /// Its parts.
    pub hand: H,
    /// State of the person's use: pages, touch and job.
    pub handheld: Handheld<'p>,
    calibration: RigCalibration,
    skin: SkinCare,
    watch: Watch,
    listens: bool,
    tone: Option<u16>,
    ticks: u32,
    prompt: (Option<Prompt>, u32),
    asked: RequestedSlide,
    memory: f32,
    serves: bool,
}

impl<'p, H: Hand> ByHand<'p, H> {
    /// A probe that was just switched on, with a fingertip of these constants.
    pub fn new(hand: H, handheld: Handheld<'p>, calibration: RigCalibration) -> Self {
        let mut by_hand = Self {
            hand,
            handheld,
            calibration,
            skin: SkinCare::NEW,
            watch: Watch::default(),
            listens: false,
            tone: None,
            ticks: 0,
            prompt: (None, 0),
            asked: RequestedSlide::default(),
            memory: 0.0,
            serves: false,
        };
        by_hand.use_calibration(calibration);
        by_hand
    }

    /// The constants in use.
    pub fn calibration(&self) -> RigCalibration {
        self.calibration
    }

    fn use_calibration(&mut self, calibration: RigCalibration) {
        self.calibration = calibration;
        let scale = calibration.pressure.force_mn_per_count;
        self.handheld.calibrate(scale);
    }

    /// A hundredth of a second: words, button, buzzer, display, and the events for the host.
    pub async fn tick(&mut self) {
        self.hand.wait().await;
        self.ticks = self.ticks.wrapping_add(1);
        if let Some(moved) = self.hand.moved() {
            self.handheld.moved(moved);
        }
        let streams = self.hand.streams() && self.handheld.prompt().is_some();
        while let Some(word) = self.hand.word() {
            self.handheld.word(word);
            if streams && self.handheld.listens() {
                let taken = self.handheld.taken();
                for block in &taken.blocks {
                    self.hand.tell(Event::Block(block.clone()));
                }
                if !taken.pdc.is_empty() {
                    self.hand.tell(Event::Pdc(taken.pdc.clone()));
                }
            }
        }
        self.handheld.tick(self.hand.is_pressed());
        if self.handheld.tone() != self.tone {
            self.tone = self.handheld.tone();
            self.hand.sound(self.tone);
        }
        self.heed();
        let due = self.ticks.is_multiple_of(PICTURE);
        if due && !self.handheld.names_textures() && self.handheld.is_new() {
            self.draw(None);
        }
        let state = self.state();
        let hand = &mut self.hand;
        hand.publish(&state);
        self.watch.look(&state, |event| hand.tell(event));
        self.remind();
    }

    fn heed(&mut self) {
        if self.handheld.listens() != self.listens {
            self.listens = self.handheld.listens();
            self.hand.listen(self.listens);
        }
    }

    /// Turns the words off until the next tick that wants them: no code takes them meanwhile.
    fn pause(&mut self) {
        self.hand.listen(false);
        self.listens = false;
        while let Some(word) = self.hand.word() {
            self.handheld.word(word);
        }
        // the next words do not follow the last ones
        self.handheld.lose(1);
    }

    fn remind(&mut self) {
        let prompt = self.handheld.prompt();
        let (told, at) = self.prompt;
        if prompt != told || self.ticks.wrapping_sub(at) >= REMIND {
            self.prompt = (prompt, self.ticks);
            if let Some(prompt) = prompt {
                self.hand.tell(Event::Prompt(prompt));
            }
        }
    }

    fn draw(&mut self, table: Option<&Table<'_>>) {
        let about = About {
            calibrated: self.calibration.scale_day().unwrap_or(0),
            memory: self.memory,
            ..self.hand.about()
        };
        let screen = self.handheld.screen(table, &about);
        self.hand.show(&screen);
    }

    /// Waits a tick for the person; returns true if the waiting may continue.
    async fn go_on(&mut self) -> Result<Option<Answer>, RigError> {
        self.tick().await;
        if self.serves && self.hand.is_stopped() {
            self.handheld.release();
            return Err(RigError::Stopped);
        }
        match self.handheld.answer() {
            Some(Answer::GivenUp) => Err(RigError::Stopped),
            Some(Answer::Nobody) => Err(RigError::NobodyThere),
            Some(Answer::Trouble) => {
                let fault = self.handheld.fault().unwrap_or(Fault::SensorSilent);
                Err(RigError::Fault(fault))
            }
            answer => Ok(answer),
        }
    }
}

impl<H: Hand> Rig for ByHand<'_, H> {
    type Error = RigError;

    fn measures(&self) -> PropertySet {
        [Property::Roughness, Property::Fineness]
            .into_iter()
            .collect()
    }

    async fn perform(&mut self, slide: &mut Slide<'_>) -> Result<(), RigError> {
        if slide.movement() != MOVEMENT {
            return Err(RigError::NotByHand);
        }
        self.asked.slide = self.asked.slide.saturating_add(1);
        self.handheld.ask_for_slide(self.asked);
        self.heed();
        while self.go_on().await? != Some(Answer::Slid) {}
        slide.adopt(self.handheld.slide());
        Ok(())
    }

    async fn lifted(&mut self) -> Result<(), RigError> {
        self.heed();
        for _ in 0..PATIENCE {
            if !self.handheld.is_touched() {
                break;
            }
            self.go_on().await?;
        }
        // the next step may take long, and no code takes words meanwhile
        self.pause();
        Ok(())
    }
}

impl<H: Hand> RigHandle for ByHand<'_, H> {
    fn state(&self) -> RigState {
        // without words the finger's state is unknown
        let heard = self.handheld.listens();
        RigState {
            phase: self.handheld.phase(),
            at_rest: !(heard && self.handheld.is_touched()),
            force_mn: if heard {
                self.handheld.view().force_mn
            } else {
                0.0
            },
            air_counts: self.handheld.air_counts(),
            skin: self.skin,
            ..RigState::parked(self.calibration)
        }
    }

    async fn begin(&mut self, _seed: u32) {
        self.asked.slide = 0;
    }

    async fn home(&mut self) -> Result<(), RigError> {
        self.handheld.clear();
        self.heed();
        for _ in 0..CLEARED {
            self.tick().await;
        }
        self.handheld
            .fault()
            .map_or(Ok(()), |fault| Err(RigError::Fault(fault)))
    }

    async fn run_unloaded(&mut self, _speed_um_s: u32) -> Result<UnloadedRun, RigError> {
        Err(RigError::NotByHand)
    }

    async fn set_calibration(&mut self, calibration: RigCalibration) -> Result<(), RigError> {
        let checked = calibration.check().map_err(Refused::Calibration);
        checked.map_err(RigError::Refused)?;
        self.use_calibration(calibration);
        Ok(())
    }

    async fn set_skin(&mut self, skin: SkinCare) {
        self.skin = skin;
    }

    /// P_DC in the air, once the finger has been there for two seconds.
    async fn calibrate(&mut self) -> Result<RigCalibration, Failure> {
        self.handheld.ask_for_air();
        self.heed();
        let mut in_the_air = 0;
        for _ in 0..PATIENCE {
            self.go_on().await.map_err(Failure::Rig)?;
            in_the_air = match self.handheld.air_counts() {
                Some(_) if !self.handheld.is_touched() => in_the_air + 1,
                _ => 0,
            };
            if let Some(counts) = self.handheld.air_counts().filter(|_| in_the_air >= AIR) {
                self.handheld.release();
                let calibration = self.calibration.with_air(counts);
                self.set_calibration(calibration)
                    .await
                    .map_err(Failure::Rig)?;
                return Ok(calibration);
            }
        }
        self.handheld.release();
        Err(Failure::Rig(RigError::NobodyThere))
    }

    async fn weigh(&mut self, mn: u16) -> Result<f32, Failure> {
        // the weight before may still be there
        self.handheld.ask_to_lift();
        self.lifted().await.map_err(Failure::Rig)?;
        self.handheld.ask_for_weight(mn);
        self.heed();
        let scale = self.calibration.pressure.force_mn_per_count;
        let mut weighing = Weighing::in_air(mn, scale);
        let mut before = None;
        for _ in 0..PATIENCE {
            self.go_on().await.map_err(Failure::Rig)?;
            let (now, above) = (self.handheld.air_counts(), self.handheld.counts_above_air());
            let (Some(now), Some(above)) = (now, above) else {
                continue;
            };
            // the touch takes a P_DC that has fallen for the air's
            let fallen = now - *before.get_or_insert(now);
            if let Some(counts) = weighing.take(above + fallen) {
                self.handheld.release();
                return Ok(counts);
            }
        }
        self.handheld.release();
        Err(Failure::Rig(RigError::NobodyThere))
    }

    // in images that never do it, a future of it would take flash
    async fn turn_over(&mut self) -> Result<Turned, Failure> {
        if !self.hand.feels_gravity() {
            return Err(Failure::OtherProbe);
        }
        self.handheld.ask_to_turn(false);
        self.heed();
        let (mut turning, mut over) = (Turning::default(), false);
        for _ in 0..PATIENCE {
            self.go_on().await.map_err(Failure::Rig)?;
            let gravity = self.hand.gravity();
            if let Some(turned) = gravity.and_then(|counts| turning.take(counts)) {
                self.handheld.release();
                return Ok(turned);
            }
            if turning.wants_turn() && !over {
                over = true;
                self.handheld.ask_to_turn(true);
            }
        }
        self.handheld.release();
        Err(Failure::Rig(RigError::NobodyThere))
    }
}

pub(crate) type HandProbe<'m, H, F, B, E> = Probe<'m, ByHand<'m, H>, F, B, E>;

/// A hundredth of a second of the person's own use, with the job on the table, if there is one; `log` gets the outcome.
pub async fn step<H, F, B, E>(probe: &mut HandProbe<'_, H, F, B, E>, log: impl FnMut(Outcome<'_>))
where
    H: Hand,
    F: NorFlash,
    B: StoredBytes<F>,
    E: Events,
{
    let Probe {
        rig,
        memory,
        events,
        ..
    } = probe;
    rig.tick().await;
    if let Some(same) = rig.handheld.go() {
        events.go(same);
    }
    let job = rig.handheld.job();
    let due = job.is_some() || rig.ticks.is_multiple_of(PICTURE);
    if due && rig.handheld.is_new() {
        let bytes = memory.in_force().len() as f32 / Store::<F>::MAX_TABLE as f32;
        let textures = f32::from(rig.handheld.textures()) / MAX_TEXTURES as f32;
        rig.memory = bytes.max(textures);
        // reading a table means checking it, which takes milliseconds
        let table = if rig.handheld.names_textures() {
            memory.table().ok()
        } else {
            None
        };
        rig.draw(table.as_ref());
    }
    if let Some(job) = job {
        rig.pause();
        // the picture goes out meanwhile
        rig.hand.wait().await;
        work(job, &mut rig.handheld, memory, events, log).await;
        rig.heed();
    }
}

fn asked(command: &Command) -> (RequestedSlide, Option<Name>) {
    match command {
        Command::Identify(wanted) | Command::Verify(wanted) => (
            RequestedSlide {
                slide: 0,
                of: wanted.max_slides,
            },
            None,
        ),
        Command::Train(wanted) => (RequestedSlide::default(), Some(wanted.name.clone())),
        _ => (RequestedSlide::default(), None),
    }
}

/// Serves a request of the host, and shows its result.
pub async fn serve<H, F, B, E>(probe: &mut HandProbe<'_, H, F, B, E>, request: &Request)
where
    H: Hand,
    F: NorFlash,
    B: StoredBytes<F>,
    E: Events,
{
    let (slides, trains) = asked(&request.command);
    probe.rig.asked = slides;
    probe.rig.pause();
    probe.rig.serves = true;
    let before = probe.memory.table().ok().map(|table| table.crc());
    let done = probe.perform(&request.command).await;
    let table = probe.memory.table().ok();
    let after = table.map(|table| (table.crc(), table.textures()));
    let rig = &mut probe.rig;
    rig.serves = false;
    rig.handheld.release();
    if let Some((crc, textures)) = after
        && before != Some(crc)
    {
        rig.handheld.table_changed(textures);
    }
    let done = done.map(|found| match (trains, found) {
        (Some(name), _) => rig.handheld.trained(name),
        (None, Some(found)) => {
            let compared = found.answer.is_some();
            rig.handheld.told(found.into(), compared);
        }
        (None, None) => {}
    });
    rig.heed();
    probe.answer(request.id, done);
}

#[cfg(test)]
mod tests;
