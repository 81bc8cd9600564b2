//! The finger: the effects of a contact on its skin, and on its fluid or its other transducers.
//!
//! A tick goes: the skin is indented (`skin`), sticks or slips along the surface, ridges and fluid turn the surface
//! into pressure (`vibration`), and the amplifiers make the two signals that the sensor samples (`amplifier`). Fingers
//! without a fluid have other transducers in its place (`signals`); their skin of solid silicone of Shore 10 A to 20 A
//! is a Hertz contact of about the same stiffness.

mod amplifier;
mod analog;
mod cell;
mod mems;
mod signals;
mod skin;
mod stimulus;
mod vibration;

use super::conditions::{Conditions, TICK_S};
use super::maths::exp;
use super::noise::Noise;
use super::parts::fault::PartFault;
use super::played::{PlayCounts, Playback, Played};
use super::surface::Surface;
use super::textures::Texture;
use amplifier::Amplifiers;
use signals::newtons;
pub(super) use signals::{FLUID_PA_PER_G, Signals};
use skin::Skin;
pub use stimulus::Held;
pub(super) use stimulus::Stimulus;
use tactus_core::sensor::FingerName;
use vibration::Vibrations;

pub(crate) use amplifier::PA_PER_N;
#[cfg(test)]
pub(crate) use amplifier::PAC_PA_PER_COUNT;
#[cfg(test)]
pub(crate) use skin::N_PER_COUNT;

/// Deviations of the contact's state, drawn at every touch and multiplied by [`Conditions::variation`]; all chosen.
mod touch {
    /// Of ln(friction) at rest: moisture, dust, how the skin has landed.
    pub(super) const FRICTION: f64 = 0.02;
    /// It grows with speed, being twice as much at this one, mm/s (PAPER: slow slides gave the more stable forces).
    pub(super) const FRICTION_SPEED_MM_S: f64 = 40.0;
    /// Of the shear that does not depend on load (adhesion), N.
    pub(super) const ADHESION_N: f64 = 0.008;
    /// Of ln(amplitude of vibrations).
    pub(super) const VIBRATION: f64 = 0.04;
    /// More of the same for each newton: pressed hard, it matters more how the skin lies on the core.
    pub(super) const VIBRATION_PER_N: f64 = 0.06;
    /// Of ln(resonant frequency).
    pub(super) const RESONANCE: f64 = 0.03;
}

/// Relative deviation of friction while it slides at 25 mm/s, growing with the root of speed (chosen; PAPER: slow
/// slides are the more stable).
const UNSTEADY: f64 = 0.02;
/// Speed for the above, mm/s.
const UNSTEADY_AT_MM_S: f64 = 25.0;
/// Memory of that, s (chosen).
const UNSTEADY_S: f64 = 0.15;

/// Shear stiffness of the skin, N/mm (chosen: as stiff as it is in the direction of the press).
const SHEAR_N_PER_MM: f64 = 1.0;
/// Shear bulges the skin: part of it that adds to the fluid's pressure like a normal force (PAPER: "modest changes").
const SHEAR_TO_PDC: f64 = 0.03;
/// Friction changes slowly along a sample: it is looked up every so many ticks.
const FRICTION_TICKS: u32 = 8;

/// Sliding energy after which the ridges are gone, at low power, J. Chosen so that the paper's 117 * 15 slides, some 50
/// J, take about the two skins that they took, each replaced at the first visible sign of wear.
const SKIN_LIFE_J: f64 = 200.0;
/// Sliding power at which a joule wears twice as much as at low power, mW (chosen: the paper's movements, all of
/// 12.6 mW times the coefficient of friction, wear little; those it avoided for wear are above 20 mW).
const WEAR_POWER_MW: f64 = 25.0;

/// Wear in a second of sliding with this power.
fn wear_per_s(power_mw: f64) -> f64 {
    let excess = power_mw / WEAR_POWER_MW;
    1e-3 * power_mw / SKIN_LIFE_J * (1.0 + excess * excess)
}

/// Wear that sliding over a texture takes, for each mm: what the finger's will grow by, but for the variation of
/// touches.
pub fn wear_per_mm(texture: &Texture, force_n: f64, speed_mm_s: f64) -> f64 {
    let power_mw = texture.mean_friction(speed_mm_s, force_n) * force_n * speed_mm_s;
    wear_per_s(power_mw) / speed_mm_s
}

/// The surface under the finger and the finger's motion.
#[derive(Clone, Copy)]
pub(crate) struct Contact<'a> {
    /// Depth by which the skin is pressed against the surface, mm; not touching if not above 0.
    pub(crate) indentation_mm: f64,
    pub(crate) surface: Option<&'a Surface>,
    pub(crate) x_mm: f64,
    /// Velocity of the finger along the sample, mm/s.
    pub(crate) speed_mm_s: f64,
    /// Pressure that the vibration of the mounting adds, Pa.
    pub(crate) lever_vibration: f64,
}

/// State of one contact, drawn when the skin lands: deviations in units of those in [`touch`], and the factor on the
/// resonant frequency.
#[derive(Clone, Copy)]
struct Touch {
    friction: f64,
    adhesion: f64,
    vibration: f64,
    detuned: f64,
}

/// A BioTac.
pub(crate) struct Finger {
    noise: Noise,
    variation: f64,
    skin: Skin,
    vibrations: Vibrations,
    signals: Signals,
    pub(super) held: Held,
    touch: Option<Touch>,
    /// relative unsteadiness of friction
    unsteady: f64,
    /// ln of the amplitude of vibrations, and the amplitude: both stay the same while the finger is still
    amplitude: (f64, f64),
    /// coefficient of friction as last looked up, and when to look again
    friction: f64,
    look_again: u32,
    slipping: bool,
    /// shear force, N; it opposes the motion
    pub(super) shear_n: f64,
    /// wear of the skin: 0 is new, at 1 its ridges are gone
    pub(super) wear: f64,
    /// time in which the fluid's pressure runs out of a torn skin, s, and the force that it no longer carries, N
    /// (faults)
    pub(super) leak_s: Option<f64>,
    leaked_n: f64,
    /// recorded slides instead of what the surface does
    playback: Option<Playback>,
}

impl Finger {
    /// A finger with a new skin.
    #[cfg(test)]
    pub(crate) fn new(seed: u64) -> Self {
        Self::under([seed; 2], Conditions::default())
    }

    /// A finger under other conditions than the usual ones. The first seed draws its properties, the second one the
    /// events of this trial: its landings and its noise.
    pub(crate) fn under([made, trial]: [u64; 2], conditions: Conditions) -> Self {
        let mut noise = Noise::new(trial, 500);
        Self {
            variation: conditions.variation,
            skin: Skin::default(),
            vibrations: Vibrations::default(),
            signals: Signals::Fluid(Amplifiers::new(&mut Noise::new(made, 501), &mut noise)),
            held: Held::STILL,
            touch: None,
            unsteady: 0.0,
            amplitude: (0.0, 1.0),
            friction: 0.0,
            look_again: 0,
            slipping: false,
            shear_n: 0.0,
            wear: conditions.wear.clamp(0.0, 1.0),
            leak_s: None,
            leaked_n: 0.0,
            playback: None,
            noise,
        }
    }

    /// The same skin on the transducers of another kind of finger, whose first seed is `made`.
    #[must_use]
    pub(crate) fn of(mut self, finger: FingerName, made: u64) -> Self {
        let made = &mut Noise::new(made, 502);
        match finger {
            FingerName::Biotac => {}
            FingerName::Analog => self.signals = Signals::Analog(analog::Analog::new(made)),
            FingerName::Mems => self.signals = Signals::Mems(mems::Mems::new(made)),
        }
        self
    }

    pub(super) fn signals(&self) -> &Signals {
        &self.signals
    }

    /// Those of a BioTac.
    pub(super) fn amplifiers(&mut self) -> Option<&mut Amplifiers> {
        match &mut self.signals {
            Signals::Fluid(amplifiers) => Some(amplifiers),
            _ => None,
        }
    }

    /// Feeds the transducers alone, without a contact: for tests of the chain behind them. An accelerometer feels as
    /// many g as the vibration has newtons, without the silicone's resonance.
    #[cfg(test)]
    pub(super) fn feed(&mut self, stimulus: &Stimulus) {
        self.signals.tick(stimulus, &mut self.noise);
        if let Signals::Mems(mems) = &mut self.signals {
            mems.feed(stimulus.held.down + stimulus.vibration_n);
        }
    }

    /// Breaks something of the transducers.
    pub(super) fn break_part(&mut self, fault: PartFault) {
        let gain = match fault {
            PartFault::CellReversed => -1.0,
            PartFault::CellBlocked => 0.0,
            _ => 1.0,
        };
        match (&mut self.signals, fault) {
            (Signals::Analog(analog), PartFault::CellWire) => analog.wire_cut = true,
            (Signals::Analog(analog), _) => analog.cell.gain = gain,
            (Signals::Mems(mems), _) => mems.cell.gain = gain,
            (Signals::Fluid(_), _) => {}
        }
    }

    /// From now on slides feel like these, in an order that `seed` gives; without any, like the surface again.
    pub(crate) fn play(&mut self, slides: Vec<Played>, seed: u64) {
        self.playback = (!slides.is_empty()).then(|| Playback::new(slides, seed));
    }

    pub(crate) fn played(&self) -> PlayCounts {
        self.playback
            .as_ref()
            .map_or_else(PlayCounts::default, Playback::counts)
    }

    pub(crate) fn tick(&mut self, contact: &Contact<'_>) {
        if let Some(playback) = &mut self.playback {
            let touching = contact.surface.is_some() && contact.indentation_mm > 0.0;
            playback.tick(touching, contact.speed_mm_s);
        }
        let white = self.noise.white();
        let mut pressure_pa = contact.lever_vibration;
        match contact.surface {
            Some(surface) if contact.indentation_mm > 0.0 => {
                pressure_pa += self.touching(contact, surface, white);
            }
            _ => {
                self.touch = None;
                self.skin.lift();
                self.shear_n = 0.0;
                self.slipping = false;
            }
        }
        let detuned = self.touch.map_or(1.0, |touch| touch.detuned);
        let force = self.carried_n();
        let fluid_pa = self
            .vibrations
            .fluid(pressure_pa + PA_PER_N * force, force, detuned);
        let dc_n = force + SHEAR_TO_PDC * self.shear_n.abs();
        let lever_g = contact.lever_vibration / FLUID_PA_PER_G;
        let stimulus = Stimulus {
            fluid_pa,
            slow_pa: PA_PER_N * dc_n,
            force_n: self.skin.force_n(),
            vibration_n: newtons(pressure_pa - contact.lever_vibration),
            shear_n: self.shear_n.abs(),
            held: Held {
                acceleration_g: self.held.acceleration_g + lever_g,
                ..self.held
            },
        };
        self.signals.tick(&stimulus, &mut self.noise);
    }

    /// Part of the force that the fluid carries at this tick, N. Fluid that has run out of a torn skin does not come
    /// back; a slack skin has no pressure below that of the air.
    fn carried_n(&mut self) -> f64 {
        let Some(seconds) = self.leak_s else {
            return self.skin.fluid_n();
        };
        let carried_n = (self.skin.fluid_n() - self.leaked_n).max(0.0);
        self.leaked_n += carried_n * TICK_S / seconds.max(TICK_S);
        carried_n
    }

    /// A tick in contact; gives the pressure of vibrations, Pa.
    fn touching(&mut self, contact: &Contact<'_>, surface: &Surface, white: [f64; 2]) -> f64 {
        let landed = self.touch.is_none();
        let touch = match self.touch {
            Some(touch) => touch,
            None => self.land(),
        };
        let texture = &surface.texture;
        let force = self.skin.fluid_n();
        let deviation = touch::VIBRATION + touch::VIBRATION_PER_N * force;
        let amplitude = deviation * touch.vibration;
        if self.amplitude.0 != amplitude {
            self.amplitude = (amplitude, exp(amplitude));
        }
        let amplitude = self.amplitude.1;
        if landed {
            self.vibrations.land();
        }
        let follow_um =
            self.vibrations
                .follow_um(surface, contact.x_mm, force, amplitude, self.wear);
        self.skin.press(
            contact.indentation_mm + 1e-3 * follow_um,
            texture.compliance_mm_per_n,
            landed,
        );
        let load_n = self.skin.force_n();

        let speed = contact.speed_mm_s.abs();
        if self.look_again == 0 || landed {
            self.look_again = FRICTION_TICKS;
            self.friction = surface.friction(contact.x_mm, speed, load_n);
            let deviation = touch::FRICTION * (1.0 + speed / touch::FRICTION_SPEED_MM_S);
            self.friction *= exp(deviation * touch.friction);
        }
        self.look_again -= 1;
        self.shear(contact.speed_mm_s, load_n, texture.stiction, touch);

        let sliding = if self.slipping { speed } else { 0.0 };
        let power_mw = self.shear_n.abs() * sliding;
        self.wear = (self.wear + wear_per_s(power_mw) * TICK_S).min(1.0);

        self.vibrations
            .sliding_pa(surface, contact.x_mm, sliding, self.shear_n.abs(), white)
    }

    fn land(&mut self) -> Touch {
        let mut draw = || self.variation * self.noise.normal();
        let touch = Touch {
            friction: draw(),
            adhesion: draw(),
            vibration: draw(),
            detuned: exp(touch::RESONANCE * draw()),
        };
        self.touch = Some(touch);
        touch
    }

    /// Sticks, breaks away or slips: the skin stretches until static friction gives way, then kinetic friction holds
    /// it.
    fn shear(&mut self, speed_mm_s: f64, load_n: f64, stiction: f64, touch: Touch) {
        let memory = TICK_S / UNSTEADY_S;
        let kick = (2.0 * memory).sqrt() * UNSTEADY * (speed_mm_s.abs() / UNSTEADY_AT_MM_S).sqrt();
        self.unsteady += -memory * self.unsteady + kick * self.noise.white()[0];
        let adhesion = touch::ADHESION_N * touch.adhesion;
        let simulated = self.friction * (1.0 + self.unsteady) * load_n + adhesion;
        let played = self.playback.as_ref().and_then(Playback::shear_n);
        let kinetic = played.unwrap_or(simulated).max(0.0);

        let opposes = self.shear_n * speed_mm_s < 0.0;
        self.slipping &= opposes;
        if self.slipping {
            self.shear_n = kinetic.copysign(-speed_mm_s);
            return;
        }
        self.shear_n -= SHEAR_N_PER_MM * speed_mm_s * TICK_S;
        if self.shear_n.abs() > kinetic * (1.0 + stiction) {
            self.slipping = opposes;
            self.shear_n = kinetic.copysign(self.shear_n);
        }
    }

    /// Force on the skin, N.
    pub(crate) fn force_n(&self) -> f64 {
        self.skin.force_n()
    }

    /// Puts on a skin that is worn: 0 is new, at 1 its ridges are gone.
    pub(crate) fn put_on_skin(&mut self, wear: f64) {
        self.wear = wear.clamp(0.0, 1.0);
    }

    /// Fills a torn skin, and mends the amplifier.
    pub(crate) fn mend(&mut self) {
        (self.leak_s, self.leaked_n) = (None, 0.0);
        match &mut self.signals {
            Signals::Fluid(amplifiers) => amplifiers.mend(),
            Signals::Analog(analog) => {
                analog.wire_cut = false;
                analog.cell.gain = 1.0;
            }
            Signals::Mems(mems) => mems.cell.gain = 1.0,
        }
    }

    /// Reading of a converter of 12 bits on P_AC (0) or P_DC (1). An accelerometer has none.
    pub(super) fn sample_channel(&mut self, channel: u8, fraction: f64) -> u16 {
        let noise = &mut self.noise;
        let amplifiers = match &mut self.signals {
            Signals::Analog(analog) => {
                let volts = analog.volts(channel, fraction, noise);
                return (volts * 4096.0 / analog::SUPPLY_V).clamp(0.0, 4095.0) as u16;
            }
            Signals::Mems(_) => return 0,
            Signals::Fluid(amplifiers) => amplifiers,
        };
        if channel != 0 {
            return amplifiers.sample_pdc(fraction, noise);
        }
        let Some(playback) = &mut self.playback else {
            return amplifiers.sample_pac(fraction, noise);
        };
        match playback.pac(fraction) {
            // its noise is in the recording
            Some(recorded) => {
                let about_rest = recorded.unwrap_or_else(|| amplifiers.pac_noise(noise));
                let (counts, clipped) = amplifiers.convert_pac(about_rest);
                if clipped {
                    playback.clipped();
                }
                counts
            }
            None => amplifiers.sample_pac(fraction, noise),
        }
    }
}
