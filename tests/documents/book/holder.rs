//! The holder in `hardware/printer.scad`: what moves in it, and how hard that presses.

use std::collections::BTreeMap;

use super::read;

const GRAVITY: f64 = 9.81;
/// The force that no mount may exceed by itself, N.
const MOST: f64 = 2.1;
/// The Z axis of a printer: its approach and its fastest, m/s, and its acceleration, m/s2.
const SPEEDS: [f64; 2] = [0.5e-3, 5e-3];
const ACCELERATION: f64 = 0.1;

/// The numbers that a file of OpenSCAD gives to names, millimetres and grams: one, or those of a list.
pub(super) struct Measures(BTreeMap<String, Vec<f64>>);

impl Measures {
    pub(super) fn of(path: &str) -> Self {
        let mut found = BTreeMap::new();
        for line in read(path).lines() {
            let Some((name, rest)) = line.split_once(" = ") else {
                continue;
            };
            let value = rest.split(';').next().unwrap_or_default();
            let numbers = value.trim_matches(['[', ']']).split(", ");
            if let Ok(numbers) = numbers.map(str::parse).collect() {
                found.insert(name.to_owned(), numbers);
            }
        }
        Self(found)
    }

    fn all(&self, name: &str) -> &[f64] {
        let found = self.0.get(name);
        found.unwrap_or_else(|| panic!("no number is called {name}"))
    }

    pub(super) fn one(&self, name: &str) -> f64 {
        self.all(name)[0]
    }

    /// Grams of `count` washers.
    fn washers(&self, size: &str, count: &str) -> f64 {
        let [outer, inner, high] = self.all(size) else {
            panic!("{size} has no three sizes");
        };
        let area = std::f64::consts::FRAC_PI_4 * (outer.powi(2) - inner.powi(2));
        self.one("steel") * area * high * self.one(count)
    }
}

/// What rides on the block.
pub(super) struct Carriage {
    /// kg
    pub(super) mass: f64,
    /// Of its centre of mass from the tip, m.
    aside: f64,
    measures: Measures,
}

impl Carriage {
    pub(super) fn new() -> Self {
        let measures = Measures::of("hardware/printer.scad");
        let one = |name| measures.one(name);
        let [long, wide, high] = measures.all("cell") else {
            panic!("a cell has three sizes");
        };
        let bores = std::f64::consts::FRAC_PI_2 * one("cell_bore").powi(2) * wide;
        let cell = one("aluminium") * (long * wide * high - bores);
        let printed = one("petg") * one("filled") * one("carriage_volume");
        // M8 x 40: a shank, and a head and a nut of 13 mm across
        let hexagon = 0.866 * 13.0 * 13.0;
        let shank = std::f64::consts::FRAC_PI_4 * 64.0;
        let bolt = one("steel") * (40.0 * shank + 5.3 * hexagon + 6.8 * (hexagon - shank));
        let washers = measures.washers("washer", "washers")
            + measures.washers("small_washer", "small_washers");
        let parts = [
            (cell, long / 2.0 - one("reach") - long + one("cell_end")),
            (printed, one("carriage_middle")),
            (bolt + washers, one("weight_at")),
            (one("screws_mass"), one("carriage_middle")),
            (one("block_mass") + one("tip_mass") + one("cable_mass"), 0.0),
        ];
        let mass: f64 = parts.iter().map(|(mass, _)| mass).sum();
        let moment: f64 = parts.iter().map(|(mass, at)| mass * at).sum();
        Self {
            mass: mass / 1e3,
            aside: (moment / mass).abs() / 1e3,
            measures,
        }
    }

    fn weight(&self) -> f64 {
        self.mass * GRAVITY
    }

    /// The friction of the balls that carry the tilting moments: of the weight beside the tip, and of a sample that
    /// pulls as hard as the finger presses.
    fn balls(&self) -> f64 {
        let one = |name| self.measures.one(name);
        let above = one("tip_below") + self.measures.all("cell")[2] + one("standoff") + 1.0;
        let arm = (above + self.measures.all("block")[2] / 2.0) / 1e3;
        let pair = self.weight() * (self.aside + arm) / (one("ball_span") / 1e3);
        one("friction") * 2.0 * pair
    }

    /// The force on a finger that has yielded by `travel` mm, N.
    fn force(&self, travel: f64) -> f64 {
        let one = |name| self.measures.one(name);
        let rubs = one("drag") + self.balls() + one("cable_rate") * travel;
        self.weight() + rubs + self.mass * ACCELERATION
    }

    /// What a speed adds at the moment at which the finger begins to yield, m/s.
    fn blow(&self, speed: f64) -> f64 {
        speed * (self.mass * self.measures.one("skin_rate") * 1e3).sqrt()
    }
}

/// The table of `docs/src/printer.md`.
pub(super) fn force() -> String {
    let carriage = Carriage::new();
    let mut text =
        "| the finger has yielded by | force | on the way back |\n|---|---|---|\n".to_owned();
    for speed in SPEEDS {
        let force = carriage.force(0.0) + carriage.blow(speed);
        let speed = speed * 1e3;
        text += &format!("| 0 mm, Z comes down at {speed} mm/s | {force:.2} N | |\n");
    }
    let drag = carriage.measures.one("drag");
    for travel in [2.0, 6.0, carriage.measures.one("travel")] {
        let force = carriage.force(travel);
        let back = force - 2.0 * (drag + carriage.balls());
        text += &format!("| {travel} mm | {force:.2} N | {back:.2} N |\n");
    }
    let fastest = (MOST - carriage.force(0.0)) / carriage.blow(1e-3);
    text + &format!("| fastest rise of the sample, or Z, below {MOST} N | {fastest:.0} mm/s | |\n")
}

#[test]
fn the_holder_cannot_press_harder_than_the_guard_allows() {
    let carriage = Carriage::new();
    let one = |name| carriage.measures.one(name);
    let off = carriage.mass * 1e3 - one("goal");
    assert!(off.abs() < 1.0, "{off} g too much");
    assert!(one("travel") >= 6.0 && one("drop") >= one("travel") + 5.0);
    let most = carriage.force(0.0) + carriage.blow(SPEEDS[1]);
    assert!(most < MOST, "{most} N at the stroke's begin");
    let most = carriage.force(one("travel"));
    assert!(most < MOST, "{most} N at its end");
    // it lies on its stop at the probe's greatest force, and falls back on it
    let falls = carriage.weight() - one("drag") - carriage.balls();
    assert!(carriage.weight() > 1.26 * 1.1 && falls > 0.5, "{falls} N");
}

/// The holder takes the finger of `finger.scad`.
#[test]
fn the_holder_fits_the_finger() {
    let [holder, finger] = ["hardware/printer.scad", "hardware/finger.scad"].map(Measures::of);
    for name in ["cell", "cell_holes", "reach"] {
        assert_eq!(holder.all(name), finger.all(name), "{name}");
    }
    // flange, skirt, and what a sphere's end stands out beyond the wall
    let radius = finger.one("end_radius");
    let rise = radius - (radius.powi(2) - (finger.one("diameter") / 2.0).powi(2)).sqrt();
    let below = finger.one("flange") + finger.one("skirt") + rise;
    assert!((below - holder.one("tip_below")).abs() < 0.01, "{below}");
}

/// Whoever prints by the page gets every part that the file has, and no other.
#[test]
fn the_page_prints_every_part() {
    let source = read("hardware/printer.scad");
    let parts = source.split("if (part == \"").skip(1);
    let mut parts: Vec<&str> = parts.filter_map(|rest| rest.split('"').next()).collect();
    parts.retain(|part| !part.starts_with("assembly"));
    let line = format!("for part in {}; do", parts.join(" "));
    assert!(read("docs/src/printer.md").contains(&line), "no {line}");
}
