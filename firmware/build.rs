//! Link arguments for the chip. They are here and not in rustflags, which RUSTFLAGS in somebody's environment would replace.
use std::path::Path;

fn main() {
    let of = |feature| std::env::var_os(feature).is_some();
    let board = if of("CARGO_FEATURE_NUCLEO_F767ZI") {
        "nucleo-f767zi"
    } else {
        "nucleo-f429zi"
    };
    let boards = Path::new(env!("CARGO_MANIFEST_DIR")).join("boards");
    let board = boards.join(board);
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
