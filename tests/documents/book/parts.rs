//! The generated parts that come from sources: tables of faults, gates, messages, fields, settings, commands of xtask.

use syn::{Expr, Item, ItemEnum, Lit};
use tactus_core::rig::FAULTS;
use tactus_link::bringup::{MISTAKES, STEPS};

use super::{files, read};

/// Page, name of the part, and what it should be.
pub(super) fn from_sources() -> Vec<(&'static str, &'static str, String)> {
    vec![
        ("docs/src/faults.md", "faults", faults()),
        (
            "docs/src/table.md",
            "table",
            section("shared/src", "# Binary form"),
        ),
        (
            "docs/src/recordings.md",
            "recordings",
            section("host-tools/lab/src", "The project's own format"),
        ),
        (
            "docs/src/store.md",
            "store",
            section("shared/src", "The data that survives a power cut"),
        ),
        ("docs/src/store.md", "settings", settings()),
        ("docs/src/wire.md", "wire", wire()),
        ("docs/src/performance.md", "gates", gates()),
        ("docs/src/tests.md", "xtask", xtask()),
        ("docs/src/bring-up.md", "steps", steps()),
        ("docs/src/bring-up.md", "mistakes", mistakes()),
        ("docs/src/printer.md", "force", super::holder::force()),
    ]
}

fn steps() -> String {
    let mut text =
        String::from("| step | what it checks | how | what is right |\n|---|---|---|---|\n");
    for step in STEPS {
        let (key, checks, how, limit) = (step.key, step.checks, step.how, (step.limit)());
        text += &format!("| `{key}` | {checks} | {how} | {limit} |\n");
    }
    text
}

fn mistakes() -> String {
    let mut text = String::from("| name | what is wrong | what to do |\n|---|---|---|\n");
    for mistake in MISTAKES {
        let (key, what, remedy) = (mistake.key, mistake.what, mistake.remedy);
        text += &format!("| `{key}` | {what} | {remedy} |\n");
    }
    text
}

fn faults() -> String {
    let mut text = String::from(
        "| fault | how it is detected | deadline | what stops | what is refused | what to do \
         |\n|---|---|---|---|---|---|\n",
    );
    for row in FAULTS {
        text += &format!(
            "| {} | {} | {} | {} | {} | {} |\n",
            row.name, row.detected, row.deadline_ms, row.stops, row.refused, row.recovery
        );
    }
    text
}

/// The sources of a folder, parsed.
fn sources(folder: &str) -> Vec<syn::File> {
    let parse =
        |path: &String| syn::parse_file(&read(path)).unwrap_or_else(|why| panic!("{path}: {why}"));
    files(folder, ".rs").iter().map(parse).collect()
}

/// The part of a file's own documentation that begins with `start`, up to its end.
fn section(folder: &str, start: &str) -> String {
    for path in files(folder, ".rs") {
        let source = read(&path);
        let lines = source.lines().map_while(|line| line.strip_prefix("//!"));
        let page: Vec<&str> = lines
            .map(|line| line.strip_prefix(' ').unwrap_or(line))
            .collect();
        if let Some(at) = page.iter().position(|line| line.starts_with(start)) {
            // a heading there is one below the page's here
            let lines = page[at..].iter().map(|line| match line.strip_prefix("# ") {
                Some(heading) => format!("## {heading}\n"),
                None => format!("{line}\n"),
            });
            return plain(&lines.collect::<String>());
        }
    }
    panic!("no file below {folder} has a page with {start:?}");
}

/// Links to items become their names.
fn plain(text: &str) -> String {
    let mut plain = String::new();
    let mut rest = text;
    while let Some((before, after)) = rest.split_once("[`") {
        let Some((name, tail)) = after.split_once("`]") else {
            break;
        };
        let module = |part: &&str| part.starts_with(|c: char| c.is_lowercase());
        let mut path: Vec<&str> = name.split("::").collect();
        while path.len() > 1 && path.first().is_some_and(module) {
            path.remove(0);
        }
        let name = path.join("::");
        plain += &format!("{before}`{name}`");
        rest = match tail.strip_prefix('(').and_then(|tail| tail.split_once(')')) {
            Some((_, tail)) => tail,
            None => tail,
        };
    }
    plain + rest
}

/// The documentation of an item, its paragraphs as lines.
pub(super) fn doc(attributes: &[syn::Attribute]) -> String {
    let lines = attributes.iter().filter_map(|attribute| {
        let named = attribute.meta.require_name_value().ok()?;
        match &named.value {
            Expr::Lit(value) if named.path.is_ident("doc") => match &value.lit {
                Lit::Str(text) => Some(text.value().trim().to_owned()),
                _ => None,
            },
            _ => None,
        }
    });
    let lines = lines.collect::<Vec<_>>();
    match lines.is_empty() {
        true => error_text(attributes).unwrap_or_default(),
        false => plain(&lines.join(" ")),
    }
}

/// The text of an error: it says what there is no comment for.
fn error_text(attributes: &[syn::Attribute]) -> Option<String> {
    use quote::ToTokens as _;
    let mut attributes = attributes.iter();
    let error = attributes.find(|attribute| attribute.path().is_ident("error"))?;
    let mut tokens = error.meta.require_list().ok()?.tokens.clone().into_iter();
    tokens.find_map(|token| {
        let text: syn::LitStr = syn::parse2(token.into_token_stream()).ok()?;
        Some(text.value())
    })
}

fn wire() -> String {
    let mut files = sources("shared/src/wire");
    files.insert(0, syn::parse_file(&read("shared/src/wire.rs")).unwrap());
    let items: Vec<&Item> = files.iter().flat_map(|file| &file.items).collect();
    let an_enum = |name: &str| -> &ItemEnum {
        let mut enums = items.iter().filter_map(|item| match item {
            Item::Enum(found) if found.ident == name => Some(found),
            _ => None,
        });
        enums.next().unwrap_or_else(|| panic!("no enum {name}"))
    };
    let mut text = section("shared/src", "A frame is a message");
    text += "\nA message is in [postcard](https://postcard.jamesmunns.com)'s format, in which a variant is its \
     number.\n";
    for (heading, name) in [
        ("Commands of the host", "Command"),
        ("Events of the probe", "Event"),
    ] {
        let found = an_enum(name);
        text += &format!(
            "\n## {heading}\n\n| number | `{}` | what it is |\n|---|---|---|\n",
            found.ident
        );
        for (number, variant) in found.variants.iter().enumerate() {
            let about = doc(&variant.attrs);
            text += &format!("| {number} | `{}` | {about} |\n", variant.ident);
        }
    }
    text
}

/// True if it is part of a message.
pub(super) fn is_sent(attributes: &[syn::Attribute]) -> bool {
    use quote::ToTokens as _;
    attributes.iter().any(|attribute| {
        attribute.path().is_ident("derive")
            && attribute
                .to_token_stream()
                .to_string()
                .contains("Serialize")
    })
}

/// The value of a constant below `folder`, as its expression.
pub(super) fn constant(folder: &str, name: &str) -> Option<Expr> {
    sources(folder)
        .iter()
        .flat_map(|file| &file.items)
        .find_map(|item| match item {
            Item::Const(found) if found.ident == name => Some((*found.expr).clone()),
            _ => None,
        })
}

/// An expression of numbers as it is written.
fn number(of: &Expr) -> String {
    use quote::ToTokens as _;
    of.to_token_stream()
        .to_string()
        .replace(" * ", " ")
        .replace('_', " ")
}

/// The elements of an array, or of a reference to one; each the elements of a tuple.
fn rows(of: &Expr) -> Vec<Vec<Expr>> {
    match of {
        Expr::Reference(inner) => rows(&inner.expr),
        Expr::Array(array) => array
            .elems
            .iter()
            .map(|element| match element {
                Expr::Tuple(tuple) => tuple.elems.iter().cloned().collect(),
                other => vec![other.clone()],
            })
            .collect(),
        _ => Vec::new(),
    }
}

/// The words of an expression: a string itself, a constant's string, or the expression.
fn said(of: &Expr, folder: &str) -> String {
    match of {
        Expr::Lit(value) => match &value.lit {
            Lit::Str(text) => text.value(),
            _ => number(of),
        },
        Expr::Path(path) => path
            .path
            .get_ident()
            .and_then(|name| constant(folder, &name.to_string()))
            .map_or_else(|| number(of), |value| said(&value, folder)),
        _ => number(of),
    }
}

fn gates() -> String {
    const XTASK: &str = "host-tools/xtask/src";
    let mut text = String::from("| limit | of | at most |\n|---|---|---|\n");
    let flash = number(&constant(XTASK, "MAX_FLASH").unwrap());
    text += &format!("| flash | each image | {flash} |\n");
    let variables = number(&constant(XTASK, "MAX_VARIABLES").unwrap());
    text += &format!("| variables | each image | {variables} |\n");
    const EMULATOR: &str = "host-tools/emulator/src";
    for row in rows(&constant(EMULATOR, "GATES").unwrap()) {
        let [kernel, unit, gate] = [0, 1, 2].map(|at| said(&row[at], EMULATOR));
        text += &format!("| {kernel} | {unit} | {} |\n", gate.trim_end_matches(".0"));
    }
    text
}

fn settings() -> String {
    let all = sources("shared/src/store");
    let mut text = String::from("| key or limit | value | what it is |\n|---|---|---|\n");
    let mut found = Vec::new();
    for item in all.iter().flat_map(|file| &file.items) {
        if let Item::Const(constant) = item {
            let name = constant.ident.to_string();
            let listed = ["SCHEMA", "MAX_RECORDS", "SELF_MOVEMENTS", "RECORD"];
            if name.starts_with("KEY_") || listed.contains(&name.as_str()) {
                found.push((name, number(&constant.expr), doc(&constant.attrs)));
            }
        }
    }
    for (name, value, about) in found {
        text += &format!("| `{name}` | {value} | {about} |\n");
    }
    text
}

/// Names of `cargo xtask`'s commands, and what they do.
pub(super) fn xtask_commands() -> Vec<(String, String)> {
    let files = sources("host-tools/xtask/src");
    let cli = files
        .iter()
        .flat_map(|file| &file.items)
        .find_map(|item| match item {
            Item::Enum(found) if found.ident == "Cli" => Some(found),
            _ => None,
        });
    let variants = &cli.expect("xtask has an enum Cli").variants;
    variants
        .iter()
        .map(|variant| {
            let about = variant.attrs.iter().find(|a| a.path().is_ident("doc"));
            let about = doc(about.map(std::slice::from_ref).unwrap_or_default());
            (variant.ident.to_string().to_lowercase(), about)
        })
        .collect()
}

fn xtask() -> String {
    let mut text = String::from("| command | what it does |\n|---|---|\n");
    for (name, about) in xtask_commands() {
        text += &format!("| `cargo xtask {name}` | {about} |\n");
    }
    text
}
