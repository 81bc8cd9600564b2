//! A drawing as SVG: its colours and letters, light and dark, and its text for those who cannot see it.

use std::fmt::Write as _;
use std::io;

use anyhow::Context as _;
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use serde::Serialize;
use tactus_lab::data::printable::printable;

use super::labels::{Area, lines};

/// Colours that differ for every eye (Okabe & Ito), without the yellow, which is too light for white paper.
pub(crate) const COLOURS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
    RGBColor(0, 0, 0),
];
/// Colour of lines that are only there for comparison.
pub(crate) const GREY: RGBColor = RGBColor(110, 110, 110);
/// Black for words that lie on lines: paper is left round them.
pub(super) const INK: RGBColor = RGBColor(1, 1, 1);

/// Height of the letters as the library counts it: from the highest to the lowest of any letter, px.
pub(super) const TEXT: u32 = 17;
/// Height of the letters as browsers count it, px: at the width of a phone, 390 px, [`WIDTH`] leaves 11 of them.
pub(crate) const EM: f64 = TEXT as f64 / 1.24;
/// Width of a drawing, px.
pub(crate) const WIDTH: u32 = 480;
pub(super) const FONT: &str = "sans-serif";

/// The colours on a dark screen: white becomes dark and black light, and the darker colours brighter.
const STYLE: &str = "<style>[fill=\"#010101\"]{paint-order:stroke;stroke:#fff;stroke-width:3px;stroke-linejoin:round}\
@media screen and (prefers-color-scheme:dark){\
rect[fill=\"#FFFFFF\"]{fill:#15181c}[stroke=\"#FFFFFF\"]{stroke:#15181c}\
[fill=\"#010101\"]{fill:#ececec;stroke:#15181c}[fill=\"#000000\"]{fill:#ececec}[stroke=\"#000000\"]{stroke:#ececec}\
[fill=\"#6E6E6E\"]{fill:#9a9a9a}[stroke=\"#6E6E6E\"]{stroke:#9a9a9a}\
[fill=\"#0072B2\"]{fill:#2b8fd0}[stroke=\"#0072B2\"]{stroke:#2b8fd0}}</style>";
/// Style that fits the outermost drawing to its place.
const FITS: &str = "style=\"max-width:100%;height:auto\"";

/// Errors of drawing: drawing into a string does not fail, but the library allows for it.
pub(super) type Failed = DrawingAreaErrorKind<io::Error>;
pub(super) type Root<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// A figure, or a panel of one.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Figure {
    /// Name of its file, without the ending.
    pub id: String,
    /// Its description, for those who cannot see it.
    pub title: String,
    /// The drawing.
    pub svg: String,
}

/// Text of a part of a drawing for those who point at it or cannot see it.
pub(super) struct Tip {
    pub(super) area: Area,
    pub(super) says: String,
}

/// A drawing of this size in px on white paper; `draw` returns the texts of its parts. `about` is its description.
pub(super) fn figure(
    id: impl Into<String>,
    title: &str,
    about: &str,
    size: (u32, u32),
    draw: impl FnOnce(&Root<'_>) -> Result<Vec<Tip>, Failed>,
) -> anyhow::Result<Figure> {
    let mut drawing = String::new();
    let drawn = {
        let root = SVGBackend::with_string(&mut drawing, size).into_drawing_area();
        let drawn = root.fill(&WHITE).and_then(|()| draw(&root));
        drawn.and_then(|tips| root.present().map(|()| tips))
    };
    let tips = drawn
        .with_context(|| format!("the figure \"{title}\" cannot be drawn; please report this"))?;
    let mut says = format!("<title>{}</title>\n", escaped(title));
    if !about.is_empty() {
        let _ = writeln!(says, "<desc>{}</desc>", escaped(about));
    }
    let open = format!("<svg {FITS} role=\"img\" ");
    let drawing = drawing.replacen("<svg ", &open, 1);
    let drawing = drawing.replacen(">\n", &format!(">\n{says}{STYLE}\n"), 1);
    let mut figure = Figure {
        id: id.into(),
        title: title.to_owned(),
        // of letters, too, XML knows no control characters
        svg: printable(&drawing).into_owned(),
    };
    let tips = tips.iter().map(|tip| {
        let [left, top, right, bottom] = tip.area;
        format!(
            "<rect x=\"{left}\" y=\"{top}\" width=\"{}\" height=\"{}\" fill=\"transparent\"><title>{}</title></rect>\n",
            right - left,
            bottom - top,
            escaped(&tip.says)
        )
    });
    figure.add(&tips.collect::<String>());
    Ok(figure)
}

impl Figure {
    pub(super) fn add(&mut self, drawing: &str) {
        if let Some(end) = self.svg.rfind("</svg>") {
            self.svg.insert_str(end, drawing);
        }
    }
}

/// Text as XML has it.
pub fn escaped(text: &str) -> String {
    printable(text)
        .replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}

/// Place of the words of [`write`] from their point.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum From {
    Left,
    Right,
    /// They are about it.
    Middle,
    /// They are about it, and go upwards.
    Upwards,
}

/// Writes words at the height of `at`.
pub(super) fn write(
    root: &Root<'_>,
    words: &str,
    at: (i32, i32),
    from: From,
    colour: RGBColor,
) -> Result<(), Failed> {
    let font = (FONT, TEXT).into_font();
    let (font, horizontal) = match from {
        From::Left => (font, HPos::Left),
        From::Right => (font, HPos::Right),
        From::Middle => (font, HPos::Center),
        From::Upwards => (font.transform(FontTransform::Rotate270), HPos::Center),
    };
    let style = font.color(&colour).pos(Pos::new(horizontal, VPos::Center));
    root.draw(&Text::new(words.to_owned(), at, style))
}

/// Writes the title at the top, in as many lines as it takes; returns their height in px.
pub(super) fn caption(root: &Root<'_>, title: &str, width: u32) -> Result<u32, Failed> {
    const LINE: i32 = TEXT as i32 + 3;
    let mut y = 14;
    for line in lines(title, EM * 1.1, width as i32 - 12) {
        let style = (FONT, TEXT + 2).into_font().color(&BLACK);
        let style = style.pos(Pos::new(HPos::Center, VPos::Center));
        root.draw(&Text::new(line, (width as i32 / 2, y), style))?;
        y += LINE;
    }
    Ok((y - LINE + 14) as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_of_control_characters_leaves_it_a_picture() {
        let name = "\u{1b}[2J<&\u{7}\u{202e}";
        let drawn = figure("map", name, name, (100, 100), |root| {
            write(root, name, (50, 50), From::Middle, BLACK)?;
            let area = [0, 0, 9, 9];
            let says = name.to_owned();
            Ok(vec![Tip { area, says }])
        });
        let svg = drawn.unwrap().svg;
        assert_eq!(
            svg.matches("\\u001b[2J&lt;&amp;\\u0007\\u202e").count(),
            4,
            "{svg}"
        );
        assert!(!svg.chars().any(|c| c.is_control() && c != '\n'), "{svg:?}");
    }
}
