//! The oscilloscope's pictures of the book: their durations are those that the firmware is set to, and the book has them as the pins do.

use std::path::Path;

use tactus_core::rig::steps::BASE_HZ;
use tactus_core::sensor::biotac::GAP_US;
use tactus_core::sensor::pressure::SLOTS_HZ;
use tactus_emulator::runs::scope::{Picture, pictures};

use crate::common::elf;

/// What the firmware's board sets: the bus is 84 MHz / 16, a transaction may end so much later than its bytes take (`chip::slots`),
/// the lever's driver has current for so long before it steps, and STEP is high for so long (`chip::lever`), the PWM of the
/// stage's motor (`chip::current`).
const BUS_HZ: f64 = 84e6 / 16.0;
const SLACK_US: f64 = 7.0;
const CURRENT_S: f64 = 10e-3;
const PULSE_S: f64 = 5e-6;
const PWM_HZ: f64 = 84e6 / 4100.0;
/// The lever's driver and the servo are asked once a millisecond.
const TICK_S: f64 = 1e-3;
/// The emergency stop is believed when three looks find it open, and its deadline is 5 ms after it bounced last (`rig::FAULTS`).
const LOOKS_S: f64 = 2e-3;
const DEADLINE_S: f64 = 5e-3;

fn seconds(pictures: &[Picture], file: &str, what: &str) -> f64 {
    let picture = pictures.iter().find(|picture| picture.file == file);
    let seconds = picture.and_then(|picture| picture.seconds(what));
    seconds.unwrap_or_else(|| panic!("{file} does not say {what}"))
}

#[test]
fn durations_are_those_that_the_firmware_is_set_to() {
    let Some(elf) = elf() else {
        return;
    };
    let pictures = pictures(&elf).unwrap();
    let close = |file: &str, what: &str, wanted_s: f64, off_s: f64| {
        let there = seconds(&pictures, file, what);
        assert!(
            (there - wanted_s).abs() <= off_s,
            "{file}, {what}: {there} s, set to {wanted_s} s"
        );
    };
    close("scope-slot.svg", "slot", 1.0 / f64::from(SLOTS_HZ), 2e-6);
    let pause_us = seconds(&pictures, "scope-slot.svg", "pause") * 1e6;
    let gap_us = f64::from(GAP_US);
    assert!(
        (gap_us..gap_us + SLACK_US).contains(&pause_us),
        "{pause_us} us"
    );
    close("scope-word.svg", "8 bits", 8.0 / BUS_HZ, 1e-9);
    let selected = seconds(&pictures, "scope-word.svg", "selected for");
    assert!(
        (16.0 / BUS_HZ..16.0 / BUS_HZ + SLACK_US * 1e-6).contains(&selected),
        "{selected} s"
    );
    let current = seconds(&pictures, "scope-step.svg", "current before the first step");
    assert!(
        (CURRENT_S..CURRENT_S + 2.0 * TICK_S).contains(&current),
        "{current} s"
    );
    close("scope-step.svg", "a pulse is high for", PULSE_S, 0.1e-6);
    close(
        "scope-step.svg",
        "from step to step",
        1.0 / f64::from(BASE_HZ),
        0.5e-6,
    );
    close("scope-pwm.svg", "period", 1.0 / PWM_HZ, 0.02e-6);
    let stops = seconds(&pictures, "scope-stop.svg", "stopped within");
    let bounces = seconds(&pictures, "scope-stop.svg", "bounces for");
    assert!(
        (LOOKS_S..=bounces + DEADLINE_S).contains(&stops),
        "{stops} s, and it bounced for {bounces} s"
    );
    // by the world: an edge of A in each fourth um at the speed of the title
    let encoder = pictures
        .iter()
        .find(|picture| picture.file == "scope-encoder.svg")
        .unwrap();
    let (_, at) = encoder.title.rsplit_once(" at ").unwrap();
    let mm_s: f64 = at.trim_end_matches(" mm/s").parse().unwrap();
    close(
        "scope-encoder.svg",
        "A's period",
        4e-3 / mm_s,
        // the commutation moves the speed by some per cent, and the title's is of a moment after the first edges
        0.05 * 4e-3 / mm_s,
    );
    close(
        "scope-encoder.svg",
        "A to B",
        1e-3 / mm_s,
        0.05 * 1e-3 / mm_s,
    );
}

/// Texts of a picture, without the axis' figures.
fn texts(svg: &str) -> Vec<&str> {
    let texts = svg.split("<text").skip(1);
    let texts = texts.filter_map(|text| text.split_once('>')?.1.split_once('<'));
    let said = texts.map(|(said, _)| said);
    said.filter(|said| said.parse::<f64>().is_err()).collect()
}

/// How far a figure may be from the book's, as a share: the run of the firmware's first moves is not the same after each change.
const CLOSE: f64 = 0.1;

/// Whether two texts are the same but for figures that are close.
fn same(book: &str, now: &str) -> bool {
    let words = |text: &str| text.split(' ').map(str::to_owned).collect::<Vec<_>>();
    let (book, now) = (words(book), words(now));
    let word = |(book, now): (&String, &String)| match (book.parse::<f64>(), now.parse::<f64>()) {
        (Ok(book), Ok(now)) => (book - now).abs() <= CLOSE * now.abs(),
        _ => book == now,
    };
    book.len() == now.len() && book.iter().zip(&now).all(word)
}

#[test]
fn the_book_has_the_pictures_of_the_pins() {
    let Some(elf) = elf() else {
        return;
    };
    let book = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/src");
    let page = std::fs::read_to_string(book.join("bring-up.md")).unwrap();
    for picture in pictures(&elf).unwrap() {
        let (file, svg) = (picture.file, picture.svg());
        assert!(svg.len() < 6_000, "{file} has {} bytes", svg.len());
        assert!(
            page.contains(&format!("]({file})")),
            "bring-up.md has no {file}"
        );
        let drawn = std::fs::read_to_string(book.join(file)).unwrap();
        let (drawn, now) = (texts(&drawn), texts(&svg));
        assert!(now.len() > picture.rows.len() + picture.spans.len());
        assert!(
            drawn.len() == now.len() && drawn.iter().zip(&now).all(|(book, now)| same(book, now)),
            "{file} is stale (cargo xtask docs --scope): {drawn:?}, the pins: {now:?}"
        );
    }
    assert!(!same("slot 227 us", "slot 190 us") && !same("A PD12", "B PD12"));
}
