//! The screens of weights on the finger, and of an accelerometer that is turned over.

use embedded_graphics::draw_target::DrawTarget;
use embedded_graphics::pixelcolor::BinaryColor;

use super::letters::{LARGE, SMALL};
use super::{Brush, Done, say};

impl<D: DrawTarget<Color = BinaryColor>> Brush<'_, D> {
    pub(super) fn weigh(&mut self, mn: u16, force_mn: f32) -> Done<D> {
        self.title("Calibrate", "keep still")?;
        self.centre("Put on", 13, &LARGE)?;
        // the figure written on weights
        let grams = (u32::from(mn) * 1000 + 4903) / 9807;
        self.centre(&say(format_args!("{grams} g")), 32, &LARGE)?;
        let reads = force_mn as u16;
        let reads = say(format_args!(
            "{}.{:02} N, reads {}.{:02}",
            mn / 1000,
            mn % 1000 / 10,
            reads / 1000,
            reads % 1000 / 10
        ));
        self.centre(&reads, 54, &SMALL)
    }

    pub(super) fn turn(&mut self, over: bool) -> Done<D> {
        self.title("Calibrate", "keep still")?;
        let (first, second) = if over {
            ("Turn it", "over")
        } else {
            ("Point it", "down")
        };
        self.centre(first, 18, &LARGE)?;
        self.centre(second, 38, &LARGE)
    }
}
