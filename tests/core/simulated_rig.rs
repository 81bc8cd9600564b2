//! The whole loop on the simulated rig: learning, 200 explorations, and whatever commands come.

use embassy_futures::block_on;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use rayon::prelude::*;
use tactus_core::dsp::Plan;
use tactus_core::explorer::{Config, Explorer, Method};
use tactus_core::features::{Blocks, Measurement, Movement, Property, PropertySet, Slide};
use tactus_core::probe::explore::{ExplorationStep, explore};
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::rig::control::Control;
use tactus_core::rig::{Phase, Refused, Rig as _};
use tactus_core::sensor::pressure::Calibration;
use tactus_core::table::Table;
use tactus_lab::data::replay::measure;
use tactus_lab::sim::collection::{Collection, calibrated, record_texture, texture_name};
use tactus_lab::sim::rig::{Performed, SimError, SimRig};
use tactus_tests::count;
use tactus_world::faults::Fault;
use tactus_world::stage::{FORCE_N_PER_A, SAMPLE_AT_MM, SAMPLE_MM};
use tactus_world::world::Setup;

use crate::rigs::{MOVEMENTS, texture};

/// The verdict was right; the slides of an exploration.
type Explored = (bool, Vec<(Movement, Performed)>);

/// A count of P_DC, N.
const COUNT_N: f64 = 0.0115;

#[test]
fn explorations_are_right_and_made_as_asked() {
    let world = Collection::new(11, (0..count(117, 40)).map(texture).collect(), 5);
    let calibration = calibrated(world.setup(1, 0)).unwrap();
    let bytes = world.learn(Method::Fused, calibration, || ()).unwrap();
    let table = Table::read(&bytes).unwrap();
    let plan = Plan::new();
    let config = Config {
        method: Method::Fused,
        open: true,
        ..Config::default()
    };

    let explored: Vec<Explored> = (0..count(200, 40))
        .into_par_iter()
        .map(|n| {
            let unknown = texture(n);
            let mut rig = SimRig::new(world.setup(unknown, 100 + n));
            rig.control().calibrate(calibration).unwrap();
            let mut explorer = Explorer::<128>::new(table, PropertySet::ALL, config).unwrap();
            let mut movements = Vec::new();
            let tell = |event: ExplorationStep<'_, SimError>| match event {
                ExplorationStep::Measured(action, ..) => {
                    movements.push(table.movement(action.movement).unwrap());
                }
                ExplorationStep::Rejected(_, why) => panic!("{}: {why}", texture_name(unknown)),
                _ => {}
            };
            let verdict = block_on(explore(&mut rig, &mut explorer, &plan, || 0, tell));
            let verdict = verdict.unwrap_or_else(|why| panic!("{}: {why}", texture_name(unknown)));
            let is_right = table.name(verdict.texture) == Some(texture_name(unknown));
            (
                is_right,
                movements
                    .into_iter()
                    .zip(rig.performed().to_vec())
                    .collect(),
            )
        })
        .collect();

    let (right, all) = (explored.iter().filter(|e| e.0).count(), explored.len());
    println!("{right} of {all} right");
    for (movement, slide) in explored.iter().flat_map(|e| &e.1) {
        let force_n = f64::from(movement.force_n());
        let tolerance = (0.05 * force_n).max(COUNT_N);
        assert!(
            (slide.force_n - force_n).abs() <= tolerance,
            "{movement}: {slide:?}"
        );
        assert!(slide.speed_error <= 0.01, "{slide:?}");
        assert!(slide.force_max_n <= 2.2, "{slide:?}");
    }
    assert!(right * 20 >= all * 19, "{right} of {all} right");
}

#[test]
fn the_same_seed_gives_the_same_slides_on_any_number_of_threads() {
    let world = Collection::new(3, vec![10, 47, 100], 1);
    let calibration = calibrated(world.setup(10, 0)).unwrap();
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| world.record(calibration, || ()).unwrap())
    };
    let one = on(1);
    assert!(one == on(3));
    let other = Collection {
        seed: 4,
        ..world.clone()
    };
    assert!(one != other.record(calibration, || ()).unwrap());
}

#[test]
fn a_recorded_slide_has_the_properties_measured_live() {
    // the same rig twice: once it explores, once it records
    let setup = Setup {
        texture: 100,
        trial_seed: 5,
        ..Setup::default()
    };
    let calibration = calibrated(setup).unwrap();
    let recorded = &record_texture(setup, calibration, &[Movement::FOR_FINENESS], 1).unwrap()[0];
    let recorded = Measurement {
        // a rig with force sensing does not look at P_DC
        pdc: None,
        ..measure(&Plan::new(), recorded).unwrap()
    };

    let plan = Plan::new();
    let mut rig = SimRig::new(setup);
    rig.control().calibrate(calibration).unwrap();
    let mut slide = Slide::new(&plan, Movement::FOR_FINENESS);
    block_on(rig.perform(&mut slide)).unwrap();
    assert_eq!(slide.finish().unwrap(), recorded);
}

/// The still finger's power is measured while the stage stands, so a stage's own vibration is taken for texture:
/// roughness and fineness move with its amplitude, in standard deviations of a texture's trials.
#[test]
fn a_stage_that_vibrates_is_taken_for_texture() {
    const TRIALS: u64 = 4;
    const UM: [f64; 4] = [0.0, 1.0, 3.0, 10.0];
    let properties = |(texture, movement), um, trial| {
        let mut rig = SimRig::new(Setup {
            texture,
            trial_seed: trial,
            ..Setup::default()
        });
        rig.world().inject(Fault::StageVibrates { um });
        rig.home().unwrap();
        let recorded = rig.record(movement).unwrap();
        let observed = measure(&Plan::new(), &recorded).unwrap().properties;
        [Property::Roughness, Property::Fineness].map(|p| f64::from(observed.get(p).unwrap()))
    };
    let textures = (1..=117).step_by(117 / count(9, 4) as usize);
    let cells: Vec<_> = textures
        .flat_map(|texture| MOVEMENTS.map(|m| (texture, m)))
        .collect();
    // by amplitude
    let shifts = cells.into_par_iter().map(|cell| {
        let trials =
            UM.map(|um| -> Vec<_> { (0..TRIALS).map(|t| properties(cell, um, t)).collect() });
        let mean = |of: &[[f64; 2]], p: usize| of.iter().map(|x| x[p]).sum::<f64>() / TRIALS as f64;
        let still = &trials[0];
        [0, 1].map(|p| {
            let squares = still.iter().map(|x| (x[p] - mean(still, p)).powi(2));
            let sd = (squares.sum::<f64>() / (TRIALS - 1) as f64).sqrt();
            trials
                .each_ref()
                .map(|moved| (mean(moved, p) - mean(still, p)).abs() / sd)
        })
    });
    let shifts: Vec<[[f64; UM.len()]; 2]> = shifts.collect();
    for property in [0, 1] {
        let moved = [0, 1, 2, 3].map(|um| {
            let mut all: Vec<f64> = shifts.iter().map(|s| s[property][um]).collect();
            all.sort_by(f64::total_cmp);
            (all[all.len() / 2], all[all.len() - 1])
        });
        println!("median and most of {UM:?} um: {moved:.2?} sd");
        assert_eq!(moved[0], (0.0, 0.0));
        let rises = |a: &(f64, f64), b: &(f64, f64)| a.0 <= b.0 && a.1 <= b.1;
        assert!(moved.is_sorted_by(rises), "{moved:?}");
        // what rests on one texture is not told: some texture moves by as much as its trials differ
        assert!(moved[UM.len() - 1].1 > 1.0, "{moved:?}");
    }
}

#[test]
fn calibration_finds_the_constants_of_the_rig() {
    for seed in 1..=3 {
        let mut rig = SimRig::new(Setup {
            texture: 41,
            world_seed: seed,
            finger_seed: seed,
            ..Setup::default()
        });
        rig.home().unwrap();
        let found = rig.calibrate(20_261_121).unwrap();
        println!("{found:?}");
        // the amplifier's gain is off by half a percent at most
        let per_ampere = f64::from(found.newton_per_ampere);
        assert!(
            (per_ampere / FORCE_N_PER_A - 1.0).abs() < 0.02,
            "{per_ampere}"
        );
        let mn_per_count = f64::from(found.pressure.force_mn_per_count);
        assert!((mn_per_count / 11.5 - 1.0).abs() < 0.03, "{mn_per_count}");
        assert_eq!(found.date, 20_261_121);
        assert!(found.serial.starts_with(b"BT"));
        assert_eq!(RigCalibration::from_bytes(&found.to_bytes()), Ok(found));
    }
}

#[test]
fn traction_is_the_shear_that_really_acts() {
    for texture in [30, 43, 47, 84] {
        let setup = Setup {
            texture,
            trial_seed: 2,
            ..Setup::default()
        };
        let calibration = calibrated(setup).unwrap();
        let mut rig = SimRig::new(setup);
        rig.control().calibrate(calibration).unwrap();
        rig.home().unwrap();
        let mut shear = Vec::new();
        rig.control().start(Movement::FOR_TRACTION, 0.5).unwrap();
        let plan = Plan::new();
        let mut slide = Slide::new(&plan, Movement::FOR_TRACTION);
        let mut blocks = Blocks::default();
        while rig.control().phase() != Phase::Ready {
            let outputs = rig.tick().clone();
            let (phase, shear_mn) = (&outputs.sample_phase, outputs.shear_mn);
            if let Some(block) = blocks.put(phase, &outputs.pac, shear_mn) {
                slide.take(&block);
            }
            if shear_mn.is_some() {
                shear.push(rig.world().truth().shear_n.abs());
            }
        }
        slide.take(&blocks.end(0));
        let slide = slide.finish().unwrap();
        let truth = shear.iter().sum::<f64>() / shear.len() as f64;
        let traction = f64::from(slide.properties.get(Property::Traction).unwrap());
        assert!(
            (traction - truth).abs() < 0.03 + 0.03 * truth,
            "{}: {traction} {truth}",
            texture_name(texture)
        );
    }
}

#[test]
fn the_skin_is_reported_worn_before_its_roughness_goes() {
    // a high-wear movement on a rough texture, until the finger's own wear shows
    let mut rig = SimRig::new(Setup {
        texture: 100,
        ..Setup::default()
    });
    rig.home().unwrap();
    rig.calibrate_current().unwrap();
    rig.control().allow_high_force(true);
    let plan = Plan::new();
    let rough = Movement::from_si(1.8, 100.0).unwrap();
    let roughness = |rig: &mut SimRig| {
        let recorded = rig.record(rough).unwrap();
        let observed = measure(&plan, &recorded).unwrap();
        let worn = rig.control().skin().is_worn();
        (observed.properties.get(Property::Roughness).unwrap(), worn)
    };
    let new: Vec<f32> = (0..15).map(|_| roughness(&mut rig).0).collect();
    // the slides from the warning on: they have somewhat more wear, and are as many as the new ones
    let warning = (0..400).find(|_| roughness(&mut rig).1);
    assert!(warning.is_some(), "no warning");
    let warned: Vec<f32> = (0..15).map(|_| roughness(&mut rig).0).collect();
    let (energy, truth) = (
        f64::from(rig.control().skin().energy_j()),
        rig.world().truth(),
    );
    while rig.world().truth().wear < 0.6 {
        rig.slide(rough, 0.5, |_, _| ()).unwrap();
    }
    let late: Vec<f32> = (0..15).map(|_| roughness(&mut rig).0).collect();
    let mean = |r: &[f32]| r.iter().sum::<f32>() / r.len() as f32;
    let spread = (new.iter().map(|r| (r - mean(&new)).powi(2)).sum::<f32>() / 14.0).sqrt();
    assert!(rig.control().skin().is_worn());
    assert!(
        (mean(&new) - mean(&warned)).abs() < spread,
        "roughness has gone before the warning"
    );
    assert!(
        (mean(&new) - mean(&late)).abs() > 2.0 * spread,
        "roughness does not go with the skin"
    );
    // too much rather than too little: on the ramps, acceleration counts as shear
    assert!(
        (0.95..1.25).contains(&(energy / truth.sliding_j)),
        "counted {energy} J of {} J",
        truth.sliding_j
    );
    rig.control().skin().replaced();
    assert!(!rig.control().skin().is_worn());
}

/// A request of a user, or of a broken host.
#[derive(Clone, Debug)]
enum Command {
    Home,
    Start {
        force_mn: u16,
        speed_um_s: u32,
        start: f32,
    },
    Unloaded(u32),
    Stop,
    Reset,
    AllowHighForce(bool),
    Calibrate {
        mn_per_count: f32,
        no_contact: f32,
        newton_per_ampere: f32,
    },
    Place(u8),
    SampleChanged,
    Weigh(u16),
}

fn command() -> impl Strategy<Value = Command> {
    let any_float = || {
        prop_oneof![
            Just(f32::NAN),
            Just(f32::INFINITY),
            -1e3f32..1e4,
            5.0f32..20.0
        ]
    };
    prop_oneof![
        2 => Just(Command::Home),
        6 => (100u16..=2000, 5_000u32..=150_000, any_float())
            .prop_map(|(force_mn, speed_um_s, start)| Command::Start { force_mn, speed_um_s, start }),
        1 => prop_oneof![5_000u32..150_000, any::<u32>()].prop_map(Command::Unloaded),
        1 => Just(Command::Stop),
        1 => Just(Command::Reset),
        1 => any::<bool>().prop_map(Command::AllowHighForce),
        1 => (any_float(), any_float(), any_float()).prop_map(
            |(mn_per_count, no_contact, newton_per_ampere)| Command::Calibrate {
                mn_per_count,
                no_contact,
                newton_per_ampere
            }
        ),
        1 => (1u8..=117).prop_map(Command::Place),
        1 => Just(Command::SampleChanged),
        1 => (0u16..=2000).prop_map(Command::Weigh),
    ]
}

fn obey(control: &mut Control, command: &Command) -> Result<(), Refused> {
    match *command {
        Command::Home => control.home(),
        Command::Start {
            force_mn,
            speed_um_s,
            start,
        } => control.start(Movement::new(force_mn, speed_um_s).unwrap(), start),
        Command::Unloaded(speed) => control.start_unloaded(speed),
        Command::Stop => {
            control.stop();
            Ok(())
        }
        Command::Reset => control.reset(),
        Command::Weigh(mn) => control.weigh(mn),
        Command::AllowHighForce(allow) => {
            control.allow_high_force(allow);
            Ok(())
        }
        Command::Calibrate {
            mn_per_count,
            no_contact,
            newton_per_ampere,
        } => {
            let pressure = Calibration {
                force_mn_per_count: mn_per_count,
                pdc_no_contact: no_contact,
                ..Calibration::PAPER
            };
            control.calibrate(RigCalibration {
                pressure,
                newton_per_ampere,
                ..*control.calibration()
            })
        }
        Command::SampleChanged => {
            control.sample_changed();
            Ok(())
        }
        Command::Place(_) => Ok(()),
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: count(48, 8) as u32,
        rng_seed: RngSeed::Fixed(3),
        failure_persistence: None,
        ..ProptestConfig::default()
    })]
    #[test]
    fn no_commands_leave_the_limits_of_force_and_travel(
        texture in 1u8..=117,
        seed in 0u64..1000,
        commands in proptest::collection::vec((command(), prop_oneof![0u32..50, 0u32..3000, 3000u32..40_000]), 1..25),
    ) {
        let mut rig = SimRig::new(Setup { texture, trial_seed: seed, ..Setup::default() });
        let _ = rig.home();
        for (command, wait_ms) in &commands {
            if let Command::Place(texture) = command {
                let _ = rig.place(*texture);
            }
            let _ = obey(rig.control(), command);
            for _ in 0..*wait_ms {
                rig.tick();
            }
        }
        let truth = rig.world().truth();
        prop_assert!(truth.force_max_n <= 2.2, "{} N", truth.force_max_n);
        let (low, high) = truth.stage_reach_mm;
        // never into a hard stop: the switches lie 1 mm beyond the sample
        prop_assert!(low > SAMPLE_AT_MM - 2.0 && high < SAMPLE_AT_MM + SAMPLE_MM + 2.0, "{low} to {high} mm");
        prop_assert_eq!(truth.lever_bad_pulses, 0);
    }
}
