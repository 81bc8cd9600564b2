//! The readers against the real recordings of `data/biotac`.
use tactus::recordings::{Background, RecordingSet};
use tactus_tests::data;

#[test]
fn all_slides_of_the_real_recordings_are_read() {
    let Some(folder) = data("biotac") else { return };
    let set = RecordingSet::open(&folder).unwrap();
    let manifest = std::fs::read(folder.join("manifest.json")).unwrap();
    let manifest: serde_json::Value = serde_json::from_slice(&manifest).unwrap();
    assert_eq!(set.textures().len(), 20);
    assert_eq!(set.textures()[19].id, 20);
    assert_eq!(set.textures()[19].name, "metal (steel)");
    let mut count = 0;
    for index in 0..set.textures().len() {
        let slides = set.load_texture(index).unwrap();
        let numbers: Vec<u32> = slides.iter().map(|s| s.number).collect();
        assert_eq!(serde_json::json!(numbers), manifest["slides"]);
        for slide in &slides {
            assert_eq!(slide.texture, index);
            assert_eq!((slide.pac.len(), slide.pdc.len()), (12_980, 590));
            assert_eq!(slide.shear_mn.as_ref().map(Vec::len), Some(590));
            assert_eq!((slide.pdc_rate_hz, slide.shear_rate_hz), (100, 100));
            assert_eq!(slide.steady(2200), 1100..12_100);
            assert_eq!(slide.steady(100), 50..550);
            assert_eq!(slide.background, Background::Power(2.2));
            assert_eq!(slide.movement.speed_um_s(), 25_000);
            assert_eq!(slide.movement.force_mn(), 800);
        }
        count += slides.len();
    }
    assert_eq!(count, 680);
}

/// features.csv was made by another program (numpy) from the same files: its traction is the mean of the shear force.
#[test]
fn shear_force_gives_the_golden_traction() {
    let Some(folder) = data("biotac") else { return };
    let set = RecordingSet::open(&folder).unwrap();
    let mut golden = csv::Reader::from_path(folder.join("features.csv")).unwrap();
    let golden: Vec<Vec<f64>> = golden.deserialize().map(Result::unwrap).collect();
    let mut rows = golden.iter();
    for index in 0..set.textures().len() {
        for slide in set.load_texture(index).unwrap() {
            let row = rows.next().unwrap();
            assert_eq!(row[0], f64::from(set.textures()[index].id));
            assert_eq!(row[1], f64::from(slide.number));
            let shear = slide.shear_mn.as_ref().unwrap();
            let window = &shear[slide.steady(slide.shear_rate_hz)];
            let sum: f64 = window.iter().map(|mn| f64::from(*mn)).sum();
            assert!((sum / window.len() as f64 / 1000.0 - row[2]).abs() < 1e-6);
        }
    }
}
