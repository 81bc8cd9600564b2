//! The vendor's facts about the chip's registers: stm32-metapac's metadata and, of reset values and fields, ST's SVD.

use std::sync::OnceLock;

use rigless::soc::{Bus, RegisterSpec};
use rustc_hash::FxHashMap;
use stm32_metapac::metadata::ir::{
    Access, Array, BitOffset, Block, BlockItem, BlockItemInner, Field, FieldSet, IR, Register,
};
use stm32_metapac::metadata::{METADATA, PeripheralRccRegister};

/// Peripherals lie in pages of this many bytes, some in one page together.
const PAGE: u64 = 0x400;

/// The facts about a word of a peripheral.
#[derive(Clone, Debug)]
pub(crate) struct Word {
    /// "SPI1.CR1"
    pub(crate) name: String,
    /// Its peripheral in [`METADATA`].
    pub(crate) peripheral: usize,
    pub(crate) reads: bool,
    pub(crate) writes: bool,
    /// Bits that are in some field.
    pub(crate) fields: u32,
    pub(crate) reset: u32,
}

impl Word {
    /// Its name in its peripheral.
    pub(crate) fn register(&self) -> &str {
        self.name.split_once('.').map_or("", |(_, name)| name)
    }
}

/// The place of a field: its word, and its bits.
pub(crate) type Place = (u64, u32);

#[derive(Debug)]
pub(crate) struct Vendor {
    words: FxHashMap<u64, Word>,
    /// Pages of peripherals, with the first of them.
    pages: FxHashMap<u64, usize>,
    /// By the names of [`Word`].
    addresses: FxHashMap<String, u64>,
    /// By names as "SPI1.CR1.SPE".
    fields: FxHashMap<String, Place>,
    /// The field that enables each of [`METADATA`]'s peripherals, and the one that holds it in reset.
    switches: Vec<[Option<Place>; 2]>,
}

/// Names are spelled in several ways: `TIM_GP16`, `TimGp16`.
fn plain(name: &str) -> String {
    let letters = name.chars().filter(|c| *c != '_');
    letters.map(|c| c.to_ascii_uppercase()).collect()
}

fn same(a: &str, b: &str) -> bool {
    plain(a) == plain(b)
}

fn offsets(array: &Option<Array>) -> Vec<u32> {
    match array {
        None => vec![0],
        Some(Array::Regular(all)) => (0..all.len).map(|at| at * all.stride).collect(),
        Some(Array::Cursed(all)) => all.offsets.to_vec(),
    }
}

fn ones(bits: u32, at: u32) -> u32 {
    ((1_u64 << bits.min(32)) - 1).checked_shl(at).unwrap_or(0) as u32
}

fn bits(field: &Field) -> u32 {
    let each = match &field.bit_offset {
        BitOffset::Regular(at) => ones(field.bit_size, at.offset),
        BitOffset::Cursed(parts) => {
            let parts = parts.ranges.iter();
            parts.fold(0, |all, part| {
                all | ones(part.end() - part.start() + 1, *part.start())
            })
        }
    };
    let all = offsets(&field.array).into_iter();
    all.fold(0, |bits, at| bits | each << at)
}

/// A field set and the ones that it extends.
fn field_sets<'a>(ir: &'a IR, name: &'a str) -> impl Iterator<Item = &'a FieldSet> {
    let find = |name: &str| ir.fieldsets.iter().find(|set| same(set.name, name));
    std::iter::successors(find(name), move |set| find(set.extends?))
}

fn fields<'a>(ir: &'a IR, register: &'a Register) -> impl Iterator<Item = &'a Field> {
    let sets = register.fieldset.into_iter();
    sets.flat_map(|name| field_sets(ir, name))
        .flat_map(|set| set.fields)
}

fn items<'a>(ir: &'a IR, name: &'a str) -> impl Iterator<Item = &'a BlockItem> {
    let find = |name: &str| -> Option<&'a Block> { ir.blocks.iter().find(|b| same(b.name, name)) };
    std::iter::successors(find(name), move |block| find(block.extends?))
        .flat_map(|block| block.items)
}

/// Every register of a block: its name, its place, and itself.
fn registers(ir: &'static IR, block: &'static str) -> Vec<(String, u32, &'static Register)> {
    let mut found = Vec::new();
    for item in items(ir, block) {
        let name = item.name.to_uppercase();
        let arrayed = item.array.is_some();
        for (number, offset) in offsets(&item.array).into_iter().enumerate() {
            let at = item.byte_offset + offset;
            let name = match arrayed {
                true => format!("{name}{number}"),
                false => name.clone(),
            };
            match &item.inner {
                BlockItemInner::Register(register) => found.push((name, at, register)),
                BlockItemInner::Block(inner) => {
                    let inner = registers(ir, inner.block).into_iter();
                    found.extend(inner.map(|(n, a, r)| (format!("{name}.{n}"), at + a, r)));
                }
            }
        }
    }
    found
}

impl Vendor {
    /// All facts; the reset values are those of `bus`, of which there is one kind.
    pub(crate) fn of(bus: &Bus) -> &'static Self {
        static VENDOR: OnceLock<Vendor> = OnceLock::new();
        VENDOR.get_or_init(|| Self::new(bus))
    }

    fn new(bus: &Bus) -> Self {
        let (mut words, mut pages) = (FxHashMap::<u64, Word>::default(), FxHashMap::default());
        let (mut addresses, mut places) = (FxHashMap::default(), FxHashMap::default());
        let mut specified: FxHashMap<u64, &RegisterSpec> = FxHashMap::default();
        for instance in bus.peripherals() {
            let all = instance.registers.iter();
            specified.extend(all.map(|spec| (instance.base + u64::from(spec.offset), spec)));
        }
        for (number, peripheral) in METADATA.peripherals.iter().enumerate() {
            let Some(of) = &peripheral.registers else {
                continue;
            };
            for (name, at, register) in registers(of.ir, of.block) {
                let address = peripheral.address + u64::from(at);
                let (word, shift) = (address & !3, 8 * (address & 3) as u32);
                pages.entry(address / PAGE).or_insert(number);
                let name = format!("{}.{name}", peripheral.name);
                let mut told = 0;
                for field in fields(of.ir, register) {
                    let bits = bits(field) << shift;
                    told |= bits;
                    places.insert(format!("{name}.{}", plain(field.name)), (word, bits));
                }
                if register.fieldset.is_none() {
                    told = ones(register.bit_size, shift);
                }
                let spec = specified.get(&address);
                addresses.insert(name.clone(), word);
                // one word has several names if its meaning depends on another: all their fields may be written
                let word = words.entry(word).or_insert_with(|| Word {
                    name,
                    peripheral: number,
                    reads: false,
                    writes: false,
                    fields: 0,
                    reset: spec.map_or(0, |spec| spec.reset as u32),
                });
                word.reads |= register.access != Access::Write;
                word.writes |= register.access != Access::Read;
                word.fields |= told;
            }
        }
        let switch = |register: &Option<PeripheralRccRegister>| {
            let of = register.as_ref()?;
            let name = format!("RCC.{}.{}", of.register, plain(of.field));
            places.get(&name).copied()
        };
        let switches = METADATA.peripherals.iter().map(|peripheral| {
            let rcc = peripheral.rcc.as_ref();
            rcc.map_or([None; 2], |rcc| [switch(&rcc.enable), switch(&rcc.reset)])
        });
        let switches = switches.collect();
        Self {
            words,
            pages,
            addresses,
            fields: places,
            switches,
        }
    }

    /// The word at an address of a peripheral's page; `None` without one.
    pub(crate) fn at(&self, address: u64) -> Option<Result<&Word, usize>> {
        if let Some(word) = self.words.get(&(address & !3)) {
            return Some(Ok(word));
        }
        self.pages.get(&(address / PAGE)).map(|page| Err(*page))
    }

    /// The address of a register: "SPI1" and "CR1".
    pub(crate) fn address(&self, peripheral: &str, register: &str) -> Option<u64> {
        let name = format!("{peripheral}.{register}");
        self.addresses.get(&name).copied()
    }

    /// The place of a field: "SPI1", "CR1" and "SPE".
    pub(crate) fn field(&self, peripheral: &str, register: &str, field: &str) -> Option<Place> {
        let name = format!("{peripheral}.{register}.{field}");
        self.fields.get(&name).copied()
    }

    /// The field that enables a peripheral, and the one that holds it in reset.
    pub(crate) fn switches(&self, peripheral: usize) -> [Option<Place>; 2] {
        self.switches.get(peripheral).copied().unwrap_or_default()
    }

    /// All words and where they are, for a reset.
    pub(crate) fn words(&self) -> impl Iterator<Item = (u64, &Word)> {
        self.words.iter().map(|(address, word)| (*address, word))
    }
}
