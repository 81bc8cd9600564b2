//! Training for a fused table: one slide is enough, and what comes is whitened as the table has it.

use super::*;
use crate::features::FeatureSet;
use crate::features::Vector;
use crate::table::Whitening;
use crate::table::tests::whitening::{Noise, World, learned};
use crate::table::tests::{fused_of, known, straight};

fn bands(x: &Vector) -> Observation {
    Observation {
        bands: x.iter().copied().collect(),
        ..Observation::default()
    }
}

/// Three textures at two movements, learned from four slides each of a world that has five; and its whitenings.
fn world_and_table(noise: &mut Noise) -> (World, List<Whitening>, List<u8>) {
    let world = World::new(noise, 5, 2, 6);
    let mut slides = world.slides(noise, 4);
    slides.iter_mut().for_each(|textures| textures.truncate(3));
    let whitenings = learned(&slides);
    let row = |texture: usize| {
        let cell = |movement: usize| {
            let mut known = Whitened::default();
            for slide in &slides[movement][texture] {
                known.teach(&whitenings[movement].apply(slide));
            }
            known
        };
        [0, 1].map(cell).to_vec()
    };
    let known: List<List<Whitened>> = (0..3).map(row).collect();
    let bytes = fused_of(FeatureSet::Bands, &whitenings, &known);
    (world, whitenings, bytes)
}

#[test]
fn a_new_texture_is_the_whitened_mean_of_its_slides() {
    for trials in 1..=5 {
        let noise = &mut Noise(trials.into());
        let (world, whitenings, bytes) = world_and_table(noise);
        let old = Table::read(&bytes).unwrap();
        let wanted = Wanted {
            trials,
            measures: PropertySet::default(),
            ..wanted("felt")
        };
        // a texture takes 13 bytes at each movement, 5 for itself, and its name
        let needed = bytes.len() + 2 * 13 + 5 + 1 + 4;
        let buffer = Training::new(wanted, Some(&old), needed - 1).err();
        assert_eq!(buffer, Some(TrainingError::NoSpace(needed)));
        let mut training = Training::new(wanted, Some(&old), needed).unwrap();
        assert_eq!((training.table(), training.makes_table()), (None, true));
        assert_eq!(training.left(), 2 * u16::from(trials));
        let mut sums = [[0.0; 6]; 2];
        let mut stored: List<TrainingRecord> = List::new();
        while let Some(movement) = training.next() {
            let at = old.movements().position(|m| m == movement).unwrap();
            let slide = world.slide(noise, 4, at);
            for (sum, z) in sums[at].iter_mut().zip(whitenings[at].apply(&slide)) {
                *sum += f64::from(z);
            }
            // the power is cut before every slide
            let mut again = Training::new(wanted, Some(&old), needed).unwrap();
            for movement in old.movements() {
                if let Some(last) = stored.iter().rev().find(|t| t.movement == movement) {
                    again.resume(movement, last.stats).unwrap();
                }
            }
            assert_eq!(again.learned(), training.learned());
            training = again;
            stored.push(training.took(Some(&old), movement, &bands(&slide)).unwrap());
        }
        assert_eq!(stored.len(), 2 * usize::from(trials));
        assert!(stored.iter().all(|t| t.table.is_none() && t.name == "felt"));
        let mut buffer = vec![0; needed];
        let new = training.encode(Some(&old), &mut buffer).unwrap();
        assert_eq!(new.as_bytes().len(), needed);
        for (movement, sum) in (0..).zip(sums) {
            assert_eq!(new.trials(3, movement), trials);
            for (mean, sum) in new.white_mean(3, movement).zip(sum) {
                let error = f64::from(mean) - sum / f64::from(trials);
                assert!(error.abs() <= 0.5 + 0.25 * f64::from(trials - 1), "{error}");
            }
        }
        let user = Tally {
            user: 2 * trials,
            ..Tally::default()
        };
        assert_eq!((new.tally(3), new.number(3)), (user, 3));
        assert_eq!((new.lineage(), new.name(3)), (old.crc(), Some("felt")));
        for texture in 0..3 {
            assert_eq!(new.tally(texture), old.tally(texture));
            for movement in 0..2 {
                assert_eq!(
                    new.whitened(texture, movement),
                    old.whitened(texture, movement)
                );
                assert_eq!(new.whitening(movement), old.whitening(movement));
            }
        }
    }
}

#[test]
fn a_known_fused_texture_goes_on_with_its_slides() {
    let noise = &mut Noise(99);
    let (world, whitenings, bytes) = world_and_table(noise);
    let old = Table::read(&bytes).unwrap();
    let wanted = Wanted {
        trials: 6,
        ..wanted("t1")
    };
    let mut training = Training::new(wanted, Some(&old), 0).unwrap();
    assert_eq!((training.table(), training.left()), (Some(old.crc()), 4));
    assert_eq!(
        training.learned()[1].1,
        TrainingStats::Fused(old.whitened(1, 1))
    );
    let mut sums = [0, 1].map(|m| {
        let mean = old.whitened(1, m).mean;
        mean.map(|m| 4.0 * f64::from(m))
    });
    while let Some(movement) = training.next() {
        let at = old.movements().position(|m| m == movement).unwrap();
        let slide = world.slide(noise, 1, at);
        for (sum, z) in sums[at].iter_mut().zip(whitenings[at].apply(&slide)) {
            *sum += f64::from(z);
        }
        let stored = training.took(Some(&old), movement, &bands(&slide)).unwrap();
        assert_eq!(stored.table, Some(old.crc()));
    }
    let mut buffer = vec![0; 4096];
    let new = training.encode(Some(&old), &mut buffer).unwrap();
    assert!(new.names().eq(old.names()));
    for (movement, sum) in (0..).zip(sums) {
        assert_eq!(new.trials(1, movement), 6);
        for (mean, sum) in new.white_mean(1, movement).zip(sum) {
            assert!((f64::from(mean) - sum / 6.0).abs() <= 1.0);
        }
    }
    let tally = Tally {
        factory: 8,
        user: 4,
        itself: 0,
    };
    assert_eq!(new.tally(1), tally);
    // and with the table that is now
    let training = Training::new(wanted, Some(&new), 0).unwrap();
    assert_eq!((training.next(), training.table()), (None, Some(new.crc())));
}

#[test]
fn what_no_fused_table_can_take_is_refused() {
    let row = || vec![known(3, &[1.0; 13]); 2];
    let whitenings = [straight(13), straight(13)];
    let bytes = fused_of(FeatureSet::Force, &whitenings, &[row(), row()]);
    let old = Table::read(&bytes).unwrap();
    let none = Wanted {
        trials: 0,
        ..wanted("felt")
    };
    assert_eq!(
        Training::new(none, Some(&old), 4096).err(),
        Some(TrainingError::Trials(0))
    );
    let no_force = Wanted {
        measures: PropertySet::from_bits(6).unwrap(),
        ..wanted("felt")
    };
    let missing = TrainingError::Features(FeatureSet::Force);
    assert_eq!(
        Training::new(no_force, Some(&old), 4096).err(),
        Some(missing)
    );
    let mut training = Training::new(wanted("felt"), Some(&old), 4096).unwrap();
    let movement = training.next().unwrap();
    let before = training.learned().to_vec();
    let traction_only = observation(0.5);
    assert_eq!(
        training.took(Some(&old), movement, &traction_only),
        Err(missing)
    );
    let whole = Observation {
        bands: heapless::Vec::from_slice(&[5; 12]).unwrap(),
        ..observation(0.5)
    };
    assert_eq!(
        training.took(None, movement, &whole),
        Err(missing),
        "nothing to whiten with"
    );
    let gaussians = TrainingStats::Gaussians(Experience::default());
    assert_eq!(
        training.resume(movement, gaussians),
        Err(TrainingError::Stats)
    );
    assert_eq!(training.learned(), before);
    let stored = training.took(Some(&old), movement, &whole).unwrap();
    assert_eq!(stored.stats.trials(), 1);
    // nor does a table of Gaussians take what is whitened
    let gaussians = table(2);
    let gaussians = Table::read(&gaussians).unwrap();
    let mut other = Training::new(wanted("felt"), Some(&gaussians), 4096).unwrap();
    let movement = other.next().unwrap();
    assert_eq!(
        other.resume(movement, stored.stats),
        Err(TrainingError::Stats)
    );
    // a pilot beside a fused table is about properties
    let pilot = Wanted {
        pilot: true,
        ..wanted("felt")
    };
    let mut pilot = Training::new(pilot, Some(&old), 0).unwrap();
    assert!(!pilot.makes_table());
    assert_eq!(train(&mut pilot).len(), 90);
    assert!(matches!(pilot.learned()[0].1, TrainingStats::Gaussians(_)));
}
