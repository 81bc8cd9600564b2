//! Reader of folders like `data/biotac`: `manifest.json` and, per material, the gzip of headerless little-endian 16-bit
//! records, one per slide.
//!
//! Fields that are read from the manifest: `slides` (their numbers, the same for all materials), `record` (name, count
//! and rate of each field of a record, in its order; `pac`, `pdc` and `f_tangential` are used), `motion.speed_mm_s`,
//! `steady_window_s`, and per file its name, material, sizes and hashes. Nothing is assumed about the numbers of
//! materials, slides or samples.
use std::path::{Path, PathBuf};

use serde::Deserialize;
use tactus_core::features::Movement;

use super::files::{
    BIOTAC_MANIFEST as MANIFEST, IN_FLIGHT, MAX_MANIFEST, RecordingError, Result, check_text,
    distinct_textures, in_order_of_time, inside, read_bounded, read_named, unpack,
};
use super::npy::{self, MAX_SAMPLES};
use crate::data::recording::{Labels, PAC_RATE_HZ, Recording, SlideKey, Texture};

/// The pressing force is not in the manifest: the arm pressed with about 0.8 N, which fell to 0.3 N over the slide.
pub(crate) const NOMINAL_FORCE_MN: u16 = 800;
/// Background power in counts^2: the records start with the finger in motion, and the golden roughness subtracts this
/// value.
pub(crate) const BACKGROUND_POWER: f32 = 2.2;

/// Memory of a material in its bytes of samples: packed, twice that at most, unpacked, and as samples.
const COPIES: u64 = 4;
/// Most bytes of samples of one material, 1000 slides of 6 s: it is read into memory as a whole.
const MAX_RAW: u64 = IN_FLIGHT / COPIES / 2;
/// Most slides of all materials together.
const MAX_SLIDES: usize = 1 << 20;

/// The contents of a manifest, checked.
#[derive(Debug)]
pub struct Manifest {
    path: PathBuf,
    movement: Movement,
    window: (f32, f32),
    /// (number, place in the file), in the order of numbers
    slides: Vec<(u32, usize)>,
    record: Record,
    files: Vec<Entry>,
}

#[derive(Debug)]
struct Record {
    values: usize,
    pac: Span,
    pdc: Span,
    shear: Option<Span>,
}

#[derive(Clone, Copy, Debug)]
struct Span {
    start: usize,
    count: usize,
    rate_hz: u32,
}

#[derive(Deserialize, Debug)]
struct Json {
    slides: Vec<u32>,
    record: Vec<Field>,
    motion: Motion,
    steady_window_s: (f32, f32),
    files: Vec<Entry>,
}

#[derive(Deserialize, Debug)]
struct Field {
    name: String,
    count: usize,
    rate_hz: u32,
}

#[derive(Deserialize, Debug)]
struct Motion {
    speed_mm_s: f32,
}

#[derive(Deserialize, Debug)]
struct Entry {
    file: String,
    material: u32,
    name: String,
    n_slides: usize,
    bytes_gz: u64,
    bytes_raw: u64,
    sha256_gz: String,
    sha256_raw: String,
}

impl Manifest {
    /// Reads and checks a manifest.
    /// Errors: if it cannot be read, is no such manifest, or contradicts itself.
    pub fn read(folder: &Path) -> Result<Self> {
        let path = &inside(folder, MANIFEST, MANIFEST)?;
        let fault =
            |place: &str, cause: String| RecordingError::at(path, format!("{place}: {cause}"));
        let bytes = read_bounded(path, MAX_MANIFEST)?;
        let json: Json = serde_json::from_slice(&bytes).map_err(|e| {
            let place = format!("line {}, column {}", e.line(), e.column());
            fault(&place, format!("{e}; the layout is that of data/biotac"))
        })?;
        let movement =
            Movement::from_si(f32::from(NOMINAL_FORCE_MN) * 1e-3, json.motion.speed_mm_s)
                .map_err(|e| fault("motion.speed_mm_s", e.to_string()))?;
        let record = Record::of(&json.record).map_err(|cause| fault("record", cause))?;

        let textures: Vec<Texture> = json.files.iter().map(Entry::texture).collect();
        distinct_textures(path, &textures)?;
        if textures.is_empty() {
            return Err(fault("files", "no material is listed".to_owned()));
        }
        if textures.len().saturating_mul(json.slides.len()) > MAX_SLIDES {
            let cause = format!("more than {MAX_SLIDES} slides in all; split the folder");
            return Err(fault("slides", cause));
        }
        for entry in &json.files {
            check_text(path, "files", &entry.name)?;
            if entry.n_slides == 0 || json.slides.is_empty() {
                return Err(RecordingError::empty_texture(path, &entry.texture()));
            }
            let place = format!("files, {}", entry.file);
            let listed = json.slides.len();
            if entry.n_slides != listed {
                let slides = entry.n_slides;
                let cause =
                    format!("n_slides is {slides}, but \"slides\" lists {listed}; they must agree");
                return Err(fault(&place, cause));
            }
            let bytes = (entry.n_slides * 2).checked_mul(record.values);
            if bytes.is_none_or(|n| n as u64 != entry.bytes_raw) {
                let (slides, values) = (entry.n_slides, record.values);
                let cause = format!(
                    "bytes_raw is {}, but slides ({slides}) of {values} 16-bit values are not that many bytes; they \
                     must agree",
                    entry.bytes_raw
                );
                return Err(fault(&place, cause));
            }
            if entry.bytes_raw > MAX_RAW {
                let cause = format!(
                    "bytes_raw is {}, more than the {MAX_RAW} bytes one material can have; split it",
                    entry.bytes_raw
                );
                return Err(fault(&place, cause));
            }
            // twice the raw size is more than gzip ever needs
            if entry.bytes_gz > entry.bytes_raw.saturating_mul(2) + 4096 {
                let cause = format!(
                    "bytes_gz is {}, far more than the {} bytes that are in it; correct the manifest",
                    entry.bytes_gz, entry.bytes_raw
                );
                return Err(fault(&place, cause));
            }
        }
        let mut slides: Vec<(u32, usize)> = json.slides.into_iter().zip(0..).collect();
        in_order_of_time(
            path,
            textures[0].id,
            &mut slides,
            |s| s.0,
            |s| format!("slides, entry {}", s.1 + 1),
        )?;
        Ok(Self {
            path: path.to_owned(),
            movement,
            window: json.steady_window_s,
            slides,
            record,
            files: json.files,
        })
    }

    pub(super) fn contents(&self) -> (Vec<Texture>, Vec<Vec<SlideKey>>) {
        let key = |&(number, _): &(u32, usize)| SlideKey {
            number,
            movement: self.movement,
            labels: Labels::default(),
        };
        let slides: Vec<SlideKey> = self.slides.iter().map(key).collect();
        (
            self.files.iter().map(Entry::texture).collect(),
            vec![slides; self.files.len()],
        )
    }

    pub(super) fn memory(&self, texture: usize) -> u64 {
        COPIES * self.files[texture].bytes_raw
    }

    pub(super) fn each_slide(
        &self,
        folder: &Path,
        texture: usize,
        take: &mut dyn FnMut(Recording) -> Result<()>,
    ) -> Result<()> {
        let entry = &self.files[texture];
        let values = entry.values(folder)?;
        self.slides
            .iter()
            .map(|&(number, place)| {
                let record = &values[place * self.record.values..][..self.record.values];
                let field = |span: Span| &record[span.start..][..span.count];
                let Record {
                    pac, pdc, shear, ..
                } = self.record;
                let slide = Recording {
                    texture,
                    number,
                    movement: self.movement,
                    window: self.window,
                    blocks: Vec::new(),
                    background: Some(BACKGROUND_POWER),
                    pdc: field(pdc).to_vec(),
                    pdc_rate_hz: pdc.rate_hz.into(),
                    outside_mn: None,
                    pace: None,
                    shear_rate_hz: shear.unwrap_or(pdc).rate_hz.into(),
                    highest_hz: None,
                };
                let slide = slide.cut(&[], field(pac), shear.map(field));
                slide.map_err(|cause| {
                    let cause = format!("slide {number} of {}: {cause}", entry.file);
                    RecordingError::at(&self.path, cause)
                })
            })
            .try_for_each(|slide| take(slide?))
    }
}

impl Record {
    fn of(fields: &[Field]) -> std::result::Result<Self, String> {
        let mut start = 0;
        let (mut pac, mut pdc, mut shear) = (None, None, None);
        for field in fields {
            let Field {
                ref name,
                count,
                rate_hz,
            } = *field;
            if count == 0 || count > MAX_SAMPLES {
                return Err(format!(
                    "{name} with {count} values; a slide has 1 to {MAX_SAMPLES}"
                ));
            }
            let span = Some(Span {
                start,
                count,
                rate_hz,
            });
            let slot = match name.as_str() {
                "pac" => &mut pac,
                "pdc" => &mut pdc,
                "f_tangential" => &mut shear,
                _ => &mut None,
            };
            if slot.is_some() {
                return Err(format!("{name} is listed twice"));
            }
            *slot = span;
            start += count;
        }
        let pac = pac.ok_or("there is no pac in it")?;
        if pac.rate_hz != PAC_RATE_HZ {
            return Err(format!(
                "pac at {} Hz; all of Tactus counts on {PAC_RATE_HZ} Hz",
                pac.rate_hz
            ));
        }
        Ok(Self {
            values: start,
            pac,
            pdc: pdc.ok_or("there is no pdc in it")?,
            shear,
        })
    }
}

impl Entry {
    fn texture(&self) -> Texture {
        Texture {
            id: self.material,
            name: self.name.clone(),
        }
    }

    /// All values of the file, hashes checked before and after decompression.
    fn values(&self, folder: &Path) -> Result<Vec<i16>> {
        let packed = read_named(folder, MANIFEST, &self.file, self.bytes_gz)?;
        let path = folder.join(&self.file);
        if (packed.len() as u64) < self.bytes_gz {
            let cause = format!(
                "truncated: {} bytes, the manifest says {}; fetch it again",
                packed.len(),
                self.bytes_gz
            );
            return Err(RecordingError::at(&path, cause));
        }
        let raw = unpack(
            &path,
            &packed,
            &self.sha256_gz,
            self.bytes_raw,
            &self.sha256_raw,
        )?;
        Ok(npy::from_le_bytes(&raw))
    }
}
