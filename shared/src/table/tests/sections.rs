//! Sections behind the names of a table: what they hold, what is skipped, what is refused.

use super::damage::{crc_of, read_all};
use super::whitening::{Noise, World};
use super::*;
use crate::table::{
    Against, Drift, Drifts, EPISODES, Limits, Population, Sections, Tail, whiten_drifting,
    with_sections,
};

fn tail(begin: f32) -> Tail {
    Tail { begin, excess: 2.5 }
}

fn limits() -> Limits {
    Limits {
        false_alarm: 0.03,
        drifted: [tail(-1.0), tail(-3.0), tail(-2.0)],
        same: [tail(1.0), tail(2.0), tail(3.0)],
    }
}

/// Four textures, two movements and two features, with drift and limits.
pub(super) fn full() -> Vec<u8> {
    let known = |n: i16| {
        let mean = [f64::from(n), f64::from(n * n)];
        vec![super::known(5, &mean), super::known(4, &mean)]
    };
    let textures: Vec<_> = (0..4).map(known).collect();
    let plain = fused_of(FeatureSet::Bands, &[straight(2), straight(2)], &textures);
    let means = textures.iter().map(|row| (row[0].slides, &row[0].mean[..]));
    let population = Population::new(2, means).unwrap();
    let mut drifts = Drifts::default();
    drifts[0] = 0.5;
    let sections = Sections {
        drift: (Drift::default(), &[drifts, drifts]),
        novelty: Some((limits(), &[population.clone(), population])),
        slopes: None,
    };
    let mut out = vec![0; 4000];
    let table = with_sections(&mut out, &Table::read(&plain).unwrap(), &sections).unwrap();
    assert_eq!(
        table.as_bytes().len(),
        plain.len() + 4 + 8 + 8 + 4 + 52 + 2 * (14 + 8)
    );
    table.as_bytes().to_vec()
}

/// The offset of the sections in [`full`].
fn begin(bytes: &[u8]) -> usize {
    bytes.len() - CRC_BYTES - (4 + 8 + 8 + 4 + 52 + 2 * (14 + 8))
}

pub(super) fn changed(change: impl FnOnce(&mut Vec<u8>, usize)) -> Vec<u8> {
    let mut bytes = full();
    let at = begin(&bytes);
    bytes.truncate(bytes.len() - CRC_BYTES);
    change(&mut bytes, at);
    sealed(bytes)
}

/// With its length and checksum.
pub(super) fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
    let length = (bytes.len() + CRC_BYTES) as u32;
    bytes[8..12].copy_from_slice(&length.to_le_bytes());
    seal(bytes)
}

#[test]
fn sections_read_back_and_stay_when_textures_change() {
    let bytes = full();
    let table = Table::read(&bytes).unwrap();
    let agrees = |table: &Table<'_>| {
        assert_eq!(table.drift(), Some(Drift::default()));
        assert!(table.drifts(1).unwrap().eq([0.5]));
        assert!(table.drifts(2).is_none());
        assert_eq!(table.limits(), Some(limits()));
        assert!(table.population(1).unwrap().variances.zip([0.0; 2]).count() == 2);
        assert!(table.population(2).is_none());
    };
    agrees(&table);
    let name = "x";
    for change in [
        Change::Forget(1),
        Change::Rename { texture: 2, name },
        put("new"),
    ] {
        let bytes = amended(&bytes, change);
        let amended = Table::read(&bytes).unwrap();
        assert_eq!(amended.lineage(), table.crc());
        agrees(&amended);
    }
    let mut told = bytes.clone();
    retell(&mut told, 1, 0, &NEW[0], Tally::default()).unwrap();
    agrees(&Table::read(&told).unwrap());
    // a table may have none
    let plain = fused_of(
        FeatureSet::Bands,
        &[straight(2)],
        &[vec![known(2, &[1.0, 2.0])]],
    );
    let plain = Table::read(&plain).unwrap();
    assert_eq!((plain.drift(), plain.limits()), (None, None));
}

#[test]
fn unknown_sections_are_skipped() {
    let bytes = changed(|bytes, at| {
        let new = [0x07, 0x80, 3, 0, 1, 2, 3];
        bytes.splice(at..at, new);
        bytes.extend([0x63, 0, 0, 0]);
    });
    let table = Table::read(&bytes).unwrap();
    assert_eq!(table.limits(), Some(limits()));
    let amended = amended(&bytes, Change::Forget(0));
    let mut windows = amended.windows(7);
    assert!(windows.any(|w| w == [7, 0x80, 3, 0, 1, 2, 3]));
}

#[test]
fn damaged_sections_are_refused() {
    let drift = TableError::Section(1);
    let novelty = TableError::Section(2);
    let limits_at = 4 + 8 + 8 + 4 + 4;
    for (at, number, error) in [
        // the drift and its variances
        (4, -0.1, drift),
        (8, f32::NAN, drift),
        (12, -1.0, drift),
        (16, 1e6, drift),
        // share, begin, excess, an infinite one, a variance of the population
        (limits_at - 4, 1.0, novelty),
        (limits_at, f32::NAN, novelty),
        (limits_at + 4, 0.0, novelty),
        (limits_at + 44, f32::INFINITY, novelty),
        (limits_at + 48 + 14, 0.0, novelty),
        // binary places of an axis
        (
            limits_at + 48 + 4,
            f32::from_le_bytes([31, 0, 0, 0]),
            novelty,
        ),
    ] {
        let number = number.to_le_bytes();
        let bytes = changed(|bytes, begin| bytes[begin + at..][..4].copy_from_slice(&number));
        assert_eq!(super::error(&bytes), error, "{at}");
    }
    let twice = changed(|bytes, at| bytes.extend_from_within(at..at + 20));
    assert_eq!(super::error(&twice), drift);
    let a_byte_too_many = changed(|bytes, _| bytes.push(1));
    assert_eq!(super::error(&a_byte_too_many), TableError::Sections);
    let short = changed(|bytes, at| bytes[at + 2] -= 4);
    let cut = changed(|bytes, _| bytes.truncate(bytes.len() - 1));
    for bytes in [short, cut] {
        let found = super::error(&bytes);
        assert!(matches!(
            found,
            TableError::Sections | TableError::Section(_)
        ));
    }
    // a table of Gaussians has none
    let mut gaussians = small();
    let section = full()[begin(&full())..][..20].to_vec();
    gaussians.truncate(gaussians.len() - CRC_BYTES);
    gaussians.extend(section);
    assert_eq!(super::error(&sealed(gaussians)), drift);
}

#[test]
fn no_damage_to_sections_panics() {
    let good = full();
    for at in begin(&good)..good.len() - CRC_BYTES {
        for bits in [1, 0x80, 0xff] {
            let bytes = changed(|bytes, _| bytes[at] ^= bits);
            assert_ne!(crc_of(&bytes), crc_of(&good));
            read_all(&bytes);
        }
    }
}

#[test]
fn the_limit_follows_the_false_alarm_and_never_rises_with_slides() {
    let limits = limits();
    // the tail begins at 10 % of its own promise, and twice as many alarms come
    assert_eq!(limits.limit(Against::Same, 1, Some(0.2)), 1.0);
    let tenth = limits.limit(Against::Same, 1, Some(0.02)) - 1.0;
    assert!((tenth - 2.5 * 10_f32.ln()).abs() < 1e-5, "{tenth}");
    let drifted = [1, 2, 3, 9].map(|slides| limits.limit(Against::Drifted, slides, Some(0.2)));
    assert_eq!(drifted, [-1.0, -3.0, -3.0, -3.0]);
    assert_eq!(limits.limit(Against::Same, 0, Some(0.2)), 1.0);
    assert_eq!(EPISODES, 3);
}

/// W D W' is diagonal and has the variances that are told, for the drift of the raw features.
#[test]
fn the_drift_is_diagonal_in_whitened_space() {
    let mut noise = Noise(5);
    let world = World::new(&mut noise, 9, 2, 13);
    let slides = world.slides(&mut noise, 6);
    let scatters: Vec<Scatter> = slides
        .iter()
        .map(|textures| {
            let mut scatter = Scatter::new(13);
            textures
                .iter()
                .for_each(|slides| scatter.push(slides).unwrap());
            scatter
        })
        .collect();
    let drift = Drift {
        bands: 0.3,
        traction: 0.1,
    };
    let learned = whiten_drifting(&scatters, FeatureSet::Force, drift).unwrap();
    for ((whitening, variances), textures) in learned.iter().zip(&slides) {
        let d = 13;
        let all: Vec<f64> = textures.iter().flatten().map(|x| x[0].into()).collect();
        let mean = all.iter().sum::<f64>() / all.len() as f64 / 1024.0;
        let raw = |i: usize, j: usize| match (i, j) {
            (0, 0) => (0.1 * mean).powi(2),
            (0, _) | (_, 0) => 0.0,
            (1 | 2, _) | (_, 1 | 2) if i != j => 0.0,
            (1 | 2, _) => 0.36 * 0.09,
            _ => 0.09 * (-0.5 * i.abs_diff(j) as f64).exp(),
        };
        let bytes = whitening.as_bytes();
        let w = |row: usize, column: usize| {
            let at = 3 * d + 2 * (row * d + column);
            let weight = f64::from(i16::from_le_bytes([bytes[at], bytes[at + 1]]));
            weight / f64::from(1u32 << bytes[2 * d + row])
        };
        let mut along = Vec::new();
        for a in 0..d {
            for b in 0..d {
                let sum: f64 = (0..d)
                    .flat_map(|i| (0..d).map(move |j| (i, j)))
                    .map(|(i, j)| w(a, i) * raw(i, j) * w(b, j))
                    .sum();
                let of = |axis: usize| f64::from(variances[axis / 2]);
                if a == b {
                    along.push(sum);
                } else {
                    let scale = (of(a) * of(b)).sqrt().max(0.01);
                    assert!(sum.abs() < 2e-3 * scale, "{a} {b}: {sum}");
                }
            }
        }
        // of each two their mean
        for (pair, variance) in along.chunks(2).zip(variances) {
            let mean = pair.iter().sum::<f64>() / pair.len() as f64;
            assert!(
                (mean - f64::from(*variance)).abs() < 2e-3 * mean,
                "{mean} {variance}"
            );
            assert!(pair[0] >= pair[pair.len() - 1] * 0.999);
        }
    }
}

/// Two clouds of textures along a diagonal: axes, variances and shrinking by hand.
#[test]
fn a_population_is_its_covariance_shrunk() {
    let means = [[768, 768], [-768, -768], [64, -64], [-64, 64]];
    let population = Population::new(2, means.iter().map(|m| (4, &m[..]))).unwrap();
    // along the diagonal 36/3, across 1/12; OAS of 3 degrees of freedom
    let (trace, squares) = (12.0 + 1.0 / 12.0, 144.0 + 1.0 / 144.0);
    let rho: f64 = trace * trace / (3.0 * (squares - trace * trace / 2.0));
    assert!((0.5..0.9).contains(&rho));
    let shrunk = |v: f64| (1.0 - rho) * v + rho * trace / 2.0 - 0.25;
    for (found, v) in population.variances.iter().zip([12.0, 1.0 / 12.0]) {
        assert!(
            (f64::from(*found) - shrunk(v)).abs() < 1e-4,
            "{found} {}",
            shrunk(v)
        );
    }
    let along = population.axes.apply(&[256, 256]);
    assert!(
        (i32::from(along[0]) - 362).abs() <= 1 && along[1].abs() <= 1,
        "{along:?}"
    );
    let across = population.axes.apply(&[256, -256]);
    assert!(across[0].abs() <= 1 && (i32::from(across[1]).abs() - 362).abs() <= 1);
    // two textures, or three of which one was never touched, are none
    let few = |slides| Population::new(2, means[..3].iter().zip(slides).map(|(m, n)| (n, &m[..])));
    assert!(few([1, 1, 0]).is_none() && few([1, 1, 1]).is_some());
}
