//! Simulate a texture: the simulated rig homes, calibrates its motor current, and slides over burlap.
//!
//! `cargo run --release -p tactus-probe --example simulate_texture`

use tactus_core::dsp::Plan;
use tactus_core::features::{Movement, Property};
use tactus_lab::data::replay::measure;
use tactus_lab::sim::collection::{calibrated, texture_number};
use tactus_lab::sim::rig::SimRig;
use tactus_world::world::Setup;

pub(crate) fn main() {
    let setup = Setup {
        texture: texture_number("Burlap").expect("a texture of Table 1"),
        ..Setup::default()
    };
    let mut rig = SimRig::new(setup);
    rig.home().expect("the rig finds its limit switches");
    let calibration = calibrated(setup).expect("the stage moves without load");
    rig.control()
        .calibrate(calibration)
        .expect("plausible constants");

    let plan = Plan::new();
    for movement in [
        Movement::FOR_TRACTION,
        Movement::FOR_FINENESS,
        Movement::FOR_ROUGHNESS,
    ] {
        let slide = rig.record(movement).expect("no fault");
        let features = measure(&plan, &slide).expect("a steady part");
        print!(
            "{:.2} N, {:.1} mm/s:",
            movement.force_n(),
            movement.speed_mm_s()
        );
        for property in Property::ALL {
            let value = features.properties.get(property).unwrap_or(f32::NAN);
            print!("  {} {value:.3}", property.name());
        }
        println!();
    }
    println!("{:.0} s of the rig's time", rig.now().as_secs_f32());
}
