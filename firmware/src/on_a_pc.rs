fn main() {
    eprintln!(
        "{} is firmware for the STM32F429ZI and does nothing on a PC: see `cargo xtask emulate` and \
         `cargo xtask flash`.",
        env!("CARGO_BIN_NAME")
    );
    std::process::exit(2);
}
