//! The handheld probe in the simulated world: a hand that follows the display, and the table that is learned from it.

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use tactus_core::dsp::Plan;
use tactus_core::explorer::Method;
use tactus_core::features::Observation;
use tactus_core::handheld::guidance::{Again, Event};
use tactus_core::handheld::touch::Touch;
use tactus_core::handheld::{FEATURES, MOVEMENT};
use tactus_core::sensor::FingerCode;
use tactus_core::sensor::pressure::{Pressure, SLOTS_HZ};
use tactus_core::table::Drift;

use crate::eval::learn::{Expected, TableError, learn_for, name_finger};
use crate::sim::collection::{Collection, texture_name};
use tactus_world::flow::{Ground, HEIGHT_MM};
use tactus_world::maths::exp;
use tactus_world::motion::MotionSensor;
use tactus_world::person::{Hand, Manner};
use tactus_world::slot::Reader;
use tactus_world::world::{Setup, Truth, World};

/// Slots from one reading of the sensor of motion to the next: 10 ms.
const READING_SLOTS: u64 = SLOTS_HZ as u64 / 100;
const REACTION_S: (f64, f64) = (0.2, 0.5);
/// Duration of a person's slide, s: until the bar is full, and a little more.
const SLIDE_S: f64 = 1.8;
/// Attempts that a person makes before giving up on a texture.
const ATTEMPTS: u32 = 10;

/// One slide over a texture after the other was no good.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "{}: none of {ATTEMPTS} slides was good, the last one was {}; take another texture or another seed",
    texture_name(*texture), why.map_or("not noticed", Again::why)
)]
pub struct NoGoodSlide {
    texture: u8,
    why: Option<Again>,
}

/// A texture as an optical sensor of motion at this height sees it: no surface for glass and polished ones (chosen).
pub fn ground(texture: u8, height_mm: f64) -> Ground {
    let name = texture_name(texture).to_lowercase();
    if name.contains("glass") || name.contains("polished") {
        Ground::Glass
    } else {
        Ground::Seen(height_mm)
    }
}

/// A person with a probe.
pub struct Person {
    world: World,
    reader: Reader,
    slot: u64,
    random: ChaCha8Rng,
    manner: Manner,
    motion: Option<MotionSensor>,
    texture: u8,
}

impl Person {
    /// A person who holds the probe over the texture of `setup`.
    pub fn new(setup: Setup, manner: Manner) -> Self {
        let mut world = World::new(setup);
        world.hold(Hand::new(setup.trial_seed, manner));
        let mut random = ChaCha8Rng::seed_from_u64(setup.trial_seed);
        random.set_stream(1);
        let reader = Reader::new(setup.finger);
        // parts that do not start give no words, and that is noticed
        let began_ns = u64::from(reader.power_up_ms()) * 1_000_000;
        let _ = reader.start_up(began_ns, |transfer, mosi, miso| {
            world.transfer(transfer, mosi, miso);
        });
        Self {
            world,
            reader,
            slot: 0,
            random,
            manner,
            motion: manner
                .tilt_mm
                .map(|_| MotionSensor::new(setup.trial_seed, ground(setup.texture, HEIGHT_MM))),
            texture: setup.texture,
        }
    }

    /// The next word of the sensor.
    pub fn word(&mut self) -> Option<Pressure> {
        let at = u128::from(self.slot) * 1_000_000_000 / u128::from(SLOTS_HZ);
        // the sensor needs 100 ms to start
        let at_ns = 150_000_000 + at as u64;
        let slot = self.slot;
        self.slot += 1;
        let world = &mut self.world;
        self.reader
            .word_of_slot(slot, at_ns, |transfer, mosi, miso| {
                world.transfer(transfer, mosi, miso);
            })
    }

    /// Sets the intention of the hand.
    pub fn intend(&mut self, force_n: f64, pace_mm_s: f64) {
        if let Some(hand) = self.world.hand() {
            hand.intend(force_n, pace_mm_s);
        }
    }

    /// The ground truth.
    pub fn truth(&self) -> Truth {
        self.world.truth()
    }

    fn normal(&mut self) -> f64 {
        // twelve uniform ones: a person is no mathematician
        (0..12).map(|_| self.random.random::<f64>()).sum::<f64>() - 6.0
    }

    /// Lets so much time pass; the first event for which `until` holds ends it.
    fn run_until(
        &mut self,
        touch: &mut Touch<'_>,
        seconds: f64,
        until: impl Fn(&Event) -> bool,
    ) -> Option<Event> {
        for _ in 0..(seconds * f64::from(SLOTS_HZ)) as u32 {
            let word = self.word();
            let due = self.slot.is_multiple_of(READING_SLOTS);
            if let (Some(motion), Some(hand), true) = (&mut self.motion, self.world.hand(), due) {
                let at_ns = self.slot * 1_000_000_000 / u64::from(SLOTS_HZ);
                touch.moved(motion.poll(at_ns, hand.x_mm()));
            }
            if let Some(event) = touch.word(word)
                && until(&event)
            {
                return Some(event);
            }
        }
        None
    }

    /// Presses and slides as the probe prompts: returns the slide, or its fault; `None` if nothing was noticed.
    pub fn slide(&mut self, touch: &mut Touch<'_>) -> Option<Result<Observation, Again>> {
        let target_n = f64::from(<(u16, u32)>::from(MOVEMENT).0) * 1e-3;
        let pace_mm_s = f64::from(<(u16, u32)>::from(MOVEMENT).1) * 1e-3;
        let force_n = target_n * exp(self.manner.force_spread * self.normal());
        let pace_mm_s = pace_mm_s * exp(self.manner.pace_spread * self.normal());
        if let Some(tilt_mm) = self.manner.tilt_mm {
            let height_mm = HEIGHT_MM + tilt_mm * self.normal();
            let ground = ground(self.texture, height_mm);
            if let Some(motion) = &mut self.motion {
                motion.flow().over(ground);
            }
        }
        self.intend(force_n, 0.0);
        self.run_until(touch, 5.0, |event| *event == Event::Still);
        let reaction_s = self.random.random_range(REACTION_S.0..REACTION_S.1);
        self.run_until(touch, reaction_s, |_| false);
        self.intend(force_n, pace_mm_s);
        let over = |event: &Event| matches!(event, Event::Slid(_) | Event::Again(_));
        let measured = self.run_until(touch, SLIDE_S, over);
        self.intend(force_n, 0.0);
        self.run_until(touch, 0.1, |_| false);
        self.intend(0.0, 0.0);
        let pause_s = self.random.random_range(0.3..0.5);
        self.run_until(touch, pause_s, |_| false);
        match measured? {
            Event::Slid(observation) => Some(Ok(observation)),
            Event::Again(why) => Some(Err(why)),
            _ => None,
        }
    }
}

/// So many good slides of a texture by one person, and the number of other ones.
pub fn slides(
    setup: Setup,
    manner: Manner,
    wanted: u32,
) -> Result<(Vec<Observation>, u32), NoGoodSlide> {
    let plan = Plan::new();
    let mut touch = Touch::new(&plan);
    let mut person = Person::new(setup, manner);
    touch.calibrate(person.reader.model().calibration.force_mn_per_count);
    person.run_until(&mut touch, 0.5, |event| *event == Event::Zeroed);
    let (mut good, mut bad, mut row) = (Vec::new(), 0, 0);
    let mut last;
    while (good.len() as u32) < wanted {
        match person.slide(&mut touch) {
            Some(Ok(observation)) => {
                good.push(observation);
                row = 0;
                continue;
            }
            Some(Err(why)) => last = Some(why),
            None => last = None,
        }
        bad += 1;
        row += 1;
        if row == ATTEMPTS {
            return Err(NoGoodSlide {
                texture: setup.texture,
                why: last,
            });
        }
    }
    Ok((good, bad))
}

/// Learns a handheld's table from a simulated hand: `collection.trials` slides of every texture. Returns also the
/// numbers of textures without enough good slides; they are not in the table.
pub fn learn(
    collection: &Collection,
    done: impl Fn() + Sync,
) -> Result<(Vec<u8>, Vec<u8>), TableError> {
    let measured: Vec<_> = collection
        .textures
        .par_iter()
        .map(|&texture| {
            let setup = collection.setup(texture, 0);
            let made = slides(setup, Manner::default(), collection.trials);
            done();
            made
        })
        .collect();
    let (mut names, mut known, mut left_out) = (Vec::new(), Vec::new(), Vec::new());
    for ((name, &texture), measured) in collection
        .names()
        .into_iter()
        .zip(&collection.textures)
        .zip(measured)
    {
        match measured {
            Ok((good, _)) => {
                names.push(name);
                known.push(vec![good]);
            }
            Err(_) => left_out.push(texture),
        }
    }
    let expected = Expected {
        drift: Some(Drift::BY_HAND),
        ..Expected::default()
    };
    let features = Some(FEATURES);
    let table = learn_for(
        &expected,
        Method::Fused,
        features,
        &names,
        &[MOVEMENT],
        &known,
    )?;
    let table = name_finger(&table, FingerCode::of(collection.finger), 0, "")?;
    Ok((table, left_out))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::collection::texture_number;

    fn world(among: u8) -> Collection {
        Collection::new(1, Collection::spread(60, among), 5)
    }

    /// A hand that holds its pace, and the probe at the height that its sensor of motion is for.
    const LEVEL: Manner = Manner {
        tremor: 0.005,
        wander: 0.04,
        uneven: 0.0,
        force_spread: 0.1,
        pace_spread: 0.0,
        tilt_mm: Some(0.0),
    };

    #[test]
    fn what_is_too_smooth_to_be_felt_is_noticed_where_it_is_seen() {
        let tile = texture_number("smooth tile").unwrap();
        let felt = slides(world(1).setup(tile, 0), Manner::default(), 3);
        assert!(
            matches!(felt, Err(NoGoodSlide { why: None, .. })),
            "{felt:?}"
        );
        let (good, bad) = slides(world(1).setup(tile, 0), LEVEL, 3).unwrap();
        assert_eq!((good.len(), bad), (3, 0));
    }

    #[test]
    fn twenty_hands_are_measured_as_they_mean_to_slide_and_none_on_glass() {
        let glass = texture_number("frosted glass").unwrap();
        let burlap = texture_number("burlap").unwrap();
        (1..=20).into_par_iter().for_each(|seed| {
            let world = Collection::new(seed, vec![burlap, glass], 1);
            let pace = |texture| {
                let (good, _) = slides(world.setup(texture, seed), LEVEL, 1).unwrap();
                good.first().unwrap().pace
            };
            // 3 %: the part before full speed, frames, counts
            let measured = pace(burlap).unwrap();
            assert!(measured.abs() < 31, "{seed}: {measured}");
            assert_eq!(pace(glass), None, "{seed}");
        });
    }

    /// The hand of the scenario `uneven`.
    #[test]
    fn a_slide_that_nearly_stops_is_too_uneven() {
        let burlap = texture_number("burlap").unwrap();
        let plan = Plan::new();
        for trial in 100..108 {
            let mut touch = Touch::new(&plan);
            let mut person = Person::new(world(1).setup(burlap, trial), Manner::default());
            person.intend(0.5, 0.0);
            let still = person.run_until(&mut touch, 5.0, |event| *event == Event::Still);
            assert!(still.is_some(), "{trial}");
            person.run_until(&mut touch, 0.3, |_| false);
            person.intend(0.5, 70.0);
            person.run_until(&mut touch, 0.6, |_| false);
            person.intend(0.5, 8.0);
            let over = person.run_until(&mut touch, 2.0, |_| true);
            assert_eq!(over, Some(Event::Again(Again::TooUneven)), "{trial}");
        }
    }
}
