//! What `tactus evaluate --lifelong --plot` draws: how slides move away from what was learned while a session goes on, and what
//! is told of them.

use crate::chart::{Chart, DrawError, Figure, MARKS, Series};
use tactus_lab::eval::lifelong::{Learning, Lifelong, Moment};

/// Textures that have a line of their own.
const FARTHEST: usize = 4;

/// What a curve is called, its colour, and its share.
type Curve = (&'static str, usize, fn(&Moment) -> f64);

const TOLD: [Curve; 5] = [
    ("right name, as sure", 0, |m| m.verdicts.right),
    ("wrong name, as sure", 1, |m| m.verdicts.wrong),
    ("none of those known", 2, |m| m.verdicts.new),
    ("changed", 3, |m| m.verdicts.changed),
    ("undecided", 4, |m| m.verdicts.undecided),
];

/// How far slides are from what was learned, of all textures and of those that went farthest; and what is told, a picture
/// for each way of learning. `train_slides` of each texture and movement were learned from.
///
/// # Errors
/// See [`DrawError`].
pub fn figures(lives: &[Lifelong], train_slides: usize) -> Result<Vec<Figure>, DrawError> {
    let mut figures = vec![distances(lives, train_slides)?];
    let nothing = lives.iter().find(|life| life.learning == Learning::None);
    figures.extend(nothing.map(farthest).transpose()?);
    for life in lives {
        figures.push(told(life)?);
    }
    Ok(figures)
}

/// A curve over the slides of a session, of which each point says its number.
fn curve(
    colour: usize,
    name: &str,
    points: impl Iterator<Item = (usize, f64)>,
    says: impl Fn(usize, f64) -> String,
) -> Series {
    let mut series = Series::curve(colour, MARKS[colour % MARKS.len()], name, Vec::new());
    for (slide, y) in points {
        series.points.push((slide as f64, y));
        series.says.push(says(slide, y));
    }
    series
}

fn chart<'a>(title: &str, y: &'a str, top: f64, slides: usize, series: Vec<Series>) -> Chart<'a> {
    Chart {
        y_range: (0.0, top),
        x_marks: slides.clamp(1, 8),
        x_text: &whole,
        ..Chart::new(
            title,
            "slide of a texture, after those it was learned from",
            y,
            (0.5, slides as f64 + 0.5),
            series,
        )
    }
}

/// The number of a slide; nothing between two of them.
fn whole(x: f64) -> String {
    if (x - x.round()).abs() < 1e-6 {
        format!("{x:.0}")
    } else {
        String::new()
    }
}

/// A little more than the highest point.
fn top(series: &[Series]) -> f64 {
    let points = series.iter().flat_map(|s| &s.points);
    1.1 * points.map(|p| p.1).fold(1.5, f64::max)
}

const APART: &str = "distance (standard deviations)";
const BELOW: &str =
    "Root mean square over features. Dashed: what slides that do not drift would give.";

fn distances(lives: &[Lifelong], train_slides: usize) -> Result<Figure, DrawError> {
    let mut series: Vec<Series> = (0..)
        .zip(lives)
        .map(|(n, life)| {
            let name = life.learning.words();
            let points = life.over_time.iter().map(|m| (m.slide, m.distance_sd));
            curve(n, name, points, |slide, y| {
                format!("{name}, slide {slide}: {y:.2} standard deviations")
            })
        })
        .collect();
    let slides = lives.iter().map(|l| l.over_time.len()).max().unwrap_or(0);
    // of a slide about the mean of those that were learned from
    let still = (1.0 + 1.0 / train_slides.max(1) as f64).sqrt();
    let ends = vec![(0.5, still), (slides as f64 + 0.5, still)];
    let top = top(&series);
    series.push(Series::dashed("", ends));
    Chart {
        below: BELOW,
        ..chart(
            "How far slides are from what the table says",
            APART,
            top,
            slides,
            series,
        )
    }
    .figure("drift")
}

/// The textures that are farthest away in the last third of the session, while nothing is learned.
fn farthest(life: &Lifelong) -> Result<Figure, DrawError> {
    let late = |of: &[f64]| {
        let late = &of[of.len() - of.len().div_ceil(3)..];
        late.iter().sum::<f64>() / late.len().max(1) as f64
    };
    let mut textures: Vec<_> = life.by_texture.iter().collect();
    textures.sort_by(|a, b| late(&b.distance_sd).total_cmp(&late(&a.distance_sd)));
    let shown = textures.iter().take(FARTHEST).enumerate();
    let mut series: Vec<Series> = shown
        .map(|(n, of)| {
            let name = &of.texture;
            let points = (1..).zip(of.distance_sd.iter().copied());
            curve(n, name, points, |slide, y| {
                format!("{name}, slide {slide}: {y:.2} standard deviations")
            })
        })
        .collect();
    let all = life.over_time.iter();
    let all: Vec<(f64, f64)> = all.map(|m| (m.slide as f64, m.distance_sd)).collect();
    let slides = all.len();
    let top = top(&series);
    series.push(Series::dashed("all textures", all));
    chart(
        "The textures that went farthest, nothing learned",
        APART,
        top,
        slides,
        series,
    )
    .figure("drift-by-texture")
}

fn told(life: &Lifelong) -> Result<Figure, DrawError> {
    let series = TOLD.map(|(name, colour, share)| {
        let points = life.over_time.iter().map(|m| (m.slide, 100.0 * share(m)));
        curve(colour, name, points, |slide, y| {
            format!("slide {slide}: {y:.1} % {name}")
        })
    });
    let (id, who) = match life.learning {
        Learning::None => ("told-without-learning", "nothing is learned"),
        Learning::Itself => ("told-learning-by-itself", "it learns by itself"),
        Learning::Asking => ("told-asking", "it asks where it is uncertain"),
    };
    chart(
        &format!("What is told after one slide, while {who}"),
        "episodes (%)",
        104.0,
        life.over_time.len(),
        series.into(),
    )
    .figure(id)
}
