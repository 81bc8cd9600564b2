//! The menu, and the comparison with a texture that was chosen.

use super::*;

/// From the ready page to the touch that is compared with a texture.
#[test]
fn the_menu_leads_to_everything() {
    let plan = Plan::new();
    let mut bench = Bench::new(&plan);
    for (entry, page) in [(1, "About"), (2, "Air")] {
        bench.press(10);
        assert_eq!(bench.shown(), "Choose");
        (0..entry).for_each(|_| bench.press(10));
        bench.press(70);
        assert_eq!(bench.shown(), page, "{entry}");
        bench.press(10);
        if page != "Air" {
            assert_eq!(bench.shown(), "Air", "{entry}");
        } else {
            // the last press was on the ready page
            bench.press(10);
        }
        while bench.probe.page != Page::Ready {
            bench.press(70);
        }
    }
}

#[test]
fn a_texture_is_compared_with_one_that_was_chosen() {
    let plan = Plan::new();
    let mut bench = Bench::new(&plan);
    bench.table = with_limits();
    choose_reference(&mut bench, 2);
    assert_eq!(
        (bench.shown().as_str(), bench.probe.go()),
        ("Press", Some(false))
    );
    // a touch without result ends nothing
    for event in [Event::Down, Event::Up] {
        bench.probe.on_touch(event);
    }
    bench.touch(Event::Again(Again::TooHard));
    (0..AGAIN).for_each(|_| bench.tick(false));
    bench.slide(Some(2));
    let same = |bench: &Bench<'_>| {
        let table = Table::read(&bench.table).unwrap();
        match bench.probe.screen(Some(&table), &About::default()) {
            Screen::Compared { same, open, .. } => Some((same, open)),
            _ => None,
        }
    };
    assert_eq!(same(&bench), Some((Some(true), false)));
    assert_eq!((bench.probe.go(), bench.probe.go()), (Some(true), None));
    // the next sample: the output is off before its slide
    bench.probe.on_touch(Event::Down);
    assert_eq!(
        (bench.shown().as_str(), bench.probe.go()),
        ("Press", Some(false))
    );
    bench.slide(Some(1));
    assert_eq!(same(&bench), Some((Some(false), false)));
    assert_eq!(bench.probe.go(), Some(false));
    assert_eq!(bench.probe.episode.len(), 1);
    // another reference: the list begins with the last one
    bench.press(70);
    assert_eq!(
        bench.probe.page,
        Page::Choose(super::super::List::Reference, 2)
    );
    (0..4).for_each(|_| bench.press(10));
    bench.press(70);
    bench.slide(Some(1));
    assert_eq!(same(&bench), Some((Some(true), false)));
    // and the end of it: nothing was learned
    bench.press(10);
    assert_eq!(bench.probe.page, Page::Ready);
    bench.slide(Some(3));
    assert_eq!(bench.shown(), "Verdict");
    assert_eq!(bench.learned, []);
}
