//! The order of the house where the compiler does not keep it.
use std::{fs, path::Path};
use syn::visit::Visit;

/// Rooms of a crate in steps: a room uses those of earlier steps only. An image of the firmware knows no other image.
const ROOMS: &str = "
shared/src/ sensor < dsp < features < table < explorer rig < store < wire < probe < handheld
firmware/src/ board < chip < tasks < boot workload < checks < bench selftest handheld rig arm
host-tools/lab/src/ data < eval < sim < live < remote
host-tools/emulator/src/ board < host < runs";
/// Crates of the project that a crate may depend on.
const CRATES: &str = "
shared -
host-tools/link core
host-tools/world core
host-tools/lab core link world
host-tools/study core link world lab";
/// Peripherals that a file may name. First their owners, for which no driver of embassy is used; then files that touch
/// them at start-up, after a panic, beside a driver, in another image, or to read.
const PERIPHERALS: &str = "
chip/current.rs ADC1 ADC123_COMMON DMA2; chip/encoder.rs TIM4; chip/lever.rs TIM1; chip/motion.rs SPI4
chip/slots.rs SPI1 TIM2; chip/watchdog.rs IWDG
board.rs DBGMCU FLASH RCC; chip/bank2.rs FLASH; chip/rescue.rs RCC
checks.rs TIM2; selftest/chip.rs FLASH GPIOA RCC";
/// Most exceptions: long functions, functions with many arguments, wide lines of Rust and of Markdown.
const EXCEPTIONS: [usize; 4] = [16, 6, 35, 0];

/// Files below a folder with this extension: names from the top, and texts.
fn files(folder: &str, extension: &str) -> Vec<(String, String)> {
    let mut above = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors();
    let root = above.find(|path| path.join("memory.x").is_file()).unwrap();
    let (mut found, mut todo) = (Vec::new(), vec![root.join(folder)]);
    while let Some(path) = todo.pop() {
        let name = path.strip_prefix(root).unwrap().to_string_lossy();
        let name = name.replace('\\', "/");
        if path.is_dir() && !name.starts_with('.') && !name.ends_with("target") {
            let entries = fs::read_dir(&path).unwrap();
            todo.extend(entries.map(|entry| entry.unwrap().path()));
        } else if path.extension().is_some_and(|end| end == extension) {
            found.push((name, fs::read_to_string(&path).unwrap()));
        }
    }
    found
}

/// Files of product code below a folder.
fn product(folder: &str) -> Vec<(String, String)> {
    let mut all = files(folder, "rs");
    let is_test = |name: &str| name.ends_with("tests.rs") || name.contains("/tests/");
    all.retain(|(name, _)| name.contains("src/") && !is_test(name));
    all
}

/// Code without inline tests and comments.
fn code(text: &str) -> String {
    let tests = text.find("\n#[cfg(test)]\nmod tests {");
    let lines = text[..tests.unwrap_or(text.len())].lines();
    let code: Vec<&str> = lines
        .filter(|line| !line.trim_start().starts_with("//"))
        .collect();
    code.join("\n")
}

/// The names behind each `mark`: one, or those of a group in braces.
fn names<'t>(code: &'t str, mark: &str) -> Vec<&'t str> {
    let no_word = |c: char| !c.is_alphanumeric() && !"_*".contains(c);
    let uses = code.split(mark).skip(1).flat_map(|rest| {
        let is_group = rest.starts_with('{');
        let end = rest.find(|c| if is_group { c == ';' } else { no_word(c) });
        rest[..end.unwrap_or(rest.len())].split(['{', ','])
    });
    let names = uses.filter_map(|name| name.trim().split(no_word).next());
    names.filter(|name| !name.is_empty()).collect()
}

/// Peripherals that a file may name.
fn allowed(file: &str) -> Vec<&str> {
    let mut rows = PERIPHERALS
        .split([';', '\n'])
        .map(|row| row.trim().split(' '));
    let row = rows.find(|row| row.clone().next() == Some(file));
    row.into_iter().flatten().skip(1).collect()
}

#[test]
fn a_room_uses_earlier_rooms_only() {
    let mut faults = Vec::new();
    for (folder, rooms) in ROOMS.lines().filter_map(|line| line.split_once(' ')) {
        let steps: Vec<&str> = rooms.split(" < ").collect();
        let step = |room: &str| steps.iter().position(|s| s.split(' ').any(|r| r == room));
        for (file, text) in product(folder) {
            let here = file[folder.len()..].split(['/', '.']).next().unwrap();
            let code = code(&text);
            let mut used = names(&code, "crate::");
            used.retain(|used| *used != here && step(here).is_some() && step(used) >= step(here));
            faults.extend(used.iter().map(|used| format!("{file} uses {used}")));
        }
    }
    assert_eq!(faults, [""; 0]);
    let code = "use crate::{table::{A, B}, rig}; fn f() { log!(crate::probe::Y) }";
    assert_eq!(names(code, "crate::"), ["table", "A", "B", "rig", "probe"]);
}

#[test]
fn a_crate_depends_on_those_below_it() {
    for (folder, allowed) in CRATES.lines().filter_map(|line| line.split_once(' ')) {
        let manifest = &files(&format!("{folder}/Cargo.toml"), "toml")[0].1;
        let product = manifest.split("\n[dev-").next().unwrap().lines();
        let own = product.filter_map(|line| line.strip_prefix("tactus-")?.split(['.', ' ']).next());
        let wrong: Vec<&str> = own
            .filter(|own| !allowed.split(' ').any(|other| other == *own))
            .collect();
        assert_eq!(wrong, [""; 0], "{folder}");
    }
    let root = files("shared/src/lib.rs", "rs").remove(0).1;
    assert!(root.contains("\n#![no_std]\n#![forbid(unsafe_code)]\n") && !root.contains("alloc;"));
}

/// Functions that are too long, and those with too many arguments.
#[derive(Default)]
struct Functions([Vec<String>; 2]);

impl Functions {
    fn add(&mut self, function: &syn::Signature, body: &syn::Block) {
        let end = body.brace_token.span.close().end().line;
        let lines = end - function.fn_token.span.start().line + 1;
        let counts = [lines, function.inputs.len()];
        for at in (0..2).filter(|at| counts[*at] > [80, 6][*at]) {
            self.0[at].push(format!("{}: {}", function.ident, counts[at]));
        }
    }
}

impl Visit<'_> for Functions {
    fn visit_item_fn(&mut self, item: &syn::ItemFn) {
        self.add(&item.sig, &item.block);
    }
    fn visit_impl_item_fn(&mut self, item: &syn::ImplItemFn) {
        self.add(&item.sig, &item.block);
    }
}

#[test]
fn files_and_functions_are_short() {
    let (mut functions, mut long) = (Functions::default(), Vec::new());
    for (file, text) in ["shared", "firmware", "host-tools"].map(product).concat() {
        functions.visit_file(&syn::parse_file(&code(&text)).unwrap());
        long.extend((text.lines().count() > 600).then_some(file));
    }
    assert_eq!(long, [""; 0]);
    for (found, most) in functions.0.iter().zip(EXCEPTIONS) {
        assert!(found.len() <= most, "{} of {most}: {found:#?}", found.len());
    }
}

#[test]
fn lines_fit_a_page() {
    for (extension, step, most) in [("rs", 1, EXCEPTIONS[2]), ("md", 2, EXCEPTIONS[3])] {
        let mut wide = Vec::new();
        for (file, text) in files("", extension) {
            // in Markdown, code, tables and lines with an address may be wide
            let mut lines: Vec<_> = text
                .split("\n```")
                .step_by(step)
                .flat_map(str::lines)
                .collect();
            lines.retain(|line| step == 1 || !line.starts_with('|') && !line.contains("https:"));
            lines.retain(|line| line.chars().count() > 120);
            wide.extend(lines.iter().map(|line| format!("{file}: {line}")));
        }
        assert!(wide.len() <= most, "{} of {most}: {wide:#?}", wide.len());
    }
}

/// Registers and drivers that a file of the firmware names and may not.
fn foreign(file: &str, text: &str) -> Vec<String> {
    let code = code(text);
    let own = allowed(file);
    let mut foreign = names(&code, "pac::");
    // types of registers are not in capitals
    foreign.retain(|name| *name == name.to_uppercase() && !own.contains(name));
    let mut drivers = names(&code, "embassy_stm32::");
    drivers.retain(|name| ["spi", "adc", "wdg"].contains(name));
    let others = ["::pac;", "::pac as", "{pac, ", " pac}", "low_level::Timer"];
    let others = others.into_iter().filter(|other| code.contains(other));
    let all = foreign.into_iter().chain(drivers).chain(others);
    all.map(|name| format!("{file}: {name}")).collect()
}

#[test]
fn a_peripheral_has_one_owner() {
    let firmware = product("firmware/src/");
    for (file, text) in &firmware {
        assert_eq!(foreign(&file["firmware/src/".len()..], text), [""; 0]);
    }
    let wrong = "use embassy_stm32::{pac, wdg}; use embassy_stm32::pac::{SPI1, spi::Br, RCC as R};";
    let wrong = foreign("chip/slots.rs", wrong).join("; ");
    assert_eq!(wrong.replace("chip/slots.rs: ", ""), "RCC; wdg; {pac, ");
    let count = |end: &str, words: &[&str]| -> usize {
        let all = firmware.iter().filter(|(file, _)| file.ends_with(end));
        let in_file = |text: &str| {
            words
                .iter()
                .map(|word| text.matches(word).count())
                .sum::<usize>()
        };
        all.map(|(_, text)| in_file(text)).sum()
    };
    // critical sections do not mask the highest priority: who has it shares no data by them, as drivers do
    let urgent = ["Priority::P0"];
    assert_eq!(
        (count(".rs", &urgent), count("src/board.rs", &urgent)),
        (2, 2)
    );
    let shares = [
        "critical_section",
        "CriticalSection",
        "defmt",
        "interrupt::free",
    ];
    assert_eq!(count("chip/slots.rs", &shares), 0);
    let writes = [".write(|", ".modify(|", ".write_value("];
    assert_eq!(count("selftest/chip.rs", &writes), 0);
}
