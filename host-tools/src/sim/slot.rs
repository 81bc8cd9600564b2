//! The sensor's slots in virtual time.

use std::convert::Infallible;

use tactus_core::sensor::biotac::BioTac;
use tactus_core::sensor::pressure::Pressure;
use tactus_core::sensor::{PressureSensor as _, slot, slot_of};

/// Two bytes at 5.25 MHz.
pub(crate) const TRANSFER_NS: u64 = 3_048;
/// A transaction begins so much later than the gap before it asks for.
const LATE_NS: u64 = 5_000;

/// The word of slot `n` of a BioTac, which begins at `at_ns`. `transact` gets when each of its transactions begins, ns, what is
/// sent, and room for what comes in.
pub(crate) fn word_of_slot(
    n: u64,
    at_ns: u64,
    mut transact: impl FnMut(u64, &[u8], &mut [u8]),
) -> Option<Pressure> {
    // slots begin again after two
    let n = n as u32;
    let mut begins_ns = at_ns;
    let Ok(answer) = slot::perform(slot_of::<BioTac>(n), |transaction, miso| {
        transact(begins_ns, transaction.out, miso);
        begins_ns += TRANSFER_NS + 1000 * u64::from(transaction.gap_us) + LATE_NS;
        Ok::<(), Infallible>(())
    });
    BioTac.decode(n, &answer).ok()
}
