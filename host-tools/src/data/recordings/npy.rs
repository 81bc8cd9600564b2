//! One stream of 16-bit samples as a `.npy` file, which numpy opens in one line (`numpy.load`).
use npyz::WriterBuilder as _;

use crate::data::recording::MAX_SAMPLES;

/// Longest file that [`read`] can be given: samples and a generous header.
pub const MAX_BYTES: u64 = 2 * MAX_SAMPLES as u64 + 4096;

/// The file of `samples`: format version 1, `<i2`, one dimension.
pub fn write(samples: &[i16]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let dtype = npyz::DType::Plain("<i2".parse().expect("a type of numpy"));
    let mut writer = npyz::WriteOptions::new()
        .dtype(dtype)
        .shape(&[samples.len() as u64])
        .writer(&mut bytes)
        .begin_nd()
        .expect("a vector takes any header");
    let written = writer.extend(samples).and_then(|()| writer.finish());
    written.expect("a vector takes any samples, and all of the shape's were given");
    bytes
}

/// The samples of a `.npy` file: little-endian 16-bit integers in one dimension, as `numpy.save` and [`write()`] make them.
///
/// The header is compared with the one form it can have. npyz would parse it as a Python literal of any depth and size,
/// which a damaged file can turn against us.
///
/// # Errors
/// What is wrong with the file.
pub fn read(bytes: &[u8]) -> Result<Vec<i16>, String> {
    const FIX: &str = "; save a one-dimensional array of numpy.int16 with numpy.save";
    let short = || "the .npy file ends within its header; fetch or record it again".to_owned();
    let Some(rest) = bytes.strip_prefix(b"\x93NUMPY") else {
        return Err(format!("not a .npy file{FIX}"));
    };
    let (version, rest) = rest.split_at_checked(2).ok_or_else(short)?;
    let size_bytes = match version {
        [1, 0] => 2,
        [2 | 3, 0] => 4,
        _ => {
            let [major, minor] = [version[0], version[1]];
            return Err(format!(
                "version {major}.{minor} of the .npy format is unknown{FIX}"
            ));
        }
    };
    let (size, rest) = rest.split_at_checked(size_bytes).ok_or_else(short)?;
    // little-endian
    let size = size.iter().rev().fold(0, |n, b| n << 8 | usize::from(*b));
    let (header, data) = rest.split_at_checked(size).ok_or_else(short)?;
    let header: String = header
        .iter()
        .filter(|b| !b.is_ascii_whitespace())
        .map(|b| char::from(*b))
        .collect();

    let wrong = |what: &str| {
        let header: String = header.chars().take(120).collect();
        format!("{what} in the .npy header {header}{FIX}")
    };
    let rest = header
        .strip_prefix("{'descr':'<i2',")
        .ok_or_else(|| wrong("the type is not '<i2'"))?;
    let rest = rest
        .strip_prefix("'fortran_order':False,")
        .ok_or_else(|| wrong("the order is not C"))?;
    let shape = rest
        .strip_prefix("'shape':(")
        .and_then(|rest| rest.trim_end_matches([',', '}']).strip_suffix(",)"))
        .and_then(|number| number.parse::<u64>().ok())
        .ok_or_else(|| wrong("the shape is not one number"))?;
    if !data.len().is_multiple_of(2) {
        return Err(format!(
            "{} bytes of samples are an odd number, and a sample has two; fetch or record the file again",
            data.len()
        ));
    }
    if shape != data.len() as u64 / 2 {
        return Err(format!(
            "the .npy header promises {shape} samples, the file has {}; fetch or record it again",
            data.len() / 2
        ));
    }
    Ok(from_le_bytes(data))
}

/// Samples from pairs of bytes, the low one first.
pub(super) fn from_le_bytes(bytes: &[u8]) -> Vec<i16> {
    let (pairs, _) = bytes.as_chunks::<2>();
    pairs.iter().map(|b| i16::from_le_bytes(*b)).collect()
}
