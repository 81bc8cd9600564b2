//! Reports that no probe makes.

use super::*;

fn slide_report(change: impl FnOnce(&mut wire::SlideReport), posterior: &[f32]) -> Event {
    let mut observed = wire::SlideReport {
        properties: [Some(0.4), Some(3.0), None],
        background: 2.0,
        ..wire::SlideReport::default()
    };
    change(&mut observed);
    Event::SlideReport {
        slide: 1,
        action: tactus_core::table::Action {
            movement: 0,
            property: None,
        },
        observed,
        posterior: posterior.iter().copied().collect(),
    }
}

fn verdict(change: impl FnOnce(&mut Verdict)) -> Event {
    let mut verdict = Verdict {
        texture: 1,
        name: Name::try_from("cork").unwrap(),
        probability: 0.995,
        sure: true,
        log_odds: Some(-7.5),
        slides: 3,
        ..Verdict::default()
    };
    change(&mut verdict);
    Event::Verdict(verdict)
}

/// Whole frames with a right checksum, of a probe that is broken, or hostile.
#[test]
fn reports_that_no_probe_makes_are_damaged_ones() {
    let name = |name: &str| Name::try_from(name).unwrap();
    let learned = |texture: &str| {
        Event::TextureLearned(TextureLearned {
            name: name(texture),
            slides: 3,
            itself: true,
        })
    };
    let said = |text: &str| Failure::Said(wire::text(text));
    let part = |offset, length, bytes: usize| Event::TablePart {
        offset,
        length,
        bytes: vec![0; bytes].into_iter().collect(),
    };
    let steady = |steady| {
        Event::Block(Block {
            number: 0,
            still: false,
            steady: Some(steady),
            pac: [1; 64].into_iter().collect(),
            ..Block::default()
        })
    };
    let good = [
        steady((264, 13_200)),
        verdict(|_| ()),
        verdict(|v| (v.probability, v.log_odds) = (1.0, None)),
        verdict(|v| v.name = name("Ölpapier 2 µm")),
        slide_report(|_| (), &[0.25, 0.75]),
        slide_report(|o| o.properties = [None; 3], &[]),
        learned("cork"),
        part(256, 300, 44),
        part(0, 512, PART),
        Event::Trouble(said("press the button")),
        Event::Weighed {
            mn: 1,
            counts: -3.5,
        },
    ];
    let bad = [
        verdict(|v| v.probability = f32::NAN),
        verdict(|v| v.probability = 2.0),
        verdict(|v| v.probability = -0.5),
        verdict(|v| v.log_odds = Some(f32::INFINITY)),
        verdict(|v| v.texture = 5000),
        verdict(|v| v.name = name("\u{1b}]0;evil\u{7}")),
        verdict(|v| v.name = name("a\u{202e}b")),
        verdict(|v| v.name = name("")),
        slide_report(|_| (), &[f32::INFINITY, 0.5]),
        slide_report(|_| (), &[1.5]),
        slide_report(|_| (), &[0.9, 0.9]),
        slide_report(|o| o.background = -1.0, &[1.0]),
        slide_report(|o| o.background = f32::NAN, &[1.0]),
        slide_report(|o| o.properties[1] = Some(f32::INFINITY), &[1.0]),
        learned("a\nb"),
        part(0, u32::MAX, PART),
        part(4096, 4000, PART),
        part(u32::MAX, 300, 1),
        // a byte a part would take hours
        part(0, 300, 1),
        Event::Trouble(said("\u{1b}[2J")),
        Event::Refused {
            id: 0,
            why: Failure::Memory(wire::MemoryError::Unknown(name("a\rb"))),
        },
        Event::Weighed {
            mn: 1,
            counts: f32::NAN,
        },
        Event::Turned {
            g_counts: f32::NAN,
            offset_counts: 0.0,
        },
        // a count would be an infinite acceleration
        Event::Turned {
            g_counts: 0.0,
            offset_counts: 0.0,
        },
        steady((8000, 7000)),
        // two months of silence before it
        steady((4_000_000_000, 4_000_000_001)),
    ];
    for (event, is_good) in good
        .map(|e| (e, true))
        .into_iter()
        .chain(bad.map(|e| (e, false)))
    {
        let frame = Probe::default().event(event.clone());
        let (mut session, mut send) = (Session::default(), Vec::new());
        let reports = session.receive(&frame);
        let damaged = u64::from(!is_good);
        assert_eq!(
            (reports.len() == 1, session.damaged()),
            (is_good, damaged),
            "{event:?}"
        );
        let request = Request::command(Command::Home);
        let mut job = Job::begin(request, &mut session, &mut send).unwrap();
        let polled = job.poll(&mut session, &frame, &mut send, |_| ());
        let is_refused = matches!(polled, Poll::Ready(Err(LinkError::Impossible(_))));
        assert_eq!(is_refused, !is_good, "{event:?}");
    }
}
