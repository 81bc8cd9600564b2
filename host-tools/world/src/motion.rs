//! The optical sensor of motion with the core's driver, on a bus of 2 MHz in mode 3.

use std::convert::Infallible;

use embedded_hal::spi::{ErrorType, Operation, SpiDevice};
use tactus_core::sensor::paa5100je::Paa5100je;

use super::flow::{BYTE_NS, Flow, Ground};

#[derive(Debug)]
struct Bus {
    flow: Flow,
    now_ns: u64,
    x_mm: f64,
    pauses: f64,
}

impl Bus {
    fn pass(&mut self, ns: u64) {
        self.now_ns += ns;
        self.flow.moves(self.now_ns, self.x_mm);
    }

    fn byte(&mut self, mosi: u8) -> u8 {
        let begins_ns = self.now_ns;
        self.pass(BYTE_NS);
        self.flow.byte(begins_ns, self.now_ns, mosi)
    }
}

impl ErrorType for Bus {
    type Error = Infallible;
}

impl SpiDevice for Bus {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
        self.flow.select();
        for operation in operations {
            match operation {
                Operation::Write(bytes) => bytes.iter().for_each(|byte| {
                    self.byte(*byte);
                }),
                Operation::Read(bytes) => bytes.iter_mut().for_each(|byte| *byte = self.byte(0)),
                Operation::Transfer(answers, bytes) => {
                    let each = answers.iter_mut().zip(bytes.iter());
                    each.for_each(|(answer, byte)| *answer = self.byte(*byte));
                }
                Operation::TransferInPlace(bytes) => {
                    bytes.iter_mut().for_each(|byte| *byte = self.byte(*byte));
                }
                Operation::DelayNs(ns) => self.pass((f64::from(*ns) * self.pauses) as u64),
            }
        }
        self.flow.deselect();
        Ok(())
    }
}

/// The part and who asks it.
#[derive(Debug)]
pub struct MotionSensor {
    driver: Paa5100je<Bus>,
}

impl MotionSensor {
    /// One over this ground that has just got its power.
    pub fn new(seed: u64, ground: Ground) -> Self {
        Self {
            driver: Paa5100je::new(Bus {
                flow: Flow::new(seed, ground),
                now_ns: 0,
                x_mm: 0.0,
                pauses: 1.0,
            }),
        }
    }

    /// The part.
    pub fn flow(&mut self) -> &mut Flow {
        &mut self.driver.bus().flow
    }

    /// The driver's counts when the probe has come here at that time.
    pub fn poll(&mut self, at_ns: u64, x_mm: f64) -> Option<[i16; 2]> {
        let bus = self.driver.bus();
        bus.x_mm = x_mm;
        bus.pass(at_ns.saturating_sub(bus.now_ns));
        self.driver.poll((at_ns / 1_000_000) as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::super::flow::HEIGHT_MM;
    use super::*;
    use tactus_core::sensor::paa5100je::{COUNTS_PER_MM, MotionFault};

    /// A probe that is read every 10 ms.
    struct Moving {
        sensor: MotionSensor,
        ns: u64,
        x_mm: f64,
    }

    impl Moving {
        fn over(ground: Ground) -> Self {
            Self {
                sensor: MotionSensor::new(1, ground),
                ns: 0,
                x_mm: 0.0,
            }
        }

        /// Counts and readings of a surface that was not seen, while it moves for so long.
        fn moved(&mut self, mm_s: f64, seconds: f64) -> (i32, usize) {
            let (mut counts, mut lost) = (0, 0);
            for _ in 0..(seconds * 100.0) as u32 {
                self.ns += 10_000_000;
                self.x_mm += mm_s * 0.01;
                match self.sensor.poll(self.ns, self.x_mm) {
                    Some([x, y]) => counts += i32::from(x) + i32::from(y),
                    None => lost += 1,
                }
            }
            (counts, lost)
        }

        fn fault(&self) -> Option<MotionFault> {
            self.sensor.driver.fault()
        }
    }

    #[test]
    fn the_driver_sets_it_up_and_measures_its_speed() {
        let mut probe = Moving::over(Ground::Seen(HEIGHT_MM));
        let (counts, starting) = probe.moved(25.0, 0.1);
        assert!(starting < 10 && counts > 0, "{starting} {counts}");
        assert!(probe.sensor.flow().is_set_up());
        for mm_s in [5.0, 25.0, 60.0, 250.0] {
            probe.moved(mm_s, 0.1);
            let (counts, lost) = probe.moved(mm_s, 1.2);
            let measured = f64::from(counts) / f64::from(COUNTS_PER_MM) / 1.2;
            assert!((measured / mm_s - 1.0).abs() < 0.03, "{measured} {mm_s}");
            assert_eq!(lost, 0);
        }
        // a millimetre nearer it counts 4 % more
        probe.sensor.flow().over(Ground::Seen(HEIGHT_MM - 1.0));
        probe.moved(25.0, 0.1);
        let (counts, _) = probe.moved(25.0, 1.2);
        let way_mm = f64::from(counts) / f64::from(COUNTS_PER_MM);
        assert!((way_mm / 31.25 - 1.0).abs() < 0.02, "{way_mm}");
        assert_eq!(probe.sensor.flow().refused(), 0);
    }

    #[test]
    fn glass_and_air_are_lost_track_and_no_stillness() {
        for ground in [Ground::Glass, Ground::Seen(40.0), Ground::Seen(10.0)] {
            let mut probe = Moving::over(ground);
            assert_eq!(probe.moved(25.0, 0.5), (0, 50), "{ground:?}");
            assert_eq!(probe.fault(), None);
        }
    }

    /// The part would stop after ten minutes.
    #[test]
    fn after_long_stillness_it_is_started_again_before_it_stops() {
        let mut probe = Moving::over(Ground::Seen(HEIGHT_MM));
        probe.moved(0.0, 1.0);
        let (_, lost) = probe.moved(0.0, 720.0);
        assert!((11 * 5..=12 * 8).contains(&lost), "{lost}");
        let (counts, lost) = probe.moved(25.0, 0.5);
        assert!(counts > 100 && lost <= 8, "{counts} {lost}");
    }

    #[test]
    fn a_pulled_plug_is_told_and_a_plug_put_back_is_noticed() {
        let mut probe = Moving::over(Ground::Seen(HEIGHT_MM));
        probe.moved(25.0, 0.5);
        probe.sensor.flow().unplug(true);
        assert_eq!(probe.moved(25.0, 0.5), (0, 50));
        assert_eq!(probe.fault(), Some(MotionFault::Identity([0xFF; 2])));
        probe.sensor.flow().unplug(false);
        probe.moved(25.0, 1.0);
        let (counts, lost) = probe.moved(25.0, 0.5);
        assert!(counts > 100 && lost == 0, "{counts} {lost}");
        assert_eq!(probe.fault(), None);
        // plugged in again between two readings
        probe.sensor.flow().unplug(true);
        probe.sensor.flow().unplug(false);
        probe.moved(25.0, 0.01);
        assert_eq!(probe.fault(), Some(MotionFault::Forgot));
    }

    #[test]
    fn a_part_whose_registers_do_not_read_back_measures_all_the_same() {
        let mut probe = Moving::over(Ground::Seen(HEIGHT_MM));
        probe.sensor.flow().write_only();
        let (counts, starting) = probe.moved(25.0, 1.0);
        assert!(counts > 200 && starting < 10, "{counts} {starting}");
        assert_eq!(probe.fault(), None);
    }

    #[test]
    fn pauses_that_are_too_short_are_refused() {
        let mut probe = Moving::over(Ground::Seen(HEIGHT_MM));
        probe.sensor.driver.bus().pauses = 0.5;
        assert_eq!(probe.moved(25.0, 0.5), (0, 50));
        assert!(matches!(probe.fault(), Some(MotionFault::Identity(_))));
        assert!(probe.sensor.flow().refused() > 0);
    }
}
