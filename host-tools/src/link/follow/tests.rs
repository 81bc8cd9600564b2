use std::cell::RefCell;
use std::sync::OnceLock;

use tactus_core::dsp::Kernels;
use tactus_core::explorer::Strategy;
use tactus_core::features::{self, BLOCK, Movement};
use tactus_core::probe::explore::{Event, explore};
use tactus_core::rig::Rig;
use tactus_core::table::Name;
use tactus_core::wire::{self, MAX_FRAME, Receiver, Report};

use super::*;
use crate::sim::collection::{Collection, calibrated};
use crate::sim::rig::{SimError, SimRig, feel};

const UNKNOWN: u8 = 47;

/// Tells as the probe does, through frames.
#[derive(Default)]
struct Tells(RefCell<Vec<Tell>>);

impl Tells {
    fn push(&self, tell: Tell) {
        let mut room = [0; MAX_FRAME + 1];
        let report = Report {
            number: 0,
            at_ms: 0,
            tell,
        };
        let mut receiver = Receiver::default();
        for &byte in wire::encode(&report, &mut room).unwrap() {
            if let Some(got) = receiver.push::<Report>(byte) {
                self.0.borrow_mut().push(got.unwrap().tell);
            }
        }
    }
}

/// The simulated rig, with its samples told in blocks.
struct Streamed<'a> {
    rig: SimRig,
    tells: &'a Tells,
}

impl Streamed<'_> {
    fn tell(&self, number: &mut u16, block: &mut Block) {
        let steady = block.steady;
        let still = block.still;
        let told = std::mem::replace(
            block,
            Block {
                number: 0,
                still,
                steady: None,
                pac: Default::default(),
                shear_mn: Default::default(),
                lost: 0,
            },
        );
        self.tells.push(Tell::Block(Block {
            number: *number,
            steady,
            ..told
        }));
        *number += 1;
    }
}

impl Rig for Streamed<'_> {
    type Error = SimError;

    fn measures(&self) -> PropertySet {
        PropertySet::ALL
    }

    async fn perform<K: Kernels>(
        &mut self,
        movement: Movement,
        slide: &mut features::Slide<'_, K>,
    ) -> Result<(), SimError> {
        if self.rig.control().phase() == tactus_core::rig::Phase::Parked {
            self.rig.home()?;
        }
        let mut ticks = Vec::new();
        self.rig.slide(movement, 0.5, |outputs, _| {
            feel(outputs, slide);
            ticks.push(outputs.clone());
        })?;
        let mut number = 0;
        let mut block = Block {
            number: 0,
            still: true,
            steady: None,
            pac: Default::default(),
            shear_mn: Default::default(),
            lost: 0,
        };
        for tick in ticks {
            let still = match &tick.felt {
                features::Felt::Nothing => continue,
                features::Felt::Still => true,
                _ => false,
            };
            let full = block.pac.len() + tick.pac.len() > BLOCK;
            if (full || still != block.still) && !block.pac.is_empty() {
                self.tell(&mut number, &mut block);
            }
            block.still = still;
            if let features::Felt::Begin(steady) = tick.felt {
                block.steady = Some((steady.start, steady.end));
            }
            block.pac.extend_from_slice(&tick.pac).unwrap();
            block.shear_mn.extend(tick.shear_mn);
        }
        self.tell(&mut number, &mut block);
        Ok(())
    }
}

fn asked() -> Identify {
    Identify {
        among: Default::default(),
        threshold: 1.0,
        max_slides: 4,
        method: None,
        strategy: Strategy::Bayesian,
        open: true,
        learn: false,
        seed: 1,
    }
}

/// A fused table of three textures, and what a probe tells of an exploration with it.
fn explored() -> &'static (Vec<u8>, Vec<Tell>) {
    static EXPLORED: OnceLock<(Vec<u8>, Vec<Tell>)> = OnceLock::new();
    EXPLORED.get_or_init(|| exploration(Method::Fused))
}

fn exploration(method: Method) -> (Vec<u8>, Vec<Tell>) {
    let world = Collection {
        seed: 5,
        textures: vec![10, UNKNOWN, 100],
        trials: 3,
    };
    let calibration = calibrated(world.setup(10, 0)).unwrap();
    let bytes = world.learn(method, calibration, || ()).unwrap();
    let table = Table::read(&bytes).unwrap();
    let tells = Tells::default();
    let mut rig = Streamed {
        rig: SimRig::new(world.setup(UNKNOWN, 100)),
        tells: &tells,
    };
    rig.rig.control().calibrate(calibration).unwrap();
    let config = Config {
        method,
        open: asked().open,
        threshold: asked().threshold,
        max_slides: asked().max_slides,
        strategy: asked().strategy,
    };
    let mut explorer = Explorer::<8>::new(table, PropertySet::ALL, config).unwrap();
    let (mut slide, plan) = (1, Plan::new());
    let exploration = explore(
        &mut rig,
        &mut explorer,
        &plan,
        || 0,
        |event| {
            tells.push(match event {
                Event::Chosen(action, outlook) => {
                    let mut outlook: Vec<Promise> = outlook
                        .iter()
                        .map(|o| Promise {
                            action: o.action,
                            uncertainty: o.uncertainty,
                            benefit: o.benefit,
                        })
                        .collect();
                    outlook.sort_by(|a, b| b.benefit.total_cmp(&a.benefit));
                    Tell::Chosen {
                        slide,
                        movement: table.movement(action.movement).unwrap(),
                        action,
                        outlook: outlook.into_iter().take(MAX_OUTLOOK).collect(),
                    }
                }
                Event::Felt(action, measurement, posterior) => {
                    slide += 1;
                    Tell::Felt {
                        slide: slide - 1,
                        action,
                        felt: measurement.into(),
                        posterior: posterior.iter().copied().collect(),
                    }
                }
                Event::Decided {
                    verdict,
                    slides,
                    certain,
                } => Tell::Verdict {
                    texture: verdict.texture,
                    name: Name::try_from(table.name(verdict.texture).unwrap()).unwrap(),
                    probability: verdict.probability,
                    sure: verdict.sure,
                    unknown: verdict.unknown,
                    log_odds: verdict.log_odds,
                    slides,
                    asks: method == Method::Fused && !certain,
                },
                Event::Rejected(..) => panic!("{event:?}"),
            });
        },
    );
    embassy_futures::block_on(exploration).unwrap();
    let tells = tells.0.into_inner();
    (bytes, tells)
}

/// Follows these reports; how well they agree, and what could not be compared.
fn follow(tells: &[Tell]) -> (Agreement, Vec<FollowError>) {
    follow_with(&explored().0, &asked(), tells)
}

fn follow_with(table: &[u8], asked: &Identify, tells: &[Tell]) -> (Agreement, Vec<FollowError>) {
    let plan = Plan::new();
    let table = Table::read(table).unwrap();
    let mut follower = Follower::new(table, PropertySet::ALL, asked, &plan).unwrap();
    let errors = tells.iter().filter_map(|tell| follower.hear(tell).err());
    let errors = errors.collect();
    (follower.agreement().clone(), errors)
}

/// Follows the exploration with the first report changed that `change` knows.
fn changed(change: impl FnMut(&mut Tell) -> bool) -> (Agreement, Vec<FollowError>) {
    let mut tells = explored().1.clone();
    assert!(tells.iter_mut().any(change));
    follow(&tells)
}

/// The `nth` report (from 0) that `is` knows.
fn place(nth: usize, is: impl Fn(&Tell) -> bool) -> usize {
    let mut places = explored().1.iter().enumerate().filter(|(_, t)| is(t));
    places.nth(nth).unwrap().0
}

#[test]
fn an_exploration_is_followed_to_the_bit() {
    let (agreement, errors) = follow(&explored().1);
    assert_eq!(errors, []);
    let exact = Agreement {
        slides: 4,
        posteriors: 4,
        choices: 4,
        verdicts: 1,
        ..Agreement::default()
    };
    assert_eq!(agreement, exact);
    assert!(agreement.agrees());
    // so is one by the paper's method, if it was asked for
    let (table, tells) = exploration(Method::Paper);
    let asked = Identify {
        method: Some(Method::Paper),
        ..asked()
    };
    assert_eq!(follow_with(&table, &asked, &tells), (exact, vec![]));
}

#[test]
fn a_changed_sample_is_found() {
    // in the middle of the steady part of the first slide
    let at = place(60, |t| matches!(t, Tell::Block(b) if !b.still));
    let mut tells = explored().1.clone();
    let Tell::Block(block) = &mut tells[at] else {
        panic!()
    };
    block.pac[7] += 40;
    let (agreement, errors) = follow(&tells);
    assert_eq!((errors, agreement.slides), (vec![], 4));
    assert!(agreement.properties > 0.0 && agreement.signal > 0.0);
    assert_eq!((agreement.posterior, agreement.outlook), (0.0, 0.0));
}

#[test]
fn a_changed_posterior_property_or_promise_is_found() {
    let (agreement, _) = changed(|tell| match tell {
        Tell::Felt {
            slide: 2,
            posterior,
            ..
        } => {
            posterior[1] += 2e-4;
            true
        }
        _ => false,
    });
    assert!((agreement.posterior - 2e-4).abs() < 1e-6 && !agreement.agrees());
    let (agreement, _) = changed(|tell| match tell {
        Tell::Felt { slide: 1, felt, .. } => {
            felt.properties[0] = None;
            true
        }
        _ => false,
    });
    assert_eq!(agreement.properties, f32::INFINITY);
    let (agreement, _) = changed(|tell| match tell {
        Tell::Chosen {
            slide: 3, outlook, ..
        } => {
            outlook[0].benefit -= 1e-3;
            true
        }
        _ => false,
    });
    assert!((agreement.outlook - 1e-3).abs() < 1e-6 && !agreement.agrees());
    let (agreement, _) = changed(|tell| match tell {
        Tell::Verdict { sure, .. } => {
            *sure = !*sure;
            true
        }
        _ => false,
    });
    assert_eq!(agreement.other_verdicts, 1);
    let (agreement, _) = changed(|tell| match tell {
        Tell::Verdict { unknown, .. } => {
            *unknown = !*unknown;
            true
        }
        _ => false,
    });
    assert_eq!(agreement.other_verdicts, 1);
    let (agreement, _) = changed(|tell| match tell {
        Tell::Verdict { log_odds, .. } => {
            *log_odds = log_odds.map(|odds| odds + 0.5);
            true
        }
        _ => false,
    });
    assert!((agreement.posterior - 0.5).abs() < 1e-3, "{agreement:?}");
    let (agreement, _) = changed(|tell| match tell {
        Tell::Felt { slide: 1, felt, .. } => {
            felt.bands[3] += 1;
            true
        }
        _ => false,
    });
    assert!(agreement.signal >= 1.0 / FEATURE_STEPS && !agreement.agrees());
}

#[test]
fn another_choice_is_found() {
    let (agreement, errors) = changed(|tell| match tell {
        Tell::Chosen {
            slide: 1,
            action,
            outlook,
            ..
        } => {
            *action = outlook.last().unwrap().action;
            true
        }
        _ => false,
    });
    assert_eq!(errors, []);
    assert_eq!(agreement.other_choices.len(), 1);
    assert_eq!(agreement.other_choices[0].slide, 1);
    assert!(!agreement.agrees());
}

#[test]
fn a_missing_report_is_said_and_the_rest_followed() {
    let without = |at: usize| {
        let mut tells = explored().1.clone();
        tells.remove(at);
        follow(&tells)
    };
    let (agreement, errors) = without(place(40, |t| matches!(t, Tell::Block(_))));
    let missing = FollowError::MissingBlock {
        slide: 1,
        expected: 40,
        got: 41,
    };
    assert_eq!(errors, [missing]);
    assert_eq!((agreement.slides, agreement.posteriors), (3, 4));
    // what was felt is lost: nothing after it can be compared
    let (agreement, errors) = without(place(1, |t| matches!(t, Tell::Felt { .. })));
    assert_eq!(
        errors[0],
        FollowError::Order {
            expected: 2,
            got: 3
        }
    );
    assert_eq!(agreement.posteriors, 1);
    // streaming was off
    let silent: Vec<Tell> = explored().1.clone();
    let silent: Vec<Tell> = silent
        .into_iter()
        .filter(|t| !matches!(t, Tell::Block(_)))
        .collect();
    let (agreement, errors) = follow(&silent);
    assert_eq!(
        errors,
        (1..=4).map(FollowError::NoBlocks).collect::<Vec<_>>()
    );
    assert!(agreement.slides == 0 && !agreement.agrees());
}

#[test]
fn lost_samples_are_no_slide_here_either() {
    let at = place(0, |t| matches!(t, Tell::Felt { .. }));
    let mut tells = explored().1[..at].to_vec();
    let rejected = Tell::Rejected {
        slide: 1,
        why: wire::Text::try_from("3 samples were lost").unwrap(),
    };
    let (agreement, errors) = follow(&[&tells[..], std::slice::from_ref(&rejected)].concat());
    assert_eq!((agreement.rejected, agreement.rejected_only_there), (1, 1));
    assert_eq!(errors, []);
    let Some(Tell::Block(last)) = tells.last_mut() else {
        panic!()
    };
    last.lost = 3;
    let (agreement, _) = follow(&[&tells[..], &[rejected]].concat());
    assert_eq!((agreement.rejected, agreement.rejected_only_there), (1, 0));
}
