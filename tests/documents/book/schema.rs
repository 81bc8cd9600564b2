//! The messages of the link for programs: `docs/src/wire.json`, made from the sources as the page is.
//!
//! A type is the name of a number, of a type in `types`, or one of these: `{"seq": T}`, `{"option": T}`,
//! `{"tuple": [T, ...]}`, `{"array": T, "length": N}`, `{"enum": [VARIANT, ...]}`, `{"struct": [FIELD, ...]}`.

use std::collections::BTreeMap;

use serde_json::{Map, Value, json};
use syn::{Expr, Fields, GenericArgument, Item, Lit, PathArguments, Type, UseTree};
use tactus_core::rig::FAULTS;
use tactus_core::wire::bringup::BRINGUP;
use tactus_core::wire::{MAX_MESSAGE, PROTOCOL};

use super::parts::{doc, is_sent};
use super::{files, read};

/// The contents of frames: requests and reports of a probe, questions and answers of the self-test.
const ROOTS: [&str; 4] = ["Request", "Report", "Ask", "Answer"];
/// Numbers and texts as postcard has them; `usize` is as long as the longer end's.
const PLAIN: [&str; 12] = [
    "bool", "u8", "u16", "u32", "u64", "i8", "i16", "i32", "i64", "f32", "f64", "string",
];

/// The whole file.
pub(super) fn schema() -> String {
    let mut made = Schema::default();
    let roots = ROOTS.map(|root| {
        let found = made.sources.named(root, "wire");
        made.add(found)
    });
    let mut text = format!(
        "{{\n\"protocol\": {PROTOCOL},\n\"bringup\": {BRINGUP},\n\"max_message\": {MAX_MESSAGE},\n\"roots\": \
         {},\n\"types\": {{\n",
        json!(roots)
    );
    // a line for each type: a change of one is a change of a line
    let types = made.types.iter();
    let lines: Vec<String> = types
        .map(|(name, what)| format!("{}: {what}", json!(name)))
        .collect();
    text += &lines.join(",\n");
    text + "\n}\n}\n"
}

/// Where an item is defined.
#[derive(Clone, Copy, PartialEq, Eq)]
struct At {
    file: usize,
    item: usize,
}

struct Sources(Vec<(String, syn::File)>);

impl Default for Sources {
    fn default() -> Self {
        let parse = |path: String| {
            let file = syn::parse_file(&read(&path)).unwrap_or_else(|why| panic!("{path}: {why}"));
            (path, file)
        };
        Self(files("shared/src", ".rs").into_iter().map(parse).collect())
    }
}

impl Sources {
    fn item(&self, at: At) -> &Item {
        &self.0[at.file].1.items[at.item]
    }

    /// All types of this name that may be part of a message, and names of others.
    fn all(&self, name: &str) -> Vec<At> {
        let mut found = Vec::new();
        for (file, (_, parsed)) in self.0.iter().enumerate() {
            for (item, what) in parsed.items.iter().enumerate() {
                let is_it = match what {
                    Item::Struct(a) => a.ident == name && is_sent(&a.attrs),
                    Item::Enum(a) => a.ident == name && is_sent(&a.attrs),
                    Item::Type(a) => a.ident == name,
                    _ => false,
                };
                if is_it {
                    found.push(At { file, item });
                }
            }
        }
        found
    }

    /// The one in a room or file of this name.
    fn named(&self, name: &str, place: &str) -> At {
        let all = self.all(name).into_iter();
        let there: Vec<At> = all
            .filter(|at| {
                self.0[at.file]
                    .0
                    .split(['/', '.'])
                    .any(|word| word == place)
            })
            .collect();
        let [one] = there[..] else {
            panic!("{} types {name} in {place}", there.len());
        };
        one
    }

    /// The meaning of a path in a file: defined there, brought there, or the only one of its name.
    fn resolve(&self, path: &syn::Path, from: usize) -> At {
        let mut words: Vec<String> = path.segments.iter().map(|s| s.ident.to_string()).collect();
        let name = words.last().cloned().unwrap_or_default();
        let all = self.all(&name);
        if let [one] = all[..] {
            return one;
        }
        if words.len() == 1 {
            if let Some(here) = all.iter().find(|at| at.file == from) {
                return *here;
            }
            let uses = self.0[from].1.items.iter();
            let mut brought = uses.filter_map(|item| match item {
                Item::Use(what) => brings(&what.tree, &name),
                _ => None,
            });
            words = brought.next_back().unwrap_or(words);
        }
        let place = words.iter().rev().nth(1);
        let place = place.unwrap_or_else(|| panic!("{name} in {}: which?", self.0[from].0));
        self.named(&name, place)
    }
}

/// The path by which a `use` brings this name.
fn brings(tree: &UseTree, name: &str) -> Option<Vec<String>> {
    match tree {
        UseTree::Path(path) => {
            let mut whole = vec![path.ident.to_string()];
            whole.extend(brings(&path.tree, name)?);
            Some(whole)
        }
        UseTree::Name(found) => (found.ident == name).then(|| vec![name.to_owned()]),
        UseTree::Group(group) => group.items.iter().find_map(|tree| brings(tree, name)),
        _ => None,
    }
}

#[derive(Default)]
struct Schema {
    sources: Sources,
    types: BTreeMap<String, Value>,
    /// by the name that each has here
    places: Vec<(String, At)>,
}

impl Schema {
    /// Takes in a type and all that it holds; its name here.
    fn add(&mut self, at: At) -> String {
        if let Some((name, _)) = self.places.iter().find(|(_, there)| *there == at) {
            return name.clone();
        }
        let (name, what) = match self.sources.item(at) {
            Item::Struct(found) => (found.ident.to_string(), Item::Struct(found.clone())),
            Item::Enum(found) => (found.ident.to_string(), Item::Enum(found.clone())),
            _ => panic!("neither struct nor enum"),
        };
        // a name that another room has, too
        let taken = self.places.iter().any(|(other, _)| *other == name);
        let path = &self.sources.0[at.file].0;
        let room = path.trim_start_matches("shared/src/");
        let room = room.split(['/', '.']).next().unwrap_or_default();
        let name = if taken {
            format!("{room}::{name}")
        } else {
            name
        };
        self.places.push((name.clone(), at));
        let value = match &what {
            Item::Struct(found) => self.a_struct(found, at.file),
            Item::Enum(found) => {
                // only a reason may be another rig's; the probe's are `RigError`
                let given = found.generics.type_params().filter_map(|parameter| {
                    let default = parameter.default.clone()?;
                    Some((parameter.ident.to_string(), default))
                });
                let given = BTreeMap::from_iter(given);
                let variants = found.variants.iter().map(|variant| {
                    let mut row = Map::new();
                    row.insert("name".into(), json!(variant.ident.to_string()));
                    row.insert("what".into(), json!(doc(&variant.attrs)));
                    if let Some(holds) = self.fields(&variant.fields, at.file, &given) {
                        row.insert("holds".into(), holds);
                    }
                    Value::Object(row)
                });
                json!({ "enum": variants.collect::<Vec<_>>() })
            }
            _ => unreachable!(),
        };
        self.types.insert(name.clone(), value);
        name
    }

    fn a_struct(&mut self, found: &syn::ItemStruct, file: usize) -> Value {
        if let Some(as_this) = serde(&found.attrs, "into") {
            let kind: Type = syn::parse_str(&as_this).unwrap();
            return self.kind(&kind, file, &BTreeMap::new());
        }
        let holds = self.fields(&found.fields, file, &BTreeMap::new());
        holds.unwrap_or_else(|| json!({ "tuple": [] }))
    }

    /// The form of fields on the line: nothing, one type, a tuple, or a struct.
    fn fields(
        &mut self,
        of: &Fields,
        file: usize,
        given: &BTreeMap<String, Type>,
    ) -> Option<Value> {
        let mut kinds = Vec::new();
        for field in of {
            let kind = match serde(&field.attrs, "with").as_deref() {
                // the probabilities that are not negligible, with their places
                Some("sparse") => json!({"tuple": ["u16", {"seq": {"tuple": ["u8", "f32"]}}]}),
                Some(other) => panic!("{other}: how is that on the line?"),
                None => self.kind(&field.ty, file, given),
            };
            kinds.push((field, kind));
        }
        match (of, &kinds[..]) {
            (Fields::Unit, _) => None,
            (Fields::Unnamed(_), [(_, one)]) => Some(one.clone()),
            (Fields::Unnamed(_), _) => {
                let kinds: Vec<_> = kinds.into_iter().map(|(_, kind)| kind).collect();
                Some(json!({ "tuple": kinds }))
            }
            (Fields::Named(_), _) => {
                let rows = kinds.iter().map(|(field, kind)| {
                    let name = field.ident.as_ref().map(ToString::to_string);
                    json!({"name": name, "type": kind, "what": doc(&field.attrs)})
                });
                Some(json!({ "struct": rows.collect::<Vec<_>>() }))
            }
        }
    }

    fn kind(&mut self, of: &Type, file: usize, given: &BTreeMap<String, Type>) -> Value {
        match of {
            Type::Array(array) => {
                let element = self.kind(&array.elem, file, given);
                json!({"array": element, "length": length(&array.len)})
            }
            Type::Tuple(tuple) => {
                let kinds = tuple.elems.iter().map(|kind| self.kind(kind, file, given));
                json!({ "tuple": kinds.collect::<Vec<_>>() })
            }
            Type::Path(path) => self.path(&path.path, file, given),
            _ => panic!("a type that no message has"),
        }
    }

    fn path(&mut self, path: &syn::Path, file: usize, given: &BTreeMap<String, Type>) -> Value {
        let last = path.segments.last().unwrap();
        let name = last.ident.to_string();
        let kinds: Vec<Type> = match &last.arguments {
            PathArguments::AngleBracketed(inner) => inner.args.iter().filter_map(a_type).collect(),
            _ => Vec::new(),
        };
        let mut kind = |at: usize| self.kind(&kinds[at], file, given);
        match name.as_str() {
            "Vec" => json!({ "seq": kind(0) }),
            "Option" => json!({ "option": kind(0) }),
            "String" | "str" => json!("string"),
            "Result" => {
                let [good, bad] = [kind(0), kind(1)];
                json!({"enum": [{"name": "Ok", "holds": good}, {"name": "Err", "holds": bad}]})
            }
            "usize" => json!("u64"),
            // its name in files, its number on the line
            "FingerCode" => json!("u8"),
            // made by a macro
            "Fault" => {
                let faults = FAULTS.iter().map(|row| {
                    let name = serde_json::to_value(row.fault).unwrap();
                    json!({"name": name, "what": row.name})
                });
                let faults: Vec<Value> = faults.collect();
                self.types.insert(name.clone(), json!({ "enum": faults }));
                json!(name)
            }
            plain if PLAIN.contains(&plain) => json!(plain),
            parameter if given.contains_key(parameter) => {
                self.kind(&given[parameter].clone(), file, given)
            }
            _ => {
                let at = self.sources.resolve(path, file);
                if let Item::Type(alias) = self.sources.item(at) {
                    let kind = (*alias.ty).clone();
                    return self.kind(&kind, at.file, given);
                }
                json!(self.add(at))
            }
        }
    }
}

fn a_type(argument: &GenericArgument) -> Option<Type> {
    match argument {
        GenericArgument::Type(kind) => Some(kind.clone()),
        _ => None,
    }
}

/// A number that stands there, or a constant of the messages.
fn length(of: &Expr) -> u64 {
    match of {
        Expr::Lit(value) => match &value.lit {
            Lit::Int(number) => number.base10_parse().unwrap(),
            _ => panic!("a length that is no number"),
        },
        Expr::Path(path) => {
            let name = path.path.segments.last().unwrap().ident.to_string();
            let value = super::parts::constant("shared/src", &name);
            length(&value.unwrap_or_else(|| panic!("no constant {name}")))
        }
        _ => panic!("a length that is no constant"),
    }
}

/// The value of `#[serde(name = "value")]`.
fn serde(attributes: &[syn::Attribute], name: &str) -> Option<String> {
    let mut value = None;
    for attribute in attributes.iter().filter(|a| a.path().is_ident("serde")) {
        let _ = attribute.parse_nested_meta(|meta| {
            if let Ok(given) = meta.value() {
                let given: syn::LitStr = given.parse()?;
                if meta.path.is_ident(name) {
                    value = Some(given.value());
                }
            }
            Ok(())
        });
    }
    value
}
