//! The driver on a mocked bus: every worked word, every command, both patterns, blocking, async and split.

use std::cell::RefCell;
use std::rc::Rc;
use std::string::ToString;
use std::vec;
use std::vec::Vec;

use embassy_futures::block_on;
use embedded_hal::delay::DelayNs;
use embedded_hal::spi::{ErrorKind, ErrorType, Operation, SpiDevice};
use embedded_hal_mock::eh1::delay::{CheckedDelay, Transaction as Delay};
use embedded_hal_mock::eh1::spi::{Mock, Transaction as Spi};

use super::*;
use crate::sensor::driver::{Driver, Error};
use crate::sensor::pressure::{self, Calibration, Counts, Pressure};

type MockDriver = Driver<BioTac, Mock<u8>, CheckedDelay>;

/// The rows of the worked table: word, and value or error.
fn worked_words() -> Vec<([u8; 2], Result<u16, WordError>)> {
    vec![
        ([0x01, 0x01], Ok(0)),
        ([0xFE, 0xF8], Ok(4095)),
        ([0x80, 0x01], Ok(2048)),
        ([0x7F, 0x29], Ok(2021)),
        ([0xA2, 0x08], Ok(2593)),
        ([0x81, 0x01], Err(WordError::Parity(BadParity::Byte0))),
        ([0x80, 0x41], Err(WordError::Parity(BadParity::Byte1))),
        ([0x86, 0x01], Ok(2144)),
        (
            [0xA5, 0x2D],
            Err(WordError::ErrorFrame(ErrorCode::SamplingDelay)),
        ),
        ([0xFF, 0xFF], Err(WordError::NoSensor)),
        ([0x00, 0x00], Err(WordError::NoSensor)),
    ]
}

/// A command and the read of its answer on the bus.
fn exchange(command: [u8; 2], mosi: &[u8], miso: &[u8]) -> Vec<Spi<u8>> {
    vec![
        Spi::transaction_start(),
        Spi::write_vec(command.to_vec()),
        Spi::transaction_end(),
        Spi::transaction_start(),
        Spi::transfer_in_place(mosi.to_vec(), miso.to_vec()),
        Spi::transaction_end(),
    ]
}

fn sample(command: u8, miso: [u8; 2]) -> Vec<Spi<u8>> {
    exchange([command, 0x00], &[0x00, 0x01], &miso)
}

fn blocking_delays(exchanges: usize) -> Vec<Delay> {
    let one = [Delay::blocking_delay_us(50), Delay::blocking_delay_us(10)];
    vec![one; exchanges].concat()
}

fn async_delays(exchanges: usize) -> Vec<Delay> {
    let one = [Delay::async_delay_us(50), Delay::async_delay_us(10)];
    vec![one; exchanges].concat()
}

fn with_driver(bus: &[Spi<u8>], delays: &[Delay], test: impl FnOnce(&mut MockDriver)) {
    let mut driver = Driver::new(BioTac, Mock::new(bus), CheckedDelay::new(delays));
    test(&mut driver);
    let (mut spi, mut delay) = driver.release();
    spi.done();
    delay.done();
}

#[test]
fn every_worked_word_comes_out_of_both_drivers() {
    for (n, channel, command) in [
        (0, pressure::Channel::Pac, 0x80),
        (1, pressure::Channel::Pdc, 0x83),
    ] {
        for (word, expected) in worked_words() {
            let expected = expected
                .map(|value| Pressure {
                    channel,
                    counts: Counts::new(value).unwrap(),
                })
                .map_err(Error::Sensor);
            let bus = sample(command, word);
            with_driver(&bus, &blocking_delays(1), |driver| {
                assert_eq!(driver.sample(n), expected, "{word:02X?}");
            });
            with_driver(&bus, &async_delays(1), |driver| {
                let sample = block_on(driver.sample_async(n));
                assert_eq!(sample, expected, "{word:02X?}");
            });
        }
    }
}

#[test]
fn every_channel_is_sampled_by_its_command() {
    const COMMANDS: [u8; 24] = [
        0x80, 0x83, 0x85, 0x86, 0x9E, 0xA2, 0xA4, 0xA7, 0xA8, 0xAB, 0xAD, 0xAE, 0xB0, 0xB3, 0xB5,
        0xB6, 0xB9, 0xBA, 0xBC, 0xBF, 0xC1, 0xC2, 0xC4, 0xC7,
    ];
    let bus = COMMANDS.map(|c| sample(c, [0x7F, 0x29])).concat();
    with_driver(&bus, &blocking_delays(24), |driver| {
        for channel in Channel::ALL {
            let word = driver.perform(&channel.transactions()).unwrap();
            assert_eq!(
                decode(word[..].try_into().unwrap()),
                Ok(Counts::new(2021).unwrap())
            );
        }
    });
    with_driver(&bus, &async_delays(24), |driver| {
        for channel in Channel::ALL {
            let word = block_on(driver.perform_async(&channel.transactions())).unwrap();
            assert_eq!(
                decode(word[..].try_into().unwrap()),
                Ok(Counts::new(2021).unwrap())
            );
        }
    });
}

#[test]
fn pressures_take_turns_on_the_bus_and_become_pascals_and_newtons() {
    let bus = [
        sample(0x80, [0x80, 0x01]),
        sample(0x83, [0xA2, 0x08]),
        sample(0x80, [0x7F, 0x29]),
        sample(0x83, encode(Counts::new(2593 + 110).unwrap())),
    ]
    .concat();
    with_driver(&bus, &blocking_delays(4), |driver| {
        let calibration = Calibration::PAPER;
        let pascals: Vec<f32> = (0..4)
            .map(|slot| driver.sample(slot).unwrap())
            .map(|p| calibration.pascals(p.channel, f32::from(p.counts.get())))
            .collect();
        assert_eq!(pascals[..2], [0.0, 0.0]);
        assert!((pascals[2] + 10.07).abs() < 0.01);
        assert!((pascals[3] - 4065.6).abs() < 1.0);
    });
}

#[test]
fn the_makers_44_slots_go_over_the_bus_in_order() {
    let mut bus = Vec::new();
    let others = [
        0xA2, 0xA4, 0xA7, 0xA8, 0xAB, 0xAD, 0xAE, 0xB0, 0xB3, 0xB5, 0xB6, 0xB9, 0xBA, 0xBC, 0xBF,
        0xC1, 0xC2, 0xC4, 0xC7, 0x83, 0x85, 0x86,
    ];
    for other in others {
        bus.extend(sample(other, [0xA2, 0x08]));
        bus.extend(sample(0x80, [0x80, 0x01]));
    }
    with_driver(&bus, &blocking_delays(44), |driver| {
        for channel in FULL_FRAME {
            let word = driver.perform(&channel.transactions()).unwrap();
            let value = if channel == Channel::Pac { 2048 } else { 2593 };
            assert_eq!(
                decode(word[..].try_into().unwrap()),
                Ok(Counts::new(value).unwrap())
            );
        }
    });
}

#[test]
fn power_up_waits_100_ms() {
    with_driver(&[], &[Delay::blocking_delay_ms(100)], |driver| {
        driver.power_up();
    });
    with_driver(&[], &[Delay::async_delay_ms(100)], |driver| {
        block_on(driver.power_up_async());
    });
}

fn identity_bus(serial: &[u8; 16]) -> Vec<Spi<u8>> {
    [
        exchange([0x61, 0x15], &[0; 16], serial),
        exchange([0x61, 0x13], &[0; 4], b"0234"),
        exchange([0x61, 0x10], &[0; 2], b"21"),
        exchange([0x61, 0x61], &[0; 2], &[0x3E, 0x80]),
        exchange([0x61, 0x70], &[0; 2], &[0x11, 0x30]),
    ]
    .concat()
}

#[test]
fn the_identity_is_read_property_by_property() {
    let check = |identity: Identity| {
        assert_eq!(identity.serial.as_str(), "BT0123456789ABCD");
        assert_eq!(identity.firmware.as_str(), "0234");
        assert_eq!(identity.flex.as_str(), "21");
        assert_eq!(identity.cpu_khz, 16_000);
        assert_eq!(identity.sampling_rate, Some(4400));
    };
    let bus = identity_bus(b"BT0123456789ABCD");
    with_driver(&bus, &blocking_delays(5), |driver| {
        check(driver.identity().unwrap());
    });
    with_driver(&bus, &async_delays(5), |driver| {
        check(block_on(driver.identity_async()).unwrap());
    });
}

#[test]
fn a_garbled_identity_is_an_error() {
    let mut serial = *b"BT0123456789ABCD";
    serial[15] = 0x92;
    let bus = identity_bus(&serial);
    let expected = Err(Error::Sensor(PropertyError::NotText {
        property: Property::Serial,
        at: 15,
        byte: 0x92,
    }));
    with_driver(&bus, &blocking_delays(5), |driver| {
        assert_eq!(driver.identity(), expected);
    });
    with_driver(&bus, &async_delays(5), |driver| {
        assert_eq!(block_on(driver.identity_async()), expected);
    });
}

/// The calls to a bus and a delay in one order: two mocks cannot tell which came first.
#[derive(Clone, PartialEq, Eq, Debug)]
enum Event {
    /// MOSI of a transaction, chip select low before and high after.
    Bus(Vec<u8>),
    WaitNs(u32),
}

/// Bus and delay of a sensor that answers 2593 to everything, and fails from a given transaction on.
#[derive(Clone)]
struct Recorder {
    events: Rc<RefCell<Vec<Event>>>,
    fail_at: usize,
}

impl Recorder {
    fn new(fail_at: usize) -> Self {
        let events = Rc::default();
        Self { events, fail_at }
    }

    fn log(&self) -> Vec<Event> {
        self.events.borrow().clone()
    }

    fn transact(&self, operations: &mut [Operation<'_, u8>]) -> Result<(), ErrorKind> {
        let mut events = self.events.borrow_mut();
        let done = events.iter().filter(|e| matches!(e, Event::Bus(_))).count();
        if done >= self.fail_at {
            return Err(ErrorKind::Overrun);
        }
        let mut mosi = Vec::new();
        for operation in operations {
            match operation {
                Operation::Write(bytes) => mosi.extend(bytes.iter()),
                Operation::TransferInPlace(bytes) => {
                    mosi.extend(bytes.iter());
                    bytes.copy_from_slice(&[0xA2, 0x08]);
                }
                other => panic!("{other:?} is not part of the protocol"),
            }
        }
        events.push(Event::Bus(mosi));
        Ok(())
    }
}

impl ErrorType for Recorder {
    type Error = ErrorKind;
}

impl SpiDevice for Recorder {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), ErrorKind> {
        self.transact(operations)
    }
}

impl embedded_hal_async::spi::SpiDevice for Recorder {
    async fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), ErrorKind> {
        self.transact(operations)
    }
}

impl DelayNs for Recorder {
    fn delay_ns(&mut self, ns: u32) {
        self.events.borrow_mut().push(Event::WaitNs(ns));
    }
}

impl embedded_hal_async::delay::DelayNs for Recorder {
    async fn delay_ns(&mut self, ns: u32) {
        self.events.borrow_mut().push(Event::WaitNs(ns));
    }
}

fn one_sample() -> Vec<Event> {
    vec![
        Event::Bus(vec![0x83, 0x00]),
        Event::WaitNs(50_000),
        Event::Bus(vec![0x00, 0x01]),
        Event::WaitNs(10_000),
    ]
}

#[test]
fn the_gap_lies_between_command_and_read_with_chip_select_high() {
    let recorder = Recorder::new(usize::MAX);
    let mut driver = Driver::new(BioTac, recorder.clone(), recorder.clone());
    let blocking = driver.sample(1).unwrap();
    assert_eq!(recorder.log(), one_sample());
    let awaited = block_on(driver.sample_async(1)).unwrap();
    assert_eq!(recorder.log(), [one_sample(), one_sample()].concat());
    assert_eq!(blocking, awaited);
    assert_eq!(blocking.counts.get(), 2593);
}

#[test]
fn a_failing_bus_ends_the_exchange_and_is_passed_on() {
    for (fail_at, before) in [(0, 0), (1, 2)] {
        let expected = Err(Error::Bus(ErrorKind::Overrun));
        let recorder = Recorder::new(fail_at);
        let mut driver = Driver::new(BioTac, recorder.clone(), recorder.clone());
        assert_eq!(driver.sample(1), expected);
        assert_eq!(recorder.log(), one_sample()[..before]);

        let recorder = Recorder::new(fail_at);
        let mut driver = Driver::new(BioTac, recorder.clone(), recorder.clone());
        let awaited = block_on(driver.sample_async(1));
        assert_eq!(awaited, expected);
        assert_eq!(recorder.log(), one_sample()[..before]);
    }
    let recorder = Recorder::new(0);
    let mut driver = Driver::new(BioTac, recorder.clone(), recorder.clone());
    let bus = Error::Bus(ErrorKind::Overrun);
    assert_eq!(driver.identity(), Err(bus));
    assert_eq!(block_on(driver.identity_async()), Err(bus));
    assert_eq!(bus.to_string(), "SPI bus failed: Overrun");
    let word = Error::<ErrorKind, _>::Sensor(WordError::NoSensor);
    assert_eq!(word.to_string(), WordError::NoSensor.to_string());
}
