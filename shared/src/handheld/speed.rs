//! Speed of the probe, from its sensor of motion, if it has one.

use heapless::Deque;

use crate::features::{Movement, fixed};
use crate::sensor::paa5100je::COUNTS_PER_MM;

/// Number of readings that show whether the probe moves: 50 ms.
const LATEST: usize = 5;
/// It moves when it has come so far within them, mm: 5 mm/s, the slowest movement that there is.
const MOVES_MM: f32 = 0.25;

/// Counts along both axes since the reading before; `None` where the surface was not seen.
pub type Moved = Option<[i16; 2]>;

#[derive(Clone, Debug, Default)]
pub(super) struct Speedometer {
    latest: Deque<Moved, LATEST>,
    /// Counts of the slide so far, and those before its steady part.
    counts: [i32; 2],
    before: [i32; 2],
    seen: bool,
}

impl Speedometer {
    pub(super) fn take(&mut self, moved: Moved) {
        if self.latest.is_full() {
            let _ = self.latest.pop_front();
        }
        // one place is free now
        let _ = self.latest.push_back(moved);
        self.seen &= moved.is_some();
        add(&mut self.counts, moved);
    }

    pub(super) fn is_there(&self) -> bool {
        !self.latest.is_empty()
    }

    /// Returns true if the probe moves; `None` if the sensor does not see it.
    pub(super) fn moves(&self) -> Option<bool> {
        let mut counts = [0; 2];
        for moved in &self.latest {
            moved.as_ref()?;
            add(&mut counts, *moved);
        }
        let known = self.latest.is_full();
        known.then(|| way_mm(counts) > MOVES_MM)
    }

    pub(super) fn begin(&mut self) {
        (self.counts, self.before, self.seen) = ([0; 2], [0; 2], true);
    }

    pub(super) fn steady(&mut self) {
        self.before = self.counts;
    }

    /// The way of the slide so far, mm; `None` if a part of it was not seen.
    pub(super) fn way_mm(&self) -> Option<f32> {
        self.seen.then(|| way_mm(self.counts))
    }

    /// ln of the mean speed of the steady part in parts of the movement's, 1/1024, if that took so many seconds; `None`
    /// if the probe did not see all of the way.
    pub(super) fn pace(&self, seconds: f32, movement: Movement) -> Option<i16> {
        let [x, y] = self.counts;
        let [x0, y0] = self.before;
        let way_mm = way_mm([x.saturating_sub(x0), y.saturating_sub(y0)]);
        let pace = libm::logf(way_mm / (movement.speed_mm_s() * seconds));
        fixed(pace).filter(|_| self.seen)
    }
}

fn add(counts: &mut [i32; 2], moved: Moved) {
    for (sum, counts) in counts.iter_mut().zip(moved.unwrap_or_default()) {
        *sum = sum.saturating_add(counts.into());
    }
}

fn way_mm(counts: [i32; 2]) -> f32 {
    let [x, y] = counts.map(|c| c as f32);
    libm::sqrtf(x * x + y * y) / COUNTS_PER_MM
}

#[cfg(test)]
mod tests {
    use super::super::judge::MOVEMENT;
    use super::*;

    #[test]
    fn a_way_is_a_speed_and_a_gap_in_it_is_none() {
        let mut speed = Speedometer::default();
        assert_eq!(speed.pace(1.2, MOVEMENT), None, "nothing has begun");
        speed.begin();
        // the way before the steady part does not count
        speed.take(Some([0, -50]));
        speed.steady();
        (0..120).for_each(|_| speed.take(Some([0, -3])));
        // 228 counts a mm and mm of height, at 25 mm; 25.1 mm/s are meant
        let mm = 360.0 / (228.0 / 25.0);
        let expected = (mm / 1.2 / f64::from(MOVEMENT.speed_mm_s())).ln() * 1024.0;
        let pace = speed.pace(1.2, MOVEMENT).unwrap();
        assert!(
            (f64::from(pace) - expected).abs() < 1.0,
            "{pace} {expected}"
        );
        let way = f64::from(speed.way_mm().unwrap());
        assert!((way - 410.0 / (228.0 / 25.0)).abs() < 1e-3, "{way}");
        speed.take(None);
        assert_eq!((speed.pace(1.2, MOVEMENT), speed.way_mm()), (None, None));
        speed.begin();
        assert_eq!(speed.pace(1.2, MOVEMENT), None, "nothing has moved");
        speed.take(Some([12, 0]));
        assert!(speed.pace(0.05, MOVEMENT).is_some());
    }

    #[test]
    fn moving_and_still_are_told_where_it_sees() {
        let mut speed = Speedometer::default();
        (0..4).for_each(|_| speed.take(Some([0, 0])));
        assert_eq!(speed.moves(), None, "too early");
        speed.take(Some([0, 0]));
        assert_eq!(speed.moves(), Some(false));
        (0..2).for_each(|_| speed.take(Some([1, 2])));
        assert_eq!(speed.moves(), Some(true));
        speed.take(None);
        assert_eq!(speed.moves(), None);
        (0..2).for_each(|_| speed.take(Some([0, 1])));
        (0..3).for_each(|_| speed.take(Some([0, 0])));
        assert_eq!(speed.moves(), Some(false), "0.22 mm are no movement yet");
    }
}
