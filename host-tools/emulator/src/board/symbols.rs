//! Functions and variables of an ELF, and where its code is.

use std::ops::Range;

use object::{Object as _, ObjectSection as _, ObjectSymbol as _, SectionKind};

/// Addresses of code.
pub(super) fn code(elf: &[u8]) -> object::Result<Vec<Range<u64>>> {
    let file = object::File::parse(elf)?;
    let code = file
        .sections()
        .filter(|section| section.kind() == SectionKind::Text);
    let ranges = code.map(|section| section.address()..section.address() + section.size());
    Ok(ranges.collect())
}

/// Functions and variables, by their paths: compilers mangle them in more than one way.
pub(super) fn symbols(elf: &[u8]) -> object::Result<Vec<(String, u64, u64)>> {
    let file = object::File::parse(elf)?;
    let mut symbols = Vec::new();
    for symbol in file.symbols() {
        let address = match symbol.kind() {
            object::SymbolKind::Text => symbol.address() & !1,
            object::SymbolKind::Data => symbol.address(),
            _ => continue,
        };
        if symbol.is_definition() {
            let name = format!("{:#}", rustc_demangle::demangle(symbol.name()?));
            symbols.push((name, address, symbol.size()));
        }
    }
    Ok(symbols)
}
