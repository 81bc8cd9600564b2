//! Picture of an exploration: the course of the posterior.

use tactus_core::table::{Action, Table};
use tactus_core::wire::Event;

use crate::chart::{Chart, Figure, MARKS, Series};

/// Textures that were never more probable than this have no line of their own.
const LIKELY: f32 = 0.05;
const MOST: usize = 6;

struct Counted {
    action: Action,
    /// of every texture of the table
    posterior: Vec<f32>,
}

/// The slides of an exploration that counted, as they come.
pub struct Exploration<'t> {
    table: Table<'t>,
    slides: Vec<Counted>,
}

impl<'t> Exploration<'t> {
    /// One with this table, of which nothing has happened yet.
    pub fn new(table: Table<'t>) -> Self {
        Self {
            table,
            slides: Vec::new(),
        }
    }

    /// Its table.
    pub fn table(&self) -> Table<'t> {
        self.table
    }

    /// Takes an event of it; ignores any other.
    pub fn event(&mut self, event: &Event) {
        if let Event::SlideReport {
            action, posterior, ..
        } = event
        {
            self.slides.push(Counted {
                action: *action,
                posterior: posterior.to_vec(),
            });
        }
    }

    /// Its picture; none, if no slide counted.
    pub fn figures(&self, threshold: f32) -> anyhow::Result<Vec<Figure>> {
        match self.slides.is_empty() {
            true => Ok(Vec::new()),
            false => Ok(vec![self.posterior(threshold)?]),
        }
    }

    /// The textures, the most probable one at the end first, and how probable they are.
    fn best(&self) -> Vec<(u16, f32)> {
        let last = self.slides.last();
        let posterior = last.map_or(&[][..], |slide| &slide.posterior);
        let mut best: Vec<(u16, f32)> = (0..).zip(posterior.iter().copied()).collect();
        best.sort_by(|a, b| b.1.total_cmp(&a.1));
        best
    }

    fn posterior(&self, threshold: f32) -> anyhow::Result<Figure> {
        let slides = self.slides.len() as f64;
        let prior = 1.0 / f64::from(self.table.textures().max(1));
        let of = |texture: u16| {
            let after = self.slides.iter();
            after.map(move |s| {
                s.posterior
                    .get(usize::from(texture))
                    .copied()
                    .unwrap_or(0.0)
            })
        };
        let most = |texture: u16| of(texture).fold(0.0, f32::max);
        let likely = self.best().into_iter().filter(|&(t, _)| most(t) >= LIKELY);
        let shown: Vec<u16> = likely.map(|(texture, _)| texture).take(MOST).collect();
        let mut series = Vec::new();
        for (n, &texture) in shown.iter().enumerate() {
            let name = self.table.name(texture).unwrap_or("?");
            let after = of(texture).map(|p| 100.0 * f64::from(p));
            let after: Vec<f64> = std::iter::once(100.0 * prior).chain(after).collect();
            let says = (0..).zip(&after).map(|(slide, p)| match slide {
                0 => format!("{name}: {p:.2} % before the first slide"),
                n => format!("{name}: {p:.2} % after slide {n}"),
            });
            let says = says.collect();
            let points = (0..).map(f64::from).zip(after).collect();
            series.push(Series {
                says,
                ..Series::curve(n, MARKS[n % MARKS.len()], name, points)
            });
        }
        let limit = 100.0 * f64::from(threshold);
        let ends = vec![(0.0, limit), (slides, limit)];
        series.push(Series::dashed("threshold", ends));
        let step = |x: f64| {
            let at = x.round() as usize;
            if at == 0 {
                return "start".to_owned();
            }
            let slide = self.slides.get(at - 1);
            match slide.map(|slide| slide.action) {
                Some(Action {
                    movement,
                    property: Some(property),
                }) => {
                    format!("M{} {}", movement + 1, property.name()[..1].to_uppercase())
                }
                Some(Action {
                    movement,
                    property: None,
                }) => format!("M{}", movement + 1),
                None => String::new(),
            }
        };
        let properties = self.slides.iter().any(|s| s.action.property.is_some());
        let mut made: Vec<u8> = self.slides.iter().map(|s| s.action.movement).collect();
        made.sort_unstable();
        made.dedup();
        let made = made
            .iter()
            .filter_map(|&m| Some(format!("M{}: {}", m + 1, self.table.movement(m)?)));
        let mut below = made.collect::<Vec<_>>().join("; ");
        below.push('.');
        if properties {
            below += " Looked at: T traction, R roughness, F fineness.";
        }
        Chart {
            y_range: (0.0, 104.0),
            x_marks: self.slides.len() + 1,
            x_text: &step,
            below: &below,
            size: (crate::chart::WIDTH, 400),
            ..Chart::new(
                "How probable each texture was",
                "slide",
                "posterior probability (%)",
                (-0.1, slides + 0.1),
                series,
            )
        }
        .figure("posterior")
    }
}
