//! One stream of 16-bit samples as a `.npy` file, which numpy opens in one line (`numpy.load`).

/// Longest stream that is read, in samples: two minutes of P_AC. A slide lasts 15 s at most.
pub(crate) const MAX_SAMPLES: usize = 1 << 18;
/// Longest file that [`read`] can be given: samples and a generous header.
pub const MAX_BYTES: u64 = 2 * MAX_SAMPLES as u64 + 4096;

const FIX: &str = "; save a one-dimensional array of numpy.int16 with numpy.save";

/// The file of `samples`: format version 1, `<i2`, one dimension.
pub fn write(samples: &[i16]) -> Vec<u8> {
    let data: Vec<u8> = samples
        .iter()
        .flat_map(|sample| sample.to_le_bytes())
        .collect();
    array("<i2", &[samples.len()], &data)
}

/// The file of an array: format version 1, in C's order. `kind` is numpy's word for an element, "<f4" for example.
pub fn array(kind: &str, shape: &[usize], data: &[u8]) -> Vec<u8> {
    let shape: String = shape.iter().map(|length| format!("{length}, ")).collect();
    let header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({shape}), }}");
    // elements begin at byte 128
    let header = format!("{header:<117}\n");
    let mut bytes = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    bytes.extend_from_slice(header.as_bytes());
    bytes.extend_from_slice(data);
    bytes
}

/// The samples of a `.npy` file: little-endian 16-bit integers in one dimension, as `numpy.save` and [`write()`] make
/// them.
///
/// The header is compared with the one form it can have. npyz would parse it as a Python literal of any depth and size,
/// which a damaged file can turn against us.
pub fn read(bytes: &[u8]) -> Result<Vec<i16>, String> {
    let rest = bytes
        .strip_prefix(b"\x93NUMPY")
        .ok_or_else(|| format!("not a .npy file{FIX}"))?;
    let cut = "the .npy file ends within its header; fetch or record it again";
    let (version, rest) = rest.split_at_checked(2).ok_or(cut)?;
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
    let (size, rest) = rest.split_at_checked(size_bytes).ok_or(cut)?;
    // little-endian
    let size = size.iter().rev().fold(0, |n, b| n << 8 | usize::from(*b));
    let (header, data) = rest.split_at_checked(size).ok_or(cut)?;
    let header: String = header
        .iter()
        .filter(|b| !b.is_ascii_whitespace())
        .map(|b| char::from(*b))
        .collect();

    let wrong = |what| {
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
            "samples by the .npy header: {shape}; in the file: {}; fetch or record it again",
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
