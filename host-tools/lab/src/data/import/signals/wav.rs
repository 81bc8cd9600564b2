//! WAV: integers of 8 to 32 bits, floats of 32 and 64, any channels, also as RF64, as WAVE_FORMAT_EXTENSIBLE, with any
//! other chunks, and of a recorder that was switched off before it wrote the length. (The library hound reads neither
//! RF64 nor floats of 64 bits, nor what was not ended.)

use super::{Signals, fits};

const INTEGERS: u16 = 1;
const FLOATS: u16 = 3;
const EXTENSIBLE: u16 = 0xfffe;
/// A length that is said elsewhere, or was never written.
const ELSEWHERE: u32 = u32::MAX;

struct Format {
    kind: u16,
    channels: usize,
    rate_hz: u32,
    /// bytes of a sample
    bytes: usize,
}

fn damaged(why: &str) -> String {
    format!("a damaged WAV file ({why}); fetch it again")
}

pub(super) fn read(file: &[u8], most: usize) -> Result<Signals, String> {
    if file.get(8..12) != Some(b"WAVE") {
        return Err(damaged("no WAVE in it"));
    }
    let was_ended = u32_at(file, 4).is_some_and(|length| ![0, ELSEWHERE].contains(&length));
    let mut rest = file.get(12..).unwrap_or_default();
    let (mut format, mut long) = (None, None);
    while let Some((head, body)) = rest.split_first_chunk::<8>() {
        let [name @ .., a, b, c, d] = *head;
        let length = u32::from_le_bytes([a, b, c, d]);
        let whole = |length: u64| body.get(..usize::try_from(length).ok()?);
        match &name {
            b"fmt " => {
                let chunk = whole(length.into()).ok_or_else(|| damaged("it is cut off"))?;
                format = Some(Format::of(chunk)?);
            }
            // the length of the samples is the second of three of 64 bits
            b"ds64" => long = chunk_at(body, 8),
            b"data" => {
                let format = format.ok_or_else(|| damaged("no format before its samples"))?;
                let data = match long.filter(|_| length == ELSEWHERE) {
                    Some(long) => whole(u64::from_le_bytes(long)),
                    None if length == ELSEWHERE || length == 0 && !was_ended => {
                        Some(&body[..body.len() - body.len() % format.frame()])
                    }
                    None => whole(length.into()),
                };
                let data = data.filter(|data| data.len().is_multiple_of(format.frame()));
                let data = data.ok_or_else(|| damaged("its last sample is cut off"))?;
                return format.signals(data, most);
            }
            _ => {}
        }
        // chunks begin at even places
        let next = usize::try_from(u64::from(length) + u64::from(length % 2));
        rest = next.ok().and_then(|n| body.get(n..)).unwrap_or_default();
    }
    Err(damaged("no samples in it"))
}

fn chunk_at<const N: usize>(bytes: &[u8], at: usize) -> Option<[u8; N]> {
    bytes.get(at..)?.first_chunk().copied()
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    chunk_at(bytes, at).map(u32::from_le_bytes)
}

impl Format {
    fn of(chunk: &[u8]) -> Result<Self, String> {
        let at = |n| {
            let bytes = chunk_at(chunk, n).ok_or_else(|| damaged("no format"))?;
            Ok::<_, String>(u16::from_le_bytes(bytes))
        };
        let kind = match at(0)? {
            // the kind is the begin of a longer name
            EXTENSIBLE => at(24)?,
            kind => kind,
        };
        let (channels, bits) = (usize::from(at(2)?), at(14)?);
        let rate_hz = u32_at(chunk, 4).unwrap_or(0);
        match (kind, bits) {
            (INTEGERS, 1..=32) | (FLOATS, 32 | 64) if channels > 0 && rate_hz > 0 => Ok(Self {
                kind,
                channels,
                rate_hz,
                bytes: usize::from(bits.div_ceil(8)),
            }),
            _ => Err(format!(
                "WAV of format {kind} with {bits} bits, {channels} channels, {rate_hz} Hz; save it as PCM of 16 or 24 \
                 bits, or as float"
            )),
        }
    }

    /// Bytes of a sample of all channels.
    fn frame(&self) -> usize {
        self.channels * self.bytes
    }

    fn sample(&self, bytes: &[u8]) -> f64 {
        match (self.kind, bytes) {
            (FLOATS, &[a, b, c, d]) => f32::from_le_bytes([a, b, c, d]).into(),
            (FLOATS, _) => bytes.first_chunk().map_or(0.0, |b| f64::from_le_bytes(*b)),
            // 8 bits are without a sign
            (_, &[byte]) => (f64::from(byte) - 128.0) / 128.0,
            _ => {
                let from_top = |all: u32, byte: &u8| all >> 8 | u32::from(*byte) << 24;
                let upper = bytes.iter().fold(0, from_top).cast_signed();
                f64::from(upper) / f64::from(1_u32 << 31)
            }
        }
    }

    fn signals(&self, data: &[u8], most: usize) -> Result<Signals, String> {
        let frames = data.chunks_exact(self.frame());
        fits(frames.len(), self.channels, most)?;
        let channel = |c: usize| {
            let samples = frames.clone().map(|frame| &frame[c * self.bytes..]);
            let samples = samples.map(|sample| self.sample(&sample[..self.bytes]));
            ((c + 1).to_string(), samples.collect())
        };
        Ok(Signals {
            rate_hz: Some(self.rate_hz.into()),
            channels: (0..self.channels).map(channel).collect(),
            kind: "WAV",
            ..Signals::default()
        })
    }
}
