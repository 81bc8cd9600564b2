//! Functions and variables of an ELF.

use object::{Object as _, ObjectSymbol as _};

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
