//! Pages for a browser: HTML that needs no other file and no script, and is well-formed XML, so that a small parser can
//! check it.

use minijinja::Environment;
use minijinja::syntax::SyntaxConfig;
use minijinja::value::{Serde, Value};
use serde::Serialize;
use tactus_lab::data::printable::printable;

/// The page that a template makes of these words and figures; `style` is the pages' CSS. Errors: The template is wrong.
pub fn render(template: &str, page: &impl Serialize) -> Result<String, minijinja::Error> {
    let lines = SyntaxConfig::builder()
        .trim_blocks(true)
        .lstrip_blocks(true)
        .build()?;
    let mut templates = Environment::new();
    templates.set_syntax(lines);
    let style = Value::from_safe_string(include_str!("page.css").to_owned());
    templates.add_global("style", style);
    templates.add_template("page.html", template)?;
    let page = templates.get_template("page.html")?.render(Serde(page))?;
    Ok(printable(&page).into_owned())
}
