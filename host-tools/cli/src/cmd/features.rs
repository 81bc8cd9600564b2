//! `tactus features`: what every recorded slide measures.

use std::io::Write;

use clap::ValueEnum;
use serde::Serialize;
use tactus_core::features::{BAND_EDGES, Property};
use tactus_lab::data::replay::trials;

use super::args::Recordings;
use super::textures::measure_folder;

/// Print the properties and band powers of every recorded slide
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tactus features --recordings DIR
  tactus features --recordings DIR --format csv > features.csv")]
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
    /// Aligned, for people
    Text,
}

#[derive(Serialize)]
struct SlideFeatures<'s> {
    material: u32,
    name: &'s str,
    slide: u32,
    trial: usize,
    force_n: f32,
    speed_mm_s: f32,
    traction_n: Option<f32>,
    roughness_ln: Option<f32>,
    roughness_is_bound: bool,
    fineness_unfiltered_ln: Option<f32>,
    ln_psd_bands: Vec<f32>,
}

pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    let (set, measured) = measure_folder(&args.from.folder()?)?;
    let textures = set.textures().iter().zip(&measured);
    let rows = textures.flat_map(|(texture, slides)| {
        let numbered = slides.iter().zip(trials(slides));
        numbered.map(move |(slide, trial)| (texture, slide, trial))
    });
    match args.format {
        Rows::Csv => {
            let bands = (0..BAND_EDGES.len() - 1).map(|band| format!(",ln_psd_band{band}"));
            writeln!(
                out,
                "material,slide,traction_n,roughness_ln,fineness_unfiltered_ln{},name,force_n,speed_mm_s,trial",
                bands.collect::<String>()
            )?;
            for (texture, slide, trial) in rows {
                write!(out, "{},{}", texture.id, slide.number)?;
                for property in Property::ALL {
                    let value = slide.measurement.properties.get(property);
                    write!(
                        out,
                        ",{}",
                        value.map_or(String::new(), |value| format!("{value:.6}"))
                    )?;
                }
                for band in slide.measurement.ln_bands() {
                    write!(out, ",{band:.6}")?;
                }
                let (force_n, speed_mm_s) = (slide.movement.force_n(), slide.movement.speed_mm_s());
                let name = csv_field(&texture.name);
                writeln!(out, ",{name},{force_n:.3},{speed_mm_s:.3},{trial}")?;
            }
        }
        Rows::Json => {
            for (texture, slide, trial) in rows {
                let measurement = &slide.measurement;
                let value = |property| measurement.properties.get(property);
                let features = SlideFeatures {
                    material: texture.id,
                    name: &texture.name,
                    slide: slide.number,
                    trial,
                    force_n: slide.movement.force_n(),
                    speed_mm_s: slide.movement.speed_mm_s(),
                    traction_n: value(Property::Traction),
                    roughness_ln: value(Property::Roughness),
                    roughness_is_bound: measurement.roughness_is_bound,
                    fineness_unfiltered_ln: value(Property::Fineness),
                    ln_psd_bands: measurement.ln_bands().into_iter().collect(),
                };
                writeln!(out, "{}", serde_json::to_string(&features)?)?;
            }
        }
        Rows::Text => {
            writeln!(
                out,
                "no. {:<24} slide  {:<20} traction N  roughness   fineness  ln of eight bands, 20 to 1000 Hz",
                "texture", "movement"
            )?;
            for (texture, slide, _) in rows {
                let (id, name, number) = (texture.id, &texture.name, slide.number);
                let movement = slide.movement.to_string();
                write!(out, "{id:>3} {name:<24} {number:>5}  {movement:<20}")?;
                for property in Property::ALL {
                    let value = slide.measurement.properties.get(property);
                    let value = value.map_or("-".to_owned(), |value| format!("{value:.3}"));
                    write!(out, " {value:>10}")?;
                }
                write!(out, " ")?;
                for band in slide.measurement.ln_bands() {
                    write!(out, " {band:>5.1}")?;
                }
                let is_bound = slide.measurement.roughness_is_bound;
                writeln!(
                    out,
                    "{}",
                    if is_bound {
                        "  (not rougher than this)"
                    } else {
                        ""
                    }
                )?;
            }
        }
    }
    Ok(())
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
