//! What `cargo xtask bench` counts: the core's functions as the rig calls them, on what the host gives. The emulator's
//! bench compiles this file too and runs the same with the plain kernels; results must be equal to the bit.

use core::hint::black_box;

use heapless::Vec;
use tactus_core::dsp::{BandPower, FRAME, HOP, Plan, SpectrumSum};
use tactus_core::explorer::{Config, Explorer, Method};
use tactus_core::features::{
    BLOCK, Block, Movement, Observation, Properties, Property, PropertySet, Slide,
};
use tactus_core::sensor::pressure::RATE_HZ;
use tactus_core::table::{Action, Table};

/// Forces in a block: one each tick of the servo's.
const SHEARS: usize = BLOCK * 1000 / RATE_HZ as usize;
const CAPACITY: usize = tactus_core::table::MAX_TEXTURES;

/// What is counted.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Workload {
    /// The cost of counting itself.
    Nothing,
    /// Band-pass and mean power of the samples, in blocks.
    BandPower,
    /// One frame of the spectrum: window, FFT, power and bands.
    Frame,
    /// All features of a slide, in blocks.
    Slide,
    /// From the last sample of a slide to the next choice.
    Decision,
}

impl Workload {
    /// All, by their codes.
    pub const ALL: [Self; 5] = [
        Self::Nothing,
        Self::BandPower,
        Self::Frame,
        Self::Slide,
        Self::Decision,
    ];
}

/// Counts what something takes.
pub trait Counter {
    /// Does it, and counts.
    fn count<T>(&mut self, work: impl FnOnce() -> T) -> T;
}

/// An observed slide, and the action that looks at it, in words.
pub struct ObservedSlide {
    /// The method that decides.
    pub method: Method,
    /// The action that it was made for.
    pub action: Action,
    /// The measured slide.
    pub slide: Observation,
}

impl ObservedSlide {
    const METHODS: [Method; 4] = [
        Method::Paper,
        Method::Student,
        Method::StudentAll,
        Method::Fused,
    ];

    /// As words, of which there are as many as bands, and a few.
    pub fn write(&self, mut put: impl FnMut(i16)) {
        let at = |found: Option<usize>| found.map_or(-1, |at| at as i16);
        put(at(Self::METHODS.iter().position(|m| *m == self.method)));
        put(self.action.movement.into());
        put(at(self.action.property.map(Property::index)));
        for property in Property::ALL {
            let bits = self.slide.properties.get(property).unwrap_or(f32::NAN);
            let bits = bits.to_bits();
            put(bits as i16);
            put((bits >> 16) as i16);
        }
        put(self.slide.pressure.is_some().into());
        let pressure = self.slide.pressure.unwrap_or_default();
        pressure.into_iter().for_each(&mut put);
        put(self.slide.bands.len() as i16);
        self.slide.bands.iter().for_each(|band| put(*band));
    }

    /// From words, and what follows them.
    pub fn read(words: &[i16]) -> Option<(Self, &[i16])> {
        let (&[method, movement, property], words) = words.split_first_chunk()?;
        let (values, words) = words.split_first_chunk::<6>()?;
        let (&[has_pressure, mean, sd, bands], words) = words.split_first_chunk()?;
        let (bands, rest) = words.split_at_checked(usize::try_from(bands).ok()?)?;
        let mut properties = [None; 3];
        for (property, pair) in properties.iter_mut().zip(values.as_chunks::<2>().0) {
            let [low, high] = pair.map(|word| u32::from(word as u16));
            let value = f32::from_bits(high << 16 | low);
            *property = Some(value).filter(|value| !value.is_nan());
        }
        let property = usize::try_from(property).ok();
        let observed = Self {
            method: *Self::METHODS.get(usize::try_from(method).ok()?)?,
            action: Action {
                movement: u8::try_from(movement).ok()?,
                property: property.and_then(|at| Property::ALL.get(at).copied()),
            },
            slide: Observation {
                properties: Properties::new(properties),
                bands: Vec::from_slice(bands).ok()?,
                pressure: (has_pressure != 0).then_some([mean, sd]),
                pace: None,
            },
        };
        Some((observed, rest))
    }
}

/// Runs a workload on the samples or the observed slide in `words`, which the background precedes, and writes its
/// results; `None` if the words make no sense.
pub fn run(
    workload: Workload,
    plan: &Plan,
    table: &[u8],
    words: &[i16],
    counter: &mut impl Counter,
    put: &mut impl FnMut(&[u8]),
) -> Option<()> {
    match workload {
        Workload::Nothing => counter.count(|| ()),
        Workload::BandPower => {
            let mut power = BandPower::default();
            let mean = counter.count(|| {
                for samples in black_box(words).chunks(BLOCK) {
                    power.push(plan, samples);
                }
                power.mean(plan)
            });
            put(&mean?.to_le_bytes());
        }
        Workload::Frame => {
            let mut spectrum = SpectrumSum::default();
            let (first, rest) = words.split_at_checked(FRAME - HOP)?;
            spectrum.push(plan, first);
            let frame = rest.get(..HOP)?;
            counter.count(|| spectrum.push(plan, black_box(frame)));
            let psd = spectrum.finish()?;
            psd.psd().iter().for_each(|p| put(&p.to_le_bytes()));
        }
        Workload::Slide => {
            let (mut slide, mut block) = slide_of(plan, words);
            let observed = counter.count(|| {
                for samples in black_box(words).chunks(BLOCK) {
                    fill(&mut block, samples);
                    slide.take(&block);
                }
                slide.finish().map(|slide| Observation::from(&slide))
            });
            put_observation(&observed.ok()?, put);
        }
        Workload::Decision => decide(plan, Table::read(table).ok()?, words, counter, put)?,
    }
    Some(())
}

#[inline(never)]
fn decide(
    plan: &Plan,
    table: Table<'_>,
    words: &[i16],
    counter: &mut impl Counter,
    put: &mut impl FnMut(&[u8]),
) -> Option<()> {
    let (observed, samples) = ObservedSlide::read(words)?;
    let config = Config {
        method: observed.method,
        ..Config::default()
    };
    let mut explorer = Explorer::<CAPACITY>::new(table, PropertySet::ALL, config).ok()?;
    let (mut slide, mut block) = slide_of(plan, samples);
    let mut rest = samples.chunks(BLOCK);
    let last = rest.next_back()?;
    for samples in rest {
        fill(&mut block, samples);
        slide.take(&block);
    }
    fill(&mut block, last);
    let decided = counter.count(|| {
        slide.take(&block);
        let measured = slide.finish().map(|slide| Observation::from(&slide));
        // the posterior is of the other slide, which leaves as many textures as are wanted
        let seen = explorer.observe(observed.action, black_box(&observed.slide));
        let mut outcomes = Vec::new();
        explorer.evaluate_actions(&mut outcomes);
        let chosen = black_box(explorer.choose(black_box(&outcomes), 0));
        (measured, seen, explorer.verdict(), chosen)
    });
    let (measured, seen, _, action) = decided;
    seen.ok()?;
    put_observation(&measured.ok()?, put);
    for p in explorer.posterior() {
        put(&p.to_le_bytes());
    }
    put(&explorer.log_odds().unwrap_or(f32::NAN).to_le_bytes());
    put(&[action.movement]);
    for outcome in &explorer.expected_outcomes() {
        put(&outcome.uncertainty.to_le_bytes());
        put(&outcome.benefit.to_le_bytes());
    }
    Some(())
}

/// The slide of so many samples, all at constant speed, after its first block, which has none.
fn slide_of<'p>(plan: &'p Plan, samples: &[i16]) -> (Slide<'p>, Block) {
    let mut slide = Slide::new(plan, Movement::FOR_TRACTION);
    slide.set_background(2.0);
    let mut block = Block {
        steady: Some((0, samples.len() as u32)),
        ..Block::default()
    };
    slide.take(&block);
    block.steady = None;
    (slide, block)
}

fn fill(block: &mut Block, samples: &[i16]) {
    block.number += 1;
    block.pac.clear();
    // a block has space for them
    let _ = block.pac.extend_from_slice(samples);
    let _ = block.shear_mn.resize(SHEARS, 700);
}

fn put_observation(observed: &Observation, put: &mut impl FnMut(&[u8])) {
    for property in Property::ALL {
        let value = observed.properties.get(property).unwrap_or(f32::NAN);
        put(&value.to_le_bytes());
    }
    observed
        .bands
        .iter()
        .for_each(|band| put(&band.to_le_bytes()));
}
