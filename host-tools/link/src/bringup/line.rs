//! Questions and answers as bytes, without IO and without a clock.

use tactus_core::wire::bringup::{Answer, Ask, MARK, Measure, Saw};
use tactus_core::wire::{MAX_FRAME, Report, decode, encode};

use super::seams::Trouble;

/// The host's end of the line.
#[derive(Debug, Default)]
pub struct Line {
    id: u16,
    frame: Vec<u8>,
    /// Frames that another image sent.
    others: u32,
    /// Questions, their answers, and damaged frames.
    pub traffic: [u32; 3],
    /// Time of the last answer since the board started, ms.
    pub at_ms: u32,
}

impl Line {
    /// The frame of a question.
    pub fn question(&mut self, measure: Measure) -> Result<Vec<u8>, Trouble> {
        self.id = self.id.wrapping_add(1);
        self.traffic[0] += 1;
        let ask = Ask {
            id: self.id,
            mark: MARK,
            measure,
        };
        let mut buffer = [0; MAX_FRAME + 1];
        let frame = encode(&ask, &mut buffer);
        let frame = frame.map_err(|why| Trouble::Unexpected(why.to_string()))?;
        // whatever was on the line before ends here
        Ok([&[0], frame].concat())
    }

    /// Takes in bytes of the board: the answer to the last question, if it is among them.
    pub fn receive(&mut self, bytes: &[u8]) -> Result<Option<Saw>, Trouble> {
        let mut found = None;
        for &byte in bytes {
            if byte != 0 {
                if self.frame.len() <= MAX_FRAME {
                    self.frame.push(byte);
                }
                continue;
            }
            let mut frame = std::mem::take(&mut self.frame);
            match decode::<Answer>(&mut frame.clone()) {
                Ok(answer) if answer.mark == MARK => {
                    self.others = 0;
                    if answer.id == self.id {
                        (found, self.at_ms) = (Some(answer.saw), answer.at_ms);
                        self.traffic[1] += 1;
                    }
                }
                _ if decode::<Report>(&mut frame.clone()).is_ok() => self.others += 1,
                _ if decode::<Ask>(&mut frame).is_ok_and(|ask| ask.mark == MARK) => {
                    return Err(Trouble::Echo);
                }
                _ => self.traffic[2] += u32::from(!frame.is_empty()),
            }
        }
        // a rig that has just started says much by itself, and answers no question of ours
        if self.others > 3 {
            return Err(Trouble::OtherImage);
        }
        Ok(found)
    }
}
