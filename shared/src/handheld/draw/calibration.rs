//! The screens of weights on the finger, and of an accelerometer that is turned over.

use embedded_graphics::draw_target::DrawTarget;
use embedded_graphics::pixelcolor::BinaryColor;

use super::letters::{LARGE, SMALL};
use super::{Brush, Done, say};
use crate::rig::turning::Turned;
use crate::rig::weigh::ForceScale;

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

    pub(super) fn scale(&mut self, scale: &ForceScale) -> Done<D> {
        let hundredths = libm::roundf(100.0 * scale.mn_per_count) as u16;
        let (whole, rest) = (hundredths / 100, hundredths % 100);
        let off = scale.off_mn as u16;
        let text = say(format_args!(
            "A count is {whole}.{rest:02} mN. At worst {off} mN off."
        ));
        self.sentence("Force is set", &text)
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

    pub(super) fn turned(&mut self, turned: &Turned) -> Done<D> {
        let off = (turned.offset_counts / turned.g_counts * 1e3) as i16;
        let text = say(format_args!(
            "1 g is {} counts, zero {off} mg.",
            turned.g_counts as u16
        ));
        self.sentence("Turned over", &text)
    }
}
