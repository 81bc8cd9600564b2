//! Charts as SVG, for any contents.

pub(crate) mod grid;
mod labels;
pub(crate) mod matrix;
mod svg;

use plotters::prelude::*;

use labels::{Area, lines, place, width};
pub(crate) use svg::{COLOURS, EM, GREY, WIDTH};
use svg::{FONT, Failed, From, INK, Root, TEXT, Tip, caption, figure, write};
pub use svg::{Figure, escaped};

/// The mark at a point.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum Mark {
    /// Nothing: only the line.
    None,
    Circle,
    Cross,
    Triangle,
    Square,
}

/// The marks in the order in which series take them: the colour alone is not enough for every eye.
pub(crate) const MARKS: [Mark; 4] = [Mark::Circle, Mark::Triangle, Mark::Square, Mark::Cross];

pub(crate) struct Series {
    /// Written at the last point, or in the legend; empty for none.
    pub(crate) name: String,
    pub(crate) colour: RGBColor,
    pub(crate) mark: Mark,
    /// The line that joins them, if any; dashed if they are only there for comparison.
    pub(crate) line: Option<Line>,
    pub(crate) width: u32,
    pub(crate) points: Vec<(f64, f64)>,
    /// Written beside each point where there is room; nothing where it is empty.
    pub(crate) labels: Vec<String>,
    /// Tooltip of each point; empty for none.
    pub(crate) says: Vec<String>,
}

#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Line {
    Whole,
    Dashed,
}

impl Series {
    /// Points that nothing joins, in one of [`COLOURS`].
    pub(crate) fn points(
        colour: usize,
        mark: Mark,
        name: impl Into<String>,
        points: Vec<(f64, f64)>,
    ) -> Self {
        Self {
            name: name.into(),
            colour: COLOURS[colour % COLOURS.len()],
            mark,
            line: None,
            width: 2,
            points,
            labels: Vec::new(),
            says: Vec::new(),
        }
    }

    /// Points that a line joins.
    pub(crate) fn curve(
        colour: usize,
        mark: Mark,
        name: impl Into<String>,
        points: Vec<(f64, f64)>,
    ) -> Self {
        Self {
            line: Some(Line::Whole),
            ..Self::points(colour, mark, name, points)
        }
    }

    /// A grey line that is only there for comparison.
    pub(crate) fn dashed(name: impl Into<String>, points: Vec<(f64, f64)>) -> Self {
        Self {
            colour: GREY,
            line: Some(Line::Dashed),
            ..Self::points(0, Mark::None, name, points)
        }
    }
}

pub(crate) struct Chart<'a> {
    pub(crate) title: String,
    /// Its description, for those who cannot see it; empty if the title says it.
    pub(crate) about: String,
    /// Quantity of an axis, with its unit.
    pub(crate) x: &'a str,
    pub(crate) y: &'a str,
    pub(crate) x_range: (f64, f64),
    pub(crate) y_range: (f64, f64),
    /// Number of marks on the x axis, and their labels.
    pub(crate) x_marks: usize,
    pub(crate) x_text: &'a dyn Fn(f64) -> String,
    pub(crate) below: &'a str,
    /// px
    pub(crate) size: (u32, u32),
    pub(crate) series: Vec<Series>,
}

/// Size of a chart that asks for none, px.
const PANEL: (u32, u32) = (WIDTH, 350);
/// Height of a line of words, px.
const LINE: i32 = TEXT as i32 + 2;

/// Range that holds all values, with a little margin.
pub(crate) fn buffer(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = values
        .filter(|v| v.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
            (l.min(v), h.max(v))
        });
    if low > high {
        return (0.0, 1.0);
    }
    let buffer = (0.06 * (high - low)).max(1e-6);
    (low - buffer, high + buffer)
}

fn plain(value: f64) -> String {
    let rounded = (value * 1e6).round() / 1e6;
    format!("{}", rounded + 0.0)
}

impl<'a> Chart<'a> {
    /// A chart of the size of a panel whose y axis has room for all points, six marks on the x axis, and a legend.
    pub(crate) fn new(
        title: impl Into<String>,
        x: &'a str,
        y: &'a str,
        x_range: (f64, f64),
        series: Vec<Series>,
    ) -> Self {
        let points = series.iter().flat_map(|s| &s.points).map(|p| p.1);
        Self {
            title: title.into(),
            about: String::new(),
            x,
            y,
            x_range,
            y_range: buffer(points),
            x_marks: 6,
            x_text: &plain,
            below: "",
            size: PANEL,
            series,
        }
    }

    /// Height of these words below a chart, px.
    pub(crate) fn height_of(below: &str) -> u32 {
        (LINE * lines(below, EM, WIDTH as i32 - 16).len() as i32) as u32
    }

    pub(crate) fn figure(self, id: impl Into<String>) -> anyhow::Result<Figure> {
        figure(id, &self.title, &self.about, self.size, |root| {
            Ok(self.draw(root)?.1)
        })
    }

    /// Draws it; returns the area between the axes, and the tooltips of its points.
    fn draw(&self, root: &Root<'_>) -> Result<(Area, Vec<Tip>), Failed> {
        let (full, tall) = (self.size.0 as i32, self.size.1 as i32);
        let title = caption(root, &self.title, self.size.0)? as i32;
        let top = self.legend(root, title)?;
        let below = lines(self.below, EM, full - 16);
        let below: Vec<&String> = below.iter().filter(|line| !line.is_empty()).collect();
        let under = LINE * below.len() as i32;
        for (line, y) in below
            .iter()
            .zip((tall - under + 4..).step_by(LINE as usize))
        {
            write(root, line, (8, y), From::Left, BLACK)?;
        }
        let mut on = ChartBuilder::on(root);
        on.margin(6)
            .margin_top(top)
            .margin_right(16)
            .margin_bottom(6 + under)
            .x_label_area_size(if self.x.is_empty() { 24 } else { 48 })
            .y_label_area_size(70);
        let (x_range, y_range) = (self.x_range, self.y_range);
        let mut drawn = on.build_cartesian_2d(x_range.0..x_range.1, y_range.0..y_range.1)?;
        let (x_text, y_text) = (|x: &f64| (self.x_text)(*x), |y: &f64| plain(*y));
        let mut mesh = drawn.configure_mesh();
        mesh.x_desc(self.x)
            .y_desc(self.y)
            .x_labels(self.x_marks)
            .y_labels(6)
            .x_label_formatter(&x_text)
            .y_label_formatter(&y_text)
            .light_line_style(TRANSPARENT)
            .bold_line_style(BLACK.mix(0.12))
            .label_style((FONT, TEXT))
            .axis_desc_style((FONT, TEXT));
        if self.series.is_empty() {
            mesh.disable_mesh();
        }
        mesh.draw()?;
        for series in &self.series {
            let style = series.colour.stroke_width(series.width);
            match series.line {
                Some(Line::Whole) => {
                    drawn.draw_series([PathElement::new(series.points.clone(), style)])?;
                }
                Some(Line::Dashed) => {
                    let ends = series.points.windows(2);
                    let dashes = ends.flat_map(|ends| self.dashes(ends[0], ends[1]));
                    drawn.draw_series(dashes.map(|dash| PathElement::new(dash, style)))?;
                }
                None => {}
            }
        }
        let area = drawn.plotting_area();
        let (x, y) = (area.get_x_axis_pixel_range(), area.get_y_axis_pixel_range());
        let [left, right] = [x.start.min(x.end), x.start.max(x.end)];
        let [top, bottom] = [y.start.min(y.end), y.start.max(y.end)];
        let mut tips = Vec::new();
        let (mut points, mut labels): (Vec<_>, Vec<_>) = Default::default();
        for series in &self.series {
            let at: Vec<(i32, i32)> = series
                .points
                .iter()
                .map(|p| area.map_coordinate(p))
                .collect();
            for &at in &at {
                mark(root, series, at)?;
            }
            tips.extend(at.iter().zip(&series.says).map(|(&(x, y), says)| Tip {
                area: [x - 8, y - 8, x + 8, y + 8],
                says: says.clone(),
            }));
            points.extend(at.iter().zip(&series.labels).map(|(at, _)| *at));
            labels.extend(series.labels.iter().cloned());
        }
        let inside = [left + 2, top + 2, right - 2, bottom - 2];
        let placed = place(&points, &labels, EM, inside);
        for ((at, label), middle) in points.iter().zip(&labels).zip(placed) {
            let Some((x, y)) = middle else { continue };
            let half = width(label, EM) / 2;
            let near = ((at.0).clamp(x - half, x + half), (at.1).clamp(y - 8, y + 8));
            if (near.0 - at.0).abs() + (near.1 - at.1).abs() > 12 {
                root.draw(&PathElement::new(vec![*at, near], BLACK.mix(0.4)))?;
            }
            write(root, label, (x, y), From::Middle, INK)?;
        }
        Ok(([left, top, right, bottom], tips))
    }

    /// Writes the legend below the title, in as many lines as it takes; returns the px down to its end.
    fn legend(&self, root: &Root<'_>, top: i32) -> Result<i32, Failed> {
        const SIGN: i32 = 30;
        let (mut x, mut y) = (10, top + 8);
        let mut next = |name: &str| {
            let wide = SIGN + width(name, EM) + 12;
            if x > 10 && x + wide > self.size.0 as i32 {
                (x, y) = (10, y + LINE);
            }
            x += wide;
            (x - wide, y)
        };
        let mut is_empty = true;
        for series in self.series.iter().filter(|s| !s.name.is_empty()) {
            let (x, y) = next(&series.name);
            let style = series.colour.stroke_width(2);
            let lines: &[[i32; 2]] = match series.line {
                Some(Line::Whole) => &[[0, 24]],
                Some(Line::Dashed) => &[[0, 9], [14, 24]],
                None => &[],
            };
            for [from, to] in lines {
                root.draw(&PathElement::new(vec![(x + from, y), (x + to, y)], style))?;
            }
            mark(root, series, (x + 12, y))?;
            write(root, &series.name, (x + SIGN, y), From::Left, BLACK)?;
            is_empty = false;
        }
        Ok(if is_empty { top } else { y + LINE - 6 })
    }

    /// Cuts a line into dashes of about a 60th of the chart.
    fn dashes(&self, from: (f64, f64), to: (f64, f64)) -> Vec<Vec<(f64, f64)>> {
        let part = |a: f64, b: f64, range: (f64, f64)| ((b - a) / (range.1 - range.0)).abs();
        let length = part(from.0, to.0, self.x_range).max(part(from.1, to.1, self.y_range));
        let dashes = ((60.0 * length).ceil() as usize).max(1);
        let at = |dash: usize| {
            let share = (dash as f64 / dashes as f64).min(1.0);
            let between = |a: f64, b: f64| a + (b - a) * share;
            (between(from.0, to.0), between(from.1, to.1))
        };
        let dashes = (0..dashes).step_by(2);
        dashes.map(|d| vec![at(d), at(d + 1)]).collect()
    }
}

fn mark(root: &Root<'_>, series: &Series, at: (i32, i32)) -> Result<(), Failed> {
    let filled = series.colour.filled();
    match series.mark {
        Mark::None => Ok(()),
        Mark::Circle => root.draw(&Circle::new(at, 3, filled)),
        Mark::Cross => root.draw(&Cross::new(at, 3, series.colour.stroke_width(2))),
        Mark::Triangle => root.draw(&TriangleMarker::new(at, 4, filled)),
        Mark::Square => {
            let (x, y) = at;
            root.draw(&Rectangle::new([(x - 3, y - 3), (x + 3, y + 3)], filled))
        }
    }
}
