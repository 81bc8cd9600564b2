//! A probe that takes requests, and runs for as long as its caller allows.

use std::cell::RefCell;
use std::future::Future;
use std::pin::Pin;
use std::rc::Rc;
use std::task::{Context, Waker};
use std::time::Duration;

use embassy_futures::yield_now;
use serde::Serialize;
use serde::de::DeserializeOwned;
use tactus_core::explorer::Method;
use tactus_core::features::{Movement, Observation, Slide};
use tactus_core::probe::seams::RigHandle as _;
use tactus_core::rig::Rig as _;
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::table::{Name, is_false_alarm};
use tactus_core::wire::{self, Command, Identify};

use super::message::{Happening, Measured, Reply, Request, Settings, movement_of};
use super::scene::Scene;
use super::slides::{TRIALS, Trials, WORLD, table};
use super::standing::PLAN;
use crate::sim::collection::{Collection, calibrated};
use crate::sim::flash::{RamFlash, TABLE};
use crate::sim::probe::{SimProbe, switch_on};
use crate::sim::rig::SimRig;
use tactus_world::textures::TEXTURES;
use tactus_world::world::Setup;

enum Job {
    Serve(Box<Command>),
    Move(Movement, u32),
}

impl Job {
    fn on(self, texture: u8) -> Result<(Self, Option<u8>), &'static str> {
        if !(1..=117).contains(&texture) {
            return Err("textures have the numbers 1 to 117");
        }
        Ok((self, Some(texture)))
    }
}

type Desk = Rc<RefCell<Option<(Job, Option<u8>)>>>;

struct Preparing {
    settings: Settings,
    collection: Collection,
    calibration: RigCalibration,
    trials: Vec<Trials>,
}

struct Running {
    paper: bool,
    scene: Rc<RefCell<Scene>>,
    desk: Desk,
    life: Pin<Box<dyn Future<Output = ()>>>,
}

/// A viewer's session with a simulated probe.
#[derive(Default)]
pub struct Session {
    preparing: Option<Preparing>,
    running: Option<Running>,
}

type Answered = Result<Reply, Box<dyn std::error::Error>>;

impl Session {
    /// Carries out a request in JSON, and replies in JSON: see `live/message.rs`.
    pub fn ask(&mut self, request: &str) -> String {
        asked_in_json(request, |request| match request {
            Ok(request) => self.answer(request).unwrap_or_else(|why| Reply::Error {
                why: sentence(why.as_ref()),
            }),
            Err(why) => Reply::Error { why },
        })
    }

    fn answer(&mut self, request: Request) -> Answered {
        match request {
            Request::Textures => Ok(Reply::Textures {
                names: TEXTURES.iter().map(|texture| texture.name).collect(),
            }),
            Request::World(settings) => self.begin(settings),
            Request::Prepare => self.prepare(),
            Request::Identify {
                texture,
                seed,
                threshold,
                false_alarm,
                max_slides,
            } => {
                if !(threshold > 0.0 && threshold <= 1.0) {
                    return Err("the threshold is a probability between 0 and 1".into());
                }
                if false_alarm.is_some_and(|share| !is_false_alarm(share)) {
                    return Err("false alarms are a share from 0.0005 to 0.2".into());
                }
                if max_slides == 0 {
                    return Err("at least one slide".into());
                }
                let running = self.idle()?;
                let wanted = Identify {
                    seed,
                    threshold,
                    false_alarm,
                    max_slides,
                    method: running.paper.then_some(Method::Paper),
                    ..Identify::default()
                };
                let job = Job::Serve(Box::new(Command::Identify(wanted)));
                running.follow(job.on(texture)?)
            }
            Request::Move {
                texture,
                seed,
                force_n,
                speed_mm_s,
            } => {
                let movement = Movement::from_si(force_n, speed_mm_s)?;
                let running = self.idle()?;
                running.follow(Job::Move(movement, seed).on(texture)?)
            }
            Request::Label { name } => {
                let name = Name::try_from(name.trim()).map_err(|_| "the name is too long")?;
                if name.is_empty() {
                    return Err("a texture needs a name".into());
                }
                self.idle()?
                    .follow((Job::Serve(Box::new(Command::Label(name))), None))
            }
            Request::Skin { wear } => {
                self.running()?.scene.borrow_mut().wear = Some(wear.clamp(0.0, 1.0));
                self.step(0)
            }
            Request::Stop => {
                self.running()?.scene.borrow_mut().stop = true;
                self.step(0)
            }
            Request::Step { ms } => self.step(ms),
        }
    }

    fn begin(&mut self, settings: Settings) -> Answered {
        if !(2..=117).contains(&settings.textures) {
            return Err("a probe here knows 2 to 117 textures".into());
        }
        if !(0.0..=10.0).contains(&settings.drift) {
            return Err("drift is 0 to 10 times the usual".into());
        }
        self.running = None;
        let collection = Collection::new(
            settings.world,
            Collection::spread(1, settings.textures),
            TRIALS,
        );
        let trials = if settings.world == WORLD {
            let mut all = Trials::of_world()?;
            all.retain(|trials| collection.textures.contains(&trials.texture));
            all
        } else {
            Vec::new()
        };
        let of = collection.textures.len();
        let done = trials.len();
        let calibration = calibrated(shimmed(collection.setup(1, 0)))?;
        self.preparing = Some(Preparing {
            settings,
            collection,
            calibration,
            trials,
        });
        Ok(Reply::Preparing { done, of })
    }

    fn prepare(&mut self) -> Answered {
        let mut now = self.preparing.take().ok_or("no world was asked for")?;
        let of = now.collection.textures.len();
        if let Some(&texture) = now.collection.textures.get(now.trials.len()) {
            let made = Trials::make(now.collection.seed, texture, now.calibration)?;
            now.trials.push(made);
            let done = now.trials.len();
            self.preparing = Some(now);
            return Ok(Reply::Preparing { done, of });
        }
        let Preparing {
            settings:
                Settings {
                    paper,
                    drift,
                    trial,
                    ..
                },
            collection,
            calibration,
            trials,
        } = now;
        let factory = table(&trials, paper, drift)?;
        let mut rig = SimRig::new(shimmed(collection.setup(1, 1 + trial)));
        rig.control().calibrate(calibration)?;
        rig.home()?;
        let (scene, desk) = (Rc::new(RefCell::new(Scene::default())), Desk::default());
        let life = live(rig, factory, Rc::clone(&scene), Rc::clone(&desk));
        let mut running = Running {
            paper,
            scene,
            desk,
            life: Box::pin(life),
        };
        running.poll();
        let known = running.scene.borrow().monitor.known().clone();
        if known.textures.is_empty() {
            return Err("the probe does not start".into());
        }
        self.running = Some(running);
        Ok(Reply::Ready(known))
    }

    fn running(&mut self) -> Result<&mut Running, &'static str> {
        self.running.as_mut().ok_or("there is no probe yet")
    }

    fn idle(&mut self) -> Result<&mut Running, &'static str> {
        let running = self.running()?;
        if running.scene.borrow().busy {
            return Err("the probe is busy: stop it first");
        }
        Ok(running)
    }

    fn step(&mut self, ms: u32) -> Answered {
        let running = self.running()?;
        running.go_on(ms);
        Ok(Reply::Frame(running.scene.borrow_mut().frame()))
    }
}

/// Samples on shims, so that the finger's way down is short.
fn shimmed(setup: Setup) -> Setup {
    Setup {
        shimmed: true,
        ..setup
    }
}

pub(crate) fn asked_in_json<Q: DeserializeOwned, R: Serialize>(
    request: &str,
    answer: impl FnOnce(Result<Q, String>) -> R,
) -> String {
    let request = serde_json::from_str(request);
    let reply = answer(request.map_err(|why| format!("no request: {why}")));
    serde_json::to_string(&reply).unwrap_or_default()
}

pub(crate) fn sentence(why: &dyn std::error::Error) -> String {
    let mut sentence = why.to_string();
    let mut cause = why.source();
    while let Some(deeper) = cause {
        sentence = format!("{sentence}: {deeper}");
        cause = deeper.source();
    }
    sentence
}

impl Running {
    fn follow(&mut self, job: (Job, Option<u8>)) -> Answered {
        self.scene.borrow_mut().busy = true;
        *self.desk.borrow_mut() = Some(job);
        Ok(Reply::Frame(self.scene.borrow_mut().frame()))
    }

    fn go_on(&mut self, ms: u32) {
        {
            let mut scene = self.scene.borrow_mut();
            scene.until = Some(scene.now() + Duration::from_millis(ms.into()));
        }
        // a store that writes lets others run first, too: keep going until it waits for the time, or for a job
        let goes_on = |running: &Self| {
            let scene = running.scene.borrow();
            scene.busy && !scene.waits.get()
        };
        self.scene.borrow().waits.set(false);
        while {
            self.poll();
            goes_on(self)
        } {}
    }

    fn poll(&mut self) {
        let mut context = Context::from_waker(Waker::noop());
        // it never ends
        let _ = self.life.as_mut().poll(&mut context);
    }
}

async fn live(rig: SimRig, factory: Vec<u8>, scene: Rc<RefCell<Scene>>, desk: Desk) {
    let mut buffer = vec![0; TABLE];
    let on = switch_on(rig, RamFlash::blank(), &factory, &mut buffer, &PLAN, &scene);
    let mut probe = match on {
        Ok(probe) => probe,
        Err(why) => {
            scene.borrow_mut().monitor.happens(Happening::Refused {
                why: why.to_string(),
            });
            return std::future::pending().await;
        }
    };
    let mut id = 0;
    loop {
        {
            let mut scene = scene.borrow_mut();
            scene.monitor.knows(probe.memory.in_force());
            scene.monitor.learned();
            scene.busy = false;
            scene.stop = false;
            // nothing moves: every due change is made
            scene.until = None;
        }
        let (job, texture) = loop {
            if let Some(job) = desk.borrow_mut().take() {
                break job;
            }
            yield_now().await;
        };
        // a new request gets its time with the next step
        scene.borrow_mut().busy = true;
        if let Some(texture) = texture.filter(|texture| scene.borrow().texture() != *texture) {
            // a change of the sample needs the finger out of the way first
            let lifted = probe.rig.lift().await;
            scene.borrow_mut().place(texture, lifted);
        }
        match job {
            Job::Serve(command) => {
                let command = *command;
                if let (Command::Identify(wanted), Ok(table)) = (&command, probe.memory.table()) {
                    let config = wanted.config(table.contents());
                    scene.borrow_mut().monitor.explores(config);
                }
                id = u16::wrapping_add(id, 1);
                let request = wire::Request { id, command };
                probe.serve(&request).await;
            }
            Job::Move(movement, seed) => {
                let made = make(&mut probe, &scene, movement, seed).await;
                scene.borrow_mut().monitor.happens(made);
                scene.borrow_mut().monitor.happens(Happening::Done);
            }
        }
    }
}

async fn make<'p>(
    probe: &mut SimProbe<'p, Scene>,
    scene: &RefCell<Scene>,
    movement: Movement,
    seed: u32,
) -> Happening {
    probe.memory.episode = None;
    probe.rig.begin(seed).await;
    let mut slide = Slide::new(&PLAN, movement);
    let made = match probe.rig.perform(&mut slide).await {
        Ok(()) => probe.rig.lifted().await,
        Err(why) => Err(why),
    };
    if let Err(why) = made {
        return Happening::Refused {
            why: why.to_string(),
        };
    }
    match slide.finish() {
        Err(why) => Happening::Rejected {
            why: why.to_string(),
        },
        Ok(measurement) => {
            let seen = Observation::from(&measurement);
            let table = probe.memory.table().ok();
            let at = table.and_then(|table| movement_of(table, movement));
            Happening::Moved {
                movement: at,
                place: at
                    .zip(table)
                    .and_then(|(at, table)| scene.borrow().monitor.place_of(table, at, &seen)),
                measured: Measured::new(movement, &seen),
            }
        }
    }
}
