//! Each fault at the pins.

use tactus_core::sensor::biotac::{WordError, decode};

use super::*;
use crate::encoder::Cut;

#[test]
fn an_unplugged_sensor_is_silent_and_starts_up_again() {
    let mut bench = Bench::new(Setup::default());
    bench.sample(PAC);
    bench.world.inject(Fault::SensorUnplugged);
    for command in [PAC, PDC] {
        assert_eq!(bench.sample(command), [0xFF, 0xFF]);
    }
    bench.world.clear();
    assert_eq!(bench.sample(PAC), [0xFF, 0xFF]);
    bench.wait_ms(100);
    assert!(decode(bench.sample(PAC)).is_ok());
}

#[test]
fn flipped_bits_spoil_their_share_of_words() {
    let mut bench = Bench::new(Setup::default());
    bench.world.inject(Fault::BitFlips { share: 0.05 });
    let words: Vec<_> = (0..10_000).map(|_| decode(bench.sample(PAC))).collect();
    let bad = words.iter().filter(|word| word.is_err()).count();
    assert!((430..570).contains(&bad), "{bad}");
    // parity sees every one of them, but for those that make an error frame
    assert!(
        words
            .iter()
            .flatten()
            .all(|counts| (2_030..2_055).contains(&counts.get()))
    );
    let missing = |word: &&Result<_, WordError>| matches!(word, Err(WordError::NoSensor));
    assert_eq!(words.iter().filter(missing).count(), 0);
}

#[test]
fn a_stuck_line_says_one_thing() {
    for (high, byte) in [(false, 0x00), (true, 0xFF)] {
        let mut bench = Bench::new(Setup::default());
        bench.world.inject(Fault::MisoStuck { high });
        assert_eq!(bench.transfer([PAC, 0]), [byte; 2]);
        assert_eq!(bench.sample(PDC), [byte; 2]);
    }
}

#[test]
fn a_frozen_sensor_repeats_good_words() {
    let mut bench = Bench::new(Setup::default());
    let last = [bench.sample(PAC), bench.sample(PDC)];
    bench.world.inject(Fault::SensorFrozen);
    for _ in 0..50 {
        assert_eq!([bench.sample(PAC), bench.sample(PDC)], last);
    }
    assert!(last.into_iter().all(|word| decode(word).is_ok()));
    bench.world.clear();
    let pac: Vec<_> = (0..50).map(|_| bench.sample(PAC)).collect();
    assert!(
        pac.iter().any(|word| *word != last[0]),
        "it has noise again"
    );
}

#[test]
fn a_drift_shows_in_the_static_pressure_alone() {
    let mut bench = Bench::new(Setup::default());
    let rest = bench.pdc();
    bench.world.inject(Fault::PdcDrift {
        counts_per_s: -20.0,
    });
    bench.wait_ms(2_000);
    let moved = bench.pdc() - rest;
    assert!((moved + 40.0).abs() < 2.0, "{moved}");
    assert!((2_030.0..2_055.0).contains(&bench.counts(PAC)));
    assert_eq!(bench.world.truth().force_n, 0.0);
}

#[test]
fn cut_encoder_wires_stop_the_count_while_the_stage_moves() {
    for (cut, spread) in [(Cut::A, 1), (Cut::B, 1), (Cut::Both, 0)] {
        let mut bench = Bench::new(Setup::default());
        bench.world.stage_pwm(bench.now_ns, 0.1);
        bench.wait_ms(100);
        bench.world.inject(Fault::EncoderCut(cut));
        let counts: Vec<i32> = (0..100)
            .map(|_| {
                bench.wait_ms(1);
                bench.world.encoder()
            })
            .collect();
        let range = counts.iter().max().unwrap() - counts.iter().min().unwrap();
        assert_eq!(range, spread, "{cut:?}");
        assert!(bench.world.truth().speed_mm_s > 40.0);
        bench.world.clear();
        bench.wait_ms(100);
        assert!(bench.world.encoder() > counts[99] + 3_000);
    }
}

#[test]
fn a_runaway_presses_until_its_current_is_off() {
    let mut bench = Bench::pressed(setup(46, 1), 0.2);
    bench.world.inject(Fault::LeverRunaway);
    bench.wait_ms(500);
    let force_n = bench.world.truth().force_n;
    assert!(force_n > 0.4, "a quarter of a millimetre: {force_n}");
    bench.world.lever_enable(bench.now_ns, false);
    let stopped = bench.world.truth().tip_mm;
    bench.wait_ms(500);
    assert!(bench.world.truth().tip_mm >= stopped);
    bench.world.lever_enable(bench.now_ns, true);
    let tip_mm = bench.world.truth().tip_mm;
    bench.wait_ms(200);
    assert_eq!(bench.world.truth().tip_mm, tip_mm, "it does not come back");
}

#[test]
fn contacts_stick() {
    let mut bench = Bench::new(Setup::default());
    let pins = |world: &World| (world.e_stop(), world.lever_top(), world.stage_limits());
    assert_eq!(pins(&bench.world), (false, false, (false, false)));
    bench.world.inject(Fault::EStop);
    bench.wait_ms(5);
    bench.world.inject(Fault::LeverTopStuck { closed: true });
    bench.world.inject(Fault::StageLimitStuck {
        upper: true,
        closed: true,
    });
    assert_eq!(pins(&bench.world), (true, true, (false, true)));
    bench.world.inject(Fault::StageLimitStuck {
        upper: false,
        closed: true,
    });
    assert_eq!(pins(&bench.world), (true, true, (true, true)));
    bench.world.clear();
    assert_eq!(pins(&bench.world), (false, false, (false, false)));

    // stuck open, they miss the ends
    bench.world.inject(Fault::LeverTopStuck { closed: false });
    bench.world.inject(Fault::StageLimitStuck {
        upper: true,
        closed: false,
    });
    bench.turn_to(false);
    bench.steps(8_000, 5_000);
    bench.world.stage_pwm(bench.now_ns, 0.2);
    bench.wait_ms(1_500);
    assert_eq!(pins(&bench.world), (false, false, (false, false)));
    bench.world.clear();
    assert_eq!(pins(&bench.world), (false, true, (false, true)));
}

#[test]
fn the_stop_bounces_and_takes_the_motors_supply_at_once() {
    let mut bounced = 0;
    for seed in 0..20 {
        let mut bench = Bench::pressed(setup(46, seed), 0.2);
        bench.world.stage_enable(bench.now_ns, true);
        bench.world.stage_pwm(bench.now_ns, 0.2);
        bench.wait_ms(100);
        bench.wait_ns(seed * 117_000);
        let before = bench.world.truth();
        assert!(before.speed_mm_s > 10.0);
        bench.world.inject(Fault::EStop);
        assert!(bench.world.e_stop(), "it opens at once");
        let open = (0..100).map(|_| {
            bench.wait_ns(50_000);
            bench.world.e_stop()
        });
        let open: Vec<bool> = open.collect();
        bounced += u32::from(open.contains(&false));
        assert_eq!(open[80..], [true; 20], "4 ms");
        assert_eq!(bench.world.truth().current_a, 0.0);
        bench.steps(400, 1_600);
        let after = bench.world.truth();
        assert_eq!(after.tip_mm, before.tip_mm, "no current, no step");
        assert!(after.speed_mm_s == 0.0, "{after:?}");
        bench.world.clear();
        bench.wait_ms(100);
        // at the end of its travel by now, in some trials
        assert!(bench.world.truth().current_a > 0.02);
    }
    assert!(bounced > 15, "{bounced} of 20");
}

#[test]
fn a_disturbed_wire_of_the_stop_takes_no_supply() {
    let mut bench = Bench::new(Setup::default());
    bench.world.inject(Fault::EStopGlitch { us: 1_000 });
    assert!(bench.world.e_stop());
    bench.wait_ns(990_000);
    assert!(bench.world.e_stop());
    bench.wait_ns(20_000);
    assert!(!bench.world.e_stop());
    bench.world.stage_pwm(bench.now_ns, 0.2);
    bench.world.inject(Fault::EStopGlitch { us: 1_000 });
    bench.wait_ms(100);
    assert!(bench.world.truth().speed_mm_s > 10.0);
}

#[test]
fn scheduled_faults_come_in_time() {
    let mut bench = Bench::new(Setup::default());
    let at_ns = bench.now_ns + 7 * MS_NS;
    bench
        .world
        .schedule(at_ns + 5 * MS_NS, Fault::LeverTopStuck { closed: true });
    bench.world.schedule(at_ns, Fault::EStop);
    bench.world.advance_to(at_ns - 1);
    assert!(!bench.world.e_stop());
    bench.world.advance_to(at_ns + 76_000);
    assert!(bench.world.e_stop() && !bench.world.lever_top());
    bench.world.advance_to(at_ns + 5 * MS_NS + 76_000);
    assert!(bench.world.lever_top());
}

#[test]
fn a_wire_that_is_cut_later_spares_the_edges_before() {
    let mut bench = Bench::new(Setup {
        keep_edges: true,
        ..Setup::default()
    });
    bench.world.stage_pwm(bench.now_ns, 0.1);
    let cut_ns = bench.now_ns + 100 * MS_NS;
    bench.world.schedule(cut_ns, Fault::EncoderCut(Cut::B));
    bench.wait_ms(200);
    let edges: Vec<Edge> = std::iter::from_fn(|| bench.world.next_encoder_edge()).collect();
    assert!(edges.windows(2).all(|pair| pair[0].at_ns <= pair[1].at_ns));
    let with_b = edges.iter().filter(|edge| edge.b).map(|edge| edge.at_ns);
    let last_b_ns = with_b.max().unwrap();
    assert!((cut_ns - MS_NS..cut_ns + 76_000).contains(&last_b_ns));
    assert!(
        edges.last().unwrap().at_ns > cut_ns + 99 * MS_NS,
        "A goes on"
    );
}

/// No fault may hide behind another's example.
#[test]
fn every_example_can_be_injected_and_cleared() {
    for fault in Fault::EXAMPLES {
        let mut bench = Bench::new(Setup::default());
        bench.world.inject(fault);
        bench.sample(PAC);
        bench.world.clear();
        bench.wait_ms(101);
        assert!(decode(bench.sample(PDC)).is_ok(), "{fault:?}");
    }
}
