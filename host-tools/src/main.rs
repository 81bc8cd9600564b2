//! The command `tactus`.
fn main() {}
