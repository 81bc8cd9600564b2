//! Wrote `reasons-6-records.jsonl` in this folder: see README.md. It is compiled at that commit only, and shall stay as it is.

use std::io::Write as _;
use std::path::PathBuf;

use serde_json::json;
use tactus_core::store::{Setting, SettingsError, StoreError};
use tactus_core::wire::{Failure, MAX_FRAME, MemoryError, encode};

fn main() {
    let out = PathBuf::from(std::env::args().nth(1).expect("a folder"));
    let mut file = std::fs::File::create(out.join("reasons-6-records.jsonl")).unwrap();
    let settings = [
        Setting::Calibration,
        Setting::Skin,
        Setting::Limits,
        Setting::Training,
        Setting::SelfLearned,
    ];
    // one that is not listed does not compile
    let kind = |setting: &Setting| match setting {
        Setting::Calibration => 0,
        Setting::Skin => 1,
        Setting::Limits => 2,
        Setting::Training => 3,
        Setting::SelfLearned => 4,
    };
    assert!(settings.iter().map(kind).eq(0..5));
    let errors = settings.map(|setting| StoreError::Settings(SettingsError::Record(setting)));
    let memory = errors.map(|why| Failure::Memory(MemoryError::Store(why)));
    let broken = errors.map(|why| Failure::Memory(MemoryError::Broken(why)));
    let not_learned = errors.map(|why| Failure::NotLearned(MemoryError::Store(why)));
    for message in [memory, broken, not_learned].into_iter().flatten() {
        let mut buffer = [0; MAX_FRAME + 1];
        let frame = encode(&message, &mut buffer).unwrap();
        let frame: String = frame.iter().map(|b| format!("{b:02x}")).collect();
        writeln!(file, "{}", json!({"frame": frame, "message": message})).unwrap();
    }
}
