//! Settings of an SPI that is on, and resets of peripherals, which turn it off.

use stm32_metapac::metadata::{METADATA, Peripheral};

use super::{Now, Referee, Rule};

/// Fields of CR1 that stand while SPE is set (RM0090 28.3.1, 28.5.1).
const FIELDS: [&str; 7] = ["CPHA", "CPOL", "BR", "LSBFIRST", "DFF", "CRCEN", "BIDIMODE"];

impl Referee {
    /// Checks a store to CR1: what an SPI that was on keeps.
    pub(super) fn spi_running(
        &mut self,
        now: Now,
        of: &'static Peripheral,
        before: u32,
        after: u32,
    ) {
        if before & self.bits(of, "CR1", "SPE") == 0 {
            return;
        }
        let changed = before ^ after;
        for field in FIELDS {
            if changed & self.bits(of, "CR1", field) != 0 {
                self.tell(now, Rule::SpiRunning, format!("{} {field}", of.name));
            }
        }
    }

    /// Peripherals whose bits rose in a register of resets begin with their reset values.
    pub(super) fn resets(&mut self, register: u64, rose: u32) {
        for number in 0..METADATA.peripherals.len() {
            let [_, reset] = self.vendor.switches(number);
            if reset.is_some_and(|(at, bits)| at == register && bits & rose != 0) {
                let words = self.vendor.words();
                let own = words.filter(|(_, word)| word.peripheral == number);
                self.written
                    .extend(own.map(|(address, word)| (address, word.reset)));
            }
        }
    }
}
