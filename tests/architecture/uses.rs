//! Which file uses what of which other file.

use std::collections::BTreeSet;

use proc_macro2::{Delimiter, TokenStream, TokenTree};
use syn::visit::{self, Visit};
use syn::{Attribute, Expr, Item, Lit, Macro, Meta, Stmt, Visibility};

use super::names::{Definition, Names, segments, self_type};
use super::source::{FileId, ModuleId, attributes, definition, is_test, leaves};

/// A place where a file uses another one.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(crate) struct Use {
    pub(crate) from: FileId,
    /// The file that defines what is used; the file itself where only a path leads through other modules.
    pub(crate) to: FileId,
    pub(crate) line: usize,
    /// The path as it stands there.
    pub(crate) what: String,
    /// Files of the modules that the path names.
    pub(crate) through: BTreeSet<FileId>,
    /// `pub use`: shows something, and does not need it.
    pub(crate) is_reexport: bool,
}

/// All uses in the product code of some crates.
pub(crate) fn uses(names: &Names<'_>) -> BTreeSet<Use> {
    let mut uses = BTreeSet::new();
    for (module, here) in names.source.modules.iter().enumerate() {
        if here.is_test {
            continue;
        }
        let mut finder = Finder {
            names,
            module,
            file: here.file,
            scopes: Vec::new(),
            this: Vec::new(),
            uses: &mut uses,
        };
        for item in names.source.items(module) {
            finder.visit_item(item);
        }
    }
    uses
}

/// What a name stands for that a block, a function or an `impl` brings.
#[derive(Clone)]
enum Local {
    /// A variable: it hides an item, and no path begins with it.
    Variable,
    /// An item of a block, or a generic parameter.
    Item,
    Import(Vec<String>),
}

type Scope = Vec<(String, Local)>;

struct Finder<'n, 's> {
    names: &'n Names<'s>,
    module: ModuleId,
    file: FileId,
    scopes: Vec<Scope>,
    /// What `Self` is.
    this: Vec<BTreeSet<Definition>>,
    uses: &'n mut BTreeSet<Use>,
}

impl Finder<'_, '_> {
    /// Notes what a path uses.
    fn path(&mut self, path: &[String], line: usize, is_reexport: bool) {
        let Some(first) = path.first() else { return };
        let what = path.join("::");
        if first == "Self" {
            let this = self.this.last().cloned().unwrap_or_default();
            return self.associated(&this, path.get(1), line, &what);
        }
        let bound = self.scopes.iter().rev().flatten().find(|(name, local)| {
            name == first && !(matches!(local, Local::Variable) && path.len() > 1)
        });
        let path = match bound {
            Some((_, Local::Import(import))) => [import, &path[1..]].concat(),
            Some(_) => return,
            None => path.to_vec(),
        };
        let found = self.names.find(self.module, &path);
        let file = |module: ModuleId| self.names.source.modules[module].file;
        let modules = found.through.iter().chain(&found.modules);
        let modules = modules.filter(|&&module| self.is_named(module));
        let through: BTreeSet<FileId> = modules.map(|&module| file(module)).collect();
        let mut to: BTreeSet<FileId> = found.definitions.iter().map(|(m, _)| file(*m)).collect();
        if to.is_empty() && !through.is_empty() {
            to.insert(self.file);
        }
        for to in to {
            self.note(to, line, &what, through.clone(), is_reexport);
        }
        self.associated(&found.definitions, found.rest.first(), line, &what);
    }

    /// Whether a path names a module by being more than inside of it: all but the crate's root and this module's parents.
    fn is_named(&self, module: ModuleId) -> bool {
        let modules = &self.names.source.modules;
        let mut above = Some(self.module);
        while let Some(at) = above {
            if at == module {
                return false;
            }
            above = modules[at].parent;
        }
        modules[module].root != module
    }

    /// Notes the files that define an associated function or constant.
    fn associated(
        &mut self,
        of: &BTreeSet<Definition>,
        name: Option<&String>,
        line: usize,
        what: &str,
    ) {
        let Some(name) = name else { return };
        for definition in of {
            let files: Vec<FileId> = self.names.associated(definition, name).collect();
            for to in files {
                self.note(to, line, what, BTreeSet::new(), false);
            }
        }
    }

    fn note(
        &mut self,
        to: FileId,
        line: usize,
        what: &str,
        through: BTreeSet<FileId>,
        is_reexport: bool,
    ) {
        if to != self.file || !through.is_empty() {
            self.uses.insert(Use {
                from: self.file,
                to,
                line,
                what: what.to_owned(),
                through,
                is_reexport,
            });
        }
    }

    /// Paths in the tokens of a macro. `after_equals`: only those behind a `=`, as in `#[arg(default_value_t = seeds())]`.
    fn tokens(&mut self, tokens: TokenStream, after_equals: bool) {
        let trees: Vec<TokenTree> = tokens.into_iter().collect();
        let is = |at: usize, what: char| matches!(trees.get(at), Some(TokenTree::Punct(p)) if p.as_char() == what);
        let mut at = 0;
        while at < trees.len() {
            match &trees[at] {
                TokenTree::Group(group) => {
                    // the fields of a pattern or an expression, and whatever else
                    let only = after_equals && group.delimiter() == Delimiter::Parenthesis;
                    self.tokens(group.stream(), only);
                }
                TokenTree::Ident(first) => {
                    let line = first.span().start().line;
                    let mut path = vec![first.to_string()];
                    let start = at;
                    while is(at + 1, ':') && is(at + 2, ':') {
                        let Some(TokenTree::Ident(next)) = trees.get(at + 3) else {
                            break;
                        };
                        path.push(next.to_string());
                        at += 3;
                    }
                    let before = start.checked_sub(1);
                    let behind = |what| before.is_some_and(|before| is(before, what));
                    let is_crate = first == "crate" || !behind('$');
                    // a field or a method, a name of the field that is filled in
                    let is_field = behind('.') && !before.is_some_and(|b| b > 0 && is(b - 1, '.'));
                    let is_key = path.len() == 1 && is(at + 1, ':');
                    let wanted = !after_equals || behind('=') || path.len() > 1;
                    if is_crate && !is_field && !is_key && wanted {
                        self.path(&path, line, false);
                    }
                }
                TokenTree::Literal(literal) if after_equals && names_a_path(&trees[..at]) => {
                    if let Ok(path) = syn::parse_str::<syn::LitStr>(&literal.to_string())
                        && let Ok(path) = path.parse::<syn::Path>()
                    {
                        self.path(&segments(&path), literal.span().start().line, false);
                    }
                }
                _ => {}
            }
            at += 1;
        }
    }

    fn within(&mut self, scope: Scope, visit: impl FnOnce(&mut Self)) {
        self.scopes.push(scope);
        visit(self);
        self.scopes.pop();
    }

    fn generics(generics: &syn::Generics) -> Scope {
        let types = generics.type_params().map(|p| &p.ident);
        let names = types.chain(generics.const_params().map(|p| &p.ident));
        names.map(|name| (name.to_string(), Local::Item)).collect()
    }
}

/// Whether what stands before a string makes it a path, as in `#[serde(default = "least")]`.
fn names_a_path(before: &[TokenTree]) -> bool {
    let [.., TokenTree::Ident(key), TokenTree::Punct(equals)] = before else {
        return false;
    };
    equals.as_char() == '='
        && ["default", "with", "serialize_with", "deserialize_with"]
            .iter()
            .any(|known| key == known)
}

/// The variables that a piece of syntax binds.
#[derive(Default)]
struct Bound(Scope);

impl<'a> Visit<'a> for Bound {
    fn visit_pat_ident(&mut self, pattern: &'a syn::PatIdent) {
        let name = pattern.ident.to_string();
        // a capital is a constant or a variant
        if name.starts_with(|c: char| c.is_lowercase() || c == '_') {
            self.0.push((name, Local::Variable));
        }
        visit::visit_pat_ident(self, pattern);
    }
}

impl<'a> Visit<'a> for Finder<'_, '_> {
    fn visit_item(&mut self, item: &'a Item) {
        // modules inside of this one are modules of their own
        if is_test(attributes(item)) || matches!(item, Item::Mod(_)) {
            return;
        }
        if let Item::Use(import) = item {
            if self.scopes.is_empty() {
                let is_reexport = !matches!(import.vis, Visibility::Inherited);
                for leaf in leaves(&import.tree) {
                    // of a glob, what is used is noted where it is used
                    self.path(&leaf.path, leaf.line, is_reexport);
                }
            }
            return;
        }
        visit::visit_item(self, item);
    }

    fn visit_item_fn(&mut self, item: &'a syn::ItemFn) {
        let mut scope = Self::generics(&item.sig.generics);
        let mut bound = Bound::default();
        bound.visit_item_fn(item);
        scope.append(&mut bound.0);
        self.within(scope, |it| visit::visit_item_fn(it, item));
    }

    fn visit_impl_item_fn(&mut self, item: &'a syn::ImplItemFn) {
        if is_test(&item.attrs) {
            return;
        }
        let mut scope = Self::generics(&item.sig.generics);
        let mut bound = Bound::default();
        bound.visit_impl_item_fn(item);
        scope.append(&mut bound.0);
        self.within(scope, |it| visit::visit_impl_item_fn(it, item));
    }

    fn visit_trait_item_fn(&mut self, item: &'a syn::TraitItemFn) {
        let mut scope = Self::generics(&item.sig.generics);
        let mut bound = Bound::default();
        bound.visit_trait_item_fn(item);
        scope.append(&mut bound.0);
        self.within(scope, |it| visit::visit_trait_item_fn(it, item));
    }

    fn visit_item_impl(&mut self, item: &'a syn::ItemImpl) {
        let this = self_type(&item.self_ty).map(|path| self.names.find(self.module, &path));
        self.this
            .push(this.map(|found| found.definitions).unwrap_or_default());
        let scope = Self::generics(&item.generics);
        self.within(scope, |it| visit::visit_item_impl(it, item));
        self.this.pop();
    }

    fn visit_item_struct(&mut self, item: &'a syn::ItemStruct) {
        let scope = Self::generics(&item.generics);
        self.within(scope, |it| visit::visit_item_struct(it, item));
    }

    fn visit_item_enum(&mut self, item: &'a syn::ItemEnum) {
        let scope = Self::generics(&item.generics);
        self.within(scope, |it| visit::visit_item_enum(it, item));
    }

    fn visit_item_trait(&mut self, item: &'a syn::ItemTrait) {
        let scope = Self::generics(&item.generics);
        self.within(scope, |it| visit::visit_item_trait(it, item));
    }

    fn visit_block(&mut self, block: &'a syn::Block) {
        let mut scope = Scope::new();
        for statement in &block.stmts {
            let Stmt::Item(item) = statement else {
                continue;
            };
            if let Some((name, _)) = definition(item) {
                scope.push((name, Local::Item));
            }
            if let Item::Use(import) = item {
                for leaf in leaves(&import.tree) {
                    self.path(&leaf.path, leaf.line, false);
                    if let Some(name) = leaf.name {
                        scope.push((name, Local::Import(leaf.path)));
                    }
                }
            }
        }
        self.within(scope, |it| visit::visit_block(it, block));
    }

    fn visit_path(&mut self, path: &'a syn::Path) {
        if path.leading_colon.is_none() {
            let line = path.segments[0].ident.span().start().line;
            self.path(&segments(path), line, false);
        }
        visit::visit_path(self, path);
    }

    fn visit_expr_method_call(&mut self, call: &'a syn::ExprMethodCall) {
        if let Expr::Path(receiver) = &*call.receiver
            && receiver.path.is_ident("self")
        {
            let this = self.this.last().cloned().unwrap_or_default();
            let line = call.method.span().start().line;
            let what = format!("self.{}", call.method);
            self.associated(&this, Some(&call.method.to_string()), line, &what);
        }
        visit::visit_expr_method_call(self, call);
    }

    fn visit_macro(&mut self, item: &'a Macro) {
        self.visit_path(&item.path);
        self.tokens(item.tokens.clone(), false);
    }

    fn visit_attribute(&mut self, attribute: &'a Attribute) {
        match &attribute.meta {
            Meta::List(list) if list.path.is_ident("derive") => {
                self.tokens(list.tokens.clone(), false);
            }
            Meta::List(list) => self.tokens(list.tokens.clone(), true),
            Meta::NameValue(pair) if !matches!(&pair.value, Expr::Lit(lit) if matches!(lit.lit, Lit::Str(_))) =>
            {
                self.visit_expr(&pair.value);
            }
            _ => {}
        }
    }

    fn visit_visibility(&mut self, _: &'a Visibility) {}
}
