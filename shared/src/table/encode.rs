//! Writing a table in its binary form.

use core::fmt;

use super::{
    Action, CELL_BYTES, CRC_BYTES, CRC32, Experience, Layout, MAGIC, MAX_MOVEMENTS,
    METHOD_GAUSSIAN, SD_LEAST, SD_STEP, Table, TableError, VERSION, mean_step,
};
use crate::features::{Property, PropertySet};
use crate::movement::Movement;

/// One texture of a table to be written.
#[derive(Clone, Copy, Debug)]
pub struct Texture<'a> {
    /// Its name, unlike every other, of 1 to 255 bytes.
    pub name: &'a str,
    /// What was learned, movement by movement.
    pub experience: &'a [Experience],
}

/// Why a table was not written.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum EncodeError {
    /// No texture, movement or property, or more movements than [`MAX_MOVEMENTS`].
    Empty,
    /// The table takes this many bytes, and there is less room.
    Room(usize),
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
    /// What was written does not read: a name is empty or there twice, or a movement is.
    Invalid(TableError),
}

impl fmt::Display for EncodeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Empty => write!(
                f,
                "a table needs a texture, a property and 1 to {MAX_MOVEMENTS} movements"
            ),
            Self::Room(needed) => {
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
            } => write!(
                f,
                "texture {}, movement {}: {} {mean} is beyond the table's +-{}",
                texture + 1,
                action.movement + 1,
                action.property,
                mean_step(action.property) * 32768.0
            ),
            Self::Invalid(why) => why.fmt(f),
        }
    }
}

impl core::error::Error for EncodeError {}

/// Bytes that a table takes, names and their lengths included in `names`.
pub const fn encoded_len(textures: usize, movements: usize, names: usize) -> usize {
    Layout::new(textures, movements).names + names + CRC_BYTES
}

/// Writes a table into `out` and reads it back.
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
    let textures = textures.map(|t| (t.name, t.experience.iter().copied()));
    write(out, measured, movements.iter().copied(), textures)
}

/// Writes `old` into `out` with what was learned of one texture, movement by movement: in place of what the table has, or
/// as one more texture behind the others. All else stays the same to the bit.
///
/// # Errors
/// As [`encode`].
pub fn amend<'o>(
    out: &'o mut [u8],
    old: &Table<'_>,
    texture: Texture<'_>,
) -> Result<Table<'o>, EncodeError> {
    let place = old.find(texture.name).unwrap_or(old.textures);
    let added = (place == old.textures).then_some(texture.name);
    let textures = old.names().chain(added).zip(0u16..).map(|(name, index)| {
        let learned = texture.experience.iter().enumerate();
        let experience = learned.map(move |(movement, new)| {
            if index == place {
                *new
            } else {
                old.experience(index, movement as u8)
            }
        });
        (name, experience)
    });
    write(out, old.measured, old.movements(), textures)
}

/// Writes names and experiences, movement by movement.
fn write<'o, 'a>(
    out: &'o mut [u8],
    measured: PropertySet,
    movements: impl ExactSizeIterator<Item = Movement>,
    textures: impl Iterator<Item = (&'a str, impl ExactSizeIterator<Item = Experience> + Clone)> + Clone,
) -> Result<Table<'o>, EncodeError> {
    let (count, names) = textures.clone().fold((0usize, 0), |(n, names), (name, _)| {
        (n + 1, names + 1 + name.len())
    });
    let length = encoded_len(count, movements.len(), names);
    let (Ok(count), Ok(length_field)) = (u16::try_from(count), u32::try_from(length)) else {
        return Err(EncodeError::Room(length));
    };
    if count == 0 || measured.is_empty() || !(1..=MAX_MOVEMENTS).contains(&movements.len()) {
        return Err(EncodeError::Empty);
    }
    let per_texture = movements.len();
    let mut writer = Writer {
        room: out.get_mut(..length).ok_or(EncodeError::Room(length))?,
        at: 0,
    };
    writer.put(&MAGIC);
    writer.put(&VERSION.to_le_bytes());
    writer.put(&[METHOD_GAUSSIAN, measured.bits()]);
    writer.put(&length_field.to_le_bytes());
    writer.put(&count.to_le_bytes());
    writer.put(&[movements.len() as u8, 0]);
    for movement in movements {
        writer.put(&movement.force_mn().to_le_bytes());
        writer.put(&movement.speed_um_s().to_le_bytes());
    }
    for ((_, experiences), index) in textures.clone().zip(0..) {
        if experiences.len() != per_texture {
            return Err(EncodeError::Movements(index));
        }
        for (experience, movement) in experiences.zip(0..) {
            for (property, mean) in Property::ALL.into_iter().zip(experience.mean) {
                if !measured.contains(property) {
                    writer.put(&[0; CELL_BYTES]);
                    continue;
                }
                let action = Action { movement, property };
                let range = EncodeError::Range {
                    texture: index,
                    action,
                    mean,
                };
                let step = libm::roundf(mean / mean_step(property));
                if !(f32::from(i16::MIN)..=f32::from(i16::MAX)).contains(&step) {
                    return Err(range);
                }
                let sd = experience
                    .gaussian(property)
                    .map_or(0.0, |g| g.sd.max(SD_LEAST));
                writer.put(&(step as i16).to_le_bytes());
                // `as` saturates: trials that differ by more than 4 are no worse than that
                writer.put(&(libm::roundf(sd / SD_STEP) as u16).to_le_bytes());
            }
        }
    }
    for experience in textures.clone().flat_map(|(_, experiences)| experiences) {
        writer.put(&[experience.trials]);
    }
    for ((name, _), index) in textures.zip(0..) {
        writer.put(&[u8::try_from(name.len()).map_err(|_| EncodeError::Name(index))?]);
        writer.put(name.as_bytes());
    }
    let crc = CRC32.checksum(writer.written());
    writer.put(&crc.to_le_bytes());
    Table::read(writer.room).map_err(EncodeError::Invalid)
}

/// Fills a slice from its beginning.
struct Writer<'o> {
    room: &'o mut [u8],
    at: usize,
}

impl Writer<'_> {
    fn put(&mut self, bytes: &[u8]) {
        if let Some(room) = self.room.get_mut(self.at..self.at + bytes.len()) {
            room.copy_from_slice(bytes);
        }
        self.at += bytes.len();
    }

    fn written(&self) -> &[u8] {
        self.room.get(..self.at).unwrap_or_default()
    }
}
