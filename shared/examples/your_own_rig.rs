//! A rig of your own: implement `Rig`, and the explorer drives it.
//!
//! `cargo run -p tactus-core --example your_own_rig`

use std::f32::consts::TAU;

use embassy_futures::block_on;
use tactus_core::dsp::Plan;
use tactus_core::explorer::{Config, Explorer};
use tactus_core::features::{Block, Movement, Properties, Property, PropertySet, Slide};
use tactus_core::probe::explore::{ExplorationStep, explore};
use tactus_core::rig::Rig;
use tactus_core::table::{Experience, encode};

const MOVEMENT: Movement = Movement::FOR_FINENESS;

/// A rig that only exists here: a texture is a vibration of this frequency.
struct Hum(f32);

impl Rig for Hum {
    type Error = core::convert::Infallible;
    fn measures(&self) -> PropertySet {
        PropertySet::ALL
    }

    async fn perform(&mut self, slide: &mut Slide<'_>) -> Result<(), Self::Error> {
        // a real rig presses here, and measures the still finger
        slide.set_background(2.0);
        let hz = self.0 * slide.movement().speed_mm_s() / 25.0;
        let sample = |n: u16| 40.0 * (f32::from(n) / 2200.0 * hz * TAU).sin();
        let samples: Vec<i16> = (0..3300).map(|n| sample(n) as i16).collect();
        // and those from 200 on are at constant speed
        for block in Block::cut(&[], 200..3300, &samples, &[400; 100]) {
            slide.take(&block);
        }
        Ok(())
    }
}

/// A texture's slides, with some scatter that a real rig brings along.
fn learn(mut rig: Hum, plan: &Plan) -> [Experience; 1] {
    let mut slide = Slide::new(plan, MOVEMENT);
    let Ok(()) = block_on(rig.perform(&mut slide));
    let features = slide.finish().expect("a steady part");
    let mut experience = Experience::default();
    for scatter in [-0.02, 0.0, 0.02] {
        let values = Property::ALL.map(|p| features.properties.get(p).map(|x| x + scatter));
        let trial = Properties::new(values);
        experience.learn(trial.measured(), &trial).expect("finite");
    }
    [experience]
}

pub(crate) fn main() {
    let plan = Plan::new();
    let fine = learn(Hum(400.0), &plan);
    let coarse = learn(Hum(80.0), &plan);
    let textures = [("fine", &fine[..]), ("coarse", &coarse[..])];
    let (mut bytes, measured) = ([0; 512], PropertySet::ALL);
    let table = encode(&mut bytes, measured, &[MOVEMENT], textures.into_iter());
    let table = table.expect("it fits");

    let mut rig = Hum(80.0);
    let explorer = Explorer::<'_, 2>::new(table, rig.measures(), Config::default());
    let mut explorer = explorer.expect("it can begin");
    let tell = |event: ExplorationStep<'_, _>| {
        if let ExplorationStep::Measured(action, _, posterior) = event {
            println!("looked at {}: {posterior:.3?}", action.what());
        }
    };
    let verdict = block_on(explore(&mut rig, &mut explorer, &plan, || 0, tell));
    let texture = verdict.expect("no slide fails").texture;
    println!("it is {}", table.name(texture).unwrap_or("?"));
}
