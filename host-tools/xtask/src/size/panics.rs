//! What an image's symbols say: the biggest of them, the functions that panic, and who calls those.
use anyhow::Result;
use object::{Object as _, ObjectSection as _, ObjectSymbol as _, SymbolKind};

/// How many symbols are the biggest.
const SYMBOLS: usize = 10;
/// A function, constant or variable, and its bytes.
#[derive(PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(super) struct Symbol {
    pub(super) bytes: u64,
    pub(super) name: String,
}

/// The biggest symbols.
pub(super) fn symbols(elf: &[u8]) -> Result<Vec<Symbol>> {
    let file = object::File::parse(elf)?;
    let sized = file.symbols().filter(|symbol| {
        matches!(symbol.kind(), SymbolKind::Text | SymbolKind::Data) && symbol.is_definition()
    });
    let mut symbols = sized
        .map(|symbol| {
            Ok(Symbol {
                bytes: symbol.size(),
                name: format!("{:#}", rustc_demangle::demangle(symbol.name()?)),
            })
        })
        .collect::<Result<Vec<_>>>()?;
    symbols.sort_by(|a, b| b.cmp(a));
    symbols.dedup();
    symbols.truncate(SYMBOLS);
    Ok(symbols)
}

/// A function that panics, and those that call it.
pub(super) struct Panics {
    pub(super) name: String,
    pub(super) callers: Vec<String>,
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

/// Functions that panic, and who calls them, by the calls and jumps in the code.
pub(super) fn panics(elf: &[u8]) -> Result<Vec<Panics>> {
    let file = object::File::parse(elf)?;
    let mut functions = Vec::new();
    for symbol in file.symbols() {
        if symbol.kind() == SymbolKind::Text && symbol.is_definition() && symbol.size() > 0 {
            let name = format!("{:#}", rustc_demangle::demangle(symbol.name()?));
            functions.push((symbol.address() & !1, symbol.size(), name));
        }
    }
    functions.sort();
    let calls: Vec<Vec<u64>> = functions
        .iter()
        .map(|(address, size, _)| {
            let code = file
                .sections()
                .find_map(|section| section.data_range(*address, *size).ok().flatten());
            targets(*address, code.unwrap_or_default()).collect()
        })
        .collect();
    Ok(callers(&functions, &calls))
}

/// Parts of the names of functions that panic for whoever calls them: what the compiler puts into a function of its own
/// because many end with it, and indexing.
const WAYS: [&str; 4] = [
    "OUTLINED_FUNCTION",
    "core::slice::copy_from_slice_impl",
    "as core::ops::index::Index",
    "core::slice::index::",
];

/// The functions that panic, and who calls them: functions by address, size and name, and where the calls of each go.
fn callers(functions: &[(u64, u64, String)], calls: &[Vec<u64>]) -> Vec<Panics> {
    let does = |name: &str| PANICKING.iter().any(|part| name.contains(part));
    let is_way = |name: &str| WAYS.iter().any(|part| name.contains(part));
    let mut panics: std::collections::BTreeMap<u64, Panics> = functions
        .iter()
        .filter(|(_, _, name)| does(name))
        .map(|(address, _, name)| {
            let panics = Panics {
                name: name.clone(),
                callers: Vec::new(),
            };
            (*address, panics)
        })
        .collect();
    // what ends in a panic is its way, not its reason: one that panics for another, and what was outlined
    let mut ways: std::collections::BTreeMap<u64, u64> =
        panics.keys().map(|address| (*address, *address)).collect();
    let mut known = 0;
    while known < ways.len() {
        known = ways.len();
        for ((address, _, name), targets) in functions.iter().zip(calls) {
            if is_way(name)
                && let Some(end) = targets.iter().find_map(|target| ways.get(target))
            {
                ways.insert(*address, *end);
            }
        }
    }
    for ((_, _, name), targets) in functions.iter().zip(calls) {
        for target in targets {
            if !does(name)
                && !is_way(name)
                && let Some(panics) = ways.get(target).and_then(|end| panics.get_mut(end))
                && !panics.callers.contains(name)
            {
                panics.callers.push(name.clone());
            }
        }
    }
    panics.into_values().collect()
}

/// Where the long calls and jumps (BL and B.W) of code at an address go.
fn targets(address: u64, code: &[u8]) -> impl Iterator<Item = u64> + '_ {
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
                return Some((here + 4).wrapping_add_signed(i64::from(offset as i32)));
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
        let found: Vec<u64> = targets(0x0800_0000, &bytes).collect();
        assert_eq!(found, [0x0800_000e, 0x0800_0006, 0x0800_0012]);
    }

    #[test]
    fn a_panic_is_its_callers_whatever_lies_between() {
        let names = [
            "core::panicking::panic",
            "OUTLINED_FUNCTION_3",
            "OUTLINED_FUNCTION_4",
            "<[u8] as core::ops::index::Index<usize>>::index",
            "rig::work",
            "rig::tick",
            "rig::rest",
        ];
        let functions: Vec<(u64, u64, String)> = (1..)
            .zip(names)
            .map(|(n, name)| (16 * n, 8, name.into()))
            .collect();
        let calls = [
            vec![],
            vec![48],
            vec![16],
            vec![8, 16],
            vec![32],
            vec![64, 16],
            vec![112],
        ];
        let found = callers(&functions, &calls);
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].name, "core::panicking::panic");
        assert_eq!(found[0].callers, ["rig::work", "rig::tick"]);
    }
}
