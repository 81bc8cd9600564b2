use super::super::fault::FAULTS;
use super::*;
use crate::sensor::biotac;
use crate::sensor::pressure::{Channel, Counts};

fn word(channel: Channel, counts: u16) -> Option<Pressure> {
    Some(Pressure {
        channel,
        counts: Counts::new(counts).unwrap(),
    })
}

/// The inputs of a rig at rest; P_AC has its noise.
fn at_rest(ms: u32) -> ([Option<Pressure>; 4], GuardInputs<'static>) {
    let pac = |n: u32| word(Channel::Pac, 2040 + (ms * 7 + n * 5) as u16 % 9);
    let words = [
        pac(0),
        word(Channel::Pdc, 2593),
        pac(1),
        word(Channel::Pdc, 2593),
    ];
    let inputs = GuardInputs {
        words: &[],
        e_stop: false,
        hung: false,
        lever_top: false,
        lever_left: false,
        stage_limit: false,
        stage_wanted_mm_s: 0.0,
        stage_mm: 30.0,
        emf_mm_s: 0.0,
    };
    (words, inputs)
}

/// Runs a second of ms, each changed by `change`; returns the first fault and its time.
fn run(
    change: impl Fn(u32, &mut [Option<Pressure>; 4], &mut GuardInputs<'_>),
) -> Option<(u32, Fault)> {
    let mut guard = Guard::default();
    let meter = ForceMeter::new(2593.0);
    (0..1000).find_map(|ms| {
        let (mut words, mut inputs) = at_rest(ms);
        change(ms, &mut words, &mut inputs);
        Some((
            ms,
            guard.tick(
                &GuardInputs {
                    words: &words,
                    ..inputs
                },
                &meter,
                &biotac::PARTS.model,
                11.5,
                2050.0,
            )?,
        ))
    })
}

#[test]
fn a_rig_at_rest_has_no_fault() {
    assert_eq!(run(|_, _, _| ()), None);
}

#[test]
fn faults_are_seen_when_the_table_says() {
    assert_eq!(
        run(|ms, _, s| s.e_stop = ms >= 500),
        Some((502, Fault::EStop))
    );
    assert_eq!(
        run(|ms, _, s| s.e_stop = ms % 3 != 0),
        None,
        "two ms of the emergency stop are a disturbance of its wire"
    );
    assert_eq!(
        run(|ms, _, s| s.lever_top = ms >= 500),
        Some((502, Fault::LeverLimit))
    );
    assert_eq!(
        run(|ms, _, s| s.lever_left = ms >= 500),
        Some((519, Fault::LeverNotHome))
    );
    assert_eq!(
        run(|ms, _, s| s.lever_left = ms % 20 != 0),
        None,
        "a contact that bounces is no lever that comes down"
    );
    assert_eq!(
        run(|ms, _, s| s.stage_limit = ms >= 500),
        Some((502, Fault::StageLimit))
    );
    assert_eq!(
        run(|ms, _, s| s.stage_limit = ms % 3 != 0),
        None,
        "two ms of a switch are its bouncing"
    );
    assert_eq!(
        run(|ms, w, _| if ms >= 500 {
            *w = [None; 4]
        }),
        Some((509, Fault::SensorSilent))
    );
    assert_eq!(
        run(|ms, w, _| if ms >= 500 {
            *w = at_rest(500).0;
            w[2] = w[0]
        }),
        Some((600, Fault::SensorFrozen))
    );
    // at a rail with the noise of a count, and of a slide that only reaches it now and then
    for rail in [0, 4095 - 3] {
        let flickers = |ms: u32, n: u32| word(Channel::Pac, rail + ((ms + n) % 4) as u16);
        assert_eq!(
            run(|ms, w, _| if ms >= 500 {
                (w[0], w[2]) = (flickers(ms, 1), flickers(ms, 3));
            }),
            Some((599, Fault::SensorFrozen))
        );
        assert_eq!(
            run(|ms, w, _| if ms >= 500 && ms % 50 != 0 {
                (w[0], w[2]) = (flickers(ms, 1), flickers(ms, 3));
            }),
            None
        );
    }
}

#[test]
fn half_a_percent_of_damaged_words_is_too_many() {
    // one of four words every 40 ms is 25 a second, every 50 ms 20
    assert!(matches!(
        run(|ms, w, _| if ms % 40 == 0 {
            w[1] = None
        }),
        Some((880, Fault::SensorErrors))
    ));
    assert_eq!(
        run(|ms, w, _| if ms % 50 == 0 {
            w[1] = None
        }),
        None
    );
}

#[test]
fn a_standing_stage_is_blocked_or_its_encoder_silent() {
    let moving = |ms: u32, s: &mut GuardInputs<'_>| {
        s.stage_wanted_mm_s = 10.0;
        s.emf_mm_s = 10.0;
        s.stage_mm = 30.0 + ms.min(500) as f32 * 0.01;
    };
    let blocked = run(|ms, _, s| {
        moving(ms, s);
        if ms > 500 {
            s.emf_mm_s = 0.5;
        }
    });
    let silent = run(|ms, _, s| moving(ms, s));
    assert!(
        matches!(blocked, Some((527..=531, Fault::StageStall))),
        "{blocked:?}"
    );
    assert!(
        matches!(silent, Some((527..=531, Fault::EncoderSilent))),
        "{silent:?}"
    );
    let goes = run(|ms, _, s| {
        moving(ms, s);
        s.stage_mm = 30.0 + ms as f32 * 0.01;
    });
    assert_eq!(goes, None);
}

/// The mean of the last 10 ms is behind a force that rises.
#[test]
fn a_rising_force_is_judged_as_it_is_now() {
    let (words, inputs) = at_rest(0);
    let inputs = GuardInputs {
        words: &words,
        ..inputs
    };
    let judged = |counts: fn(u16) -> u16| {
        let mut meter = ForceMeter::new(2000.0);
        (0..44).for_each(|n| meter.push(Counts::new(2000 + counts(n)).unwrap()));
        assert!(meter.counts() * 11.5 < 1900.0);
        Guard::default().tick(&inputs, &meter, &biotac::PARTS.model, 11.5, 2050.0)
    };
    assert_eq!(judged(|_| 162), None);
    assert_eq!(judged(|n| 5 * n), Some(Fault::ForceHigh));
}

#[test]
fn no_calibration_allows_more_than_the_papers() {
    let mut meter = ForceMeter::new(2000.0);
    for _ in 0..44 {
        // 2.05 N are 178.3 counts of 11.5 mN
        meter.push(Counts::new(2179).unwrap());
    }
    let (words, inputs) = at_rest(0);
    for mn_per_count in [1.0, 11.5, 12.0] {
        let fault = Guard::default().tick(
            &GuardInputs {
                words: &words,
                ..inputs
            },
            &meter,
            &biotac::PARTS.model,
            mn_per_count,
            2050.0,
        );
        assert_eq!(fault, Some(Fault::ForceHigh));
    }
    // a model of half as much a count: 4.1 N of the paper's are 2.05 N
    let half = FingerModel {
        calibration: Calibration {
            force_mn_per_count: 5.75,
            ..Calibration::PAPER
        },
        ..biotac::PARTS.model
    };
    let trips = |counts: u16, mn_per_count: f32| {
        let mut meter = ForceMeter::new(2000.0);
        (0..44).for_each(|_| meter.push(Counts::new(2000 + counts).unwrap()));
        let inputs = GuardInputs {
            words: &words,
            ..inputs
        };
        let fault = Guard::default().tick(&inputs, &meter, &half, mn_per_count, 2050.0);
        fault == Some(Fault::ForceHigh)
    };
    assert!(!trips(356, 5.75) && trips(357, 5.75));
    assert!(trips(357, 2.0) && trips(179, 11.5));
    meter.zero();
    assert_eq!(
        Guard::default().tick(
            &GuardInputs {
                words: &words,
                ..inputs
            },
            &ForceMeter::new(2000.0),
            &biotac::PARTS.model,
            11.5,
            2050.0
        ),
        None
    );
}

#[test]
fn the_table_has_every_fault_once_and_a_fault_can_be_ignored() {
    for (at, row) in FAULTS.iter().enumerate() {
        assert_eq!(row.fault as usize, at, "{}", row.name);
        assert_eq!(row.fault.row(), Some(row));
        assert_eq!(row.fault.name(), row.name);
        assert_eq!(row.fault.recovery(), row.recovery);
        assert!(!FAULTS[..at].iter().any(|other| other.name == row.name));
    }
    assert_eq!(Fault::ArmOff as usize + 1, FAULTS.len());
    let mut guard = Guard::new(Unguarded::against(Fault::EStop));
    let (words, inputs) = at_rest(0);
    let inputs = GuardInputs {
        words: &words,
        e_stop: true,
        lever_top: true,
        ..inputs
    };
    let meter = ForceMeter::new(2593.0);
    assert_eq!(
        guard.tick(&inputs, &meter, &biotac::PARTS.model, 11.5, 2050.0),
        None
    );
    guard.reset();
    guard.tick(&inputs, &meter, &biotac::PARTS.model, 11.5, 2050.0);
    guard.tick(&inputs, &meter, &biotac::PARTS.model, 11.5, 2050.0);
    assert_eq!(
        guard.tick(&inputs, &meter, &biotac::PARTS.model, 11.5, 2050.0),
        Some(Fault::LeverLimit),
        "the others are still looked for"
    );
}

#[test]
fn a_high_force_is_allowed_and_guarded_by_limits_of_its_own() {
    let finger = |force_mn_per_count, linear_mn| Calibration {
        force_mn_per_count,
        linear_mn,
        ..Calibration::PAPER
    };
    for (linear_mn, usual_mn, high_mn) in [
        (2000.0, 2050.0, 2100.0),
        (1000.0, 1025.0, 1050.0),
        (3000.0, 2050.0, 2100.0),
    ] {
        let finger = finger(11.5, linear_mn);
        let limits = [false, true].map(|high| force_limit_mn(&finger, high));
        assert_eq!(limits, [usual_mn, high_mn]);
    }
    for (force_mn, mn_per_count, [usual, allowed]) in [
        (1262, 11.5, [true, true]),
        (1262, 6.0, [true, true]),
        (1263, 11.5, [false, true]),
        (2000, 11.5, [false, true]),
        (2000, 20.0, [false, true]),
        // the guard would act before
        (2000, 10.9, [false, false]),
        (1995, 11.0, [false, true]),
    ] {
        let finger = finger(mn_per_count, 2000.0);
        let may =
            [false, true].map(|high| may_press(&biotac::PARTS.model, &finger, force_mn, high));
        assert_eq!(may, [usual, allowed], "{force_mn} mN, {mn_per_count}");
    }
    assert!(
        !may_press(&biotac::PARTS.model, &finger(11.5, 1200.0), 1262, true),
        "beyond its line"
    );
}
