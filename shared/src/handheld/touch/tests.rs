//! Touches of made-up signals: a finger on a spring, vibrations of noise.

use super::*;
use crate::probe::explore::Random;
use crate::sensor::pressure::Counts;
use proptest::prelude::*;
use std::vec::Vec as List;

/// P_DC in the air.
const AIR: f64 = 2610.0;

/// So long, with this force in mN and vibration in counts rms, from the first to the last.
struct Part {
    seconds: f64,
    mn: (f64, f64),
    rms: (f64, f64),
}

fn part(seconds: f64, mn: f64, rms: f64) -> Part {
    Part {
        seconds,
        mn: (mn, mn),
        rms: (rms, rms),
    }
}

/// Air, and a press of this force until the finger may slide.
fn pressed(mn: f64) -> List<Part> {
    std::vec![
        part(0.4, 0.0, 0.0),
        Part {
            seconds: 0.15,
            mn: (0.0, mn),
            rms: (20.0, 20.0),
        },
        part(0.6, mn, 0.0),
    ]
}

/// The words of all parts.
fn words(parts: &[Part]) -> List<Option<Pressure>> {
    let mut random = Random::new(5);
    let mut words = List::new();
    for part in parts {
        let slots = (part.seconds * 4400.0) as usize;
        for slot in 0..slots {
            let at = slot as f64 / slots as f64;
            let between = |(from, to): (f64, f64)| from + (to - from) * at;
            // uniform, of rms 1
            let mut noise = || (f64::from(random.next_f32()) - 0.5) * 12f64.sqrt();
            let channel = Channel::PATTERN[words.len() % 2];
            let value = match channel {
                Channel::Pac => 2041.0 + 1.5 * noise() + between(part.rms) * noise(),
                Channel::Pdc => AIR + between(part.mn) / 11.5 + 0.3 * noise(),
            };
            words.push(Some(Pressure {
                channel,
                counts: Counts::from_low_bits(value.round().clamp(0.0, 4095.0) as u16),
            }));
        }
    }
    words
}

fn feel(words: &[Option<Pressure>]) -> List<Event> {
    let plan = Plan::new();
    let mut touch = Touch::new(&plan);
    words.iter().filter_map(|word| touch.word(*word)).collect()
}

fn with(parts: List<Part>, more: List<Part>) -> List<Part> {
    parts.into_iter().chain(more).collect()
}

fn again(events: &[Event]) -> Option<Again> {
    events.iter().find_map(|event| match event {
        Event::Again(why) => Some(*why),
        _ => None,
    })
}

#[test]
fn a_good_slide_is_reported_with_its_features() {
    let slide = with(
        pressed(500.0),
        std::vec![
            part(1.6, 520.0, 40.0),
            part(0.3, 500.0, 0.0),
            part(0.3, 0.0, 0.0)
        ],
    );
    let events = feel(&words(&slide));
    let [
        Event::Zeroed,
        Event::Down,
        Event::Still,
        Event::Slid(observation),
        Event::Up,
    ] = &events[..]
    else {
        panic!("{events:?}");
    };
    // 45 counts of P_DC, in hundreds, in 1024ths
    let [mean, ln_sd] = observation.pressure.unwrap();
    assert!(
        (mean - (0.52e3 / 11.5 / 100.0 * 1024.0) as i16).abs() < 12,
        "{mean}"
    );
    // hardly any scatter: ln of half a count, and a little
    assert!((-710..0).contains(&ln_sd), "{ln_sd}");
    // white noise: the same power in every bin
    let power = f64::from(observation.bands[25]) / 1024.0;
    assert!((power - f64::ln(40.0 * 40.0 + 2.25)).abs() < 0.4, "{power}");
}

#[test]
fn slides_that_are_no_good_say_why() {
    for (why, parts) in [
        (
            Again::TooHard,
            std::vec![part(1.0, 520.0, 40.0), part(0.6, 900.0, 40.0)],
        ),
        (
            Again::TooLight,
            std::vec![part(1.0, 520.0, 40.0), part(0.6, 200.0, 40.0)],
        ),
        // it stops, or is lifted
        (
            Again::TooShort,
            std::vec![part(0.9, 520.0, 40.0), part(0.5, 520.0, 0.0)],
        ),
        (
            Again::TooShort,
            std::vec![part(0.9, 520.0, 40.0), part(0.5, 0.0, 0.0)],
        ),
        (
            Again::TooUneven,
            std::vec![
                part(0.6, 520.0, 100.0),
                part(0.6, 520.0, 14.0),
                part(0.6, 520.0, 60.0)
            ],
        ),
    ] {
        let events = feel(&words(&with(pressed(500.0), parts)));
        assert_eq!(again(&events), Some(why), "{events:?}");
        assert!(!events.iter().any(|e| matches!(e, Event::Slid(_))), "{why}");
    }
    // before the slide it only asks for a lighter press, but for a force that no person intends
    for (mn, why) in [(1100.0, None), (1700.0, Some(Again::TooHard))] {
        let events = feel(&words(&with(pressed(500.0), std::vec![part(0.3, mn, 0.0)])));
        assert_eq!(again(&events), why, "{mn}");
    }
}

#[test]
fn a_lost_word_spoils_a_slide_and_only_delays_a_press() {
    let slide = with(pressed(500.0), std::vec![part(1.6, 520.0, 40.0)]);
    let whole = words(&slide);
    let mut lost = whole.clone();
    lost[(2.0 * 4400.0) as usize] = None;
    let events = feel(&lost);
    assert_eq!(again(&events), Some(Again::Disturbed), "{events:?}");
    let mut early = whole;
    early[(0.7 * 4400.0) as usize] = None;
    let events = feel(&early);
    assert!(matches!(events.last(), Some(Event::Slid(_))), "{events:?}");
    // words that were lost on the way count as much
    let plan = Plan::new();
    let mut touch = Touch::new(&plan);
    let mut spoiled = None;
    for (n, word) in words(&slide).into_iter().enumerate() {
        if n == 8800 {
            touch.lose(3);
        }
        if let Some(Event::Again(why)) = touch.word(word) {
            spoiled = Some(why);
        }
    }
    assert_eq!(spoiled, Some(Again::Disturbed));
}

#[test]
fn a_slide_that_begins_at_a_lost_word_is_noticed() {
    let slide = with(
        pressed(500.0),
        std::vec![part(1.6, 520.0, 40.0), part(0.3, 520.0, 0.0)],
    );
    let whole = words(&slide);
    // the slide begins 1.15 s after the start
    let begins = (1.15 * 4400.0) as usize;
    for at in (begins - 440..begins + 440).step_by(20) {
        let mut lost = whole.clone();
        lost[at] = None;
        let events = feel(&lost);
        let [.., Event::Still, last] = &events[..] else {
            panic!("{at}: {events:?}");
        };
        let may = matches!(last, Event::Slid(_)) || *last == Event::Again(Again::Disturbed);
        assert!(may, "{at}: {events:?}");
        // before it begins, nothing of it is lost
        if at + 44 < begins {
            assert!(matches!(last, Event::Slid(_)), "{at}: {events:?}");
        }
    }
}

#[test]
fn only_a_press_in_the_zone_that_is_kept_still_may_slide() {
    for (mn, rms, may) in [
        (200.0, 0.0, false),
        (900.0, 0.0, false),
        (500.0, 20.0, false),
        (500.0, 0.0, true),
    ] {
        let parts = std::vec![part(0.4, 0.0, 0.0), part(1.0, mn, rms)];
        let events = feel(&words(&parts));
        assert_eq!(events.contains(&Event::Still), may, "{mn} {rms} {events:?}");
    }
}

#[test]
fn a_finger_that_was_down_when_the_power_came_is_no_zero() {
    let events = feel(&words(&with(
        std::vec![part(0.5, 600.0, 0.0), part(0.3, 0.0, 0.0)],
        with(pressed(500.0), std::vec![part(1.6, 520.0, 40.0)]),
    )));
    assert!(matches!(events.last(), Some(Event::Slid(_))), "{events:?}");
}

#[test]
fn a_sensor_that_is_silent_or_hangs_is_noticed() {
    let mut cut = words(&pressed(500.0));
    cut[1500..].fill(None);
    let events = feel(&cut);
    assert_eq!(events[..2], [Event::Zeroed, Event::Silent]);
    let mut hung = words(&pressed(500.0));
    let (pac, pdc) = (hung[1500], hung[1501]);
    for pair in hung[1500..].chunks_exact_mut(2) {
        pair.copy_from_slice(&[pac, pdc]);
    }
    assert_eq!(feel(&hung)[1], Event::Frozen);
    // at an end of its range with the noise of a count
    let counts = |n: usize| Counts::new(4092 + (n % 4) as u16).unwrap();
    for (n, pair) in hung[1500..].chunks_exact_mut(2).enumerate() {
        let pac = pair[0].map(|word| Pressure {
            counts: counts(n),
            ..word
        });
        pair[0] = pac;
    }
    assert_eq!(feel(&hung)[1], Event::Frozen);
}

proptest! {
    /// For any words, nothing panics, and a rejected slide gives no observation.
    #[test]
    fn any_words_will_do(
        parts in proptest::collection::vec(
            (0.0..0.6f64, -200.0..3000f64, -200.0..3000f64, 0.0..900f64, 0.0..0.01f64),
            1..12,
        ),
    ) {
        let mut all = words(&[part(0.3, 0.0, 0.0)]);
        for (seconds, from, to, rms, lost) in parts {
            let mut some = words(&[Part { seconds, mn: (from, to), rms: (rms, rms) }]);
            let mut random = Random::new(all.len() as u32);
            some.iter_mut().filter(|_| f64::from(random.next_f32()) < lost).for_each(|word| *word = None);
            all.extend(some);
        }
        let mut open = false;
        for event in feel(&all) {
            match event {
                Event::Still => open = true,
                // one slide of each press, at most
                Event::Slid(_) => prop_assert!(std::mem::take(&mut open)),
                Event::Again(_) | Event::Up => open = false,
                _ => {}
            }
        }
    }
}

/// Events of a probe whose sensor of motion reports every 10 ms, from the beginning of the parts: for so long, counts.
fn feel_moving(parts: &[Part], seen: &[(f64, Moved)]) -> List<Event> {
    let plan = Plan::new();
    let mut touch = Touch::new(&plan);
    let each = seen.iter();
    let mut readings = each.flat_map(|(s, moved)| std::vec![*moved; (s * 100.0) as usize]);
    let mut events = List::new();
    for (number, word) in words(parts).into_iter().enumerate() {
        if number.is_multiple_of(44) {
            touch.moved(readings.next().unwrap_or(Some([0, 0])));
        }
        events.extend(touch.word(word));
    }
    events
}

/// Of the press and of a slide that begins 1.25 s after it.
fn pressed_and_slid(rms: f64) -> List<Part> {
    with(
        pressed(500.0),
        std::vec![part(0.1, 500.0, 0.0), part(2.0, 500.0, rms)],
    )
}

#[test]
fn a_slide_that_is_seen_has_its_speed() {
    // 25.1 mm/s are 229 counts a second
    for counts in [[0, 3], [-4, 0], [2, 2]] {
        let events = feel_moving(
            &pressed_and_slid(30.0),
            &[(1.25, Some([0, 0])), (2.0, Some(counts))],
        );
        let observed = events.iter().find_map(|event| match event {
            Event::Slid(observation) => Some(observation.pace),
            _ => None,
        });
        let expected = (pace_counts(counts) / 229.0_f64).ln() * 1024.0;
        let measured = f64::from(observed.unwrap().unwrap());
        assert!(
            (measured - expected).abs() < 15.0,
            "{counts:?}: {measured} {expected}"
        );
    }
}

/// Counts of a second.
fn pace_counts([x, y]: [i16; 2]) -> f64 {
    f64::from(x).hypot(f64::from(y)) * 100.0
}

#[test]
fn a_texture_that_is_too_smooth_to_be_felt_is_noticed_where_it_is_seen() {
    let parts = pressed_and_slid(0.0);
    let slid = |events: &[Event]| events.iter().any(|event| matches!(event, Event::Slid(_)));
    assert!(!slid(&feel(&words(&parts))));
    let seen = [(1.25, Some([0, 0])), (2.0, Some([0, 2]))];
    assert!(slid(&feel_moving(&parts, &seen)));
}

#[test]
fn what_is_lively_and_does_not_move_is_no_slide() {
    let parts = pressed_and_slid(30.0);
    let events = feel_moving(&parts, &[(4.0, Some([0, 0]))]);
    let over = events
        .iter()
        .any(|event| matches!(event, Event::Slid(_) | Event::Again(_)));
    assert!(!over, "{events:?}");
    // and one that stands still again was too short, however lively it is
    let seen = [
        (1.25, Some([0, 0])),
        (0.5, Some([0, 2])),
        (2.0, Some([0, 0])),
    ];
    assert_eq!(again(&feel_moving(&parts, &seen)), Some(Again::TooShort));
}

#[test]
fn a_slide_that_is_not_seen_all_the_way_has_no_speed() {
    let parts = pressed_and_slid(30.0);
    for seen in [
        &[(4.0, None)][..],
        &[
            (1.25, Some([0, 0])),
            (0.8, Some([0, 2])),
            (0.01, None),
            (2.0, Some([0, 2])),
        ],
    ] {
        let events = feel_moving(&parts, seen);
        let observed = events.iter().find_map(|event| match event {
            Event::Slid(observation) => Some(observation.clone()),
            _ => None,
        });
        assert_eq!(observed.unwrap().pace, None, "{seen:?}");
    }
    // without any it behaves as without a sensor
    assert_eq!(feel_moving(&parts, &[(4.0, None)]), feel(&words(&parts)));
}
