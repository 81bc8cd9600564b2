//! The calls of functions that panic in an image, by their places in the source.
use std::collections::BTreeSet;

use anyhow::Result;
use object::{Object as _, ObjectSection as _, ObjectSymbol as _, SymbolKind};

/// The origin of a call of a function that panics.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(super) enum Kind {
    Dependency,
    /// The body of an async function, which panics when it is polled after its end: no executor does that.
    Resumed,
    /// Several checks of one function that the compiler has made one: it does not say which.
    Merged,
    Ours,
}

impl Kind {
    pub(super) const ALL: [(Self, &str); 4] = [
        (Self::Dependency, "checks in dependencies"),
        (Self::Resumed, "async functions, polled after their end"),
        (Self::Merged, "checks that the compiler has merged"),
        (Self::Ours, "checks of our own"),
    ];

    /// The kind of a call, by its place in the source: what was inlined last comes first.
    fn of(frames: &[Frame]) -> Self {
        let is_ours = |file: &str| file.contains("shared/src") || file.contains("firmware/src");
        let is_library = |file: &str| file.contains("/library/") || file.contains("/rustc/");
        let Some(at) = frames.iter().position(|frame| !is_library(&frame.file)) else {
            return Self::Dependency;
        };
        let frame = &frames[at];
        if !is_ours(&frame.file) {
            return Self::Dependency;
        }
        let last = frame.function.rsplit("::").next().unwrap_or_default();
        if at == 0 && last.trim_start_matches('{').starts_with("closure") {
            Self::Resumed
        } else if frame.line == 0 {
            Self::Merged
        } else {
            Self::Ours
        }
    }
}

/// A function that the debug information has at an address, and the place in it.
#[derive(Debug)]
struct Frame {
    function: String,
    file: String,
    line: u32,
}

#[derive(PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(super) struct Panic {
    pub(super) kind: Kind,
    /// The place in the source outside the standard library.
    pub(super) place: String,
    pub(super) function: String,
}

/// Parts of the names of functions that do nothing but panic.
const PANICKING: [&str; 13] = [
    "panicking::panic",
    "panicking::assert_failed",
    "panic_already",
    "panic_const",
    "panic_bounds_check",
    "panic_display",
    "slice_index_fail",
    "len_mismatch_fail",
    "panic_on_ord_violation",
    "do_panic",
    "unwrap_failed",
    "expect_failed",
    "_defmt_panic",
];

/// Calls of functions that panic, by the calls and jumps in the code.
pub(super) fn panics(elf: &[u8]) -> Result<Vec<Panic>> {
    let file = object::File::parse(elf)?;
    let mut functions = Vec::new();
    for symbol in file.symbols() {
        if symbol.kind() == SymbolKind::Text && symbol.is_definition() && symbol.size() > 0 {
            let name = format!("{:#}", rustc_demangle::demangle(symbol.name()?));
            functions.push((symbol.address() & !1, symbol.size(), name));
        }
    }
    functions.sort();
    functions.dedup_by_key(|(address, ..)| *address);
    let does = |name: &str| PANICKING.iter().any(|part| name.contains(part));
    let panicking: BTreeSet<u64> = file
        .symbols()
        .filter(|symbol| {
            let name = symbol.name().unwrap_or_default();
            does(&format!("{:#}", rustc_demangle::demangle(name)))
        })
        .map(|symbol| symbol.address() & !1)
        .collect();
    let lines = Lines::of(&file)?;
    let mut found = BTreeSet::new();
    for (address, size, name) in &functions {
        let code = file
            .sections()
            .find_map(|section| section.data_range(*address, *size).ok().flatten());
        if panicking.contains(address) {
            continue;
        }
        let calls = targets(*address, code.unwrap_or_default());
        for (at, _) in calls.filter(|(_, target)| panicking.contains(target)) {
            let frames = lines.at(at)?;
            let outside = |frame: &&Frame| !frame.file.contains("/library/");
            let place = frames.iter().find(outside);
            let place = place.map(|frame| format!("{}:{}", frame.file, frame.line));
            found.insert(Panic {
                kind: Kind::of(&frames),
                place: place.unwrap_or_default(),
                function: name.clone(),
            });
        }
    }
    Ok(found.into_iter().collect())
}

type Reader<'e> = addr2line::gimli::EndianSlice<'e, addr2line::gimli::LittleEndian>;

struct Lines<'e>(addr2line::Context<Reader<'e>>);

impl<'e> Lines<'e> {
    fn of(file: &object::File<'e>) -> Result<Self> {
        let section = |id: addr2line::gimli::SectionId| {
            let section = file.section_by_name(id.name());
            let bytes = section.map_or(Ok(&[][..]), |section| section.data());
            bytes.map(|bytes| Reader::new(bytes, addr2line::gimli::LittleEndian))
        };
        let dwarf = addr2line::gimli::Dwarf::load(section)?;
        Ok(Self(addr2line::Context::from_dwarf(dwarf)?))
    }

    /// The functions at an address, the innermost first.
    fn at(&self, address: u64) -> Result<Vec<Frame>> {
        let mut frames = self.0.find_frames(address).skip_all_loads()?;
        let mut found = Vec::new();
        while let Some(frame) = frames.next()? {
            let function = match &frame.function {
                Some(function) => function.raw_name()?.into_owned(),
                None => String::new(),
            };
            let location = frame.location.as_ref();
            found.push(Frame {
                function: format!("{:#}", rustc_demangle::demangle(&function)),
                file: location.and_then(|l| l.file).unwrap_or("?").to_owned(),
                line: location.and_then(|l| l.line).unwrap_or(0),
            });
        }
        Ok(found)
    }
}

/// The long calls and jumps (BL and B.W) of code at an address: where they are, and where they go.
fn targets(address: u64, code: &[u8]) -> impl Iterator<Item = (u64, u64)> + '_ {
    let (halves, _) = code.as_chunks();
    let halves: Vec<u32> = halves
        .iter()
        .map(|half| u32::from(u16::from_le_bytes(*half)))
        .collect();
    let mut at = 0;
    std::iter::from_fn(move || {
        while let Some(&first) = halves.get(at) {
            let here = address + 2 * at as u64;
            if first >> 11 < 0b11101 {
                at += 1;
                continue;
            }
            let second = halves.get(at + 1).copied().unwrap_or_default();
            at += 2;
            // BL, or B without a condition
            if first >> 11 == 0b11110 && second & 0x9000 == 0x9000 {
                let sign = first >> 10 & 1;
                let (j1, j2) = (second >> 13 & 1, second >> 11 & 1);
                let high = (sign ^ j1 ^ 1) << 23 | (sign ^ j2 ^ 1) << 22;
                let offset = high | (first & 0x3ff) << 12 | (second & 0x7ff) << 1;
                let offset = offset | if sign == 1 { 0xff00_0000 } else { 0 };
                let target = (here + 4).wrapping_add_signed(i64::from(offset as i32));
                return Some((here, target));
            }
        }
        None
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn calls_are_found_where_they_go() {
        // nop; bl +8; bl -4 from its end; b.w +4; a short branch
        let code = [
            0xbf00u16, 0xf000, 0xf804, 0xf7ff, 0xfffe, 0xf000, 0xb802, 0xe7fe,
        ];
        let bytes: Vec<u8> = code.iter().flat_map(|half| half.to_le_bytes()).collect();
        let found: Vec<u64> = targets(0x0800_0000, &bytes).map(|(_, to)| to).collect();
        assert_eq!(found, [0x0800_000e, 0x0800_0006, 0x0800_0012]);
    }

    #[test]
    fn a_panic_is_of_the_kind_of_its_place() {
        let kind = |frames: &[(&str, &str, u32)]| {
            let frames: Vec<Frame> = frames
                .iter()
                .map(|(function, file, line)| Frame {
                    function: (*function).into(),
                    file: (*file).into(),
                    line: *line,
                })
                .collect();
            Kind::of(&frames)
        };
        let ours = (
            "tactus_core::rig::stage::Stage::tick",
            "./shared/src/rig/stage.rs",
            7,
        );
        let library = (
            "core::slice::copy_from_slice",
            "/rustc/x/library/core/src/slice.rs",
            9,
        );
        let other = (
            "cobs::decode",
            "cargo/registry/src/cobs-0.3.0/src/dec.rs",
            3,
        );
        assert_eq!(kind(&[ours]), Kind::Ours);
        // what panics for somebody else
        assert_eq!(kind(&[library, ours]), Kind::Ours);
        assert_eq!(kind(&[library, other, ours]), Kind::Dependency);
        assert_eq!(kind(&[library]), Kind::Dependency);
        for name in ["a::b::{{closure}}", "a::b::{closure#0}"] {
            let polled = (name, "./firmware/src/tasks/watch.rs", 9);
            assert_eq!(kind(&[polled]), Kind::Resumed);
            assert_eq!(kind(&[library, polled]), Kind::Ours);
        }
        let merged = ("tactus_firmware::boot::ends", "./firmware/src/boot.rs", 0);
        assert_eq!(kind(&[merged]), Kind::Merged);
    }
}
