//! Trainings without a rig, step by step.

mod fused;

use super::*;
use crate::features::Properties;
use crate::features::Property;
use crate::rig::HIGH_FORCE_MN;
use crate::table::tests::{around, table_of};
use std::vec;
use std::vec::Vec as List;

fn none() -> TrainingStats {
    TrainingStats::Gaussians(Experience::default())
}

fn wanted(name: &str) -> Wanted<'_> {
    Wanted {
        name,
        trials: 3,
        pilot: false,
        measures: PropertySet::ALL,
        most_mn: HIGH_FORCE_MN,
    }
}

/// `textures` textures at two movements.
fn table(textures: usize) -> List<u8> {
    let cell = vec![around([(0.1, 0.2), (0.3, 0.1), (0.5, 0.4)]); 2];
    table_of(PropertySet::ALL, &vec![cell; textures])
}

fn observation(value: f32) -> Observation {
    Properties::new([Some(value), Some(2.0 * value), Some(3.0 * value)]).into()
}

/// Makes all movements; those made.
fn train(training: &mut Training) -> List<Movement> {
    let mut made = List::new();
    while let Some(movement) = training.next() {
        made.push(movement);
        training
            .took(None, movement, &observation(made.len() as f32 * 0.01))
            .unwrap();
    }
    made
}

#[test]
fn a_new_texture_is_added_and_the_others_stay_to_the_bit() {
    let bytes = table(5);
    let old = Table::read(&bytes).unwrap();
    let mut training = Training::new(wanted("felt"), Some(&old), 4096).unwrap();
    assert_eq!((training.name(), training.table()), ("felt", None));
    let mut buffer = vec![0; 4096];
    let [first, second] = [0, 1].map(|m| old.movement(m).unwrap());
    let unfinished = training.encode(Some(&old), &mut buffer).err();
    assert_eq!(unfinished, Some(TrainingError::Unfinished(first)));
    assert_eq!(
        train(&mut training),
        [first, second, first, second, first, second]
    );
    let new = training.encode(Some(&old), &mut buffer).unwrap();
    assert_eq!(
        new.names().collect::<List<_>>(),
        ["t0", "t1", "t2", "t3", "t4", "felt"]
    );
    assert_eq!([0, 1].map(|m| new.trials(5, m)), [3, 3]);
    // movements, cells and trials of the first five lie where they lay, but for the trials
    let cells = 16 + 2 * 6 + 5 * 2 * 12;
    assert_eq!(new.as_bytes()[16..cells], bytes[16..cells]);
    for (texture, movement) in (0..5).flat_map(|t| [(t, 0), (t, 1)]) {
        let of = |table: &Table<'_>| table.experience(texture, movement);
        assert_eq!(of(&new), of(&old));
    }
    // and the other way round: learning nothing new writes the same table
    let known = Training::new(
        Wanted {
            trials: 2,
            ..wanted("t3")
        },
        Some(&old),
        0,
    );
    let same = known.unwrap().encode(Some(&old), &mut buffer).unwrap();
    // but for where it came from
    let (lineage, end) = (16 + 2 * 6 + 5 * 2 * 12 + 5 * 2, bytes.len() - 4);
    assert_eq!(same.as_bytes()[..lineage], bytes[..lineage]);
    assert_eq!(same.as_bytes()[lineage..lineage + 4], bytes[end..]);
    assert_eq!(same.as_bytes()[lineage + 4..end], bytes[lineage + 4..end]);
    assert_eq!((same.lineage(), old.lineage()), (old.crc(), old.crc()));
    // which stays as it is from then on
    let once_more = Wanted {
        trials: 2,
        ..wanted("t0")
    };
    let known = Training::new(once_more, Some(&same), 0).unwrap();
    let mut again = vec![0; 4096];
    let again = known.encode(Some(&same), &mut again).unwrap();
    assert_eq!(again.as_bytes(), same.as_bytes());
    let other = training.encode(None, &mut buffer).err();
    assert_eq!(other, Some(TrainingError::Table));
}

#[test]
fn a_known_texture_goes_on_with_its_trials() {
    let bytes = table(3);
    let old = Table::read(&bytes).unwrap();
    let mut training = Training::new(wanted("t1"), Some(&old), 0).unwrap();
    assert_eq!(training.table(), Some(old.crc()));
    let (movement, two) = training.learned()[0];
    assert_eq!(two.trials(), 2);
    let record = training.took(None, movement, &observation(0.2)).unwrap();
    assert_eq!((record.stats.trials(), record.table), (3, Some(old.crc())));
    assert_eq!((&record.name[..], record.movement), ("t1", movement));
    // the power is cut
    let mut training = Training::new(wanted("t1"), Some(&old), 0).unwrap();
    training.resume(movement, record.stats).unwrap();
    assert_eq!(train(&mut training), [old.movement(1).unwrap()]);
    let mut buffer = vec![0; 4096];
    let new = training.encode(Some(&old), &mut buffer).unwrap();
    assert_eq!(
        (new.textures(), new.trials(1, 0), new.trials(1, 1)),
        (3, 3, 3)
    );
    let mean = new
        .experience(1, 0)
        .gaussian(Property::Traction)
        .unwrap()
        .mean;
    assert!((mean - (0.1 + 0.1 + 0.2) / 3.0).abs() < 1e-3, "{mean}");
}

#[test]
fn what_cannot_end_in_a_table_is_refused_before_touching() {
    let bytes = table(3);
    let old = Table::read(&bytes).unwrap();
    let refused = |wanted, buffer| Training::new(wanted, Some(&old), buffer).err();
    let long = std::format!("{:041}", 0);
    assert_eq!(refused(wanted(""), 4096), Some(TrainingError::Name(0)));
    assert_eq!(refused(wanted(&long), 4096), Some(TrainingError::Name(41)));
    assert_eq!(refused(wanted(&long[..40]), 4096), None);
    let once = Wanted {
        trials: 1,
        ..wanted("felt")
    };
    assert_eq!(refused(once, 4096), Some(TrainingError::Trials(1)));
    let needed = bytes.len() + 2 * 13 + 5 + 1 + 4;
    assert_eq!(refused(wanted("felt"), needed), None);
    assert_eq!(
        refused(wanted("felt"), needed - 1),
        Some(TrainingError::NoSpace(needed))
    );
    let handheld = Wanted {
        measures: PropertySet::from_bits(6).unwrap(),
        ..wanted("felt")
    };
    let traction = TrainingError::Measures(Some(Property::Traction));
    assert_eq!(refused(handheld, 4096), Some(traction));
    let nothing = Wanted {
        measures: PropertySet::default(),
        ..wanted("felt")
    };
    let nothing = Training::new(nothing, None, 4096).err();
    assert_eq!(nothing, Some(TrainingError::Measures(None)));
    let full = table(MAX_TEXTURES);
    let full = Table::read(&full).unwrap();
    let one_more = Training::new(wanted("felt"), Some(&full), 16_384).err();
    assert_eq!(one_more, Some(TrainingError::Textures));
    assert!(Training::new(wanted("t7"), Some(&full), 16_384).is_ok());
}

#[test]
fn a_slide_that_lacks_a_property_does_not_count() {
    let mut training = Training::new(wanted("felt"), None, 4096).unwrap();
    let movement = training.next().unwrap();
    let lacks = Properties::new([Some(1.0), None, Some(f32::NAN)]);
    let missing = TrainingError::Missing(Property::Roughness);
    assert_eq!(training.took(None, movement, &lacks.into()), Err(missing));
    assert_eq!(training.learned()[0].1, none());
    let other = Movement::new(1000, 30_000).unwrap();
    let foreign = Err(TrainingError::Movement(other));
    assert_eq!(training.took(None, other, &observation(1.0)), foreign);
    let foreign = Err(TrainingError::Movement(other));
    assert_eq!(training.resume(other, none()), foreign);
}

#[test]
fn without_a_table_the_first_texture_makes_one() {
    for (pilot, most_mn, movements) in [
        (false, HIGH_FORCE_MN, 3),
        (true, HIGH_FORCE_MN, 30),
        (true, 2000, 36),
    ] {
        let wanted = Wanted {
            pilot,
            most_mn,
            ..wanted("felt")
        };
        let mut training = Training::new(wanted, None, 4096).unwrap();
        let made = train(&mut training);
        assert_eq!(made.len(), 3 * movements);
        let mut buffer = vec![0; 4096];
        let first = training.encode(None, &mut buffer).unwrap();
        assert_eq!(first.names().collect::<List<_>>(), ["felt"]);
        if !pilot {
            assert!(first.movements().eq(FIRST_MOVEMENTS));
            continue;
        }
        assert!(first.movements().eq(pilot_movements(most_mn)));
        // where the table has the pilot's movements a second pilot goes into it
        let second = Wanted {
            name: "wool",
            ..wanted
        };
        let mut training = Training::new(second, Some(&first), 4096).unwrap();
        assert!(training.makes_table());
        train(&mut training);
        let mut buffer = vec![0; 4096];
        let both = training.encode(Some(&first), &mut buffer).unwrap();
        assert_eq!((both.textures(), both.movements().len()), (2, movements));
    }
}

#[test]
fn a_pilot_beside_a_table_has_only_a_result() {
    let bytes = table(3);
    let old = Table::read(&bytes).unwrap();
    let pilot = Wanted {
        pilot: true,
        ..wanted("t1")
    };
    // no space is asked for
    let mut training = Training::new(pilot, Some(&old), 0).unwrap();
    assert_eq!((training.makes_table(), training.table()), (false, None));
    let made = train(&mut training);
    assert!(made.iter().all(|m| m.force_mn() <= 1262) && made.len() == 90);
    assert!(training.learned().iter().all(|(_, e)| e.trials() == 3));
    let none = training.encode(Some(&old), &mut [0; 64]).err();
    assert_eq!(none, Some(TrainingError::Pilot));
}
