//! The stage's quadrature encoder: two lines in Gray code, A before B towards higher positions, and the reading of a
//! counter on them, also with a wire cut.

use std::collections::VecDeque;

/// Counts per mm: 1 um per count, all four edges counted (chosen).
pub const COUNTS_PER_MM: f64 = 1e3;

/// A wire of the encoder that is cut. The counter's pull-down holds its input low.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Cut {
    /// Line A: the count moves to and fro by one.
    A,
    /// Line B: likewise.
    B,
    /// Both, or the supply: the count stands.
    Both,
}

/// The lines from this instant on.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Edge {
    /// Its time, ns.
    pub at_ns: u64,
    /// Line A.
    pub a: bool,
    /// Line B.
    pub b: bool,
}

/// Encoder and counter. The count is 0 where the stage stood at power-up: there is no index.
#[derive(Clone, Debug)]
pub struct Encoder {
    origin: f64,
    cut: Option<Cut>,
    /// lines A and B are exchanged
    swapped: bool,
    /// counts of a mm
    per_mm: f64,
    /// count - [`Encoder::followed`]
    offset: i64,
    /// counts, the times when they were reached and the levels of the lines then, if edges are kept
    passed: Option<VecDeque<(i64, Edge)>>,
    shown: (bool, bool),
}

impl Encoder {
    /// An encoder that is switched on at a position. With `edges`, each edge is kept until it is fetched.
    pub fn new(position_mm: f64, edges: bool) -> Self {
        Self {
            origin: (position_mm * COUNTS_PER_MM).floor(),
            cut: None,
            swapped: false,
            per_mm: COUNTS_PER_MM,
            offset: 0,
            passed: edges.then(VecDeque::new),
            shown: lines(0, None),
        }
    }

    /// The stage went from one position to another at constant speed, from `began_ns` to `ended_ns`.
    pub fn pass(&mut self, [from_mm, to_mm]: [f64; 2], [began_ns, ended_ns]: [u64; 2]) {
        let (from, to) = (self.counts(from_mm), self.counts(to_mm));
        let Some(passed) = &mut self.passed else {
            return;
        };
        let wires = (self.cut, self.swapped);
        let mut pass = |count: i64, boundary: i64| {
            let at_mm = (boundary as f64 + self.origin) / self.per_mm;
            let share = ((at_mm - from_mm) / (to_mm - from_mm)).clamp(0.0, 1.0);
            let at_ns = began_ns + (share * (ended_ns - began_ns) as f64) as u64;
            passed.push_back((count, edge(at_ns, count, wires)));
        };
        if to > from {
            (from + 1..=to).for_each(|count| pass(count, count));
        } else {
            (to..from).rev().for_each(|count| pass(count, count + 1));
        }
    }

    /// Reading of the counter with the stage at a position.
    pub fn count(&self, position_mm: f64) -> i32 {
        let followed = followed(self.counts(position_mm), self.cut);
        (self.offset + if self.swapped { -followed } else { followed }) as i32
    }

    /// An encoder of this share of the lines, with the stage at a position where it counts 0.
    pub(crate) fn set_lines(&mut self, share: f64, position_mm: f64) {
        self.per_mm = COUNTS_PER_MM * share;
        self.origin = (position_mm * self.per_mm).floor();
    }

    /// Returns true for each of the lines A and B that is driven at the chip.
    pub(crate) fn is_wired(&self) -> (bool, bool) {
        let cut = |line| self.cut == Some(line) || self.cut == Some(Cut::Both);
        (!cut(Cut::A), !cut(Cut::B))
    }

    /// Exchanges lines A and B, or puts them right, at a time with the stage at a position. Edges of that tick that are
    /// yet to come are changed.
    pub fn swap(&mut self, swapped: bool, position_mm: f64, now_ns: u64) {
        if swapped == self.swapped {
            return;
        }
        // two lines at once are nothing to a counter
        let before = i64::from(self.count(position_mm));
        self.swapped = swapped;
        self.offset += before - i64::from(self.count(position_mm));
        self.rewire(self.counts(position_mm), now_ns);
    }

    /// Cuts wires, or joins them again, at a time with the stage at a position. Edges of that tick that are yet to come
    /// are changed.
    pub(crate) fn set_cut(&mut self, cut: Option<Cut>, position_mm: f64, now_ns: u64) {
        if cut == self.cut {
            return;
        }
        let count = self.counts(position_mm);
        let sign = if self.swapped { -1 } else { 1 };
        let before = self.offset + sign * followed(count, self.cut);
        let jump = sign * step(lines(count, self.cut), lines(count, cut));
        self.cut = cut;
        self.offset = before + jump - sign * followed(count, cut);
        self.rewire(count, now_ns);
    }

    /// The lines are what the wires of now make of the count, and of the edges to come.
    fn rewire(&mut self, count: i64, now_ns: u64) {
        let wires = (self.cut, self.swapped);
        if let Some(passed) = &mut self.passed {
            let now = passed.partition_point(|(_, edge)| edge.at_ns <= now_ns);
            for (count, to_come) in passed.range_mut(now..) {
                *to_come = edge(to_come.at_ns, *count, wires);
            }
            passed.insert(now, (count, edge(now_ns, count, wires)));
        }
    }

    /// The oldest edge up to `now_ns` that was not fetched yet.
    pub(crate) fn next_edge(&mut self, now_ns: u64) -> Option<Edge> {
        let passed = self.passed.as_mut()?;
        while let Some((_, edge)) = passed.pop_front_if(|(_, edge)| edge.at_ns <= now_ns) {
            if (edge.a, edge.b) != self.shown {
                self.shown = (edge.a, edge.b);
                return Some(edge);
            }
        }
        None
    }

    fn counts(&self, position_mm: f64) -> i64 {
        ((position_mm * self.per_mm).floor() - self.origin) as i64
    }
}

fn edge(at_ns: u64, count: i64, (cut, swapped): (Option<Cut>, bool)) -> Edge {
    let (a, b) = lines(count, cut);
    let (a, b) = if swapped { (b, a) } else { (a, b) };
    Edge { at_ns, a, b }
}

fn lines(count: i64, cut: Option<Cut>) -> (bool, bool) {
    let a = matches!(count & 3, 1 | 2);
    let b = matches!(count & 3, 2 | 3);
    match cut {
        None => (a, b),
        Some(Cut::A) => (false, b),
        Some(Cut::B) => (a, false),
        Some(Cut::Both) => (false, false),
    }
}

/// Steps of a counter at an edge; it ignores a change of both lines at once.
fn step(from: (bool, bool), to: (bool, bool)) -> i64 {
    let quarter = |(a, b): (bool, bool)| match (a, b) {
        (false, false) => 0,
        (true, false) => 1,
        (true, true) => 2,
        (false, true) => 3,
    };
    match (quarter(to) - quarter(from)) & 3 {
        1 => 1,
        3 => -1,
        _ => 0,
    }
}

/// Counts that a counter adds up to from the lines of a count, but for an offset.
fn followed(count: i64, cut: Option<Cut>) -> i64 {
    match (cut, lines(count, cut)) {
        (None, _) => count,
        (Some(Cut::A), (_, b)) => -i64::from(b),
        (Some(Cut::B), (a, _)) => i64::from(a),
        (Some(Cut::Both), _) => 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Goes to and fro with wires cut, joined and exchanged, and counts edges as a timer does.
    #[test]
    fn the_count_is_what_a_counter_makes_of_the_edges() {
        let mut encoder = Encoder::new(10.0003, true);
        let cuts = [None, Some(Cut::A), Some(Cut::B), Some(Cut::Both), None];
        let way = [10.0003, 10.0121, 10.0049, 10.0301, 9.9907, 10.0003];
        let (mut counted, mut shown) = (0, (false, false));
        let mut now = 0;
        for (cut, leg) in cuts.into_iter().chain(cuts).zip(way.windows(2).cycle()) {
            encoder.set_cut(cut, leg[0], now);
            encoder.swap(now > 2_000 && now < 8_000, leg[0], now);
            encoder.pass([leg[0], leg[1]], [now, now + 1_000]);
            now += 1_000;
            while let Some(edge) = encoder.next_edge(now) {
                counted += step(shown, (edge.a, edge.b));
                shown = (edge.a, edge.b);
            }
            assert_eq!(encoder.count(leg[1]), counted as i32, "{cut:?}");
        }
    }

    #[test]
    fn edges_are_gray_coded_and_in_time() {
        let mut encoder = Encoder::new(5.0004, true);
        encoder.pass([5.0004, 5.0104], [1_000, 2_000]);
        let edges: Vec<Edge> = std::iter::from_fn(|| encoder.next_edge(2_000)).collect();
        assert_eq!(edges.len(), 10);
        assert_eq!(encoder.count(5.0104), 10);
        // the first boundary is 0.6 um away, the next ones 1 um, at 10 um per 1000 ns
        let stamps: Vec<u64> = edges
            .iter()
            .map(|edge| (edge.at_ns + 5) / 10 * 10)
            .collect();
        assert_eq!(stamps, (0..10).map(|i| 1_060 + 100 * i).collect::<Vec<_>>());
        assert_eq!((edges[0].a, edges[0].b), (true, false), "A leads upwards");
        for pair in edges.windows(2) {
            assert_eq!(
                (pair[0].a != pair[1].a) as u8 + (pair[0].b != pair[1].b) as u8,
                1
            );
        }
    }
}
