//! Random samples, and random damage.
use proptest::prelude::*;

use super::*;

proptest! {
    #[test]
    fn npy_round_trip_is_identity(samples in proptest::collection::vec(any::<i16>(), 0..2000)) {
        prop_assert_eq!(npy::read(&npy::write(&samples)), Ok(samples));
    }

    #[test]
    fn slides_round_trip_whatever_they_hold(
        name in "[a-zäöü麻 ,\"'=@#-]{0,20}",
        id: u32, number: u32,
        force_mn in 100_u16..=2000, speed_um_s in 5_000_u32..=150_000,
        pac in proptest::collection::vec(any::<i16>(), 220..300),
        pdc_rate_hz in 1.0_f64..100.0, start in 0.0_f32..0.05, length in 0.01_f32..0.05,
        power in proptest::option::of(0.0_f32..1e9),
        shear in proptest::option::of(proptest::collection::vec(any::<i16>(), 10..20)),
    ) {
        let folder = TempDir::new().unwrap();
        let still = if power.is_none() { &[5][..] } else { &[] };
        let slide = Recording {
            texture: 0,
            number,
            movement: Movement::new(force_mn, speed_um_s).unwrap(),
            window: (start, start + length),
            blocks: Vec::new(),
            background: power,
            pdc: vec![3; 10],
            pdc_rate_hz,
            outside_mn: None,
            pace: None,
            shear_rate_hz: 100.0,
            highest_hz: None,
        };
        let slide = slide.cut(still, &pac, shear.as_deref()).unwrap();
        prop_assert_eq!((slide.pac(), slide.shear_mn()), (pac, shear));
        let mut writer = RecordingWriter::begin(folder.path(), vec![texture(id, &name)], "test").unwrap();
        writer.write(&slide).unwrap();
        writer.finish().unwrap();
        let set = RecordingSet::open(folder.path()).unwrap();
        prop_assert_eq!(set.textures(), [texture(id, name.trim())]);
        prop_assert_eq!(set.load_texture(0).unwrap(), [slide]);
    }
}
