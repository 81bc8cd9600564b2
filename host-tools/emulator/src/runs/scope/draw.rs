//! Traces as SVG: a row for each pin, a time axis, and durations as dimension lines with their figures.

use std::fmt::Write as _;

/// A duration that is written into a picture.
#[derive(Clone, PartialEq, Debug)]
pub struct Span {
    /// What it is, in a few words.
    pub what: &'static str,
    /// Row below which it is drawn.
    pub row: usize,
    /// From, to, ns.
    pub from_to_ns: (f64, f64),
}

impl Span {
    /// Its length, s.
    pub fn seconds(&self) -> f64 {
        (self.from_to_ns.1 - self.from_to_ns.0) * 1e-9
    }
}

/// What one pin does.
#[derive(Clone, Debug, Default)]
pub struct Row {
    /// Signal and pin.
    pub name: String,
    /// Times, ns, and levels from 0 to 1, joined by lines.
    pub line: Vec<(f64, f64)>,
    /// Times from, to, ns, in which it changes faster than can be drawn.
    pub bursts: Vec<(f64, f64)>,
    /// Times, ns, and levels of single readings.
    pub dots: Vec<(f64, f64)>,
}

impl Row {
    /// A row of levels: the first one holds from the beginning, the last one until the end.
    pub fn levels(name: &str, before: bool, edges: &[(f64, bool)], from_to_ns: (f64, f64)) -> Self {
        let level = |high: bool| f64::from(u8::from(high));
        let mut now = level(before);
        let mut line = vec![(from_to_ns.0, now)];
        for (at_ns, high) in edges {
            line.push((*at_ns, now));
            now = level(*high);
            line.push((*at_ns, now));
        }
        line.push((from_to_ns.1, now));
        Self {
            name: name.to_owned(),
            line,
            ..Self::default()
        }
    }
}

/// A picture.
#[derive(Clone, Debug)]
pub struct Picture {
    /// Its file.
    pub file: &'static str,
    /// What it shows.
    pub title: String,
    /// Where the time axis begins and ends, ns; 0 is the trigger.
    pub from_to_ns: (f64, f64),
    /// Its rows.
    pub rows: Vec<Row>,
    /// Durations.
    pub spans: Vec<Span>,
}

const WIDTH: f64 = 720.0;
const LEFT: f64 = 104.0;
const RIGHT: f64 = 16.0;
const TOP: f64 = 32.0;
const HIGH: f64 = 20.0;
/// Of a row, and of each duration below it.
const ROW: f64 = 32.0;
const DIMENSION: f64 = 15.0;
/// Width of a letter of the durations' figures.
const LETTER: f64 = 5.6;

impl Picture {
    /// The duration of this name, s.
    pub fn seconds(&self, what: &str) -> Option<f64> {
        let span = self.spans.iter().find(|span| span.what == what);
        span.map(Span::seconds)
    }

    fn x(&self, at_ns: f64) -> f64 {
        let (from, to) = self.from_to_ns;
        LEFT + (at_ns - from) / (to - from) * (WIDTH - LEFT - RIGHT)
    }

    /// As SVG.
    pub fn svg(&self) -> String {
        let rows = self.rows.len() as f64;
        let bottom = TOP + rows * ROW + self.spans.len() as f64 * DIMENSION;
        let height = bottom + 24.0;
        let title = &self.title;
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" font-family=\"sans-serif\" font-size=\"12\">\n\
             <title>{title}</title>\n<style>.t{{stroke:#0072B2;fill:none}}.b{{fill:#0072B2;fill-opacity:.5}}.d{{stroke:#B34700}}.n{{fill:#B34700;font-size:10px;stroke:#fff;stroke-width:7px;paint-order:stroke}}.g{{stroke:#ddd}}.a{{font-size:10px;text-anchor:middle}}</style>\n\
             <rect width=\"{WIDTH}\" height=\"{height}\" fill=\"#fff\"/>\n<text x=\"8\" y=\"18\">{title}</text>\n"
        );
        self.axis(bottom, &mut svg);
        let mut top = TOP;
        for (row, index) in self.rows.iter().zip(0..) {
            let low = top + HIGH + 6.0;
            self.row(row, low, &mut svg);
            top += ROW;
            for span in self.spans.iter().filter(|span| span.row == index) {
                self.dimension(span, top + 4.0, &mut svg);
                top += DIMENSION;
            }
        }
        svg + "</svg>\n"
    }

    fn axis(&self, bottom: f64, svg: &mut String) {
        let (from, to) = self.from_to_ns;
        let (unit, unit_ns) = unit(to - from);
        let steps = (0..9).flat_map(|power| {
            [1.0, 2.0, 5.0].map(|first: f64| first * 10.0_f64.powi(power - 2) * unit_ns)
        });
        let mut steps = steps.filter(|step| (to - from) / step <= 12.0);
        let step = steps.next().unwrap_or(to - from);
        let (first, last) = ((from / step).ceil() as i64, (to / step).floor() as i64);
        for tick in first..=last {
            let at_ns = tick as f64 * step;
            let x = self.x(at_ns);
            // 0.3 and not 0.30000000000000004
            let said = (at_ns / unit_ns * 100.0).round() / 100.0;
            let y = bottom + 14.0;
            // writing to a string does not fail
            let _ = writeln!(
                svg,
                "<path class=\"g\" d=\"M{x:.1} {TOP}V{bottom}\"/><text class=\"a\" x=\"{x:.1}\" y=\"{y}\">{said}</text>"
            );
        }
        let _ = writeln!(svg, "<text x=\"8\" y=\"{}\">{unit}</text>", bottom + 14.0);
    }

    fn row(&self, row: &Row, low: f64, svg: &mut String) {
        let y = |level: f64| low - level * HIGH;
        let _ = writeln!(
            svg,
            "<text x=\"8\" y=\"{:.0}\">{}</text>",
            low - 6.0,
            row.name
        );
        let mut path = String::new();
        let mut pen = None;
        for (at_ns, level) in &row.line {
            let (x, y) = (
                format!("{:.1}", self.x(*at_ns)),
                format!("{:.1}", y(*level)),
            );
            let _ = match &pen {
                None => write!(path, "M{x} {y}"),
                Some((last, _)) if *last == x => write!(path, "V{y}"),
                Some((_, last)) if *last == y => write!(path, "H{x}"),
                Some(_) => write!(path, "L{x} {y}"),
            };
            pen = Some((x, y));
        }
        let _ = writeln!(svg, "<path class=\"t\" d=\"{path}\"/>");
        for (from, to) in &row.bursts {
            let (x, wide) = (self.x(*from), self.x(*to) - self.x(*from));
            let _ = writeln!(
                svg,
                "<rect class=\"b\" x=\"{x:.1}\" y=\"{:.1}\" width=\"{wide:.1}\" height=\"{HIGH}\"/>",
                y(1.0)
            );
        }
        for (at_ns, level) in &row.dots {
            let _ = writeln!(
                svg,
                "<circle class=\"b\" cx=\"{:.1}\" cy=\"{:.1}\" r=\"2.5\"/>",
                self.x(*at_ns),
                y(*level)
            );
        }
    }

    fn dimension(&self, span: &Span, y: f64, svg: &mut String) {
        let (from, to) = (self.x(span.from_to_ns.0), self.x(span.from_to_ns.1));
        let said = format!("{} {}", span.what, duration(span.seconds() * 1e9));
        let (up, down) = (y - 4.0, y + 4.0);
        let _ = write!(
            svg,
            "<path class=\"d\" d=\"M{from:.1} {up}V{down}M{from:.1} {y}H{to:.1}M{to:.1} {up}V{down}\"/>"
        );
        let wide = LETTER * said.len() as f64;
        // within it, to the right of it, or to the left where there is no room
        let (x, anchor) = if to - from > wide + 16.0 {
            (from.midpoint(to), " text-anchor=\"middle\"")
        } else if to + 6.0 + wide > WIDTH {
            (from - 5.0, " text-anchor=\"end\"")
        } else {
            (to + 5.0, "")
        };
        let _ = writeln!(
            svg,
            "<text class=\"n\" x=\"{x:.1}\" y=\"{:.1}\"{anchor}>{said}</text>",
            y + 3.5
        );
    }
}

/// A unit for lengths up to this one, and how many ns it has.
fn unit(length_ns: f64) -> (&'static str, f64) {
    match length_ns {
        1e6.. => ("ms", 1e6),
        _ => ("us", 1e3),
    }
}

/// A duration with three digits.
fn duration(ns: f64) -> String {
    let (unit, unit_ns) = unit(ns);
    let value = ns / unit_ns;
    let digits = match value {
        100.0.. => 0,
        10.0.. => 1,
        _ => 2,
    };
    format!("{value:.digits$} {unit}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_says_its_durations_and_its_axis() {
        let window = (-1e3, 9e3);
        let picture = Picture {
            file: "x.svg",
            title: "pulses".to_owned(),
            from_to_ns: window,
            rows: vec![Row::levels(
                "STEP PE9",
                false,
                &[(0.0, true), (5e3, false)],
                window,
            )],
            spans: vec![Span {
                what: "high",
                row: 0,
                from_to_ns: (0.0, 5e3),
            }],
        };
        assert_eq!(picture.seconds("high"), Some(5e-6));
        let svg = picture.svg();
        for part in ["high 5.00 us", ">us<", ">9<", "STEP PE9", "pulses"] {
            assert!(svg.contains(part), "{part}: {svg}");
        }
        // a wave of two edges: down, up, along, down, along
        assert!(
            svg.contains("d=\"M104.0 58.0H164.0V38.0H464.0V58.0H704.0\""),
            "{svg}"
        );
        assert_eq!(duration(312_500.0), "312 us");
        assert_eq!(duration(10_250_000.0), "10.2 ms");
    }
}
