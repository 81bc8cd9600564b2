//! `tactus textures`: the names that other commands take.

use std::io::Write;
use std::path::PathBuf;

use serde::Serialize;
use tactus_lab::data::recordings::RecordingSet;
use tactus_world::textures::TEXTURES;

use super::output::{Format, print_json};
use super::table_file::read_table;

/// List the textures that are known: of the simulated world, of a table, or of recordings
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tactus textures                      the 117 textures of Table 1, as --texture and --textures take them
  tactus textures --recordings DIR     as --material takes them
  tactus textures --table FILE")]
pub(crate) struct Args {
    /// Those of a folder of recordings
    #[arg(long, value_name = "DIR")]
    recordings: Option<PathBuf>,
    /// Those of a texture table
    #[arg(long, value_name = "FILE", conflicts_with = "recordings")]
    table: Option<PathBuf>,
    /// How to print them
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

/// A texture, as it may be named.
#[derive(Serialize)]
struct KnownTexture {
    number: u32,
    name: String,
}

/// Lists them.
pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    let known: Vec<KnownTexture> = if let Some(folder) = &args.recordings {
        let set = RecordingSet::open(folder)?;
        let of = |texture: &tactus_lab::data::recording::Texture| KnownTexture {
            number: texture.id,
            name: texture.name.clone(),
        };
        set.textures().iter().map(of).collect()
    } else if let Some(file) = &args.table {
        let mut bytes = Vec::new();
        let table = read_table(file, &mut bytes)?;
        let known = (1..).zip(table.names());
        known
            .map(|(number, name)| KnownTexture {
                number,
                name: name.to_owned(),
            })
            .collect()
    } else {
        let of = |t: &tactus_world::textures::Named| KnownTexture {
            number: t.number.into(),
            name: t.name.to_owned(),
        };
        TEXTURES.iter().map(of).collect()
    };
    if args.format == Format::Json {
        return print_json(&known, out);
    }
    for KnownTexture { number, name } in known {
        writeln!(out, "{number:>3} {name}")?;
    }
    Ok(())
}
