//! The conditions for starting a converter by software.

use std::collections::BTreeMap;

use stm32_metapac::metadata::{METADATA, Peripheral};

use super::violation::Rule;

/// Fastest clock of a converter, MHz, from 2.4 V on (data sheet, table 74).
const FASTEST_MHZ: u32 = 36;
/// From switching it on to its first conversion, ns (data sheet, table 74: t_STAB).
const STEADY_NS: u64 = 3000;
/// Bits of CR2 (RM0090 13.13.3).
const ADON: u32 = 1;
const CONT: u32 = 1 << 1;
const DMA: u32 = 1 << 8;
const DDS: u32 = 1 << 9;
const SWSTART: u32 = 1 << 30;
/// Bits of a stream's CR (RM0090 10.5.5).
const EN: u32 = 1;
const CIRC: u32 = 1 << 8;
const STREAMS: usize = 8;

/// The converters and when each was switched on, ns.
#[derive(Clone, Debug, Default)]
pub(super) struct Converters(BTreeMap<&'static str, u64>);

impl Converters {
    /// A store to CR2 of a converter on a bus of so many MHz, with CR2 before and after it: returns the violation, or
    /// `None` if it starts no conversion. `word` is a register of a peripheral as the firmware set it.
    pub(super) fn store(
        &mut self,
        of: &'static Peripheral,
        at_ns: u64,
        [before, after]: [u32; 2],
        bus_mhz: u32,
        word: impl Fn(&str, &str) -> u32,
    ) -> Option<Vec<(Rule, String)>> {
        if after & !before & ADON != 0 {
            self.0.insert(of.name, at_ns);
        }
        if after & !before & SWSTART == 0 {
            return None;
        }
        let on_ns = self.0.get(of.name).copied().unwrap_or(0);
        let mut wrong = Vec::new();
        if after & ADON == 0 || at_ns < on_ns + STEADY_NS {
            wrong.push((Rule::Unsteady, of.name.to_owned()));
        }
        // RM0090 13.8.1: without DDS the stream's last transfer is the last request
        if after & (CONT | DMA | DDS) == CONT | DMA && fills_a_ring(of, &word) {
            wrong.push((Rule::RequestsEnd, of.name.to_owned()));
        }
        let prescaler = word("ADC123_COMMON", "CCR") >> 16 & 3;
        let mhz = bus_mhz / (2 * (prescaler + 1));
        if mhz > FASTEST_MHZ {
            wrong.push((Rule::ConverterClock, format!("{} at {mhz} MHz", of.name)));
        }
        Some(wrong)
    }
}

/// Returns true if a stream that takes a converter's data begins again at its end.
fn fills_a_ring(of: &Peripheral, word: impl Fn(&str, &str) -> u32) -> bool {
    let controllers = METADATA.peripherals.iter().filter(|peripheral| {
        let registers = peripheral.registers.as_ref();
        registers.is_some_and(|registers| registers.kind == "dma")
    });
    let mut streams = controllers.flat_map(|dma| (0..STREAMS).map(move |n| (dma.name, n)));
    streams.any(|(dma, n)| {
        let from = u64::from(word(dma, &format!("ST{n}.PAR")));
        let control = word(dma, &format!("ST{n}.CR"));
        control & (EN | CIRC) == EN | CIRC && from >> 8 == of.address >> 8
    })
}
