//! What the house must be: no circle of files, no room that knows a later one, no long file.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::fs;
use std::path::{Path, PathBuf};

use super::names::Names;
use super::source::{FileId, Source};
use super::uses::{Use, uses};

/// Lines that a file of product code may have, its inline tests counted.
pub(crate) const MOST_LINES: usize = 600;

/// A package and the order of its rooms.
pub(crate) struct Package {
    /// Its folder; the source is in `src`.
    pub(crate) folder: &'static str,
    /// A room knows those of the steps before its own. Rooms of one step do not know each other. None: the package has no
    /// rooms.
    pub(crate) steps: &'static [&'static [&'static str]],
    /// Rooms that do not know each other although their steps would let them.
    pub(crate) strangers: &'static [(&'static str, &'static str)],
    /// What need not be in a room: the roots of the package, and what they bring for all rooms.
    pub(crate) outside: &'static [&'static str],
}

/// Everything that is wrong in these packages, a sentence each.
pub(crate) fn faults(top: &Path, packages: &[Package]) -> Vec<String> {
    let mut faults = Vec::new();
    let mut source = Source::default();
    let mut homes = BTreeMap::new();
    for (package, number) in packages.iter().zip(0..) {
        let folder = top.join(package.folder).join("src");
        for root in roots(&folder) {
            if let Err(why) = source.read_crate(top, &root) {
                faults.push(why);
            }
        }
        for file in files(&folder) {
            if !source.knows(&file) && !is_for_tests(&file) {
                let name = name(top, &file);
                faults.push(format!("{name}: no module of the package is in this file"));
            }
        }
        for (id, file) in source.files.iter().enumerate() {
            if let Some(inside) = file.name.strip_prefix(&format!("{}/src/", package.folder)) {
                homes.entry(id).or_insert((number, inside.to_owned()));
            }
        }
    }
    let house = House {
        source: &source,
        packages,
        homes,
        uses: uses(&Names::new(&source)),
    };
    faults.extend(house.long_files());
    faults.extend(house.homeless());
    faults.extend(house.doors());
    faults.extend(house.circles());
    faults
}

pub(crate) fn name(top: &Path, file: &Path) -> String {
    let file = file.strip_prefix(top).unwrap_or(file);
    file.to_string_lossy().replace('\\', "/")
}

/// The root files of a package's crates.
fn roots(source: &Path) -> Vec<PathBuf> {
    let mut roots = vec![source.join("lib.rs"), source.join("main.rs")];
    let programs = fs::read_dir(source.join("bin")).into_iter().flatten();
    let mut programs: Vec<PathBuf> = programs.flatten().map(|entry| entry.path()).collect();
    programs.sort();
    for program in programs {
        if program.is_dir() {
            roots.push(program.join("main.rs"));
        } else {
            roots.push(program);
        }
    }
    roots.retain(|root| root.is_file());
    roots
}

/// All files of Rust below a folder.
pub(crate) fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut entries: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
    entries.sort();
    let mut all = Vec::new();
    for entry in entries {
        if entry.is_dir() {
            all.extend(files(&entry));
        } else if entry.extension().is_some_and(|extension| extension == "rs") {
            all.push(entry);
        }
    }
    all
}

/// `tests.rs`, and everything in a folder `tests`.
fn is_for_tests(file: &Path) -> bool {
    file.ends_with("tests.rs") || file.components().any(|c| c.as_os_str() == "tests")
}

struct House<'s> {
    source: &'s Source,
    packages: &'s [Package],
    /// The package of each file, and the file's path below `src`.
    homes: BTreeMap<FileId, (usize, String)>,
    uses: BTreeSet<Use>,
}

impl House<'_> {
    fn name(&self, file: FileId) -> &str {
        &self.source.files[file].name
    }

    fn long_files(&self) -> Vec<String> {
        let files = self.source.files.iter();
        files
            .filter(|file| file.is_product && file.lines > MOST_LINES)
            .map(|file| {
                format!(
                    "{} has {} lines, and {MOST_LINES} are the most: make two files of it, or move its tests to one",
                    file.name, file.lines
                )
            })
            .collect()
    }

    /// The package and the first name of a file's path: `table` of `table.rs` and of `table/format.rs`.
    fn place(&self, file: FileId) -> Option<(usize, &str)> {
        let (package, inside) = self.homes.get(&file)?;
        let first = inside.split('/').next()?;
        Some((*package, first.strip_suffix(".rs").unwrap_or(first)))
    }

    /// The package, the room of a file, and its step.
    fn room(&self, file: FileId) -> Option<(usize, &str, usize)> {
        let (package, first) = self.place(file)?;
        let steps = self.packages[package].steps.iter();
        let step = steps
            .zip(0..)
            .find_map(|(step, number)| step.contains(&first).then_some(number))?;
        Some((package, first, step))
    }

    fn homeless(&self) -> Vec<String> {
        let mut homeless = Vec::new();
        for (id, file) in self.source.files.iter().enumerate() {
            let Some((package, first)) = self.place(id) else {
                continue;
            };
            let Package { steps, outside, .. } = self.packages[package];
            let known = steps.is_empty() || outside.contains(&first) || self.room(id).is_some();
            if file.is_product && !known {
                let rooms: Vec<&str> = steps.iter().copied().flatten().copied().collect();
                let rooms = rooms.join(", ");
                homeless.push(format!("{} is in no room; there are {rooms}", file.name));
            }
        }
        homeless
    }

    /// Uses of a room that the user's room does not know; each name once.
    fn doors(&self) -> Vec<String> {
        let mut wrong: BTreeMap<(&str, &str, String), BTreeMap<&str, &Use>> = BTreeMap::new();
        for found in &self.uses {
            let Some((package, user, step)) = self.room(found.from) else {
                continue;
            };
            for &used in found.through.iter().chain([&found.to]) {
                let Some((_, buffer, later)) = self.room(used).filter(|used| used.0 == package)
                else {
                    continue;
                };
                let strangers = self.packages[package].strangers.iter();
                let mut strangers = strangers.map(|(a, b)| [[*a, *b], [*b, *a]]);
                let why = if buffer == user {
                    continue;
                } else if later > step {
                    format!("comes after {user}")
                } else if later == step || strangers.any(|pair| pair.contains(&[user, buffer])) {
                    format!("and {user} do not know each other")
                } else {
                    continue;
                };
                let last = found.what.rsplit("::").next().unwrap_or(&found.what);
                let names = wrong
                    .entry((self.name(found.from), buffer, why))
                    .or_default();
                let first = names.entry(last).or_insert(found);
                if found.line < first.line {
                    *first = found;
                }
            }
        }
        let wrong = wrong.into_iter().map(|((file, buffer, why), names)| {
            let names = names.into_values();
            let names: Vec<String> = names
                .map(|found| format!("`{}` (line {})", found.what, found.line))
                .collect();
            let names = names.join(", ");
            format!("{file} uses {names} of the room {buffer}, but {buffer} {why}")
        });
        wrong.collect()
    }

    /// Every circle of files, the shortest through each use that is in one; each file is told with one that it is in.
    fn circles(&self) -> Vec<String> {
        let mut edges: BTreeMap<FileId, BTreeMap<FileId, &Use>> = BTreeMap::new();
        for found in &self.uses {
            if found.to != found.from && !found.is_reexport {
                let of = edges.entry(found.from).or_default();
                of.entry(found.to).or_insert(found);
            }
        }
        let mut circles: BTreeMap<BTreeSet<FileId>, Vec<&Use>> = BTreeMap::new();
        for (&from, to) in &edges {
            for (&to, first) in to {
                if let Some(mut back) = shortest(&edges, to, from) {
                    back.insert(0, first);
                    let files = back.iter().map(|found| found.from).collect();
                    circles.entry(files).or_insert(back);
                }
            }
        }
        let mut circles: Vec<Vec<&Use>> = circles.into_values().collect();
        circles.sort_by_key(Vec::len);
        circles.iter().map(|circle| self.circle(circle)).collect()
    }

    fn circle(&self, circle: &[&Use]) -> String {
        let steps: Vec<String> = circle
            .iter()
            .map(|found| {
                let (from, to) = (self.name(found.from), self.name(found.to));
                format!("{from}:{} uses `{}` of {to}", found.line, found.what)
            })
            .collect();
        format!("files import each other in a circle: {}", steps.join(", "))
    }
}

/// The shortest way from one file to another.
fn shortest<'u>(
    edges: &BTreeMap<FileId, BTreeMap<FileId, &'u Use>>,
    from: FileId,
    to: FileId,
) -> Option<Vec<&'u Use>> {
    let mut came: BTreeMap<FileId, &Use> = BTreeMap::new();
    let mut queue = VecDeque::from([from]);
    while let Some(at) = queue.pop_front() {
        if at == to {
            let mut way = Vec::new();
            let mut at = to;
            while at != from {
                let step = came[&at];
                way.insert(0, step);
                at = step.from;
            }
            return Some(way);
        }
        for (&next, &step) in edges.get(&at).into_iter().flatten() {
            if next != from && !came.contains_key(&next) {
                came.insert(next, step);
                queue.push_back(next);
            }
        }
    }
    None
}
