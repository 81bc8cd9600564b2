//! `tactus-emulator`: the firmware's ELF on the emulated board.

fn main() -> std::process::ExitCode {
    tactus_emulator::runs::main()
}
