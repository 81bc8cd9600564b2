//! Link arguments for the chip. They are here and not in rustflags, which RUSTFLAGS in somebody's environment would replace.
use std::path::Path;

fn main() {
    let crate_ = Path::new(env!("CARGO_MANIFEST_DIR"));
    let board = match std::env::var_os("CARGO_FEATURE_NUCLEO_F767ZI") {
        Some(_) => "nucleo-f767zi",
        None => "nucleo-f429zi",
    };
    let (root, board) = (crate_.join(".."), crate_.join("boards").join(board));
    for script in [root.join("memory.x"), board.join("board.x")] {
        println!("cargo::rerun-if-changed={}", script.display());
    }
    if std::env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    // cortex-m-rt's link.x includes memory.x, and that the board's
    for folder in [root, board] {
        println!("cargo::rustc-link-search={}", folder.display());
    }
    // no pages on a microcontroller: sections need no alignment to 64 KB
    for argument in ["--nmagic", "-Tlink.x", "-Tdefmt.x"] {
        println!("cargo::rustc-link-arg-bins={argument}");
    }
}
