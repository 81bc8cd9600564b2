//! The path of the stage in a slide.

use crate::features::Movement;

/// Constant speed over `length_mm`, with a ramp before and one after.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct SlidePath {
    /// Sliding speed in mm/s.
    pub speed_mm_s: f32,
    /// Distance at constant speed in mm.
    pub length_mm: f32,
    pub(crate) acceleration_mm_s2: f32,
}

impl SlidePath {
    /// Acceleration of the reference stage.
    pub const ACCELERATION_MM_S2: f32 = 1000.0;
    /// The square of texture is 75 mm wide (Methods, "Textures").
    pub const SAMPLE_MM: f32 = 75.0;
    /// Longest slide at constant speed: the rest of the sample is the range for its random start.
    pub const LONGEST_MM: f32 = 60.0;

    /// A slide of `length_mm` at the speed of `movement`, with the reference stage's acceleration.
    pub fn new(movement: Movement, length_mm: f32) -> Self {
        Self {
            speed_mm_s: movement.speed_mm_s(),
            length_mm,
            acceleration_mm_s2: Self::ACCELERATION_MM_S2,
        }
    }

    /// Duration of one ramp in s.
    pub fn ramp_s(&self) -> f32 {
        self.speed_mm_s / self.acceleration_mm_s2
    }

    /// Duration of the part at constant speed in s.
    pub fn steady_s(&self) -> f32 {
        self.length_mm / self.speed_mm_s
    }

    /// Travel from rest to rest in mm: each ramp takes v^2 / 2a.
    pub fn travel_mm(&self) -> f32 {
        self.length_mm + self.speed_mm_s * self.ramp_s()
    }

    /// Range of the slide's start in mm behind the first possible one, so that the finger stays on a sample of
    /// `sample_mm`; `None` if the slide does not fit at all.
    pub(crate) fn start_room_mm(&self, sample_mm: f32) -> Option<f32> {
        let margin = sample_mm - self.travel_mm();
        (margin >= 0.0).then_some(margin)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_75_mm_sample_at_1000_mm_s2_gives_the_times_of_the_hardware_facts() {
        for (speed, steady_s) in [(10.0, 7.49), (63.1, 1.126), (100.0, 0.65)] {
            let length = 75.0 - speed * speed / 1000.0;
            let path = SlidePath {
                speed_mm_s: speed,
                length_mm: length,
                acceleration_mm_s2: 1000.0,
            };
            assert!((path.steady_s() - steady_s).abs() < 1e-3);
            assert!((path.travel_mm() - 75.0).abs() < 1e-4);
        }
    }

    #[test]
    fn start_room_is_what_the_sample_leaves() {
        let path = SlidePath::new(Movement::FOR_TRACTION, SlidePath::LONGEST_MM);
        let margin = path.start_room_mm(SlidePath::SAMPLE_MM).unwrap();
        assert!((margin - 14.9).abs() < 1e-4);
        assert!(path.start_room_mm(60.0).is_none());
    }
}
