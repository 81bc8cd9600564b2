//! The chip's edge lines, which rigless lacks.

use rigless::device::{Device, DeviceContext, RegisterFile};
use rigless::soc::stm32f427::generated::exti::Register as ExtiRegister;

/// EXTI's lines 0 to 15 (RM0090 12.2).
#[derive(Debug, Default)]
pub(super) struct Exti {
    pending: u64,
    /// NVIC outputs that are high
    raised: u64,
}

impl Exti {
    /// Lines behind each interrupt of the instance: the first one is PVD's.
    const LINES: [u64; 8] = [0, 1, 2, 4, 8, 16, 0x03e0, 0xfc00];

    pub(super) fn edge(
        &mut self,
        line: u8,
        rising: bool,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        let select = if rising {
            ExtiRegister::Rtsr
        } else {
            ExtiRegister::Ftsr
        };
        self.pending |= registers.get(select) & 1 << line;
        self.refresh(registers, context);
    }

    fn refresh(&mut self, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        registers.set(ExtiRegister::Pr, self.pending);
        let active = self.pending & registers.get(ExtiRegister::Imr);
        for (output, lines) in Self::LINES.into_iter().enumerate() {
            let bit = 1 << output;
            match (active & lines != 0, self.raised & bit != 0) {
                (true, false) => context.raise(output),
                (false, true) => context.lower(output),
                _ => continue,
            }
            self.raised ^= bit;
        }
    }
}

impl Device for Exti {
    type Register = ExtiRegister;

    fn write(
        &mut self,
        register: ExtiRegister,
        value: u64,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        match register {
            ExtiRegister::Swier => self.pending |= value & registers.get(ExtiRegister::Imr),
            // a 1 clears the line, and what software set of it
            ExtiRegister::Pr => {
                self.pending &= !value;
                let software = registers.get(ExtiRegister::Swier);
                registers.set(ExtiRegister::Swier, software & !value);
            }
            _ => {}
        }
        self.refresh(registers, context);
    }

    fn reset(&mut self) {
        *self = Self::default();
    }
}
