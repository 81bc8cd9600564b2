//! The chip's registers at one end of the pins, the rig at the other, and no core between.

use std::sync::{Arc, Mutex};

use rigless::emulator::{Error, Memory};
use rigless::soc::Width;
use tactus_core::sensor::FingerName;
use tactus_world::encoder::Cut;
use tactus_world::faults::Fault;
use tactus_world::world::{Setup, World};

use super::*;
use crate::board::options::Options;
use crate::board::pins;
use crate::board::rig::{Output, Rig, lock};

const MS: u64 = 1_000_000;

/// RAM for DMA to write to, by its half-words.
#[derive(Default)]
struct Ram(std::collections::BTreeMap<u64, u16>);

const RAM: u64 = 0x2000_0000;

impl Memory for Ram {
    fn read(&mut self, address: u64, width: Width) -> Result<u64, Error> {
        Err(Error::Memory { address, width })
    }

    fn write(&mut self, address: u64, width: Width, value: u64) -> Result<(), Error> {
        if width != Width::W16 || address < RAM {
            return Err(Error::Memory { address, width });
        }
        self.0.insert(address, value as u16);
        Ok(())
    }
}

struct Bench {
    board: Board,
    rig: SharedRig,
    ram: Ram,
    now: u64,
}

const SETUP: Setup = Setup {
    texture: 50,
    world_seed: 3,
    trial_seed: 4,
    finger_seed: 5,
    keep_edges: true,
    shimmed: false,
    samples_of: None,
    finger: FingerName::Biotac,
};

impl Bench {
    fn new() -> Self {
        let trace = Options {
            trace_s: 1,
            ..Options::default()
        };
        let rig = Arc::new(Mutex::new(Rig::new(SETUP, &trace)));
        let board = Board::new(&rig, NonZeroU64::new(168_000_000).unwrap(), true).unwrap();
        let mut bench = Self {
            board,
            rig,
            ram: Ram::default(),
            now: 0,
        };
        // every peripheral's clock, from the internal oscillator: 16 MHz
        for enable in [0x4002_3830, 0x4002_3840, 0x4002_3844] {
            bench.write(enable, 0xFFFF_FFFF);
        }
        lock(&bench.rig).wire(true, true);
        bench
    }

    fn write(&mut self, address: u64, value: u64) {
        let part = &mut self.board.part;
        part.write(VirtualNanos(self.now), address, Width::W32, value)
            .unwrap_or_else(|fault| panic!("{address:#x}: {fault}"));
        part.settle(&mut self.ram).unwrap();
    }

    fn read(&mut self, address: u64) -> u64 {
        let part = &mut self.board.part;
        part.read(VirtualNanos(self.now), address, Width::W32)
            .unwrap_or_else(|fault| panic!("{address:#x}: {fault}"))
    }

    /// Lets time pass, stopping at every event, as the core does.
    fn pass_until(&mut self, until: u64) {
        loop {
            let part = &mut self.board.part;
            let next = part.next_event().map_or(until, |at| at.0.min(until));
            self.now = self.now.max(next);
            part.advance_to(VirtualNanos(self.now));
            part.settle(&mut self.ram).unwrap();
            if self.now >= until {
                break;
            }
        }
    }
}

#[test]
fn an_edge_at_a_pin_is_pending_in_exti_until_it_is_cleared() {
    const IMR: u64 = 0x4001_3C00;
    const RTSR: u64 = 0x4001_3C08;
    const PR: u64 = 0x4001_3C14;
    const EXTICR4: u64 = 0x4001_3814;
    let mut bench = Bench::new();
    let at = VirtualNanos(0);
    let line = 1 << 13;
    // closed: pulled to ground
    bench.board.drive(at, pins::E_STOP, Some(false));
    // pull-up of PF13, EXTI13 from port F, rising edges, not masked
    bench.write(0x4002_140C, 1 << 26);
    bench.write(EXTICR4, 5 << 4);
    bench.write(RTSR, line);
    bench.write(IMR, line);
    // another port's pin 13, and the wrong edge
    bench.board.drive(at, pins::BUTTON, Some(true));
    assert_eq!(bench.read(PR), 0);
    bench.board.drive(at, pins::E_STOP, None);
    assert!(bench.board.level(pins::E_STOP), "pulled up");
    assert_eq!(bench.read(PR), line);
    let raised = bench.board.part.drain_interrupts();
    assert_eq!(raised.len(), 1, "EXTI15_10: {raised:?}");
    bench.write(PR, line);
    assert_eq!(bench.read(PR), 0);
    assert_eq!(bench.board.part.drain_interrupts().len(), 1, "lowered");
    bench.board.drive(at, pins::E_STOP, Some(false));
    assert_eq!(bench.read(PR), 0, "a falling edge");
}

/// TIM4 as an encoder counter on both lines.
fn start_encoder(bench: &mut Bench) {
    const TIM4: u64 = 0x4000_0800;
    for (register, value) in [(0x08, 3), (0x18, 0x0101), (0x2C, 0xFFFF), (0x00, 1)] {
        bench.write(TIM4 + register, value);
    }
}

#[test]
fn the_encoder_is_counted_to_the_edge_whenever_the_counter_is_read() {
    const CNT: u64 = 0x4000_0824;
    let mut bench = Bench::new();
    start_encoder(&mut bench);
    lock(&bench.rig).stage_port(0, None);
    lock(&bench.rig).stage_enable(0, true);
    let mut furthest = 0;
    for read in 0..3000u64 {
        // a movement there and back, read at times that fit no tick
        let now = read * 311_113;
        {
            let mut rig = lock(&bench.rig);
            rig.stage_dir(now, read < 1500);
            rig.stage_duty(now, 0.15);
            match read {
                2000 => rig.world().inject(Fault::EncoderCut(Cut::A)),
                2200 => rig.world().clear(),
                _ => {}
            }
        }
        bench.pass_until(now + 100_000);
        let count = bench.read(CNT) as u16 as i16;
        let truth = lock(&bench.rig).world().encoder();
        assert_eq!(count, truth as i16, "read {read}");
        furthest = furthest.max(truth);
    }
    assert!(furthest > 5_000, "the stage has moved {furthest} um only");
}

#[test]
fn conversions_give_the_code_that_the_world_has_when_they_end() {
    const ADC: u64 = 0x4001_2000;
    const EOC: u64 = 1 << 1;
    let mut bench = Bench::new();
    // its double, with the same inputs
    let mut world = World::new(SETUP);
    lock(&bench.rig).stage_port(0, None);
    lock(&bench.rig).stage_enable(0, true);
    world.stage_enable(0, true);
    bench.write(ADC + 0x08, 1);
    bench.write(ADC + 0x34, 3);
    let mut codes = std::collections::BTreeSet::new();
    for conversion in 1..500u64 {
        let now = conversion * 997_003;
        bench.pass_until(now);
        let duty = (conversion % 100) as f64 / 100.0;
        {
            let mut rig = lock(&bench.rig);
            rig.stage_dir(now, true);
            rig.stage_duty(now, duty);
        }
        world.stage_pwm(now, duty);
        bench.write(ADC + 0x08, 1 | 1 << 30);
        let ends = bench.board.part.next_event().unwrap();
        bench.pass_until(ends.0);
        assert_eq!(bench.read(ADC) & EOC, EOC);
        world.advance_to(ends.0);
        let code = bench.read(ADC + 0x4C);
        assert_eq!(code, u64::from(world.motor_adc()), "{conversion}");
        codes.insert(code);
    }
    assert!(codes.len() > 50, "{} codes", codes.len());
}

/// PWM of 4100 ticks and a conversion of 3936 of them: 25 conversions in 24 periods, of all places in a period.
#[test]
fn the_converter_sees_the_ripple_of_the_current_and_its_mean_over_whole_periods() {
    const TIM3: u64 = 0x4000_0400;
    const ADC: u64 = 0x4001_2000;
    const DMA: u64 = 0x4002_6400;
    const CONVERSIONS: usize = 25;
    let mut bench = Bench::new();
    lock(&bench.rig).world().inject(Fault::StageJammed);
    lock(&bench.rig).stage_port(0, None);
    lock(&bench.rig).stage_dir(0, true);
    lock(&bench.rig).stage_enable(0, true);
    // 168 MHz by the crystal: APB1 at 42 and its timers at 84, APB2 at 84
    bench.write(0x4002_3C00, 5);
    bench.write(0x4002_3800, 1 << 16 | 0x83);
    bench.pass_until(10 * MS);
    bench.write(0x4002_3804, 0x2740_2A04);
    bench.write(0x4002_3800, 1 << 24 | 1 << 16 | 0x83);
    bench.pass_until(20 * MS);
    bench.write(0x4002_3808, 5 << 10 | 4 << 13 | 2);
    // PWM mode 1 on channel 1: a tenth
    for (register, value) in [
        (0x2C, 4099),
        (0x34, 410),
        (0x18, 0b1101 << 3),
        (0x20, 1),
        (0x14, 1),
        (0x00, 0x81),
    ] {
        bench.write(TIM3 + register, value);
    }
    // the converters at 84 MHz / 8; 480 cycles of channel 3, on and on, to a ring
    for (register, value) in [
        (DMA + 0x18, ADC + 0x4C),
        (DMA + 0x1C, RAM),
        (DMA + 0x14, CONVERSIONS as u64),
        (DMA + 0x10, 0x2D01),
        (ADC + 0x304, 3 << 16),
        (ADC + 0x10, 7 << 9),
        (ADC + 0x34, 3),
        (ADC + 0x08, 0x303),
        (ADC + 0x08, 1 << 30 | 0x303),
    ] {
        bench.write(register, value);
    }
    let mut rings = Vec::new();
    for _ in 0..40 {
        bench.pass_until(bench.now + 24 * 4100 * 1000 / 84);
        rings.push(bench.ram.0.values().copied().collect::<Vec<_>>());
    }
    assert_eq!(bench.ram.0.len(), CONVERSIONS);
    let mean = |codes: &mut dyn Iterator<Item = u16>| {
        let codes: Vec<u16> = codes.collect();
        codes.iter().map(|code| f64::from(*code)).sum::<f64>() / codes.len() as f64
    };
    let rings = &rings[2..];
    let truth = {
        let mut rig = lock(&bench.rig);
        let from = bench.now;
        mean(&mut (0..1000).map(|reading| {
            rig.world().advance_to(from + reading * 1000);
            rig.world().motor_adc()
        }))
    };
    let of_ring = mean(&mut rings.iter().flatten().copied());
    // 25 places leave up to 0.45 mA, which are 0.55 counts; the rest is noise
    assert!((of_ring - truth).abs() < 0.8, "{of_ring} of {truth}");
    // and each place of it is the current of one place in the period: 203 mA from the least to the most
    let places = (0..CONVERSIONS).map(|at| mean(&mut rings.iter().map(|ring| ring[at])));
    let (least, most) = places.fold((f64::MAX, 0.0), |(least, most), code| {
        (f64::min(least, code), f64::max(most, code))
    });
    let swing_a = (most - least) * 3.3 / 4096.0;
    assert!((swing_a - 0.203).abs() < 0.02, "{swing_a} A");
}

/// A transfer over SPI1 with chip select; the answer, and from when to when chip select was low.
fn transfer(bench: &mut Bench, mosi: &[u8]) -> (Vec<u8>, [u64; 2]) {
    const DR: u64 = 0x4001_300C;
    let began = bench.now;
    lock(&bench.rig).select_part(began, 0, true);
    let mut miso = Vec::new();
    for byte in mosi {
        bench.write(DR, (*byte).into());
        let ends = bench.board.part.next_event().unwrap();
        bench.pass_until(ends.0);
        miso.push(bench.read(DR) as u8);
    }
    lock(&bench.rig).select_part(bench.now, 0, false);
    (miso, [began, bench.now])
}

/// Master, 1 MHz, on: with these bits of CR1 besides.
fn start_spi(bench: &mut Bench, cr1: u64) {
    let cr1 = cr1 | 1 << 2 | 3 << 3 | 1 << 6 | 1 << 8 | 1 << 9;
    bench.write(0x4001_3000, cr1);
    lock(&bench.rig).spi_control(cr1);
}

#[test]
fn the_sensor_says_over_spi1_what_the_world_says() {
    let mut bench = Bench::new();
    let mut world = World::new(SETUP);
    start_spi(&mut bench, 0);
    bench.pass_until(101 * MS);
    for slot in 0..200u64 {
        let command = [0x80, 0x83, 0x9E, 0x81, 0xA1 ^ 0x20][(slot % 5) as usize];
        bench.pass_until(101 * MS + slot * 227_273);
        for mosi in [[command, 0], [0, 1]] {
            let (miso, [began, ended]) = transfer(&mut bench, &mosi);
            let mut expected = [0; 2];
            world.spi(began, ended - began, &mosi, &mut expected);
            assert_eq!(miso, expected, "slot {slot}, {mosi:02X?}");
            bench.pass_until(bench.now + 51_000);
        }
    }
    // the serial number
    transfer(&mut bench, &[0x61, 0x15]);
    bench.pass_until(bench.now + 60_000);
    let mut mosi = [0; 16];
    mosi[15] = 1;
    let (serial, _) = transfer(&mut bench, &mosi);
    assert!(serial.starts_with(b"BT"), "{serial:?}");
}

#[test]
fn a_wrong_clock_phase_and_a_missing_select_are_noticed() {
    let odd = |word: &[u8]| word.iter().all(|byte| byte.count_ones() % 2 == 1);
    let mut bench = Bench::new();
    // CPHA
    start_spi(&mut bench, 1);
    bench.pass_until(101 * MS);
    let mut bad = 0;
    for slot in 0..200u64 {
        bench.pass_until(101 * MS + slot * 227_273);
        transfer(&mut bench, &[0x80, 0]);
        bench.pass_until(bench.now + 51_000);
        bad += u32::from(!odd(&transfer(&mut bench, &[0, 1]).0));
    }
    // about every other one, where a few dozen in a second are a bad link to the guard
    assert!(bad > 50, "{bad} of 200 words are bad");
    // right again, and no part selected
    start_spi(&mut bench, 0);
    bench.write(0x4001_300C, 0x80);
    let ends = bench.board.part.next_event().unwrap();
    bench.pass_until(ends.0);
    assert_eq!(bench.read(0x4001_300C), 0xFF);
}

#[test]
fn every_pulse_of_tim1_is_a_step_with_its_instant() {
    const TIM1: u64 = 0x4001_0000;
    let mut bench = Bench::new();
    {
        let mut rig = lock(&bench.rig);
        rig.step_port(0, None);
        rig.lever_enable(0, true);
    }
    // 2 MHz; 1000 steps/s, 5 us high; PWM mode 1 on channel 1; main output on
    for (register, value) in [
        (0x28, 7),
        (0x2C, 1999),
        (0x34, 10),
        (0x18, 6 << 4),
        (0x20, 1),
        (0x44, 1 << 15),
        (0x14, 1),
        (0x00, 1),
    ] {
        bench.write(TIM1 + register, value);
    }
    let up = lock(&bench.rig).world().truth().tip_mm;
    bench.pass_until(100 * MS + MS / 2);
    let mut rig = lock(&bench.rig);
    let edges: Vec<(u64, bool)> = rig
        .trace()
        .filter_map(|(at, output)| match output {
            Output::LeverStep(high) => Some((*at, *high)),
            _ => None,
        })
        .collect();
    let rises: Vec<u64> = edges.iter().filter(|e| e.1).map(|e| e.0).collect();
    assert!((100..=101).contains(&rises.len()), "{}", rises.len());
    assert!(rises.windows(2).all(|pair| pair[1] - pair[0] == MS));
    assert!(
        edges
            .windows(2)
            .filter(|pair| pair[0].1)
            .all(|pair| pair[1].0 - pair[0].0 == 5_000)
    );
    let truth = rig.world().truth();
    assert_eq!(truth.lever_bad_pulses, 0);
    let moved_mm = truth.tip_mm - up;
    // but for the step that the motor was pulled into when it got current
    assert!(
        (moved_mm - 0.000_625 * rises.len() as f64).abs() < 0.02,
        "{moved_mm}"
    );
}

#[test]
fn the_stages_duty_changes_where_a_period_begins_and_nothing_stops_the_core_in_between() {
    const TIM3: u64 = 0x4000_0400;
    const PERIOD: u64 = 50_000;
    let mut bench = Bench::new();
    lock(&bench.rig).stage_port(0, None);
    lock(&bench.rig).stage_dir(0, true);
    // 16 MHz, 20 kHz; PWM mode 1 on channel 1, compare and reload with shadows
    for (register, value) in [
        (0x2C, 799),
        (0x18, 0b1101 << 3),
        (0x20, 1),
        (0x14, 1),
        (0x00, 0x81),
    ] {
        bench.write(TIM3 + register, value);
    }
    let mut expected = Vec::new();
    for (n, compare) in [200, 600, 600, 0, 799, 801, 1].into_iter().enumerate() {
        // at the beginning of a period, and later and later in it
        bench.pass_until(n as u64 * (2 * MS + 7_310) + MS);
        bench.write(TIM3 + 0x34, compare);
        let duty = (compare as f64 / 800.0).min(1.0);
        if expected.last().is_none_or(|(_, last)| *last != duty) {
            expected.push(((bench.now + 1).next_multiple_of(PERIOD), duty));
        }
    }
    bench.pass_until(20 * MS);
    assert_eq!(bench.board.part.next_event(), None);
    let rig = lock(&bench.rig);
    let duties: Vec<(u64, f64)> = rig
        .trace()
        .filter_map(|(at, output)| match output {
            Output::StageDuty(duty) => Some((*at, *duty)),
            _ => None,
        })
        .collect();
    assert_eq!(duties.len(), expected.len(), "{duties:?}");
    for (seen, expected) in duties.iter().zip(expected) {
        // widths are whole ns
        let off = (seen.1 - expected.1).abs();
        assert!(seen.0 == expected.0 && off < 2e-5, "{seen:?} {expected:?}");
    }
}
