//! What a path means: from a module, through imports, faces and globs, to the files that define it.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};

use syn::{ImplItem, Item, Type};

use super::source::{FileId, ModuleId, Named, Source, is_test};

/// A definition: the module it is in, and its name.
pub(crate) type Definition = (ModuleId, String);

/// Where a path leads.
#[derive(Default, Debug)]
pub(crate) struct Found {
    pub(crate) definitions: BTreeSet<Definition>,
    pub(crate) modules: BTreeSet<ModuleId>,
    /// Modules that the path names on its way.
    pub(crate) through: BTreeSet<ModuleId>,
    /// What stands behind a definition: a variant, an associated function.
    pub(crate) rest: Vec<String>,
}

impl Found {
    fn is_nothing(&self) -> bool {
        self.definitions.is_empty() && self.modules.is_empty()
    }
}

/// The names of some crates.
pub(crate) struct Names<'s> {
    pub(crate) source: &'s Source,
    /// The files with an `impl Type` that defines this associated function or constant.
    associated: BTreeMap<(Definition, String), BTreeSet<FileId>>,
    /// What is looked up now: a module that imports a name by itself leads nowhere.
    looking: RefCell<BTreeSet<Definition>>,
}

/// Imports of imports of imports: more than this is a circle of `pub use`.
const DEEPEST: usize = 32;

impl<'s> Names<'s> {
    pub(crate) fn new(source: &'s Source) -> Self {
        let mut names = Self {
            source,
            associated: BTreeMap::new(),
            looking: RefCell::default(),
        };
        for module in 0..source.modules.len() {
            if !source.modules[module].is_test {
                names.enter_impls(module);
            }
        }
        names
    }

    fn enter_impls(&mut self, module: ModuleId) {
        let source = self.source;
        for item in source.items(module) {
            let Item::Impl(block) = item else { continue };
            if block.trait_.is_some() || is_test(&block.attrs) {
                continue;
            }
            let Some(path) = self_type(&block.self_ty) else {
                continue;
            };
            for definition in self.find(module, &path).definitions {
                for item in &block.items {
                    let name = match item {
                        ImplItem::Const(item) => &item.ident,
                        ImplItem::Fn(item) => &item.sig.ident,
                        _ => continue,
                    };
                    let key = (definition.clone(), name.to_string());
                    let files = self.associated.entry(key).or_default();
                    files.insert(source.modules[module].file);
                }
            }
        }
    }

    /// The files whose `impl` blocks define `name` for a type.
    pub(crate) fn associated(
        &self,
        of: &Definition,
        name: &str,
    ) -> impl Iterator<Item = FileId> + '_ {
        let files = self.associated.get(&(of.clone(), name.to_owned()));
        files.into_iter().flatten().copied()
    }

    /// Where a path leads from a module. Nowhere: another crate, or a name that is no item.
    pub(crate) fn find(&self, from: ModuleId, path: &[String]) -> Found {
        self.find_within(from, path, DEEPEST)
    }

    fn find_within(&self, from: ModuleId, path: &[String], depth: usize) -> Found {
        let mut found = Found::default();
        let Some((first, mut rest)) = path.split_first() else {
            return found;
        };
        if depth == 0 {
            return found;
        }
        let module = &self.source.modules[from];
        match first.as_str() {
            "crate" | "$crate" => _ = found.modules.insert(module.root),
            "self" => _ = found.modules.insert(from),
            "super" => found.modules.extend(module.parent),
            name => found = self.lookup(from, name, depth),
        }
        while let Some((name, after)) = rest.split_first() {
            // a name in front of `::` is a module, if a module has that name
            if found.modules.is_empty() {
                break;
            }
            let mut next = Found::default();
            for &module in &found.modules {
                let step = match name.as_str() {
                    "super" => Found {
                        modules: self.source.modules[module].parent.into_iter().collect(),
                        ..Found::default()
                    },
                    name => self.lookup(module, name, depth),
                };
                next.definitions.extend(step.definitions);
                next.modules.extend(step.modules);
            }
            next.through = &found.through | &found.modules;
            if next.is_nothing() {
                // what a macro defines cannot be seen: it is in the file of that module. An import is of another crate
                let unseen = found.modules.iter().copied();
                let unseen =
                    unseen.filter(|&module| !self.source.modules[module].names.contains_key(name));
                next.definitions = unseen.map(|module| (module, name.clone())).collect();
            }
            found = next;
            rest = after;
        }
        found.rest = rest.to_vec();
        found
    }

    /// What a module calls by this name.
    fn lookup(&self, module: ModuleId, name: &str, depth: usize) -> Found {
        let looked = (module, name.to_owned());
        if depth == 0 || !self.looking.borrow_mut().insert(looked.clone()) {
            return Found::default();
        }
        let found = self.lookup_once(module, name, depth);
        self.looking.borrow_mut().remove(&looked);
        found
    }

    fn lookup_once(&self, module: ModuleId, name: &str, depth: usize) -> Found {
        let mut found = Found::default();
        let here = &self.source.modules[module];
        for named in here.names.get(name).into_iter().flatten() {
            match named {
                Named::Definition(_) => _ = found.definitions.insert((module, name.to_owned())),
                Named::Module(id) => _ = found.modules.insert(*id),
                Named::Import(path) => {
                    // `use core::fmt;` is not found again under its own name
                    let outside = path.len() == 1 && path[0] == name;
                    if !outside && !self.is_elsewhere(module, path) {
                        let step = self.find_within(module, path, depth - 1);
                        found.definitions.extend(step.definitions);
                        found.modules.extend(step.modules);
                    }
                }
            }
        }
        if here.names.contains_key(name) {
            return found;
        }
        for glob in &here.globs {
            if self.is_elsewhere(module, glob) {
                continue;
            }
            let from = self.find_within(module, glob, depth - 1);
            for &inner in &from.modules {
                if inner != module {
                    let step = self.lookup(inner, name, depth - 1);
                    found.definitions.extend(step.definitions);
                    found.modules.extend(step.modules);
                }
            }
            for definition in from.definitions {
                if self.variants(&definition).any(|variant| variant == name) {
                    found.definitions.insert(definition);
                }
            }
        }
        found
    }

    /// Whether a path begins with the name of another crate: no module and no import here has that name.
    fn is_elsewhere(&self, module: ModuleId, path: &[String]) -> bool {
        let here = &self.source.modules[module];
        match path.first().map(String::as_str) {
            Some("crate" | "$crate" | "self" | "super") => false,
            Some(first) => !here.names.contains_key(first) && here.globs.is_empty(),
            None => true,
        }
    }

    fn variants(&self, (module, name): &Definition) -> impl Iterator<Item = &str> {
        let named = self.source.modules[*module].names.get(name);
        named.into_iter().flatten().flat_map(|named| match named {
            Named::Definition(variants) => variants.iter().map(String::as_str).collect(),
            _ => Vec::new(),
        })
    }
}

/// The type that an `impl` is for, as a path.
pub(crate) fn self_type(ty: &Type) -> Option<Vec<String>> {
    match ty {
        Type::Path(ty) if ty.qself.is_none() => Some(segments(&ty.path)),
        Type::Reference(ty) => self_type(&ty.elem),
        _ => None,
    }
}

/// The names of a path.
pub(crate) fn segments(path: &syn::Path) -> Vec<String> {
    let segments = path.segments.iter().map(|s| s.ident.to_string());
    segments.collect()
}
