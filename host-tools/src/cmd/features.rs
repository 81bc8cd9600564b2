//! `tactus features`: what every recorded slide measures.

use std::io::Write;

use clap::ValueEnum;
use tactus_core::features::{BAND_EDGES, Property};

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
    /// Aligned, for people
    Text,
}

/// Prints a row for every slide.
pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    let (set, measured) = measure_folder(&args.from.recordings)?;
    let rows = set
        .textures()
        .iter()
        .zip(&measured)
        .flat_map(|(texture, slides)| slides.iter().map(move |s| (texture, s)));
    match args.format {
        Rows::Csv => {
            let bands = (0..BAND_EDGES.len() - 1).map(|band| format!(",ln_psd_band{band}"));
            writeln!(
                out,
                "material,slide,traction_n,roughness_ln,fineness_unfiltered_ln{}",
                bands.collect::<String>()
            )?;
            for (texture, slide) in rows {
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
                writeln!(out)?;
            }
        }
        Rows::Text => {
            writeln!(
                out,
                "no. {:<24} slide  {:<20} traction N  roughness   fineness  ln of eight bands, 20 to 1000 Hz",
                "texture", "movement"
            )?;
            for (texture, slide) in rows {
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
