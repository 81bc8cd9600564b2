//! The moving picture of the README: an exploration as `tactus identify` prints it, as an animated SVG.

use std::fmt::Write as _;

/// Seconds of a slide's four parts: choice, way down and slide, features, posterior.
const PARTS: [f64; 4] = [1.2, 2.4, 0.8, 1.6];
/// Seconds that the verdict stays.
const VERDICT: f64 = 3.5;
const ROW: usize = 26;
const BAR: f64 = 190.0;

/// One slide, as it is printed.
struct Slide<'t> {
    movement: &'t str,
    because: &'t str,
    features: &'t str,
    posterior: Vec<(f64, &'t str)>,
}

fn slides(printed: &str) -> Vec<Slide<'_>> {
    let mut slides: Vec<Slide<'_>> = Vec::new();
    for line in printed.lines() {
        let said = line.trim_start_matches([' ', '█', '░']);
        if let Some((_, movement)) = line.strip_prefix("Slide ").and_then(|l| l.split_once(": ")) {
            slides.push(Slide {
                movement,
                because: "",
                features: "",
                posterior: Vec::new(),
            });
            continue;
        }
        let Some(slide) = slides.last_mut().filter(|_| line.starts_with(' ')) else {
            continue;
        };
        if let Some(because) = said.strip_prefix("because ") {
            slide.because = because.split(" (").next().unwrap_or(because);
        } else if slide.features.is_empty() {
            slide.features = said
                .split_once("  ")
                .map_or(said, |(_, features)| features.trim());
        } else if let Some((percent, name)) = said.split_once(" %  ") {
            slide
                .posterior
                .push((percent.trim().parse().unwrap(), name));
        }
    }
    slides
}

/// Opacity of something that is there from one second to another.
fn shown(css: &mut String, name: &str, total: f64, from: f64, to: f64) {
    let at = |seconds: f64| 100.0 * seconds / total;
    let (a, b, c, d) = (at(from), at(from + 0.25), at(to - 0.05), at(to));
    let end = if to >= total {
        ",100%{opacity:1}".replacen(',', "", 1)
    } else {
        format!("{d:.2}%,100%{{opacity:0}}")
    };
    writeln!(
        css,
        "@keyframes {name}{{0%,{a:.2}%{{opacity:0}}{b:.2}%,{c:.2}%{{opacity:1}}{end}}} .{name}{{animation:{name} {total}s infinite}}"
    )
    .unwrap();
}

/// A property that changes at these seconds to these values.
fn moved(css: &mut String, name: &str, total: f64, stops: &[(f64, String)]) {
    let stops: String = stops
        .iter()
        .map(|(seconds, value)| format!("{:.2}%{{transform:{value}}}", 100.0 * seconds / total))
        .collect();
    writeln!(
        css,
        "@keyframes {name}{{{stops}}} .{name}{{animation:{name} {total}s infinite ease-in-out}}"
    )
    .unwrap();
}

/// The picture of what `tactus COMMAND` printed.
pub(super) fn moving(printed: &str, command: &str) -> String {
    let slides = slides(printed);
    assert!(!slides.is_empty(), "no slides in\n{printed}");
    let each: f64 = PARTS.iter().sum();
    let total = each * slides.len() as f64 + VERDICT;
    let mut names: Vec<&str> = Vec::new();
    for (_, name) in slides.iter().flat_map(|slide| &slide.posterior) {
        if !names.contains(name) && !name.ends_with(" others") {
            names.push(name);
        }
    }
    let among = printed
        .split_once("one of ")
        .and_then(|(_, rest)| rest.split_once('.'));
    let among: f64 = among
        .and_then(|(n, _)| n.parse().ok())
        .unwrap_or(names.len() as f64);
    let verdict = printed
        .lines()
        .find(|line| line.starts_with("It is"))
        .unwrap_or_default();

    let (mut css, mut body) = (String::new(), String::new());
    let (mut finger, mut sample) = (vec![(0.0, up())], vec![(0.0, at(0.0))]);
    for (number, slide) in slides.iter().enumerate() {
        let begin = each * number as f64;
        let [choice, slid, observed, _] = PARTS;
        let (down, over) = (begin + choice, begin + choice + slid);
        // the last one stays below the verdict
        let end = if number + 1 == slides.len() {
            total
        } else {
            begin + each
        };
        finger.extend([
            (down, up()),
            (down + 0.5, at(0.0)),
            (over - 0.3, at(0.0)),
            (over, up()),
        ]);
        sample.extend([
            (down + 0.5, at(0.0)),
            (over - 0.3, at(-70.0)),
            (over + 0.6, at(0.0)),
        ]);
        shown(&mut css, &format!("c{number}"), total, begin, end);
        shown(&mut css, &format!("f{number}"), total, over, end);
        shown(&mut css, &format!("p{number}"), total, over + observed, end);
        writeln!(
            body,
            r#"<g class="c{number}"><text x="24" y="262" class="h">Slide {}: {}</text><text x="24" y="282" class="s">{}</text></g>"#,
            number + 1,
            slide.movement,
            slide.because
        )
        .unwrap();
        writeln!(
            body,
            r#"<text x="24" y="310" class="f{number}">measured: {}</text>"#,
            slide.features
        )
        .unwrap();
        for (percent, name) in &slide.posterior {
            if let Some(row) = names.iter().position(|n| n == name) {
                let y = 84 + ROW * row;
                writeln!(
                    body,
                    r#"<text x="796" y="{y}" class="e p{number}">{percent:.1} %</text>"#
                )
                .unwrap();
            }
        }
    }
    finger.push((total, up()));
    sample.push((total, at(0.0)));
    moved(&mut css, "finger", total, &finger);
    moved(&mut css, "sample", total, &sample);
    for (row, name) in names.iter().enumerate() {
        let mut width = 1.0 / among;
        let mut stops = vec![(0.0, scale(width))];
        for (number, slide) in slides.iter().enumerate() {
            let begin = each * number as f64 + PARTS[..3].iter().sum::<f64>();
            stops.push((begin, scale(width)));
            let found = slide.posterior.iter().find(|(_, other)| other == name);
            width = found.map_or(0.0, |(percent, _)| percent / 100.0);
            stops.push((begin + 0.8, scale(width)));
        }
        stops.push((total, scale(width)));
        moved(&mut css, &format!("b{row}"), total, &stops);
        let y = 84 + ROW * row;
        writeln!(
            body,
            r#"<text x="540" y="{y}" class="e">{name}</text><rect class="rail" x="550" y="{}" width="{BAR}" height="14"/><rect class="bar b{row}" x="550" y="{}" width="{BAR}" height="14"/>"#,
            y - 12,
            y - 12
        )
        .unwrap();
    }
    shown(&mut css, "v", total, total - VERDICT, total);
    let height = 340;
    format!(
        r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 820 {height}" role="img" aria-label="A finger slides over an unknown texture until one of {among} is sure: {verdict}">
<desc>tactus {command}</desc>
<style>
text{{font:14px sans-serif;fill:#1f2328}}.h{{font-weight:bold}}.s{{font-size:12px;fill:#57606a}}.e{{text-anchor:end}}.v{{font-weight:bold;fill:#1a7f37}}
.card{{fill:#fff}}.metal{{fill:#d0d7de;stroke:#57606a}}.skin{{fill:#e8b28f;stroke:#9a6a4a}}.cloth{{fill:#dfc98a;stroke:#8a7330}}.rail{{fill:#eaeef2}}.bar{{fill:#0969da;transform-origin:550px 0}}
@media(prefers-color-scheme:dark){{text{{fill:#e6edf3}}.s{{fill:#a5afba}}.v{{fill:#3fb950}}.card{{fill:#0d1117}}.metal{{fill:#30363d;stroke:#8b949e}}.skin{{fill:#b98261}}.cloth{{fill:#8a7838;stroke:#c9b36a}}.rail{{fill:#21262d}}.bar{{fill:#58a6ff}}}}
{css}@media(prefers-reduced-motion:reduce){{*{{animation-play-state:paused!important;animation-delay:-{}s!important}}}}
</style>
<rect class="card" width="820" height="{height}" rx="8"/>
<text x="24" y="34" class="s">tactus {command}</text>
<g class="sample"><path class="cloth" d="M90 186l8-5 8 5 8-5 8 5 8-5 8 5 8-5 8 5 8-5 8 5 8-5 8 5 8-5 8 5 8-5 8 5 8-5 8 5 8-5 8 5 8-5 8 5 8-5 8 5v12H90z"/><rect class="metal" x="80" y="198" width="212" height="16" rx="3"/></g>
<path class="metal" d="M24 222h340v8H24z"/>
<g class="finger"><path class="metal" d="M40 112h196v12H40z"/><path class="skin" d="M196 124h34v40c0 26-34 26-34 0z"/></g>
<text x="550" y="54" class="s">probability of each texture, of {among}</text>
{body}<text x="400" y="{}" class="v">{verdict}</text>
</svg>
"#,
        total - 0.5,
        height - 20
    )
}

fn up() -> String {
    "translate(0px,-34px)".to_owned()
}

fn at(x: f64) -> String {
    format!("translate({x}px,0px)")
}

fn scale(width: f64) -> String {
    format!("scaleX({width:.4})")
}
