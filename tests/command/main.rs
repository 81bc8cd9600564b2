//! Tests of the command `tactus` as a person or a script uses it, and of the examples.

mod bad_input;
mod command_line;
mod convert;
mod device;
mod kills;
mod output;
mod study;
mod verdicts;
