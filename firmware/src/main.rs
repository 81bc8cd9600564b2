//! The rig's firmware.
fn main() {}
