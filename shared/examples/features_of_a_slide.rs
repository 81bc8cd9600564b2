//! From the samples of one slide to its features: traction, roughness, fineness and band powers.
//!
//! `cargo run -p tactus-core --example features_of_a_slide`

use tactus_core::dsp::Plan;
use tactus_core::features::{Block, Movement, Property, Slide};

/// P_AC samples a second.
const RATE_HZ: f32 = 2200.0;

pub(crate) fn main() {
    // coefficients and angles, made once for all slides
    let plan = Plan::new();

    // 1. the finger presses and stands still: this power is subtracted later
    let noise = |n: u32| (n.wrapping_mul(2_654_435_761) >> 29) as i16 - 4;
    let still: Vec<i16> = (0..2200).map(noise).collect();

    // 2. the slide
    let texture = |n: u32| {
        let turns = n as f32 / RATE_HZ;
        (60.0 * (turns * 150.0 * std::f32::consts::TAU).sin()) as i16 + noise(n)
    };
    let samples: Vec<i16> = (0..4400).map(texture).collect();

    // 3. samples travel in blocks; those of the slide from 440 on are at constant speed
    let mut slide = Slide::new(&plan, Movement::FOR_TRACTION);
    for block in Block::cut(&still, 440..4400, &samples, &[412; 100]) {
        slide.take(&block);
    }

    // 4. the features
    let features = slide.finish().expect("the slide has a steady part");
    for property in Property::ALL {
        let value = features.properties.get(property);
        println!("{:<10} {:.3}", property.name(), value.unwrap());
    }
    let bands = features.spectrum.fused_bands();
    println!("mean ln of 26 band powers {bands:.1?}");
}
