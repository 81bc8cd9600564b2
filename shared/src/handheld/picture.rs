//! A picture of 128 x 64 points, in the order in which the display keeps them: eight pages of 128 columns, a byte each,
//! its lowest bit on top.

use core::convert::Infallible;

use embedded_graphics::Pixel;
use embedded_graphics::draw_target::DrawTarget;
use embedded_graphics::geometry::{OriginDimensions, Size};
use embedded_graphics::pixelcolor::BinaryColor;

/// Points in a row.
pub const WIDTH: usize = 128;
/// Rows.
pub const HEIGHT: usize = 64;

/// A picture of the display.
#[derive(Clone, PartialEq, Eq)]
pub struct Picture([u8; WIDTH * HEIGHT / 8]);

impl Picture {
    /// Dark.
    pub const fn new() -> Self {
        Self([0; WIDTH * HEIGHT / 8])
    }

    /// As the display keeps it.
    pub const fn bytes(&self) -> &[u8; WIDTH * HEIGHT / 8] {
        &self.0
    }

    /// From the bytes that a display keeps.
    pub const fn from_bytes(bytes: [u8; WIDTH * HEIGHT / 8]) -> Self {
        Self(bytes)
    }

    /// Returns true if a point is lit; outside, none is.
    pub fn is_lit(&self, x: usize, y: usize) -> bool {
        let byte = (x < WIDTH).then(|| self.0.get(y / 8 * WIDTH + x)).flatten();
        byte.is_some_and(|byte| byte >> (y % 8) & 1 == 1)
    }
}

impl Default for Picture {
    fn default() -> Self {
        Self::new()
    }
}

impl OriginDimensions for Picture {
    fn size(&self) -> Size {
        Size::new(WIDTH as u32, HEIGHT as u32)
    }
}

impl DrawTarget for Picture {
    type Color = BinaryColor;
    type Error = Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<BinaryColor>>>(
        &mut self,
        pixels: I,
    ) -> Result<(), Infallible> {
        for Pixel(at, colour) in pixels {
            let (Ok(x), Ok(y)) = (usize::try_from(at.x), usize::try_from(at.y)) else {
                continue;
            };
            let byte = (x < WIDTH)
                .then(|| self.0.get_mut(y / 8 * WIDTH + x))
                .flatten();
            if let Some(byte) = byte {
                let bit = 1 << (y % 8);
                match colour {
                    BinaryColor::On => *byte |= bit,
                    BinaryColor::Off => *byte &= !bit,
                }
            }
        }
        Ok(())
    }
}
