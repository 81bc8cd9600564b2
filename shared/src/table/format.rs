//! The binary form of a table (see [`crate::table`]): its sizes, its contents, and what can be wrong with it.

use core::fmt;

use serde::{Deserialize, Serialize};

use super::name::NameError;
use super::whitening::Whitening;
use crate::features::{FeatureSet, MovementError, Property, PropertySet};
use crate::sensor::FingerCode;

pub(super) const MAGIC: [u8; 4] = *b"TACT";
/// Version of the binary form.
pub const VERSION: u16 = 1;
pub(super) const SLOPES: u16 = 4;
pub(super) const HEAD: usize = 4;
pub(super) const DRIFT: u16 = 1;
pub(super) const TWO: usize = 8;
pub(super) const MS: usize = 2;
pub(super) const LENGTH: u16 = 6;
pub(super) const GAUSSIANS: u8 = 0;
pub(super) const FUSED: u8 = 1;
/// Code of the first of [`FeatureSet::ALL`]. Those below were of logarithms of mean spectra in twelve bands.
const FIRST_SET: u8 = 4;
/// Bytes of a table's header.
pub(crate) const HEADER: usize = 16;
pub(super) const MOVEMENT_BYTES: usize = 6;
pub(super) const PROPERTIES: usize = Property::ALL.len();
pub(super) const CELL_BYTES: usize = 4;
pub(super) const CRC_BYTES: usize = 4;

/// Most movements in a table: the whole grid of the pilot study.
pub const MAX_MOVEMENTS: usize = 36;
/// Most actions of a table.
pub const MAX_ACTIONS: usize = MAX_MOVEMENTS * PROPERTIES;
/// Most textures of a table.
pub const MAX_TEXTURES: usize = 128;

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
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, thiserror::Error)]
#[allow(missing_docs)] // their texts say it
pub enum TableError {
    #[error("truncated: {got} bytes of {wanted}")]
    Truncated { got: usize, wanted: usize },
    #[error("not a texture table: it begins with {0:02x?}, not `TACT`")]
    Magic([u8; 4]),
    #[error(
        "version {0}, and this program reads version {VERSION}: learn the table anew, or use the program that wrote it"
    )]
    Version(u16),
    #[error("method {0} is unknown to this program")]
    Method(u8),
    #[error("the header says {header} bytes, the contents take {contents}")]
    Length { header: usize, contents: usize },
    #[error("damaged: checksum {computed:08x}, and {stored:08x} was written")]
    Crc { stored: u32, computed: u32 },
    #[error("the header counts no textures, movements or properties, or too many")]
    Header,
    #[error("movement {}: {}", .0 + 1, .1)]
    Movement(u8, MovementError),
    #[error("movement {} is there twice", .0 + 1)]
    TwinMovement(u8),
    #[error(
        "texture {}, movement {}, {}: trials, but no standard deviation",
        .texture + 1,
        .action.movement + 1,
        .action.what()
    )]
    Deviation { texture: u16, action: Action },
    #[error("the whitening of movement {} is damaged", .0 + 1)]
    Whitening(u8),
    #[error("the name of texture {} is not UTF-8, or another's as well", .0 + 1)]
    Name(u16),
    #[error("texture {} has another's number", .0 + 1)]
    Number(u16),
    #[error("what follows the names is damaged")]
    Sections,
    /// A section of this kind is damaged, there twice, or not for such a table.
    #[error(fmt = damaged)]
    Section(u16),
    #[error(
        "learned with the finger {table}, but the finger here is {probe}: their slides cannot be compared. Use a table \
         that was learned with {probe}"
    )]
    Finger {
        table: FingerCode,
        probe: FingerCode,
    },
    #[error("the name of texture {} {}", .0 + 1, .1)]
    Unnamed(u16, NameError),
    #[error("{0} textures, and a table has {MAX_TEXTURES} at most: learn fewer")]
    Textures(u16),
    #[error("{0} bytes follow the end of the table: take them off, or copy the table again")]
    Behind(usize),
}

fn damaged(kind: &u16, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    f.write_str(match *kind {
        DRIFT => "the drift that it expects is damaged",
        2 => "its limits of new and changed textures are damaged",
        SLOPES => "its slopes over speed are damaged",
        LENGTH => "what it says of shorter slides is damaged",
        kind => return write!(f, "section {kind} is damaged"),
    })
}

pub(super) const LABEL_BYTES: usize = 5;

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

    pub(super) const fn codes(self) -> [u8; 3] {
        match self {
            Self::Gaussians(measured) => [GAUSSIANS, measured.bits(), 0],
            Self::Fused(set, features) => [FUSED, FIRST_SET + set as u8, features],
        }
    }

    pub(super) fn from_codes([contents, what, features]: [u8; 3]) -> Result<Self, TableError> {
        match contents {
            GAUSSIANS => PropertySet::from_bits(what)
                .filter(|set| !set.is_empty() && features == 0)
                .map(Self::Gaussians),
            FUSED => FeatureSet::ALL
                .get(usize::from(what).wrapping_sub(FIRST_SET.into()))
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
