//! A table's notes of samples: true if they were moved or turned between the trials that it was learned from. A slide
//! on the same track again shows little about a texture.

use tactus_core::table::Table;

pub use tactus_link::samples::{Noting, Trials, fewest, note, noting, of_all};

/// The table's notes of its samples, in words.
pub fn in_words(table: Table<'_>) -> String {
    let of = |wanted: Option<bool>| -> Vec<&str> {
        let textures = (0..table.textures()).filter(|&texture| table.moved(texture) == wanted);
        textures.filter_map(|texture| table.name(texture)).collect()
    };
    let (moved, stayed, unknown) = (of(Some(true)), of(Some(false)), of(None));
    let all = usize::from(table.textures());
    if unknown.len() == all {
        return "samples: not known whether they were moved between trials".to_owned();
    }
    if moved.len() == all {
        return "samples: all were moved between trials".to_owned();
    }
    let parts = [
        ("moved between trials", moved),
        ("always at the same spot", stayed),
        ("not known", unknown),
    ];
    let parts = parts.into_iter().filter(|(_, names)| !names.is_empty());
    let parts: Vec<String> = parts
        .map(|(what, names)| format!("{what}: {}", names.join(", ")))
        .collect();
    format!("samples, {}", parts.join("; "))
}

/// Advice for samples that never moved; `None` if there are none.
pub fn advice(stayed: &[&str]) -> Option<String> {
    (!stayed.is_empty()).then(|| {
        format!(
            "Learned at one spot: {}. A slide on the same track again says little about a texture, so it may not be \
             known at other spots, or turned: learn it again, and move or turn the sample between trials.",
            stayed.join(", ")
        )
    })
}

#[cfg(test)]
mod tests {
    use tactus_core::explorer::Method;
    use tactus_core::features::{Movement, Observation, Properties};

    use super::*;
    use crate::eval::learn::learn;

    fn table(method: Method) -> Vec<u8> {
        let slide =
            |x: f32| Observation::from(Properties::new([Some(x), Some(3.0), Some(5.0 + x)]));
        let slides = |x: f32| vec![vec![slide(x), slide(x + 0.1), slide(x + 0.3)]];
        let names = ["cork", "felt", "silk", "wool"].map(str::to_owned);
        let slides: Vec<_> = (0..4u8).map(|n| slides(f32::from(n) / 4.0)).collect();
        learn(method, None, &names, &[Movement::FOR_TRACTION], &slides).unwrap()
    }

    #[test]
    fn a_note_is_read_back_and_all_else_stays_as_it_is() {
        let notes = [Some(true), Some(false), None, Some(false)];
        for method in [Method::Paper, Method::Fused] {
            let plain = table(method);
            assert_eq!(note(&plain, |_| None).unwrap(), plain);
            let noted = note(&plain, |texture| notes[usize::from(texture)]).unwrap();
            let read = Table::read(&noted).unwrap();
            for texture in 0..4u16 {
                assert_eq!(read.moved(texture), notes[usize::from(texture)]);
            }
            assert_eq!(
                in_words(read),
                "samples, moved between trials: cork; always at the same spot: felt, wool; not known: silk"
            );
            read.check_samples().unwrap();
            let before = Table::read(&plain).unwrap();
            assert_eq!(
                (read.drift(), read.limits()),
                (before.drift(), before.limits())
            );
            assert_eq!(noted.len(), plain.len() + 4 + 5 * 3);
            // taken back, only its ancestor is named
            let again = note(&noted, |_| None).unwrap();
            assert_eq!(again.len(), plain.len());
            assert_eq!(Table::read(&again).unwrap().lineage(), before.lineage());
        }
        assert_eq!(
            in_words(Table::read(&table(Method::Fused)).unwrap()),
            "samples: not known whether they were moved between trials"
        );
    }

    #[test]
    fn what_is_said_is_true_of_all() {
        let (yes, no) = (Some(true), Some(false));
        for (all, of) in [
            (&[][..], None),
            (&[yes, yes], yes),
            (&[no], no),
            (&[yes, no], None),
            (&[None, yes], None),
            (&[yes, None], None),
        ] {
            assert_eq!(of_all(all.iter().copied()), of, "{all:?}");
        }
    }

    #[test]
    fn what_is_noted_of_trials_is_true_of_all_and_of_each() {
        let (yes, no) = (Some(true), Some(false));
        // said before the first trial, between trials; noted of all, and before each
        for (first, said, all, each) in [
            (None, &[][..], None, &[None][..]),
            (None, &[true, true], yes, &[yes; 3]),
            (None, &[false, false], no, &[no; 3]),
            (None, &[true, false], None, &[None, yes, no]),
            (Some(None), &[true, true], None, &[]),
            (Some(yes), &[true], yes, &[]),
            (Some(no), &[true], None, &[]),
            (Some(yes), &[], yes, &[]),
        ] {
            let mut trials = Trials::default();
            first.iter().for_each(|before| trials.said(*before));
            said.iter().for_each(|moved| trials.said(Some(*moved)));
            assert_eq!(trials.moved(), all, "{first:?} {said:?}");
            for (trial, noted) in each.iter().enumerate() {
                assert_eq!(trials.before_trial(trial), *noted, "{said:?}");
            }
        }
    }
}
