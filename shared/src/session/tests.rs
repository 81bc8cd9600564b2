use super::*;
use crate::features::{Property, PropertySet};
use crate::rig::pins::MAX_WORDS;
use crate::table::tests::{around, table_of};
use embassy_futures::block_on;
use std::format;
use std::string::String;
use std::vec;

/// A rig on which every texture has the traction that comes next, in mN; none is a slide without samples.
struct Script(std::collections::VecDeque<Option<i16>>);

impl Rig for Script {
    type Error = &'static str;

    fn measures(&self) -> PropertySet {
        [Property::Traction].into_iter().collect()
    }

    async fn perform<K: Kernels>(
        &mut self,
        _: Movement,
        slide: &mut Slide<'_, K>,
    ) -> Result<(), Self::Error> {
        let Some(traction) = self.0.pop_front().ok_or("the lever fell off")? else {
            return Ok(());
        };
        slide.set_background(2.0);
        slide.start(0..600);
        slide.push(&core::array::from_fn::<i16, 600, _>(|n| {
            ((n * 37) % 101) as i16
        }));
        slide.push_shear(&[traction; 10]);
        Ok(())
    }
}

fn table() -> vec::Vec<u8> {
    let row = |mean| vec![around([(mean, 0.3); 3])];
    table_of(PropertySet::ALL, &[row(1.0), row(2.0), row(3.0)])
}

fn wanted(among: &[u16]) -> Identify {
    Identify {
        among: Vec::from_slice(among).unwrap(),
        threshold: 0.99,
        max_slides: 3,
        method: Some(Method::Paper),
        strategy: crate::explorer::Strategy::Bayesian,
        open: false,
        learn: false,
        seed: 1,
    }
}

fn identified(slides: &[Option<i16>], wanted: &Identify) -> (Result<(), Text>, vec::Vec<String>) {
    let bytes = table();
    let mut told = vec::Vec::new();
    let result = block_on(identify::<_, crate::kernels::Plain>(
        wanted,
        &mut Script(slides.iter().copied().collect()),
        Table::read(&bytes).unwrap(),
        &Plan::new(),
        |tell| {
            told.push(match tell {
                Tell::Chosen { slide, outlook, .. } => {
                    format!("chosen {slide} of {}", outlook.len())
                }
                Tell::Felt {
                    slide, posterior, ..
                } => format!("felt {slide} {posterior:.2?}"),
                Tell::Rejected { slide, why } => format!("rejected {slide}: {why}"),
                Tell::Verdict {
                    name, sure, slides, ..
                } => format!("{name} {sure} {slides}"),
                other => format!("{other:?}"),
            });
        },
    ));
    (result.map(|_| ()), told)
}

#[test]
fn an_exploration_is_told_from_beginning_to_end() {
    let (result, told) = identified(&[None, Some(2100), Some(2000)], &wanted(&[]));
    assert_eq!(result, Ok(()));
    assert_eq!(
        told,
        [
            "chosen 1 of 1",
            "rejected 1: the slide never reached its steady part",
            "chosen 1 of 1",
            "felt 1 [0.00, 0.99, 0.01]",
            "chosen 2 of 1",
            "felt 2 [0.00, 1.00, 0.00]",
            "t1 true 2",
        ]
    );
}

#[test]
fn of_a_pair_only_one_can_be_the_answer() {
    let (result, told) = identified(&[Some(2000); 3], &wanted(&[0, 2]));
    assert_eq!(result, Ok(()));
    assert!(told.iter().all(|line| !line.starts_with("t1")), "{told:?}");
    assert!(told[1].ends_with("0.00, 0.50]"), "{told:?}");
}

#[test]
fn what_goes_wrong_is_said() {
    assert_eq!(
        identified(&[], &wanted(&[])).0.unwrap_err(),
        "the lever fell off"
    );
    let error = identified(&[], &wanted(&[7])).0.unwrap_err();
    assert!(error.contains("not textures of the table"), "{error}");
}

#[test]
fn a_long_sentence_is_cut_at_a_character() {
    let cut = text("ä".repeat(100));
    assert_eq!(cut.len(), 120);
    assert_eq!(cut, text("ä".repeat(60)));
    assert_eq!(text(format_args!("{}{}", "x".repeat(119), "ä")).len(), 119);
}

#[test]
fn random_numbers_are_spread() {
    for seed in [0, 1, u32::MAX] {
        let mut random = Random::new(seed);
        let mut bins = [0; 10];
        for _ in 0..10_000 {
            let x = random.next_f32();
            assert!((0.0..1.0).contains(&x));
            bins[(x * 10.0) as usize] += 1;
        }
        // 1000 with a standard deviation of 30
        assert!(bins.iter().all(|n| (850..1150).contains(n)), "{bins:?}");
    }
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
