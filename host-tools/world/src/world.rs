//! The whole rig behind its pins: finger, sample, lever, stage, encoder, amplifier, switches.
//!
//! Inputs are levels, duties and bytes with their time in ns; outputs are the levels of the pins at the time reached.
//! Nothing here knows the intentions of a controller. [`World::truth`] is for tests and displays only.
//!
//! Time: [`World::advance_to`] advances in ticks of 76 us. The tick that holds
//! the time reached is computed as a whole, with the inputs as they were at its begin, so that an input acts within
//! 76 us; outputs between ticks are interpolated. Times may repeat; a time earlier than the last acts now, though the
//! driver still measures STEP and DIR by it.
//!
//! A world is its [`Setup`] and its inputs: the same give the same words, on any thread.

use std::f64::consts::TAU;

use super::conditions::Conditions;
use super::encoder::{Edge, Encoder};
use super::faults::{Fault, Faults, Miso};
use super::finger::{Contact, Finger, Held};
use super::lever::Lever;
use super::maths::sin;
use super::mount::Mount;
use super::parts::{PartFault, Peers};
use super::ripple::PwmPhase;
use super::stage::Stage;
use super::surface::Surface;
use super::wiring::{Miswired, Wires};
use super::{noise::Noise, textures};
use tactus_core::sensor::FingerName;

mod built;
mod holder;

pub use built::Reached;
use holder::Holder;

/// The seeds and parts that a world is made from.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Setup {
    /// Number of the texture that is mounted, 1 to 117 (Table 1).
    pub texture: u8,
    /// Seed of the textures, this rig's motors and its amplifier.
    pub world_seed: u64,
    /// Seed of the differences between trials: the places of lever and stage at power-up, noise, hum, the stage's
    /// friction.
    pub trial_seed: u64,
    /// Seed of the fingertip.
    pub finger_seed: u64,
    /// Kind of finger.
    pub finger: FingerName,
    /// True if [`World::next_encoder_edge`] is going to be asked: edges are kept until then.
    pub keep_edges: bool,
    /// True if samples lie on shims: those that are thinner than 11 mm end at that height. The finger's
    /// way down, at 0.5 mm/s, then takes 9 s at most and not up to half a minute.
    pub shimmed: bool,
    /// The world that the texture belongs to; this one, unless given. So one rig slides over more textures than Table
    /// 1 has.
    pub samples_of: Option<u64>,
}

impl Default for Setup {
    fn default() -> Self {
        Self {
            texture: 1,
            world_seed: 1,
            trial_seed: 1,
            finger_seed: 1,
            finger: FingerName::Biotac,
            keep_edges: false,
            shimmed: false,
            samples_of: None,
        }
    }
}

/// The ground truth, which no pin shows.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Truth {
    /// Time of these values: the end of the tick, at most 76 us ahead of the time reached.
    pub at_ns: u64,
    /// Number of the mounted texture.
    pub texture: u8,
    /// Contact force, N.
    pub force_n: f64,
    /// Largest contact force of all ticks since [`World::reset_extremes`], N.
    pub force_max_n: f64,
    /// Shear on the stage, N; positive towards higher positions, so against a movement it is negative.
    pub shear_n: f64,
    /// Height of the undeformed fingertip over the steel plate, mm.
    pub tip_mm: f64,
    /// Depth of the sample in the fingertip, mm; negative is a gap.
    pub indentation_mm: f64,
    /// Steps down that STEP commanded and the lever did not make, less those up.
    pub(crate) lever_missing_steps: f64,
    /// STEP and DIR edges that broke the driver's timing.
    pub lever_bad_pulses: u64,
    /// Place of the stage, mm from its lower hard stop.
    pub stage_mm: f64,
    /// Lowest and highest place of the stage since [`World::reset_extremes`], mm.
    pub stage_reach_mm: (f64, f64),
    /// Place of the finger on the sample, mm from its edge.
    pub sample_mm: f64,
    /// Speed of the stage, mm/s.
    pub speed_mm_s: f64,
    /// Motor current, A.
    pub current_a: f64,
    /// Yield of the finger's mount, mm.
    pub mount_mm: f64,
    /// Work of the finger's shear since power-up, J: it wears the skin.
    pub sliding_j: f64,
    /// Wear of the skin, as the finger has it.
    pub wear: f64,
}

/// The reason why a hand cannot get between finger and sample, or another sample cannot.
#[derive(thiserror::Error, Clone, Copy, PartialEq, Debug)]
#[error("the finger would be {indentation_mm:.3} mm deep in the sample: lift it first")]
pub struct NotLifted {
    /// Depth of the sample in the fingertip, mm.
    pub indentation_mm: f64,
}

/// The rig.
pub struct World {
    setup: Setup,
    variation: f64,
    now_ns: u64,
    ticks: u64,
    tick_began_ns: u64,
    tick_ends_ns: u64,
    lever: Lever,
    mount: Mount,
    stage: Stage,
    /// the enables of lever and stage
    wanted: (bool, bool),
    encoder: Encoder,
    surface: Surface,
    finger: Finger,
    peers: Peers,
    /// bytes since chip select fell
    selected: Option<usize>,
    miso: Miso,
    faults: Faults,
    wires: Wires,
    /// latest first
    scheduled: Vec<(u64, Fault)>,
    force_max_n: f64,
    stage_reach_mm: (f64, f64),
    sliding_j: f64,
    /// a weight on the inclined stage, N
    pull_n: f64,
    holder: Option<Holder>,
    /// amplitude, g, and frequency, Hz, of what shakes the table under the rig
    table: (f64, f64),
}

impl World {
    /// Range of the tip at power-up, mm over the plate, and of the stage, mm (chosen): a controller has to find its
    /// switches.
    const POWER_UP_MM: [(f64, f64); 2] = [(12.0, 15.0), (20.0, 65.0)];
    /// Height to which shims bring a sample that is thinner, mm over the plate: a millimetre below the lowest tip at
    /// power-up.
    pub(crate) const SHIMMED_MM: f64 = 11.0;

    /// A rig just powered up: no current in either motor, the finger in the air.
    pub fn new(setup: Setup) -> Self {
        Self::under(setup, Conditions::default())
    }

    /// The same under other conditions than the usual ones.
    pub fn under(setup: Setup, conditions: Conditions) -> Self {
        let mut trial = Noise::new(setup.trial_seed, 0x3071d);
        // one finger in all trials, but each has landings and noise of its own
        let finger_noise = setup.finger_seed.rotate_left(32) ^ trial.uniform().to_bits();
        let [tip_mm, stage_mm] = Self::POWER_UP_MM.map(|(low, high)| trial.between(low, high));
        let finger = Finger::under([setup.finger_seed, finger_noise], conditions)
            .of(setup.finger, setup.finger_seed);
        let mut world = Self {
            setup,
            variation: conditions.variation,
            now_ns: 0,
            ticks: 0,
            tick_began_ns: 0,
            tick_ends_ns: 0,
            lever: Lever::new(tip_mm, setup.world_seed, setup.trial_seed),
            // without a second witness of the force, the mount is what yields
            mount: if setup.finger == FingerName::Mems {
                Mount::SPRUNG
            } else {
                Mount::STIFF
            },
            stage: Stage::new(stage_mm, setup.world_seed, setup.trial_seed),
            wanted: (false, false),
            encoder: Encoder::new(stage_mm, setup.keep_edges),
            surface: sample(
                setup.texture,
                setup.samples_of.unwrap_or(setup.world_seed),
                conditions.variation,
            ),
            peers: Peers::new(&finger, setup.finger_seed),
            finger,
            selected: None,
            miso: Miso::new(setup.trial_seed),
            faults: Faults::default(),
            wires: Wires::default(),
            scheduled: Vec::new(),
            force_max_n: 0.0,
            stage_reach_mm: (stage_mm, stage_mm),
            sliding_j: 0.0,
            pull_n: 0.0,
            holder: None,
            table: (0.0, 0.0),
        };
        world.advance_to(0);
        world
    }

    /// Lets time pass.
    pub fn advance_to(&mut self, now_ns: u64) {
        self.now_ns = self.now_ns.max(now_ns);
        while self.tick_ends_ns <= self.now_ns {
            self.tick();
        }
    }

    /// The time reached, ns.
    pub fn now_ns(&self) -> u64 {
        self.now_ns
    }

    /// STEP of the lever's driver. Each rising edge is a step; levels of at least 4 us.
    pub fn lever_step(&mut self, now_ns: u64, high: bool) {
        self.advance_to(now_ns);
        self.lever.step(now_ns, high, self.finger.force_n());
    }

    /// DIR of the lever's driver: high is down. Stable for 1 us before STEP rises.
    pub fn lever_dir(&mut self, now_ns: u64, high: bool) {
        self.advance_to(now_ns);
        self.lever.dir(now_ns, high);
    }

    /// EN of the lever's driver: high gives current (chosen; a driver with a low-active EN has an inverter). Low at
    /// power-up.
    pub fn lever_enable(&mut self, now_ns: u64, high: bool) {
        self.advance_to(now_ns);
        self.wanted.0 = high;
        self.supply_motors();
    }

    /// Duty of the stage's H-bridge, -1 to 1; positive drives to higher positions and counts. 0 shorts the motor: it
    /// brakes.
    pub fn stage_pwm(&mut self, now_ns: u64, duty: f64) {
        self.advance_to(now_ns);
        self.stage.set_duty(self.wires.motor_duty(duty));
    }

    /// The duty of the bridge that has this share of the PWM and this level of DIR at its inputs' wires.
    pub fn bridge_duty(&self, pwm: f64, dir: bool) -> f64 {
        self.wires.duty(pwm, dir)
    }

    /// Enable of the stage's H-bridge: low, the motor has no current and the stage coasts. Low at power-up.
    pub fn stage_enable(&mut self, now_ns: u64, high: bool) {
        self.advance_to(now_ns);
        self.wanted.1 = high;
        self.supply_motors();
    }

    /// Gives both motors current if they are enabled, unless the emergency stop has taken their supply.
    fn supply_motors(&mut self) {
        let dips = self.now_ns < self.faults.dip_ends_ns;
        let stopped =
            self.faults.e_stop.cuts_power() && !self.wires.have(Miswired::EStopKeepsSupply);
        let on = !stopped && !dips;
        let (lever, stage) = self.wanted;
        self.lever.enable(lever && on, self.finger.force_n());
        let open = self.faults.bridge_off || self.wires.have(Miswired::BridgeEnableOpen);
        self.stage.enabled = stage && on && !open;
    }

    /// Count of the stage's encoder, 1000 per mm, 0 where it stood at power-up.
    pub fn encoder(&self) -> i32 {
        self.encoder
            .count(self.stage.position_at_mm(self.fraction()))
    }

    /// The next edge of the encoder's lines up to the time reached, if [`Setup::keep_edges`] is set. Both lines are low
    /// at power-up.
    pub fn next_encoder_edge(&mut self) -> Option<Edge> {
        self.encoder.next_edge(self.now_ns)
    }

    /// The converter's reading of the stage's mean motor current: 12 bits over 3.3 V, about 2048 without current, 1
    /// V/A.
    pub fn motor_adc(&self) -> u16 {
        self.amplified(self.stage.adc(self.now_ns))
    }

    /// Its reading at this place in a period of the bridge's PWM.
    pub fn motor_adc_within(&self, phase: PwmPhase) -> u16 {
        self.amplified(self.stage.adc_within(self.now_ns, phase))
    }

    fn amplified(&self, reading: u16) -> u16 {
        self.faults.amplified(self.wires.amplified(reading))
    }

    /// The limit switch at the top of the lever's travel; `true` is closed.
    pub fn lever_top(&self) -> bool {
        self.faults.switches.read(self.switches(), self.now_ns)[0]
    }

    /// The limit switches at the lower and the upper end of the stage; `true` is closed.
    pub fn stage_limits(&self) -> (bool, bool) {
        let [_, lower, upper] = self.faults.switches.read(self.switches(), self.now_ns);
        (lower, upper)
    }

    /// The limit switches as they are wired: the lever's, then the stage's.
    fn switches(&self) -> [bool; 3] {
        let (lower, upper) = self.wires.limits(self.stage.limits());
        [
            self.lever.at_top() != self.wires.have(Miswired::TopNormallyOpen),
            lower,
            upper,
        ]
    }

    /// The emergency stop's contact for the firmware; `true` is open, as when it is pressed.
    pub fn e_stop(&self) -> bool {
        self.faults.e_stop.is_open(self.now_ns) && !self.wires.have(Miswired::EStopBridged)
    }

    /// The ground truth.
    pub fn truth(&self) -> Truth {
        let [_, sample_mm, speed_mm_s] = match &self.holder {
            Some(holder) => holder.place(),
            None => [0.0, self.stage.on_sample_mm(), self.stage.speed_mm_s],
        };
        Truth {
            at_ns: self.tick_ends_ns,
            texture: self.setup.texture,
            force_n: self.finger.force_n(),
            force_max_n: self.force_max_n,
            shear_n: self.finger.shear_n,
            tip_mm: self.lever.height_mm,
            indentation_mm: self.indentation_mm(),
            lever_missing_steps: self.lever.missing_steps(),
            lever_bad_pulses: self.lever.bad_pulses,
            stage_mm: self.stage.position_mm,
            stage_reach_mm: self.stage_reach_mm,
            sample_mm,
            speed_mm_s,
            current_a: self.stage.current_a,
            mount_mm: self.mount.pushed_mm,
            sliding_j: self.sliding_j,
            wear: self.finger.wear,
        }
    }

    /// Begins the maxima and the reach of [`Truth`] anew.
    pub fn reset_extremes(&mut self) {
        self.force_max_n = self.finger.force_n();
        self.stage_reach_mm = (self.stage.position_mm, self.stage.position_mm);
    }

    fn inject_at(&mut self, fault: Fault, at_ns: u64, position_mm: f64) {
        let now = self.switches();
        let faults = &mut self.faults;
        match fault {
            Fault::SensorUnplugged => match &mut self.peers {
                Peers::BioTac(sensor) => sensor.unplug(),
                peers => peers.break_part(at_ns, PartFault::Unplugged, &mut self.finger),
            },
            Fault::BitFlips { share } => faults.flip_share = share,
            Fault::WordNoise { share } => faults.noise_share = share,
            Fault::MisoStuck { high } => faults.miso_stuck = Some(high),
            Fault::SensorFrozen => faults.frozen = true,
            Fault::PdcDrift { counts_per_s } => faults.drift = Some((counts_per_s, at_ns)),
            Fault::PdcStuck => faults.pdc_stuck = true,
            Fault::PdcFades { seconds } => {
                let amplifiers = self.finger.amplifiers();
                amplifiers.into_iter().for_each(|a| a.fade_pdc(seconds));
            }
            Fault::SkinLeaks { seconds } => self.finger.leak_s = Some(seconds),
            Fault::PdcWeak { gain } => {
                let amplifiers = self.finger.amplifiers();
                amplifiers.into_iter().for_each(|a| a.weaken_pdc(gain));
            }
            Fault::StageJammed => self.stage.jammed = true,
            Fault::EncoderSwapped => self.encoder.swap(true, position_mm, at_ns),
            Fault::CurrentOffset { amperes } => faults.current = Some(amperes),
            Fault::CurrentSaturated => faults.current = Some(f64::INFINITY),
            Fault::SupplyDip { ms } => {
                faults.dip_ends_ns = at_ns + ms * 1_000_000;
                self.supply_motors();
            }
            Fault::BridgeOff => {
                faults.bridge_off = true;
                self.supply_motors();
            }
            Fault::FastDecay => self.stage.decays_fast = true,
            Fault::StageVibrates { um } => self.stage.vibration_um = um,
            Fault::EncoderCut(cut) => self.encoder.set_cut(Some(cut), position_mm, at_ns),
            Fault::StageLimitStuck { upper, closed } => {
                faults.switches.stuck[1 + usize::from(upper)] = Some(closed);
            }
            Fault::LeverTopStuck { closed } => faults.switches.stuck[0] = Some(closed),
            Fault::SwitchesBounce { ms } => faults.switches.bounce(now, ms),
            Fault::LeverLosesSteps { share } => self.lever.lost_share = share,
            Fault::LeverRunaway => self.lever.run_away_down(true),
            Fault::LeverDirInverted => self.lever.inverted = true,
            Fault::EStop => {
                faults.e_stop.press(at_ns);
                self.supply_motors();
            }
            Fault::EStopGlitch { us } => faults.e_stop.disturb(at_ns, us),
        }
    }

    fn tick(&mut self) {
        self.tick_began_ns = self.tick_ends_ns;
        let began_ns = self.tick_began_ns;
        while let Some((_, fault)) = self.scheduled.pop_if(|(at_ns, _)| *at_ns <= began_ns) {
            self.inject_at(fault, began_ns, self.stage.position_mm);
        }
        if (1..=began_ns).contains(&self.faults.dip_ends_ns) {
            self.faults.dip_ends_ns = 0;
            self.supply_motors();
        }
        self.ticks += 1;
        // 1 s / 13 200 is 2 500 000 / 33 ns: exact, and no overflow
        let (whole, rest) = (self.ticks / 33, self.ticks % 33);
        self.tick_ends_ns = whole * 2_500_000 + rest * 2_500_000 / 33;

        let shear_n = self.finger.shear_n;
        if let Some(holder) = &mut self.holder {
            holder.tick(self.finger.force_n());
            self.finger.held = holder.held();
            let [indentation_mm, x_mm, speed_mm_s] = holder.place();
            self.finger.tick(&Contact {
                indentation_mm,
                surface: Some(&self.surface),
                x_mm,
                speed_mm_s,
                lever_vibration: 0.0,
            });
            self.peers.tick(self.tick_ends_ns, &self.finger);
            self.force_max_n = self.force_max_n.max(self.finger.force_n());
            self.move_motors(0.0, 0.0);
            return;
        }
        let force_n = self.finger.force_n();
        let (table_g, hz) = self.table;
        if table_g != 0.0 {
            let turns = hz * self.tick_ends_ns as f64 * 1e-9;
            self.finger.held = Held {
                acceleration_g: table_g * sin(TAU * turns),
                ..Held::STILL
            };
        }
        self.mount.tick(force_n);
        let [from_mm, to_mm] = self.move_motors(force_n, shear_n);
        self.finger.tick(&Contact {
            indentation_mm: self.indentation_mm(),
            surface: Some(&self.surface),
            x_mm: self.stage.on_sample_mm(),
            speed_mm_s: self.stage.speed_mm_s,
            lever_vibration: self.lever.vibration_pa(),
        });

        self.peers.tick(self.tick_ends_ns, &self.finger);
        self.force_max_n = self.force_max_n.max(self.finger.force_n());
        self.stage_reach_mm.0 = self.stage_reach_mm.0.min(to_mm);
        self.stage_reach_mm.1 = self.stage_reach_mm.1.max(to_mm);
        self.sliding_j -= shear_n * (to_mm - from_mm) * 1e-3;
    }

    /// A tick of lever and stage with this force of the finger and this shear on them, N: from where to where the stage
    /// goes.
    fn move_motors(&mut self, force_n: f64, shear_n: f64) -> [f64; 2] {
        self.lever.tick(self.tick_ends_ns, force_n);
        let from_mm = self.stage.position_mm;
        self.stage.tick(shear_n + self.pull_n);
        let to_mm = self.stage.position_mm;
        if from_mm != to_mm {
            self.encoder
                .pass([from_mm, to_mm], [self.tick_began_ns, self.tick_ends_ns]);
        }
        let switches = self.switches();
        self.faults.switches.watch(switches, self.tick_ends_ns);
        [from_mm, to_mm]
    }

    /// Part of its tick at the time reached, 0 to 1.
    fn fraction(&self) -> f64 {
        (self.now_ns - self.tick_began_ns) as f64 / (self.tick_ends_ns - self.tick_began_ns) as f64
    }

    fn indentation_mm(&self) -> f64 {
        if let Some(holder) = &self.holder {
            return holder.place()[0];
        }
        self.over_tip_mm(&self.surface) + self.stage.heave_mm()
    }

    /// Height of a sample over the undeformed tip, mm.
    fn over_tip_mm(&self, surface: &Surface) -> f64 {
        let thickness_mm = surface.texture.thickness_mm;
        let top_mm = if self.setup.shimmed {
            thickness_mm.max(Self::SHIMMED_MM)
        } else {
            thickness_mm
        };
        top_mm - self.lever.height_mm - self.mount.pushed_mm
    }

    fn must_be_over(&self, surface: &Surface) -> Result<(), NotLifted> {
        let over_mm = self.over_tip_mm(surface);
        let indentation_mm = self.holder.as_ref().map_or(over_mm, |h| h.place()[0]);
        if indentation_mm > 0.0 {
            return Err(NotLifted { indentation_mm });
        }
        Ok(())
    }
}

/// The sample of a texture that belongs to a world.
fn sample(texture: u8, world_seed: u64, variation: f64) -> Surface {
    Surface::new(&textures::draw(texture, world_seed), world_seed, variation)
}

mod breaking;
mod bus;
mod by_hand;
#[cfg(test)]
mod tests;
