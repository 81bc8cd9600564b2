//! Link arguments for the chip. They are here and not in rustflags, which RUSTFLAGS in somebody's environment would
//! replace.
use std::path::Path;

fn main() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    println!(
        "cargo::rerun-if-changed={}",
        root.join("memory.x").display()
    );
    if std::env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    // cortex-m-rt's link.x includes memory.x
    println!("cargo::rustc-link-search={}", root.display());
    // no pages on a microcontroller: sections need no alignment to 64 KB
    for argument in ["--nmagic", "-Tlink.x", "-Tdefmt.x"] {
        println!("cargo::rustc-link-arg-bins={argument}");
    }
}
