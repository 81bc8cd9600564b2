use super::*;
use crate::sensor::biotac;

/// P_DC of a finger in the air, counts.
const REST: f32 = 2640.0;

/// A lever over a sample.
struct Bench {
    lever: Lever,
    meter: ForceMeter,
    /// Steps down from the limit switch.
    way: f32,
    seed: u32,
    /// The sample's surface below the homed finger, mm, and how much it gives way, mm/N.
    clear_mm: f32,
    compliance: f32,
    /// The skin is torn: neither signal shows a contact.
    torn: bool,
    /// P_DC of the finger and the height over the sample at which it still came down fast, and the ms of it all.
    fast: (f32, f32),
    ms: u32,
}

impl Bench {
    fn new(clear_mm: f32, compliance: f32) -> Self {
        let mut lever = Lever::new(&biotac::PARTS.model, Unguarded::default());
        lever.home();
        Self {
            lever,
            meter: ForceMeter::new(REST),
            way: 0.0,
            seed: 1,
            clear_mm,
            compliance,
            torn: false,
            fast: (0.0, f32::INFINITY),
            ms: 0,
        }
    }

    /// Force on the finger in counts of P_DC. Hertz: 1 N at 1 mm of the skin alone.
    fn counts(&self) -> f32 {
        let mm = self.way * STEP_UM * 1e-3 - self.clear_mm;
        let (mut low, mut high) = (0.0, mm.max(0.0));
        for _ in 0..40 {
            let skin: f32 = (low + high) / 2.0;
            let over = skin + self.compliance * skin * libm::sqrtf(skin) > mm;
            (low, high) = if over { (low, skin) } else { (skin, high) };
        }
        low * libm::sqrtf(low) / 0.0115
    }

    /// Runs the lever until it is in this state.
    fn until(&mut self, wanted: LeverState) -> Result<(), Fault> {
        for _ in 0..60_000 {
            let counts = if self.torn { 0.0 } else { self.counts() };
            for _ in 0..2 {
                self.seed = self
                    .seed
                    .wrapping_mul(1_664_525)
                    .wrapping_add(1_013_904_223);
                let noise = (self.seed >> 8) as f32 / (1 << 23) as f32 - 1.0;
                let sample = libm::roundf(REST + counts + 0.5 * noise);
                self.meter.push(Counts::new(sample as u16).unwrap());
            }
            let (steps, at_top) = (self.way as i32, self.way <= 0.0);
            let rate = self.lever.tick(&mut self.meter, steps, at_top)?;
            self.way += rate as f32 * 1e-3;
            self.ms += 1;
            if rate > APPROACH_STEPS_S {
                let height = self.clear_mm - self.way * STEP_UM * 1e-3;
                self.fast = (self.fast.0.max(self.counts()), self.fast.1.min(height));
            }
            if self.lever.state() == wanted {
                return Ok(());
            }
        }
        panic!("no end in a minute");
    }

    /// Presses to 0.5 N; returns its result, and the force at its end in counts.
    fn press(&mut self) -> (Result<(), Fault>, f32) {
        let ended = self.until(LeverState::Lifted).and_then(|()| {
            assert!(self.lever.press(43.5));
            self.until(LeverState::Holding)
        });
        (ended, self.counts())
    }
}

fn press(clear_mm: f32, compliance: f32) -> (Result<(), Fault>, f32) {
    Bench::new(clear_mm, compliance).press()
}

#[test]
fn a_zero_that_was_taken_under_load_is_no_zero() {
    for compliance in [0.0, 0.1, 1.0, 2.0] {
        for clear_mm in [1.0, 0.2, 0.1] {
            let (ended, counts) = press(clear_mm, compliance);
            assert_eq!(ended, Ok(()), "{clear_mm} mm, {compliance} mm/N");
            assert!((counts - 43.5).abs() < 1.0, "{counts}");
        }
        for pressed_mm in [0.0, 0.05, 0.25, 1.0] {
            let (ended, counts) = press(-pressed_mm, compliance);
            assert_eq!(
                ended,
                Err(Fault::Unsteady),
                "{pressed_mm} mm, {compliance} mm/N"
            );
            // it has gone on for 0.1 mm at most
            let (_, before) = press(-pressed_mm - 0.11, compliance);
            assert!(counts < before + 1.0, "{counts}, {before}");
        }
    }
}

#[test]
fn a_finger_that_feels_nothing_where_it_felt_the_sample_stops() {
    for compliance in [0.0, 0.1, 1.0, 2.0] {
        let mut bench = Bench::new(3.0, compliance);
        assert_eq!(bench.press().0, Ok(()));
        bench.lever.lift(bench.way as i32);
        assert_eq!(bench.press().0, Ok(()));
        bench.lever.lift(bench.way as i32);
        bench.torn = true;
        let (ended, counts) = bench.press();
        assert_eq!(ended, Err(Fault::PressureDead), "{compliance} mm/N");
        assert!(counts * 0.0115 < 1.3, "{counts}");
    }
}

/// A finger that waits over the sample goes to the switch, and the place of the sample stays known there.
#[test]
fn a_finger_that_hangs_is_parked_and_knows_its_sample() {
    let mut bench = Bench::new(3.0, 0.1);
    assert_eq!(bench.press().0, Ok(()));
    bench.lever.lift(bench.way as i32);
    assert_eq!(bench.until(LeverState::Lifted), Ok(()));
    assert!(!bench.lever.is_at_switch() && bench.way > 2000.0);
    let zero = bench.lever.zero();
    for _ in 0..HANGS_MS {
        assert!(!bench.lever.wait());
        assert_eq!(bench.until(LeverState::Lifted), Ok(()));
    }
    assert!(bench.lever.wait() && !bench.lever.wait());
    assert_eq!(bench.until(LeverState::Lifted), Ok(()));
    assert!(bench.lever.is_at_switch() && bench.way <= 0.0);
    assert!(!bench.lever.park(), "it is");
    assert_eq!(bench.lever.zero(), zero);
    bench.torn = true;
    let (ended, counts) = bench.press();
    assert_eq!(ended, Err(Fault::PressureDead));
    assert!(counts * 0.0115 < 1.3, "{counts}");
}

#[test]
fn another_sample_may_be_lower() {
    let mut bench = Bench::new(3.0, 0.1);
    assert_eq!(bench.press().0, Ok(()));
    bench.lever.lift(bench.way as i32);
    bench.clear_mm = 6.0;
    bench.lever.forget_contact();
    assert_eq!(bench.press().0, Ok(()));
}

#[test]
fn it_comes_down_fast_until_it_touches_and_slowly_where_it_knows_the_sample() {
    for compliance in [0.0, 0.1, 1.0, 2.0, 4.0] {
        for seed in 1..=10 {
            let mut bench = Bench::new(6.0, compliance);
            bench.seed = seed;
            let (ended, counts) = bench.press();
            assert_eq!(ended, Ok(()), "{compliance} mm/N");
            assert!((counts - 43.5).abs() < 1.0, "{counts}");
            // 6 mm take 12 s at the speed of an approach; two thirds of the lightest press
            assert!(bench.fast.1 < 0.0, "{:?}", bench.fast);
            assert!(bench.fast.0 * 11.5 < 66.0, "{:?}", bench.fast);
            let first_ms = bench.ms;
            assert!(first_ms < 12_000, "{first_ms}");
            bench.lever.lift(bench.way as i32);
            (bench.fast, bench.ms) = ((0.0, f32::INFINITY), 0);
            assert_eq!(bench.press().0, Ok(()));
            // half of the contact threshold, on the softest sample
            assert!(bench.fast.0 * 11.5 < 17.25, "{:?}", bench.fast);
            assert!((-0.12..0.15).contains(&bench.fast.1), "{:?}", bench.fast);
        }
    }
}

#[test]
fn a_zero_is_proven_at_the_speed_of_an_approach() {
    let mut bench = Bench::new(3.0, 0.0);
    bench.until(LeverState::Lifted).unwrap();
    assert!(bench.lever.press(43.5));
    bench.until(LeverState::Approaching(None)).unwrap();
    let from = bench.way;
    let mut ms = 0;
    while bench.fast.1.is_infinite() {
        bench.until(LeverState::Approaching(None)).unwrap();
        ms += 1;
    }
    let way_mm = (bench.way - from) * STEP_UM * 1e-3;
    assert!(
        ms >= 199 && (0.09..0.11).contains(&way_mm),
        "{ms} ms, {way_mm} mm"
    );
}
