//! Names of textures: data from a host, a file or a person, which terminals, pictures and displays show.

use heapless::String;
use serde::{Deserialize, Serialize};

/// Most bytes of a texture's name.
pub const MAX_NAME: usize = 40;

/// Name of a texture.
pub type Name = String<MAX_NAME>;

/// The reasons why a text is no name of a texture.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, thiserror::Error)]
#[allow(missing_docs)] // their texts say it
pub enum NameError {
    #[error("is empty: give one of 1 to {MAX_NAME} bytes")]
    Empty,
    #[error("has {0} bytes: shorten it to {MAX_NAME}")]
    Long(usize),
    /// A character of this number.
    #[error("has the character U+{0:04X}, which does not print: leave it out")]
    Unprintable(u32),
}

/// Characters that change or hide those around them and print nothing themselves: the general categories Cf, Zl and Zp
/// of Unicode 16, selectors of variants and tags, blanks that are letters by category, private use and noncharacters of
/// the first plane.
const UNPRINTABLE: [(u32, u32); 30] = [
    (0xAD, 0xAD),
    (0x34F, 0x34F),
    (0x600, 0x605),
    (0x61C, 0x61C),
    (0x6DD, 0x6DD),
    (0x70F, 0x70F),
    (0x890, 0x891),
    (0x8E2, 0x8E2),
    (0x115F, 0x1160),
    (0x17B4, 0x17B5),
    (0x180B, 0x180F),
    (0x200B, 0x200F),
    (0x2028, 0x202E),
    (0x2060, 0x206F),
    (0x3164, 0x3164),
    (0xE000, 0xF8FF),
    (0xFDD0, 0xFDEF),
    (0xFE00, 0xFE0F),
    (0xFEFF, 0xFEFF),
    (0xFFA0, 0xFFA0),
    (0xFFF0, 0xFFFB),
    (0xFFFE, 0xFFFF),
    (0x110BD, 0x110BD),
    (0x110CD, 0x110CD),
    (0x13430, 0x1343F),
    (0x1BCA0, 0x1BCA3),
    (0x1D173, 0x1D17A),
    // tags, selectors of variants, and the planes of private use to the end
    (0xE0000, 0xE0FFF),
    (0xF0000, 0xFFFFF),
    (0x10_0000, 0x10_FFFF),
];

/// Returns whether a character shows something, or is a space, and leaves those around it as they are.
pub fn is_printable(character: char) -> bool {
    let code = u32::from(character);
    let hidden = |&(first, last): &(u32, u32)| (first..=last).contains(&code);
    !character.is_control() && !UNPRINTABLE.iter().any(hidden)
}

/// Returns the name that a text is: 1 to [`MAX_NAME`] bytes of printable characters, not all of them spaces.
/// Errors: the first rule that it breaks.
pub fn valid_name(text: &str) -> Result<Name, NameError> {
    if text.trim().is_empty() {
        return Err(NameError::Empty);
    }
    if let Some(hidden) = text.chars().find(|c| !is_printable(*c)) {
        return Err(NameError::Unprintable(hidden.into()));
    }
    Name::try_from(text).map_err(|_| NameError::Long(text.len()))
}
