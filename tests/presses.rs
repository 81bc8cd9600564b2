//! Presses on soft and hard things, with P_DC sound, dead, dying and leaking. What counts is the world's own force.
//!
//! The whole campaign takes about an hour: `cargo test --release -p tactus-tests --test presses -- --ignored --nocapture`,
//! or every seventh rig of it with `TACTUS_PRESSES_EVERY=7`.

use std::collections::BTreeMap;

use tactus::sim::press::{Bench, Campaign, Press, Trouble};
use tactus_core::rig::guard::Unguarded;
use tactus_core::rig::{Ended, Fault};

/// Prints how the presses ended, and objects to those that were too hard, and to sound ones that were not made.
fn judge(presses: &[Press]) {
    let mut ends = BTreeMap::new();
    for press in presses {
        let ended = match &press.ended {
            Ok(ended) => format!("{ended:?}"),
            Err(error) => error.to_string(),
        };
        let (count, most) = ends
            .entry((format!("{:?}", press.bench.trouble), ended))
            .or_insert((0_u32, 0.0_f64));
        *count += 1;
        *most = most.max(press.force_max_n);
    }
    println!("{} presses", presses.len());
    for ((trouble, ended), (count, most)) in ends {
        println!("{trouble:8} {count:6}  {most:.3} N at most  {ended}");
    }
    let hard: Vec<_> = presses.iter().filter(|p| p.is_too_hard()).collect();
    let objections = |presses: &[&Press]| {
        let lines: Vec<_> = presses.iter().take(40).map(ToString::to_string).collect();
        lines.join("\n")
    };
    assert!(
        hard.is_empty(),
        "{} too hard\n{}",
        hard.len(),
        objections(&hard)
    );
    let refused = |p: &&Press| p.bench.trouble == Trouble::Sound && p.ended != Ok(Ended::Whole);
    let refused: Vec<_> = presses.iter().filter(refused).collect();
    println!("{}", objections(&refused));
    let progress = [Fault::PressureDead, Fault::LeverSlips].map(|fault| Err(fault.into()));
    assert!(
        refused.iter().all(|p| !progress.contains(&p.ended)),
        "sound ones were refused"
    );
}

#[test]
fn a_sample_of_the_campaign_presses_nothing_too_hard() {
    let campaign = Campaign {
        worlds: 1..=100,
        every: 397,
        unguarded: Unguarded::default(),
    };
    judge(&campaign.run(|| ()));
}

#[test]
#[ignore = "an hour"]
fn the_whole_campaign_presses_nothing_too_hard() {
    let every = std::env::var("TACTUS_PRESSES_EVERY");
    for unguarded in [Unguarded::default(), Unguarded::against(Fault::ForceHigh)] {
        let campaign = Campaign {
            worlds: 1..=100,
            every: every.as_ref().map_or(1, |text| text.parse().unwrap()),
            unguarded,
        };
        println!("{unguarded:?}");
        judge(&campaign.run(|| ()));
    }
}

/// The guard is what holds the force back: without it a dead P_DC presses too hard.
#[test]
fn without_the_guard_a_dead_pressure_crushes_the_finger() {
    let presses = |unguarded| {
        let bench = Bench {
            world: 1,
            texture: 45,
            trouble: Trouble::Dead,
            unguarded,
        };
        bench.run()
    };
    let guarded = presses(Unguarded::default());
    let dead = Err(Fault::PressureDead.into());
    for press in &guarded {
        assert!(press.ended == dead && press.force_max_n < 1.0, "{press}");
    }
    let unguarded = presses(Unguarded::against(Fault::PressureDead));
    assert!(unguarded.iter().any(Press::is_too_hard), "{}", unguarded[0]);
}

/// Soft foam gives way by more than 3 mm on the way to 2 N, and is no lever that slips.
#[test]
fn the_softest_foam_is_pressed_with_two_newtons() {
    for world in [2, 3, 4711, 4712] {
        let bench = Bench {
            world,
            texture: 30,
            trouble: Trouble::Sound,
            unguarded: Unguarded::against(Fault::ForceHigh),
        };
        for press in bench.run() {
            let wanted_n = f64::from(press.movement.force_n());
            assert_eq!(press.ended, Ok(Ended::Whole), "{press}");
            assert!(press.force_max_n > 0.9 * wanted_n, "{press}");
            assert!(!press.is_too_hard(), "{press}");
        }
    }
}
