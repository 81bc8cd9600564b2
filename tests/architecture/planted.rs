//! Each fault planted in a small tree, and found.

use std::fs;

use tempfile::TempDir;

use super::rules::{MOST_LINES, Package, faults};

const CORE: Package = Package {
    folder: "core",
    steps: &[&["sensor"], &["table"], &["explorer", "rig"], &["probe"]],
    strangers: &[("sensor", "probe")],
    outside: &["lib", "bin"],
};

/// What is wrong with a package of these files.
fn found(files: &[(&str, &str)]) -> Vec<String> {
    let top = TempDir::new().unwrap();
    for (name, text) in files {
        let file = top.path().join("core/src").join(name);
        fs::create_dir_all(file.parent().unwrap()).unwrap();
        fs::write(file, text).unwrap();
    }
    faults(top.path(), &[CORE])
}

#[track_caller]
fn assert_clean(files: &[(&str, &str)]) {
    assert_eq!(found(files), Vec::<String>::new());
}

/// Two files in a circle: the one says `forth` in line 2, the other `back`.
#[track_caller]
fn assert_circle(a: &str, forth: &str, b: &str, back: &str) {
    let found = found(&[
        ("lib.rs", "mod table;"),
        ("table.rs", "mod a;\nmod b;\nmod c;\n"),
        ("table/a.rs", a),
        ("table/b.rs", b),
        (
            "table/c.rs",
            "pub use super::a::*;\npub(crate) use super::b;",
        ),
    ]);
    let wanted = format!(
        "files import each other in a circle: core/src/table/a.rs:2 uses `{forth}` of core/src/table/b.rs, \
         core/src/table/b.rs:2 uses `{back}` of core/src/table/a.rs"
    );
    assert_eq!(found, [wanted]);
}

const A: &str = "pub struct A;\nuse super::b::B;";

#[test]
fn two_files_in_a_circle_are_named_with_what_they_use() {
    assert_circle(
        A,
        "super::b::B",
        "pub struct B;\nuse crate::table::a::A;",
        "crate::table::a::A",
    );
}

#[test]
fn a_path_of_any_kind_is_an_import() {
    let of_a = |line: &str, path: &str| {
        assert_circle(A, "super::b::B", &format!("pub struct B;\n{line}"), path)
    };
    of_a("use super::{c, a::{self, A as Other}};", "super::a::A");
    of_a("pub(crate) fn f(_: super::a::A) {}", "super::a::A");
    of_a(
        "pub(crate) fn f() { let _ = crate::table::a::A; }",
        "crate::table::a::A",
    );
    of_a("impl Into<super::a::A> for B {}", "super::a::A");
    of_a(
        "pub(crate) fn f(x: u8) { match x { super::a::X => {} _ => {} } }",
        "super::a::X",
    );
    of_a(
        "pub(crate) fn f() { assert!(super::a::holds(1)); }",
        "super::a::holds",
    );
    of_a(
        "pub(crate) fn f() { vec![(1, super::a::A)]; }",
        "super::a::A",
    );
    of_a("#[derive(super::a::Make)] struct C;", "super::a::Make");
    of_a(
        "struct C { #[serde(default = \"super::a::least\")] c: u8 }",
        "super::a::least",
    );
    of_a(
        "struct C { #[arg(default_value_t = super::a::LEAST)] c: u8 }",
        "super::a::LEAST",
    );
    of_a(
        "macro_rules! m { () => { $crate::table::a::A }; }",
        "crate::table::a::A",
    );
    of_a("pub(crate) fn f() { use super::a; let _ = a::A; }", "a::A");
    // through a face, its globs, and its modules
    of_a("pub(crate) fn f(_: super::c::A) {}", "super::c::A");
    of_a("use crate::table::c::A;", "crate::table::c::A");
    of_a("use super::c::*; impl B { fn f(_: A) {} }", "A");
    of_a("use super::*; impl B { fn f(_: a::A) {} }", "a::A");
    of_a(
        "use super::c::b::super::a; impl B { fn f(_: a::A) {} }",
        "a::A",
    );
}

#[test]
fn an_associated_function_belongs_to_the_file_that_has_it() {
    let a = "use super::b::B;\nimpl B { fn grow(&self) {} fn small() {} }";
    let found = |b: &str| {
        found(&[
            ("lib.rs", "mod table;"),
            ("table.rs", "mod a;\nmod b;"),
            ("table/a.rs", a),
            ("table/b.rs", b),
        ])
    };
    let circle = |what: &str| {
        format!(
            "files import each other in a circle: core/src/table/a.rs:1 uses `super::b::B` of core/src/table/b.rs, \
             core/src/table/b.rs:2 uses `{what}` of core/src/table/a.rs"
        )
    };
    let b = "pub struct B;\nimpl B { fn f(&self) { self.grow() } }";
    assert_eq!(found(b), [circle("self.grow")]);
    let b = "pub struct B;\npub fn f() { B::small() }";
    assert_eq!(found(b), [circle("B::small")]);
    let b = "pub struct B;\nimpl B { fn f() { Self::small() } }";
    assert_eq!(found(b), [circle("Self::small")]);
    assert_eq!(
        found("pub struct B;\nimpl B { fn f(&self) { self.other() } }"),
        [""; 0]
    );
}

#[test]
fn a_longer_circle_is_told_once_and_shortest_first() {
    let found = found(&[
        ("lib.rs", "mod table;"),
        ("table.rs", "mod a; mod b; mod c; mod d;"),
        ("table/a.rs", "pub struct A(super::b::B);"),
        ("table/b.rs", "pub struct B(super::c::C);"),
        ("table/c.rs", "pub struct C(super::a::A, super::d::D);"),
        ("table/d.rs", "pub struct D;"),
    ]);
    assert_eq!(
        found,
        [
            "files import each other in a circle: core/src/table/a.rs:1 uses `super::b::B` of core/src/table/b.rs, \
          core/src/table/b.rs:1 uses `super::c::C` of core/src/table/c.rs, \
          core/src/table/c.rs:1 uses `super::a::A` of core/src/table/a.rs"
        ]
    );
}

#[test]
fn a_child_that_needs_its_roots_definition_is_in_a_circle_if_the_root_needs_the_child() {
    let tree = |root: &'static str| {
        found(&[
            ("lib.rs", "mod table;"),
            ("table.rs", root),
            ("table/a.rs", "pub struct A([u8; super::SIZE]);"),
        ])
    };
    assert_eq!(
        tree("mod a;\npub use a::A;\npub const SIZE: usize = 3;"),
        [""; 0]
    );
    assert_eq!(
        tree("mod a;\nuse a::A;\npub const SIZE: usize = 3;"),
        [
            "files import each other in a circle: core/src/table.rs:2 uses `a::A` of core/src/table/a.rs, \
          core/src/table/a.rs:1 uses `super::SIZE` of core/src/table.rs"
        ]
    );
}

#[test]
fn a_file_that_two_crates_include_is_one() {
    let found = found(&[
        ("lib.rs", "mod table;"),
        ("table.rs", "mod a;\n#[path = \"bin/one/b.rs\"]\nmod other;"),
        ("table/a.rs", "use super::other::B;\npub struct A;"),
        ("bin/one/main.rs", "mod b;\nmod a { pub struct A; }"),
        ("bin/one/b.rs", "pub struct B;\nuse super::a::A;"),
    ]);
    assert_eq!(
        found,
        [
            "files import each other in a circle: core/src/table/a.rs:1 uses `super::other::B` of core/src/bin/one/b.rs, \
          core/src/bin/one/b.rs:2 uses `super::a::A` of core/src/table/a.rs"
        ]
    );
}

#[test]
fn a_room_that_knows_a_later_one_is_named() {
    let tree = |sensor: &'static str| {
        found(&[
            ("lib.rs", "mod sensor; mod table;\npub fn fill() {}"),
            ("sensor.rs", sensor),
            (
                "table.rs",
                "mod format;\npub use format::Name;\npub use crate::sensor::*;",
            ),
            ("table/format.rs", "pub struct Name;"),
        ])
    };
    let wrong = |what: &str| {
        vec![format!(
            "core/src/sensor.rs uses `{what}` (line 1) of the room table, but table comes after sensor"
        )]
    };
    assert_eq!(tree("use crate::table::Name;"), wrong("crate::table::Name"));
    assert_eq!(
        tree("pub use crate::table::Name;"),
        wrong("crate::table::Name")
    );
    assert_eq!(tree("use crate::table;"), wrong("crate::table"));
    assert_eq!(tree("use crate::table::*;"), wrong("crate::table"));
    assert_eq!(
        tree("fn f(_: crate::table::Name) {}"),
        wrong("crate::table::Name")
    );
    // by way of a later room to one's own
    assert_eq!(
        tree("use crate::table::Counts;\npub struct Counts;"),
        wrong("crate::table::Counts")
    );
    // once for each name
    assert_eq!(
        tree("use crate::table::Name;\nfn f(_: Name) -> Name { Name }"),
        wrong("crate::table::Name")
    );
    assert_eq!(tree("pub fn f() { crate::fill() }"), [""; 0]);
}

#[test]
fn rooms_of_one_step_and_strangers_do_not_know_each_other() {
    let found = found(&[
        ("lib.rs", "mod sensor; mod explorer; mod rig; mod probe;"),
        ("sensor.rs", "pub struct S;"),
        ("explorer.rs", "use crate::sensor::S;\npub struct E;"),
        ("rig.rs", "use crate::explorer::E;"),
        ("probe.rs", "use crate::explorer::E;\nuse crate::sensor::S;"),
    ]);
    assert_eq!(
        found,
        [
            "core/src/probe.rs uses `crate::sensor::S` (line 2) of the room sensor, but sensor and probe do not know each other",
            "core/src/rig.rs uses `crate::explorer::E` (line 1) of the room explorer, but explorer and rig do not know each other"
        ]
    );
}

#[test]
fn long_files_and_files_without_a_room_or_a_module_are_named() {
    let lines = |n| "// a line\n".repeat(n);
    let (long, longer) = (lines(MOST_LINES), lines(MOST_LINES + 1));
    // inline tests count, those in files of their own do not
    let tests = format!("#[cfg(test)]\nmod tests {{\n{long}}}\n");
    let found = found(&[
        ("lib.rs", "mod sensor; mod table; mod attic;"),
        ("sensor.rs", &long),
        ("table.rs", "mod a; mod b;\n#[cfg(test)] mod tests;"),
        ("table/a.rs", &longer),
        ("table/b.rs", &tests),
        ("table/tests.rs", &format!("mod more;\n{longer}")),
        ("table/tests/more.rs", &longer),
        ("table/forgotten.rs", ""),
        ("attic.rs", ""),
    ]);
    let long = |name: &str, lines| {
        format!(
            "{name} has {lines} lines, and 600 are the most: make two files of it, or move its tests to one"
        )
    };
    assert_eq!(
        found,
        [
            "core/src/table/forgotten.rs: no module of the package is in this file".to_owned(),
            long("core/src/table/a.rs", 601),
            long("core/src/table/b.rs", 603),
            "core/src/attic.rs is in no room; there are sensor, table, explorer, rig, probe"
                .to_owned(),
        ]
    );
}

#[test]
fn tests_import_what_they_test() {
    assert_clean(&[
        ("lib.rs", "mod sensor; mod table;"),
        (
            "sensor.rs",
            "#[cfg(test)]\nmod tests;\n#[cfg(test)]\nuse crate::table::T;\npub struct S;",
        ),
        ("sensor/tests.rs", "use super::S;\nuse crate::table::T;"),
        (
            "table.rs",
            "pub struct T;\n#[cfg(all(test, unix))]\nmod tests { use super::T; use crate::sensor::S; }",
        ),
    ]);
}

#[test]
fn what_only_looks_like_an_import_is_none() {
    assert_clean(&[
        ("lib.rs", "mod table;"),
        ("table.rs", "mod a;\nmod b;\nmod c;\npub use b::*;"),
        ("table/a.rs", "use super::b::*;\npub struct A;\npub fn word() {}\npub mod table {}\npub use serde::Vec;"),
        (
            "table/b.rs",
            "use super::c::*;\nuse core::fmt;\n/// See [`super::a::A`].\npub struct B<A>(A);\n
             impl<A> B<A> { pub fn word(&self, word: u8) -> u8 { self.word(word); let a = fmt::A; println!(\"{a}\"); a.word } }
             pub fn f() { struct A; let A = A; }
             pub fn g() { let word = 1; assert!(word == 1, \"word\"); Other { word: 2, A: 1 }; }
             pub fn h(x: super::a::Vec) { std::a::A; ::a::A; }",
        ),
        ("table/c.rs", "pub use super::a::*;"),
    ]);
}

#[test]
fn what_cannot_be_read_is_said() {
    assert_eq!(
        found(&[("lib.rs", "mod gone;")]),
        ["core/src/lib.rs: there is no file of `mod gone`"]
    );
    let found = found(&[("lib.rs", "\n}")]);
    assert!(found[0].starts_with("core/src/lib.rs:2: "), "{found:?}");
}
