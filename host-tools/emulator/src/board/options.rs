//! Options of a run.

use std::num::NonZeroU64;

use tactus_world::flow::Ground;

/// Options of a run.
#[derive(Clone, Debug)]
pub struct Options {
    /// Instructions in a second of virtual time; the board's core makes about this many.
    pub instructions_per_second: NonZeroU64,
    /// Length of a step of switches, log and truth, ns. Sensor, encoder, STEP, PWM and current are exact in any case.
    pub tick_ns: u64,
    /// Time for which changes at the outputs are kept, s: [`Rig::trace`](super::Rig::trace).
    pub trace_s: u64,
    /// True if the debug probe gives its 8 MHz at power-up.
    pub clock: bool,
    /// Contents of the firmware's store at power-up, from [`Emulator::store`](super::Emulator::store); blank otherwise.
    pub store: Option<Vec<u8>>,
    /// BOR_LEV of the chip's option bytes: 0 is level 3, 3 is off, as the chip is delivered (RM0090 3.9.10).
    pub brown_out: u8,
    /// Ground under the handheld's sensor of motion, if there is one.
    pub motion: Option<Ground>,
    /// True if the core has its MPU, with which the firmware guards its stack. Each access is checked then, which takes
    /// twice the time; without, the firmware's writes to the MPU have no effect, as on a part that has none.
    pub mpu: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            instructions_per_second: NonZeroU64::new(168_000_000).expect("it is not 0"),
            tick_ns: 100_000,
            trace_s: 2,
            clock: true,
            store: None,
            brown_out: 3,
            motion: None,
            mpu: false,
        }
    }
}
