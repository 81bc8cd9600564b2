//! Charts and matrices as SVG: how they are drawn, whatever they show.

use std::fmt::Write as _;

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Colours that differ for every eye (Okabe & Ito), without the yellow, which is too light for white paper.
pub(super) const COLOURS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
    RGBColor(0, 0, 0),
];
/// For what is only there for comparison.
pub(super) const GREY: RGBColor = RGBColor(110, 110, 110);
/// Height of the letters, px.
const TEXT: u32 = 13;
const FONT: &str = "sans-serif";

/// What stands at a point.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) enum Mark {
    /// Nothing: only the line.
    None,
    Circle,
    Cross,
    Triangle,
    Square,
}

/// Points of one kind.
pub(super) struct Series {
    /// Written at the last point, or in the legend; empty for none.
    pub(super) name: String,
    pub(super) colour: RGBColor,
    pub(super) mark: Mark,
    /// Whether a line joins them; dashed if they are only there for comparison.
    pub(super) line: Option<Line>,
    pub(super) points: Vec<(f64, f64)>,
}

#[derive(Clone, Copy, PartialEq)]
pub(super) enum Line {
    Whole,
    Dashed,
}

/// A chart.
pub(super) struct Chart<'a> {
    pub(super) title: String,
    /// What an axis shows, with its unit.
    pub(super) x: &'a str,
    pub(super) y: &'a str,
    pub(super) x_range: (f64, f64),
    pub(super) y_range: (f64, f64),
    /// Number of marks on the x axis, and what stands there.
    pub(super) x_marks: usize,
    pub(super) x_text: &'a dyn Fn(f64) -> String,
    /// Names at the ends of the lines rather than in a legend.
    pub(super) named_at_end: bool,
    pub(super) size: (u32, u32),
    pub(super) series: Vec<Series>,
}

/// Of one panel, px.
pub(super) const PANEL: (u32, u32) = (440, 320);

/// Why a figure was not drawn; drawing into a string does not fail, but the library says it might.
#[derive(Debug, thiserror::Error)]
#[error("a figure cannot be drawn: {0}")]
pub struct DrawError(String);

impl<E: std::error::Error + Send + Sync> From<DrawingAreaErrorKind<E>> for DrawError {
    fn from(why: DrawingAreaErrorKind<E>) -> Self {
        Self(why.to_string())
    }
}

/// Range that holds all values, with a little room.
pub(super) fn room(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = values
        .filter(|v| v.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
            (l.min(v), h.max(v))
        });
    if low > high {
        return (0.0, 1.0);
    }
    let room = (0.06 * (high - low)).max(1e-6);
    (low - room, high + room)
}

/// A number for an axis.
pub(super) fn plain(value: f64) -> String {
    let rounded = (value * 1e6).round() / 1e6;
    format!("{}", rounded + 0.0)
}

/// Draws curves over the same x as SVG, each with its name: for what is measured outside of a study.
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
    let looks = COLOURS.into_iter().zip(marks).cycle();
    let series = curves.iter().zip(looks);
    let series = series.map(|((name, points), (colour, mark))| Series {
        name: (*name).to_owned(),
        colour,
        mark,
        line: Some(Line::Whole),
        points: points.clone(),
    });
    let all = || curves.iter().flat_map(|(_, points)| points);
    chart(&Chart {
        title: title.to_owned(),
        x,
        y,
        x_range: room(all().map(|(x, _)| *x)),
        y_range: room(all().map(|(_, y)| *y)),
        x_marks: 6,
        x_text: &plain,
        named_at_end: false,
        size: (640, 400),
        series: series.collect(),
    })
}

/// Draws a chart.
pub(super) fn chart(chart: &Chart<'_>) -> Result<String, DrawError> {
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, chart.size).into_drawing_area();
        root.fill(&WHITE)?;
        let right = if chart.named_at_end { 62 } else { 14 };
        let mut on = ChartBuilder::on(&root);
        on.margin(6)
            .margin_right(right)
            .caption(&chart.title, (FONT, TEXT + 2))
            .x_label_area_size(42)
            .y_label_area_size(58);
        let mut drawn = on.build_cartesian_2d(
            chart.x_range.0..chart.x_range.1,
            chart.y_range.0..chart.y_range.1,
        )?;
        drawn
            .configure_mesh()
            .x_desc(chart.x)
            .y_desc(chart.y)
            .x_labels(chart.x_marks)
            .y_labels(6)
            .x_label_formatter(&|x| (chart.x_text)(*x))
            .y_label_formatter(&|y| plain(*y))
            .light_line_style(TRANSPARENT)
            .bold_line_style(BLACK.mix(0.12))
            .label_style((FONT, TEXT))
            .axis_desc_style((FONT, TEXT))
            .draw()?;
        for series in &chart.series {
            let points = series.points.clone();
            match series.line {
                Some(Line::Whole) => {
                    let style = series.colour.stroke_width(2);
                    drawn.draw_series([PathElement::new(points, style)])?;
                }
                Some(Line::Dashed) => {
                    let style = series.colour.stroke_width(2);
                    let dashes = points
                        .windows(2)
                        .flat_map(|ends| dashes(ends[0], ends[1], chart));
                    drawn.draw_series(dashes.map(|dash| PathElement::new(dash, style)))?;
                }
                None => {}
            }
            let at = series.points.iter().copied();
            let (colour, filled) = (series.colour, series.colour.filled());
            match series.mark {
                Mark::None => {}
                Mark::Circle => {
                    drawn.draw_series(at.map(|p| Circle::new(p, 3, filled)))?;
                }
                Mark::Cross => {
                    drawn.draw_series(at.map(|p| Cross::new(p, 3, colour.stroke_width(2))))?;
                }
                Mark::Triangle => {
                    drawn.draw_series(at.map(|p| TriangleMarker::new(p, 4, filled)))?;
                }
                Mark::Square => {
                    let square =
                        |p| EmptyElement::at(p) + Rectangle::new([(-3, -3), (3, 3)], filled);
                    drawn.draw_series(at.map(square))?;
                }
            }
        }
        let area = drawn.plotting_area();
        let mut taken: Vec<i32> = Vec::new();
        for (nth, series) in chart
            .series
            .iter()
            .filter(|s| !s.name.is_empty())
            .enumerate()
        {
            let style = (FONT, TEXT).into_font().color(&series.colour);
            if chart.named_at_end {
                let Some(last) = series.points.last() else {
                    continue;
                };
                let style = style.pos(Pos::new(HPos::Left, VPos::Center));
                let (x, mut y) = area.map_coordinate(last);
                // names do not cover each other, nor what is written below the axis
                let (top, bottom) = area.get_y_axis_pixel_range().into_pair();
                let away = if y > (top + bottom) / 2 { -1 } else { 1 };
                while taken.iter().any(|other| (other - y).abs() < TEXT as i32) {
                    y += away;
                }
                taken.push(y);
                root.draw(&Text::new(series.name.clone(), (x + 6, y), style))?;
            } else {
                let (x, _) = area.get_x_axis_pixel_range().into_pair();
                let (top, _) = area.get_y_axis_pixel_range().into_pair();
                let style = style.pos(Pos::new(HPos::Left, VPos::Center));
                let y = top + 12 + 16 * nth as i32;
                root.draw(&Text::new(
                    format!("{} {}", sign(series), series.name),
                    (x + 8, y),
                    style,
                ))?;
            }
        }
        root.present()?;
    }
    Ok(svg)
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

trait IntoPair {
    fn into_pair(self) -> (i32, i32);
}

impl IntoPair for std::ops::Range<i32> {
    fn into_pair(self) -> (i32, i32) {
        (self.start.min(self.end), self.start.max(self.end))
    }
}

/// Cuts a line into dashes of about a 60th of the chart.
fn dashes(from: (f64, f64), to: (f64, f64), chart: &Chart<'_>) -> Vec<Vec<(f64, f64)>> {
    let part = |a: f64, b: f64, range: (f64, f64)| ((b - a) / (range.1 - range.0)).abs();
    let length = part(from.0, to.0, chart.x_range).max(part(from.1, to.1, chart.y_range));
    let dashes = ((60.0 * length).ceil() as usize).max(1);
    let at = |share: f64| {
        let between = |a: f64, b: f64| a + (b - a) * share;
        (between(from.0, to.0), between(from.1, to.1))
    };
    (0..dashes)
        .step_by(2)
        .map(|d| {
            let [begin, end] = [d, d + 1].map(|d| at((d as f64 / dashes as f64).min(1.0)));
            vec![begin, end]
        })
        .collect()
}

/// A cell of a [`grid`].
pub(super) struct Tile {
    pub(super) text: String,
    /// 0 is white, 1 the darkest blue.
    pub(super) shade: f64,
    /// Greyed out.
    pub(super) avoided: bool,
    /// With a thick frame.
    pub(super) framed: bool,
}

/// A table of shaded cells, row by row from the top, with names at the left and below.
pub(super) fn grid(
    title: &str,
    (x, columns): (&str, &[String]),
    (y, rows): (&str, &[String]),
    tiles: &[Vec<Tile>],
) -> Result<String, DrawError> {
    const LEFT: i32 = 66;
    const TOP: i32 = 30;
    const BELOW: i32 = 46;
    let size = (PANEL.0, PANEL.1 + 20);
    let (width, height) = (size.0 as i32 - LEFT - 10, size.1 as i32 - TOP - BELOW);
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        root.fill(&WHITE)?;
        let text = |colour: &RGBColor, horizontal, vertical| {
            let style = (FONT, TEXT).into_font().color(colour);
            style.pos(Pos::new(horizontal, vertical))
        };
        let middle = text(&BLACK, HPos::Center, VPos::Center);
        let at = (size.0 as i32 / 2, 14);
        let bold = (FONT, TEXT + 2).into_font().color(&BLACK);
        let bold = bold.pos(Pos::new(HPos::Center, VPos::Center));
        root.draw(&Text::new(title.to_owned(), at, bold))?;
        let below = (LEFT + width / 2, size.1 as i32 - 12);
        root.draw(&Text::new(x.to_owned(), below, middle.clone()))?;
        let turned = (FONT, TEXT).into_font().transform(FontTransform::Rotate270);
        let turned = turned
            .color(&BLACK)
            .pos(Pos::new(HPos::Center, VPos::Center));
        root.draw(&Text::new(y.to_owned(), (12, TOP + height / 2), turned))?;
        let column = |c: usize| LEFT + width * c as i32 / columns.len().max(1) as i32;
        let row = |r: usize| TOP + height * r as i32 / rows.len().max(1) as i32;
        for (c, name) in columns.iter().enumerate() {
            let at = ((column(c) + column(c + 1)) / 2, TOP + height + 12);
            root.draw(&Text::new(name.clone(), at, middle.clone()))?;
        }
        let mut frames = Vec::new();
        for (r, (name, tiles)) in rows.iter().zip(tiles).enumerate() {
            let at = (LEFT - 6, (row(r) + row(r + 1)) / 2);
            root.draw(&Text::new(
                name.clone(),
                at,
                text(&BLACK, HPos::Right, VPos::Center),
            ))?;
            for (c, tile) in tiles.iter().enumerate() {
                let corners = [(column(c), row(r)), (column(c + 1), row(r + 1))];
                let (fill, ink) = if tile.avoided {
                    (RGBColor(150, 150, 150), WHITE)
                } else {
                    let of = |dark: f64| (255.0 - (255.0 - dark) * tile.shade) as u8;
                    let ink = if tile.shade > 0.55 { WHITE } else { BLACK };
                    (RGBColor(of(0.0), of(84.0), of(140.0)), ink)
                };
                root.draw(&Rectangle::new(corners, fill.filled()))?;
                root.draw(&Rectangle::new(corners, WHITE.stroke_width(1)))?;
                let at = (
                    (corners[0].0 + corners[1].0) / 2,
                    (corners[0].1 + corners[1].1) / 2,
                );
                root.draw(&Text::new(
                    tile.text.clone(),
                    at,
                    text(&ink, HPos::Center, VPos::Center),
                ))?;
                if tile.framed {
                    frames.push(corners);
                }
            }
        }
        for [from, to] in frames {
            let inner = [(from.0 + 2, from.1 + 2), (to.0 - 2, to.1 - 2)];
            root.draw(&Rectangle::new(inner, COLOURS[1].stroke_width(4)))?;
        }
        root.present()?;
    }
    Ok(svg)
}

/// Lower ends of the shades of a [`matrix`]: what is less is white.
pub(super) const SHADES: [f32; 5] = [0.05, 0.2, 0.4, 0.6, 0.8];

/// A symmetric matrix of degrees from 0 to 1 as an image: black is 1.
pub(super) fn matrix(title: &str, axis: &str, of: &[Vec<f32>]) -> Result<String, DrawError> {
    let size = (PANEL.0, PANEL.0);
    let n = of.len() as f64;
    let mut svg = String::new();
    let (left, right, top, bottom) = {
        let root = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        root.fill(&WHITE)?;
        let mut on = ChartBuilder::on(&root);
        on.margin(6)
            .margin_right(14)
            .caption(title, (FONT, TEXT + 2))
            .x_label_area_size(42)
            .y_label_area_size(58);
        let mut drawn = on.build_cartesian_2d(0.5..n + 0.5, n + 0.5..0.5)?;
        drawn
            .configure_mesh()
            .x_desc(axis)
            .y_desc(axis)
            .x_labels(6)
            .y_labels(6)
            .x_label_formatter(&|x| plain(*x))
            .y_label_formatter(&|y| plain(*y))
            .disable_mesh()
            .label_style((FONT, TEXT))
            .axis_desc_style((FONT, TEXT))
            .draw()?;
        let area = drawn.plotting_area();
        let (left, right) = area.get_x_axis_pixel_range().into_pair();
        let (top, bottom) = area.get_y_axis_pixel_range().into_pair();
        root.present()?;
        (
            f64::from(left),
            f64::from(right),
            f64::from(top),
            f64::from(bottom),
        )
    };
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
    Ok(svg.replacen("</svg>", &image, 1))
}
