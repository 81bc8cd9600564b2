//! Finding out which finger is on the bus.

use super::finger::FingerName;
use super::slot::{Answer, StartStep, Transaction};
use super::{ads1220, analog, biotac, iis3dwb, mcp3202, mems};

/// The fastest clock that every part of every finger can be read with, Hz: for [`find`], and for lists of start-up.
pub const SLOWEST_HZ: u32 = *mcp3202::PORT.clock_hz.end();

/// The words that a finger is asked for before it is known, and those that have to be good.
const WORDS: u32 = 4;
const GOOD: u32 = 2;
/// P_DC of an MCP3202 that is read a few times within a millisecond changes by less, counts.
const STEADY: u16 = 32;

/// The finger on the bus; `None` if nothing answers as one of them does. Nothing is set up, but for the registers of an
/// ADS1220.
///
/// `ask` makes one transaction with a part of a finger of this name, as its port wants it but at [`SLOWEST_HZ`] or
/// less, waits so many us more, and gives the answer; an empty one if the bus failed.
///
/// Nobody is asked what could harm another finger's part. The second chip select is an ADS1220's alone. An IIS3DWB is
/// only read: a BioTac takes the address for a channel that it does not have, and answers nothing before it is asked
/// again; an MCP3202 makes a conversion. A BioTac's words would write to registers of an IIS3DWB, so that one is looked
/// for before. The MCP3202 comes last: what a BioTac with a bad cable makes of its command is not to be an answer.
pub fn find(mut ask: impl FnMut(FingerName, &Transaction, u32) -> Answer) -> Option<FingerName> {
    let mut is_part = |steps: &[StartStep]| {
        steps.iter().all(|step| {
            let answer = ask(FingerName::Mems, &step.transaction, step.wait_us);
            step.check(mems::PARTS.ports, &answer).is_ok()
        })
    };
    if is_part(&ads1220::CHECK) || is_part(&iis3dwb::CHECK) {
        return Some(FingerName::Mems);
    }
    if is_biotac(&mut ask) {
        return Some(FingerName::Biotac);
    }
    is_analog(&mut ask).then_some(FingerName::Analog)
}

/// Words with the parity and the zeros of a BioTac's, or its error frames.
fn is_biotac(ask: &mut impl FnMut(FingerName, &Transaction, u32) -> Answer) -> bool {
    let good = (0..WORDS).filter(|n| {
        let mut answer = Answer::new();
        for transaction in biotac::PARTS.slot(*n) {
            answer = ask(FingerName::Biotac, transaction, 0);
        }
        match biotac::sample(*n, &answer) {
            Ok(_) => true,
            Err(biotac::WordError::ErrorFrame(code)) => code.meaning().is_some(),
            Err(_) => false,
        }
    });
    good.count() as u32 >= GOOD
}

/// Conversions with their null bit behind a line that nobody drives, and a cell that does not jump.
fn is_analog(ask: &mut impl FnMut(FingerName, &Transaction, u32) -> Answer) -> bool {
    let (mut least, mut most) = (u16::MAX, 0);
    for n in 0..WORDS {
        for transaction in analog::PARTS.slot(n) {
            let answer = ask(FingerName::Analog, transaction, 0);
            let (Some(counts), Some(first)) = (mcp3202::decode(&answer), answer.first()) else {
                return false;
            };
            // three bits come before the null bit, all from the pull-up or all from what the line was at
            if !matches!(first >> 5, 0b000 | 0b111) {
                return false;
            }
            if n % 2 == 0 {
                // at an end of the range the line may be stuck there
                if counts.is_clipped() {
                    return false;
                }
            } else {
                least = least.min(counts.get());
                most = most.max(counts.get());
            }
        }
    }
    most.abs_diff(least) < STEADY
}

#[cfg(test)]
mod tests;
