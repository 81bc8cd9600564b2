//! Sentences of bounded length.

use core::fmt::{self, Write as _};

use heapless::String;

/// A sentence.
pub type Text = String<120>;

/// A sentence, cut off where it is too long.
pub fn text(sentence: impl fmt::Display) -> Text {
    cut(&sentence)
}

/// Not generic, so that the firmware has this code once.
#[inline(never)]
fn cut(sentence: &dyn fmt::Display) -> Text {
    /// Takes what fits.
    struct Cut(Text);
    impl fmt::Write for Cut {
        fn write_str(&mut self, part: &str) -> fmt::Result {
            part.chars()
                .try_for_each(|c| self.0.push(c))
                .map_err(|_| fmt::Error)
        }
    }
    let mut text = Cut(Text::new());
    // an error is its end
    let _ = write!(text, "{sentence}");
    text.0
}
