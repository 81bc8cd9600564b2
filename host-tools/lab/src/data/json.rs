//! Figures as JSON, with digits that mean something.

use std::io::{self, Write};

use serde::Serialize;
use serde_json::ser::{Formatter, PrettyFormatter, Serializer};

/// The object as indented text. Figures that were computed (`f64`) have six digits; what was measured (`f32`) stays as
/// it is.
///
/// # Errors
/// A key is no text.
pub fn text(value: &impl Serialize) -> serde_json::Result<String> {
    let mut text = Vec::new();
    let rounded = Rounded(PrettyFormatter::new());
    value.serialize(&mut Serializer::with_formatter(&mut text, rounded))?;
    Ok(String::from_utf8_lossy(&text).into_owned())
}

struct Rounded<'f>(PrettyFormatter<'f>);

macro_rules! as_pretty {
    ($($what:ident($($first:ident)?))*) => {$(
        fn $what<W: ?Sized + Write>(&mut self, to: &mut W $(, $first: bool)?) -> io::Result<()> {
            self.0.$what(to $(, $first)?)
        }
    )*};
}

impl Formatter for Rounded<'_> {
    fn write_f64<W: ?Sized + Write>(&mut self, to: &mut W, value: f64) -> io::Result<()> {
        let rounded = format!("{value:.5e}").parse().unwrap_or(value);
        let is_nothing = value.abs() < 1e-9;
        self.0.write_f64(to, if is_nothing { 0.0 } else { rounded })
    }

    as_pretty! {
        begin_array() end_array() begin_array_value(first) end_array_value()
        begin_object() end_object() begin_object_key(first) begin_object_value() end_object_value()
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn computed_figures_have_six_digits_and_measured_ones_their_own() {
        let figures = [1.0 / 3.0, 123_456_789.0, 1e-33, -0.25];
        let text = super::text(&(figures, [0.1_f32, 1.262], "1.23456789", [(); 0])).unwrap();
        let words: Vec<&str> = text.split_whitespace().collect();
        let wanted =
            "[ [ 0.333333, 123457000.0, 0.0, -0.25 ], [ 0.1, 1.262 ], \"1.23456789\", [] ]";
        assert_eq!(words.join(" "), wanted);
        assert!(text.starts_with("[\n  [\n    0.333333,\n"), "{text}");
    }
}
