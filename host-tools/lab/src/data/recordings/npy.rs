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

/// The file of an array of words.
pub fn words<'w>(words: impl Iterator<Item = &'w str>) -> Vec<u8> {
    let words: Vec<Vec<char>> = words.map(|word| word.chars().collect()).collect();
    // numpy has no words of no letter
    let longest = words.iter().map(Vec::len).max().unwrap_or(0).max(1);
    let letter = |word: &Vec<char>, n: usize| word.get(n).map_or(0, |c| u32::from(*c));
    let letters = words
        .iter()
        .flat_map(|word| (0..longest).map(move |n| letter(word, n)));
    let data: Vec<u8> = letters.flat_map(u32::to_le_bytes).collect();
    array(&format!("<U{longest}"), &[words.len()], &data)
}

/// A `.npz` file of these arrays, each by its name: a zip archive whose files are not packed.
pub fn zipped(arrays: &[(&str, Vec<u8>)]) -> Vec<u8> {
    let (mut file, mut list) = (Vec::new(), Vec::new());
    for (name, array) in arrays {
        let name = format!("{name}.npy");
        let mut crc = flate2::Crc::new();
        crc.update(array);
        let size = (array.len() as u32).to_le_bytes();
        // version 2.0, no flag, not packed, midnight of 1 January 1980
        let mut about = vec![20, 0, 0, 0, 0, 0, 0, 0, 0x21, 0];
        for part in [crc.sum().to_le_bytes(), size, size] {
            about.extend(part);
        }
        about.extend((name.len() as u16).to_le_bytes());
        about.extend([0, 0]);
        list.extend(b"PK\x01\x02\x14\0");
        list.extend(&about);
        list.extend([0; 10]);
        list.extend((file.len() as u32).to_le_bytes());
        list.extend(name.as_bytes());
        file.extend(b"PK\x03\x04");
        file.extend(&about);
        file.extend(name.as_bytes());
        file.extend(array);
    }
    let (begin, length) = (file.len() as u32, list.len() as u32);
    let number = (arrays.len() as u16).to_le_bytes();
    file.extend(list);
    file.extend(b"PK\x05\x06\0\0\0\0");
    file.extend(number);
    file.extend(number);
    file.extend(length.to_le_bytes());
    file.extend(begin.to_le_bytes());
    file.extend([0, 0]);
    file
}

/// The samples of a `.npy` file: little-endian 16-bit integers in one dimension, as `numpy.save` and [`write()`] make
/// them.
///
pub fn read(bytes: &[u8]) -> Result<Vec<i16>, String> {
    let Header {
        kind,
        fortran,
        shape,
        data,
        text,
    } = Header::of(bytes)?;
    let wrong = |what| {
        let text: String = text.chars().take(120).collect();
        format!("{what} in the .npy header {text}{FIX}")
    };
    if kind != "<i2" {
        return Err(wrong("the type is not '<i2'"));
    }
    if fortran {
        return Err(wrong("the order is not C"));
    }
    let [samples] = shape[..] else {
        return Err(wrong("the shape is not one number"));
    };
    if !data.len().is_multiple_of(2) {
        return Err(format!(
            "{} bytes of samples are an odd number, and a sample has two; fetch or record the file again",
            data.len()
        ));
    }
    if samples != data.len() / 2 {
        return Err(format!(
            "samples by the .npy header: {samples}; in the file: {}; fetch or record it again",
            data.len() / 2
        ));
    }
    Ok(from_le_bytes(data))
}

/// The parts of a `.npy` file.
///
/// The header is compared with the one form that numpy gives it. npyz would parse it as a Python literal of any depth
/// and size, which a damaged file can turn against us.
struct Header<'b> {
    kind: String,
    fortran: bool,
    shape: Vec<usize>,
    data: &'b [u8],
    text: String,
}

impl<'b> Header<'b> {
    fn of(bytes: &'b [u8]) -> Result<Self, String> {
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
        let (text, data) = rest.split_at_checked(size).ok_or(cut)?;
        let text: String = text
            .iter()
            .filter(|b| !b.is_ascii_whitespace())
            .map(|b| char::from(*b))
            .collect();
        let parse = || {
            let rest = text.strip_prefix("{'descr':'")?;
            let (kind, rest) = rest.split_once("','fortran_order':")?;
            let (fortran, rest) = rest.split_once(",'shape':(")?;
            let (shape, _) = rest.split_once(')')?;
            let shape = shape.split(',').filter(|length| !length.is_empty());
            let shape = shape
                .map(|length| length.parse().ok())
                .collect::<Option<_>>()?;
            Some((kind.to_owned(), fortran == "True", shape))
        };
        let wrong = || {
            let text: String = text.chars().take(120).collect();
            format!("the .npy header is {text}{FIX}")
        };
        let (kind, fortran, shape) = parse().ok_or_else(wrong)?;
        Ok(Self {
            kind,
            fortran,
            shape,
            data,
            text,
        })
    }
}

/// The channels of a `.npy` file of integers or floats, of either byte order: of one dimension one channel, of two the
/// longer one is time. `fits` refuses more samples or channels than the caller takes.
/// Errors: It is none, or refused.
pub fn read_channels(
    bytes: &[u8],
    fits: impl Fn(usize, usize) -> Result<(), String>,
) -> Result<Vec<Vec<f64>>, String> {
    let header = Header::of(bytes)?;
    let data = header.data;
    let big = header.kind.starts_with('>');
    let (rows, columns) = match header.shape[..] {
        [samples] => (samples, 1),
        [rows, columns] => (rows, columns),
        _ => {
            let dimensions = header.shape.len();
            return Err(format!(
                "an array of {dimensions} dimensions; save one or two"
            ));
        }
    };
    // a recording is longer than it has channels
    let by_row = rows >= columns || header.shape.len() == 1;
    let (samples, channels) = if by_row {
        (rows, columns)
    } else {
        (columns, rows)
    };
    macro_rules! elements {
        ($number:ty) => {{
            let (elements, rest) = data.as_chunks::<{ size_of::<$number>() }>();
            if !rest.is_empty() || rows.checked_mul(columns) != Some(elements.len()) {
                return Err("its header says another number of elements; save it again".to_owned());
            }
            fits(samples, channels)?;
            let number = |sample: usize, channel: usize| {
                // the first index is the slow one in C's order
                let at = match by_row != header.fortran {
                    true => sample * channels + channel,
                    false => channel * samples + sample,
                };
                match big {
                    true => <$number>::from_be_bytes(elements[at]) as f64,
                    false => <$number>::from_le_bytes(elements[at]) as f64,
                }
            };
            let channel = |channel| (0..samples).map(|sample| number(sample, channel)).collect();
            (0..channels).map(channel).collect()
        }};
    }
    Ok(match header.kind.trim_start_matches(['<', '>', '|', '=']) {
        "i1" => elements!(i8),
        "u1" => elements!(u8),
        "i2" => elements!(i16),
        "u2" => elements!(u16),
        "i4" => elements!(i32),
        "u4" => elements!(u32),
        "i8" => elements!(i64),
        "u8" => elements!(u64),
        "f4" => elements!(f32),
        "f8" => elements!(f64),
        kind => {
            return Err(format!(
                "an array of {kind:?}; save one of integers or floats"
            ));
        }
    })
}

/// Samples from pairs of bytes, the low one first.
pub(super) fn from_le_bytes(bytes: &[u8]) -> Vec<i16> {
    let (pairs, _) = bytes.as_chunks::<2>();
    pairs.iter().map(|b| i16::from_le_bytes(*b)).collect()
}
