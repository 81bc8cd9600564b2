//! Tables of shaded cells as SVG.

use plotters::prelude::*;

use super::labels::{lines, width};
use super::svg::{COLOURS, EM, Figure, From, GREY, Tip, WIDTH, caption, figure, write};

/// A cell of a [`Grid`].
pub(crate) struct Tile {
    /// Written in it, where it has room.
    pub(crate) text: String,
    /// Opacity of its colour, 0 to 1.
    pub(crate) shade: f64,
    pub(crate) colour: RGBColor,
    pub(crate) framed: bool,
    /// Tooltip; empty for none.
    pub(crate) says: String,
}

pub(crate) struct Grid<'a> {
    pub(crate) id: String,
    pub(crate) title: String,
    pub(crate) about: &'a str,
    /// Quantity of the columns, and the name of each.
    pub(crate) x: (&'a str, Vec<String>),
    /// Quantity of the rows, and the name of each, from the top.
    pub(crate) y: (&'a str, Vec<String>),
    /// Row by row.
    pub(crate) tiles: Vec<Vec<Tile>>,
    pub(crate) below: &'a str,
}

/// Height of a row that has only a name, and of a line of words, px.
const LINE: i32 = 18;
/// Height of the cells of a small table, all together, px.
const TALL: i32 = 270;

impl Grid<'_> {
    pub(crate) fn figure(self) -> anyhow::Result<Figure> {
        let (columns, rows) = (&self.x.1, &self.y.1);
        let longest = |names: &[String]| names.iter().map(|n| width(n, EM)).max().unwrap_or(0);
        let left = 28 + longest(rows);
        let wide = WIDTH as i32 - left - 8;
        let row_height = (TALL / rows.len().max(1) as i32).clamp(LINE, 44);
        let height = row_height * rows.len() as i32;
        let below = lines(self.below, EM, WIDTH as i32 - 16);
        let below: Vec<&String> = below.iter().filter(|line| !line.is_empty()).collect();
        let title_lines = lines(&self.title, EM * 1.1, WIDTH as i32 - 12).len() as i32;
        let top = 8 + 20 * title_lines + 2;
        let size = top + height + 48 + LINE * below.len() as i32;
        let column = |c: usize| left + wide * c as i32 / columns.len().max(1) as i32;
        let row = |r: usize| top + row_height * r as i32;
        // names that would cover each other are left out
        let room = wide / columns.len().max(1) as i32;
        let every = (longest(columns) + 4).div_euclid(room.max(1)) as usize + 1;
        figure(
            self.id.as_str(),
            &self.title,
            self.about,
            (WIDTH, size as u32),
            |root| {
                caption(root, &self.title, WIDTH)?;
                let middle = left + wide / 2;
                let under = top + height;
                write(root, self.x.0, (middle, under + 34), From::Middle, BLACK)?;
                let side = (11, top + height / 2);
                write(root, self.y.0, side, From::Upwards, BLACK)?;
                for (line, y) in below
                    .iter()
                    .zip((under + 34 + LINE..).step_by(LINE as usize))
                {
                    write(root, line, (8, y), From::Left, BLACK)?;
                }
                for (c, name) in columns.iter().enumerate() {
                    let at = ((column(c) + column(c + 1)) / 2, under + 12);
                    // the last ones are no numbers, and have room at their sides
                    let is_word = name.parse::<f64>().is_err() && width(name, EM) <= room;
                    let is_last = c + 1 == columns.len();
                    let is_shown =
                        is_word || is_last || c % every == 0 && c + every <= columns.len();
                    if is_shown {
                        write(root, name, at, From::Middle, BLACK)?;
                    }
                }
                let (mut frames, mut tips) = (Vec::new(), Vec::new());
                for (r, (name, tiles)) in rows.iter().zip(&self.tiles).enumerate() {
                    let y = (row(r) + row(r + 1)) / 2;
                    write(root, name, (left - 6, y), From::Right, BLACK)?;
                    for (c, tile) in tiles.iter().enumerate() {
                        let corners = [(column(c), row(r)), (column(c + 1), row(r + 1))];
                        let [(x0, y0), (x1, y1)] = corners;
                        let fill = tile.colour.mix(tile.shade);
                        root.draw(&Rectangle::new(corners, fill.filled()))?;
                        if x1 - x0 > 6 {
                            root.draw(&Rectangle::new(corners, BLACK.mix(0.15)))?;
                        }
                        let ink = if tile.shade > 0.55 { WHITE } else { BLACK };
                        if width(&tile.text, EM) <= x1 - x0 {
                            write(root, &tile.text, ((x0 + x1) / 2, y), From::Middle, ink)?;
                        }
                        if !tile.says.is_empty() {
                            tips.push(Tip {
                                area: [x0, y0, x1, y1],
                                says: tile.says.clone(),
                            });
                        }
                        if tile.framed {
                            frames.push(corners);
                        }
                    }
                }
                let all = [(left, top), (left + wide, top + height)];
                root.draw(&Rectangle::new(all, BLACK.mix(0.3)))?;
                for [from, to] in frames {
                    let inner = [(from.0 + 2, from.1 + 2), (to.0 - 2, to.1 - 2)];
                    root.draw(&Rectangle::new(inner, COLOURS[1].stroke_width(4)))?;
                }
                Ok(tips)
            },
        )
    }
}

/// Colour of a cell that is to be left out of account.
pub(crate) const AVOIDED: RGBColor = GREY;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_that_are_no_numbers_have_their_names() {
        let columns = (1..=20)
            .map(|n| n.to_string())
            .chain(["N", "?"].map(str::to_owned));
        let grid = Grid {
            id: "grid".to_owned(),
            title: "Grid".to_owned(),
            about: "",
            x: ("x", columns.collect()),
            y: ("y", vec!["row".to_owned()]),
            tiles: Vec::new(),
            below: "",
        };
        let svg = grid.figure().unwrap().svg;
        for (name, is_shown) in [("1", true), ("2", false), ("N", true), ("?", true)] {
            assert_eq!(svg.contains(&format!(">\n{name}\n<")), is_shown, "{name}");
        }
    }
}
