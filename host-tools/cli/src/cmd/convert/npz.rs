//! Recordings as one `.npz` file: `numpy.load` opens it.

use std::io::Write;

use anyhow::Context as _;
use tactus_core::features::Property;
use tactus_lab::data::recordings::{RecordingSet, npy};
use tactus_lab::data::replay::MeasuredSlide;
use zip::ZipWriter;
use zip::write::{SimpleFileOptions, StreamWriter};

/// Writes the samples of every slide, and what is known of them: arrays with a row for each slide.
pub(super) fn write<W: Write>(
    to: W,
    set: &RecordingSet,
    measured: &[Vec<MeasuredSlide>],
    done: &(dyn Fn() + Sync),
) -> anyhow::Result<()> {
    let mut npz = Npz(ZipWriter::new_stream(to));
    let mut rows = Rows::default();
    for (index, (texture, measured)) in set.textures().iter().zip(measured).enumerate() {
        let slides = set.load_texture(index)?;
        let keys = set.slides(index);
        for ((slide, measured), key) in slides.iter().zip(measured).zip(keys) {
            let at = rows.number.len();
            let streams = [
                ("still", Some(slide.still())),
                ("pac", Some(slide.pac())),
                ("pdc", Some(slide.pdc.clone())),
                ("shear", slide.shear_mn()),
            ];
            for (stream, samples) in streams {
                let name = format!("{stream}_{at}");
                npz.add(&name, &npy::write(&samples.unwrap_or_default()))?;
            }
            rows.texture.push(texture.name.clone());
            rows.finger.push(key.labels.finger.to_string());
            rows.lot.push(key.labels.lot.clone());
            rows.number.push(slide.number);
            rows.movement.push((
                f32::from(slide.movement.force_mn()) * 1e-3,
                slide.movement.speed_um_s() as f32 * 1e-3,
            ));
            rows.window.push(slide.window);
            let measurement = &measured.measurement;
            let properties = Property::ALL.map(|p| measurement.properties.get(p));
            rows.properties
                .push(properties.map(|p| p.unwrap_or(f32::NAN)));
            rows.ln_bands.push(measurement.ln_bands().to_vec());
        }
        done();
    }
    rows.write(&mut npz)?;
    Ok(npz.0.finish()?.flush()?)
}

/// An array for each, a row for each slide.
#[derive(Default)]
struct Rows {
    texture: Vec<String>,
    finger: Vec<String>,
    lot: Vec<String>,
    number: Vec<u32>,
    movement: Vec<(f32, f32)>,
    window: Vec<(f32, f32)>,
    properties: Vec<[f32; 3]>,
    ln_bands: Vec<Vec<f32>>,
}

impl Rows {
    fn write<W: Write>(&self, npz: &mut Npz<W>) -> anyhow::Result<()> {
        let slides = self.number.len();
        for (name, texts) in [
            ("texture", &self.texture),
            ("finger", &self.finger),
            ("lot", &self.lot),
        ] {
            npz.texts(name, texts)?;
        }
        let numbers: Vec<u8> = self.number.iter().flat_map(|n| n.to_le_bytes()).collect();
        npz.add("slide", &npy::array("<u4", &[slides], &numbers))?;
        let pair = |pairs: &[(f32, f32)]| -> Vec<f32> {
            pairs.iter().flat_map(|(a, b)| [*a, *b]).collect()
        };
        npz.floats("movement", &[slides, 2], &pair(&self.movement))?;
        npz.floats("window_s", &[slides, 2], &pair(&self.window))?;
        npz.floats("properties", &[slides, 3], self.properties.as_flattened())?;
        let bands = self.ln_bands.first().map_or(0, Vec::len);
        npz.floats("ln_bands", &[slides, bands], &self.ln_bands.concat())
    }
}

struct Npz<W: Write>(ZipWriter<StreamWriter<W>>);

impl<W: Write> Npz<W> {
    fn add(&mut self, name: &str, array: &[u8]) -> anyhow::Result<()> {
        // numpy reads either; without a time the same recordings are the same file
        let stored = SimpleFileOptions::default()
            .compression_method(zip::CompressionMethod::Stored)
            .last_modified_time(zip::DateTime::default());
        let file = self.0.start_file(format!("{name}.npy"), stored);
        file.with_context(|| name.to_owned())?;
        Ok(self.0.write_all(array)?)
    }

    fn floats(&mut self, name: &str, shape: &[usize], values: &[f32]) -> anyhow::Result<()> {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.add(name, &npy::array("<f4", shape, &bytes))
    }

    /// Texts as numpy has them: all as long as the longest, four bytes a character.
    fn texts(&mut self, name: &str, texts: &[String]) -> anyhow::Result<()> {
        let longest = texts.iter().map(|text| text.chars().count()).max();
        let longest = longest.unwrap_or_default().max(1);
        let padded = texts.iter().flat_map(|text| {
            let characters = text.chars().map(u32::from);
            characters.chain(std::iter::repeat(0)).take(longest)
        });
        let bytes: Vec<u8> = padded.flat_map(u32::to_le_bytes).collect();
        self.add(
            name,
            &npy::array(&format!("<U{longest}"), &[texts.len()], &bytes),
        )
    }
}
