use super::*;
use crate::rig::pins::MAX_WORDS;
use std::vec;

#[test]
fn a_long_sentence_is_cut_at_a_character() {
    let cut = text("ä".repeat(100));
    assert_eq!(cut.len(), 120);
    assert_eq!(cut, text("ä".repeat(60)));
    assert_eq!(text(format_args!("{}{}", "x".repeat(119), "ä")).len(), 119);
}

#[test]
fn blocks_hold_every_sample_in_its_order() {
    let mut blocks = Blocks::default();
    let mut sent = vec::Vec::new();
    let mut next = 0_i16;
    let mut samples = |n: usize| -> vec::Vec<i16> {
        let from = next;
        next += n as i16;
        (from..next).collect()
    };
    for _ in 0..70 {
        sent.extend(blocks.put(&Felt::Still, &samples(3), None));
    }
    sent.extend(blocks.put(&Felt::Nothing, &[], None));
    sent.extend(blocks.put(&Felt::Begin(440..900), &samples(2), None));
    for ms in 0..200 {
        sent.extend(blocks.put(&Felt::Slide, &samples(2), Some(ms)));
    }
    sent.extend(blocks.put(&Felt::Slide, &samples(MAX_WORDS), Some(200)));
    sent.push(blocks.end(5));
    assert!(
        sent.iter()
            .enumerate()
            .all(|(n, b)| usize::from(b.number) == n)
    );
    let pac: vec::Vec<i16> = sent.iter().flat_map(|b| b.pac.iter().copied()).collect();
    assert_eq!(pac, (0..next).collect::<vec::Vec<_>>());
    let shear: vec::Vec<i16> = sent
        .iter()
        .flat_map(|b| b.shear_mn.iter().copied())
        .collect();
    assert_eq!(shear, (0..=200).collect::<vec::Vec<_>>());
    let still: usize = sent.iter().filter(|b| b.still).map(|b| b.pac.len()).sum();
    assert_eq!(still, 210);
    let steady: vec::Vec<_> = sent.iter().filter_map(|b| b.steady).collect();
    assert_eq!(steady, [(440, 900)]);
    assert!(
        sent.iter()
            .find(|b| !b.still)
            .is_some_and(|b| b.steady.is_some())
    );
    assert_eq!(sent.iter().map(|b| b.lost).sum::<u32>(), 5);
}
