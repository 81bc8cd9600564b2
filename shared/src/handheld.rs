//! The handheld probe: a person presses and slides, and a display says how. No motor, so no movement to choose and no
//! traction: what is compared is one slide at about one force and pace, by
//! [`FeatureSet::Pressure`](crate::features::FeatureSet::Pressure).
//!
//! [`Handheld`] has no clock. Time is what it is given: sensor words, of which there are 4400 in a second, and ticks of
//! the button, of which there are 100. It says what the display shows ([`Handheld::screen`]), what the buzzer sounds,
//! whether the sensor is wanted, and what is to be done with the table, which it does not own: [`Job`].

mod button;
pub mod by_hand;
pub mod draw;
pub mod guidance;
pub mod jobs;
pub mod judge;
pub mod picture;
pub mod screen;
mod speed;
mod spelling;
pub mod states;
pub mod touch;

pub use draw::draw;
pub use judge::{
    ASK_AFTER, FEATURES, JudgeError, Judgement, MAX_SLIDES, MOVEMENT, judge, judge_at_most,
};
pub use picture::Picture;
pub use screen::{About, Screen, Trouble};
pub use speed::Moved;
pub use spelling::{Place, WHEEL};
pub use states::{Answer, Choice, Handheld, Job, RequestedSlide, TICKS_HZ};
