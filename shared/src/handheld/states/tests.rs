//! Tests of the probe's states under any events; with made-up slides, since touches have tests of their own.

mod menu;

use super::*;
use crate::explorer::EpisodeSummary;
use crate::handheld::draw;
use crate::handheld::judge::{FEATURES, free_name, judge};
use crate::handheld::picture::Picture;
use crate::probe::explore::Random;
use crate::sensor::pressure::{Channel, Counts};
use crate::table::tests::{fused_of, known, straight};
use crate::table::{
    Drift, Drifts, EPISODES, Limits, Population, Sections, Tail, Whitened, with_sections,
};
use proptest::prelude::*;
use proptest::strategy::Strategy;
use std::vec;
use std::vec::Vec as List;

/// Four textures far apart, of all the features that a handheld has.
fn textures() -> List<List<Whitened>> {
    let far = |texture| {
        let mut mean = [0.0; 14];
        mean[texture] = 12.0;
        vec![known(5, &mean)]
    };
    (0..4).map(far).collect()
}

fn table() -> List<u8> {
    fused_of(FEATURES, &[straight(14)], &textures())
}

/// The same with limits.
fn with_limits() -> List<u8> {
    let plain = table();
    let textures = textures();
    let means = textures.iter().map(|row| (row[0].slides, &row[0].mean[..]));
    let population = Population::new(14, means).unwrap();
    let tail = Tail {
        begin: 2.0,
        excess: 1.0,
    };
    let limits = Limits {
        false_alarm: 0.02,
        drifted: [tail; EPISODES],
        same: [tail; EPISODES],
    };
    let sections = Sections {
        drift: (Drift::default(), &[Drifts::default()]),
        novelty: Some((limits, &[population])),
        slopes: None,
    };
    let mut out = vec![0; 8000];
    let table = Table::read(&plain).unwrap();
    let table = with_sections(&mut out, &table, &sections).unwrap();
    table.as_bytes().to_vec()
}

/// A slide that feels like one of them, or, for `None`, like none: as far from each as they are from each other.
fn slide(texture: Option<usize>) -> Observation {
    let mut features = [0; 14];
    match texture {
        Some(texture) => features[texture] = 12 * 1024,
        None => features[..4].fill(12 * 1024),
    }
    Observation {
        pressure: Some([features[0], features[1]]),
        bands: Vec::from_slice(&features[2..]).unwrap(),
        ..Observation::default()
    }
}

/// A probe, its table, and the name that was learned.
struct Bench<'p> {
    probe: Handheld<'p>,
    table: List<u8>,
    learned: List<(Choice, u8)>,
    episode: Option<EpisodeSummary>,
    /// Every texture in the table counts as changed.
    changed: bool,
}

impl<'p> Bench<'p> {
    fn new(plan: &'p Plan) -> Self {
        Self {
            probe: Handheld::new(plan, 4),
            table: table(),
            learned: List::new(),
            episode: None,
            changed: false,
        }
    }

    fn judge(
        &self,
        slides: &[Observation],
        reference: Option<u16>,
    ) -> Result<(Judgement, EpisodeSummary), JudgeError> {
        let table = Table::read(&self.table).unwrap();
        judge(table, slides, reference, None)
    }

    fn work(&mut self) {
        let table = Table::read(&self.table).unwrap();
        match self.probe.job() {
            None => {}
            Some(Job::Judge { slides, reference }) => match self.judge(&slides, reference) {
                Ok((mut judgement, episode)) => {
                    self.episode = Some(episode);
                    judgement.changed |= self.changed;
                    self.probe.judged(Ok(judgement));
                }
                Err(why) => self.probe.judged(Err(why)),
            },
            Some(Job::Teach(choice)) => {
                let slides = self.episode.take().unwrap().observed[0].1;
                self.learned.push((choice, slides));
                self.probe.learned(Ok(free_name(&table)), 4);
            }
        }
    }

    fn press(&mut self, ticks: u32) {
        (0..ticks).for_each(|_| self.tick(true));
        (0..5).for_each(|_| self.tick(false));
    }

    fn tick(&mut self, pressed: bool) {
        self.probe.silent = 0;
        self.probe.tick(pressed);
        self.work();
    }

    fn touch(&mut self, slid: Event) {
        for event in [Event::Down, Event::Still, slid, Event::Up] {
            self.probe.on_touch(event);
            self.work();
        }
    }

    fn slide(&mut self, texture: Option<usize>) {
        self.touch(Event::Slid(slide(texture)));
    }

    fn verdict(&self) -> &Judgement {
        assert_eq!(self.probe.page, Page::Verdict);
        self.probe.judgement.as_ref().unwrap()
    }

    /// The first words of the screen.
    fn shown(&self) -> std::string::String {
        let table = Table::read(&self.table).unwrap();
        let screen = self.probe.screen(Some(&table), &About::default());
        let mut picture = Picture::new();
        let Ok(()) = draw(&screen, &mut picture);
        let words = std::format!("{screen:?}");
        words.split([' ', '(']).next().unwrap().into()
    }
}

#[test]
fn a_known_texture_is_recognised_and_the_next_episode_begins_anew() {
    let plan = Plan::new();
    let mut bench = Bench::new(&plan);
    assert_eq!(bench.shown(), "Air");
    for texture in [2, 0] {
        bench.slide(Some(texture));
        assert_eq!(bench.shown(), "Verdict");
        let judgement = bench.verdict();
        assert!(judgement.sure && !judgement.unknown);
        assert_eq!(usize::from(judgement.leading[0].0), texture);
        assert_eq!(bench.probe.episode.len(), 1);
    }
    bench.press(10);
    assert!(bench.probe.episode.is_empty());
    assert_eq!(bench.learned, []);
}

#[test]
fn an_unknown_one_is_said_to_be_and_can_be_named() {
    let plan = Plan::new();
    let mut bench = Bench::new(&plan);
    bench.slide(None);
    bench.slide(None);
    assert_eq!(bench.shown(), "Unknown");
    bench.press(70);
    assert_eq!(bench.shown(), "Choose");
    // the three leading ones, then a number
    (0..3).for_each(|_| bench.press(10));
    bench.press(70);
    assert_eq!(bench.learned, [(Choice::Numbered, 2)]);
    assert_eq!(bench.shown(), "Learned");
    (0..LEARNED).for_each(|_| bench.tick(false));
    assert_eq!(bench.shown(), "Air");
}

#[test]
fn a_changed_one_is_moved_by_yes_and_named_anew_after_no() {
    let plan = Plan::new();
    let mut bench = Bench::new(&plan);
    bench.changed = true;
    bench.slide(Some(2));
    assert_eq!(bench.shown(), "Changed");
    // yes
    bench.press(70);
    assert_eq!(bench.learned, [(Choice::Known(2), 1)]);
    assert_eq!(bench.shown(), "Learned");
    (0..LEARNED).for_each(|_| bench.tick(false));
    bench.learned.clear();
    bench.slide(Some(1));
    // no: the list begins with a new one
    bench.press(10);
    assert_eq!(
        (bench.shown(), &bench.learned[..]),
        ("Choose".into(), &[][..])
    );
    bench.press(70);
    assert_eq!(bench.learned, [(Choice::Numbered, 1)]);
    (0..LEARNED).for_each(|_| bench.tick(false));
    bench.learned.clear();
    // neither: the next slide is of another sample
    bench.slide(Some(1));
    bench.slide(Some(3));
    assert_eq!(bench.shown(), "Changed");
    assert_eq!(bench.verdict().leading[0].0, 3);
    assert_eq!(bench.learned, []);
    // an unknown one is not asked about
    (0..2).for_each(|_| bench.slide(None));
    assert_eq!(bench.shown(), "Unknown");
}

#[test]
fn names_are_spelled() {
    let plan = Plan::new();
    let mut bench = Bench::new(&plan);
    bench.slide(Some(1));
    bench.press(70);
    (0..4).for_each(|_| bench.press(10));
    bench.press(70);
    assert_eq!(bench.shown(), "Spell");
    // b, then back over the wheel's end to OK
    bench.press(10);
    bench.press(70);
    (0..36).for_each(|_| bench.press(10));
    bench.press(70);
    let spelled = Choice::Spelled(Name::try_from("b").unwrap());
    assert_eq!(bench.learned, [(spelled, 1)]);
}

#[test]
fn a_training_takes_three_good_slides() {
    let plan = Plan::new();
    let mut bench = Bench::new(&plan);
    bench.press(70);
    assert_eq!(bench.shown(), "Press");
    bench.slide(Some(3));
    bench.touch(Event::Again(Again::TooHard));
    bench.slide(Some(3));
    assert_ne!(bench.shown(), "Choose");
    (0..AGAIN).for_each(|_| bench.tick(false));
    bench.slide(Some(3));
    assert_eq!(bench.shown(), "Choose");
    bench.press(70);
    assert_eq!(bench.learned, [(Choice::Known(3), 3)]);
}

fn choose_reference(bench: &mut Bench<'_>, texture: u16) {
    bench.press(10);
    bench.press(70);
    (0..texture).for_each(|_| bench.press(10));
    bench.press(70);
}

#[test]
fn who_is_not_sure_is_asked_to_slide_again_and_five_slides_are_the_end() {
    let plan = Plan::new();
    let mut bench = Bench::new(&plan);
    bench.table = with_limits();
    choose_reference(&mut bench, 0);
    // for any slides
    let unsure = |open| Judgement {
        leading: [(0, 1.0)].into_iter().collect(),
        open,
        ..Judgement::default()
    };
    for slides in 1..=ASK_AFTER {
        for event in [Event::Down, Event::Still, Event::Slid(slide(Some(0)))] {
            bench.probe.on_touch(event);
        }
        let Some(Job::Judge {
            slides: all,
            reference: Some(0),
        }) = bench.probe.job()
        else {
            panic!("nothing to judge");
        };
        assert_eq!(all.len(), slides);
        bench.probe.judged(Ok(unsure(slides < ASK_AFTER)));
        bench.probe.on_touch(Event::Up);
        assert_eq!(
            (bench.shown().as_str(), bench.probe.go().is_some()),
            ("Compared", true)
        );
    }
    // the next one is another sample
    bench.probe.on_touch(Event::Down);
    assert!(bench.probe.episode.is_empty());
}

/// After five slides the leading one is shown, and more slides of the same episode may follow, up to ten; or the button
/// ends it.
#[test]
fn who_is_not_sure_after_five_slides_may_go_on_to_ten_or_end_it() {
    let plan = Plan::new();
    let judgement = |open| Judgement {
        leading: [(0, 0.6), (1, 0.3), (2, 0.1)].into_iter().collect(),
        open,
        ..Judgement::default()
    };
    let slide_once = |bench: &mut Bench<'_>, slides: usize| {
        bench.probe.on_touch(Event::Down);
        let asked = match bench.probe.screen(None, &About::default()) {
            Screen::Press { slide, of, .. } => (usize::from(slide), of),
            other => panic!("{other:?}"),
        };
        assert_eq!(asked, (slides, if slides <= ASK_AFTER { 5 } else { 10 }));
        bench.probe.on_touch(Event::Still);
        bench.probe.on_touch(Event::Slid(slide(Some(0))));
        let Some(Job::Judge { slides: all, .. }) = bench.probe.job() else {
            panic!("nothing to judge");
        };
        assert_eq!(all.len(), slides);
        bench.probe.judged(Ok(judgement(slides < MAX_SLIDES)));
        bench.probe.on_touch(Event::Up);
    };
    for end_after in [ASK_AFTER, 7, MAX_SLIDES] {
        let mut bench = Bench::new(&plan);
        for slides in 1..=end_after {
            slide_once(&mut bench, slides);
            let screen = bench.probe.screen(None, &About::default());
            let Screen::Verdict { rows, sure, open } = screen else {
                assert!(slides < ASK_AFTER, "{screen:?}");
                continue;
            };
            assert!(slides >= ASK_AFTER && !sure);
            assert_eq!(
                (open, rows.len()),
                if slides < MAX_SLIDES {
                    (true, 2)
                } else {
                    (false, 3)
                }
            );
        }
        if end_after < MAX_SLIDES {
            bench.press(10);
            assert_eq!(bench.probe.page, Page::Ready);
        }
        // the next one is another sample
        bench.probe.on_touch(Event::Down);
        assert!(bench.probe.episode.is_empty());
    }
    // and it can be taught at once
    let mut bench = Bench::new(&plan);
    (1..=ASK_AFTER).for_each(|slides| slide_once(&mut bench, slides));
    bench.press(70);
    assert_eq!(bench.probe.page, Page::Choose(super::List::Name, 0));
}

#[test]
fn a_table_without_limits_cannot_tell_same_from_different() {
    let plan = Plan::new();
    let mut bench = Bench::new(&plan);
    choose_reference(&mut bench, 1);
    for event in [Event::Down, Event::Still, Event::Slid(slide(Some(1)))] {
        bench.probe.on_touch(event);
    }
    bench.work();
    assert_eq!(bench.shown(), "Fault");
    assert!(!bench.probe.listens());
    bench.press(10);
    assert_eq!(bench.probe.page, Page::Ready);
}

#[test]
fn faults_show_and_go() {
    let plan = Plan::new();
    let mut bench = Bench::new(&plan);
    (0..NO_WORDS).for_each(|_| bench.probe.tick(false));
    assert_eq!(bench.shown(), "Fault");
    bench.probe.on_touch(Event::Zeroed);
    assert_eq!(bench.probe.page, Page::Ready);
    bench.slide(None);
    bench.probe.on_touch(Event::Silent);
    assert_eq!(bench.shown(), "Fault");
    assert!(bench.probe.episode.is_empty() && bench.probe.listens());
    bench.probe.memory_failed("worn");
    assert!(!bench.probe.listens());
    bench.press(10);
    assert_eq!(bench.probe.page, Page::Ready);
}

#[test]
fn it_goes_dark_and_wakes_by_the_button() {
    let plan = Plan::new();
    let mut bench = Bench::new(&plan);
    (0..DARK_AFTER).for_each(|_| bench.tick(false));
    assert_eq!(bench.shown(), "Dark");
    assert!(!bench.probe.listens());
    bench.press(10);
    assert_eq!(bench.shown(), "Air");
    assert!(bench.probe.listens());
    bench.press(10);
    assert_eq!(bench.shown(), "Choose");
    assert!(!bench.probe.listens());
}

#[test]
fn melodies_end() {
    let plan = Plan::new();
    let mut bench = Bench::new(&plan);
    bench.slide(Some(1));
    assert!(bench.probe.tone().is_some());
    (0..100).for_each(|_| bench.tick(false));
    assert_eq!(bench.probe.tone(), None);
}

/// Events of a probe.
#[derive(Clone, Debug)]
enum Happens {
    Touched(u8),
    Slid(u8),
    Words(u16, u16),
    Lost(u32),
    Ticks(bool, u8),
    Judged(u16, bool, bool, bool),
    Learned(bool, u16),
    Broken,
}

fn happens() -> impl Strategy<Value = Happens> {
    prop_oneof![
        4 => (0u8..12).prop_map(Happens::Touched),
        4 => (0u8..6).prop_map(Happens::Slid),
        1 => (any::<u16>(), 0u16..2000).prop_map(|(seed, n)| Happens::Words(seed, n)),
        1 => any::<u32>().prop_map(Happens::Lost),
        6 => (any::<bool>(), 0u8..120).prop_map(|(pressed, n)| Happens::Ticks(pressed, n)),
        2 => (any::<u16>(), any::<bool>(), any::<bool>(), any::<bool>())
            .prop_map(|(t, a, b, c)| Happens::Judged(t, a, b, c)),
        2 => (any::<bool>(), any::<u16>()).prop_map(|(ok, n)| Happens::Learned(ok, n)),
        1 => Just(Happens::Broken),
    ]
}

proptest! {
    /// Nothing panics, everything can be drawn, and only good slides are judged and learned from.
    #[test]
    fn whatever_happens_only_good_slides_count(steps in proptest::collection::vec(happens(), 1..80)) {
        let plan = Plan::new();
        let mut probe = Handheld::new(&plan, 4);
        let bytes = table();
        let table = Table::read(&bytes).unwrap();
        let mut good: List<Observation> = List::new();
        let mut judged = false;
        let mut random = Random::new(1);
        for step in steps {
            match step {
                Happens::Touched(which) => probe.on_touch(match which {
                    0 => Event::Zeroed,
                    1..=3 => Event::Down,
                    4 => Event::Still,
                    5..=7 => Event::Up,
                    8 => Event::Silent,
                    9 => Event::Frozen,
                    10 => Event::Again(Again::TooHard),
                    _ => Event::Again(Again::TooUneven),
                }),
                Happens::Slid(which) => {
                    // each its own
                    let mut slide = slide(usize::from(which).checked_sub(2));
                    slide.bands[11] = good.len() as i16;
                    good.push(slide.clone());
                    probe.on_touch(Event::Slid(slide));
                }
                Happens::Words(seed, n) => {
                    let mut random = Random::new(seed.into());
                    for slot in 0..n {
                        let channel = Channel::PATTERN[usize::from(slot % 2)];
                        let counts = Counts::from_low_bits((f64::from(random.next_f32()) * 4096.0) as u16);
                        let word = (f64::from(random.next_f32()) > 0.01).then_some(Pressure { channel, counts });
                        probe.word(word);
                    }
                }
                Happens::Lost(words) => probe.lose(words),
                Happens::Ticks(pressed, n) => (0..n).for_each(|_| probe.tick(pressed)),
                Happens::Judged(texture, sure, unknown, open) => {
                    let leading = (0..3).map(|n| (texture.wrapping_add(n), random.next_f32()));
                    let leading = leading.collect();
                    probe.judged(Ok(Judgement { leading, sure, unknown, open, changed: sure && !open }));
                    judged = true;
                }
                Happens::Learned(ok, textures) => {
                    let name = if ok { Ok(free_name(&table)) } else { Err("no") };
                    probe.learned(name, textures);
                }
                Happens::Broken => probe.memory_failed("broken"),
            }
            match probe.job() {
                Some(Job::Judge { slides, .. }) => {
                    prop_assert!(!slides.is_empty());
                    prop_assert!(slides.iter().all(|slide| good.contains(slide)));
                    judged = false;
                }
                Some(Job::Teach(_)) => prop_assert!(judged, "learned from what nobody judged"),
                None => {}
            }
            let screen = probe.screen(Some(&table), &About::default());
            let mut picture = Picture::new();
            let Ok(()) = draw(&screen, &mut picture);
            probe.screen(None, &About::default());
            prop_assert!(probe.episode.len() <= good.len());
        }
    }
}
