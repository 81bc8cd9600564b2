//! The binary form of a table (see [`crate::table`]): its sizes, its contents, and what can be wrong with it.

use core::fmt;

use heapless::String;
use serde::{Deserialize, Serialize};

use super::whitening::Whitening;
use crate::features::{FeatureSet, MovementError, Property, PropertySet};
use crate::sensor::FingerCode;

pub(super) const MAGIC: [u8; 4] = *b"TACT";
/// Version of the binary form.
pub const VERSION: u16 = 1;
/// The kind of the section that has them.
pub(super) const SLOPES: u16 = 4;
/// Bytes of a section's kind and length.
pub(super) const HEAD: usize = 4;
/// The kind of the section of drift, and bytes of its two numbers.
pub(super) const DRIFT: u16 = 1;
pub(super) const TWO: usize = 8;
/// Bytes of a length of shorter slides in its section.
pub(super) const MS: usize = 2;
/// The kind of the sections that say it, one for each length.
pub(super) const LENGTH: u16 = 6;
pub(super) const GAUSSIANS: u8 = 0;
pub(super) const FUSED: u8 = 1;
pub(super) const HEADER: usize = 16;
pub(super) const MOVEMENT_BYTES: usize = 6;
pub(super) const PROPERTIES: usize = Property::ALL.len();
pub(super) const CELL_BYTES: usize = 4;
pub(super) const CRC_BYTES: usize = 4;

/// Most movements in a table: the whole grid of the pilot study.
pub const MAX_MOVEMENTS: usize = 36;
/// Most actions of a table.
pub const MAX_ACTIONS: usize = MAX_MOVEMENTS * PROPERTIES;
/// Most textures of a probe's table.
pub const MAX_TEXTURES: usize = 128;

/// Name of a texture.
pub type Name = String<40>;

/// The next action of an exploration: one of the table's movements, and the property to look at, or all features of the
/// slide.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
pub struct Action {
    /// Index of the movement in the table.
    pub movement: u8,
    /// The property looked at; `None` for all that the slide says.
    pub property: Option<Property>,
}

impl Action {
    /// Looks at one property of a movement.
    pub const fn of(movement: u8, property: Property) -> Self {
        Self {
            movement,
            property: Some(property),
        }
    }

    /// The property looked at, in words.
    pub const fn what(self) -> &'static str {
        match self.property {
            Some(property) => property.name(),
            None => "all",
        }
    }
}

/// The kind of data that a table holds of a texture.
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
    /// From the user, by training or by a label.
    pub user: u8,
    /// From the probe's own certain verdicts.
    pub itself: u8,
}

/// The reasons why bytes are not a valid texture table.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
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
        /// The length in the header.
        header: usize,
        /// The length of the contents.
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
    /// The bytes after the names are not valid sections.
    Sections,
    /// A section of this kind is damaged, there twice, or not for such a table.
    Section(u16),
    /// It was learned with another finger than the probe has.
    Finger {
        /// The table's.
        table: FingerCode,
        /// The probe's.
        probe: FingerCode,
    },
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
            Self::Version(found) => write!(
                f,
                "version {found}, and this program reads version {VERSION}: learn the table anew, or use the program \
                 that wrote it"
            ),
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
            Self::Sections => f.write_str("what follows the names is damaged"),
            Self::Finger { table, probe } => write!(
                f,
                "learned with the finger {table}, but the finger here is {probe}: their slides cannot be compared. Use a table that was learned with {probe}"
            ),
            Self::Section(1) => f.write_str("the drift that it expects is damaged"),
            Self::Section(2) => f.write_str("its limits of new and changed textures are damaged"),
            Self::Section(4) => f.write_str("its slopes over speed are damaged"),
            Self::Section(6) => f.write_str("what it says of shorter slides is damaged"),
            Self::Section(kind) => write!(f, "section {kind} is damaged"),
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

/// Bytes of a texture's number and tally.
pub(super) const LABEL_BYTES: usize = 5;

/// The offsets of the parts of a table.
pub(super) struct Layout {
    pub(super) whitenings: usize,
    pub(super) cells: usize,
    pub(super) trials: usize,
    pub(super) lineage: usize,
    pub(super) labels: usize,
    pub(super) names: usize,
}

impl Contents {
    /// Bytes of a movement's whitening, and of a texture's cells at a movement.
    pub(super) const fn sizes(self) -> (usize, usize) {
        match self {
            Self::Gaussians(_) => (0, PROPERTIES * CELL_BYTES),
            Self::Fused(_, features) => {
                (Whitening::bytes(features as usize), 2 * features as usize)
            }
        }
    }

    pub(super) const fn layout(self, textures: usize, movements: usize) -> Layout {
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
    pub(super) const fn codes(self) -> [u8; 3] {
        match self {
            Self::Gaussians(measured) => [GAUSSIANS, measured.bits(), 0],
            Self::Fused(set, features) => [FUSED, set as u8, features],
        }
    }

    pub(super) fn from_codes([contents, what, features]: [u8; 3]) -> Result<Self, TableError> {
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

pub(super) fn array<const N: usize>(bytes: &[u8], at: usize) -> Option<[u8; N]> {
    bytes.get(at..)?.first_chunk().copied()
}

/// Kinds and contents of sections; `None` for the rest where it is no section.
pub(super) fn each(bytes: &[u8]) -> impl Iterator<Item = Option<(u16, &[u8])>> + Clone {
    let mut rest = bytes;
    core::iter::from_fn(move || {
        if rest.is_empty() {
            return None;
        }
        let section = rest.split_first_chunk::<HEAD>().and_then(|(head, after)| {
            let [k0, k1, l0, l1] = *head;
            let (contents, after) = after.split_at_checked(u16::from_le_bytes([l0, l1]).into())?;
            rest = after;
            Some((u16::from_le_bytes([k0, k1]), contents))
        });
        if section.is_none() {
            rest = &[];
        }
        Some(section)
    })
}
