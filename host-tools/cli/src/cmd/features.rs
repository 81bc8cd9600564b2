//! `tactus features`: what every recorded slide measures.

use std::io::Write;

use clap::ValueEnum;
use serde::Serialize;
use tactus_core::features::{
    FEATURE_STEPS, FUSED_BANDS, FeatureSet, Movement, Observation, Property,
};
use tactus_lab::data::recording::{SlideKey, Texture};
use tactus_lab::data::recordings::{RecordingSet, npy};
use tactus_lab::data::replay::{MeasuredSlide, trials};
use tactus_lab::eval::basis::{best_features, length};

use super::args::Recordings;
use super::textures::measure_folder;

/// Print the properties and the features of every recorded slide
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tactus features --recordings DIR
  tactus features --recordings DIR --format csv > features.csv
  tactus features --recordings DIR --format npz > features.npz    numpy.load gives X, y, sessions, runs")]
pub(crate) struct Args {
    #[command(flatten)]
    from: Recordings,
    /// How to print them
    #[arg(long, value_enum, default_value_t = Rows::Text)]
    format: Rows,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Rows {
    /// Comma-separated, for programs
    Csv,
    /// An object for every slide on a line of its own, for programs
    Json,
    /// Arrays of numpy, for other classifiers: the features that the method `fused` would use of these slides
    Npz,
    /// Aligned, for people
    Text,
}

#[derive(Serialize)]
struct SlideFeatures<'s> {
    material: u32,
    name: &'s str,
    slide: u32,
    trial: usize,
    force_n: Option<f32>,
    speed_mm_s: Option<f32>,
    traction_n: Option<f32>,
    roughness_ln: Option<f32>,
    roughness_is_bound: bool,
    fineness_unfiltered_ln: Option<f32>,
    /// `null` where the sensor does not measure a band.
    ln_fused_bands: [Option<f32>; FUSED_BANDS],
    pdc_mean: Option<f32>,
    pdc_sd: Option<f32>,
    session: &'s str,
    run: &'s str,
    #[serde(skip)]
    movement: Movement,
}

impl<'s> SlideFeatures<'s> {
    fn of(texture: &'s Texture, slide: &MeasuredSlide, trial: usize, key: &'s SlideKey) -> Self {
        let measurement = &slide.measurement;
        let value = |property| measurement.properties.get(property);
        let (force_n, speed_mm_s) = slide.movement.known();
        let bands = measurement.spectrum.fused_bands();
        let (pdc_mean, pdc_sd) = measurement.pdc.unzip();
        Self {
            material: texture.id,
            name: &texture.name,
            slide: slide.number,
            trial,
            force_n,
            speed_mm_s,
            traction_n: value(Property::Traction),
            roughness_ln: value(Property::Roughness),
            roughness_is_bound: measurement.roughness_is_bound,
            fineness_unfiltered_ln: value(Property::Fineness),
            ln_fused_bands: std::array::from_fn(|band| {
                (band < measurement.bands).then_some(bands[band])
            }),
            pdc_mean,
            pdc_sd,
            session: &key.labels.session,
            run: &key.labels.run,
            movement: slide.movement,
        }
    }

    fn properties(&self) -> [Option<f32>; 3] {
        [
            self.traction_n,
            self.roughness_ln,
            self.fineness_unfiltered_ln,
        ]
    }
}

pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    let (set, measured) = measure_folder(&args.from.folder()?, &args.from.only)?;
    if args.format == Rows::Npz {
        // as it is: what is printed has no bytes that do not print
        return Ok(std::io::stdout().write_all(&arrays(&set, &measured)?)?);
    }
    let textures = set.textures().iter().zip(&measured).enumerate();
    let rows = textures.flat_map(|(index, (texture, slides))| {
        let numbered = slides.iter().zip(trials(slides)).zip(set.slides(index));
        numbered.map(move |((slide, trial), key)| SlideFeatures::of(texture, slide, trial, key))
    });
    match args.format {
        Rows::Csv => csv(rows, out),
        Rows::Text => text(rows, out),
        Rows::Json | Rows::Npz => {
            for row in rows {
                writeln!(out, "{}", serde_json::to_string(&row)?)?;
            }
            Ok(())
        }
    }
}

fn csv<'s>(
    rows: impl Iterator<Item = SlideFeatures<'s>>,
    out: &mut impl Write,
) -> anyhow::Result<()> {
    let bands: String = (0..FUSED_BANDS)
        .map(|band| format!(",ln_fused_band{band}"))
        .collect();
    let properties = "material,slide,traction_n,roughness_ln,fineness_unfiltered_ln";
    writeln!(
        out,
        "{properties}{bands},pdc_mean,pdc_sd,session,run,name,force_n,speed_mm_s,trial"
    )?;
    let cell = |value: Option<f32>, digits: usize| {
        value.map_or(String::new(), |value| format!("{value:.digits$}"))
    };
    for row in rows {
        write!(out, "{},{}", row.material, row.slide)?;
        let pdc = [row.pdc_mean, row.pdc_sd];
        for value in row
            .properties()
            .iter()
            .chain(&row.ln_fused_bands)
            .chain(&pdc)
        {
            write!(out, ",{}", cell(*value, 6))?;
        }
        let [session, run, name] = [row.session, row.run, row.name].map(csv_field);
        let (force, speed) = (cell(row.force_n, 3), cell(row.speed_mm_s, 3));
        writeln!(out, ",{session},{run},{name},{force},{speed},{}", row.trial)?;
    }
    Ok(())
}

fn text<'s>(
    rows: impl Iterator<Item = SlideFeatures<'s>>,
    out: &mut impl Write,
) -> anyhow::Result<()> {
    writeln!(
        out,
        "no. {:<24} slide  {:<20} traction N  roughness   fineness  P_DC mean, scatter  ln of 26 bands",
        "texture", "movement"
    )?;
    for row in rows {
        let (movement, slide) = (row.movement.to_string(), row.slide);
        write!(
            out,
            "{:>3} {:<24} {slide:>5}  {movement:<20}",
            row.material, row.name
        )?;
        let value = |value: Option<f32>, digits: usize| {
            value.map_or("-".to_owned(), |value| format!("{value:.digits$}"))
        };
        for property in row.properties() {
            write!(out, " {:>10}", value(property, 3))?;
        }
        let [mean, scatter] = [row.pdc_mean, row.pdc_sd].map(|pdc| value(pdc, 1));
        write!(out, " {mean:>10} {scatter:>8} ")?;
        for band in row.ln_fused_bands {
            write!(out, " {:>5}", value(band, 1))?;
        }
        let bound = ["", "  (not rougher than this)"][usize::from(row.roughness_is_bound)];
        writeln!(out, "{bound}")?;
    }
    Ok(())
}

/// The features that the method `fused` would use of these slides, as a `.npz` file.
fn arrays(set: &RecordingSet, measured: &[Vec<MeasuredSlide>]) -> std::io::Result<Vec<u8>> {
    let slides: Vec<Vec<Vec<Observation>>> = measured
        .iter()
        .map(|slides| {
            let of = |movement: Movement| {
                let same = slides.iter().filter(|slide| slide.movement == movement);
                same.map(MeasuredSlide::observation).collect()
            };
            set.movements().into_iter().map(of).collect()
        })
        .collect();
    let features = best_features(&slides);
    let mut names = match features {
        FeatureSet::Force => vec!["traction_n".to_owned()],
        FeatureSet::Pressure => ["pdc_mean_100", "ln_pdc_sd"].map(str::to_owned).to_vec(),
        FeatureSet::Bands => Vec::new(),
        FeatureSet::Properties => Property::ALL
            .map(|property| property.name().to_owned())
            .to_vec(),
    };
    if features != FeatureSet::Properties {
        let bands = length(features, &slides).saturating_sub(features.others());
        names.extend((0..bands).map(|band| format!("ln_fused_band{band}")));
    }
    let rows = || {
        let textures = set.textures().iter().zip(measured).enumerate();
        textures.flat_map(|(index, (texture, slides))| {
            let keys = slides.iter().zip(set.slides(index));
            keys.map(move |(slide, key)| (texture, slide, key))
        })
    };
    let mut x = Vec::new();
    for (_, slide, _) in rows() {
        let observed = slide.observation();
        let vector = observed.vector(features, names.len()).unwrap_or_default();
        x.extend(vector.iter().map(|steps| f32::from(*steps) / FEATURE_STEPS));
    }
    let all = rows().count();
    let floats = |values: Vec<f32>, shape: &[usize]| {
        let bytes: Vec<u8> = values.into_iter().flat_map(f32::to_le_bytes).collect();
        npy::array("<f4", shape, &bytes)
    };
    let numbers: Vec<u8> = rows()
        .flat_map(|(_, slide, _)| slide.number.to_le_bytes())
        .collect();
    let movement = |of: fn(Movement) -> Option<f32>| {
        let values = rows().map(|(_, slide, _)| of(slide.movement).unwrap_or(f32::NAN));
        floats(values.collect(), &[all])
    };
    let words = |of: fn(&SlideKey) -> &str| npy::words(rows().map(|(_, _, key)| of(key)));
    npy::zipped(&[
        ("X", floats(x, &[all, names.len()])),
        (
            "y",
            npy::words(rows().map(|(texture, ..)| texture.name.as_str())),
        ),
        (
            "feature_names",
            npy::words(names.iter().map(String::as_str)),
        ),
        ("slides", npy::array("<u4", &[all], &numbers)),
        ("sessions", words(|key| &key.labels.session)),
        ("runs", words(|key| &key.labels.run)),
        ("force_n", movement(|made| made.known().0)),
        ("speed_mm_s", movement(|made| made.known().1)),
    ])
}

/// A text as a cell: a spreadsheet takes what begins like a formula for one, unless there is an apostrophe before it.
fn csv_field(text: &str) -> String {
    let formula = text.starts_with(['=', '+', '-', '@', '\t', '\r']);
    let text = format!("{}{text}", if formula { "'" } else { "" });
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use super::csv_field;

    #[test]
    fn a_name_with_a_comma_is_one_field_and_none_is_a_formula() {
        for formula in ["=1+2", "+1", "-1", "@SUM(A1)"] {
            assert_eq!(csv_field(formula), format!("'{formula}"));
        }
        assert_eq!(csv_field("=A1,2"), "\"'=A1,2\"");
        assert_eq!(csv_field("Denim twill"), "Denim twill");
        assert_eq!(csv_field("5\" mesh, red"), "\"5\"\" mesh, red\"");
    }
}
