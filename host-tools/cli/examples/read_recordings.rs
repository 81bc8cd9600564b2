//! Read a folder of recordings: textures, movements, samples, and the features of each slide.
//!
//! `cargo run --release -p tactus-probe --example read_recordings`

use std::path::Path;

use tactus_core::dsp::Plan;
use tactus_core::features::Property;
use tactus_lab::data::recording::PAC_RATE_HZ;
use tactus_lab::data::recordings::RecordingSet;
use tactus_lab::data::replay::measure;

pub(crate) fn main() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../recordings/simulated");
    let folder = folder.canonicalize().expect("the repository's recordings");
    // the manifest only; samples are read texture by texture
    let set = RecordingSet::open(&folder).expect("a folder of recordings");
    println!(
        "{} textures at {} movements",
        set.textures().len(),
        set.movements().len()
    );

    let plan = Plan::new();
    for (index, texture) in set.textures().iter().enumerate() {
        let slides = set.load_texture(index).expect("whole files");
        let first = slides.first().expect("each texture has slides");
        let steady = first.steady(PAC_RATE_HZ);
        let features = measure(&plan, first).expect("a steady part");
        let [traction, roughness, fineness] =
            Property::ALL.map(|p| features.properties.get(p).unwrap_or(f32::NAN));
        println!(
            "{:<16} {} slides; the first: {:.2} N, {:.1} mm/s, {} samples of P_AC at constant speed; \
             traction {traction:.3} N, roughness {roughness:.2}, fineness {fineness:.2}",
            texture.name,
            slides.len(),
            first.movement.force_n(),
            first.movement.speed_mm_s(),
            steady.len()
        );
    }
}
