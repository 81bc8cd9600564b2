//! The readers against the real recordings of `data/biotac`.
use std::fmt::Write as _;
use std::path::Path;

use tactus_lab::data::import::import;
use tactus_lab::data::properties::PropertyTable;
use tactus_lab::data::recording::Recording;
use tactus_lab::data::recordings::RecordingSet;
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
            assert_eq!((slide.pac().len(), slide.pdc.len()), (12_980, 590));
            assert_eq!(slide.shear_mn().map(|s| s.len()), Some(590));
            assert_eq!((slide.pdc_rate_hz, slide.shear_rate_hz), (100.0, 100.0));
            assert_eq!(slide.steady(2200), 1100..12_100);
            assert_eq!(slide.steady(100), 50..550);
            assert_eq!(slide.background, Some(2.2));
            assert_eq!(slide.movement.speed_um_s(), 25_000);
            assert_eq!(slide.movement.force_mn(), 800);
        }
        count += slides.len();
    }
    assert_eq!(count, 20 * manifest["slides"].as_array().unwrap().len());
}

#[test]
fn import_of_the_real_recordings_keeps_every_sample() {
    let Some(folder) = data("biotac") else { return };
    let to = tempfile::tempdir().unwrap();
    let done = import(&folder, to.path(), &mut |_, _| ()).unwrap();
    let [from, to] = [&folder, to.path()].map(|folder| RecordingSet::open(folder).unwrap());
    assert_eq!((done.textures, done.left_out.len()), (20, 0));
    assert_eq!(from.textures(), to.textures());
    for texture in 0..20 {
        let [from, to] = [&from, &to].map(|set| set.load_texture(texture).unwrap());
        assert!(from == to, "{texture}");
    }
}

/// The publisher's files, made again from `data/biotac`: the import must give back all magnitudes and forces, and signs
/// that agree with those of the data.
#[test]
fn import_of_rectified_recordings_rebuilds_their_signs() {
    let Some(folder) = data("biotac") else { return };
    let set = RecordingSet::open(&folder).unwrap();
    let (from, to) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let textures = [0, 6, 19];
    let mut slides = Vec::new();
    for texture in textures {
        let slide = set.load_texture(texture).unwrap().swap_remove(7);
        publish(from.path(), set.textures()[texture].id, &slide);
        slides.push(slide);
    }
    import(from.path(), to.path(), &mut |_, _| ()).unwrap();
    let imported = RecordingSet::open(to.path()).unwrap();
    for (texture, slide) in slides.iter().enumerate() {
        let rebuilt = imported.load_texture(texture).unwrap().remove(0);
        assert_eq!(
            (rebuilt.number, rebuilt.movement, rebuilt.window),
            (slide.number, slide.movement, slide.window)
        );
        assert_eq!(
            (&rebuilt.pdc, rebuilt.shear_mn()),
            (&slide.pdc, slide.shear_mn())
        );
        assert_eq!(rebuilt.background, slide.background);
        let magnitudes = |pac: &[i16]| pac.iter().map(|x| x.unsigned_abs()).collect::<Vec<_>>();
        assert_eq!(magnitudes(&rebuilt.pac()), magnitudes(&slide.pac()));
        let agreement = agreement(&rebuilt.pac(), &slide.pac());
        // one sign for all would give about 0.98
        assert!(agreement > 0.987, "slide over {texture}: {agreement}");
    }
}

/// Of the neighbouring samples that are not 0, how many change their sign in both or in neither.
fn agreement(a: &[i16], b: &[i16]) -> f64 {
    let signs: Vec<bool> = a
        .iter()
        .zip(b)
        .filter(|(x, _)| **x != 0)
        .map(|(x, y)| (*x < 0) == (*y < 0))
        .collect();
    let same = signs.windows(2).filter(|w| w[0] == w[1]).count();
    same as f64 / (signs.len() - 1) as f64
}

/// Writes a slide as the publisher of the BioTac recordings did.
fn publish(folder: &Path, material: u32, slide: &Recording) {
    let folder = folder.join(format!("raw_data/mat{material}"));
    std::fs::create_dir_all(&folder).unwrap();
    let pac: String = (1..=22).map(|n| format!(",pac{n}")).collect();
    let mut bio = format!("timestamp,pdc{pac}\n");
    let mut cw = String::from("timestamp,fx,fy,fz\n");
    let shear = slide.shear_mn().unwrap();
    for (row, samples) in slide.pac().chunks(22).enumerate() {
        let time = 1_581_073_084.0 + row as f64 / 100.0;
        let samples: String = samples.iter().map(|x| format!(",{}", x.abs())).collect();
        writeln!(bio, "{time:.9},{}{samples},", slide.pdc[row]).unwrap();
        writeln!(cw, "{time:.9},0,0,{}", f64::from(shear[row]) / 1000.0).unwrap();
    }
    let name = |kind| folder.join(format!("mat{material}_{}_{kind}.csv", slide.number));
    std::fs::write(name("bio"), bio).unwrap();
    std::fs::write(name("cw"), cw).unwrap();
}

#[test]
fn the_property_worlds_are_read() {
    let Some(folder) = data("worlds") else { return };
    for world in 1..=3 {
        let set = PropertyTable::read(&folder.join(format!("world_{world}.csv"))).unwrap();
        assert_eq!((set.textures.len(), set.movements.len()), (117, 3));
        assert!(set.train.iter().flatten().all(|trials| trials.len() == 5));
        let tested = set
            .validate
            .iter()
            .filter(|t| t.iter().all(|trials| trials.len() == 5));
        assert_eq!(tested.count(), 16);
        assert_eq!(set.validate.iter().flatten().flatten().count(), 16 * 3 * 5);
    }
}
