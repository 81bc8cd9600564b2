//! Sentences about what a probe has learned, beside the rest of its table.

use std::io::{self, Write};

use crate::eval::alike::Alike;

/// "Most like Canvas: 31 % of slides could be taken for it"
fn most_like(nearest: &Alike) -> String {
    let other = &nearest.texture;
    match (nearest.taken_for * 100.0).round() {
        share if share < 1.0 => {
            format!("Most like {other}: less than 1 % of slides could be taken for it")
        }
        share => format!("Most like {other}: {share:.0} % of slides could be taken for it"),
    }
}

/// Prints what a texture that was learned feels most like, and what to do where that is too much.
pub fn compare(name: &str, is_new: bool, nearest: &Alike, out: &mut impl Write) -> io::Result<()> {
    let other = &nearest.texture;
    let (force_n, speed_mm_s) = (nearest.force_n, nearest.speed_mm_s);
    let like = most_like(nearest);
    writeln!(
        out,
        "{like}, at {force_n:.2} N, {speed_mm_s:.1} mm/s, the movement that tells the two apart best."
    )?;
    if !nearest.feels_the_same {
        return Ok(());
    }
    write!(
        out,
        "WARNING: {name} feels the same as {other}: ten slides would not tell them apart. "
    )?;
    if is_new {
        writeln!(
            out,
            "If it is {other}: tactus device forget --name '{name}', then teach it as '{other}'. If not: consider \
                 more trials."
        )
    } else {
        writeln!(out, "Consider more trials.")
    }
}
