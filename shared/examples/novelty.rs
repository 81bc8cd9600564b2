//! Notice a texture that was never learned: a fused table, whose verdict may be "none of those I know".
//!
//! `cargo run -p tactus-core --example novelty`

use tactus_core::explorer::{Config, Explorer, Method};
use tactus_core::features::{FeatureSet, Movement, Observation, PropertySet, Vector};
use tactus_core::table::{Drift, Scatter, Whitened, encode_fused, whiten_drifting};

/// Twelve band powers.
const FEATURES: usize = 12;
const NAMES: [&str; 8] = ["a", "b", "c", "d", "e", "f", "g", "h"];
const TRIALS: usize = 5;

/// A slide on a texture: the texture's own band powers, and what differs from slide to slide.
fn slide(texture: usize, random: &mut u32) -> Vector {
    let mut noise = || {
        *random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (*random >> 24) as i16 - 128
    };
    let band = |band: usize| (((texture + 1) * (3 * band + 7)) % 11 * 512) as i16;
    (0..FEATURES).map(|n| band(n) + noise()).collect()
}

pub(crate) fn main() {
    let mut random = 1;
    let mut learn = |texture| [(); TRIALS].map(|()| slide(texture, &mut random));
    let trials: Vec<[Vector; TRIALS]> = (0..NAMES.len()).map(&mut learn).collect();

    // how slides of one texture scatter gives the whitening; each texture is then a mean
    let mut scatter = Scatter::new(FEATURES);
    for slides in &trials {
        scatter.push(slides).expect("as many features");
    }
    let learned = whiten_drifting(&[scatter], FeatureSet::Bands, Drift::NONE);
    let (whitening, _) = learned.expect("enough trials").remove(0);
    let mut learned = [[Whitened::default()]; NAMES.len()];
    for ([mean], slides) in learned.iter_mut().zip(&trials) {
        for slide in slides {
            mean.teach(&whitening.apply(slide));
        }
    }
    let textures = NAMES.into_iter().zip(learned.iter().map(|mean| &mean[..]));
    let movements = [(Movement::FOR_FINENESS, whitening)];
    let mut bytes = [0; 4096];
    let table = encode_fused(&mut bytes, FeatureSet::Bands, &movements, textures).expect("it fits");

    // a texture of the table, and one that nobody has learned
    for (what, number) in [("texture d", 3), ("a new one", 42)] {
        let config = Config {
            method: Method::Fused,
            open: true,
            ..Config::default()
        };
        let mut explorer =
            Explorer::<'_, 8>::new(table, PropertySet::ALL, config).expect("it can begin");
        let verdict = loop {
            let action = explorer.choose(&explorer.expected_outcomes(), 0);
            let bands = slide(number, &mut random).into_iter().collect();
            let slide = Observation {
                bands,
                ..Observation::default()
            };
            explorer.observe(action, &slide).expect("all bands");
            if let Some(verdict) = explorer.verdict() {
                break verdict;
            }
        };
        let name = table.name(verdict.texture).unwrap_or("?");
        let odds = explorer.log_odds().unwrap_or(f32::NAN);
        let unknown = if verdict.unknown {
            "none of those in the table; most like"
        } else {
            "it is"
        };
        println!("{what}: {unknown} {name} (log-odds of none {odds:.1})");
    }
}
