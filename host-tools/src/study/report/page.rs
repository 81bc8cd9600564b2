//! The page: sections as HTML that needs no other file and no script. It is well-formed XML as well, so that a small parser
//! can check it.

use std::fmt::Write as _;

use super::model::{Block, Cell, Figure, Section, Table};
use crate::study::results::Study;

/// Dark on white, one column on a phone, no shadows or colours that a printer would fill.
const STYLE: &str = "\
:root{color-scheme:light}
body{font:16px/1.5 system-ui,sans-serif;color:#1a1a1a;background:#fff;max-width:1000px;margin:0 auto;padding:16px}
h1{font-size:1.7rem;line-height:1.2;margin:.5em 0}
h2{font-size:1.3rem;margin:2em 0 .4em;border-bottom:2px solid #0072b2;padding-bottom:.2em}
p{max-width:46em}
code{font-family:ui-monospace,monospace;font-size:.9em;background:#f2f2f2;padding:.1em .3em;overflow-wrap:anywhere}
nav a{margin-right:1em}
a{color:#00568a}
figure{margin:1.2em 0}
figcaption,caption{font-size:.92rem;color:#333;text-align:left;max-width:52em}
caption{padding:.3em 0;font-weight:600}
.panels{display:flex;flex-wrap:wrap;gap:8px}
.panel{flex:1 1 300px;max-width:480px;min-width:0}
.panel svg{width:100%;height:auto;display:block}
.table{overflow-x:auto;margin:1.2em 0}
table{border-collapse:collapse;font-size:.9rem}
th,td{padding:.2em .6em;border-bottom:1px solid #ccc;text-align:left;vertical-align:top}
th{border-bottom:2px solid #666}
td.n{text-align:right;font-variant-numeric:tabular-nums;white-space:nowrap}
.file{font-size:.85rem;color:#444}
@media (max-width:600px){body{padding:10px}h1{font-size:1.4rem}.panel{flex-basis:100%;max-width:100%}th,td{padding:.2em .35em}table{font-size:.82rem}}
@media print{body{max-width:none;padding:0;font-size:10.5pt}nav{display:none}h2{break-after:avoid}.panel,tr{break-inside:avoid}.panel{flex:0 0 47%;max-width:47%}.table{overflow:visible}a{color:inherit;text-decoration:none}}
";

/// The page of a study.
pub(super) fn html(study: &Study, sections: &[Section]) -> String {
    let mut page = String::new();
    let mut put = |text: &str| page.push_str(text);
    put("<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n");
    put("<meta name=\"viewport\" content=\"width=device-width,initial-scale=1\"/>\n");
    // no icon is asked for
    put("<link rel=\"icon\" href=\"data:,\"/>\n");
    put("<title>The study of Fishel &amp; Loeb 2012, on the simulated rig</title>\n<style>\n");
    put(STYLE);
    put("</style>\n</head>\n<body>\n<main>\n");
    put(
        "<h1>Bayesian exploration of textures: the study of Fishel &amp; Loeb 2012, on the simulated rig</h1>\n",
    );
    put(&format!(
        "<p>Made by Tactus {} with <code>{}</code>: world {}, variation of trials {}. The same command gives the same page.</p>\n",
        escaped(study.version),
        escaped(&study.command),
        study.seed,
        study.variation
    ));
    put("<nav>");
    for section in sections {
        put(&format!(
            "<a href=\"#{}\">{}</a> ",
            section.id,
            escaped(&section.title)
        ));
    }
    put("</nav>\n");
    for section in sections {
        put(&format!(
            "<section id=\"{}\">\n<h2>{}</h2>\n",
            section.id,
            escaped(&section.title)
        ));
        for block in &section.blocks {
            put(&match block {
                Block::Text(text) => format!("<p>{}</p>\n", escaped(text)),
                Block::Table(of) => table(of),
                Block::Figure(panels, caption) => figure(panels, caption),
                Block::File(of) => format!(
                    "<p class=\"file\">{}: <a href=\"tables/{1}.csv\">tables/{1}.csv</a></p>\n",
                    escaped(&of.title),
                    of.id
                ),
            });
        }
        put("</section>\n");
    }
    put("</main>\n</body>\n</html>\n");
    page
}

fn table(table: &Table) -> String {
    let mut html = format!(
        "<div class=\"table\"><table id=\"table-{}\"><caption>{}</caption>\n<thead><tr>",
        table.id,
        escaped(&table.title)
    );
    // writing to a String cannot fail
    for name in &table.header {
        let _ = write!(html, "<th scope=\"col\">{}</th>", escaped(name));
    }
    html.push_str("</tr></thead>\n<tbody>\n");
    for row in &table.rows {
        html.push_str("<tr>");
        for cell in row {
            let _ = match cell {
                Cell::Text(text) => write!(html, "<td>{}</td>", escaped(text)),
                Cell::Number(value, decimals) => {
                    write!(html, "<td class=\"n\">{value:.decimals$}</td>")
                }
                Cell::Empty => write!(html, "<td></td>"),
            };
        }
        html.push_str("</tr>\n");
    }
    let _ = writeln!(
        html,
        "</tbody></table><p class=\"file\"><a href=\"tables/{0}.csv\">tables/{0}.csv</a></p></div>",
        table.id
    );
    html
}

fn figure(panels: &[Figure], caption: &str) -> String {
    let mut html = String::from("<figure>\n<div class=\"panels\">\n");
    for panel in panels {
        let label = format!(
            "<svg role=\"img\" aria-label=\"{}\" ",
            escaped(&panel.title)
        );
        let svg = panel.svg.replacen("<svg ", &label, 1);
        let _ = writeln!(
            html,
            "<div class=\"panel\" id=\"figure-{}\">{svg}</div>",
            panel.id
        );
    }
    let _ = writeln!(
        html,
        "</div>\n<figcaption>{}</figcaption>\n</figure>",
        escaped(caption)
    );
    html
}

/// Text that is no markup.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}
