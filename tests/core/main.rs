//! Tests of core and lab across the crates: golden values, reference figures, faults, explorations.

mod arm;
mod crush;
mod early;
mod fault_cases;
mod faults;
mod figures;
mod fixed_point;
mod formats;
mod fused_recipe;
mod golden;
mod half_words;
mod high_force;
mod oracle;
mod pace;
mod page;
mod played;
mod press;
mod presses;
mod printer;
mod recordings;
mod refresh;
mod rigs;
mod same;
mod simulated_rig;
