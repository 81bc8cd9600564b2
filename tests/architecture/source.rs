//! The source of a crate as a tree of modules: which file holds each, what it defines, and what it imports.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Component, Path, PathBuf};

use syn::punctuated::Punctuated;
use syn::{Attribute, Expr, Item, ItemMod, Lit, Meta, Token, UseTree};

/// Index of a file in [`Source::files`].
pub(crate) type FileId = usize;
/// Index of a module in [`Source::modules`].
pub(crate) type ModuleId = usize;

/// Every file and module of some crates.
#[derive(Default)]
pub(crate) struct Source {
    pub(crate) files: Vec<File>,
    pub(crate) modules: Vec<Module>,
    by_path: BTreeMap<PathBuf, FileId>,
}

/// A file of source.
pub(crate) struct File {
    /// Below the folder that was read, with `/`: how sentences name it.
    pub(crate) name: String,
    pub(crate) lines: usize,
    /// Whether a module outside of tests is in it.
    pub(crate) is_product: bool,
    pub(crate) syntax: syn::File,
}

/// A module: the root of a crate, a file, or `mod x { }`.
pub(crate) struct Module {
    pub(crate) file: FileId,
    pub(crate) parent: Option<ModuleId>,
    /// The root of its crate.
    pub(crate) root: ModuleId,
    /// For `mod x { }`: which item of its parent it is.
    inline: Option<usize>,
    /// Under `#[cfg(test)]`.
    pub(crate) is_test: bool,
    /// What each name stands for; one name may be a module and a function.
    pub(crate) names: BTreeMap<String, Vec<Named>>,
    /// `use ...::*`.
    pub(crate) globs: Vec<Vec<String>>,
}

/// What a name of a module stands for.
#[derive(Clone)]
pub(crate) enum Named {
    /// It is defined here; the variants, if it is an enum.
    Definition(BTreeSet<String>),
    Module(ModuleId),
    /// It is imported from this path.
    Import(Vec<String>),
}

/// A name that a `use` brings: under which name, from which path. `None` is a glob.
pub(crate) struct Leaf {
    pub(crate) name: Option<String>,
    pub(crate) path: Vec<String>,
    pub(crate) line: usize,
}

impl Source {
    /// Reads a crate from its root file; `top` is the folder that names of files are given below.
    pub(crate) fn read_crate(&mut self, top: &Path, root: &Path) -> Result<(), String> {
        let file = self.file(top, root)?;
        let folder = root.parent().unwrap_or(top).to_owned();
        let id = self.module(file, None, false);
        self.read_items(top, id, &folder, &folder)
    }

    /// Whether some module is in this file.
    pub(crate) fn knows(&self, path: &Path) -> bool {
        self.by_path.contains_key(path)
    }

    /// The items of a module: those of its file, or those between its braces.
    pub(crate) fn items(&self, module: ModuleId) -> &[Item] {
        let here = &self.modules[module];
        match here.parent.zip(here.inline) {
            None => &self.files[here.file].syntax.items,
            Some((parent, at)) => match self.items(parent).get(at) {
                Some(Item::Mod(item)) => item.content.as_ref().map_or(&[], |(_, items)| items),
                _ => &[],
            },
        }
    }

    fn module(&mut self, file: FileId, parent: Option<ModuleId>, is_test: bool) -> ModuleId {
        let id = self.modules.len();
        let root = parent.map_or(id, |parent| self.modules[parent].root);
        self.modules.push(Module {
            file,
            parent,
            root,
            inline: None,
            is_test,
            names: BTreeMap::new(),
            globs: Vec::new(),
        });
        self.files[file].is_product |= !is_test;
        id
    }

    fn file(&mut self, top: &Path, path: &Path) -> Result<FileId, String> {
        if let Some(&known) = self.by_path.get(path) {
            return Ok(known);
        }
        let name = path.strip_prefix(top).unwrap_or(path);
        let name = name.to_string_lossy().replace('\\', "/");
        let text = fs::read_to_string(path).map_err(|why| format!("{name}: {why}"))?;
        let syntax = syn::parse_file(&text)
            .map_err(|why| format!("{name}:{}: {why}", why.span().start().line))?;
        let id = self.files.len();
        self.files.push(File {
            name,
            lines: text.lines().count(),
            is_product: false,
            syntax,
        });
        self.by_path.insert(path.to_owned(), id);
        Ok(id)
    }

    /// Enters what a file or an inline module says. `here` is the folder of the file, `children` where modules of its own lie.
    fn read_items(
        &mut self,
        top: &Path,
        module: ModuleId,
        here: &Path,
        children: &Path,
    ) -> Result<(), String> {
        let items = std::mem::take(&mut self.files[self.modules[module].file].syntax.items);
        let read = self.enter(top, module, &items, here, children);
        self.files[self.modules[module].file].syntax.items = items;
        read
    }

    fn enter(
        &mut self,
        top: &Path,
        module: ModuleId,
        items: &[Item],
        here: &Path,
        children: &Path,
    ) -> Result<(), String> {
        for (at, item) in items.iter().enumerate() {
            if let Item::Mod(child) = item {
                let id = self.enter_module(top, module, at, child, here, children)?;
                self.name(module, child.ident.to_string(), Named::Module(id));
            }
            if is_test(attributes(item)) && !self.modules[module].is_test {
                continue;
            }
            if let Item::Use(item) = item {
                for leaf in leaves(&item.tree) {
                    match leaf.name {
                        Some(name) => self.name(module, name, Named::Import(leaf.path)),
                        None => self.modules[module].globs.push(leaf.path),
                    }
                }
            }
            if let Some((name, variants)) = definition(item) {
                self.name(module, name, Named::Definition(variants));
            }
        }
        Ok(())
    }

    fn name(&mut self, module: ModuleId, name: String, named: Named) {
        let names = &mut self.modules[module].names;
        names.entry(name).or_default().push(named);
    }

    fn enter_module(
        &mut self,
        top: &Path,
        parent: ModuleId,
        at: usize,
        item: &ItemMod,
        here: &Path,
        children: &Path,
    ) -> Result<ModuleId, String> {
        let is_test = self.modules[parent].is_test || is_test(&item.attrs);
        let own = children.join(item.ident.to_string());
        if let Some((_, items)) = &item.content {
            let id = self.module(self.modules[parent].file, Some(parent), is_test);
            self.modules[id].inline = Some(at);
            // a #[path] in an inline module counts from the inline module's folder
            self.enter(top, id, items, &own, &own)?;
            return Ok(id);
        }
        let candidates = match path_attribute(&item.attrs) {
            Some(path) => vec![plain(&here.join(path))],
            None => vec![own.with_extension("rs"), own.join("mod.rs")],
        };
        let Some(path) = candidates.iter().find(|path| path.is_file()) else {
            let file = &self.files[self.modules[parent].file].name;
            return Err(format!("{file}: there is no file of `mod {}`", item.ident));
        };
        let file = self.file(top, path)?;
        let id = self.module(file, Some(parent), is_test);
        let folder = path.parent().unwrap_or(here).to_owned();
        let is_folder = path.ends_with("mod.rs") || path_attribute(&item.attrs).is_some();
        let children = if is_folder { folder.clone() } else { own };
        self.read_items(top, id, &folder, &children)?;
        Ok(id)
    }
}

/// Without `..`: a file that two crates include is one file.
fn plain(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for part in path.components() {
        match part {
            Component::ParentDir => _ = plain.pop(),
            Component::CurDir => {}
            part => plain.push(part),
        }
    }
    plain
}

/// Whether something is for tests only: `#[cfg(test)]`, `#[cfg(all(test, ...))]`, `#[test]`.
pub(crate) fn is_test(attributes: &[Attribute]) -> bool {
    fn wants_test(meta: &Meta) -> bool {
        match meta {
            Meta::Path(path) => path.is_ident("test"),
            Meta::List(list) if list.path.is_ident("all") => list
                .parse_args_with(Punctuated::<Meta, Token![,]>::parse_terminated)
                .is_ok_and(|all| all.iter().any(wants_test)),
            _ => false,
        }
    }
    attributes.iter().any(|attribute| match &attribute.meta {
        Meta::Path(path) => path.is_ident("test"),
        Meta::List(list) if list.path.is_ident("cfg") => {
            list.parse_args().is_ok_and(|meta: Meta| wants_test(&meta))
        }
        _ => false,
    })
}

fn path_attribute(attributes: &[Attribute]) -> Option<String> {
    attributes.iter().find_map(|attribute| {
        let Meta::NameValue(pair) = &attribute.meta else {
            return None;
        };
        match &pair.value {
            Expr::Lit(lit) if pair.path.is_ident("path") => match &lit.lit {
                Lit::Str(path) => Some(path.value()),
                _ => None,
            },
            _ => None,
        }
    })
}

/// The attributes of an item.
pub(crate) fn attributes(item: &Item) -> &[Attribute] {
    match item {
        Item::Const(i) => &i.attrs,
        Item::Enum(i) => &i.attrs,
        Item::ExternCrate(i) => &i.attrs,
        Item::Fn(i) => &i.attrs,
        Item::ForeignMod(i) => &i.attrs,
        Item::Impl(i) => &i.attrs,
        Item::Macro(i) => &i.attrs,
        Item::Mod(i) => &i.attrs,
        Item::Static(i) => &i.attrs,
        Item::Struct(i) => &i.attrs,
        Item::Trait(i) => &i.attrs,
        Item::TraitAlias(i) => &i.attrs,
        Item::Type(i) => &i.attrs,
        Item::Union(i) => &i.attrs,
        Item::Use(i) => &i.attrs,
        _ => &[],
    }
}

/// The name that an item defines, and its variants.
pub(crate) fn definition(item: &Item) -> Option<(String, BTreeSet<String>)> {
    let name = match item {
        Item::Const(i) => &i.ident,
        Item::Enum(i) => {
            let variants = i.variants.iter().map(|v| v.ident.to_string());
            return Some((i.ident.to_string(), variants.collect()));
        }
        Item::Fn(i) => &i.sig.ident,
        Item::Macro(i) => i.ident.as_ref()?,
        Item::Static(i) => &i.ident,
        Item::Struct(i) => &i.ident,
        Item::Trait(i) => &i.ident,
        Item::TraitAlias(i) => &i.ident,
        Item::Type(i) => &i.ident,
        Item::Union(i) => &i.ident,
        _ => return None,
    };
    (name != "_").then(|| (name.to_string(), BTreeSet::new()))
}

/// All names that a `use` brings.
pub(crate) fn leaves(tree: &UseTree) -> Vec<Leaf> {
    fn walk(tree: &UseTree, before: &[String], leaves: &mut Vec<Leaf>) {
        let with = |name: &syn::Ident| [before, &[name.to_string()]].concat();
        let mut leaf = |name: Option<&syn::Ident>, path: Vec<String>, line| {
            let name = name.map(|name| match (name == "self", before.last()) {
                (true, Some(last)) => last.clone(),
                _ => name.to_string(),
            });
            let itself = path.len() > 1 && path.last().is_some_and(|last| last == "self");
            let path = if itself { before.to_vec() } else { path };
            leaves.push(Leaf { name, path, line });
        };
        match tree {
            UseTree::Path(path) => walk(&path.tree, &with(&path.ident), leaves),
            UseTree::Name(name) => leaf(
                Some(&name.ident),
                with(&name.ident),
                name.ident.span().start().line,
            ),
            UseTree::Rename(name) => leaf(
                Some(&name.rename),
                with(&name.ident),
                name.ident.span().start().line,
            ),
            UseTree::Glob(star) => {
                leaf(None, before.to_vec(), star.star_token.spans[0].start().line);
            }
            UseTree::Group(group) => group
                .items
                .iter()
                .for_each(|tree| walk(tree, before, leaves)),
        }
    }
    let mut all = Vec::new();
    walk(tree, &[], &mut all);
    all
}
