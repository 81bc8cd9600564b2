//! Checks of recorded samples before anything is learned from them: a sensor that is dead is no texture, and one piece
//! of a recording is one slide.

use std::collections::{HashMap, HashSet};

use tactus_core::features::{Signal, SlideError};
use tactus_core::table::SlideHash;

use super::recording::{PAC_RATE_HZ, Recording};

/// The streams of a slide begin and end together, but for a sample and the time that a recorder takes to stop, s.
const STOPPING_S: f64 = 0.1;
/// Samples that are compared at once.
const WINDOW: usize = 32;
/// Most windows that are compared in each second of a slide.
const PER_SECOND: f64 = 64.0;
/// Of a slow sensor one window in so many is compared: hours of it fit into memory.
const LEAST_APART: u32 = 8;
/// Fewest different windows of a slide whose parts are compared. One that is shorter, or repeats itself as a pure tone
/// does, is compared as a whole.
const FEWEST: usize = 16;
/// Share of a slide's windows, one in so many, that may be those of others.
const SHARED: usize = 3;

/// The reasons why the samples of a slide cannot be those of a sensor that works.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub(crate) enum SampleFault {
    /// The signal hangs, or is cut off.
    #[error(transparent)]
    Signal(#[from] SlideError),
    #[error("P_AC lasts {pac:.2} s and {stream} {other:.2} s: samples are missing")]
    Missing {
        pac: f64,
        stream: &'static str,
        other: f64,
    },
}

/// Checks the samples of a slide; what is told of a signal that is cut off a little.
/// Errors: the first fault.
pub(crate) fn check(slide: &Recording) -> Result<Option<SlideError>, SampleFault> {
    let pac = slide.pac();
    let steady = pac.get(slide.steady(PAC_RATE_HZ)).unwrap_or_default();
    let signal = |samples: &[i16]| {
        let mut signal = Signal::default();
        signal.push(samples);
        signal.check()
    };
    signal(&slide.still())?;
    let clipped = signal(steady)?;
    let seconds = |samples: usize, rate_hz: f64| samples as f64 / rate_hz;
    let lasts = seconds(pac.len(), PAC_RATE_HZ.into());
    let shear = slide.shear_mn().map(|mn| (mn.len(), slide.shear_rate_hz));
    // without samples it was not measured
    let pdc = Some((slide.pdc.len(), slide.pdc_rate_hz)).filter(|(samples, _)| *samples > 0);
    for (stream, of) in [("P_DC", pdc), ("shear", shear)] {
        let Some((samples, rate_hz)) = of else {
            continue;
        };
        let other = seconds(samples, rate_hz);
        if (lasts - other).abs() > STOPPING_S + seconds(1, rate_hz) {
            return Err(SampleFault::Missing {
                pac: lasts,
                stream,
                other,
            });
        }
    }
    Ok(clipped)
}

/// Marks by which a piece of a recording is known again, wherever it was cut out: hashes of some of its windows, which
/// their samples choose.
#[derive(Clone, Debug)]
pub(crate) struct Fingerprint(Vec<u32>);

impl Fingerprint {
    /// That of P_AC at constant speed.
    pub(crate) fn of(slide: &Recording) -> Self {
        let pac = slide.pac();
        let steady = pac.get(slide.steady(PAC_RATE_HZ)).unwrap_or_default();
        let samples = steady.iter().map(|x| x.unsigned_abs().into());
        Self::of_samples(samples, f64::from(PAC_RATE_HZ))
    }

    /// That of a signal of any sensor, whose sign does not count.
    #[cfg(feature = "import")]
    pub(crate) fn of_signal(samples: &[f64], rate_hz: f64) -> Self {
        Self::of_samples(samples.iter().map(|x| x.abs().to_bits()), rate_hz)
    }

    fn of_samples(samples: impl Iterator<Item = u64>, rate_hz: f64) -> Self {
        const BASE: u64 = 0x9e37_79b9_7f4a_7c15;
        // `as` saturates
        let every = ((rate_hz / PER_SECOND) as u32).max(LEAST_APART);
        let samples: Vec<u64> = samples.map(mixed).collect();
        let last = (0..WINDOW).fold(1_u64, |power, _| power.wrapping_mul(BASE));
        let (mut rolling, mut whole, mut hashes) = (0_u64, 0_u64, Vec::new());
        for (at, sample) in samples.iter().enumerate() {
            rolling = rolling.wrapping_mul(BASE).wrapping_add(*sample);
            whole = mixed(whole ^ sample);
            if let Some(before) = at.checked_sub(WINDOW) {
                rolling = rolling.wrapping_sub(samples[before].wrapping_mul(last));
            }
            let hash = mixed(rolling);
            if at + 1 >= WINDOW && (hash as u32).is_multiple_of(every) {
                hashes.push((hash >> 32) as u32);
            }
        }
        hashes.sort_unstable();
        let all = hashes.len();
        hashes.dedup();
        if hashes.len() < FEWEST || hashes.len() * 4 < all * 3 {
            hashes = vec![(whole >> 32) as u32];
        }
        Self(hashes)
    }
}

/// Marks of a slide that a table notes, most.
const NOTED: usize = 8;
/// Fewest marks by which a slide is taken for another.
const FEWEST_NOTED: usize = 3;

/// Marks by which a slide is known again in any folder: the hash of its P_AC, and those of some of its windows.
#[derive(Clone, Debug)]
pub struct SlideMarks {
    hash: SlideHash,
    print: Fingerprint,
}

impl From<SlideHash> for SlideMarks {
    /// Marks of samples that are not at hand.
    fn from(hash: SlideHash) -> Self {
        let print = Fingerprint(Vec::new());
        Self { hash, print }
    }
}

impl SlideMarks {
    /// Those of a slide.
    pub fn of(slide: &Recording) -> Self {
        Self {
            hash: slide.hash(),
            print: Fingerprint::of(slide),
        }
    }

    /// The hash of the whole slide.
    pub fn hash(&self) -> SlideHash {
        self.hash
    }

    /// Marks as a table notes them beside hashes: three bytes of the slide's hash, and as many of a window's.
    fn windows(&self) -> impl Iterator<Item = SlideHash> {
        let [.., a, b, c] = self.hash;
        let windows = self.print.0.iter().map(|hash| hash.to_le_bytes());
        windows.map(move |[x, y, z, _]| [a, b, c, x, y, z])
    }

    /// The hashes that a table notes of slides, `most` at most: those of the slides, and as many of their windows for
    /// each as there is room for.
    pub fn noted(slides: &[&Self], most: usize) -> Vec<SlideHash> {
        let each = (most / slides.len().max(1)).saturating_sub(1).min(NOTED);
        let hashes = slides.iter().map(|slide| slide.hash);
        let windows = slides.iter().flat_map(|slide| slide.windows().take(each));
        hashes.chain(windows).collect()
    }
}

/// Slides that are known again, shifted or not.
#[derive(Debug, Default)]
pub struct SeenSlides {
    hashes: HashSet<SlideHash>,
    /// by a window's mark, the slides that have it
    windows: HashMap<[u8; 3], Vec<[u8; 3]>>,
    /// marks of each slide
    marks: HashMap<[u8; 3], usize>,
}

impl SeenSlides {
    /// Those of which a table notes these hashes.
    pub fn noted(hashes: &[SlideHash]) -> Self {
        let mut seen = Self {
            hashes: hashes.iter().copied().collect(),
            ..Self::default()
        };
        for [a, b, c, x, y, z] in hashes {
            let slide = [*a, *b, *c];
            seen.windows.entry([*x, *y, *z]).or_default().push(slide);
            *seen.marks.entry(slide).or_default() += 1;
        }
        seen
    }

    /// These, with all marks.
    pub fn of<'m>(slides: impl IntoIterator<Item = &'m SlideMarks>) -> Self {
        let marks =
            |slide: &SlideMarks| std::iter::once(slide.hash).chain(slide.windows()).collect();
        let all: Vec<Vec<SlideHash>> = slides.into_iter().map(marks).collect();
        Self::noted(&all.concat())
    }

    /// True if a slide is one of them, or shares more than a third of its samples, or of theirs, with one.
    pub fn has(&self, slide: &SlideMarks) -> bool {
        if self.hashes.contains(&slide.hash) {
            return true;
        }
        let mut of: HashMap<[u8; 3], usize> = HashMap::new();
        for [.., x, y, z] in slide.windows() {
            for seen in self.windows.get(&[x, y, z]).into_iter().flatten() {
                *of.entry(*seen).or_default() += 1;
            }
        }
        of.iter().any(|(seen, shared)| {
            let marks = self.marks.get(seen).copied().unwrap_or(0);
            *shared >= FEWEST_NOTED && shared * SHARED > marks.min(slide.print.0.len())
        })
    }
}

/// A number whose bits depend on all bits of another (the last step of SplitMix64).
fn mixed(x: u64) -> u64 {
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// A slide whose samples are those of another, shifted or not.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error(
    "{percent} % of its P_AC is that of {other}, sample for sample: a copy, one recording cut twice, or a recorder \
     that repeats itself"
)]
pub(crate) struct DuplicateSlide {
    percent: usize,
    other: String,
}

/// Finds copies among the slides of a set, of all textures.
#[derive(Debug, Default)]
pub(crate) struct DuplicateSearch {
    /// the first slide with a hash
    seen: HashMap<u32, u32>,
    slides: Vec<String>,
}

impl DuplicateSearch {
    /// Takes in the next slide; `name` is what it is called where others are its copies.
    /// Errors: it is one itself.
    pub(crate) fn add(
        &mut self,
        Fingerprint(hashes): &Fingerprint,
        name: String,
    ) -> Result<(), DuplicateSlide> {
        let mut of: HashMap<u32, usize> = HashMap::new();
        for slide in hashes.iter().filter_map(|hash| self.seen.get(hash)) {
            *of.entry(*slide).or_default() += 1;
        }
        let shared: usize = of.values().sum();
        if shared * SHARED > hashes.len() {
            let most = of
                .iter()
                .max_by_key(|(slide, count)| (**count, u32::MAX - **slide));
            let other = most.and_then(|(slide, _)| self.slides.get(*slide as usize));
            return Err(DuplicateSlide {
                percent: shared * 100 / hashes.len(),
                other: other.cloned().unwrap_or_default(),
            });
        }
        for hash in hashes {
            self.seen.entry(*hash).or_insert(self.slides.len() as u32);
        }
        self.slides.push(name);
        Ok(())
    }
}
