//! Charts and matrices as SVG: how they are drawn, whatever they show.

use std::fmt::Write as _;
use std::io;

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use serde::Serialize;

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
/// For what is only there for comparison.
const GREY: RGBColor = RGBColor(110, 110, 110);
/// Height of the letters, px.
const TEXT: u32 = 13;
const FONT: &str = "sans-serif";

/// What stands at a point.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum Mark {
    /// Nothing: only the line.
    None,
    Circle,
    Cross,
    Triangle,
    Square,
}

/// Points of one kind.
pub(crate) struct Series {
    /// Written at the last point, or in the legend; empty for none.
    pub(crate) name: String,
    pub(crate) colour: RGBColor,
    pub(crate) mark: Mark,
    /// Whether a line joins them; dashed if they are only there for comparison.
    pub(crate) line: Option<Line>,
    pub(crate) points: Vec<(f64, f64)>,
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
            points,
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

/// A chart.
pub(crate) struct Chart<'a> {
    pub(crate) title: String,
    /// What an axis shows, with its unit.
    pub(crate) x: &'a str,
    pub(crate) y: &'a str,
    pub(crate) x_range: (f64, f64),
    pub(crate) y_range: (f64, f64),
    /// Number of marks on the x axis, and what stands there.
    pub(crate) x_marks: usize,
    pub(crate) x_text: &'a dyn Fn(f64) -> String,
    /// Names at the ends of the lines rather than in a legend.
    pub(crate) named_at_end: bool,
    /// px
    pub(crate) size: (u32, u32),
    pub(crate) series: Vec<Series>,
}

/// A figure, or a panel of one.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub(crate) struct Figure {
    /// Name of its file, without the ending.
    pub(crate) id: String,
    /// What it shows, for those who cannot see it.
    pub(crate) title: String,
    /// The drawing.
    pub(crate) svg: String,
}

/// Of one panel, px.
const PANEL: (u32, u32) = (440, 320);

/// Why a drawing fails: drawing into a string does not, but the library says it might.
type Failed = DrawingAreaErrorKind<io::Error>;

/// A figure was not drawn.
#[derive(Debug, thiserror::Error)]
#[error("the figure \"{figure}\" cannot be drawn; please report this")]
pub struct DrawError {
    /// Its title.
    figure: String,
    source: Failed,
}

/// Range that holds all values, with a little room.
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

/// A number for an axis.
fn plain(value: f64) -> String {
    let rounded = (value * 1e6).round() / 1e6;
    format!("{}", rounded + 0.0)
}

/// Draws curves over the same x as SVG, each with its name.
///
/// # Errors
/// See [`DrawError`].
pub fn curves(
    title: &str,
    x: &str,
    y: &str,
    curves: &[(&str, Vec<(f64, f64)>)],
) -> Result<String, DrawError> {
    let marks = [Mark::Circle, Mark::Triangle, Mark::Square, Mark::Cross];
    let series = curves.iter().enumerate();
    let series = series.map(|(n, (name, points))| {
        Series::curve(
            n % marks.len(),
            marks[n % marks.len()],
            *name,
            points.clone(),
        )
    });
    let x_range = buffer(
        curves
            .iter()
            .flat_map(|(_, points)| points)
            .map(|(x, _)| *x),
    );
    let chart = Chart {
        size: (640, 400),
        ..Chart::new(title, x, y, x_range, series.collect())
    };
    Ok(chart.figure("")?.svg)
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
        Self {
            title: title.into(),
            x,
            y,
            x_range,
            y_range: buffer(series.iter().flat_map(|s| &s.points).map(|p| p.1)),
            x_marks: 6,
            x_text: &plain,
            named_at_end: false,
            size: PANEL,
            series,
        }
    }

    /// Draws it.
    ///
    /// # Errors
    /// See [`DrawError`].
    pub(crate) fn figure(self, id: impl Into<String>) -> Result<Figure, DrawError> {
        let (svg, _) = svg(&self.title, self.size, |root| self.draw(root))?;
        Ok(Figure {
            id: id.into(),
            title: self.title,
            svg,
        })
    }

    /// Draws it, and says where in the drawing the area between the axes is: left, right, top and bottom in px.
    fn draw(&self, root: &Root<'_>) -> Result<[i32; 4], Failed> {
        let right = if self.named_at_end { 62 } else { 14 };
        let mut on = ChartBuilder::on(root);
        on.margin(6)
            .margin_right(right)
            .caption(&self.title, (FONT, TEXT + 2))
            .x_label_area_size(42)
            .y_label_area_size(58);
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
            let style = series.colour.stroke_width(2);
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
            let at = series.points.iter().copied();
            let filled = series.colour.filled();
            match series.mark {
                Mark::None => {}
                Mark::Circle => {
                    drawn.draw_series(at.map(|p| Circle::new(p, 3, filled)))?;
                }
                Mark::Cross => {
                    drawn.draw_series(at.map(|p| Cross::new(p, 3, style)))?;
                }
                Mark::Triangle => {
                    drawn.draw_series(at.map(|p| TriangleMarker::new(p, 4, filled)))?;
                }
                Mark::Square => {
                    let corners = [(-3, -3), (3, 3)];
                    let square = |p| EmptyElement::at(p) + Rectangle::new(corners, filled);
                    drawn.draw_series(at.map(square))?;
                }
            }
        }
        let area = drawn.plotting_area();
        let (x, y) = (area.get_x_axis_pixel_range(), area.get_y_axis_pixel_range());
        let [left, right] = [x.start.min(x.end), x.start.max(x.end)];
        let [top, bottom] = [y.start.min(y.end), y.start.max(y.end)];
        let mut taken: Vec<i32> = Vec::new();
        let named = self.series.iter().filter(|s| !s.name.is_empty());
        for (nth, series) in (0..).zip(named) {
            let style = (FONT, TEXT).into_font().color(&series.colour);
            let style = style.pos(Pos::new(HPos::Left, VPos::Center));
            if self.named_at_end {
                let Some(last) = series.points.last() else {
                    continue;
                };
                let (x, mut y) = area.map_coordinate(last);
                // names do not cover each other, nor what is written below the axis
                let away = if y > (top + bottom) / 2 { -1 } else { 1 };
                while taken.iter().any(|other| (other - y).abs() < TEXT as i32) {
                    y += away;
                }
                taken.push(y);
                root.draw(&Text::new(series.name.clone(), (x + 6, y), style))?;
            } else {
                let name = format!("{} {}", sign(series), series.name);
                root.draw(&Text::new(name, (left + 8, top + 12 + 16 * nth), style))?;
            }
        }
        Ok([left, right, top, bottom])
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

type Root<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// A drawing of this size in px on white paper, and what `draw` says of it.
fn svg<T>(
    title: &str,
    size: (u32, u32),
    draw: impl FnOnce(&Root<'_>) -> Result<T, Failed>,
) -> Result<(String, T), DrawError> {
    let mut svg = String::new();
    let drawn = {
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        let drawn = root.fill(&WHITE).and_then(|()| draw(&root));
        drawn.and_then(|drawn| root.present().map(|()| drawn))
    };
    let drawn = drawn.map_err(|source| DrawError {
        figure: title.to_owned(),
        source,
    })?;
    Ok((svg, drawn))
}

/// What stands before a name in a legend: the colour alone is not enough for every eye.
fn sign(series: &Series) -> &'static str {
    match (series.mark, series.line) {
        (Mark::Circle, _) => "\u{25cf}",
        (Mark::Cross, _) => "\u{d7}",
        (Mark::Triangle, _) => "\u{25b2}",
        (Mark::Square, _) => "\u{25a0}",
        (Mark::None, Some(Line::Dashed)) => "\u{2013} \u{2013}",
        (Mark::None, _) => "\u{2014}",
    }
}

/// A cell of a [`grid`].
pub(crate) struct Tile {
    pub(crate) text: String,
    /// 0 is white, 1 the darkest blue.
    pub(crate) shade: f64,
    /// Greyed out.
    pub(crate) avoided: bool,
    /// With a thick frame.
    pub(crate) framed: bool,
}

/// A table of shaded cells, row by row from the top, with names at the left and below.
///
/// # Errors
/// See [`DrawError`].
pub(crate) fn grid(
    id: &str,
    title: String,
    (x, columns): (&str, &[String]),
    (y, rows): (&str, &[String]),
    tiles: &[&[Tile]],
) -> Result<Figure, DrawError> {
    const LEFT: i32 = 66;
    const TOP: i32 = 30;
    const BELOW: i32 = 46;
    let size = (PANEL.0, PANEL.1 + 20);
    let (width, height) = (size.0 as i32 - LEFT - 10, size.1 as i32 - TOP - BELOW);
    let (svg, ()) = svg(&title, size, |root| {
        let style = |font: FontDesc<'static>, colour: &RGBColor, horizontal| {
            font.color(colour).pos(Pos::new(horizontal, VPos::Center))
        };
        let font = || (FONT, TEXT).into_font();
        let write =
            |text: &str, at: (i32, i32), style| root.draw(&Text::new(text.to_owned(), at, style));
        let middle = |colour| style(font(), colour, HPos::Center);
        let bold = style((FONT, TEXT + 2).into_font(), &BLACK, HPos::Center);
        write(&title, (size.0 as i32 / 2, 14), bold)?;
        write(x, (LEFT + width / 2, size.1 as i32 - 12), middle(&BLACK))?;
        let turned = font().transform(FontTransform::Rotate270);
        write(
            y,
            (12, TOP + height / 2),
            style(turned, &BLACK, HPos::Center),
        )?;
        let column = |c: usize| LEFT + width * c as i32 / columns.len().max(1) as i32;
        let row = |r: usize| TOP + height * r as i32 / rows.len().max(1) as i32;
        for (c, name) in columns.iter().enumerate() {
            let at = ((column(c) + column(c + 1)) / 2, TOP + height + 12);
            write(name, at, middle(&BLACK))?;
        }
        let mut frames = Vec::new();
        for (r, (name, tiles)) in rows.iter().zip(tiles).enumerate() {
            let y = (row(r) + row(r + 1)) / 2;
            write(name, (LEFT - 6, y), style(font(), &BLACK, HPos::Right))?;
            for (c, tile) in tiles.iter().enumerate() {
                let corners = [(column(c), row(r)), (column(c + 1), row(r + 1))];
                let dark = tile.avoided || tile.shade > 0.55;
                let ink = if dark { &WHITE } else { &BLACK };
                let of = |dark: f64| (255.0 - (255.0 - dark) * tile.shade) as u8;
                let fill = if tile.avoided {
                    RGBColor(150, 150, 150)
                } else {
                    RGBColor(of(0.0), of(84.0), of(140.0))
                };
                root.draw(&Rectangle::new(corners, fill.filled()))?;
                root.draw(&Rectangle::new(corners, WHITE.stroke_width(1)))?;
                write(
                    &tile.text,
                    ((corners[0].0 + corners[1].0) / 2, y),
                    middle(ink),
                )?;
                if tile.framed {
                    frames.push(corners);
                }
            }
        }
        for [from, to] in frames {
            let inner = [(from.0 + 2, from.1 + 2), (to.0 - 2, to.1 - 2)];
            root.draw(&Rectangle::new(inner, COLOURS[1].stroke_width(4)))?;
        }
        Ok(())
    })?;
    Ok(Figure {
        id: id.to_owned(),
        title,
        svg,
    })
}

/// Lower ends of the shades of a [`matrix`]: what is less is white.
pub(crate) const SHADES: [f32; 5] = [0.05, 0.2, 0.4, 0.6, 0.8];

/// A symmetric matrix of degrees from 0 to 1 as an image, `title` above it: black is 1. `told` is for those who cannot see it.
///
/// # Errors
/// See [`DrawError`].
pub(crate) fn matrix(
    id: impl Into<String>,
    title: &str,
    told: impl Into<String>,
    axis: &str,
    of: &[Vec<f32>],
) -> Result<Figure, DrawError> {
    let n = of.len() as f64;
    let chart = Chart {
        y_range: (n + 0.5, 0.5),
        size: (PANEL.0, PANEL.0),
        ..Chart::new(title, axis, axis, (0.5, n + 0.5), Vec::new())
    };
    let (svg, area) = svg(title, chart.size, |root| chart.draw(root))?;
    let [left, right, top, bottom] = area.map(f64::from);
    // one path for each shade: 13 689 rectangles would be megabytes
    let mut paths = String::new();
    for (level, least) in SHADES.iter().enumerate() {
        let most = SHADES.get(level + 1).copied().unwrap_or(f32::INFINITY);
        let is = |degree: &f32| (*least..most).contains(degree);
        let mut path = String::new();
        for (r, row) in of.iter().enumerate() {
            let mut c = 0;
            while c < row.len() {
                let run = row[c..].iter().take_while(|degree| is(degree)).count();
                if run > 0 {
                    // in cells; the transformation makes pixels of them
                    let _ = write!(path, "M{c} {r}h{run}v1h-{run}z");
                }
                c += run.max(1);
            }
        }
        let grey = 255 - 51 * (level as u32 + 1);
        if !path.is_empty() {
            let _ = writeln!(
                paths,
                "<path fill=\"rgb({grey},{grey},{grey})\" d=\"{path}\"/>"
            );
        }
    }
    let (width, height) = ((right - left) / n, (bottom - top) / n);
    let image = format!(
        "<g shape-rendering=\"crispEdges\" transform=\"translate({left} {top}) scale({width} {height})\">\n{paths}</g>\n</svg>"
    );
    Ok(Figure {
        id: id.into(),
        title: told.into(),
        svg: svg.replacen("</svg>", &image, 1),
    })
}
