//! Movements of up to 2 N, for a rig whose finger's mount yields: asked of the probe, judged by the world's force on the finger.

use std::cell::RefCell;
use std::collections::BTreeMap;

use embassy_futures::block_on;
use rayon::prelude::*;
use tactus_core::dsp::Plan;
use tactus_core::features::{Movement, Properties, Property, PropertySet};
use tactus_core::rig::guard::Unguarded;
use tactus_core::rig::{Ended, Refused, RigError};
use tactus_core::table::{Experience, Texture, encode};
use tactus_core::wire::{Command, Event, Failure, Identify, Train};
use tactus_lab::sim::flash::{RamFlash, SECTOR};
use tactus_lab::sim::press::{Bench, FORCE_LIMIT_N, Press, Trouble};
use tactus_lab::sim::probe::{Host, SimProbe, switch_off_and_on, switch_on};
use tactus_lab::sim::rig::SimRig;
use tactus_world::mount::Mount;
use tactus_world::world::Setup;

/// The strongest row of the paper's grid.
fn two_newtons() -> Movement {
    Movement::new(1995, 15_849).unwrap()
}

/// A table of two textures at that movement.
fn table() -> Vec<u8> {
    let traction: PropertySet = [Property::Traction].into_iter().collect();
    let learned = [0.5, 1.5].map(|newton| {
        let mut experience = Experience::default();
        for more in [0.0, 0.1, 0.2] {
            let slide = Properties::new([Some(newton + more), None, None]);
            experience.learn(traction, &slide).unwrap();
        }
        [experience]
    });
    let textures = ["smooth", "rough"].into_iter().zip(&learned);
    let textures = textures.map(|(name, experience)| Texture { name, experience });
    let mut buffer = [0; 256];
    let table = encode(&mut buffer, traction, &[two_newtons()], textures);
    table.unwrap().as_bytes().to_vec()
}

#[derive(Default)]
struct Heard {
    slides: u32,
}

impl Host for Heard {
    fn tell(&mut self, event: Event) {
        let slid = matches!(
            event,
            Event::SlideReport { .. } | Event::TrainingSlide { .. }
        );
        self.slides += u32::from(slid);
    }
}

fn ask(probe: &mut SimProbe<'_, Heard>, command: Command) -> Result<(), Box<Failure>> {
    block_on(probe.perform(&command))
        .map(drop)
        .map_err(Box::new)
}

fn train() -> Command {
    Command::Train(Train {
        name: "felt".try_into().unwrap(),
        trials: 2,
        pilot: false,
        seed: 1,
    })
}

fn identify() -> Command {
    Command::Identify(Identify {
        max_slides: 1,
        ..Identify::default()
    })
}

/// The largest force since this was asked for last, N.
fn pressed_n(probe: &mut SimProbe<'_, Heard>) -> f64 {
    let world = probe.rig.servo.rig().world();
    let pressed_n = world.truth().force_max_n;
    world.reset_extremes();
    pressed_n
}

#[test]
fn a_probe_presses_two_newtons_only_where_that_is_set() {
    let mut rig = SimRig::new(Setup {
        texture: 100,
        ..Setup::default()
    });
    rig.world().mount(Mount::FOR_2_N);
    rig.home().unwrap();
    let (heard, plan, factory) = (RefCell::new(Heard::default()), Plan::new(), table());
    let mut buffer = vec![0; SECTOR];
    let flash = RamFlash::blank();
    let mut probe = switch_on(rig, flash, &factory, &mut buffer, &plan, &heard).unwrap();
    let refused = RigError::Refused(Refused::Force(1995));
    let is_refused = |probe: &mut SimProbe<'_, Heard>| {
        let why = ask(probe, train()).unwrap_err();
        assert_eq!(*why, Failure::Rig(refused));
        assert!(why.to_string().contains("--high-force on"), "{why}");
        assert!(ask(probe, identify()).is_err());
        assert_eq!(pressed_n(probe), 0.0);
    };
    is_refused(&mut probe);
    ask(&mut probe, Command::SetHighForce(true)).unwrap();
    for _ in 0..2 {
        ask(&mut probe, identify()).unwrap();
        let pressed_n = pressed_n(&mut probe);
        assert!((1.9..=FORCE_LIMIT_N).contains(&pressed_n), "{pressed_n} N");
        // once more after the power was off
        probe = switch_off_and_on(probe).unwrap();
    }
    ask(&mut probe, train()).unwrap();
    assert_eq!(heard.borrow().slides, 4);
    ask(&mut probe, Command::SetHighForce(false)).unwrap();
    pressed_n(&mut probe);
    is_refused(&mut probe);
    probe = switch_off_and_on(probe).unwrap();
    is_refused(&mut probe);
}

/// On the mount that such a rig is to have, and on none.
#[test]
fn two_newtons_are_made_and_no_trouble_presses_harder_than_2_2() {
    let movements = [(1585, 25_119), (1995, 15_849), (2000, 63_096)];
    let movements = movements.map(|(mn, um_s)| Movement::new(mn, um_s).unwrap());
    let benches = (1..=50u64).flat_map(|seed| {
        let mounts = [Mount::FOR_2_N, Mount::STIFF];
        let each = |mount| Trouble::ALL.map(|trouble| (mount, trouble));
        mounts
            .into_iter()
            .flat_map(each)
            .map(move |(mount, trouble)| Bench {
                world: seed,
                texture: 1 + (seed * 37 % 117) as u8,
                trouble,
                unguarded: Unguarded::default(),
                mount,
            })
    });
    let benches: Vec<Bench> = benches.collect();
    let presses: Vec<Press> = benches
        .into_par_iter()
        .flat_map_iter(|bench| {
            let movement = movements[bench.world as usize % movements.len()];
            bench.make([movement])
        })
        .collect();
    let mut ends = BTreeMap::new();
    for press in &presses {
        let Press { bench, ended, .. } = press;
        let sprung = bench.mount == Mount::FOR_2_N;
        let key = format!("{:?} sprung {sprung} {ended:?}", bench.trouble);
        let (count, most_n) = ends.entry(key).or_insert((0, 0.0_f64));
        *count += 1;
        *most_n = most_n.max(press.force_max_n);
    }
    println!("{ends:#?}");
    let list = |chosen: &dyn Fn(&&Press) -> bool| {
        let lines = presses.iter().filter(chosen).map(ToString::to_string);
        lines.collect::<Vec<_>>()
    };
    assert_eq!(list(&|press| press.is_too_hard()), [""; 0]);
    let sound = presses
        .iter()
        .filter(|press| press.bench.trouble == Trouble::Sound);
    let made = |press: &&Press| {
        press.ended == Ok(Ended::Whole)
            && press.force_max_n > 0.95 * f64::from(press.movement.force_n())
    };
    let (made, all) = (sound.clone().filter(made).count(), sound.count());
    println!("{made} of {all} sound ones were made");
    assert!(made * 20 >= all * 19, "{made} of {all}");
    let dead = |press: &&Press| press.bench.trouble == Trouble::Dead && press.ended.is_ok();
    assert_eq!(list(&dead), [""; 0]);
}
