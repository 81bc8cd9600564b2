//! Writing a table in its binary form.

use core::fmt;

use serde::{Deserialize, Serialize};

use super::format::{
    Action, CELL_BYTES, CRC_BYTES, Contents, LENGTH, MAGIC, MAX_MOVEMENTS, SLOPES, TableError,
    Tally, VERSION,
};
use super::gaussian::{SD_LEAST, SD_STEP, mean_step};
use super::sections::Sections;
use super::slopes::{self, put_slope};
use super::training_stats::{Experience, Whitened};
use super::view::Table;
use super::whitening::Whitening;
use crate::CRC32;
use crate::features::{FeatureSet, Movement, Property, PropertySet};

/// One texture of a table of Gaussians to be written.
#[derive(Clone, Copy, Debug)]
pub struct Texture<'a> {
    /// Its name, unlike every other, of 1 to 255 bytes.
    pub name: &'a str,
    /// The training statistics, movement by movement.
    pub experience: &'a [Experience],
}

/// The training statistics of a texture, movement by movement, as its table keeps them.
#[derive(Clone, Copy, Debug)]
pub enum Known<'a> {
    /// For a table of Gaussians.
    Gaussians(&'a [Experience]),
    /// For a fused table.
    Fused(&'a [Whitened]),
}

/// A change of a table.
#[derive(Clone, Copy, Debug)]
pub enum Change<'a> {
    /// Puts a texture in: it replaces the one of that name, or is added.
    Put {
        /// Its name.
        name: &'a str,
        /// Its training statistics.
        known: Known<'a>,
        /// From whom.
        tally: Tally,
    },
    /// Another name.
    Rename {
        /// Index of the texture.
        texture: u16,
        /// Its new name.
        name: &'a str,
    },
    /// A texture less.
    Forget(u16),
}

/// The reasons why a table was not written.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub enum EncodeError {
    /// No texture, movement or property, or more movements than [`MAX_MOVEMENTS`].
    Empty,
    /// The statistics are of another kind than the table, or of other features.
    Contents,
    /// There is no texture with this index.
    Texture(u16),
    /// The table takes this many bytes, and the buffer is smaller.
    NoSpace(usize),
    /// A texture has not as many experiences as there are movements.
    Movements(u16),
    /// A name is longer than 255 bytes.
    Name(u16),
    /// A mean that the fixed point cannot hold.
    Range {
        /// Index of the texture.
        texture: u16,
        /// The action concerned.
        action: Action,
        /// The mean.
        mean: f32,
    },
    /// The written table is invalid: a name is empty or there twice, or a movement is.
    Invalid(TableError),
}

impl fmt::Display for EncodeError {
    #[inline]
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Empty => write!(
                f,
                "a table needs a texture, a property and 1 to {MAX_MOVEMENTS} movements"
            ),
            Self::Contents => f.write_str("what was learned does not fit this kind of table"),
            Self::Texture(texture) => write!(f, "the table has no texture {}", texture + 1),
            Self::NoSpace(needed) => {
                write!(f, "the table takes {needed} bytes, and there is less room")
            }
            Self::Movements(texture) => write!(
                f,
                "texture {} was not learned at every movement",
                texture + 1
            ),
            Self::Name(texture) => write!(
                f,
                "the name of texture {} is longer than 255 bytes",
                texture + 1
            ),
            Self::Range {
                texture,
                action,
                mean,
            } => {
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
            Self::Invalid(why) => why.fmt(f),
        }
    }
}

impl core::error::Error for EncodeError {}

/// Bytes that a table without sections takes, names and their lengths included in `names`.
pub const fn encoded_len(
    contents: Contents,
    textures: usize,
    movements: usize,
    names: usize,
) -> usize {
    contents.layout(textures, movements).names + names + CRC_BYTES
}

/// Writes a table of Gaussians into `out` and reads it back.
///
/// Means are rounded to [`mean_step`], standard deviations to [`SD_STEP`] and kept between [`SD_LEAST`] and 4.
///
/// # Errors
/// Parts of `out` may have been written then.
pub fn encode<'o, 'a>(
    out: &'o mut [u8],
    measured: PropertySet,
    movements: &[Movement],
    textures: impl Iterator<Item = Texture<'a>> + Clone,
) -> Result<Table<'o>, EncodeError> {
    if measured.is_empty() {
        return Err(EncodeError::Empty);
    }
    let rows = textures.zip(0..=u16::MAX).map(|(texture, number)| {
        let slides = texture.experience.iter().map(Experience::trials);
        let known = Known::Gaussians(texture.experience);
        Row::new(texture.name, number, known, slides)
    });
    let contents = Contents::Gaussians(measured);
    let movements = movements.iter().copied();
    write(out, contents, movements, |_| (), 0, rows, (0, |_| ()))
}

/// Writes a fused table into `out` and reads it back: every movement with its whitening, every texture with its name
/// and what was learned of it, movement by movement.
///
/// # Errors
/// Parts of `out` may have been written then.
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
    let rows = textures
        .zip(0..=u16::MAX)
        .map(|((name, whitened), number)| {
            let slides = whitened.iter().map(|w| w.slides);
            Row::new(name, number, Known::Fused(whitened), slides)
        });
    let whitenings = |writer: &mut Writer<'_>| {
        for (_, whitening) in movements {
            writer.put(whitening.as_bytes());
        }
    };
    let contents = Contents::Fused(set, features as u8);
    let moved = movements.iter().map(|(movement, _)| *movement);
    write(out, contents, moved, whitenings, 0, rows, (0, |_| ()))
}

/// Writes `old`, a fused table, into `out` with these sections instead of its own.
///
/// # Errors
/// As [`encode`].
pub fn with_sections<'o>(
    out: &'o mut [u8],
    old: &Table<'_>,
    sections: &Sections<'_>,
) -> Result<Table<'o>, EncodeError> {
    let Contents::Fused(_, features) = old.contents else {
        return Err(EncodeError::Contents);
    };
    let features = usize::from(features);
    let length = sections.length(features);
    rewrite_with(out, old, 0, length, |put| sections.write(features, put))
}

/// Writes `old` with other sections, which take so many bytes.
pub(super) fn rewrite_with<'o>(
    out: &'o mut [u8],
    old: &Table<'_>,
    lineage: u32,
    of_sections: usize,
    sections: impl FnOnce(&mut dyn FnMut(&[u8])),
) -> Result<Table<'o>, EncodeError> {
    let rows = old.names().zip(0..);
    let rows = rows.map(|(name, texture)| Row::old(old, texture, name));
    let write = |writer: &mut Writer<'_>| sections(&mut |bytes| writer.put(bytes));
    rewrite(out, old, lineage, rows, (of_sections, write))
}

/// Writes these rows with all else as `old` has it.
fn rewrite<'o, 'a>(
    out: &'o mut [u8],
    old: &Table<'_>,
    lineage: u32,
    rows: impl Iterator<Item = Row<'a>> + Clone,
    sections: (usize, impl FnOnce(&mut Writer<'_>)),
) -> Result<Table<'o>, EncodeError> {
    let layout = old.layout();
    let whitenings = old.bytes.get(layout.whitenings..layout.cells);
    write(
        out,
        old.contents,
        old.movements(),
        |writer| writer.put(whitenings.unwrap_or_default()),
        lineage,
        rows,
        sections,
    )
}

/// Writes `old` into `out` with one change. All other textures stay the same to the bit; what a table knows of shorter
/// slides is left out, unless a texture gets another name: every one that is there must be known of them.
///
/// # Errors
/// As [`encode`], and [`EncodeError::Texture`].
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
    let kept = old.names().zip(0..).filter_map(|(name, texture)| {
        let row = Row::old(old, texture, name);
        match change {
            Change::Forget(gone) if gone == texture => None,
            Change::Rename { texture: it, name } if it == texture => Some(Row { name, ..row }),
            Change::Put { known, tally, .. } if replaced == Some(texture) => Some(Row {
                tally,
                cells: Cells::New(known),
                ..row
            }),
            _ => Some(row),
        }
    });
    let rows = kept.chain(added);
    if old.is_paced() {
        return rewrite_paced(out, old, rows);
    }
    // what shorter slides say is of these textures and no others
    let same = matches!(change, Change::Rename { .. });
    let left_out = if same { 0 } else { LENGTH };
    let others = || old.other_sections(left_out);
    let of_others = others().map(|(head, contents)| head.len() + contents.len());
    let of_others = of_others.sum();
    let write = |writer: &mut Writer<'_>| {
        for (head, contents) in others() {
            writer.put(&head);
            writer.put(contents);
        }
    };
    rewrite(out, old, old.lineage(), rows, (of_others, write))
}

/// As [`rewrite`], of a table that knows speeds: every row with its slopes, those of all textures for a new one.
fn rewrite_paced<'o, 'a>(
    out: &'o mut [u8],
    old: &Table<'_>,
    rows: impl Iterator<Item = Row<'a>> + Clone,
) -> Result<Table<'o>, EncodeError> {
    let (features, movements) = (old.features(), old.movements);
    let length = slopes::length(features, rows.clone().count(), movements.into());
    let Ok(length_field) = u16::try_from(length) else {
        return Err(EncodeError::NoSpace(length));
    };
    let others = || old.other_sections(SLOPES);
    let of_others = others().map(|(head, contents)| head.len() + contents.len());
    let of_sections = of_others.sum::<usize>() + 4 + length;
    let of_rows = rows.clone();
    let write = |writer: &mut Writer<'_>| {
        for (head, contents) in others() {
            writer.put(&head);
            writer.put(contents);
        }
        writer.put(&SLOPES.to_le_bytes());
        writer.put(&length_field.to_le_bytes());
        writer.put(old.paces_bytes());
        for row in of_rows {
            for movement in 0..movements {
                let slope = old.slope(row.slope_of, movement);
                put_slope(&slope, features, |bytes| writer.put(bytes));
            }
        }
    };
    rewrite(out, old, old.lineage(), rows, (of_sections, write))
}

/// The source of the cells of a texture.
#[derive(Clone, Copy)]
enum Cells<'a> {
    Old(Table<'a>, u16),
    New(Known<'a>),
}

/// One texture, as it is written.
#[derive(Clone, Copy)]
struct Row<'a> {
    name: &'a str,
    number: u16,
    tally: Tally,
    cells: Cells<'a>,
    /// The texture of the old table whose slopes it has.
    slope_of: Option<u16>,
}

impl<'a> Row<'a> {
    /// As a table has it.
    fn old(table: &Table<'a>, texture: u16, name: &'a str) -> Self {
        Self {
            name,
            number: table.number(texture),
            tally: table.tally(texture),
            cells: Cells::Old(*table, texture),
            slope_of: Some(texture),
        }
    }

    /// Of a table that is made.
    fn new(name: &'a str, number: u16, known: Known<'a>, slides: impl Iterator<Item = u8>) -> Self {
        Self {
            name,
            number,
            tally: Tally {
                factory: slides.fold(0, u8::saturating_add),
                ..Tally::default()
            },
            cells: Cells::New(known),
            slope_of: None,
        }
    }

    /// Returns whether it has statistics at every movement.
    fn fits(&self, contents: Contents, movements: usize) -> Result<bool, EncodeError> {
        match (self.cells, contents) {
            (Cells::Old(..), _) => Ok(true),
            (Cells::New(Known::Gaussians(known)), Contents::Gaussians(_)) => {
                Ok(known.len() == movements)
            }
            (Cells::New(Known::Fused(known)), Contents::Fused(..)) => Ok(known.len() == movements),
            _ => Err(EncodeError::Contents),
        }
    }

    fn put_cells(
        &self,
        writer: &mut Writer<'_>,
        contents: Contents,
        index: u16,
    ) -> Result<(), EncodeError> {
        match (self.cells, contents) {
            (Cells::Old(table, texture), _) => {
                for movement in 0..table.movements {
                    writer.put(table.cell_bytes(texture, movement).unwrap_or_default());
                }
                Ok(())
            }
            (Cells::New(Known::Gaussians(known)), Contents::Gaussians(measured)) => {
                put_gaussians(writer, measured, known, index)
            }
            (Cells::New(Known::Fused(known)), Contents::Fused(_, features)) => {
                for mean in known
                    .iter()
                    .flat_map(|k| k.mean.iter().take(features.into()))
                {
                    writer.put(&mean.to_le_bytes());
                }
                Ok(())
            }
            _ => Err(EncodeError::Contents),
        }
    }

    fn put_trials(&self, writer: &mut Writer<'_>) {
        match self.cells {
            Cells::Old(table, texture) => {
                (0..table.movements).for_each(|m| writer.put(&[table.trials(texture, m)]));
            }
            Cells::New(Known::Gaussians(known)) => {
                known.iter().for_each(|k| writer.put(&[k.trials]));
            }
            Cells::New(Known::Fused(known)) => known.iter().for_each(|k| writer.put(&[k.slides])),
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

/// Writes all parts, and reads the table back.
fn write<'o, 'a>(
    out: &'o mut [u8],
    contents: Contents,
    movements: impl ExactSizeIterator<Item = Movement>,
    whitenings: impl FnOnce(&mut Writer<'_>),
    lineage: u32,
    rows: impl Iterator<Item = Row<'a>> + Clone,
    (of_sections, sections): (usize, impl FnOnce(&mut Writer<'_>)),
) -> Result<Table<'o>, EncodeError> {
    let (count, names) = rows.clone().fold((0usize, 0), |(n, names), row| {
        (n + 1, names + 1 + row.name.len())
    });
    let length = encoded_len(contents, count, movements.len(), names) + of_sections;
    let (Ok(count), Ok(length_field)) = (u16::try_from(count), u32::try_from(length)) else {
        return Err(EncodeError::NoSpace(length));
    };
    if count == 0 || !(1..=MAX_MOVEMENTS).contains(&movements.len()) {
        return Err(EncodeError::Empty);
    }
    let per_texture = movements.len();
    let mut writer = Writer {
        buffer: out.get_mut(..length).ok_or(EncodeError::NoSpace(length))?,
        at: 0,
    };
    let [code, what, features] = contents.codes();
    writer.put(&MAGIC);
    writer.put(&VERSION.to_le_bytes());
    writer.put(&[code, what]);
    writer.put(&length_field.to_le_bytes());
    writer.put(&count.to_le_bytes());
    writer.put(&[per_texture as u8, features]);
    for movement in movements {
        writer.put(&movement.force_mn().to_le_bytes());
        writer.put(&movement.speed_um_s().to_le_bytes());
    }
    whitenings(&mut writer);
    for (row, index) in rows.clone().zip(0..) {
        if !row.fits(contents, per_texture)? {
            return Err(EncodeError::Movements(index));
        }
        row.put_cells(&mut writer, contents, index)?;
    }
    for row in rows.clone() {
        row.put_trials(&mut writer);
    }
    writer.put(&lineage.to_le_bytes());
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
        writer.put(&[u8::try_from(row.name.len()).map_err(|_| EncodeError::Name(index))?]);
        writer.put(row.name.as_bytes());
    }
    sections(&mut writer);
    let crc = CRC32.checksum(writer.written());
    writer.put(&crc.to_le_bytes());
    Table::read(writer.buffer).map_err(EncodeError::Invalid)
}

/// Fills a slice from its beginning.
struct Writer<'o> {
    buffer: &'o mut [u8],
    at: usize,
}

impl Writer<'_> {
    fn put(&mut self, bytes: &[u8]) {
        if let Some(buffer) = self.buffer.get_mut(self.at..self.at + bytes.len()) {
            // as long as these; `copy_from_slice` would ask again
            for (to, from) in buffer.iter_mut().zip(bytes) {
                *to = *from;
            }
        }
        self.at += bytes.len();
    }

    fn written(&self) -> &[u8] {
        self.buffer.get(..self.at).unwrap_or_default()
    }
}
