//! The texture table: what every known texture feels like at every movement, in fixed point.
//!
//! A [`Table`] borrows the binary form, from flash or a file, and copies nothing. There are two kinds of contents, for the
//! two ways of deciding: one Gaussian per (texture, movement, property), learned as [`Experience`] and written by
//! [`encode`]; or the mean of all features of a slide in whitened space, learned as [`Whitened`] and written by
//! [`encode_fused`]. [`amend`] teaches, renames and forgets textures of either kind.
//!
//! # Binary form, version 3, little-endian
//!
//! | bytes | what |
//! |---|---|
//! | 4 | magic `TACT` |
//! | 2 | version, 2 |
//! | 1 | contents, 0: Gaussians, 1: fused |
//! | 1 | Gaussians: properties measured, a bit each: 1 traction, 2 roughness, 4 fineness; fused: place in [`FeatureSet::ALL`] |
//! | 4 | length of the whole table in bytes |
//! | 2 | number of textures T |
//! | 1 | number of movements M |
//! | 1 | Gaussians: 0; fused: number of features d |
//! | 6 M | per movement: force in mN (2), speed in um/s (4) |
//! | M (3 d + 2 d d) | fused only, per movement a [`Whitening`]: d means of the features (i16, 1/1024), binary places of d rows (u8), the rows of W (i16) |
//! | 12 T M | Gaussians: per texture, movement and property: mean (i16, see [`mean_step`]), standard deviation (u16, [`SD_STEP`]); 0 and 0 for a property not measured |
//! | 2 d T M | fused: per texture and movement: mean of the d whitened features (i16, 1/256) |
//! | T M | per texture and movement: number of trials, 255 for more |
//! | 4 | CRC-32 of the table that this one was made from by teaching, the first of all; 0 for none |
//! | 5 T | per texture: a number that stays its own (2); slides that were learned from the factory, the user and itself (1 each, 255 for more) |
//! | | per texture: length of its name (1), the name in UTF-8 |
//! | 4 | CRC-32 (ISO-HDLC) of all before |

use core::fmt;

use crc::{CRC_32_ISO_HDLC, Crc};
use serde::{Deserialize, Serialize};

use crate::features::{Property, PropertySet};
use crate::fused::{FeatureSet, MAX_FEATURES, Vector, View, Whitened, Whitening};
use crate::movement::{Movement, MovementError};

mod encode;
mod experience;

pub use encode::{
    Change, EncodeError, Known, Texture, amend, encode, encode_fused, encoded_len, retell,
};
pub use experience::{Experience, Gaussian};

const MAGIC: [u8; 4] = *b"TACT";
/// Version of the binary form that this code reads and writes.
pub const VERSION: u16 = 3;
const GAUSSIANS: u8 = 0;
const FUSED: u8 = 1;
const HEADER: usize = 16;
const MOVEMENT_BYTES: usize = 6;
const PROPERTIES: usize = Property::ALL.len();
const CELL_BYTES: usize = 4;
const CRC_BYTES: usize = 4;
const CRC32: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// Most movements in a table: the whole grid of the pilot study.
pub const MAX_MOVEMENTS: usize = 36;
/// Most actions of a table.
pub const MAX_ACTIONS: usize = MAX_MOVEMENTS * PROPERTIES;

/// One step of a stored standard deviation, in the unit of its property; the largest is 4.
pub const SD_STEP: f32 = 1.0 / 16384.0;
/// Smallest standard deviation in a table, the coarsest step of a mean: a few trials that agree by chance by more than
/// the table can show would otherwise outweigh all others.
pub const SD_LEAST: f32 = 1.0 / 2048.0;

/// One step of a stored mean of `property`, in its unit: traction reaches +-8 N, roughness +-16, fineness +-8.
pub const fn mean_step(property: Property) -> f32 {
    match property {
        Property::Traction | Property::Fineness => 1.0 / 4096.0,
        Property::Roughness => 1.0 / 2048.0,
    }
}

/// What an exploration does next: makes one of the table's movements and looks at one property of it, or at all that the
/// slide says.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
pub struct Action {
    /// Index of the movement in the table.
    pub movement: u8,
    /// The property looked at; `None` for all that the slide says.
    pub property: Option<Property>,
}

impl Action {
    /// The property looked at, in words.
    pub const fn what(self) -> &'static str {
        match self.property {
            Some(property) => property.name(),
            None => "all",
        }
    }
}

/// What a table knows of a texture.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Contents {
    /// A Gaussian per (movement, property), of these properties.
    Gaussians(PropertySet),
    /// The whitened mean of this many features per movement.
    Fused(FeatureSet, u8),
}

/// From whom a texture was learned, in slides; 255 for more.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Tally {
    /// From whoever made the table.
    pub factory: u8,
    /// From the user, by teaching or by an answer.
    pub user: u8,
    /// From the probe's own certain verdicts.
    pub itself: u8,
}

/// Why bytes are no texture table.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum TableError {
    /// Fewer bytes than the table needs.
    Truncated {
        /// Bytes there are.
        got: usize,
        /// Bytes that are needed.
        wanted: usize,
    },
    /// It does not begin with `TACT`.
    Magic([u8; 4]),
    /// Written by another version.
    Version(u16),
    /// A way of deciding that this version does not know.
    Method(u8),
    /// The length in the header does not fit what it holds.
    Length {
        /// What the header says.
        header: usize,
        /// What the contents take.
        contents: usize,
    },
    /// The checksum differs: the bytes have changed since they were written.
    Crc {
        /// Stored checksum.
        stored: u32,
        /// Checksum of the bytes.
        computed: u32,
    },
    /// No texture, no movement or no property, too many movements or features, or a reserved byte that is not 0.
    Header,
    /// A movement that no rig makes.
    Movement(u8, MovementError),
    /// The same movement twice.
    TwinMovement(u8),
    /// A standard deviation of 0 where there are trials to have one.
    Deviation {
        /// Index of the texture.
        texture: u16,
        /// The action concerned.
        action: Action,
    },
    /// A whitening that cannot be one.
    Whitening(u8),
    /// A name that is empty, not UTF-8, or another texture's as well.
    Name(u16),
    /// A texture has the number of another one.
    Number(u16),
}

impl fmt::Display for TableError {
    #[inline]
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Truncated { got, wanted } => write!(f, "truncated: {got} bytes of {wanted}"),
            // by hand: printing lists for debugging takes the chip 1 KB
            Self::Magic([a, b, c, d]) => write!(
                f,
                "not a texture table: it begins with [{a:02x}, {b:02x}, {c:02x}, {d:02x}], not `TACT`"
            ),
            Self::Version(found) => {
                write!(
                    f,
                    "version {found}, and this program reads version {VERSION}: learn the table anew"
                )
            }
            Self::Method(found) => write!(f, "method {found} is unknown to this program"),
            Self::Length { header, contents } => {
                write!(
                    f,
                    "the header says {header} bytes, the contents take {contents}"
                )
            }
            Self::Crc { stored, computed } => {
                write!(
                    f,
                    "damaged: checksum {computed:08x}, and {stored:08x} was written"
                )
            }
            Self::Header => {
                f.write_str("the header counts no textures, movements or properties, or too many")
            }
            Self::Movement(index, why) => write!(f, "movement {}: {why}", index + 1),
            Self::TwinMovement(index) => write!(f, "movement {} is there twice", index + 1),
            Self::Deviation { texture, action } => write!(
                f,
                "texture {}, movement {}, {}: trials, but no standard deviation",
                texture + 1,
                action.movement + 1,
                action.what()
            ),
            Self::Whitening(index) => {
                write!(f, "the whitening of movement {} is damaged", index + 1)
            }
            Self::Number(texture) => {
                write!(f, "texture {} has another's number", texture + 1)
            }
            Self::Name(texture) => {
                write!(
                    f,
                    "the name of texture {} is empty, not UTF-8, or another's as well",
                    texture + 1
                )
            }
        }
    }
}

impl core::error::Error for TableError {}

/// What one action is expected to feel like, texture by texture.
#[derive(Clone, Copy, Debug)]
pub struct Gaussians<'t> {
    /// Each begins `stride` bytes after the one before.
    cells: &'t [u8],
    stride: usize,
    /// Each `movements` after the one before.
    trials: &'t [u8],
    movements: usize,
    /// Of the means.
    step: f32,
}

impl<'t> Gaussians<'t> {
    /// As [`Table::gaussian`].
    #[inline]
    pub fn get(&self, texture: usize) -> Option<Gaussian> {
        let trials = *self.trials.get(texture * self.movements)?;
        let cell = self.cells.get(texture * self.stride..)?;
        let &[m0, m1, s0, s1] = cell.first_chunk()?;
        (trials >= 2).then(|| Gaussian {
            mean: f32::from(i16::from_le_bytes([m0, m1])) * self.step,
            sd: f32::from(u16::from_le_bytes([s0, s1])) * SD_STEP,
        })
    }

    /// Mean (as i16) and standard deviation of each texture, in steps.
    pub fn cells(&self) -> impl Iterator<Item = [u16; 2]> + use<'t> {
        let cells = self.cells.chunks(self.stride.max(1));
        cells.map_while(|cell| {
            let &[m0, m1, s0, s1] = cell.first_chunk()?;
            Some([u16::from_le_bytes([m0, m1]), u16::from_le_bytes([s0, s1])])
        })
    }

    /// The bytes of the cells, the first at the beginning, and how far one is from the next.
    pub fn bytes(&self) -> (&'t [u8], usize) {
        (self.cells, self.stride)
    }

    /// One step of the means, in the unit of the property.
    pub fn step(&self) -> f32 {
        self.step
    }

    /// What makes steps of the means by steps of the standard deviation numbers whose square is half of that of standard
    /// deviations, in Q16.
    pub fn scale(&self) -> f32 {
        /// Square root of 2^16 / 2.
        const HALF_Q16: f32 = 181.019_34;
        self.step / SD_STEP * HALF_Q16
    }
}

/// What all textures are like at a movement, whitened.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Column<'t> {
    /// Means, the first at the beginning, numbers of 16 bits, little-endian; each begins `stride` bytes after the one before.
    pub(crate) means: &'t [u8],
    pub(crate) stride: usize,
    /// Slides that they were learned from, each `movements` after the one before.
    pub(crate) slides: &'t [u8],
    pub(crate) movements: usize,
}

impl<'t> Column<'t> {
    /// The bytes from the mean of a texture on.
    #[inline]
    pub(crate) fn mean(&self, texture: usize) -> &'t [u8] {
        self.means.get(texture * self.stride..).unwrap_or_default()
    }

    /// How many slides a texture was learned from.
    #[inline]
    pub(crate) fn slides(&self, texture: usize) -> u8 {
        self.slides
            .get(texture * self.movements)
            .copied()
            .unwrap_or(0)
    }
}

/// A checked texture table, borrowed from where it is stored.
#[derive(Clone, Copy, Debug)]
pub struct Table<'a> {
    bytes: &'a [u8],
    textures: u16,
    movements: u8,
    contents: Contents,
}

/// Bytes of a texture's number and tally.
const LABEL_BYTES: usize = 5;

/// Where the parts of a table begin.
struct Layout {
    whitenings: usize,
    cells: usize,
    trials: usize,
    lineage: usize,
    labels: usize,
    names: usize,
}

impl Contents {
    /// Bytes of a movement's whitening, and of a texture's cells at a movement.
    const fn sizes(self) -> (usize, usize) {
        match self {
            Self::Gaussians(_) => (0, PROPERTIES * CELL_BYTES),
            Self::Fused(_, features) => {
                (Whitening::bytes(features as usize), 2 * features as usize)
            }
        }
    }

    const fn layout(self, textures: usize, movements: usize) -> Layout {
        let (whitening, cell) = self.sizes();
        let whitenings = HEADER + movements * MOVEMENT_BYTES;
        let cells = whitenings + movements * whitening;
        let trials = cells + textures * movements * cell;
        let lineage = trials + textures * movements;
        let labels = lineage + 4;
        Layout {
            whitenings,
            cells,
            trials,
            lineage,
            labels,
            names: labels + textures * LABEL_BYTES,
        }
    }

    /// The three bytes of the header that say so.
    const fn codes(self) -> [u8; 3] {
        match self {
            Self::Gaussians(measured) => [GAUSSIANS, measured.bits(), 0],
            Self::Fused(set, features) => [FUSED, set as u8, features],
        }
    }

    fn from_codes([contents, what, features]: [u8; 3]) -> Result<Self, TableError> {
        match contents {
            GAUSSIANS => PropertySet::from_bits(what)
                .filter(|set| !set.is_empty() && features == 0)
                .map(Self::Gaussians),
            FUSED => FeatureSet::ALL
                .get(usize::from(what))
                .filter(|set| set.allows(features.into()))
                .map(|set| Self::Fused(*set, features)),
            other => return Err(TableError::Method(other)),
        }
        .ok_or(TableError::Header)
    }
}

fn array<const N: usize>(bytes: &[u8], at: usize) -> Option<[u8; N]> {
    bytes.get(at..)?.first_chunk().copied()
}

impl<'a> Table<'a> {
    /// Checks the table at the beginning of `bytes` and borrows it; what follows it is left alone.
    ///
    /// # Errors
    /// The first check that failed.
    #[inline]
    pub fn read(bytes: &'a [u8]) -> Result<Self, TableError> {
        let truncated = |wanted| TableError::Truncated {
            got: bytes.len(),
            wanted,
        };
        let header: &[u8; HEADER] = bytes.first_chunk().ok_or(truncated(HEADER))?;
        let [
            m0,
            m1,
            m2,
            m3,
            v0,
            v1,
            code,
            what,
            l0,
            l1,
            l2,
            l3,
            t0,
            t1,
            movements,
            features,
        ] = *header;
        if [m0, m1, m2, m3] != MAGIC {
            return Err(TableError::Magic([m0, m1, m2, m3]));
        }
        let version = u16::from_le_bytes([v0, v1]);
        if version != VERSION {
            return Err(TableError::Version(version));
        }
        let length = u32::from_le_bytes([l0, l1, l2, l3]) as usize;
        let bytes = bytes.get(..length).ok_or(truncated(length))?;
        let (body, stored) = bytes.split_last_chunk().ok_or(TableError::Length {
            header: length,
            contents: HEADER,
        })?;
        let (stored, computed) = (u32::from_le_bytes(*stored), CRC32.checksum(body));
        if stored != computed {
            return Err(TableError::Crc { stored, computed });
        }
        let contents = Contents::from_codes([code, what, features])?;
        let textures = u16::from_le_bytes([t0, t1]);
        if textures == 0 || movements == 0 || usize::from(movements) > MAX_MOVEMENTS {
            return Err(TableError::Header);
        }
        let table = Self {
            bytes,
            textures,
            movements,
            contents,
        };
        table.check()?;
        Ok(table)
    }

    #[inline]
    fn check(&self) -> Result<(), TableError> {
        let mut at = self.layout().names;
        let length = |end| TableError::Length {
            header: self.bytes.len(),
            contents: end + CRC_BYTES,
        };
        if at + CRC_BYTES > self.bytes.len() {
            return Err(length(at));
        }
        for index in 0..self.movements {
            let (force_mn, speed_um_s) = self.stored_movement(index).ok_or(length(at))?;
            let movement = Movement::new(force_mn, speed_um_s)
                .map_err(|why| TableError::Movement(index, why))?;
            if self.movements().take(index.into()).any(|m| m == movement) {
                return Err(TableError::TwinMovement(index));
            }
        }
        match self.contents {
            Contents::Gaussians(measured) => self.check_deviations(measured)?,
            Contents::Fused(..) => {
                let broken = (0..self.movements).find(|&m| self.whitening(m).is_none());
                broken.map_or(Ok(()), |m| Err(TableError::Whitening(m)))?;
            }
        }
        for texture in 0..self.textures {
            let number = self.number(texture);
            if (0..texture).any(|other| self.number(other) == number) {
                return Err(TableError::Number(texture));
            }
        }
        for texture in 0..self.textures {
            let (name, next) = self.name_at(at).map_err(length)?;
            at = next;
            let twin = || {
                self.names()
                    .take(texture.into())
                    .any(|other| other.as_bytes() == name)
            };
            if name.is_empty() || core::str::from_utf8(name).is_err() || twin() {
                return Err(TableError::Name(texture));
            }
        }
        if at + CRC_BYTES != self.bytes.len() {
            return Err(length(at));
        }
        Ok(())
    }

    #[inline]
    fn check_deviations(&self, measured: PropertySet) -> Result<(), TableError> {
        for texture in 0..self.textures {
            for movement in (0..self.movements).filter(|&m| self.trials(texture, m) >= 2) {
                for property in measured.iter() {
                    let cell = self.cell(texture, movement, property);
                    if cell.is_none_or(|(_, sd)| sd == 0) {
                        let property = Some(property);
                        let action = Action { movement, property };
                        return Err(TableError::Deviation { texture, action });
                    }
                }
            }
        }
        Ok(())
    }

    fn layout(&self) -> Layout {
        self.contents
            .layout(self.textures.into(), self.movements.into())
    }

    fn stored_movement(&self, index: u8) -> Option<(u16, u32)> {
        let at = HEADER + usize::from(index) * MOVEMENT_BYTES;
        Some((
            u16::from_le_bytes(array(self.bytes, at)?),
            u32::from_le_bytes(array(self.bytes, at + 2)?),
        ))
    }

    /// The bytes of a texture's cell at a movement.
    fn cell_bytes(&self, texture: u16, movement: u8) -> Option<&'a [u8]> {
        if texture >= self.textures || movement >= self.movements {
            return None;
        }
        let (_, cell) = self.contents.sizes();
        let index = usize::from(texture) * usize::from(self.movements) + usize::from(movement);
        self.bytes
            .get(self.layout().cells + index * cell..)?
            .get(..cell)
    }

    /// Stored mean and standard deviation of a property that was measured.
    fn cell(&self, texture: u16, movement: u8, property: Property) -> Option<(i16, u16)> {
        if !self.measured().contains(property) {
            return None;
        }
        let cells = self.cell_bytes(texture, movement)?;
        let [m0, m1, s0, s1] = array(cells, property.index() * CELL_BYTES)?;
        Some((i16::from_le_bytes([m0, m1]), u16::from_le_bytes([s0, s1])))
    }

    /// The bytes of the name at `at`, and where the next one begins; the checksum is no name.
    ///
    /// # Errors
    /// Where the name would end, were it there.
    fn name_at(&self, at: usize) -> Result<(&'a [u8], usize), usize> {
        let (body, _) = self.bytes.split_last_chunk::<CRC_BYTES>().ok_or(at)?;
        let end = at + 1 + usize::from(*body.get(at).ok_or(at + 1)?);
        Ok((body.get(at + 1..end).ok_or(end)?, end))
    }

    /// Number of textures.
    pub fn textures(&self) -> u16 {
        self.textures
    }

    /// What the table knows of a texture.
    pub fn contents(&self) -> Contents {
        self.contents
    }

    /// The properties that there are Gaussians of.
    pub fn measured(&self) -> PropertySet {
        match self.contents {
            Contents::Gaussians(measured) => measured,
            Contents::Fused(..) => PropertySet::default(),
        }
    }

    /// The movements, in the order of [`Action::movement`].
    pub fn movements(&self) -> impl ExactSizeIterator<Item = Movement> + use<'_, 'a> {
        (0..self.movements).map(|index| {
            self.movement(index).unwrap_or(Movement::FOR_ROUGHNESS) // `read` has checked them all
        })
    }

    /// The movement with this index.
    pub fn movement(&self, index: u8) -> Option<Movement> {
        let (force_mn, speed_um_s) = self
            .stored_movement(index)
            .filter(|_| index < self.movements)?;
        Movement::new(force_mn, speed_um_s).ok()
    }

    /// All (movement, property) pairs that there are Gaussians of, movement by movement, properties in the order of
    /// [`Property::ALL`].
    pub fn actions(&self) -> impl Iterator<Item = Action> + use<> {
        let measured = self.measured();
        (0..self.movements).flat_map(move |movement| {
            measured.iter().map(move |property| Action {
                movement,
                property: Some(property),
            })
        })
    }

    /// The names, in the order of the textures' indices.
    pub fn names(&self) -> impl Iterator<Item = &'a str> + Clone + use<'a> {
        let table = *self;
        let mut at = self.layout().names;
        (0..self.textures).map_while(move |_| {
            let (name, next) = table.name_at(at).ok()?;
            at = next;
            core::str::from_utf8(name).ok()
        })
    }

    /// The name of a texture.
    pub fn name(&self, texture: u16) -> Option<&'a str> {
        self.names().nth(texture.into())
    }

    /// The texture with this name.
    pub fn find(&self, name: &str) -> Option<u16> {
        self.names()
            .zip(0..)
            .find_map(|(other, texture)| (other == name).then_some(texture))
    }

    /// Number of trials that a texture was learned from at a movement, 255 for more.
    pub fn trials(&self, texture: u16, movement: u8) -> u8 {
        if texture >= self.textures || movement >= self.movements {
            return 0;
        }
        let at = self.layout().trials
            + usize::from(texture) * usize::from(self.movements)
            + usize::from(movement);
        self.bytes.get(at).copied().unwrap_or(0)
    }

    /// What a property of a texture is expected to be; `None` where fewer than two trials were made, for a property that
    /// was not measured, and outside the table.
    pub fn gaussian(&self, texture: u16, action: Action) -> Option<Gaussian> {
        if self.trials(texture, action.movement) < 2 {
            return None;
        }
        let property = action.property?;
        let (mean, sd) = self.cell(texture, action.movement, property)?;
        Some(Gaussian {
            mean: f32::from(mean) * mean_step(property),
            sd: f32::from(sd) * SD_STEP,
        })
    }

    /// [`Table::gaussian`] of every texture, for those who ask for many.
    pub fn gaussians(&self, action: Action) -> Gaussians<'a> {
        let movement = usize::from(action.movement);
        let measured = action.property.filter(|p| self.measured().contains(*p));
        let measured = measured.filter(|_| action.movement < self.movements);
        let (_, cell) = self.contents.sizes();
        let layout = self.layout();
        let cells = measured.and_then(|property| {
            let at = layout.cells + movement * cell + property.index() * CELL_BYTES;
            self.bytes.get(at..layout.trials)
        });
        let (trials, movements) = self.trials_at(action.movement);
        Gaussians {
            cells: cells.unwrap_or_default(),
            trials,
            movements,
            stride: cell * movements,
            step: measured.map_or(0.0, mean_step),
        }
    }

    /// [`Table::trials`] of every texture, the first at the beginning, and how far one is from the next; none outside the
    /// table.
    fn trials_at(&self, movement: u8) -> (&'a [u8], usize) {
        let layout = self.layout();
        let at = layout.trials + usize::from(movement);
        let trials = self.bytes.get(at..layout.lineage);
        let trials = trials.filter(|_| movement < self.movements);
        (trials.unwrap_or_default(), self.movements.into())
    }

    /// The whitened means at a movement; none in a table of Gaussians and outside the table.
    pub(crate) fn column(&self, movement: u8) -> Column<'a> {
        let (_, cell) = self.contents.sizes();
        let at = self.layout().cells + usize::from(movement) * cell;
        let means = match self.contents {
            Contents::Fused(..) if movement < self.movements => {
                self.bytes.get(at..self.layout().trials)
            }
            _ => None,
        };
        let (slides, movements) = self.trials_at(movement);
        Column {
            means: means.unwrap_or_default(),
            stride: cell * movements,
            slides,
            movements,
        }
    }

    /// What was learned of a texture at a movement, to go on from; what is in the table is rounded.
    pub fn experience(&self, texture: u16, movement: u8) -> Experience {
        let trials = self.trials(texture, movement);
        if trials == 0 {
            return Experience::default();
        }
        let mut experience = Experience {
            trials,
            ..Experience::default()
        };
        for (property, (mean, squares)) in Property::ALL
            .into_iter()
            .zip(experience.mean.iter_mut().zip(&mut experience.squares))
        {
            let (m, sd) = self.cell(texture, movement, property).unwrap_or_default();
            let sd = f32::from(sd) * SD_STEP;
            *mean = f32::from(m) * mean_step(property);
            *squares = sd * sd * f32::from(trials - 1);
        }
        experience
    }

    /// How features are whitened at a movement; `None` in a table of Gaussians and outside the table.
    pub fn whitening(&self, movement: u8) -> Option<Whitening> {
        let (bytes, features) = self.whitening_bytes(movement)?;
        Whitening::read(bytes, features)
    }

    /// The bytes of the whitening at a movement, and of how many features it is.
    fn whitening_bytes(&self, movement: u8) -> Option<(&'a [u8], usize)> {
        let Contents::Fused(_, features) = self.contents else {
            return None;
        };
        if movement >= self.movements {
            return None;
        }
        let length = Whitening::bytes(features.into());
        let at = self.layout().whitenings + usize::from(movement) * length;
        Some((self.bytes.get(at..)?.get(..length)?, features.into()))
    }

    /// The whitened mean of a texture at a movement, in steps of 1/256 standard deviation; none in a table of Gaussians and
    /// outside the table.
    pub fn white_mean(
        &self,
        texture: u16,
        movement: u8,
    ) -> impl ExactSizeIterator<Item = i16> + Clone + use<'a> {
        let cells = match self.contents {
            Contents::Fused(..) => self.cell_bytes(texture, movement).unwrap_or_default(),
            Contents::Gaussians(_) => &[],
        };
        cells.chunks_exact(2).map(|pair| match pair {
            &[low, high] => i16::from_le_bytes([low, high]),
            _ => 0,
        })
    }

    /// What was learned of a texture at a movement in a fused table, to go on from.
    pub fn whitened(&self, texture: u16, movement: u8) -> Whitened {
        let mut whitened = Whitened {
            slides: self.trials(texture, movement),
            mean: [0; MAX_FEATURES],
        };
        for (mean, stored) in whitened
            .mean
            .iter_mut()
            .zip(self.white_mean(texture, movement))
        {
            *mean = stored;
        }
        whitened
    }

    /// Whitens features at a movement; `None` as [`Table::whitening`].
    pub fn whiten(&self, movement: u8, features: &[i16]) -> Option<Vector> {
        let (bytes, known) = self.whitening_bytes(movement)?;
        Some(View::checked(bytes, known).apply(features))
    }

    fn label(&self, texture: u16) -> [u8; LABEL_BYTES] {
        let at = self.layout().labels + usize::from(texture) * LABEL_BYTES;
        let label = (texture < self.textures).then(|| array(self.bytes, at));
        label.flatten().unwrap_or_default()
    }

    /// A texture's number, which stays its own when others are forgotten or it is renamed.
    pub fn number(&self, texture: u16) -> u16 {
        let [low, high, ..] = self.label(texture);
        u16::from_le_bytes([low, high])
    }

    /// The number that one more texture gets.
    pub fn next_number(&self) -> u16 {
        let numbers = (0..self.textures).map(|texture| self.number(texture));
        numbers.max().map_or(0, |most| most.wrapping_add(1))
    }

    /// The texture with this number.
    pub fn numbered(&self, number: u16) -> Option<u16> {
        (0..self.textures).find(|&texture| self.number(texture) == number)
    }

    /// From whom a texture was learned.
    pub fn tally(&self, texture: u16) -> Tally {
        let [_, _, factory, user, itself] = self.label(texture);
        Tally {
            factory,
            user,
            itself,
        }
    }

    /// The checksum of the table that was in the beginning, before anything was taught: its own, if nothing was.
    pub fn lineage(&self) -> u32 {
        let stored = array(self.bytes, self.layout().lineage).map_or(0, u32::from_le_bytes);
        if stored == 0 { self.crc() } else { stored }
    }

    /// The checksum, which also tells one table from another.
    pub fn crc(&self) -> u32 {
        self.bytes
            .split_last_chunk()
            .map_or(0, |(_, crc)| u32::from_le_bytes(*crc))
    }

    /// The table as stored.
    pub fn as_bytes(&self) -> &'a [u8] {
        self.bytes
    }
}

#[cfg(test)]
pub(crate) mod tests;
