//! Textures that the table does not have, and learning by itself.

use super::*;

/// Five textures on the axes, six standard deviations out.
#[test]
fn what_no_texture_is_like_is_unknown_after_two_slides() {
    let bytes = axes();
    // far from all: log-odds over 2 at once
    let mut explorer = fused(&bytes, OPEN);
    explorer.observe(look(0), &at(&[4.0, -4.0, -4.0])).unwrap();
    assert!(
        explorer.log_odds().unwrap() > 2.0,
        "{:?}",
        explorer.log_odds()
    );
    assert_eq!(explorer.verdict(), None, "one slide is not enough");
    assert!(explorer.best().unknown);
    explorer.observe(look(1), &at(&[4.0, -4.0, -4.0])).unwrap();
    let verdict = explorer.verdict().unwrap();
    assert!(verdict.unknown && !verdict.sure && !explorer.is_certain());
    assert_eq!(verdict.log_odds, explorer.log_odds());
    // nearer: over 1.5, and only later than the first slide that is enough
    let mut explorer = fused(&bytes, OPEN);
    explorer.observe(look(0), &at(&[4.0, -2.16, -1.5])).unwrap();
    let log_odds = explorer.log_odds().unwrap();
    assert!(
        (1.0..2.0).contains(&log_odds) && !explorer.best().unknown,
        "{log_odds}"
    );
    explorer.observe(look(0), &at(&[4.0, -2.16, -1.5])).unwrap();
    let log_odds = explorer.log_odds().unwrap();
    assert!(log_odds > 1.5, "{log_odds}");
    assert!(explorer.verdict().unwrap().unknown);
}

#[test]
fn what_may_be_unknown_is_not_sure() {
    let bytes = axes();
    let beyond = at(&[12.0, -2.0, 0.0]);
    let mut open = fused(&bytes, OPEN);
    let mut closed = fused(&bytes, CLOSED);
    for explorer in [&mut open, &mut closed] {
        explorer.observe(look(0), &beyond).unwrap();
        assert!(explorer.posterior()[0] > 0.99 && explorer.log_odds().unwrap() > 2.0);
        assert!(!explorer.is_certain());
    }
    assert_eq!((open.best().sure, open.verdict()), (false, None));
    let verdict = closed.verdict().unwrap();
    assert_eq!(
        (verdict.texture, verdict.sure, verdict.unknown),
        (0, true, false)
    );
    // closed never says so, however far
    for z in [[30.0; 3], [-30.0, 30.0, 0.0]] {
        for movement in [0, 1, 0] {
            closed.observe(look(movement), &at(&z)).unwrap();
            assert!(closed.log_odds().unwrap() > 2.0 && !closed.best().unknown);
        }
    }
    // open it stays so until the last slide, and a slide that fits does away with it
    open.restart();
    open.observe(look(0), &beyond).unwrap();
    for _ in 0..6 {
        open.observe(look(0), &at(&[5.0, 0.5, 0.0])).unwrap();
    }
    let verdict = open.verdict().unwrap();
    assert_eq!(
        (verdict.texture, verdict.sure, verdict.unknown),
        (0, true, false)
    );
}

#[test]
fn a_name_that_new_textures_too_often_get_is_not_told_as_sure() {
    let plain = axes();
    for (named, config, kind) in [
        ([0.1, 0.0, 1.0], OPEN, VerdictKind::Sure),
        ([0.2, 0.1, 0.5], OPEN, VerdictKind::Sure),
        ([0.2, 0.1, 0.51], OPEN, VerdictKind::MostLike),
        ([0.2, 0.11, 0.4], OPEN, VerdictKind::MostLike),
        ([0.2, 0.11, 0.4], CLOSED, VerdictKind::Sure),
    ] {
        let bytes = naming_new(&plain, named);
        let mut explorer = fused(&bytes, config);
        explorer.observe(look(0), &at(&[6.0, 0.0, 0.0])).unwrap();
        let verdict = explorer.verdict().unwrap();
        assert_eq!((verdict.texture, verdict.kind()), (0, kind));
        let is_sure = kind == VerdictKind::Sure;
        assert_eq!((verdict.sure, verdict.most_like), (is_sure, !is_sure));
        assert_eq!(explorer.is_certain(), is_sure);
    }
}

#[test]
fn it_learns_by_itself_only_where_it_is_certain() {
    let bytes = axes();
    let after = |z: [f64; 3], threshold| {
        let mut explorer = fused(&bytes, Config { threshold, ..OPEN });
        assert!(!explorer.is_certain(), "before the first slide");
        explorer.observe(look(0), &at(&z)).unwrap();
        let best = explorer.best();
        (
            explorer.is_certain(),
            best.sure,
            explorer.log_odds().unwrap(),
        )
    };
    let (certain, sure, log_odds) = after([6.0, 0.0, 0.0], 0.99);
    assert!(certain && sure && log_odds < -2.0, "{log_odds}");
    let (certain, sure, log_odds) = after([4.5, -1.0, -0.5], 0.99);
    assert!(
        !certain && sure && (-2.0..0.0).contains(&log_odds),
        "{log_odds}"
    );
    let (certain, sure, log_odds) = after([6.0, 0.0, 0.0], 0.999_999);
    assert!(!certain && !sure && log_odds < -2.0, "{log_odds}");
    // never by properties alone
    let row = |mean| vec![around([(mean, 0.1); 3])];
    let bytes = table_of(PropertySet::ALL, &[row(0.0), row(2.0), row(4.0), row(6.0)]);
    for method in [Method::Paper, Method::Student, Method::StudentAll] {
        let mut explorer = fused(&bytes, Config { method, ..OPEN });
        for _ in 0..5 {
            let outcomes = explorer.expected_outcomes();
            explorer.observe(outcomes[0].action, &all(2.0)).unwrap();
        }
        assert!(explorer.best().probability > 0.99, "{method:?}");
        assert!(!explorer.is_certain() && explorer.log_odds().is_none());
        assert_eq!(explorer.observed().count(), 0);
    }
}

#[test]
fn it_learns_from_two_slides_that_agree() {
    let bytes = axes();
    let learn = Config {
        learn: true,
        ..OPEN
    };
    let after_of = |bytes: &[u8], slides: &[[f64; 3]], config| {
        let mut explorer = fused(bytes, config);
        for z in slides {
            assert!(!explorer.may_learn() && explorer.verdict().is_none());
            explorer.observe(look(0), &at(z)).unwrap();
        }
        (explorer.may_learn(), explorer.verdict().is_some())
    };
    let after = |slides: &[[f64; 3]], config| after_of(&bytes, slides, config);
    let own = [6.0, 0.2, 0.0];
    assert_eq!(after(&[own], learn), (false, false));
    assert_eq!(after(&[own, own], learn), (true, true));
    assert_eq!(
        after(&[own], OPEN),
        (false, true),
        "it need not make another"
    );
    // nor where the table would name too many new textures
    let named = naming_new(&bytes, [0.11, 0.0, 1.0]);
    assert_eq!(after_of(&named, &[own, own], learn), (false, true));
    // both together are certain, and each by itself is most like another one, before or behind
    let (other, rest) = ([2.6, 3.4, 0.0], [9.4, -3.4, 0.0]);
    for slides in [[other, rest], [rest, other]] {
        let mut explorer = fused(&bytes, learn);
        for z in slides {
            explorer.observe(look(0), &at(&z)).unwrap();
        }
        assert!(explorer.is_certain() && !explorer.may_learn());
    }
}
