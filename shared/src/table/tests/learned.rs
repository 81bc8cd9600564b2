//! A table's note of the slides that it was learned from: read back, taken out again without a trace, carried over by a
//! probe, refused where it is damaged.

use super::damage::read_all;
use super::sections::{changed, full};
use super::*;
use crate::table::{LearnedSlides, MAX_LEARNED, SlideHash, with_learned};

const HASHES: [SlideHash; 3] = [[0; 6], [0, 1, 0, 0, 0, 9], [255; 6]];

fn noted(bytes: &[u8], all: bool, hashes: &[SlideHash]) -> Result<Vec<u8>, EncodeError> {
    let mut out = vec![0; bytes.len() + 8 + 6 * hashes.len()];
    let learned = Some(LearnedSlides { all, hashes });
    let table = with_learned(&mut out, &Table::read(bytes).unwrap(), learned)?;
    Ok(table.as_bytes().to_vec())
}

#[test]
fn it_is_read_back_and_taken_out_to_the_byte() {
    for plain in [full(), small()] {
        let bytes = noted(&plain, true, &HASHES).unwrap();
        let table = Table::read(&bytes).unwrap();
        assert_eq!(bytes.len(), plain.len() + 4 + 1 + 6 * 3);
        assert_eq!(table.check_learned(), Ok(()));
        let learned = table.learned_slides();
        assert_eq!((learned.all, learned.hashes), (true, &HASHES[..]));
        assert!(learned.has(&HASHES[1]) && !learned.has(&[0, 1, 0, 0, 0, 8]));
        let mut out = vec![0; bytes.len()];
        let bare = with_learned(&mut out, &table, None).unwrap();
        assert_eq!(bare.as_bytes(), plain);
        assert_eq!(bare.learned_slides(), LearnedSlides::default());
        assert_eq!(bare.check_learned(), Ok(()));
        let others = noted(&bytes, false, &HASHES[..1]).unwrap();
        let others = Table::read(&others).unwrap().learned_slides();
        assert_eq!((others.all, others.hashes), (false, &HASHES[..1]));
    }
}

#[test]
fn what_a_probe_learns_is_not_in_it() {
    let bytes = noted(&full(), true, &HASHES).unwrap();
    let of = |bytes: &[u8]| {
        let learned = Table::read(bytes).unwrap().learned_slides();
        (learned.all, learned.hashes.len())
    };
    let tally = |user, itself| Tally {
        factory: 5,
        user,
        itself,
    };
    let known = TextureStats::Fused(&NEW);
    let taught = |name, tally| amended(&bytes, Change::Put { name, known, tally });
    assert_eq!(of(&taught("new", tally(3, 0))), (false, 3));
    assert_eq!(of(&taught("t1", tally(0, 1))), (false, 3));
    let rename = Change::Rename {
        texture: 1,
        name: "x",
    };
    assert_eq!(of(&amended(&bytes, rename)), (true, 3));
    let mut told = bytes.clone();
    retell(&mut told, 1, 0, &NEW[0], tally(0, 1)).unwrap();
    assert_eq!(of(&told), (false, 3));
}

#[test]
fn what_is_damaged_is_reported_to_who_looks_and_says_nothing() {
    let section = |contents: &[&[u8]]| {
        changed(|bytes, _| {
            for contents in contents {
                bytes.extend([8, 0]);
                bytes.extend((contents.len() as u16).to_le_bytes());
                bytes.extend(*contents);
            }
        })
    };
    let one = [1, 1, 2, 3, 4, 5, 6];
    let falling = [1, 2, 0, 0, 0, 0, 0, 1, 9, 9, 9, 9, 9];
    let twice = [1, 2, 0, 0, 0, 0, 0, 2, 0, 0, 0, 0, 0];
    let flag = [2, 1, 2, 3, 4, 5, 6];
    let cut = [1, 1, 2, 3];
    for contents in [&falling[..], &twice, &flag, &cut, &[]] {
        let bytes = section(&[contents]);
        let table = Table::read(&bytes).unwrap();
        assert_eq!(table.check_learned(), Err(TableError::Section(8)));
        assert_eq!(table.learned_slides(), LearnedSlides::default());
        read_all(&bytes);
    }
    let bytes = section(&[&one, &one]);
    let table = Table::read(&bytes).unwrap();
    assert_eq!(table.check_learned(), Err(TableError::Section(8)));
    assert_eq!(
        Table::read(&section(&[&one])).unwrap().check_learned(),
        Ok(())
    );
    // as many as there can be, and one more
    let many = |count: usize| -> Vec<SlideHash> {
        let hash = |n: usize| {
            let [.., a, b] = (n as u64).to_be_bytes();
            [a, b, 0, 0, 0, 0]
        };
        (0..count).map(hash).collect()
    };
    let most = noted(&full(), true, &many(MAX_LEARNED)).unwrap();
    let most = Table::read(&most).unwrap();
    assert_eq!(most.learned_slides().hashes.len(), MAX_LEARNED);
    let more = noted(&full(), true, &many(MAX_LEARNED + 1));
    assert!(matches!(more, Err(EncodeError::NoSpace(_))), "{more:?}");
}
