//! How long explorations take: what their slides take by their movements, since nothing here has a clock.

use tactus_core::explorer::SlideTime;
use tactus_core::features::Movement;
use tactus_core::rig::slide_path::SlidePath;

use super::evaluate::Outcome;

/// Slides of the reference rig. The overhead is the simulated rig's: what its slides take from one to the next, beyond the time
/// at the speed of the movement: the mean of two explorations of six.
pub const RIG: SlideTime = SlideTime {
    longest_mm: SlidePath::LONGEST_MM,
    longest_s: 3.0,
    overhead_s: 7.7,
};

/// Slides of FabricSlide: half of a pass of 59 mm, without its first 6 % (see `fabricslide` of `tactus-study`). How long the robot
/// takes from one to the next was not published: 2 s (chosen).
pub const FABRICS: SlideTime = SlideTime {
    longest_mm: 27.7,
    longest_s: f32::INFINITY,
    overhead_s: 2.0,
};

/// Mean time of an exploration, s; of none, 0.
pub fn mean_seconds(outcomes: &[Outcome], movements: &[Movement], time: SlideTime) -> f64 {
    let each: Vec<f64> = movements.iter().map(|m| time.seconds(*m).into()).collect();
    let of = |outcome: &Outcome| -> f64 {
        let made = outcome.made.iter().zip(&each);
        made.map(|(&made, seconds)| f64::from(made) * seconds).sum()
    };
    outcomes.iter().map(of).sum::<f64>() / outcomes.len().max(1) as f64
}
