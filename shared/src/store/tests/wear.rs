//! How much an identification and a training wear the chip's own sectors: counted here, and stated in the book
//! (docs/src/learning.md).
//!
//! The firmware stores the skin's care after every identification, and one self-learned record where it may learn and
//! was certain (`probe/memory.rs`); every training and every label writes the table anew.

use super::self_learned::{Chip, chip, learned_record};
use super::*;

/// Erases of a sector that the chip's data sheet guarantees: 10 000 cycles (DS9405, STM32F427/429, flash memory
/// endurance).
const ENDURANCE: u32 = 10_000;
const IDENTIFICATIONS: u32 = 2000;
/// Textures of the paper's Table 1: all of them self-learned at both movements, in features of two bytes each.
const TEXTURES: u16 = 117;
const FEATURES: usize = 13;
const SIZE: i16 = 8000;

/// The wear of identifications, one texture after the other.
#[derive(PartialEq, Debug)]
struct Wear {
    /// Words programmed by [`IDENTIFICATIONS`] of them, copies of what is still valid included.
    words: usize,
    /// Identifications from one erase of a settings' sector to the next: the two take turns.
    from_erase_to_erase: u32,
}

impl Wear {
    /// Identifications until both sectors have been erased as often as they may be.
    fn life(&self) -> u32 {
        2 * ENDURANCE * self.from_erase_to_erase
    }
}

fn identifications(store: &mut Chip, learns: bool) -> Wear {
    let before = (store.flash.operations, store.flash.erases, store.flash.worn);
    let mut erased_at = Vec::new();
    let mut erases = before.1;
    for n in 0..IDENTIFICATIONS {
        let skin = SkinCare::after(n as f32 * 0.1, n as f32 * 0.2);
        block_on(store.set_skin(&skin)).unwrap();
        if learns {
            let texture = (n % u32::from(TEXTURES)) as u16;
            let record = learned_record(u32::MAX, texture, 2, FEATURES, SIZE - (n % 7) as i16);
            block_on(store.set_self_learned(&record)).unwrap();
        }
        if store.flash.erases > erases {
            assert_eq!(store.flash.erases, erases + 1, "one sector at a time");
            erases += 1;
            erased_at.push(n);
        }
    }
    let worn = store.flash.worn;
    assert_eq!(worn[..2], before.2[..2], "tables are not concerned");
    assert!(worn[2].abs_diff(worn[3]) <= 1, "in turn: {worn:?}");
    let (Some(first), Some(last)) = (erased_at.first(), erased_at.last()) else {
        panic!("no erase")
    };
    Wear {
        words: store.flash.operations - before.0 - (erases - before.1),
        from_erase_to_erase: (last - first) / (erased_at.len() as u32 - 1),
    }
}

#[test]
fn identifications_wear_the_settings_by_as_much_as_the_readme_says() {
    let mut store = chip();
    block_on(store.set_calibration(&calibration(1))).unwrap();
    let plain = identifications(&mut store, false);
    std::println!("not learning: {plain:?}, {} identifications", plain.life());
    // all textures have their record first
    identifications(&mut store, true);
    let learning = identifications(&mut store, true);
    std::println!(
        "learning: {learning:?}, {} identifications",
        learning.life()
    );
    let wear = |words, from_erase_to_erase| Wear {
        words,
        from_erase_to_erase,
    };
    // words: of 2000 identifications, with what the sectors' changes copied
    assert_eq!([plain, learning], [wear(10_062, 812), wear(118_759, 68)]);
}

#[test]
fn a_training_erases_one_of_the_sectors_of_the_table() {
    let mut store = chip();
    for n in 0..20 {
        let bytes = table(n);
        let (before, erases) = (store.flash.operations, store.flash.erases);
        block_on(async {
            store.begin_table(bytes.len()).await.unwrap();
            store.write_table(0, &bytes).await.unwrap();
            let mut buffer = [0; SECTOR];
            store.commit_table(None, &mut buffer).await.unwrap();
        });
        assert_eq!(store.flash.erases - erases, 1);
        // the header's six words and the commit word
        let words = store.flash.operations - before - 1;
        assert_eq!(words, bytes.len().div_ceil(4) + 7);
    }
    assert_eq!(store.flash.worn, [7, 7, 0, 0, 3, 3]);
}
