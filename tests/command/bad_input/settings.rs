//! The settings that a probe keeps in its flash.

use embassy_futures::block_on;
use tactus_core::store::{SettingsError, Store};
use tactus_lab::sim::flash::{RamFlash, SECTOR};

/// Where the settings begin.
const SETTINGS: usize = 2 * SECTOR;
/// What was set last, and before that.
const SET: f32 = 0.005;
const BEFORE: f32 = 0.05;

type Opened = Store<RamFlash>;

/// The flash of a probe after each thing that was set.
fn flashes() -> [Vec<u8>; 3] {
    let mut store: Opened = block_on(Store::open(RamFlash::blank())).unwrap();
    let mut flashes = vec![];
    for share in [None, Some(BEFORE), Some(SET)] {
        block_on(store.set_false_alarm(share)).unwrap();
        let flash = store.close();
        flashes.push(flash.bytes.clone());
        store = block_on(Store::open(flash)).unwrap();
    }
    flashes.try_into().unwrap()
}

/// What a probe with this flash says when it starts, and what is set.
fn started(bytes: Vec<u8>) -> (Option<SettingsError>, Option<f32>) {
    let mut store: Opened = block_on(Store::open(RamFlash::of(bytes))).unwrap();
    block_on(store.mend()).unwrap();
    let told = store.settings().err().or(store.damaged_record());
    (told, block_on(store.false_alarm()).unwrap_or(None))
}

/// A cell of the table.
fn cell((told, set): (Option<SettingsError>, Option<f32>)) -> String {
    let told = told.map_or("nothing".to_owned(), |why| format!("\"{why}\""));
    let set = match set {
        Some(SET) => "what was set".to_owned(),
        Some(BEFORE) => "what was set before".to_owned(),
        None => "the table's own".to_owned(),
        Some(other) => panic!("nobody has set {other}"),
    };
    format!("{told}; in force is {set}")
}

pub(super) fn section() -> String {
    let [_, before, whole] = flashes();
    let written: Vec<usize> = (SETTINGS..whole.len())
        .filter(|&at| before[at] != whole[at])
        .collect();
    let flipped = {
        let last = whole[SETTINGS..]
            .iter()
            .rposition(|byte| *byte != 0xFF)
            .unwrap();
        // all that is written of the page in use
        let first_page = SETTINGS..SETTINGS + SECTOR - 20;
        let end = whole[first_page.clone()]
            .iter()
            .rposition(|byte| *byte != 0xFF);
        let end = end.unwrap_or(last) + 1;
        let mut cells: Vec<String> = (0..64)
            .map(|n| {
                let mut bytes = whole.clone();
                bytes[SETTINGS + n * (end - 1) / 63] ^= 1 << (n % 8);
                cell(started(bytes))
            })
            .collect();
        cells.sort();
        cells.dedup();
        cells.join("; or ")
    };
    let with = |change: &dyn Fn(&mut [u8])| {
        let mut bytes = whole.clone();
        change(&mut bytes);
        cell(started(bytes))
    };
    let half = written[..written.len() / 2].to_vec();
    let rows = [
        (
            "missing: a new probe",
            cell(started(RamFlash::<SECTOR>::blank().bytes)),
        ),
        (
            "empty: erased sectors",
            with(&|bytes| bytes[SETTINGS..].fill(0xFF)),
        ),
        ("cut short: the power failed while it was written", {
            let mut bytes = before.clone();
            half.iter().for_each(|&at| bytes[at] = whole[at]);
            cell(started(bytes))
        }),
        ("a flipped bit, 64 places one at a time", flipped),
        (
            "wrong type: other bytes all over",
            with(&|bytes| bytes[SETTINGS..].fill(0xA5)),
        ),
        (
            "huge: a record longer than any",
            with(&|bytes| {
                // the record's length: all its bits
                let at = written[0] / 4 * 4;
                bytes[at..at + 4].fill(0);
            }),
        ),
        (
            "another version",
            format!(
                "\"{}\"; in force is the table's own (a test of the core: `damaged_settings_are_reported_and_erased_without_the_tables`)",
                SettingsError::Schema(9)
            ),
        ),
        (
            "no permission",
            "cannot be: nobody else has a probe's flash".to_owned(),
        ),
    ];
    let mut text = String::from(
        "## A probe's settings\n\nWhat `tactus device settings --false-alarm` has set, in the flash of a probe that starts. What it tells comes over the link, and the store's other records are treated alike.\n\n\
         | damage | what it tells, and what is in force |\n|---|---|\n",
    );
    for (name, answer) in rows {
        text += &format!("| {name} | {answer} |\n");
    }
    text + "\n"
}
