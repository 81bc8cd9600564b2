//! Learn a table of two textures from a few trials, and identify one of them from new slides.
//!
//! `cargo run -p tactus-core --example learn_and_identify`

use tactus_core::explorer::{Config, Explorer};
use tactus_core::features::{Movement, Observation, Properties, PropertySet};
use tactus_core::table::{Experience, encode};

/// Traction in N, roughness in ln counts^2 and fineness in ln Hz of some slides at one movement.
const DENIM: [[f32; 3]; 3] = [[0.45, 6.7, 5.6], [0.43, 6.8, 5.5], [0.46, 6.6, 5.6]];
const BURLAP: [[f32; 3]; 3] = [[0.50, 7.7, 5.0], [0.48, 7.5, 5.1], [0.53, 7.8, 4.9]];

pub(crate) fn main() {
    // what the trials of each texture say
    let learned = [DENIM, BURLAP].map(|trials| {
        let mut experience = Experience::default();
        for trial in trials {
            let trial = Properties::new(trial.map(Some));
            experience
                .learn(PropertySet::ALL, &trial)
                .expect("in range");
        }
        [experience]
    });
    let textures = ["denim", "burlap"]
        .iter()
        .zip(&learned)
        .map(|(name, known)| (*name, &known[..]));

    // the table: the same bytes in a file, in the firmware and in the probe's flash
    let mut bytes = [0; 512];
    let movements = [Movement::FOR_TRACTION];
    let table = encode(&mut bytes, PropertySet::ALL, &movements, textures).expect("it fits");
    println!("the table takes {} bytes", table.as_bytes().len());

    // an exploration: slides are compared until one texture is 99 % sure
    let mut explorer =
        Explorer::<'_, 2>::new(table, PropertySet::ALL, Config::default()).expect("it can begin");
    let unknown = [[0.49, 7.6, 5.2], [0.51, 7.7, 5.0]];
    for slide in unknown {
        let outcomes = explorer.expected_outcomes();
        let action = explorer.choose(&outcomes, 0);
        let slide = Observation {
            properties: Properties::new(slide.map(Some)),
            ..Observation::default()
        };
        explorer
            .observe(action, &slide)
            .expect("it has the property");
        println!("looked at {}: {:.3?}", action.what(), explorer.posterior());
        if let Some(verdict) = explorer.verdict() {
            println!("it is {}", table.name(verdict.texture).unwrap_or("?"));
            break;
        }
    }
}
