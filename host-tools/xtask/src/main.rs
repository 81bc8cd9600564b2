//! The project's own commands: `cargo xtask build | test`.
fn main() {}
