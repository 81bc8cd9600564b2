//! Link arguments for the chip. They are here and not in rustflags, which RUSTFLAGS in somebody's environment would replace.
use std::path::Path;

fn main() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    // that of the reference board is at the top
    let board = match std::env::var_os("CARGO_FEATURE_NUCLEO_F767ZI") {
        Some(_) => root.join("boards").join("nucleo-f767zi"),
        None => root.join(".."),
    };
    println!(
        "cargo::rerun-if-changed={}",
        board.join("memory.x").display()
    );
    if std::env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    // cortex-m-rt's link.x includes memory.x, which is found on the search path
    println!("cargo::rustc-link-search={}", board.display());
    // no pages on a microcontroller: sections need no alignment to 64 KB
    for argument in ["--nmagic", "-Tlink.x", "-Tdefmt.x"] {
        println!("cargo::rustc-link-arg-bins={argument}");
    }
}
