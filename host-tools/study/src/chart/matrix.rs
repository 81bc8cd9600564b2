//! Matrices of degrees as SVG.

use std::fmt::Write as _;

use super::svg::{Figure, WIDTH, figure};
use super::{Chart, Series};

/// Lower ends of the shades of a [`matrix`]: lower degrees are white.
pub(crate) const SHADES: [f32; 5] = [0.05, 0.2, 0.4, 0.6, 0.8];

/// A symmetric matrix of degrees from 0 to 1 as an image, `title` above it: black is 1. `told` is for those who cannot
/// see it.
pub(crate) fn matrix(
    id: impl Into<String>,
    title: &str,
    told: &str,
    axis: &str,
    of: &[Vec<f32>],
) -> anyhow::Result<Figure> {
    let n = of.len() as f64;
    let chart = Chart {
        y_range: (n + 0.5, 0.5),
        size: (WIDTH, WIDTH),
        about: told.to_owned(),
        ..Chart::new(title, axis, axis, (0.5, n + 0.5), Vec::<Series>::new())
    };
    let mut area = [0; 4];
    let mut drawn = figure(id, title, told, chart.size, |root| {
        let (between, tips) = chart.draw(root)?;
        area = between;
        Ok(tips)
    })?;
    let [left, top, right, bottom] = area.map(f64::from);
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
        let share = 0.2 * (level + 1) as f64;
        if !path.is_empty() {
            let _ = writeln!(
                paths,
                "<path fill=\"#000000\" fill-opacity=\"{share:.1}\" d=\"{path}\"/>"
            );
        }
    }
    let (width, height) = ((right - left) / n, (bottom - top) / n);
    drawn.add(&format!(
        "<g shape-rendering=\"crispEdges\" transform=\"translate({left} {top}) scale({width} \
         {height})\">\n{paths}</g>\n"
    ));
    Ok(drawn)
}
