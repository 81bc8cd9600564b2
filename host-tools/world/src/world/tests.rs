use std::hash::{DefaultHasher, Hasher as _};

use tactus_core::sensor::biotac::decode;

use super::*;

mod faults;

const SECOND_NS: u64 = 1_000_000_000;
const MS_NS: u64 = 1_000_000;
/// A slot of the sensor: 1/4400 s.
const SLOT_NS: u64 = 227_272;
/// Two bytes at 5.25 MHz.
const TRANSFER_NS: u64 = 3_048;
const PAC: u8 = 0x80;
const PDC: u8 = 0x83;

/// A bench at the pins that also sees the truth.
struct Bench {
    world: World,
    now_ns: u64,
}

impl Bench {
    fn new(setup: Setup) -> Self {
        let mut bench = Self {
            world: World::new(setup),
            now_ns: 0,
        };
        bench.world.lever_enable(0, true);
        bench.world.stage_enable(0, true);
        bench.wait_ms(100);
        bench
    }

    /// With the finger just over the sample.
    fn lowered(setup: Setup) -> Self {
        let mut bench = Self::new(setup);
        bench.turn_to(true);
        while bench.world.truth().indentation_mm < -0.05 {
            bench.steps(16, 5_000);
        }
        bench.wait_ms(50);
        bench
    }

    fn pressed(setup: Setup, force_n: f64) -> Self {
        let mut bench = Self::lowered(setup);
        while bench.world.truth().force_n < force_n {
            bench.steps(1, 800);
        }
        bench.wait_ms(50);
        bench
    }

    fn wait_ms(&mut self, ms: u64) {
        self.wait_ns(ms * MS_NS);
    }

    fn wait_ns(&mut self, ns: u64) {
        self.now_ns += ns;
        self.world.advance_to(self.now_ns);
    }

    fn turn_to(&mut self, down: bool) {
        self.world.lever_dir(self.now_ns, down);
        self.now_ns += 2_000;
    }

    fn steps(&mut self, count: u32, per_s: u64) {
        for _ in 0..count {
            self.world.lever_step(self.now_ns, true);
            self.now_ns += SECOND_NS / 2 / per_s;
            self.world.lever_step(self.now_ns, false);
            self.now_ns += SECOND_NS / 2 / per_s;
        }
    }

    fn transfer(&mut self, mosi: [u8; 2]) -> [u8; 2] {
        let mut miso = [0; 2];
        self.world.spi(self.now_ns, TRANSFER_NS, &mosi, &mut miso);
        self.now_ns += TRANSFER_NS;
        miso
    }

    /// One slot; gives the word.
    fn sample(&mut self, command: u8) -> [u8; 2] {
        let began_ns = self.now_ns;
        self.transfer([command, 0]);
        self.now_ns += 50_000;
        let word = self.transfer([0, 1]);
        self.now_ns = began_ns + SLOT_NS;
        word
    }

    fn counts(&mut self, command: u8) -> f64 {
        f64::from(decode(self.sample(command)).unwrap().get())
    }

    /// Mean of P_DC over 100 samples.
    fn pdc(&mut self) -> f64 {
        (0..100).map(|_| self.counts(PDC)).sum::<f64>() / 100.0
    }

    /// Adds the levels of all pins in one slot to its hash.
    fn hash_slot(&mut self, command: u8, hash: &mut DefaultHasher) {
        hash.write(&self.sample(command));
        hash.write_i32(self.world.encoder());
        hash.write_u16(self.world.motor_adc());
        let (lower, upper) = self.world.stage_limits();
        hash.write(&[lower, upper, self.world.lever_top()].map(u8::from));
    }
}

fn setup(texture: u8, trial_seed: u64) -> Setup {
    Setup {
        texture,
        trial_seed,
        ..Setup::default()
    }
}

#[test]
fn ticks_do_not_drift() {
    let mut world = World::new(Setup::default());
    world.advance_to(SECOND_NS - 1);
    assert_eq!((world.ticks, world.tick_ends_ns), (13_200, SECOND_NS));
    world.advance_to(SECOND_NS);
    assert_eq!((world.ticks, world.tick_began_ns), (13_201, SECOND_NS));
}

#[test]
fn a_fingertip_rests_alike_in_all_trials_and_each_otherwise() {
    let rest = |finger_seed, trial_seed| {
        let setup = Setup {
            trial_seed,
            finger_seed,
            ..Setup::default()
        };
        Bench::new(setup).pdc()
    };
    let mut fingers = Vec::new();
    for finger in 1..=50 {
        let trials: Vec<f64> = (0..5)
            .map(|trial| rest(finger, 100 * finger + trial))
            .collect();
        let apart = trials.iter().map(|r| (r - trials[0]).abs());
        let apart = apart.fold(0.0, f64::max);
        // two temperatures, each within two and a half deviations of 2 counts
        assert!(
            (0.1..12.0).contains(&apart),
            "finger {finger}: {trials:.1?}"
        );
        fingers.push(trials[0]);
    }
    // those of three real ones were 112 apart (OUT)
    fingers.sort_by(f64::total_cmp);
    assert!(fingers[49] - fingers[0] > 80.0, "{fingers:.0?}");
}

#[test]
fn the_sensor_answers_through_its_pins() {
    let mut world = World::new(Setup::default());
    let mut miso = [0; 2];
    world.spi(MS_NS, TRANSFER_NS, &[PAC, 0], &mut miso);
    world.spi(MS_NS + 60_000, TRANSFER_NS, &[0, 1], &mut miso);
    assert_eq!(miso, [0xFF, 0xFF], "it starts up for 100 ms");

    let mut bench = Bench::new(Setup::default());
    // at rest P_AC is 2040 to 2045, P_DC 2583 to 2695 (OUT), whose first bytes are these
    let [byte0, _] = bench.sample(PAC);
    assert!([0x7F, 0x80].contains(&byte0), "{byte0:02X}");
    assert!((2_030.0..2_055.0).contains(&bench.counts(PAC)));
    let [byte0, _] = bench.sample(PDC);
    assert!(
        [0xA1, 0xA2, 0xA4, 0xA7, 0xA8].contains(&byte0),
        "{byte0:02X}"
    );
    assert!((2_580.0..2_700.0).contains(&bench.counts(PDC)));
    bench.transfer([PAC, 0]);
    bench.now_ns += 40_000;
    assert_eq!(bench.transfer([0, 1]), [0xA5, 0x2D], "too early");
    assert_eq!(bench.sample(0x89), [0xA5, 0x58], "no such channel");
}

#[test]
fn every_step_down_presses_harder_until_none_up_does() {
    let mut bench = Bench::lowered(setup(46, 1));
    let rest = bench.pdc();
    let mut force = 0.0;
    while force < 1.5 {
        bench.steps(1, 800);
        let truth = bench.world.truth();
        assert!(truth.force_n >= force, "{force} {truth:?}");
        force = truth.force_n;
    }
    let max = bench.world.truth().force_max_n;
    assert!((force..force + 1e-3).contains(&max), "{max}");
    // P_DC tells it: 11.5 mN per count, less what the silicone itself carries
    let counts = bench.pdc() - rest;
    let told = counts * 0.0115 / bench.world.truth().force_n;
    assert!((0.94..1.03).contains(&told), "{told}");

    bench.turn_to(false);
    bench.steps(4_000, 1_600);
    let truth = bench.world.truth();
    assert_eq!(truth.force_n, 0.0);
    assert!(truth.indentation_mm < -1.0 && truth.force_max_n >= 1.5);
    bench.world.reset_extremes();
    assert_eq!(bench.world.truth().force_max_n, 0.0);
}

#[test]
fn the_stage_slides_and_its_pins_say_where() {
    let mut bench = Bench::pressed(setup(47, 3), 0.5);
    let began_mm = bench.world.truth().stage_mm;
    let unloaded = f64::from(bench.world.motor_adc());
    bench.world.stage_pwm(bench.now_ns, -0.2);
    bench.wait_ms(150);
    let (mut current, mut shear) = (0.0, 0.0);
    for _ in 0..100 {
        bench.wait_ms(1);
        let truth = bench.world.truth();
        assert!(
            truth.speed_mm_s < -20.0 && truth.shear_n > 0.05,
            "{truth:?}"
        );
        let at_mm = began_mm + f64::from(bench.world.encoder()) * 1e-3;
        // the truth is up to a tick ahead
        assert!((at_mm - truth.stage_mm).abs() < 0.001 + truth.speed_mm_s.abs() * 76e-6);
        current += (f64::from(bench.world.motor_adc()) - unloaded) / 100.0;
        shear += truth.shear_n / 100.0;
    }
    // 1241 counts per ampere, 16.4 N per ampere, and 0.6 N of Coulomb and some viscous friction
    let current_a = current / 1241.2;
    let expected_a = -(shear + 0.6 + 0.15) / 16.4;
    assert!(
        (current_a - expected_a).abs() < 0.008,
        "{current_a} {expected_a}"
    );
    let truth = bench.world.truth();
    assert!(truth.sliding_j > 0.0 && truth.wear > 0.0);
    assert_eq!(truth.stage_reach_mm.1, began_mm);
    // against the limit switch and the stop behind it
    bench.wait_ms(3_000);
    assert_eq!(bench.world.stage_limits(), (true, false));
    assert_eq!(bench.world.truth().stage_mm, 0.0);
}

/// Textures vibrate by the speed: it is the way that a printer's carriage makes in a time.
#[test]
fn a_printer_tells_the_speed_of_its_way() {
    use crate::printer::{Kind, Printer};
    for mm in [12.0, -12.0] {
        let mut bench = Bench::new(setup(1, 5));
        bench
            .world
            .mount_on_printer(Printer::new(1, 5, Kind::Klipper));
        bench.world.printer().unwrap().jog([mm, 0.0, 0.0]);
        bench.wait_ms(150);
        let began_mm = bench.world.truth().sample_mm;
        let mut speed = 0.0;
        for _ in 0..100 {
            bench.wait_ms(1);
            speed += bench.world.truth().speed_mm_s / 100.0;
        }
        let made = (bench.world.truth().sample_mm - began_mm) / 0.1;
        assert!(
            made.abs() > 20.0 && (speed / made - 1.0).abs() < 0.05,
            "{speed} {made}"
        );
    }
}

/// At 1 kHz the count has to tell a constant speed, though ticks are not a whole part of a millisecond.
#[test]
fn the_count_is_smooth_between_ticks() {
    let mut bench = Bench::new(setup(1, 5));
    bench.world.stage_pwm(bench.now_ns, 0.15);
    bench.wait_ms(200);
    let mut from = bench.world.encoder();
    for _ in 0..100 {
        bench.wait_ms(1);
        let to = bench.world.encoder();
        let speed = bench.world.truth().speed_mm_s;
        assert!(
            (f64::from(to - from) - speed).abs() < 2.5,
            "{} {speed}",
            to - from
        );
        from = to;
    }
}

#[test]
fn samples_and_skins_are_changed_with_the_finger_lifted() {
    let mut bench = Bench::pressed(setup(46, 1), 0.3);
    assert!(bench.world.place(47).is_err());
    assert!(bench.world.put_on_skin(0.0).is_err());
    assert_eq!(bench.world.truth().texture, 46);
    bench.turn_to(false);
    bench.steps(1_000, 1_600);
    bench.world.put_on_skin(0.0).unwrap();
    let [thick, thin] = [true, false].map(|thick| {
        let over = bench.world.truth().tip_mm - 0.1;
        let fits = |number: &u8| {
            sample(*number, 1, crate::TRIAL_VARIATION)
                .texture
                .thickness_mm
                < over
        };
        (1..=117).find(|number| fits(number) != thick).unwrap()
    });
    assert!(
        bench.world.place(thick).is_err(),
        "it would lift the finger"
    );
    bench.world.place(thin).unwrap();
    bench.wait_ms(10);
    let truth = bench.world.truth();
    assert_eq!((truth.texture, truth.force_n), (thin, 0.0));
}

#[test]
fn shims_raise_what_is_thinner() {
    let shimmed = |setup| Setup {
        shimmed: true,
        ..setup
    };
    let top_mm = |world: &World| world.truth().tip_mm + world.truth().indentation_mm;
    let mut bench = Bench::new(shimmed(setup(1, 1)));
    assert!((top_mm(&bench.world) - 11.0).abs() < 1e-12);
    // the one that comes next, too
    bench.world.place(2).unwrap();
    assert!((top_mm(&bench.world) - 11.0).abs() < 1e-12);
    // the finger touches it there
    bench.turn_to(true);
    while bench.world.truth().force_n == 0.0 {
        bench.steps(16, 5_000);
    }
    let touched = bench.world.truth().tip_mm;
    assert!((10.9..=11.0).contains(&touched), "{touched} mm");
    // a sample that is thicker stays as it is, even where it touches the finger
    let thick = Setup {
        world_seed: 34,
        ..setup(30, 1)
    };
    let world = World::new(thick);
    assert!(world.truth().indentation_mm > 0.0);
    assert_eq!(World::new(shimmed(thick)).truth(), world.truth());
}

#[test]
fn a_late_stamp_acts_now_and_is_measured_as_it_is() {
    let mut bench = Bench::lowered(Setup::default());
    bench.world.advance_to(bench.now_ns + 5 * MS_NS);
    let before = bench.world.truth();
    bench.steps(3, 800);
    let after = bench.world.truth();
    assert_eq!(after.lever_missing_steps, before.lever_missing_steps);
    assert_eq!(after.lever_bad_pulses, 0);
    assert!(after.tip_mm < before.tip_mm);
}

/// Ten seconds with the finger pressed and the stage to and fro.
fn hash_of_ten_seconds(setup: Setup) -> u64 {
    let mut bench = Bench::pressed(setup, 0.4);
    let mut hash = DefaultHasher::new();
    bench
        .world
        .schedule(bench.now_ns + 9 * SECOND_NS, Fault::BitFlips { share: 0.1 });
    for slot in 0..44_000 {
        if slot % 4_400 == 0 {
            let duty = if slot % 8_800 == 0 { 0.08 } else { -0.08 };
            bench.world.stage_pwm(bench.now_ns, duty);
        }
        bench.hash_slot(if slot % 2 == 0 { PAC } else { PDC }, &mut hash);
    }
    hash.finish()
}

#[test]
fn the_same_seeds_give_the_same_words_on_any_thread() {
    let base = setup(20, 7);
    let other = Setup {
        trial_seed: 8,
        ..base
    };
    let (first, second, third) = std::thread::scope(|threads| {
        let [first, second, third] =
            [base, base, other].map(|setup| threads.spawn(move || hash_of_ten_seconds(setup)));
        (
            first.join().unwrap(),
            second.join().unwrap(),
            third.join().unwrap(),
        )
    });
    assert_eq!(first, second);
    assert_ne!(first, third);
    assert_eq!(first, hash_of_ten_seconds(base));
}
