use super::*;

const TICK_NS: u64 = 75_758;

/// A lever and a clock: time passes in ticks, steps come when they are due.
struct Bench {
    lever: Lever,
    now_ns: u64,
    load_n: f64,
}

impl Bench {
    fn at(height_mm: f64) -> Self {
        let mut lever = Lever::new(height_mm, 1, 2);
        lever.enable(true, 0.0);
        let mut bench = Self {
            lever,
            now_ns: 0,
            load_n: 0.0,
        };
        bench.wait_ms(50);
        bench
    }

    fn wait_ms(&mut self, ms: u64) {
        self.wait_ns(ms * 1_000_000);
    }

    fn wait_ns(&mut self, ns: u64) {
        let until = self.now_ns + ns;
        let mut tick = self.now_ns / TICK_NS * TICK_NS + TICK_NS;
        while tick <= until {
            self.lever.tick(tick, self.load_n);
            tick += TICK_NS;
        }
        self.now_ns = until;
    }

    fn turn_to(&mut self, down: bool) {
        self.lever.dir(self.now_ns, down);
        self.now_ns += 2_000;
    }

    fn steps(&mut self, count: u32, per_s: f64) {
        for _ in 0..count {
            self.pulse((5e8 / per_s) as u64, (5e8 / per_s) as u64);
        }
    }

    fn pulse(&mut self, high_ns: u64, low_ns: u64) {
        self.lever.step(self.now_ns, true, self.load_n);
        self.wait_ns(high_ns);
        self.lever.step(self.now_ns, false, self.load_n);
        self.wait_ns(low_ns);
    }
}

/// Largest deviation of a microstep from its ideal place, mm.
const STEP_ERROR_MM: f64 = 0.5e-3;

#[test]
fn each_step_is_five_eighths_of_a_micrometre() {
    let mut bench = Bench::at(8.0);
    bench.turn_to(true);
    bench.steps(100, 800.0); // takes up the play
    let from = bench.lever.height_mm;
    for steps in [1_u32, 7, 64, 800, 3_200] {
        let from = bench.lever.height_mm;
        bench.steps(steps, 800.0);
        let way = from - bench.lever.height_mm;
        let ideal = f64::from(steps) * STEP_UM * 1e-3;
        assert!((way - ideal).abs() <= 2.0 * STEP_ERROR_MM, "{steps}: {way}");
    }
    assert!((bench.lever.missing_steps()).abs() < 1e-9);
    // an error that does not accumulate: whole periods are exact
    let way = from - bench.lever.height_mm;
    assert!((way - 4_072.0 * STEP_UM * 1e-3).abs() < 2.0 * STEP_ERROR_MM);
    let from = bench.lever.height_mm;
    bench.steps(640, 800.0);
    assert!((from - bench.lever.height_mm - 0.4).abs() < 1e-9);
}

#[test]
fn every_step_moves_the_tip_the_way_it_should() {
    let mut bench = Bench::at(8.0);
    bench.turn_to(true);
    bench.steps(100, 800.0);
    let mut errors = Vec::new();
    for _ in 0..128 {
        let before = bench.lever.height_mm;
        bench.steps(1, 800.0);
        let way_um = (before - bench.lever.height_mm) * 1e3;
        assert!(way_um > 0.0, "{way_um}");
        errors.push(way_um - STEP_UM);
    }
    assert!(
        errors.iter().any(|error| error.abs() > 0.05),
        "microsteps are not ideal"
    );
    assert!(
        errors
            .iter()
            .zip(&errors[64..])
            .all(|(a, b)| (a - b).abs() < 1e-9)
    );
}

#[test]
fn a_reversal_has_to_cross_the_play() {
    let mut bench = Bench::at(8.0);
    bench.turn_to(true);
    bench.steps(200, 800.0);
    let lowest = bench.lever.height_mm;
    bench.turn_to(false);
    bench.steps(20, 800.0);
    assert_eq!(bench.lever.height_mm, lowest, "20 steps are 12.5 um of 15");
    bench.steps(20, 800.0);
    let up_um = (bench.lever.height_mm - lowest) * 1e3;
    assert!((up_um - (25.0 - BACKLASH_UM)).abs() < 1.1, "{up_um}");

    // a pressed finger keeps it closed
    bench.turn_to(true);
    bench.steps(200, 800.0);
    bench.load_n = 0.5;
    let lowest = bench.lever.height_mm;
    bench.turn_to(false);
    bench.steps(16, 800.0);
    let up_um = (bench.lever.height_mm - lowest) * 1e3;
    assert!((up_um - 10.0).abs() < 1.1, "{up_um}");
}

#[test]
fn pulses_that_break_the_timing_are_no_steps() {
    let mut bench = Bench::at(8.0);
    bench.turn_to(true);
    bench.steps(100, 800.0);
    for (high_ns, low_ns) in [(3_900, 1_250_000), (1_250_000, 3_900)] {
        let (missing, bad) = (bench.lever.missing_steps(), bench.lever.bad_pulses);
        for _ in 0..10 {
            bench.pulse(high_ns, low_ns);
        }
        bench.wait_ms(1);
        bench.pulse(10_000, 1_000_000);
        let (missing, bad) = (
            bench.lever.missing_steps() - missing,
            bench.lever.bad_pulses - bad,
        );
        // a low level is between two pulses: the first one after a long one is good
        let expected = if high_ns < 4_000 { 10 } else { 9 };
        assert_eq!((missing, bad), (f64::from(expected), expected as u64));
    }
    for (setup_ns, lost) in [(900, 1.0), (1_000, 0.0)] {
        for down in [false, true] {
            let missing = bench.lever.missing_steps();
            bench.lever.dir(bench.now_ns, down);
            bench.now_ns += setup_ns;
            bench.pulse(10_000, 1_000_000);
            assert_eq!(
                (bench.lever.missing_steps() - missing).abs(),
                lost,
                "{setup_ns}"
            );
        }
    }
}

#[test]
fn the_first_step_may_come_at_once() {
    let mut lever = Lever::new(8.0, 1, 2);
    lever.enable(true, 0.0);
    lever.dir(0, true);
    lever.step(1_000, true, 0.0);
    lever.step(6_000, false, 0.0);
    assert_eq!((lever.missing_steps(), lever.bad_pulses), (0.0, 0));
}

#[test]
fn it_starts_at_the_start_rate_and_not_above() {
    for (per_s, lost) in [(800.0, false), (6_300.0, false), (8_000.0, true)] {
        let mut bench = Bench::at(TOP_MM - 1.0);
        bench.turn_to(true);
        bench.steps(1_600, per_s);
        bench.wait_ms(50);
        bench.steps(1, 800.0); // the rotor falls in again
        let missing = bench.lever.missing_steps();
        assert_eq!(missing > 1_000.0, lost, "{per_s}: {missing}");
        assert_eq!(missing % 64.0, 0.0, "whole periods only");
    }
}

#[test]
fn a_ramp_takes_it_to_the_top_rate_and_not_beyond() {
    let run = |top_per_s: f64, ramp_down: bool| {
        let mut bench = Bench::at(TOP_MM - 0.7);
        bench.turn_to(true);
        let ramp_per_s2 = 0.9 * RAMP_PER_S2;
        let mut rate: f64 = 5_000.0;
        let mut ramp = Vec::new();
        while rate < top_per_s {
            ramp.push(rate);
            rate += ramp_per_s2 / rate;
        }
        for rate in &ramp {
            bench.steps(1, *rate);
        }
        bench.steps(1_000, top_per_s);
        if ramp_down {
            for rate in ramp.iter().rev() {
                bench.steps(1, *rate);
            }
        }
        bench.wait_ms(50);
        bench.steps(1, 800.0);
        bench.lever.missing_steps()
    };
    assert_eq!(run(20_000.0, true), 0.0);
    assert!(run(26_000.0, true) > 500.0, "beyond the top rate");
    assert_eq!(
        run(20_000.0, false),
        -64.0,
        "stopped from full speed, it runs on"
    );
}

#[test]
fn the_switch_at_the_top_has_a_hysteresis_and_the_hard_stop_takes_the_steps() {
    let mut bench = Bench::at(TOP_MM - 1.0);
    assert!(!bench.lever.at_top());
    bench.turn_to(false);
    while !bench.lever.at_top() {
        bench.steps(1, 3_200.0);
    }
    let closes_mm = TOP_MM - bench.lever.height_mm;
    assert!((closes_mm - LIMIT_MM).abs() < 1.1e-3, "{closes_mm}");
    bench.turn_to(true);
    while bench.lever.at_top() {
        bench.steps(1, 3_200.0);
    }
    let opens_mm = TOP_MM - bench.lever.height_mm;
    assert!((opens_mm - LIMIT_MM - LIMIT_HYSTERESIS_MM).abs() < 1.1e-3);
    bench.turn_to(false);
    bench.steps(1_600, 3_200.0); // 1 mm: 0.45 mm beyond the stop
    assert!(bench.lever.height_mm <= TOP_MM + BACKLASH_UM * 1e-3);
    assert!(bench.lever.missing_steps() < -600.0);
}

#[test]
fn without_current_it_stays_where_it_is_whatever_pushes() {
    let mut bench = Bench::at(2.0);
    bench.turn_to(true);
    bench.steps(160, 800.0);
    let held = bench.lever.height_mm;
    assert!(!bench.lever.turn_by_hand(0.1, 0.0), "the motor holds");
    for load_n in [0.5, 2.1, 12.0, 50.0] {
        bench.load_n = load_n;
        bench.lever.enable(false, load_n);
        bench.wait_ms(1_000);
        assert_eq!(bench.lever.height_mm, held, "{load_n} N");
    }
    // but for its knob
    assert!(bench.lever.turn_by_hand(0.05, 2.1));
    let up_mm = bench.lever.height_mm - held;
    assert!((up_mm - 0.05).abs() < 2e-3, "{up_mm}");
    // with the current, the rotor snaps to the nearest place that fits
    let held = bench.lever.height_mm;
    bench.lever.enable(true, 2.1);
    let snapped = bench.lever.height_mm;
    assert!((snapped - held).abs() <= 0.5 * PERIOD as f64 * STEP_UM * 1e-3 + STEP_ERROR_MM);
    assert_eq!((bench.lever.missing_steps()) % 64.0, 0.0);
}

#[test]
fn an_inverted_dir_turns_every_step_round() {
    let mut bench = Bench::at(8.0);
    bench.turn_to(true);
    bench.lever.inverted = true;
    bench.steps(100, 800.0);
    let from = bench.lever.height_mm;
    bench.steps(800, 800.0);
    let up_mm = bench.lever.height_mm - from;
    assert!((up_mm - 0.5).abs() < 2e-3, "{up_mm}");
    bench.lever.inverted = false;
    bench.steps(1_600, 800.0);
    assert!(bench.lever.height_mm < from);
}

#[test]
fn a_load_over_the_holding_force_pushes_it_back() {
    let mut bench = Bench::at(2.0);
    bench.load_n = HOLD_N - 0.1;
    bench.wait_ms(10);
    assert_eq!(bench.lever.missing_steps(), 0.0);
    bench.load_n = HOLD_N + 0.1;
    bench.wait_ms(1);
    assert!(bench.lever.missing_steps() >= 64.0);
}

#[test]
fn it_hums_differently_at_every_stop_and_not_without_current() {
    let mut bench = Bench::at(8.0);
    bench.turn_to(true);
    let mut powers = Vec::new();
    for _ in 0..20 {
        bench.steps(10, 800.0);
        bench.wait_ms(30);
        let mut power = 0.0;
        for _ in 0..1_000 {
            bench.wait_ns(TICK_NS);
            power += bench.lever.vibration_pa().powi(2);
        }
        powers.push((power / 1_000.0_f64).sqrt());
    }
    powers.sort_by(f64::total_cmp);
    assert!(
        powers[0] > 0.0 && powers[19] > 1.5 * powers[0],
        "{powers:?}"
    );
    bench.lever.enable(false, 0.0);
    bench.wait_ms(1);
    assert_eq!(bench.lever.vibration_pa(), 0.0);
}

#[test]
fn lost_steps_and_a_runaway_show_in_the_tip_alone() {
    let mut bench = Bench::at(8.0);
    bench.turn_to(true);
    bench.lever.lost_share = 0.1;
    bench.steps(2_000, 800.0);
    let missing = bench.lever.missing_steps();
    assert!((150.0..250.0).contains(&missing), "{missing}");

    bench.lever.lost_share = 0.0;
    let from = bench.lever.height_mm;
    bench.lever.run_away_down(true);
    bench.wait_ms(1_000);
    let down = from - bench.lever.height_mm;
    assert!((down - 0.5).abs() < 3e-3, "{down}");
    // commanded to go up twice as fast, it gives in after more steps than it made
    bench.turn_to(false);
    bench.steps(1_700, 1_600.0);
    let turned = bench.lever.height_mm;
    bench.wait_ms(500);
    assert_eq!(bench.lever.height_mm, turned);
    // and without current at once
    bench.lever.run_away_down(true);
    bench.lever.enable(false, 0.0);
    bench.lever.enable(true, 0.0);
    bench.wait_ms(100);
    assert!((bench.lever.height_mm - turned).abs() < 0.021);
}
