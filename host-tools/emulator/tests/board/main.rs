//! The tests that run firmware on the emulated board, as one program: its threads share the machine's cores to the end.
//! By name: `cargo test --test board faults::`.

mod arm;
mod boot;
mod bringup;
mod broken_code;
mod changed_cuts;
mod common;
mod current;
mod cuts;
mod damaged_store;
mod encoder;
mod explore;
mod faults;
mod fingers;
mod halt;
mod handheld;
mod handheld_link;
mod long_table;
mod motion;
mod person;
mod power_cut;
mod referee;
mod rescue;
mod scenario;
mod serve;
mod settings;
mod silicon;
mod silicon_image;
mod slots;
mod teach;
mod verify;
mod weights;
