//! The order of the house. Files do not import each other in a circle, a room knows those before it and none of those after
//! it, and no file of product code is longer than 600 lines.
//!
//! A file imports another one when a path of it leads to a definition there: in a `use`, a type, an expression, a pattern, an
//! attribute, or a macro. Paths are followed through modules, `use`, `pub use` and globs to the file that defines the name; of
//! `Type::name` and `self.name()` that is also the file whose `impl` block has `name`. A `pub use` alone is no import: it
//! shows something, and the file that shows it need not know it. Rooms are stricter: there it counts, and so does each
//! module that a path names on its way. Tests may import what they test.
//!
//! What is not seen: methods of other values than `self`, names that macros make up, paths in documentation.

mod house;
mod names;
mod planted;
mod registers;
mod rules;
mod source;
mod uses;

#[test]
fn the_house_is_in_order() {
    let here = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let faults = rules::faults(here.ancestors().nth(2).unwrap(), &house::PACKAGES);
    assert!(faults.is_empty(), "\n{}\n", faults.join("\n"));
}
