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

/// A `.npz` file of these arrays, each by its name.
/// Errors: it is too large for one.
#[cfg(feature = "files")]
pub fn zipped(arrays: &[(&str, Vec<u8>)]) -> std::io::Result<Vec<u8>> {
    use std::io::{Cursor, Write as _};
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let options = zip::write::SimpleFileOptions::default();
    let options = options.compression_method(zip::CompressionMethod::Stored);
    for (name, array) in arrays {
        zip.start_file(format!("{name}.npy"), options)?;
        zip.write_all(array)?;
    }
    Ok(zip.finish()?.into_inner())
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

/// An array of any shape.
#[derive(Clone, PartialEq, Debug)]
pub struct Array {
    /// Its shape.
    pub shape: Vec<usize>,
    /// Its elements as they lie in the file.
    pub data: Elements,
    fortran: bool,
}

/// The elements of an array.
#[derive(Clone, PartialEq, Debug)]
pub enum Elements {
    /// Integers, floats, or truth as 0 and 1.
    Numbers(Vec<f64>),
    /// Texts.
    Words(Vec<String>),
}

impl Array {
    /// The array of a `.npy` file of numbers or words, of either byte order.
    /// Errors: It is none, or has more elements than `most`.
    pub fn read(bytes: &[u8], most: usize) -> Result<Self, String> {
        let fixed = |why: String| why.replace(FIX, "; save an array of numbers with numpy.save");
        let header = Header::of(bytes).map_err(fixed)?;
        let all = header
            .shape
            .iter()
            .try_fold(1_usize, |n, side| n.checked_mul(*side));
        let all = all.unwrap_or(usize::MAX);
        if all > most {
            return Err(format!(
                "more than {} million numbers; split it",
                most / 1_000_000
            ));
        }
        Ok(Self {
            data: header.elements(all)?,
            shape: header.shape,
            fortran: header.fortran,
        })
    }

    /// Its numbers, if it has such.
    pub fn numbers(&self) -> Option<&[f64]> {
        match &self.data {
            Elements::Numbers(numbers) => Some(numbers),
            Elements::Words(_) => None,
        }
    }

    /// Elements from one index of a dimension to the next.
    pub fn strides(&self) -> Vec<usize> {
        let dimensions = 0..self.shape.len();
        let inner = |at: usize| match self.fortran {
            true => &self.shape[..at],
            false => &self.shape[at + 1..],
        };
        let product = |n: usize, side: &usize| n.saturating_mul(*side);
        dimensions
            .map(|at| inner(at).iter().fold(1, product))
            .collect()
    }
}

impl Header<'_> {
    fn elements(&self, wanted: usize) -> Result<Elements, String> {
        let kind = self.kind.trim_start_matches(['<', '>', '|', '=']);
        let big = self.kind.starts_with('>');
        macro_rules! numbers {
            ($number:ty, $float:expr) => {{
                let (elements, rest) = self.data.as_chunks::<{ size_of::<$number>() }>();
                let number = |bytes: &[u8; size_of::<$number>()]| match big {
                    true => $float(<$number>::from_be_bytes(*bytes)),
                    false => $float(<$number>::from_le_bytes(*bytes)),
                };
                self.counted(elements.len(), rest, wanted)?;
                Elements::Numbers(elements.iter().map(number).collect())
            }};
        }
        Ok(match kind {
            "b1" | "u1" => numbers!(u8, f64::from),
            "i1" => numbers!(i8, f64::from),
            "i2" => numbers!(i16, f64::from),
            "u2" => numbers!(u16, f64::from),
            "i4" => numbers!(i32, f64::from),
            "u4" => numbers!(u32, f64::from),
            "i8" => numbers!(i64, |x| x as f64),
            "u8" => numbers!(u64, |x| x as f64),
            "f2" => numbers!(u16, half),
            "f4" => numbers!(f32, f64::from),
            "f8" => numbers!(f64, f64::from),
            kind => {
                let letter = |bytes: &[u8; 4]| match big {
                    true => u32::from_be_bytes(*bytes),
                    false => u32::from_le_bytes(*bytes),
                };
                let wide = |word: &[u8]| {
                    let letters = word.as_chunks::<4>().0.iter().map(letter);
                    let letters = letters.take_while(|letter| *letter != 0);
                    letters
                        .map(|letter| char::from_u32(letter).unwrap_or('?'))
                        .collect()
                };
                let narrow = |word: &[u8]| {
                    let word = String::from_utf8_lossy(word);
                    word.trim_end_matches('\0').to_owned()
                };
                let length = |rest: &str| rest.parse().ok().filter(|n| (1..1 << 20).contains(n));
                match (kind.strip_prefix('U'), kind.strip_prefix('S')) {
                    (Some(rest), _) => length(rest).map(|n| self.words(4 * n, wanted, wide)),
                    (_, Some(rest)) => length(rest).map(|n| self.words(n, wanted, narrow)),
                    _ => None,
                }
                .ok_or_else(|| {
                    format!("an array of {kind:?}; save one of integers, floats or words (astype)")
                })??
            }
        })
    }

    fn words(
        &self,
        bytes: usize,
        wanted: usize,
        word: impl Fn(&[u8]) -> String,
    ) -> Result<Elements, String> {
        let words = self.data.chunks_exact(bytes);
        self.counted(words.len(), words.remainder(), wanted)?;
        Ok(Elements::Words(words.map(word).collect()))
    }

    /// Refuses elements that are not as many as the shape says.
    fn counted(&self, elements: usize, rest: &[u8], wanted: usize) -> Result<(), String> {
        match rest.is_empty() && elements == wanted {
            true => Ok(()),
            false => Err("its header says another number of elements; save it again".to_owned()),
        }
    }
}

/// A float of 16 bits: a sign, 5 of exponent, 10 of fraction.
fn half(bits: u16) -> f64 {
    let sign = if bits >> 15 == 1 { -1.0 } else { 1.0 };
    let (exponent, fraction) = (i32::from(bits >> 10 & 31), f64::from(bits & 1023) / 1024.0);
    sign * match exponent {
        0 => fraction * 2_f64.powi(-14),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1.0 + fraction) * 2_f64.powi(exponent - 15),
    }
}

/// Samples from pairs of bytes, the low one first.
pub(super) fn from_le_bytes(bytes: &[u8]) -> Vec<i16> {
    let (pairs, _) = bytes.as_chunks::<2>();
    pairs.iter().map(|b| i16::from_le_bytes(*b)).collect()
}
