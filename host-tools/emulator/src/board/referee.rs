//! Judges every access of the firmware to a peripheral by the vendor's documents of the chip, not by the models here:
//! stm32-metapac's metadata (clocks, alternate functions, DMA requests, registers and their fields) and ST's SVD (reset
//! values). Limits that neither has are quoted from RM0090 and the data sheet.

mod accelerator;
mod converter;
mod spi;
mod vendor;
mod violation;

use std::collections::{BTreeMap, BTreeSet};

use rigless::emulator::{Access, AccessKind, Hit, Host, Watch};
use rigless::soc::Bus;
use rustc_hash::FxHashMap;
use stm32_metapac::metadata::{METADATA, MemoryRegionKind, Peripheral};

use super::flash::{self, BSY, FLASH};
use super::registers::{IPSR, register, word};
pub use violation::{Rule, Violation};

use accelerator::Accelerator;
use converter::Converters;
use vendor::{Vendor, Word};

/// Status registers cleared by zeros (rc_w0). The vendor's library writes ones to their other bits, reserved ones too.
const CLEARED_BY_ZEROS: [(&str, &str); 3] = [("timer", "SR"), ("usart", "SR"), ("i2c", "SR1")];
/// Data registers take bytes, though the manual asks for half-words: the vendor's library and embassy write bytes.
const DATA: &str = "DR";

/// Kinds of peripherals whose registers are written by half-words or words (RM0090 12.3, 13.13, 17.4, 21.4, 27.6,
/// 30.6): a byte lands in all lanes.
const NO_BYTES: [&str; 6] = ["exti", "adc", "timer", "iwdg", "i2c", "usart"];
/// Exceptions before the chip's interrupts.
const FIRST_INTERRUPT: u32 = 16;
/// Modes of a pin (RM0090 8.4.1).
const ALTERNATE: u32 = 2;
const ANALOG: u32 = 3;
const INPUT: u32 = 0;
/// Ports, 1 KB each.
const PORTS: [&str; 11] = [
    "GPIOA", "GPIOB", "GPIOC", "GPIOD", "GPIOE", "GPIOF", "GPIOG", "GPIOH", "GPIOI", "GPIOJ",
    "GPIOK",
];

/// The pins that a signal of a started peripheral needs.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Wants {
    /// One pin or several.
    Pins,
    OnePin,
    /// At most one pin.
    NoTwo,
}

/// Kinds of peripherals, as [`METADATA`] has them, with the register and field that start them, and signals with a
/// field that must be set for each.
type Start = (
    &'static str,
    &'static str,
    &'static str,
    &'static [(&'static str, &'static str, Wants)],
);

const STARTS: [Start; 3] = [
    (
        "spi",
        "CR1",
        "SPE",
        &[("SPE", "SCK", Wants::Pins), ("SPE", "MISO", Wants::NoTwo)],
    ),
    (
        "usart",
        "CR1",
        "UE",
        &[("TE", "TX", Wants::Pins), ("RE", "RX", Wants::OnePin)],
    ),
    (
        "i2c",
        "CR1",
        "PE",
        &[("PE", "SCL", Wants::OnePin), ("PE", "SDA", Wants::OnePin)],
    ),
];

#[derive(Debug)]
pub(crate) struct Referee {
    vendor: &'static Vendor,
    /// Last value written to each word, or its reset value. It is meaningful only for words that the firmware alone
    /// changes.
    written: FxHashMap<u64, u32>,
    /// Encoders whose pins were checked since a pin or a timer's mode changed.
    encoders: BTreeSet<&'static str>,
    found: BTreeMap<(Rule, String), Violation>,
    /// The handler of interrupts that have none.
    no_handler: Option<u64>,
    accelerator: Accelerator,
    converters: Converters,
}

/// The access that is judged.
#[derive(Clone, Copy)]
struct Now {
    at_ns: u64,
    instruction: Option<u64>,
}

impl Now {
    /// `None`: a debugger may do all.
    fn of(access: &Access) -> Option<Self> {
        Some(Self {
            at_ns: access.virtual_time.0,
            instruction: Some(access.program_counter?),
        })
    }
}

impl Referee {
    pub(crate) fn new(bus: &Bus) -> Self {
        let mut referee = Self {
            vendor: Vendor::of(bus),
            written: FxHashMap::default(),
            encoders: BTreeSet::new(),
            found: BTreeMap::new(),
            no_handler: None,
            accelerator: Accelerator::default(),
            converters: Converters::default(),
        };
        referee.reset();
        referee
    }

    pub(crate) fn reset(&mut self) {
        let words = self.vendor.words();
        self.written = words.map(|(address, word)| (address, word.reset)).collect();
        self.accelerator = Accelerator::default();
        self.encoders.clear();
        self.converters = Converters::default();
    }

    /// Watches where interrupts end that have no handler: the most frequent of the vectors.
    pub(crate) fn watch(&mut self, host: &mut dyn Host) {
        let vectors = METADATA.interrupts.iter().map(|interrupt| {
            let vector = 4 * (FIRST_INTERRUPT + interrupt.number);
            word(FLASH as u32 + vector, host)
        });
        let mut times: BTreeMap<u32, usize> = BTreeMap::new();
        for vector in vectors.filter(|vector| *vector != 0) {
            *times.entry(vector & !1).or_default() += 1;
        }
        let most = times.into_iter().max_by_key(|(_, times)| *times);
        // one that an interrupt has of its own is a handler
        if let Some((address, 2..)) = most
            && host.watch(Watch::Instruction(address.into()))
        {
            self.no_handler = Some(address.into());
        }
    }

    /// The core came to something that is watched.
    pub(crate) fn arrived(&mut self, hit: &Hit, host: &mut dyn Host) {
        if self.no_handler != Some(hit.address) {
            return;
        }
        let exception = register(host, IPSR).unwrap_or(0);
        let number = exception.checked_sub(FIRST_INTERRUPT);
        let mut all = METADATA.interrupts.iter();
        let known = all.find(|interrupt| Some(interrupt.number) == number);
        let name = known.map_or("an exception of the core", |interrupt| interrupt.name);
        let now = Now {
            at_ns: hit.at.0,
            instruction: None,
        };
        self.tell(now, Rule::NoHandler, name.to_owned());
    }

    pub(crate) fn found(&self) -> Vec<Violation> {
        self.found.values().cloned().collect()
    }

    fn tell(&mut self, now: Now, rule: Rule, what: String) {
        let violation = self.found.entry((rule, what.clone()));
        violation
            .or_insert(Violation {
                rule,
                what,
                at_ns: now.at_ns,
                instruction: now.instruction,
                times: 0,
            })
            .times += 1;
    }

    /// A word as the firmware set it.
    fn word(&self, peripheral: &str, register: &str) -> u32 {
        let address = self.vendor.address(peripheral, register);
        let word = address.and_then(|address| self.written.get(&address));
        word.copied().unwrap_or_default()
    }

    /// A field as the firmware set it.
    fn field(&self, peripheral: &str, register: &str, name: &str) -> Option<u32> {
        let (address, mask) = self.vendor.field(peripheral, register, name)?;
        let word = self.written.get(&address)?;
        Some((word & mask) >> mask.trailing_zeros())
    }

    fn bits(&self, of: &Peripheral, register: &str, name: &str) -> u32 {
        let place = self.vendor.field(of.name, register, name);
        place.map_or(0, |(_, bits)| bits)
    }

    pub(crate) fn access(&mut self, access: &Access) {
        let Some(now) = Now::of(access) else { return };
        if self.accelerator.is_missed(now.at_ns) {
            let acr = self.word("FLASH", "ACR");
            self.tell(now, Rule::Accelerator, format!("ACR {acr:#x}"));
        }
        let word = match self.vendor.at(access.address) {
            None => return,
            Some(Ok(word)) => word,
            Some(Err(number)) => {
                let Some(of) = METADATA.peripherals.get(number) else {
                    return;
                };
                let what = format!("{} at {:#x}", of.name, access.address - of.address);
                self.powered(now, number, &what);
                self.tell(now, Rule::NoRegister, what);
                return;
            }
        };
        let Some(of) = METADATA.peripherals.get(word.peripheral) else {
            return;
        };
        self.powered(now, word.peripheral, &word.name);
        let (bytes, within) = (u64::from(access.width.bytes()), access.address & 3);
        let kind = of.registers.as_ref().map_or("", |r| r.kind);
        let register = word.register();
        let narrow = access.kind == AccessKind::Write
            && bytes == 1
            && register != DATA
            && NO_BYTES.contains(&kind);
        if narrow || within + bytes > 4 || !within.is_multiple_of(bytes) {
            self.tell(now, Rule::Width, word.name.clone());
        }
        match access.kind {
            AccessKind::Read if !word.reads => {
                self.tell(now, Rule::WriteOnly, word.name.clone());
            }
            AccessKind::Write if !word.writes => {
                self.tell(now, Rule::ReadOnly, word.name.clone());
            }
            AccessKind::Read if kind == "timer" && register == "CNT" => self.encoder(now, of),
            AccessKind::Write => {
                let part = match bytes {
                    4 => u32::MAX,
                    bytes => ((1 << (8 * bytes)) - 1) << (8 * within),
                };
                let value = (access.value as u32) << (8 * within);
                self.store(now, of, word, access.address & !3, (value, part));
            }
            _ => {}
        }
    }

    /// Checks that a peripheral is clocked, and not held in reset.
    fn powered(&mut self, now: Now, number: usize, what: &str) {
        let [enabled, reset] = self.vendor.switches(number).map(|place| {
            let (address, bits) = place?;
            Some(self.written.get(&address)? & bits != 0)
        });
        if enabled == Some(false) {
            self.tell(now, Rule::Clock, what.to_owned());
        }
        if reset == Some(true) {
            self.tell(now, Rule::HeldInReset, what.to_owned());
        }
    }

    /// A store of a value to the bits of `part`.
    fn store(
        &mut self,
        now: Now,
        of: &'static Peripheral,
        word: &Word,
        address: u64,
        (value, part): (u32, u32),
    ) {
        let kind = of.registers.as_ref().map_or("", |r| r.kind);
        let register = word.register();
        let wrong = (value ^ word.reset) & !word.fields & part;
        if wrong != 0 && !CLEARED_BY_ZEROS.contains(&(kind, register)) {
            let what = format!("{}, bits {wrong:#010x}", word.name);
            self.tell(now, Rule::ReservedBits, what);
        }
        let before = self.written.get(&address).copied().unwrap_or_default();
        let after = before & !part | value & part;
        self.written.insert(address, after);
        if kind == "gpio" || register == "SMCR" {
            self.encoders.clear();
        }
        match (kind, register) {
            ("gpio", "MODER" | "AFR0" | "AFR1") => self.pins(now, of),
            ("dma", _) => self.dma(now, of, register, before, after),
            ("rcc", "CFGR" | "PLLCFGR") | ("flash", "ACR") => self.clocks(now),
            ("exti", "IMR0") => self.edges(now, after & !before),
            ("iwdg", "PR" | "RLR") if self.word("IWDG", "KR") != 0x5555 => {
                self.tell(now, Rule::WatchdogKey, word.name.clone());
            }
            ("adc", "CR2") => self.conversion(now, of, before, after),
            ("timer", "CCER") => self.outputs(now, of, after & !before),
            ("rcc", _) if register.ends_with("RSTR") => self.resets(address, after & !before),
            (_, "CR1") => {
                self.start(now, of, kind, before, after);
                self.spi_running(now, of, before, after);
            }
            _ => {}
        }
    }

    /// The mode of a pin, and its alternate function.
    fn pin(&self, name: &str) -> Option<(u32, u8)> {
        let port = format!("GPIO{}", name.get(1..2)?);
        let number: u32 = name.get(2..)?.parse().ok()?;
        let mode = self.word(&port, "MODER") >> (2 * number) & 3;
        let functions = match number {
            0..8 => "AFR0",
            _ => "AFR1",
        };
        let function = self.word(&port, functions) >> (4 * (number % 8)) & 15;
        Some((mode, function as u8))
    }

    /// Alternate functions that the pins of a port do not have.
    fn pins(&mut self, now: Now, of: &'static Peripheral) {
        let letter = of.name.trim_start_matches("GPIO");
        for number in 0..16 {
            let name = format!("P{letter}{number}");
            let Some((ALTERNATE, function)) = self.pin(&name) else {
                continue;
            };
            let mut all = METADATA.peripherals.iter().flat_map(|p| p.pins);
            // 0 is the system's, 15 EVENTOUT (data sheet, table 12): the debugger's pins rest there
            let known = matches!(function, 0 | 15)
                || all.any(|pin| pin.pin == name && pin.af == Some(function));
            if !known {
                self.tell(
                    now,
                    Rule::AlternateFunction,
                    format!("{name}, AF{function}"),
                );
            }
        }
    }

    /// Pins that are led to a signal of a peripheral.
    fn led(&self, of: &Peripheral, signal: &str) -> usize {
        let pins = of.pins.iter().filter(|pin| pin.signal == signal);
        pins.filter(|pin| match (self.pin(pin.pin), pin.af) {
            (Some((ALTERNATE, function)), Some(af)) => function == af,
            (Some((ANALOG, _)), None) => true,
            _ => false,
        })
        .count()
    }

    /// A peripheral whose switch was turned on wants its pins.
    fn start(&mut self, now: Now, of: &'static Peripheral, kind: &str, before: u32, after: u32) {
        for (_, register, switch, signals) in STARTS.iter().filter(|(k, ..)| *k == kind) {
            if after & !before & self.bits(of, register, switch) == 0 {
                continue;
            }
            for (also, signal, wants) in *signals {
                if after & self.bits(of, register, also) != 0 {
                    self.wants(now, of, signal, *wants);
                }
            }
        }
    }

    fn wants(&mut self, now: Now, of: &'static Peripheral, signal: &str, wants: Wants) {
        let what = format!("{} {signal}", of.name);
        match (self.led(of, signal), wants) {
            (0, Wants::Pins | Wants::OnePin) => self.tell(now, Rule::NoPin, what),
            (2.., Wants::OnePin | Wants::NoTwo) => self.tell(now, Rule::TwoPins, what),
            _ => {}
        }
    }

    /// The count of an encoder, of which the timer should have both lines.
    fn encoder(&mut self, now: Now, of: &'static Peripheral) {
        // it is read every millisecond
        if self.encoders.insert(of.name)
            && matches!(self.field(of.name, "SMCR", "SMS"), Some(1..=3))
        {
            for signal in ["CH1", "CH2"] {
                self.wants(now, of, signal, Wants::OnePin);
            }
        }
    }

    /// Outputs of a timer that were switched on.
    fn outputs(&mut self, now: Now, of: &'static Peripheral, on: u32) {
        for channel in 0..4 {
            // two to a word; 0 is an output
            let mode = self.word(of.name, ["CCMR_INPUT0", "CCMR_INPUT1"][channel / 2]);
            let is_output = mode >> (8 * (channel % 2)) & 3 == 0;
            if is_output && on >> (4 * channel) & 1 == 1 {
                self.wants(now, of, &format!("CH{}", channel + 1), Wants::Pins);
            }
        }
    }

    /// A store to CR2 of a converter, which may start it.
    fn conversion(&mut self, now: Now, of: &'static Peripheral, before: u32, after: u32) {
        let mut converters = std::mem::take(&mut self.converters);
        let word = |of: &str, register: &str| self.word(of, register);
        let wrong = converters.store(of, now.at_ns, [before, after], self.buses()[2], word);
        self.converters = converters;
        let Some(wrong) = wrong else { return };
        for (rule, what) in wrong {
            self.tell(now, rule, what);
        }
        let length = self.field(of.name, "SQR1", "L").unwrap_or(0);
        // one after the other, six to a word, from the third one on
        for at in 0..=length.min(15) {
            let register = ["SQR3", "SQR2", "SQR1"][(at / 6) as usize];
            let channel = self.word(of.name, register) >> (5 * (at % 6)) & 31;
            let signal = format!("IN{channel}");
            // those within the chip have no pin
            if of.pins.iter().any(|pin| pin.signal == signal) && self.led(of, &signal) == 0 {
                self.tell(now, Rule::NotAnalog, format!("{} {signal}", of.name));
            }
        }
    }

    /// A stream of DMA that was started or changed.
    fn dma(&mut self, now: Now, of: &'static Peripheral, register: &str, before: u32, after: u32) {
        let Some((stream, name)) = register.split_once('.') else {
            return;
        };
        let number = stream.trim_start_matches(|c: char| !c.is_ascii_digit());
        let setting = |name: &str| format!("{stream}.{name}");
        let control = self.word(of.name, &setting("CR"));
        if name != "CR" {
            let other_buffer = matches!(name, "M0AR" | "M1AR");
            if control & 1 == 1 && before != after && !other_buffer {
                self.tell(now, Rule::DmaRunning, format!("{}.{register}", of.name));
            }
            return;
        }
        if after & !before & 1 == 0 {
            return;
        }
        let request = after >> 25 & 7;
        let channel = format!("{}_CH{number}", of.name);
        let from = u64::from(self.word(of.name, &setting("PAR")));
        let memory_to_memory = after >> 6 & 3 == 2;
        let wired = METADATA.peripherals.iter().filter(|p| {
            let mut requests = p.dma_channels.iter();
            requests.any(|c| c.channel == Some(channel.as_str()) && c.request == Some(request))
        });
        let wired: Vec<&Peripheral> = wired.collect();
        // a peripheral with requests of its own is served by these alone; others by a timer's
        let owner = METADATA.peripherals.iter().find(|p| {
            p.registers.is_some() && !p.dma_channels.is_empty() && from >> 10 == p.address >> 10
        });
        let right = match owner {
            Some(owner) => wired.iter().any(|p| p.address >> 10 == owner.address >> 10),
            None => !wired.is_empty(),
        };
        if !memory_to_memory && !right {
            let whose = owner.map_or("nobody", |o| o.name);
            let what = format!("{channel}, request {request}, for {whose} at {from:#x}");
            self.tell(now, Rule::DmaRequest, what);
        }
        let double = after >> 18 & 1 == 1;
        for name in ["M0AR", "M1AR"].iter().take(1 + usize::from(double)) {
            let address = self.word(of.name, &setting(name));
            let mut regions = METADATA.memory.iter().flat_map(|all| all.iter());
            let region = regions.find(|r| (r.address..r.address + r.size).contains(&address));
            // the core's own memory is on no bus of DMA's (RM0090 2.1, figure 2)
            let reached = region.is_some_and(|region| {
                region.kind == MemoryRegionKind::Flash || !region.name.starts_with("CCM")
            });
            if !reached {
                self.tell(now, Rule::DmaMemory, format!("{channel} at {address:#x}"));
            }
        }
    }

    /// Edges of pins that were unmasked.
    fn edges(&mut self, now: Now, unmasked: u32) {
        for line in (0..16).filter(|line| unmasked >> line & 1 == 1) {
            let register = format!("EXTICR{}", line / 4);
            let port = self.word("SYSCFG", &register) >> (4 * (line % 4)) & 15;
            let Some(letter) = PORTS.get(port as usize).and_then(|p| p.get(4..)) else {
                continue;
            };
            let name = format!("P{letter}{line}");
            if self.pin(&name).is_none_or(|(mode, _)| mode != INPUT) {
                self.tell(now, Rule::EdgeOfNoInput, name);
            }
        }
    }

    /// Clocks of the core, APB1 and APB2, MHz.
    fn buses(&self) -> [u32; 3] {
        // the board's crystal, and the internal oscillator
        const HSE_MHZ: u32 = 8;
        const HSI_MHZ: u32 = 16;
        let rcc = |register, name| self.field("RCC", register, name).unwrap_or(0);
        let pll = || {
            let from = match rcc("PLLCFGR", "PLLSRC") {
                0 => HSI_MHZ,
                _ => HSE_MHZ,
            };
            let (m, n) = (rcc("PLLCFGR", "PLLM").max(1), rcc("PLLCFGR", "PLLN"));
            from * n / m / (2 * (rcc("PLLCFGR", "PLLP") + 1))
        };
        let system = match rcc("CFGR", "SW") {
            0 => HSI_MHZ,
            1 => HSE_MHZ,
            _ => pll(),
        };
        let shift = |prescaler: u32| match prescaler {
            0..8 => 0,
            // 64 follows 16
            8..12 => prescaler - 7,
            _ => prescaler - 6,
        };
        let core = system >> shift(rcc("CFGR", "HPRE"));
        let bus = |name| match rcc("CFGR", name) {
            prescaler @ 4.. => core >> (prescaler - 3),
            _ => core,
        };
        [core, bus("PPRE1"), bus("PPRE2")]
    }

    /// Wait states and buses, when the core runs by the PLL.
    fn clocks(&mut self, now: Now) {
        let [core, apb1, apb2] = self.buses();
        let buses = [("core", core), ("APB1", apb1), ("APB2", apb2)];
        // RM0090, table 11, 2.7 to 3.6 V: 30 MHz for each
        let wait_states = self.field("FLASH", "ACR", "LATENCY").unwrap_or(0);
        if core > 30 * (wait_states + 1) {
            let what = format!("{core} MHz with {wait_states}");
            self.tell(now, Rule::WaitStates, what);
        }
        let on = |name| self.field("FLASH", "ACR", name) == Some(1);
        let quick = on("PRFTEN") && on("ICEN");
        self.accelerator.changed(now.at_ns, core, quick);
        // the data sheet's limits, without and with over-drive
        let over = self.field("PWR", "CR1", "ODEN").unwrap_or(0) == 1;
        let limits = match over {
            true => [180, 45, 90],
            false => [168, 42, 84],
        };
        for ((name, mhz), limit) in buses.into_iter().zip(limits) {
            if mhz > limit {
                self.tell(now, Rule::BusClock, format!("{name} at {mhz} MHz"));
            }
        }
    }

    /// Read while write spoils the data cache (ES0206 2.2.12).
    fn data_cache(&mut self, now: Now, what: &str) {
        if self.field("FLASH", "ACR", "DCEN") == Some(1) {
            self.tell(now, Rule::DataCache, what.to_owned());
        }
    }

    /// A store to the flash array, with CR and SR of the flash, before it is made; `old` is the word there.
    pub(crate) fn programs(&mut self, access: &Access, cr: u64, old: u64) {
        let Some(now) = Now::of(access) else { return };
        let (mask, sector) = (access.width.mask(), access.address & !0x3FFF);
        if flash::refusal(cr, access.width) != 0 {
            let what = format!("{} bits, CR {cr:#x}", access.width.bits());
            self.tell(now, Rule::FlashProgram, what);
            return;
        }
        self.data_cache(now, "a store");
        if access.value & mask & !old != 0 {
            let what = format!("in the 16 KB from {sector:#x}");
            self.tell(now, Rule::FlashBits, what);
        }
    }

    /// A store to CR of the flash, with SR afterwards, and whether the flash was busy before (RM0090 3.6.1).
    pub(crate) fn controls(&mut self, access: &Access, sr: u64, was_busy: bool) {
        let Some(now) = Now::of(access) else { return };
        if was_busy {
            let what = format!("CR {:#x}", access.value);
            self.tell(now, Rule::FlashBusy, what);
        } else if sr & BSY != 0 {
            self.data_cache(now, "an erase");
        }
    }
}
