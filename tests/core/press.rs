//! A campaign of presses: worlds, the whole grid of movements, ten textures of each world, and P_DC sound, dead, dying
//! and leaking. It checks the world's own force.

use std::fmt;
use std::ops::RangeInclusive;

use rayon::prelude::*;
use tactus_core::features::Movement;
use tactus_core::rig::guard::Unguarded;
use tactus_core::rig::{Ended, Phase};

use tactus_lab::sim::collection::{Collection, texture_name};
use tactus_lab::sim::rig::{FORCE_LIMIT_N, SimError, SimRig};
use tactus_world::conditions::Conditions;
use tactus_world::faults::Fault as Cause;
use tactus_world::maths::pow;
use tactus_world::mount::Mount;
use tactus_world::noise::Noise;
use tactus_world::textures;
use tactus_world::world::Setup;

/// Textures of each world: the softest, the stiffest, and others by its seed.
const TEXTURES: usize = 10;
const STREAM: u64 = 0x9e55;
/// Times in which a torn skin loses its pressure, s: see [`Trouble::Leaking`]. Within 0.05 s it shows contact in
/// neither signal, as the book's page of limits says.
const LEAK_S: (f64, f64) = (0.1, 50.0);

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Trouble {
    Sound,
    /// It is dead before the lever comes down.
    Dead,
    /// It dies while the finger presses, at once or within three seconds.
    Dying,
    /// The skin leaks from the start or from somewhere in the press on, in 0.1 to 50 s.
    Leaking,
}

impl Trouble {
    pub(crate) const ALL: [Self; 4] = [Self::Sound, Self::Dead, Self::Dying, Self::Leaking];

    /// A cause, and the share of the wanted force at which it comes.
    fn draw(self, noise: &mut Noise) -> Option<(Cause, f64)> {
        let (which, share, time) = (noise.uniform(), noise.uniform(), noise.uniform());
        let between = |low: f64, high: f64| low * pow(high / low, time);
        match self {
            Self::Sound => None,
            Self::Dead if which < 0.5 => Some((Cause::PdcStuck, 0.0)),
            Self::Dead => Some((Cause::PdcFades { seconds: 0.0 }, 0.0)),
            Self::Dying if which < 0.4 => Some((Cause::PdcStuck, share)),
            Self::Dying if which < 0.6 => Some((Cause::PdcFades { seconds: 0.0 }, share)),
            Self::Dying => {
                let seconds = between(0.05, 3.0);
                Some((Cause::PdcFades { seconds }, share))
            }
            Self::Leaking => {
                let seconds = between(LEAK_S.0, LEAK_S.1);
                let share = if which < 0.5 { 0.0 } else { share };
                Some((Cause::SkinLeaks { seconds }, share))
            }
        }
    }
}

#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Bench {
    /// The world's seed.
    pub(crate) world: u64,
    pub(crate) texture: u8,
    pub(crate) trouble: Trouble,
    pub(crate) unguarded: Unguarded,
    /// The finger's mount.
    pub(crate) mount: Mount,
}

#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Press {
    pub(crate) bench: Bench,
    /// Seed of its trial.
    pub(crate) seed: u64,
    pub(crate) movement: Movement,
    /// The fault, and its share of the movement's force.
    pub(crate) cause: Option<(Cause, f64)>,
    /// Largest force by the world's own reckoning, until the finger was lifted, N.
    pub(crate) force_max_n: f64,
    pub(crate) ended: Result<Ended, SimError>,
}

impl Press {
    pub(crate) fn is_too_hard(&self) -> bool {
        self.force_max_n > FORCE_LIMIT_N
    }
}

impl fmt::Display for Press {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Bench {
            world,
            texture,
            trouble,
            ..
        } = self.bench;
        let name = texture_name(texture);
        write!(
            f,
            "world {world}, T{texture} {name}, {}, seed {}, {trouble:?}",
            self.movement, self.seed
        )?;
        if let Some((cause, share)) = self.cause {
            write!(f, " ({cause:?} at {share:.2} of the force)")?;
        }
        write!(f, ": {:.3} N at most, ", self.force_max_n)?;
        match &self.ended {
            Ok(ended) => write!(f, "{ended:?}"),
            Err(error) => write!(f, "{error}"),
        }
    }
}

#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Campaign {
    /// Seeds of the worlds.
    pub(crate) worlds: RangeInclusive<u64>,
    /// Every so-manieth rig; 1 is all. An odd number, no multiple of 5, comes to all textures and troubles.
    pub(crate) every: usize,
    pub(crate) unguarded: Unguarded,
}

impl Campaign {
    pub(crate) fn benches(&self) -> Vec<Bench> {
        let mut benches = Vec::new();
        for world in self.worlds.clone() {
            for texture in textures_of(world) {
                for trouble in Trouble::ALL {
                    benches.push(Bench {
                        world,
                        texture,
                        trouble,
                        unguarded: self.unguarded,
                        mount: Mount::STIFF,
                    });
                }
            }
        }
        benches.into_iter().step_by(self.every.max(1)).collect()
    }

    /// Makes all presses, rigs side by side; `done` is called after each rig.
    pub(crate) fn run(&self, done: impl Fn() + Sync) -> Vec<Press> {
        let presses = self.benches().into_par_iter().flat_map_iter(|bench| {
            let presses = bench.run();
            done();
            presses
        });
        presses.collect()
    }
}

/// The softest, the stiffest and eight others, in order.
fn textures_of(world: u64) -> Vec<u8> {
    let mut by_give: Vec<u8> = (1..=117).collect();
    by_give.sort_by(|&a, &b| {
        let [a, b] = [a, b].map(|number| textures::draw(number, world).compliance_mm_per_n);
        a.total_cmp(&b)
    });
    let mut noise = Noise::new(world, STREAM);
    let mut chosen = vec![by_give.remove(0), by_give.remove(115)];
    while chosen.len() < TEXTURES {
        let at = (noise.uniform() * by_give.len() as f64) as usize;
        chosen.push(by_give.remove(at));
    }
    chosen.sort_unstable();
    chosen
}

impl Bench {
    pub(crate) fn run(&self) -> Vec<Press> {
        self.make(Movement::grid())
    }

    /// Makes these movements; high forces are allowed.
    pub(crate) fn make(&self, movements: impl IntoIterator<Item = Movement>) -> Vec<Press> {
        let number = Trouble::ALL.iter().position(|t| *t == self.trouble);
        let collection = Collection::new(self.world, Vec::new(), 1);
        let setup = Setup {
            shimmed: true,
            ..collection.setup(self.texture, 900 + number.unwrap_or(0) as u64)
        };
        let mut rig = SimRig::under(setup, Conditions::default(), self.unguarded);
        rig.world().mount(self.mount);
        rig.control().allow_high_force(true);
        let mut noise = Noise::new(setup.trial_seed, STREAM);
        let press = |movement| {
            let cause = self.trouble.draw(&mut noise);
            let ended = make(&mut rig, movement, cause);
            Press {
                bench: *self,
                seed: setup.trial_seed,
                movement,
                cause,
                force_max_n: rig.world().truth().force_max_n,
                ended,
            }
        };
        movements.into_iter().map(press).collect()
    }
}

/// Makes one movement, on a rig that is repaired before it; the cause comes at a share of the movement's force.
pub(crate) fn make(
    rig: &mut SimRig,
    movement: Movement,
    cause: Option<(Cause, f64)>,
) -> Result<Ended, SimError> {
    rig.world().clear();
    rig.control().reset()?;
    if rig.control().phase() == Phase::Parked {
        rig.home()?;
    }
    rig.world().reset_extremes();
    rig.control().start(movement, 0.3)?;
    let at_n = |share: f64| share * f64::from(movement.force_n());
    let mut cause = cause.map(|(cause, share)| (cause, at_n(share)));
    // the lever's whole way takes half a minute
    for _ in 0..60_000 {
        rig.tick();
        if let Some((fault, force_n)) = cause
            && rig.world().truth().force_n >= force_n
            && rig.control().phase() == Phase::Pressing
        {
            rig.world().inject(fault);
            cause = None;
        }
        if rig.control().is_at_rest() {
            break;
        }
    }
    rig.rest(|_| ())?;
    rig.control().take_ended().ok_or(SimError::Stopped)
}
