//! Writing a table in its binary form.

use core::fmt;

use serde::{Deserialize, Serialize};

use super::format::{
    Action, CELL_BYTES, CRC_BYTES, Contents, HEAD, LENGTH, MAGIC, MAX_MOVEMENTS, SLOPES,
    TableError, Tally, VERSION, each,
};
use super::gaussian::{SD_LEAST, SD_STEP, mean_step};
use super::name::MAX_NAME;
use super::sections::Sections;
use super::training_stats::{Experience, Whitened};
use super::view::Table;
use super::whitening::Whitening;
use crate::CRC32;
use crate::features::{FeatureSet, Movement, Property, PropertySet};

/// The training statistics of a texture, movement by movement, as its table keeps them.
#[derive(Clone, Copy, Debug)]
pub enum TextureStats<'a> {
    /// For a table of Gaussians.
    Gaussians(&'a [Experience]),
    /// For a fused table.
    Fused(&'a [Whitened]),
}

/// A change of a table.
#[derive(Clone, Copy, Debug)]
#[allow(missing_docs)] // fields whose names say it
pub enum Change<'a> {
    /// Puts a texture in: it replaces the one of that name, or is added.
    Put {
        name: &'a str,
        known: TextureStats<'a>,
        tally: Tally,
    },
    /// Another name.
    Rename { texture: u16, name: &'a str },
    /// A texture less.
    Forget(u16),
}

/// The reasons why a table was not written.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, thiserror::Error)]
#[allow(missing_docs)] // their texts say it
pub enum EncodeError {
    #[error("a table needs a texture, a property and 1 to {MAX_MOVEMENTS} movements")]
    Empty,
    #[error("what was learned does not fit this kind of table")]
    Contents,
    #[error("the table has no texture {}", .0 + 1)]
    Texture(u16),
    #[error("the table takes {0} bytes, and there is less room")]
    NoSpace(usize),
    #[error("texture {} was not learned at every movement", .0 + 1)]
    Movements(u16),
    #[error("the name of texture {} is longer than {MAX_NAME} bytes: shorten it", .0 + 1)]
    Name(u16),
    /// A mean that the fixed point cannot hold.
    #[error(fmt = range)]
    Range {
        texture: u16,
        action: Action,
        mean: f32,
    },
    /// The written table is invalid: a name is none or there twice, or a movement is.
    #[error(transparent)]
    Invalid(TableError),
}

fn range(texture: &u16, action: &Action, mean: &f32, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    // in whole numbers: the chip has better use for the 9 KB that printing any f32 takes
    let tenths = libm::roundf(10.0 * mean) as i32;
    let most = action.property.map_or(0.0, mean_step) * 32768.0;
    write!(
        f,
        "texture {}, movement {}: {} {}{}.{} is beyond the table's +-{}",
        texture + 1,
        action.movement + 1,
        action.what(),
        if tenths < 0 { "-" } else { "" },
        tenths.unsigned_abs() / 10,
        tenths.unsigned_abs() % 10,
        most as u16
    )
}

/// Bytes that a table without sections takes, names and their lengths included in `names`.
pub const fn encoded_len(
    contents: Contents,
    textures: usize,
    movements: usize,
    names: usize,
) -> usize {
    contents.layout(textures, movements).names + names + CRC_BYTES
}

/// Writes a table of Gaussians into `out` and reads it back: every texture with its name, valid and unlike every
/// other, and what was learned of it, movement by movement. Means are rounded to [`mean_step`], standard
/// deviations to [`SD_STEP`] and kept between [`SD_LEAST`] and 4. Errors: parts of `out` may have been written then.
pub fn encode<'o, 'a>(
    out: &'o mut [u8],
    measured: PropertySet,
    movements: &[Movement],
    textures: impl Iterator<Item = (&'a str, &'a [Experience])> + Clone,
) -> Result<Table<'o>, EncodeError> {
    if measured.is_empty() {
        return Err(EncodeError::Empty);
    }
    let rows = textures.zip(0..=u16::MAX).map(|((name, known), number)| {
        let slides = known.iter().map(Experience::trials);
        Row::new(name, number, TextureStats::Gaussians(known), slides)
    });
    let head = Head {
        contents: Contents::Gaussians(measured),
        movements: movements.iter().copied(),
        whitenings: core::iter::empty(),
        lineage: 0,
    };
    write(out, head, rows, |_| Ok(()))
}

/// Writes a fused table into `out` and reads it back: every movement with its whitening, every texture with its name
/// and what was learned of it, movement by movement.
/// Errors: parts of `out` may have been written then.
pub fn encode_fused<'o, 'a>(
    out: &'o mut [u8],
    set: FeatureSet,
    movements: &[(Movement, Whitening)],
    textures: impl Iterator<Item = (&'a str, &'a [Whitened])> + Clone,
) -> Result<Table<'o>, EncodeError> {
    let features = movements.first().map_or(0, |(_, w)| w.features());
    if !set.allows(features) || movements.iter().any(|(_, w)| w.features() != features) {
        return Err(EncodeError::Contents);
    }
    let rows = textures.zip(0..=u16::MAX).map(|((name, known), number)| {
        let slides = known.iter().map(|w| w.slides);
        Row::new(name, number, TextureStats::Fused(known), slides)
    });
    let head = Head {
        contents: Contents::Fused(set, features as u8),
        movements: movements.iter().map(|(movement, _)| *movement),
        whitenings: movements.iter().map(|(_, whitening)| whitening.as_bytes()),
        lineage: 0,
    };
    write(out, head, rows, |_| Ok(()))
}

/// Writes `old`, a fused table, into `out` with these sections instead of its own.
pub fn with_sections<'o>(
    out: &'o mut [u8],
    old: &Table<'_>,
    sections: &Sections<'_>,
) -> Result<Table<'o>, EncodeError> {
    let Contents::Fused(_, features) = old.contents else {
        return Err(EncodeError::Contents);
    };
    let write = |writer: &mut Writer<'_>| sections.write(features.into(), writer);
    rewrite(out, old, 0, Row::all(old), |_| false, write)
}

/// Writes `old` with one section in the place of that of the same kind, or without it if it would have no bytes.
pub(super) fn with_section<'o>(
    out: &'o mut [u8],
    old: &Table<'_>,
    kind: u16,
    is_there: bool,
    contents: impl FnOnce(&mut Writer<'_>),
) -> Result<Table<'o>, EncodeError> {
    let others = |other| other != kind;
    let write = |writer: &mut Writer<'_>| match is_there {
        true => writer.section(kind, contents),
        false => Ok(()),
    };
    rewrite(out, old, old.lineage(), Row::all(old), others, write)
}

/// Writes these rows with all else as `old` has it: of its sections those to be kept, and more behind them.
pub(super) fn rewrite<'o, 'a>(
    out: &'o mut [u8],
    old: &Table<'_>,
    lineage: u32,
    rows: impl Iterator<Item = Row<'a>> + Clone,
    keeps: impl Fn(u16) -> bool,
    more: impl FnOnce(&mut Writer<'_>) -> Result<(), EncodeError>,
) -> Result<Table<'o>, EncodeError> {
    let layout = old.layout();
    let whitenings = old.bytes.get(layout.whitenings..layout.cells);
    let head = Head {
        contents: old.contents,
        movements: old.movements(),
        whitenings: whitenings.into_iter(),
        lineage,
    };
    write(out, head, rows, |writer| {
        for (kind, contents) in each(old.sections)
            .flatten()
            .filter(|(kind, _)| keeps(*kind))
        {
            writer.section(kind, |writer| writer.put(contents))?;
        }
        more(writer)
    })
}

/// Writes `old` into `out` with one change. All other textures stay the same to the bit; what a table knows of shorter
/// slides is left out, unless a texture gets another name: every one that is there must be known of them.
/// Errors: as [`encode`], and [`EncodeError::Texture`].
#[inline]
pub fn amend<'o>(
    out: &'o mut [u8],
    old: &Table<'_>,
    change: Change<'_>,
) -> Result<Table<'o>, EncodeError> {
    if let Change::Rename { texture, .. } | Change::Forget(texture) = change
        && texture >= old.textures
    {
        return Err(EncodeError::Texture(texture));
    }
    let replaced = match change {
        Change::Put { name, .. } => old.find(name),
        _ => None,
    };
    let added = match change {
        Change::Put { name, known, tally } if replaced.is_none() => Some(Row {
            name,
            number: old.next_number(),
            tally,
            cells: Cells::New(known),
            slope_of: None,
        }),
        _ => None,
    };
    let kept = Row::all(old)
        .zip(0..)
        .filter_map(|(row, texture)| match change {
            Change::Forget(gone) if gone == texture => None,
            Change::Rename { texture: it, name } if it == texture => Some(Row { name, ..row }),
            Change::Put { known, tally, .. } if replaced == Some(texture) => Some(Row {
                tally,
                cells: Cells::New(known),
                ..row
            }),
            _ => Some(row),
        });
    let rows = kept.chain(added);
    // what shorter slides say is of these textures and no others; every row has its slopes, those of all for a new one
    let same = matches!(change, Change::Rename { .. });
    let keeps = |kind| kind != SLOPES && (same || kind != LENGTH);
    let slopes = rows.clone().map(|row| row.slope_of);
    let more = |writer: &mut Writer<'_>| old.put_slopes(slopes, writer);
    rewrite(out, old, old.lineage(), rows, keeps, more)
}

#[derive(Clone, Copy)]
enum Cells<'a> {
    Old(Table<'a>, u16),
    New(TextureStats<'a>),
}

#[derive(Clone, Copy)]
pub(super) struct Row<'a> {
    name: &'a str,
    number: u16,
    tally: Tally,
    cells: Cells<'a>,
    /// The texture of the old table whose slopes it has.
    slope_of: Option<u16>,
}

impl<'a> Row<'a> {
    pub(super) fn all(table: &Table<'a>) -> impl Iterator<Item = Self> + Clone + use<'a> {
        let table = *table;
        table.names().zip(0..).map(move |(name, texture)| Self {
            name,
            number: table.number(texture),
            tally: table.tally(texture),
            cells: Cells::Old(table, texture),
            slope_of: Some(texture),
        })
    }

    fn new(
        name: &'a str,
        number: u16,
        known: TextureStats<'a>,
        slides: impl Iterator<Item = u8>,
    ) -> Self {
        let factory = slides.fold(0, u8::saturating_add);
        Self {
            name,
            number,
            tally: Tally {
                factory,
                ..Tally::default()
            },
            cells: Cells::New(known),
            slope_of: None,
        }
    }

    fn put_cells(
        &self,
        writer: &mut Writer<'_>,
        contents: Contents,
        movements: usize,
        index: u16,
    ) -> Result<(), EncodeError> {
        let whole = |known: usize| match known == movements {
            true => Ok(()),
            false => Err(EncodeError::Movements(index)),
        };
        match (self.cells, contents) {
            (Cells::Old(table, texture), _) => {
                for movement in 0..table.movements {
                    writer.put(table.cell_bytes(texture, movement).unwrap_or_default());
                }
            }
            (Cells::New(TextureStats::Gaussians(known)), Contents::Gaussians(measured)) => {
                whole(known.len())?;
                put_gaussians(writer, measured, known, index)?;
            }
            (Cells::New(TextureStats::Fused(known)), Contents::Fused(_, features)) => {
                whole(known.len())?;
                for known in known {
                    writer.put_numbers(known.mean.iter().take(features.into()));
                }
            }
            _ => return Err(EncodeError::Contents),
        }
        Ok(())
    }

    fn put_trials(&self, writer: &mut Writer<'_>) {
        match self.cells {
            Cells::Old(table, texture) => {
                (0..table.movements).for_each(|m| writer.put(&[table.trials(texture, m)]));
            }
            Cells::New(TextureStats::Gaussians(known)) => {
                known.iter().for_each(|k| writer.put(&[k.trials]));
            }
            Cells::New(TextureStats::Fused(known)) => {
                known.iter().for_each(|k| writer.put(&[k.slides]));
            }
        }
    }
}

#[inline]
fn put_gaussians(
    writer: &mut Writer<'_>,
    measured: PropertySet,
    known: &[Experience],
    texture: u16,
) -> Result<(), EncodeError> {
    for (experience, movement) in known.iter().zip(0..) {
        for (property, mean) in Property::ALL.into_iter().zip(experience.mean) {
            if !measured.contains(property) {
                writer.put(&[0; CELL_BYTES]);
                continue;
            }
            let step = libm::roundf(mean / mean_step(property));
            if !(f32::from(i16::MIN)..=f32::from(i16::MAX)).contains(&step) {
                let action = Action::of(movement, property);
                return Err(EncodeError::Range {
                    texture,
                    action,
                    mean,
                });
            }
            let sd = experience
                .gaussian(property)
                .map_or(0.0, |g| g.sd.max(SD_LEAST));
            writer.put(&(step as i16).to_le_bytes());
            // `as` saturates: trials that differ by more than 4 are no worse than that
            writer.put(&(libm::roundf(sd / SD_STEP) as u16).to_le_bytes());
        }
    }
    Ok(())
}

struct Head<M, W> {
    contents: Contents,
    movements: M,
    whitenings: W,
    lineage: u32,
}

fn write<'o, 'a, 'w>(
    out: &'o mut [u8],
    head: Head<impl ExactSizeIterator<Item = Movement>, impl Iterator<Item = &'w [u8]>>,
    rows: impl Iterator<Item = Row<'a>> + Clone,
    sections: impl FnOnce(&mut Writer<'_>) -> Result<(), EncodeError>,
) -> Result<Table<'o>, EncodeError> {
    let (count, movements) = (rows.clone().count(), head.movements.len());
    if count == 0 || !(1..=MAX_MOVEMENTS).contains(&movements) {
        return Err(EncodeError::Empty);
    }
    let Ok(count_field) = u16::try_from(count) else {
        let least = encoded_len(head.contents, count, movements, 0);
        return Err(EncodeError::NoSpace(least));
    };
    let mut writer = Writer { buffer: out, at: 0 };
    let [code, what, features] = head.contents.codes();
    writer.put(&MAGIC);
    writer.put(&VERSION.to_le_bytes());
    writer.put(&[code, what]);
    let length_at = writer.at;
    writer.put(&[0; 4]);
    writer.put(&count_field.to_le_bytes());
    writer.put(&[movements as u8, features]);
    for movement in head.movements {
        writer.put(&movement.force_mn().to_le_bytes());
        writer.put(&movement.speed_um_s().to_le_bytes());
    }
    head.whitenings.for_each(|bytes| writer.put(bytes));
    for (row, index) in rows.clone().zip(0..) {
        row.put_cells(&mut writer, head.contents, movements, index)?;
    }
    rows.clone().for_each(|row| row.put_trials(&mut writer));
    writer.put(&head.lineage.to_le_bytes());
    for row in rows.clone() {
        let Tally {
            factory,
            user,
            itself,
        } = row.tally;
        writer.put(&row.number.to_le_bytes());
        writer.put(&[factory, user, itself]);
    }
    for (row, index) in rows.zip(0..) {
        let length = u8::try_from(row.name.len()).ok();
        let length = length.filter(|length| usize::from(*length) <= MAX_NAME);
        writer.put(&[length.ok_or(EncodeError::Name(index))?]);
        writer.put(row.name.as_bytes());
    }
    sections(&mut writer)?;
    let length = writer.at + CRC_BYTES;
    let length_field = u32::try_from(length).map_err(|_| EncodeError::NoSpace(length))?;
    writer.put_at(length_at, &length_field.to_le_bytes());
    if length > writer.buffer.len() {
        return Err(EncodeError::NoSpace(length));
    }
    let written = writer.buffer.get(..writer.at).unwrap_or_default();
    writer.put(&CRC32.checksum(written).to_le_bytes());
    let (table, _) = out.split_at_checked(length).unwrap_or_default();
    Table::read(table).map_err(EncodeError::Invalid)
}

/// Fills a slice from its beginning, and counts what it has no space for.
pub(super) struct Writer<'o> {
    buffer: &'o mut [u8],
    at: usize,
}

impl Writer<'_> {
    pub(super) fn put(&mut self, bytes: &[u8]) {
        self.put_at(self.at, bytes);
        self.at += bytes.len();
    }

    fn put_at(&mut self, at: usize, bytes: &[u8]) {
        if let Some(buffer) = self.buffer.get_mut(at..at + bytes.len()) {
            // as long as these; `copy_from_slice` would ask again
            for (to, from) in buffer.iter_mut().zip(bytes) {
                *to = *from;
            }
        }
    }

    pub(super) fn put_numbers<'n>(&mut self, numbers: impl Iterator<Item = &'n i16>) {
        numbers.for_each(|number| self.put(&number.to_le_bytes()));
    }

    pub(super) fn put_floats(&mut self, floats: impl Iterator<Item = f32>) {
        floats.for_each(|float| self.put(&float.to_le_bytes()));
    }

    /// A section: kind, length, and what `contents` puts.
    pub(super) fn section(
        &mut self,
        kind: u16,
        contents: impl FnOnce(&mut Self),
    ) -> Result<(), EncodeError> {
        let at = self.at;
        self.put(&kind.to_le_bytes());
        self.put(&[0; 2]);
        contents(self);
        let length = self.at - at - HEAD;
        let length = u16::try_from(length).map_err(|_| EncodeError::NoSpace(length))?;
        self.put_at(at + 2, &length.to_le_bytes());
        Ok(())
    }
}
