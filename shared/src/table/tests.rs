//! The table against one written by hand, a checksum bit by bit and statistics in two passes.

mod damage;
mod fused;
mod hostile;
mod learned;
mod learning;
mod lengths;
mod open_set;
mod samples;
mod sections;
pub(crate) mod slopes;
pub(crate) mod whitening;

use super::format::*;
use super::*;
use crate::features::{FeatureSet, Movement, Properties, Property, PropertySet};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use std::string::{String, ToString};
use std::vec;
use std::vec::Vec;

/// The same cases in every run.
pub(crate) fn fixed(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        rng_seed: RngSeed::Fixed(20_120_618),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

/// Two trials of this mean and standard deviation in each property.
pub(crate) fn around(cell: [(f32, f32); 3]) -> Vec<[f32; 3]> {
    let apart =
        |sign: f32| cell.map(|(mean, sd)| mean + sign * sd * core::f32::consts::FRAC_1_SQRT_2);
    vec![apart(-1.0), apart(1.0)]
}

/// A table of these trials, texture by texture and movement by movement, on the study's grid of movements.
pub(crate) fn table_of(measured: PropertySet, trials: &[Vec<Vec<[f32; 3]>>]) -> Vec<u8> {
    let movements: Vec<Movement> = Movement::grid().take(trials[0].len()).collect();
    let experience: Vec<Vec<Experience>> = trials
        .iter()
        .map(|row| row.iter().map(|t| learned(t)).collect())
        .collect();
    let names: Vec<String> = (0..trials.len()).map(|n| std::format!("t{n}")).collect();
    let textures = names.iter().zip(&experience);
    let textures = textures.map(|(name, known)| (name.as_str(), &known[..]));
    let mut out = vec![0; 100_000];
    let table = encode(&mut out, measured, &movements, textures).unwrap();
    table.as_bytes().to_vec()
}

/// A whitening that changes nothing: 1 is 1 standard deviation.
pub(crate) fn straight(features: usize) -> Whitening {
    let mut bytes = vec![0; 2 * features];
    bytes.extend(vec![14; features]);
    for row in 0..features {
        for column in 0..features {
            let weight: i16 = if row == column { 1 << 14 } else { 0 };
            bytes.extend(weight.to_le_bytes());
        }
    }
    Whitening::read(&bytes, features).unwrap()
}

/// A fused table with this share of new textures that get a name, and its interval, as its own figure.
pub(crate) fn naming_new(plain: &[u8], [share, low, high]: [f32; 3]) -> Vec<u8> {
    let figures = OpenSet {
        new_named: Share { share, low, high },
        ..OpenSet::default()
    };
    let mut out = vec![0; plain.len() + OpenSet::LENGTH];
    let table = with_open_set(&mut out, &Table::read(plain).unwrap(), &figures);
    table.unwrap().as_bytes().to_vec()
}

/// A fused table of what is known of each texture, movement by movement, on the study's grid of movements.
pub(crate) fn fused_of(
    set: FeatureSet,
    whitenings: &[Whitening],
    known: &[Vec<Whitened>],
) -> Vec<u8> {
    let movements: Vec<(Movement, Whitening)> =
        Movement::grid().zip(whitenings.iter().cloned()).collect();
    let names: Vec<String> = (0..known.len()).map(|n| std::format!("t{n}")).collect();
    let textures = names.iter().zip(known);
    let textures = textures.map(|(name, known)| (name.as_str(), known.as_slice()));
    let mut out = vec![0; 100_000];
    let table = encode_fused(&mut out, set, &movements, textures).unwrap();
    table.as_bytes().to_vec()
}

/// So many slides of this whitened mean, in standard deviations.
pub(crate) fn known(slides: u8, mean: &[f64]) -> Whitened {
    let mut known = Whitened {
        slides,
        ..Whitened::default()
    };
    for (to, from) in known.mean.iter_mut().zip(mean) {
        *to = (from * 256.0).round() as i16;
    }
    known
}

/// Statistics of a texture at two movements of two features.
const NEW: [Whitened; 2] = {
    let mut mean = [0; crate::features::MAX_FEATURES];
    (mean[0], mean[1]) = (9 * 256, 9 * 256);
    [Whitened { slides: 3, mean }; 2]
};

/// Puts [`NEW`] in.
fn put(name: &str) -> Change<'_> {
    Change::Put {
        name,
        known: TextureStats::Fused(&NEW),
        tally: Tally::default(),
    }
}

/// A table after a change.
fn amended(table: &[u8], change: Change<'_>) -> Vec<u8> {
    let mut out = vec![0; 8000];
    let amended = amend(&mut out, &Table::read(table).unwrap(), change);
    amended.unwrap().as_bytes().to_vec()
}

/// CRC-32 of zip and Ethernet, bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0, |crc: u32, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| {
            (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg())
        })
    })
}

const GAUSSIAN: Contents = Contents::Gaussians(PropertySet::ALL);
const MOVEMENTS: [Movement; 2] = [Movement::FOR_TRACTION, Movement::FOR_ROUGHNESS];

/// Two textures and two movements, all properties, field by field as the module's page has it: movements begin at byte
/// 16, cells at 28, trials at 76, the lineage at 80, numbers and tallies at 84, names at 94.
fn small() -> Vec<u8> {
    let mut bytes = b"TACT\x01\0\0\x07\x6b\0\0\0\x02\0\x02\0".to_vec();
    bytes.extend(b"\xee\x04\x10\x27\0\0"); // 1262 mN, 10000 um/s
    bytes.extend(b"\xc8\0\x78\xf6\0\0"); // 200 mN, 63096 um/s
    bytes.extend(b"\0\x10\0\x20\0\xf0\0\x30\0\x20\0\x40"); // felt, 1: means 1, -2, 2; sd 1/2, 3/4, 1
    bytes.extend([0; 12]); // felt, 2: no trial
    bytes.extend(b"\0\x08\0\0\0\x08\0\0\0\x08\0\0"); // oak, 1: means 1/2, 1, 1/2 of one trial
    bytes.extend(b"\x01\0\x08\0\xff\xff\xff\xff\xff\x7f\x09\0"); // oak, 2: smallest and largest
    bytes.extend(b"\x03\0\x01\xff");
    bytes.extend([0; 4]); // made from no other
    bytes.extend(b"\0\0\x03\0\0"); // felt: number 0, 3 slides from the factory
    bytes.extend(b"\x01\0\xff\0\0"); // oak: number 1, 255 and more
    bytes.extend(b"\x04felt\x03oak");
    seal(bytes)
}

/// Appends the checksum.
fn seal(mut bytes: Vec<u8>) -> Vec<u8> {
    let crc = crc32(&bytes);
    bytes.extend(crc.to_le_bytes());
    bytes
}

/// The small table with one thing wrong and the right checksum.
fn wrong(change: impl FnOnce(&mut Vec<u8>)) -> Vec<u8> {
    let mut bytes = small();
    bytes.truncate(bytes.len() - CRC_BYTES);
    change(&mut bytes);
    seal(bytes)
}

fn error(bytes: &[u8]) -> TableError {
    Table::read(bytes).map(|_| ()).unwrap_err()
}

fn act(movement: u8, property: Property) -> Action {
    let property = Some(property);
    Action { movement, property }
}

fn learned(trials: &[[f32; 3]]) -> Experience {
    let mut experience = Experience::default();
    for trial in trials {
        let trial = Properties::new(trial.map(Some));
        experience.learn(PropertySet::ALL, &trial).unwrap();
    }
    experience
}

fn encoded(textures: &[(&str, Vec<Experience>)]) -> Result<Vec<u8>, EncodeError> {
    let mut out = vec![0; 200_000];
    let textures = textures.iter().map(|(name, known)| (*name, &known[..]));
    let table = encode(&mut out, PropertySet::ALL, &MOVEMENTS, textures)?;
    Ok(table.as_bytes().to_vec())
}

#[test]
fn the_binary_form_is_the_documented_one() {
    let squares = |sd: [f32; 3], n: f32| sd.map(|sd| sd * sd * (n - 1.0));
    let felt = Experience {
        trials: 3,
        mean: [1.0, -2.0, 2.0],
        squares: squares([0.5, 0.75, 1.0], 3.0),
    };
    let oak = Experience {
        trials: 255,
        mean: [1.0 / 4096.0, -1.0 / 2048.0, 32767.0 / 4096.0],
        squares: squares([1e-9, 5.0, 9.0 / 16384.0], 255.0),
    };
    let textures = [
        ("felt", vec![felt, Experience::default()]),
        ("oak", vec![learned(&[[0.5, 1.0, 0.5]]), oak]),
    ];
    assert_eq!(encoded(&textures).unwrap(), small());
}

#[test]
fn a_table_reads_as_the_documented_form() {
    let bytes = small();
    let table = Table::read(&bytes).unwrap();
    assert_eq!((table.textures(), table.measured()), (2, PropertySet::ALL));
    assert_eq!(table.movements().collect::<Vec<_>>(), MOVEMENTS);
    assert_eq!(table.movement(1), Some(Movement::FOR_ROUGHNESS));
    assert_eq!(table.names().collect::<Vec<_>>(), ["felt", "oak"]);
    assert_eq!((table.name(1), table.find("oak")), (Some("oak"), Some(1)));
    assert_eq!((table.find("felt"), table.find("elm")), (Some(0), None));
    assert_eq!(
        [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(t, m)| table.trials(t, m)),
        [3, 0, 1, 255]
    );
    let gaussian = |mean, sd| Some(Gaussian { mean, sd });
    let [traction, roughness, fineness] = Property::ALL;
    assert_eq!(table.gaussian(0, act(0, traction)), gaussian(1.0, 0.5));
    assert_eq!(table.gaussian(0, act(0, roughness)), gaussian(-2.0, 0.75));
    assert_eq!(table.gaussian(0, act(0, fineness)), gaussian(2.0, 1.0));
    assert_eq!(
        table.gaussian(1, act(1, traction)),
        gaussian(1.0 / 4096.0, SD_LEAST)
    );
    assert_eq!(
        table.gaussian(1, act(1, roughness)),
        gaussian(-1.0 / 2048.0, 4.0 - SD_STEP)
    );
    assert_eq!(
        table.gaussian(1, act(1, fineness)),
        gaussian(8.0 - 1.0 / 4096.0, 9.0 * SD_STEP)
    );
    assert_eq!(table.gaussian(0, act(1, traction)), None, "no trial");
    assert_eq!(
        table.gaussian(1, act(0, traction)),
        None,
        "one trial has no deviation"
    );
    assert_eq!(table.crc(), crc32(&bytes[..103]));
    let expected = [0, 1].map(|m| Property::ALL.map(|p| act(m, p)));
    assert!(
        table.actions().eq(expected.into_iter().flatten()),
        "movement by movement, property by property"
    );
}

#[test]
fn outside_the_table_there_is_nothing() {
    // the first cell reads as 1000 mN and 10000 um/s
    let bytes = wrong(|bytes| bytes[28..34].copy_from_slice(b"\xe8\x03\x10\x27\0\0"));
    let table = Table::read(&bytes).unwrap();
    assert_eq!((table.movement(2), table.name(2)), (None, None));
    assert_eq!((table.trials(2, 0), table.trials(0, 2)), (0, 0));
    for (texture, movement) in [(2, 0), (2, 1), (0, 2), (1, 2), (u16::MAX, u8::MAX)] {
        assert_eq!(
            table.gaussian(texture, act(movement, Property::Roughness)),
            None
        );
        assert_eq!(table.cell(texture, movement, Property::Roughness), None);
        assert_eq!(table.experience(texture, movement), Experience::default());
        let all = table.gaussians(act(movement, Property::Roughness));
        assert_eq!(all.get(texture.into()), None);
    }
    assert!(table.trials_at(2).0.is_empty());
}

#[test]
fn bytes_behind_the_table_are_refused_or_left_alone() {
    let mut bytes = small();
    bytes.extend([0x5a; 40]);
    assert_eq!(error(&bytes), TableError::Behind(40));
    let table = Table::read_first(&bytes).unwrap();
    assert_eq!(table.as_bytes(), small());
    assert_eq!(table.names().count(), 2);

    let mut out = [0xa5; 100];
    let experience = [learned(&[[1.0; 3], [2.0; 3]]); 2];
    let felt = ("felt", &experience[..]);
    let length = encode(&mut out, PropertySet::ALL, &MOVEMENTS, [felt].into_iter())
        .unwrap()
        .as_bytes()
        .len();
    assert_eq!(length, encoded_len(GAUSSIAN, 1, 2, 5));
    assert!(out[length..].iter().all(|&byte| byte == 0xa5));
}

#[test]
fn what_was_not_measured_is_not_in_the_table() {
    let measured: PropertySet = [Property::Roughness].into_iter().collect();
    // a traction that no table can hold
    let experience = [learned(&[[9.0, 1.0, 2.0], [9.5, 2.0, 4.0]]); 2];
    let felt = ("felt", &experience[..]);
    let mut out = [1; 200];
    let table = encode(&mut out, measured, &MOVEMENTS, [felt].into_iter()).unwrap();
    assert_eq!(
        table.as_bytes()[28..40],
        *b"\0\0\0\0\0\x0c\x41\x2d\0\0\0\0",
        "1.5, sd 0.70711"
    );
    assert_eq!(table.measured(), measured);
    assert_eq!(
        table.actions().collect::<Vec<_>>(),
        [act(0, Property::Roughness), act(1, Property::Roughness)]
    );
    assert!(table.gaussian(0, act(1, Property::Roughness)).is_some());
    assert_eq!(table.gaussian(0, act(1, Property::Traction)), None);
    assert_eq!(table.gaussian(0, act(1, Property::Fineness)), None);
    assert_eq!(table.experience(0, 1).mean, [0.0, 1.5, 0.0]);
}

#[test]
fn the_study_fits_in_5_2_kb_and_11_kb_fused() {
    assert_eq!(encoded_len(GAUSSIAN, 117, 3, 0), 5190);
    let fused = Contents::Fused(FeatureSet::Force, 13);
    assert!(encoded_len(fused, 117, 3, 0) <= 11 << 10);
}

/// A table of any shape: names, movements, and the trials of each texture at each movement.
type Learned = (Vec<String>, Vec<Movement>, Vec<Vec<Vec<[f32; 3]>>>);

fn any_table() -> impl Strategy<Value = Learned> {
    let movements = proptest::sample::subsequence(Movement::grid().collect::<Vec<_>>(), 1..=36);
    (
        movements,
        proptest::collection::btree_set("[a-zäß語][a-zäß語 ]{0,12}", 1..6),
    )
        .prop_flat_map(|(movements, names)| {
            let scale = proptest::sample::select(vec![1e-6f32, 0.01, 0.3, 6.0]);
            let cell = ([-7.9f32..7.9, -15.9f32..15.9, -7.9f32..7.9], scale);
            let trials = cell.prop_flat_map(|(at, scale)| {
                proptest::collection::vec([-1f32..1.0, -1f32..1.0, -1f32..1.0], 0..6).prop_map(
                    move |trials| {
                        let reach = reach();
                        let near = |t: [f32; 3]| {
                            core::array::from_fn(|p| {
                                (at[p] + scale * t[p]).clamp(-reach[p], reach[p])
                            })
                        };
                        trials.into_iter().map(near).collect::<Vec<_>>()
                    },
                )
            });
            let rows = proptest::collection::vec(
                proptest::collection::vec(trials, movements.len()),
                names.len(),
            );
            (Just(names.into_iter().collect()), Just(movements), rows)
        })
}

/// Largest mean of each property, in its unit.
fn reach() -> [f32; 3] {
    Property::ALL.map(|p| mean_step(p) * 32767.0)
}

/// Mean and standard deviation in two passes.
fn two_passes(x: &[f64]) -> (f64, f64) {
    let n = x.len() as f64;
    let mean = x.iter().sum::<f64>() / n;
    (
        mean,
        (x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt(),
    )
}

/// The values of one property.
fn column(trials: &[[f32; 3]], property: Property) -> Vec<f64> {
    trials
        .iter()
        .map(|t| f64::from(t[property.index()]))
        .collect()
}

proptest! {
    #![proptest_config(fixed(64))]

    #[test]
    fn what_is_written_reads_back((names, movements, trials) in any_table()) {
        let experience: Vec<Vec<Experience>> = trials.iter()
            .map(|row| row.iter().map(|t| learned(t)).collect()).collect();
        let textures = names.iter().zip(&experience).map(|(name, known)| (name.as_str(), &known[..]));
        let mut out = vec![0xff; 40_000];
        let table = encode(&mut out, PropertySet::ALL, &movements, textures).unwrap();
        prop_assert_eq!(usize::from(table.textures()), names.len());
        prop_assert!(table.names().eq(names.iter().map(String::as_str)));
        prop_assert!(table.movements().eq(movements.iter().copied()));
        for (texture, row) in (0..).zip(&trials) {
            for (movement, trials) in (0..).zip(row) {
                prop_assert_eq!(usize::from(table.trials(texture, movement)), trials.len());
                let (all, stride) = table.trials_at(movement);
                prop_assert_eq!(usize::from(all[usize::from(texture) * stride]), trials.len());
                let again = table.experience(texture, movement);
                prop_assert_eq!(usize::from(again.trials()), trials.len());
                for property in Property::ALL {
                    let gaussian = table.gaussian(texture, act(movement, property));
                    let all = table.gaussians(act(movement, property));
                    prop_assert_eq!(all.get(texture.into()), gaussian);
                    prop_assert_eq!(gaussian.is_some(), trials.len() >= 2);
                    let Some(gaussian) = gaussian else { continue };
                    let (mean, sd) = two_passes(&column(trials, property));
                    let sd = sd.clamp(SD_LEAST.into(), 4.0 - f64::from(SD_STEP));
                    let half = f64::from(mean_step(property)) / 2.0 + 1e-5;
                    prop_assert!((f64::from(gaussian.mean) - mean).abs() <= half, "{} {mean}", gaussian.mean);
                    let half = f64::from(SD_STEP) / 2.0 + 1e-5;
                    prop_assert!((f64::from(gaussian.sd) - sd).abs() <= half, "{} {sd}", gaussian.sd);
                    // what goes on from the table agrees with it
                    let from = again.gaussian(property).unwrap();
                    prop_assert_eq!(from.mean, gaussian.mean);
                    prop_assert!((from.sd - gaussian.sd).abs() <= 1e-6 * gaussian.sd);
                }
            }
        }
        // and written again it is the same to the bit
        let again: Vec<Vec<Experience>> = (0..table.textures())
            .map(|t| (0..movements.len() as u8).map(|m| table.experience(t, m)).collect()).collect();
        let textures = names.iter().zip(&again).map(|(name, known)| (name.as_str(), &known[..]));
        let mut copy = vec![0; 40_000];
        let copy = encode(&mut copy, PropertySet::ALL, &movements, textures).unwrap();
        prop_assert_eq!(copy.as_bytes(), table.as_bytes());
    }
}

#[test]
fn what_cannot_be_written_is_refused() {
    let one = learned(&[[1.0, 2.0, 3.0]]);
    let long = "x".repeat(41);
    let two = || vec![one; 2];
    let name = |index| EncodeError::Invalid(TableError::Name(index));
    let unnamed = |index, why| EncodeError::Invalid(TableError::Unnamed(index, why));
    for (textures, why) in [
        (vec![], EncodeError::Empty),
        (
            vec![("felt", two()), ("oak", vec![one])],
            EncodeError::Movements(1),
        ),
        (vec![("felt", vec![])], EncodeError::Movements(0)),
        (vec![("felt", vec![one; 3])], EncodeError::Movements(0)),
        (vec![("felt", two()), (&long, two())], EncodeError::Name(1)),
        (vec![("", two())], unnamed(0, NameError::Empty)),
        (
            vec![("felt", two()), ("a\u{202e}b", two())],
            unnamed(1, NameError::Unprintable(0x202e)),
        ),
        (vec![("felt", two()), ("felt", two())], name(1)),
    ] {
        assert_eq!(encoded(&textures), Err(why));
    }
    let bytes = encoded(&[(&long[..40], two())]).unwrap();
    assert_eq!(Table::read(&bytes).unwrap().name(0), Some(&long[..40]));

    let write = |out: &mut [u8], measured, movements: &[Movement]| {
        let experience = vec![one; movements.len()];
        let felt = ("felt", &experience[..]);
        encode(out, measured, movements, [felt].into_iter()).map(|table| table.as_bytes().len())
    };
    let out = &mut [0; 1000];
    let movements: Vec<Movement> = Movement::grid()
        .chain([Movement::new(150, 5000).unwrap()])
        .collect();
    let all = PropertySet::ALL;
    let longest = encoded_len(GAUSSIAN, 1, 36, 5);
    assert_eq!(write(out, all, &movements[..36]), Ok(longest));
    for (measured, movements) in [
        (all, &movements[..]),
        (all, &[]),
        (PropertySet::default(), &MOVEMENTS),
    ] {
        assert_eq!(write(out, measured, movements), Err(EncodeError::Empty));
    }
    let twice = [MOVEMENTS[0], MOVEMENTS[1], MOVEMENTS[0]];
    let twin = EncodeError::Invalid(TableError::TwinMovement(2));
    assert_eq!(write(out, all, &twice), Err(twin));
    let length = encoded_len(GAUSSIAN, 1, 2, 5);
    assert_eq!(write(&mut out[..length], all, &MOVEMENTS), Ok(length));
    let buffer = Err(EncodeError::NoSpace(length));
    assert_eq!(write(&mut out[..length - 1], all, &MOVEMENTS), buffer);

    let names: Vec<String> = (0..65536).map(|n| n.to_string()).collect();
    let textures = names.iter().map(|name| (name.as_str(), &[][..]));
    let too_many = encode(out, PropertySet::ALL, &MOVEMENTS, textures).map(|_| ());
    assert!(matches!(too_many, Err(EncodeError::NoSpace(bytes)) if bytes > 65536 * 26));
}

#[test]
fn a_mean_beyond_the_fixed_point_is_refused() {
    for (property, most) in Property::ALL.into_iter().zip(reach()) {
        let step = mean_step(property);
        let write = |mean: f32| {
            let mut trial = [0.0; 3];
            trial[property.index()] = mean;
            let experience = Experience {
                trials: 1,
                mean: trial,
                ..Experience::default()
            };
            encoded(&[
                ("felt", vec![Experience::default(); 2]),
                ("oak", vec![Experience::default(), experience]),
            ])
        };
        for mean in [most, most + 0.4 * step, -most - step, -most - 1.4 * step] {
            let bytes = write(mean).unwrap();
            let read = Table::read(&bytes).unwrap().experience(1, 1).mean[property.index()];
            assert!((read - mean).abs() <= step / 2.0, "{read} {mean}");
        }
        for mean in [
            most + step,
            -most - 2.0 * step,
            f32::INFINITY,
            f32::NEG_INFINITY,
        ] {
            let range = EncodeError::Range {
                texture: 1,
                action: act(1, property),
                mean,
            };
            assert_eq!(write(mean), Err(range));
        }
        assert!(matches!(write(f32::NAN), Err(EncodeError::Range { mean, .. }) if mean.is_nan()));
    }
}
