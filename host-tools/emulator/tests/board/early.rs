//! Slides of the emulated rig that end as soon as the verdict is certain: in its reports and by the world's truth. The rig's
//! firmware has the feature `early`.

use std::path::Path;

use tactus_core::explorer::Method;
use tactus_core::wire::{Event, Identify, Phase};
use tactus_emulator::host::exploration::{Exploration, explore};
use tactus_emulator::host::milestones::Milestones;
use tactus_emulator::host::under_finger::{self, FirmwareData};
use tactus_lab::eval::learn::know_lengths;
use tactus_lab::sim::collection::Collection;
use tactus_world::faults::Fault;

use crate::common::{boot, elf};

/// A world of so many textures that holds this one, and what is learned of it with and without lengths.
fn world(seed: u64, texture: u8, among: u8) -> (Collection, [FirmwareData; 2]) {
    let collection = Collection {
        seed,
        textures: Collection::spread(texture, among),
        trials: 5,
    };
    let early = under_finger::simulated_early(&collection, Method::Fused, || ()).unwrap();
    let whole = FirmwareData {
        table: know_lengths(&early.table, &[]).unwrap(),
        ..early.clone()
    };
    (collection, [whole, early])
}

/// What an exploration came to.
struct Seen {
    explored: Exploration,
    /// What it said of ends before the end, ms at constant speed.
    early: Vec<u16>,
    /// How far the stage went while the firmware said that it slides, in the last slide, mm by the world.
    way_mm: f64,
    /// Largest force on the finger since it homed, N by the world.
    most_n: f64,
    seconds_to_verdict: f64,
}

fn seen(elf: &Path, world: &Collection, known: &FirmwareData, texture: u8) -> Seen {
    let unknown = under_finger::mounted(world, texture, 7);
    let mut talk = boot(elf, &unknown, None);
    talk.teach(&known.calibration, &known.table, |_, _| ())
        .unwrap();
    talk.board().rig().world().reset_extremes();
    let (mut early, mut path, mut sliding, mut most_n) = (Vec::new(), (0.0, 0.0), false, 0.0_f64);
    let mut times = Milestones::default();
    times.begin(talk.now_ns());
    let asked = Identify {
        seed: 11,
        ..Identify::default()
    };
    let explored = explore(
        &mut talk,
        &known.table,
        asked,
        &unknown.name,
        |board, report| {
            let (now_ns, truth) = (board.now_ns(), board.rig().world().truth());
            most_n = most_n.max(truth.force_max_n);
            if sliding {
                path.1 = truth.stage_mm;
            }
            let Some(report) = report else { return };
            times.hear(now_ns, &report.event);
            match report.event {
                Event::Early(ms) => early.push(ms),
                Event::Phase(phase) => {
                    sliding = phase == Phase::Sliding;
                    if sliding {
                        path = (truth.stage_mm, truth.stage_mm);
                    }
                }
                _ => {}
            }
        },
    );
    Seen {
        explored: explored.unwrap(),
        early,
        way_mm: path.1 - path.0,
        most_n,
        seconds_to_verdict: times.seconds_to_verdict().unwrap(),
    }
}

#[test]
fn a_slide_ends_when_the_verdict_is_certain() {
    let Some(elf) = elf() else { return };
    let (collection, known) = world(3, 47, 6);
    let [whole, early] = known
        .each_ref()
        .map(|known| seen(&elf, &collection, known, 47));
    for seen in [&whole, &early] {
        // the PC that follows has seen the slide end at the same length, with the same features
        assert_eq!(seen.explored.missed(), [""; 0]);
        assert!(seen.explored.right() && seen.explored.found.sure);
        assert!(seen.most_n < 2.2, "{} N", seen.most_n);
    }
    // without lengths all slides are whole ...
    assert_eq!(whole.early, [0; 0]);
    // ... and with them the first is the same one, which ends when it is certain
    let ([(movement, long), ..], [.., (same, short)]) =
        (&whole.explored.slides[..], &early.explored.slides[..])
    else {
        panic!("no slide was made");
    };
    assert_eq!(early.early.len(), 1);
    let ms = early.early[0];
    assert!(Collection::LENGTHS_MS.contains(&ms));
    let seconds =
        |slide: &tactus_emulator::board::Slide| (slide.ended_ns - slide.began_ns) as f64 * 1e-9;
    println!(
        "{movement}: {:.2} s and {:.1} mm; {same}: {:.2} s and {:.1} mm for {ms} ms, verdict after {:.1} and {:.1} s",
        seconds(long),
        whole.way_mm,
        seconds(short),
        early.way_mm,
        whole.seconds_to_verdict,
        early.seconds_to_verdict
    );
    // two ramps, 0.2 s to settle, the length, and at most 0.15 s: a block that must fill, the look, the stage that settles
    let speed_mm_s = f64::from(same.speed_mm_s());
    let least_s = 0.2 + f64::from(ms) * 1e-3 + 2.0 * speed_mm_s / 1000.0;
    let took_s = seconds(short);
    assert!(
        (least_s - 0.05..least_s + 0.15).contains(&took_s),
        "{took_s} s, {least_s} s at least"
    );
    // where the stage was says the same: one ramp's time at full speed stands for two ramps
    let way_mm = speed_mm_s * (took_s - speed_mm_s / 1000.0);
    assert!(
        (early.way_mm - way_mm).abs() < 0.05 * way_mm + 0.3,
        "{} mm of {way_mm}",
        early.way_mm
    );
    assert!(early.seconds_to_verdict < whole.seconds_to_verdict);
}

/// The emergency stop, while the stage brakes for a verdict: nothing moves on, and there is no verdict. It takes the motors' supply: the
/// finger stays where it is.
#[test]
fn the_guard_trips_while_a_slide_is_ended() {
    let Some(elf) = elf() else { return };
    let (collection, [_, early]) = world(3, 47, 6);
    let unknown = under_finger::mounted(&collection, 47, 7);
    let mut talk = boot(&elf, &unknown, None);
    talk.teach(&early.calibration, &early.table, |_, _| ())
        .unwrap();
    talk.board().rig().world().reset_extremes();
    let asked = Identify {
        seed: 11,
        ..Identify::default()
    };
    let (mut sliding_ms, mut fast_mm_s, mut injected) = (0, 0.0_f64, false);
    let mut told = Vec::new();
    let ended = explore(
        &mut talk,
        &early.table,
        asked,
        &unknown.name,
        |board, report| {
            if let Some(report) = report {
                match report.event {
                    Event::Phase(Phase::Sliding) => (sliding_ms, fast_mm_s) = (1, 0.0),
                    Event::Phase(_) => sliding_ms = 0,
                    Event::Verdict(_) | Event::SlideReport { .. } => told.push("a verdict"),
                    Event::Fault(tactus_core::rig::Fault::EStop) => told.push("the stop"),
                    _ => {}
                }
                return;
            }
            let speed_mm_s = board.rig().world().truth().speed_mm_s.abs();
            fast_mm_s = fast_mm_s.max(speed_mm_s);
            sliding_ms += u32::from(sliding_ms > 0);
            // up to 2 s no slide of this world ends by itself
            let brakes = (600..1000).contains(&sliding_ms) && speed_mm_s < 0.8 * fast_mm_s;
            if brakes && !injected {
                injected = true;
                board.inject(Fault::EStop);
            }
        },
    );
    assert!(injected, "no slide was ended");
    assert!(ended.is_err(), "{ended:?}");
    assert_eq!(told, ["the stop"]);
    let truth = talk.board().rig().world().truth();
    assert!(truth.force_max_n < 2.2, "{truth:?}");
    assert!(truth.speed_mm_s.abs() < 0.5, "{truth:?}");
}
