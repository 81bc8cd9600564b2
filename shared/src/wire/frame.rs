//! Frames: a message in postcard's format, its CRC-32, both in COBS, and a closing 0.

use heapless::Vec;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::CRC32;

/// Version of the messages. The two ends must have the same.
pub const PROTOCOL: u8 = 1;
/// Longest message, bytes.
pub const MAX_MESSAGE: usize = 768;
/// Longest frame without its closing 0: message, CRC, and what COBS adds, a byte and one for every 254.
pub const MAX_FRAME: usize = MAX_MESSAGE + CRC_BYTES + (MAX_MESSAGE + CRC_BYTES) / 254 + 1;

const CRC_BYTES: usize = 4;

/// Why a message does not fit into a frame.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error("the message is longer than {MAX_MESSAGE} bytes")]
pub struct TooLong;

/// A frame of `message`, its closing 0 included, at the beginning of `buffer`.
pub fn encode<'r, M: Serialize>(
    message: &M,
    buffer: &'r mut [u8; MAX_FRAME + 1],
) -> Result<&'r [u8], TooLong> {
    let mut bytes = [0; MAX_MESSAGE + CRC_BYTES];
    let (body, _) = bytes.split_at_mut(MAX_MESSAGE);
    let length = postcard::to_slice(message, body)
        .map_err(|_| TooLong)?
        .len();
    let body = bytes.get(..length).ok_or(TooLong)?;
    let crc = CRC32.checksum(body).to_le_bytes();
    let whole = bytes.get_mut(..length + CRC_BYTES).ok_or(TooLong)?;
    let end = whole.last_chunk_mut::<CRC_BYTES>().ok_or(TooLong)?;
    *end = crc;
    let length = cobs::try_encode(whole, buffer).map_err(|_| TooLong)?;
    // the buffer was chosen for it
    let frame = buffer.get_mut(..=length).ok_or(TooLong)?;
    if let Some(closing) = frame.last_mut() {
        *closing = 0;
    }
    Ok(frame)
}

/// What is wrong with a frame.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[allow(missing_docs)] // their texts say it
pub enum FrameError {
    #[error("the frame is too long")]
    TooLong,
    #[error("the frame is damaged (COBS)")]
    Cobs,
    #[error("the frame is damaged (CRC)")]
    Crc,
    #[error("the frame is no message: do both ends have the same version?")]
    Message,
}

/// The message in a frame without its closing 0; the frame is used up.
pub fn decode<M: DeserializeOwned>(frame: &mut [u8]) -> Result<M, FrameError> {
    let length = cobs::decode_in_place(frame).map_err(|_| FrameError::Cobs)?;
    let whole = frame.get(..length).ok_or(FrameError::Cobs)?;
    let (body, crc) = whole
        .split_last_chunk::<CRC_BYTES>()
        .ok_or(FrameError::Crc)?;
    if CRC32.checksum(body) != u32::from_le_bytes(*crc) {
        return Err(FrameError::Crc);
    }
    match postcard::take_from_bytes(body) {
        Ok((message, [])) => Ok(message),
        _ => Err(FrameError::Message),
    }
}

/// Puts frames together from the bytes of a line.
#[derive(Debug, Default)]
pub struct Receiver {
    frame: Vec<u8, MAX_FRAME>,
    too_long: bool,
}

impl Receiver {
    /// One that has heard nothing yet.
    pub const fn new() -> Self {
        Self {
            frame: Vec::new(),
            too_long: false,
        }
    }

    /// Takes in a byte; at the end of a frame, the message in it. An empty frame is nothing: a 0 more does no harm.
    pub fn push<M: DeserializeOwned>(&mut self, byte: u8) -> Option<Result<M, FrameError>> {
        if byte != 0 {
            self.too_long |= self.frame.push(byte).is_err();
            return None;
        }
        let message = if self.too_long {
            Some(Err(FrameError::TooLong))
        } else if self.frame.is_empty() {
            None
        } else {
            Some(decode(&mut self.frame))
        };
        self.frame.clear();
        self.too_long = false;
        message
    }
}
