//! The signals of the pins: the contract between the firmware's board and the rig.

use rigless::soc::stm32f427::peripherals::gpio::Pin;

/// A pin of the chip: its port, 0 for A, and its number.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct PinId(u8, u8);

impl PinId {
    /// Index of its port, 0 for A.
    pub(crate) fn port(self) -> usize {
        self.0.into()
    }

    pub(crate) fn number(self) -> u8 {
        self.1
    }

    pub(crate) fn pin(self) -> Pin {
        Pin::new(self.1).expect("the pins below are 0 to 15")
    }
}

const A: u8 = 0;
const B: u8 = 1;
const C: u8 = 2;
const D: u8 = 3;
const E: u8 = 4;
const F: u8 = 5;

/// Chip select of the sensor, low active.
pub const SENSOR_CS: PinId = PinId(D, 14);
/// That of a finger's second part.
pub(crate) const SENSOR_CS_2: PinId = PinId(D, 15);
/// The sensor's clock, MISO and MOSI, with SPI1's alternate function.
pub(crate) const SENSOR_SPI: [PinId; 3] = [PinId(A, 5), PinId(A, 6), PinId(B, 5)];
pub(crate) const SPI1_FUNCTION: u8 = 5;
/// Chip select of the handheld's sensor of motion, low active; its clock, MISO and MOSI, with SPI4's alternate
/// function.
pub(crate) const MOTION_CS: PinId = PinId(E, 4);
pub(crate) const MOTION_SPI: [PinId; 3] = [PinId(E, 2), PinId(E, 5), PinId(E, 6)];
pub(crate) const SPI4_FUNCTION: u8 = 5;
/// Each rising edge is a step of the lever.
pub(crate) const LEVER_STEP: PinId = PinId(E, 9);
pub(crate) const TIM1_FUNCTION: u8 = 1;
/// High is down.
pub const LEVER_DIR: PinId = PinId(E, 11);
/// High gives current.
pub const LEVER_ENABLE: PinId = PinId(E, 13);
/// Magnitude of the stage's duty.
pub(crate) const STAGE_PWM: PinId = PinId(C, 6);
/// TIM3's and TIM4's.
pub(crate) const TIM3_4_FUNCTION: u8 = 2;
/// High is towards higher positions.
pub(crate) const STAGE_DIR: PinId = PinId(C, 7);
/// High switches the bridge on.
pub const STAGE_ENABLE: PinId = PinId(C, 8);
/// Lines A and B of the stage's encoder.
pub(crate) const ENCODER: [PinId; 2] = [PinId(D, 12), PinId(D, 13)];
/// Normally closed to ground; high is actuated, or a cut wire.
pub(crate) const LEVER_TOP: PinId = PinId(F, 12);
pub(crate) const E_STOP: PinId = PinId(F, 13);
pub(crate) const STAGE_LOWER: PinId = PinId(F, 14);
pub(crate) const STAGE_UPPER: PinId = PinId(F, 15);
/// Clock and data of the handheld's display, with I2C1's alternate function.
pub(crate) const DISPLAY_I2C: [PinId; 2] = [PinId(B, 8), PinId(B, 9)];
pub(crate) const I2C1_FUNCTION: u8 = 4;
/// The handheld's buzzer, with TIM8's.
pub(crate) const BUZZER: PinId = PinId(C, 9);
pub(crate) const TIM8_FUNCTION: u8 = 3;
/// High is pressed.
pub(crate) const BUTTON: PinId = PinId(C, 13);
/// LD1 green, LD2 blue, LD3 red.
pub(crate) const LEDS: [PinId; 3] = [PinId(B, 0), PinId(B, 7), PinId(B, 14)];

/// Go / no-go: high while the last verification said "the same".
pub(crate) const GO: PinId = PinId(C, 10);

/// Levels that resistors of the drivers give to pins that the chip leaves alone, so that nothing moves in a reset.
pub(crate) const REST_LEVELS: [(PinId, bool); 10] = [
    (SENSOR_CS, true),
    (SENSOR_CS_2, true),
    (LEVER_STEP, false),
    (LEVER_DIR, false),
    (LEVER_ENABLE, false),
    (STAGE_PWM, false),
    (STAGE_DIR, false),
    (STAGE_ENABLE, false),
    (BUTTON, false),
    (GO, false),
];
