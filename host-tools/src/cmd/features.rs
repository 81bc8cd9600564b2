//! `tactus features`: what every recorded slide measures.

use std::io::Write;

use clap::ValueEnum;
use tactus_core::features::{BAND_EDGES, Property};

use super::args::Recordings;
use super::textures::feel_folder;

/// Print the properties and band powers of every recorded slide
#[derive(clap::Args)]
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
    let (set, felt) = feel_folder(&args.from.recordings)?;
    let rows = set
        .textures()
        .iter()
        .zip(&felt)
        .flat_map(|(texture, slides)| slides.iter().map(move |s| (texture, s)));
    match args.format {
        Rows::Csv => {
            write!(
                out,
                "material,slide,traction_n,roughness_ln,fineness_unfiltered_ln"
            )?;
            for band in 0..BAND_EDGES.len() - 1 {
                write!(out, ",ln_psd_band{band}")?;
            }
            writeln!(out)?;
            for (texture, slide) in rows {
                write!(out, "{},{}", texture.id, slide.number)?;
                for property in Property::ALL {
                    match slide.measurement.properties.get(property) {
                        Some(value) => write!(out, ",{value:.6}")?,
                        None => write!(out, ",")?,
                    }
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
                "{:>3} {:<24} {:>5}  {:<20} {:>10} {:>10} {:>10}  ln of eight bands, 20 to 1000 Hz",
                "no.", "texture", "slide", "movement", "traction N", "roughness", "fineness"
            )?;
            for (texture, slide) in rows {
                write!(
                    out,
                    "{:>3} {:<24} {:>5}  {:<20}",
                    texture.id,
                    texture.name,
                    slide.number,
                    slide.movement.to_string()
                )?;
                for property in Property::ALL {
                    match slide.measurement.properties.get(property) {
                        Some(value) => write!(out, " {value:>10.3}")?,
                        None => write!(out, " {:>10}", "-")?,
                    }
                }
                write!(out, " ")?;
                for band in slide.measurement.ln_bands() {
                    write!(out, " {band:>5.1}")?;
                }
                writeln!(
                    out,
                    "{}",
                    if slide.measurement.roughness_is_bound {
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
