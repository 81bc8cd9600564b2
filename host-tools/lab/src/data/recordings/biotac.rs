//! Reader of folders like `data/biotac`: `manifest.json` and, per material, the gzip of headerless little-endian 16-bit
//! records, one per slide.
//!
//! Fields that are read from the manifest: `slides` (their numbers, the same for all materials), `record` (name, count
//! and rate of each field of a record, in its order; `pac`, `pdc` and `f_tangential` are used), `motion.speed_mm_s`,
//! `steady_window_s`, and per file its name, material, sizes and hashes. Nothing is assumed about the numbers of
//! materials, slides or samples.
use std::path::PathBuf;

use serde::Deserialize;
use tactus_core::features::Movement;

use super::files::{
    BIOTAC_MANIFEST as MANIFEST, MAX_MANIFEST, Place, RecordingError, Result, distinct_textures,
    in_order_of_time, unpack,
};
use super::npy::{self, MAX_SAMPLES};
use crate::data::content::ContentError;
use crate::data::recording::{Labels, PAC_RATE_HZ, Recording, SlideKey, Texture};

/// The pressing force is not in the manifest: the arm pressed with about 0.8 N, which fell to 0.3 N over the slide.
pub const NOMINAL_FORCE_MN: u16 = 800;
/// Background power in counts^2: the records start with the finger in motion, and the golden roughness subtracts this
/// value.
pub const BACKGROUND_POWER: f32 = 2.2;

/// Most bytes of samples of one material: it is read into memory as a whole.
const MAX_RAW: u64 = 1 << 30;

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

/// Places of the fields in a record.
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
    ///
    /// # Errors
    /// If it cannot be read, is no such manifest, or contradicts itself.
    pub fn read(place: &Place) -> Result<Self> {
        let path = &place.folder().join(MANIFEST);
        let fault = |place: &str, cause| RecordingError::Entry {
            path: path.to_owned(),
            place: place.to_owned(),
            cause,
        };
        let bytes = place.read(MANIFEST, MANIFEST, MAX_MANIFEST)?;
        let json: Json = serde_json::from_slice(&bytes).map_err(|e| {
            let place = format!("line {}, column {}", e.line(), e.column());
            let json: serde_json::Value = serde_json::from_slice(&bytes).unwrap_or_default();
            let title = json["title"].as_str().unwrap_or_default();
            // the other recordings that this program knows have a manifest of the same name
            if title.starts_with("FabricSlide") {
                return fault("title", ContentError::Fabrics);
            }
            fault(&place, ContentError::Json(e, "data/biotac"))
        })?;
        let movement =
            Movement::from_si(f32::from(NOMINAL_FORCE_MN) * 1e-3, json.motion.speed_mm_s)
                .map_err(|e| fault("motion.speed_mm_s", e.into()))?;
        let record = Record::of(&json.record).map_err(|cause| fault("record", cause))?;

        let textures: Vec<Texture> = json.files.iter().map(Entry::texture).collect();
        distinct_textures(path, &textures)?;
        if textures.is_empty() {
            return Err(fault("files", ContentError::NoMaterial));
        }
        for entry in &json.files {
            if entry.n_slides == 0 || json.slides.is_empty() {
                return Err(RecordingError::EmptyTexture {
                    manifest: path.to_owned(),
                    id: entry.material,
                    name: entry.name.clone(),
                });
            }
            let place = format!("files, {}", entry.file);
            let listed = json.slides.len();
            if entry.n_slides != listed {
                let cause = ContentError::SlidesDisagree(entry.n_slides, listed);
                return Err(fault(&place, cause));
            }
            let bytes = (entry.n_slides * 2).checked_mul(record.values);
            if bytes.is_none_or(|n| n as u64 != entry.bytes_raw) {
                let (slides, values) = (entry.n_slides, record.values);
                let cause = ContentError::LengthDisagrees(entry.bytes_raw, slides, values);
                return Err(fault(&place, cause));
            }
            if entry.bytes_raw > MAX_RAW {
                let cause = ContentError::LongMaterial(entry.bytes_raw, MAX_RAW);
                return Err(fault(&place, cause));
            }
            // twice the raw size is more than gzip ever needs
            if entry.bytes_gz > entry.bytes_raw.saturating_mul(2) + 4096 {
                let cause = ContentError::LongPacked(entry.bytes_gz, entry.bytes_raw);
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

    /// The textures, and the slides of each.
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

    /// Reads all slides of one texture.
    pub(super) fn load(&self, place: &Place, texture: usize) -> Result<Vec<Recording>> {
        let entry = &self.files[texture];
        let values = entry.values(place)?;
        let records: Vec<&[i16]> = values.chunks_exact(self.record.values).collect();
        self.slides
            .iter()
            .map(|&(number, place)| {
                let record = records[place];
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
                    pdc_rate_hz: pdc.rate_hz,
                    outside_mn: None,
                    pace: None,
                    shear_rate_hz: shear.unwrap_or(pdc).rate_hz,
                };
                let slide = slide.cut(&[], field(pac), shear.map(field));
                slide.map_err(|cause| RecordingError::Entry {
                    path: self.path.clone(),
                    place: format!("slide {number} of {}", entry.file),
                    cause,
                })
            })
            .collect()
    }
}

impl Record {
    fn of(fields: &[Field]) -> std::result::Result<Self, ContentError> {
        let mut start = 0;
        let (mut pac, mut pdc, mut shear) = (None, None, None);
        for field in fields {
            let Field {
                ref name,
                count,
                rate_hz,
            } = *field;
            if count == 0 || count > MAX_SAMPLES {
                return Err(ContentError::FieldLength(name.clone(), count));
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
                return Err(ContentError::Twice(name.clone()));
            }
            *slot = span;
            start += count;
        }
        let pac = pac.ok_or(ContentError::NoField("pac"))?;
        if pac.rate_hz != PAC_RATE_HZ {
            return Err(ContentError::PacFieldRate(pac.rate_hz));
        }
        Ok(Self {
            values: start,
            pac,
            pdc: pdc.ok_or(ContentError::NoField("pdc"))?,
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
    fn values(&self, place: &Place) -> Result<Vec<i16>> {
        let packed = place.read(MANIFEST, &self.file, self.bytes_gz)?;
        let path = place.folder().join(&self.file);
        if (packed.len() as u64) < self.bytes_gz {
            return Err(RecordingError::Samples {
                path,
                cause: ContentError::Truncated(packed.len(), self.bytes_gz),
            });
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
