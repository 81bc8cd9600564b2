//! The core's registers and its memory, read while it stands.

use rigless::emulator::Host;
use rigless::soc::Width;

/// A word of memory; 0 where there is none.
pub(crate) fn word(address: u32, host: &mut dyn Host) -> u32 {
    host.read(address.into(), Width::W32).unwrap_or_default() as u32
}

/// Place of IPSR, the exception that is handled, in [`register`]'s state: behind R0 to R15, five flags, GE, IT and T.
pub(crate) const IPSR: usize = 24;

/// A register of the core, R0 to R15 and [`IPSR`]. rigless shows none, but its saved state, of which the exact version
/// in Cargo.toml has this form: postcard's, the length of the core's part and R0 to R15 first.
pub(crate) fn register(host: &mut dyn Host, number: usize) -> Option<u32> {
    let state = host.save_state().ok()?;
    let mut numbers = Numbers(&state);
    numbers.nth(1 + number)
}

/// Numbers as postcard writes them: 7 bits a byte, the lowest first.
struct Numbers<'a>(&'a [u8]);

impl Iterator for Numbers<'_> {
    type Item = u32;

    fn next(&mut self) -> Option<u32> {
        let end = self.0.iter().position(|byte| byte & 0x80 == 0)?;
        let (number, rest) = self.0.split_at(end + 1);
        self.0 = rest;
        let digits = number.iter().rev().map(|byte| u32::from(byte & 0x7F));
        Some(digits.fold(0, |number, digit| number << 7 | digit))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_postcards() {
        let bytes = [0x05, 0x80, 0x01, 0xFF, 0xFF, 0xFF, 0xFF, 0x0F, 0x80];
        assert_eq!(Numbers(&bytes).collect::<Vec<_>>(), [5, 128, u32::MAX]);
    }
}
