//! Letters, point by point. embedded-graphics has the fonts; its text renderer can do much more, and takes 3 KB.

use embedded_graphics::Pixel;
use embedded_graphics::draw_target::DrawTarget;
use embedded_graphics::geometry::Point;
use embedded_graphics::image::{GetPixel as _, ImageRaw};
use embedded_graphics::mono_font::{MonoFont, ascii};
use embedded_graphics::pixelcolor::BinaryColor;

/// Letters in a line of a font's picture, which begins with a blank.
const IN_A_LINE: i32 = 16;

pub(super) struct Font {
    letters: ImageRaw<'static, BinaryColor>,
    width: i32,
    height: i32,
}

impl Font {
    const fn of(font: &MonoFont<'static>) -> Self {
        Self {
            letters: font.image,
            width: font.character_size.width as i32,
            height: font.character_size.height as i32,
        }
    }
}

pub(super) static SMALL: Font = Font::of(&ascii::FONT_6X10);
pub(super) static BOLD: Font = Font::of(&ascii::FONT_7X13_BOLD);
pub(super) static LARGE: Font = Font::of(&ascii::FONT_10X20);

/// The point of a text that is at the given place.
#[derive(Clone, Copy)]
pub(super) enum Anchor {
    Left,
    Middle,
    Right,
}

/// Writes a text with its top at `y`, in `ink`. A letter that the font does not have is a question mark.
pub(super) fn write<D: DrawTarget<Color = BinaryColor>>(
    target: &mut D,
    text: &str,
    (x, y): (i32, i32),
    font: &Font,
    anchor: Anchor,
    ink: BinaryColor,
) -> Result<(), D::Error> {
    let last = font.width * text.chars().count() as i32 - 1;
    let mut left = match anchor {
        Anchor::Left => x,
        Anchor::Middle => x - last / 2,
        Anchor::Right => x - last,
    };
    for letter in text.chars() {
        let letter = if (' '..='~').contains(&letter) {
            letter
        } else {
            '?'
        };
        let number = letter as i32 - ' ' as i32;
        let (column, line) = (number % IN_A_LINE, number / IN_A_LINE);
        for down in 0..font.height {
            for along in 0..font.width {
                let at = Point::new(column * font.width + along, line * font.height + down);
                if font.letters.pixel(at) == Some(BinaryColor::On) {
                    let at = Point::new(left + along, y + down);
                    target.draw_iter([Pixel(at, ink)])?;
                }
            }
        }
        left += font.width;
    }
    Ok(())
}
