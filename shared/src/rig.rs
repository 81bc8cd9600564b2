//! What performs a movement, and the exploration that it serves.
//!
//! A property means something only for the movement that made it, so moving and sensing are one act.

pub mod calibration;
pub mod control;
pub mod force;
pub mod guard;
pub mod lever;
pub mod patience;
pub mod pins;
pub mod skin;
pub mod stage;
pub mod steps;
pub mod unloaded;

use core::fmt;

use crate::explorer::{Explorer, ObserveError, Outlook, Verdict};
use crate::features::{Measurement, Plan, PropertySet, Slide, SlideError};
use crate::fused::Observation;
use crate::kernels::Kernels;
use crate::movement::Movement;
use crate::table::Action;

/// Slides in a row without properties, after which an exploration ends.
pub const MAX_REJECTED: u8 = 3;

/// A board, a simulator or a recording: it makes one movement and delivers what was felt.
#[allow(async_fn_in_trait)] // no executor of this project moves tasks between threads
pub trait Rig {
    /// Why a movement failed.
    type Error;

    /// The properties that this rig can measure.
    fn measures(&self) -> PropertySet;

    /// Presses, measures the still finger, slides, and gives all samples to `slide`, in the order that [`Slide`] asks for.
    /// The finger may still be on its way up: see [`Rig::lifted`].
    ///
    /// # Errors
    /// The movement failed. The stage then stands still and the finger is lifted.
    async fn perform<K: Kernels>(
        &mut self,
        movement: Movement,
        slide: &mut Slide<'_, K>,
    ) -> Result<(), Self::Error>;

    /// Waits until the finger is lifted, which takes longer than it takes to judge what was felt. For a rig whose movements
    /// end with that, or that has no finger, there is nothing to wait for.
    ///
    /// # Errors
    /// The finger was not lifted as it should; it is now, unless that is what fails.
    async fn lifted(&mut self) -> Result<(), Self::Error> {
        Ok(())
    }
}

/// What an exploration does, as it does it.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Event<'a> {
    /// This action comes next; it and the others promised this.
    Chosen(Action, &'a [Outlook]),
    /// The slide was made and taken in; the posterior of every texture.
    Felt(Action, &'a Measurement, &'a [f32]),
    /// The slide was made, but has no value of the property. It does not count: the choice is made again, and is the same
    /// unless it is random.
    Rejected(Action, Rejection),
    /// The answer, while the finger is still being lifted.
    Decided {
        /// The answer.
        verdict: &'a Verdict,
        /// Slides that counted.
        slides: u8,
        /// See [`Explorer::is_certain`].
        certain: bool,
    },
}

/// Why a slide does not count.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Rejection {
    /// Its samples give no properties.
    Slide(SlideError),
    /// Its properties say nothing to the explorer.
    Observe(ObserveError),
}

impl fmt::Display for Rejection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Slide(why) => why.fmt(f),
            Self::Observe(why) => why.fmt(f),
        }
    }
}

/// Why an exploration ended without an answer.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum ExploreError<E> {
    /// The rig failed.
    Rig(E),
    /// [`MAX_REJECTED`] slides in a row were no good, the last one for this reason.
    Rejected(Rejection),
    /// The table has no such movement.
    Movement(u8),
}

impl<E: fmt::Display> fmt::Display for ExploreError<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Rig(why) => why.fmt(f),
            Self::Rejected(why) => write!(f, "{MAX_REJECTED} slides in a row were no good: {why}"),
            Self::Movement(index) => write!(f, "the table has no movement {}", index + 1),
        }
    }
}

impl<E: fmt::Debug + fmt::Display> core::error::Error for ExploreError<E> {}

/// Explores from the beginning until there is an answer. `random` serves [`crate::explorer::Strategy::Random`]; `tell` hears of everything.
///
/// # Errors
/// See [`ExploreError`].
pub async fn explore<R: Rig, const N: usize, K: Kernels>(
    rig: &mut R,
    explorer: &mut Explorer<'_, N, K>,
    plan: &Plan,
    random: impl FnMut() -> u32,
    tell: impl FnMut(Event<'_>),
) -> Result<Verdict, ExploreError<R::Error>> {
    let answer = slides(rig, explorer, plan, random, tell).await;
    if !matches!(answer, Err(ExploreError::Rig(_))) {
        rig.lifted().await.map_err(ExploreError::Rig)?;
    }
    answer
}

/// As [`explore`]; after the last slide the finger may still be on its way up.
async fn slides<R: Rig, const N: usize, K: Kernels>(
    rig: &mut R,
    explorer: &mut Explorer<'_, N, K>,
    plan: &Plan,
    mut random: impl FnMut() -> u32,
    mut tell: impl FnMut(Event<'_>),
) -> Result<Verdict, ExploreError<R::Error>> {
    explorer.restart();
    let mut rejected = 0;
    loop {
        if let Some(verdict) = explorer.verdict() {
            tell(Event::Decided {
                verdict: &verdict,
                slides: explorer.slides(),
                certain: explorer.is_certain(),
            });
            return Ok(verdict);
        }
        let mut outlook = heapless::Vec::new();
        explorer.look_out(&mut outlook);
        let action = explorer.choose(&outlook, random());
        tell(Event::Chosen(action, &outlook));
        let movement = explorer
            .table()
            .movement(action.movement)
            .ok_or(ExploreError::Movement(action.movement))?;
        let mut slide = Slide::<K>::new(plan);
        rig.lifted().await.map_err(ExploreError::Rig)?;
        rig.perform(movement, &mut slide)
            .await
            .map_err(ExploreError::Rig)?;
        let felt = slide
            .finish()
            .map_err(Rejection::Slide)
            .and_then(|measurement| {
                explorer
                    .observe(action, &Observation::from(&measurement))
                    .map_err(Rejection::Observe)?;
                Ok(measurement)
            });
        match felt {
            Ok(measurement) => {
                rejected = 0;
                tell(Event::Felt(action, &measurement, explorer.posterior()));
            }
            Err(why) => {
                rejected += 1;
                tell(Event::Rejected(action, why));
                if rejected == MAX_REJECTED {
                    return Err(ExploreError::Rejected(why));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::explorer::{Config, Explorer, Strategy};
    use crate::features::Property;
    use crate::table::Table;
    use crate::table::tests::{around, table_of};
    use embassy_futures::block_on;
    use std::cell::RefCell;
    use std::format;
    use std::string::{String, ToString};
    use std::vec;
    use std::vec::Vec;

    /// What the finger feels next.
    #[derive(Clone, Copy)]
    enum Felt {
        /// A slide with this tangential force in mN.
        Traction(i16),
        /// A slide without force sensing.
        NoForce,
        /// A slide that never reaches its steady part.
        Stuck,
        /// The movement fails.
        Fault(&'static str),
    }
    use Felt::{Fault, NoForce, Stuck, Traction};

    /// A rig that feels one thing after the other, and notes its movements.
    struct Script {
        felt: Vec<Felt>,
        made: Vec<Movement>,
    }

    impl Rig for Script {
        type Error = &'static str;

        fn measures(&self) -> PropertySet {
            [Property::Traction].into_iter().collect()
        }

        async fn perform<K: Kernels>(
            &mut self,
            movement: Movement,
            slide: &mut Slide<'_, K>,
        ) -> Result<(), Self::Error> {
            let felt = self
                .felt
                .get(self.made.len())
                .copied()
                .unwrap_or(Fault("script over"));
            self.made.push(movement);
            match felt {
                Fault(why) => return Err(why),
                Stuck => return Ok(()),
                Traction(mn) => slide.push_shear(&[mn; 10]),
                NoForce => {}
            }
            slide.set_background(2.0);
            slide.start(0..600);
            let sample = |n: usize| ((n * 37) % 101) as i16;
            slide.push(&(0..600).map(sample).collect::<Vec<_>>());
            Ok(())
        }
    }

    /// Two textures, tractions 1 N and 2 N, told apart better at the second of two movements.
    fn bytes() -> Vec<u8> {
        let row = |mean, wide, narrow| vec![around([(mean, wide); 3]), around([(mean, narrow); 3])];
        table_of(PropertySet::ALL, &[row(1.0, 0.8, 0.4), row(2.0, 0.8, 0.4)])
    }

    type Outcome = Result<Verdict, ExploreError<&'static str>>;

    /// Explores by this script; the outcome, what was told, and the movements that were made.
    fn explored(felt: &[Felt], config: Config) -> (Outcome, Vec<String>, Vec<Movement>) {
        let bytes = bytes();
        let mut rig = Script {
            felt: felt.to_vec(),
            made: Vec::new(),
        };
        let table = Table::read(&bytes).unwrap();
        let mut explorer = Explorer::<'_, 2>::new(table, rig.measures(), config).unwrap();
        let mut told = Vec::new();
        let mut random = [0, u32::MAX].into_iter().cycle();
        let outcome = block_on(explore(
            &mut rig,
            &mut explorer,
            &Plan::new(),
            || random.next().unwrap(),
            |event| {
                told.push(match event {
                    Event::Decided { .. } => return,
                    Event::Chosen(action, outlook) => {
                        assert!(outlook.iter().any(|o| o.action == action));
                        format!("{} {}", action.what(), action.movement)
                    }
                    Event::Felt(action, slide, posterior) => {
                        let x = slide.properties.get(action.property.unwrap()).unwrap();
                        format!("felt {} {x:.1}: {:.2}", action.movement, posterior[1])
                    }
                    Event::Rejected(action, why) => format!("rejected {}: {why}", action.movement),
                });
            },
        ));
        (outcome, told, rig.made)
    }

    fn config(threshold: f32, max_slides: u8) -> Config {
        Config {
            threshold,
            max_slides,
            ..Config::default()
        }
    }

    const STUCK: Rejection = Rejection::Slide(SlideError::NotStarted);

    #[test]
    fn explores_until_it_is_sure() {
        let felt = [1900, 2000, 2000, 2000].map(Traction);
        let (outcome, told, made) = explored(&felt, config(0.99, 10));
        let verdict = outcome.unwrap();
        assert_eq!((verdict.texture, verdict.sure), (1, true));
        // by hand: log odds +2.5, +0.78 and +3.125; uncertainty after the first 0.128 at the first movement and 0.098 at
        // the second, which was made once: 0.098^(1/2)
        assert_eq!(
            told,
            [
                "traction 1",
                "felt 1 1.9: 0.92",
                "traction 0",
                "felt 0 2.0: 0.96",
                "traction 1",
                "felt 1 2.0: 1.00"
            ]
        );
        let grid: Vec<Movement> = Movement::grid().take(2).collect();
        assert_eq!(made, [grid[1], grid[0], grid[1]]);
        let odds = (2.5f32 + 0.78125 + 3.125).exp();
        assert!((verdict.probability - odds / (1.0 + odds)).abs() < 1e-4);
    }

    /// A rig whose finger is down after a slide until somebody waits for it; what happens is noted.
    struct Slow<'a>(Script, &'a RefCell<Vec<&'static str>>);

    impl Rig for Slow<'_> {
        type Error = &'static str;

        fn measures(&self) -> PropertySet {
            self.0.measures()
        }

        async fn perform<K: Kernels>(
            &mut self,
            movement: Movement,
            slide: &mut Slide<'_, K>,
        ) -> Result<(), Self::Error> {
            self.1.borrow_mut().push("performed");
            self.0.perform(movement, slide).await
        }

        async fn lifted(&mut self) -> Result<(), Self::Error> {
            let jams = self.0.felt.len() == self.0.made.len();
            self.1.borrow_mut().push("lifted");
            if jams { Err("it jams") } else { Ok(()) }
        }
    }

    #[test]
    fn a_slide_is_judged_while_the_finger_is_lifted() {
        let outcome = |felt: &[Felt], config| {
            let (bytes, noted) = (bytes(), RefCell::default());
            let script = Script {
                felt: felt.to_vec(),
                made: Vec::new(),
            };
            let mut rig = Slow(script, &noted);
            let table = Table::read(&bytes).unwrap();
            let mut explorer = Explorer::<'_, 2>::new(table, rig.measures(), config).unwrap();
            let plan = Plan::new();
            let exploration = explore(
                &mut rig,
                &mut explorer,
                &plan,
                || 0,
                |event| {
                    noted.borrow_mut().push(match event {
                        Event::Chosen(..) => "chosen",
                        Event::Felt(..) => "felt",
                        Event::Rejected(..) => "rejected",
                        Event::Decided { slides, .. } => {
                            assert_eq!(slides, 2);
                            "decided"
                        }
                    });
                },
            );
            let outcome = block_on(exploration);
            (outcome.map(|verdict| verdict.texture), noted.into_inner())
        };
        let all = [
            "chosen",
            "lifted",
            "performed",
            "felt",
            "chosen",
            "lifted",
            "performed",
            "felt",
            "decided",
            "lifted",
        ];
        let felt = [Traction(1900), Traction(2000), Traction(0)];
        assert_eq!(outcome(&felt, config(1.0, 2)), (Ok(1), all.to_vec()));
        // the answer stands, and is told; that the finger is down is told as well
        let (failed, noted) = outcome(&felt[..2], config(1.0, 2));
        assert_eq!(
            (failed, noted),
            (Err(ExploreError::Rig("it jams")), all.to_vec())
        );
        // three that are no good end it with the finger up
        let (failed, noted) = outcome(&[Stuck, Stuck, Stuck, Stuck], config(1.0, 2));
        assert_eq!(failed, Err(ExploreError::Rejected(STUCK)));
        assert_eq!(noted.last(), Some(&"lifted"));
    }

    #[test]
    fn names_the_best_after_the_last_slide() {
        let (outcome, told, made) = explored(
            &[Traction(1900), Traction(1400), Traction(1700)],
            config(1.0, 3),
        );
        let verdict = outcome.unwrap();
        assert_eq!((verdict.texture, verdict.sure), (1, false));
        assert_eq!((told.len(), made.len()), (6, 3));
        assert!(told[5].starts_with("felt"));
        let (outcome, told, made) = explored(&[], config(1.0, 0));
        assert_eq!(outcome.unwrap().probability, 0.5, "without a slide");
        assert!(told.is_empty() && made.is_empty());
    }

    #[test]
    fn a_rejected_slide_is_repeated_and_teaches_nothing() {
        let straight = explored(&[Traction(1900), Traction(2000)], config(0.99, 2));
        let (outcome, told, made) = explored(
            &[Stuck, Traction(1900), NoForce, Traction(2000)],
            config(0.99, 2),
        );
        assert_eq!(outcome, straight.0);
        assert_eq!(made.len(), 4);
        assert_eq!(
            told,
            [
                "traction 1",
                "rejected 1: the slide never reached its steady part",
                "traction 1",
                "felt 1 1.9: 0.92",
                "traction 0",
                "rejected 0: the slide did not give a value of traction",
                "traction 0",
                "felt 0 2.0: 0.96",
            ]
        );
    }

    #[test]
    fn three_rejected_in_a_row_end_it() {
        let (outcome, told, made) =
            explored(&[Stuck, NoForce, Stuck, Traction(1900)], config(0.99, 10));
        assert_eq!(outcome, Err(ExploreError::Rejected(STUCK)));
        assert_eq!((told.len(), made.len()), (6, 3));
        assert_eq!(
            told[5],
            "rejected 1: the slide never reached its steady part"
        );
        let missing = Rejection::Observe(ObserveError::Missing(Property::Traction));
        assert_eq!(
            explored(&[NoForce; 3], config(0.99, 10)).0,
            Err(ExploreError::Rejected(missing))
        );
    }

    #[test]
    fn a_good_slide_in_between_resets_the_count() {
        let felt = [
            Stuck,
            Stuck,
            Traction(1500),
            Stuck,
            Stuck,
            Traction(1500),
            Stuck,
            Stuck,
            Stuck,
            Traction(1500),
        ];
        let (outcome, told, made) = explored(&felt, config(0.99, 10));
        assert_eq!(outcome, Err(ExploreError::Rejected(STUCK)));
        assert_eq!((told.len(), made.len()), (18, 9));
    }

    #[test]
    fn a_fault_of_the_rig_ends_it() {
        let (outcome, told, made) =
            explored(&[Stuck, Fault("e-stop"), Traction(2000)], config(0.99, 10));
        assert_eq!(outcome, Err(ExploreError::Rig("e-stop")));
        assert_eq!((told.len(), made.len()), (3, 2));
        assert_eq!(
            told[2], "traction 1",
            "nothing is told of the slide that failed"
        );
    }

    #[test]
    fn a_random_choice_takes_what_it_is_given() {
        let random = Config {
            strategy: Strategy::Random,
            ..config(1.0, 4)
        };
        let (outcome, told, made) = explored(&[Traction(1500); 4], random);
        assert_eq!(outcome.unwrap().probability, 0.5);
        let grid: Vec<Movement> = Movement::grid().take(2).collect();
        assert_eq!(made, [grid[0], grid[1], grid[0], grid[1]]);
        assert_eq!(
            (told[0].as_str(), told[2].as_str()),
            ("traction 0", "traction 1")
        );
    }

    #[test]
    fn the_errors_say_why() {
        let error = |error: ExploreError<&str>| error.to_string();
        assert_eq!(error(ExploreError::Rig("e-stop")), "e-stop");
        assert_eq!(
            error(ExploreError::Rejected(STUCK)),
            "3 slides in a row were no good: the slide never reached its steady part"
        );
        assert_eq!(
            error(ExploreError::Movement(2)),
            "the table has no movement 3"
        );
        let missing = Rejection::Observe(ObserveError::Missing(Property::Fineness));
        assert_eq!(
            missing.to_string(),
            "the slide did not give a value of fineness"
        );
    }
}
