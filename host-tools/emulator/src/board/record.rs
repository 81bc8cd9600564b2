//! The ground truth of slides: forces and speeds of the world, instants of the sensor's slots.

use tactus_world::world::Truth;

pub(crate) const CONTACT_N: f64 = 0.05;
/// A slower stage does not slide, mm/s.
const SLIDES_MM_S: f64 = 1.0;
const SHORTEST_S: f64 = 0.3;
const ACCELERATION_MM_S2: f64 = 1000.0;
/// After the ramp the stage settles for so long, s.
const SETTLING_S: f64 = 0.2;
/// Speeds are means of so many ms.
const MEAN_MS: usize = 100;
/// Slots in a second (PAPER: both pressures at 2200 Hz).
const SLOTS_HZ: f64 = 4400.0;

/// The ground truth of a slide.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Slide {
    /// Time when the stage began to move, ns.
    pub began_ns: u64,
    /// Time when it stood again or the finger was off, ns.
    pub ended_ns: u64,
    /// Contact force when the stage began to move, N.
    pub force_n: f64,
    /// Mean contact force from then on, N.
    pub(crate) force_mean_n: f64,
    /// Largest contact force, N.
    pub force_max_n: f64,
    /// Mean speed of the steady part, mm/s; 0 if there is none.
    pub speed_mm_s: f64,
    /// Largest relative deviation of the mean speed of any 100 ms of the steady part.
    pub speed_error: f64,
    /// Slots that the sensor was asked in.
    pub slots: usize,
    /// Slots between the first and the last of these that it was not asked in.
    pub missed_slots: usize,
    /// Largest deviation of a slot from the regular grid, us.
    pub slot_jitter_us: f64,
}

/// The ground truth of a contact.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Touch {
    /// Time when it began, ns.
    pub began_ns: u64,
    /// Time when the finger was off again, ns.
    pub ended_ns: Option<u64>,
}

#[derive(Debug, Default)]
pub(crate) struct Recorder {
    pub(crate) slides: Vec<Slide>,
    pub(crate) touches: Vec<Touch>,
    now: Option<Slide>,
    expected_mm_s: Option<f64>,
    /// one in a ms
    speeds: Vec<f64>,
    /// their sum, N, one for each speed
    forces_n: f64,
    next_speed_ns: u64,
    commands: Vec<u64>,
}

impl Recorder {
    pub(crate) fn expect_speed(&mut self, mm_s: f64) {
        self.expected_mm_s = Some(mm_s);
    }

    /// Chip select fell for a command.
    pub(crate) fn command(&mut self, at_ns: u64) {
        if self.now.is_some() {
            self.commands.push(at_ns);
        }
    }

    pub(crate) fn tick(&mut self, now_ns: u64, truth: &Truth) {
        let touches = truth.force_n > CONTACT_N;
        match self.touches.last_mut() {
            Some(touch) if touch.ended_ns.is_none() => {
                touch.ended_ns = (!touches).then_some(now_ns);
            }
            _ if touches => self.touches.push(Touch {
                began_ns: now_ns,
                ended_ns: None,
            }),
            _ => {}
        }
        let slides = touches && truth.speed_mm_s.abs() > SLIDES_MM_S;
        match &mut self.now {
            None if slides => {
                self.now = Some(Slide {
                    began_ns: now_ns,
                    force_n: truth.force_n,
                    force_max_n: truth.force_n,
                    ..Slide::default()
                });
                self.speeds.clear();
                self.forces_n = 0.0;
                self.commands.clear();
                self.next_speed_ns = now_ns;
            }
            Some(slide) if slides => {
                slide.force_max_n = slide.force_max_n.max(truth.force_n);
                if now_ns >= self.next_speed_ns {
                    self.next_speed_ns += 1_000_000;
                    self.speeds.push(truth.speed_mm_s.abs());
                    self.forces_n += truth.force_n;
                }
            }
            Some(slide) => {
                let mut slide = *slide;
                self.now = None;
                slide.ended_ns = now_ns;
                if (now_ns - slide.began_ns) as f64 * 1e-9 >= SHORTEST_S {
                    self.finish(slide);
                }
            }
            None => {}
        }
    }

    fn finish(&mut self, mut slide: Slide) {
        slide.force_mean_n = self.forces_n / self.speeds.len().max(1) as f64;
        let wanted = self.expected_mm_s.unwrap_or_else(|| {
            let mut sorted = self.speeds.clone();
            sorted.sort_by(f64::total_cmp);
            sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
        });
        let ramp_s = wanted / ACCELERATION_MM_S2;
        let from = ((ramp_s + SETTLING_S) * 1e3) as usize;
        // a little longer than the ramp, whose begin is unknown
        let to = self
            .speeds
            .len()
            .saturating_sub((ramp_s * 1e3) as usize + 20);
        if let Some(steady) = self.speeds.get(from..to)
            && steady.len() >= MEAN_MS
        {
            let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
            slide.speed_mm_s = mean(steady);
            let errors = steady
                .windows(MEAN_MS)
                .map(|part| (mean(part) / wanted - 1.0).abs());
            slide.speed_error = errors.fold(0.0, f64::max);
        }
        slide.slots = self.commands.len();
        slide.missed_slots = missed(&self.commands);
        slide.slot_jitter_us = jitter_ns(&self.commands) * 1e-3;
        self.slides.push(slide);
    }
}

/// Number of an instant's slot, that of the first being 0.
fn slot(first: u64, at: u64) -> f64 {
    ((at - first) as f64 * SLOTS_HZ * 1e-9).round()
}

fn missed(instants: &[u64]) -> usize {
    let [first, .., last] = *instants else {
        return 0;
    };
    (slot(first, last) as usize + 1).saturating_sub(instants.len())
}

/// Largest deviation from the grid that fits the instants best: its period need not be exactly 1/4400 s, which no timer
/// divides its clock to.
fn jitter_ns(instants: &[u64]) -> f64 {
    let [first, .., _] = *instants else {
        return 0.0;
    };
    let points: Vec<(f64, f64)> = instants
        .iter()
        .map(|&at| (slot(first, at), (at - first) as f64))
        .collect();
    let n = points.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / n;
    let (mean_slot, mean_ns) = (mean(|p| p.0), mean(|p| p.1));
    let (mut both, mut square) = (0.0, 0.0);
    for (slot, ns) in &points {
        both += (slot - mean_slot) * (ns - mean_ns);
        square += (slot - mean_slot) * (slot - mean_slot);
    }
    let period = if square > 0.0 { both / square } else { 0.0 };
    points
        .iter()
        .map(|(slot, ns)| (ns - mean_ns - period * (slot - mean_slot)).abs())
        .fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn jitter_is_what_a_slot_is_off_its_grid() {
        let grid: Vec<u64> = (0..1000).map(|slot| 5_000 + slot * 227_274).collect();
        assert!(jitter_ns(&grid) < 1e-3);
        let mut late = grid.clone();
        late[500] += 3_000;
        assert!((jitter_ns(&late) - 3_000.0).abs() < 10.0);
        // a slot that was left out is no jitter of the others
        late.remove(500);
        assert!(jitter_ns(&late) < 1e-3);
        assert_eq!((missed(&grid), missed(&late)), (0, 1));
        assert_eq!(jitter_ns(&[]), 0.0);
    }
}
