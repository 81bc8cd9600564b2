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
        let of = |all: &[Option<bool>]| of_all(all.iter().copied());
        assert_eq!(of(&[]), None);
        assert_eq!(of(&[Some(true), Some(true)]), Some(true));
        assert_eq!(of(&[Some(false)]), Some(false));
        assert_eq!(of(&[Some(true), Some(false)]), None);
        assert_eq!(of(&[None, Some(true)]), None);
        assert_eq!(of(&[Some(true), None]), None);
    }

    #[test]
    fn what_is_noted_is_true_of_all_trials() {
        let of = |before: Option<Option<bool>>, said: &[bool]| {
            let mut trials = Trials::default();
            if let Some(before) = before {
                trials.said(before);
            }
            said.iter().for_each(|moved| trials.said(Some(*moved)));
            trials.moved()
        };
        assert_eq!(of(None, &[]), None);
        assert_eq!(of(None, &[true, true]), Some(true));
        assert_eq!(of(None, &[false, false]), Some(false));
        assert_eq!(of(None, &[true, false]), None);
        assert_eq!(of(Some(None), &[true, true]), None);
        assert_eq!(of(Some(Some(true)), &[true]), Some(true));
        assert_eq!(of(Some(Some(false)), &[true]), None);
        assert_eq!(of(Some(Some(true)), &[]), Some(true));
    }

    #[test]
    fn a_trial_is_noted_as_it_was_said_and_the_first_one_as_all_others() {
        let of = |said: &[bool]| -> Vec<Option<bool>> {
            let mut trials = Trials::default();
            said.iter().for_each(|moved| trials.said(Some(*moved)));
            (0..=said.len())
                .map(|trial| trials.before_trial(trial))
                .collect()
        };
        assert_eq!(of(&[true, true]), [Some(true); 3]);
        assert_eq!(of(&[false]), [Some(false); 2]);
        assert_eq!(of(&[true, false]), [None, Some(true), Some(false)]);
        assert_eq!(of(&[]), [None]);
    }
}
