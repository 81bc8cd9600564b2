//! Golden images: every screen, as PBM files in `golden/`. `TACTUS_GOLDEN=write` makes them anew, and a sheet of all of
//! them for people; look at it before you commit.

use std::format;
use std::path::PathBuf;
use std::string::String as Text;
use std::vec::Vec as List;

use super::*;
use crate::handheld::jobs::words;
use crate::handheld::picture::{HEIGHT, Picture, WIDTH};
use crate::handheld::screen::LINES;
use crate::handheld::spelling::Spelling;
use crate::store::StoreError;
use crate::table::{Name, TableError};
use crate::wire::MemoryError;
use heapless::Vec;

const LONG: &str = "Corduroy, fine wale, well worn at the knee";

fn row(name: &str, probability: f32) -> Row<'_> {
    Row { name, probability }
}

fn wheel(turns: usize) -> [Place; WHEEL] {
    let mut spelling = Spelling::default();
    (0..turns).for_each(|_| spelling.turn());
    spelling.wheel()
}

fn rows<const N: usize>(rows: &[Row<'static>]) -> Vec<Row<'static>, N> {
    Vec::from_slice(rows).unwrap()
}

/// Every screen, by name.
fn draw_all(mut each: impl FnMut(&'static str, &Screen<'_>)) {
    draw_touches(&mut each);
    draw_verdicts(&mut each);
    draw_lists(&mut each);
    draw_ends(&mut each);
}

fn draw_touches(each: &mut impl FnMut(&'static str, &Screen<'_>)) {
    let press = |force_mn, down| Screen::Press {
        slide: 1,
        of: 5,
        force_mn,
        down,
    };
    let seen = |progress, way| Screen::Slide {
        slide: 2,
        of: 5,
        force_mn: 520.0,
        progress,
        way,
    };
    let slide = |progress| seen(progress, Way::NoSensor);
    each("air", &Screen::Air);
    each("ready", &Screen::Ready { textures: 117 });
    each("press", &press(0.0, false));
    each("press-harder", &press(180.0, true));
    each("press-lighter", &press(1100.0, true));
    each("press-still", &press(480.0, true));
    each("slide", &slide(None));
    each("slide-begun", &slide(Some(0.2)));
    each("slide-going", &slide(Some(0.8)));
    each("slide-seen", &seen(Some(0.5), Way::Seen(0.52)));
    each("slide-unseen", &seen(Some(0.5), Way::Unseen));
    each("slide-slow", &seen(Some(0.7), Way::Seen(0.4)));
    each("slide-fast", &seen(Some(0.5), Way::Seen(0.8)));
    for (name, why, lift) in [
        ("again-hard", Again::TooHard, true),
        ("again-light", Again::TooLight, false),
        ("again-short", Again::TooShort, false),
        ("again-uneven", Again::TooUneven, false),
        ("again-disturbed", Again::Disturbed, false),
    ] {
        each(name, &Screen::Again { why, lift });
    }
    each("lift", &Screen::Lift { slide: 2 });
    let weigh = Screen::Weigh {
        mn: 490,
        force_mn: 472.0,
    };
    each("weigh", &weigh);
    each("turn-down", &Screen::Turn { over: false });
    each("turn-over", &Screen::Turn { over: true });
}

fn draw_verdicts(each: &mut impl FnMut(&'static str, &Screen<'_>)) {
    each("thinking", &Screen::Thinking { slide: 2 });
    let sure = Screen::Verdict {
        rows: rows(&[
            row("bath towel", 0.9984),
            row("felt", 0.0011),
            row("burlap", 0.0001),
        ]),
        sure: true,
        open: false,
    };
    each("verdict", &sure);
    let unsure = Screen::Verdict {
        rows: rows(&[
            row("Cardboard", 0.61),
            row("Copy paper", 0.33),
            row("Balsa wood", 0.06),
        ]),
        sure: false,
        open: false,
    };
    each("verdict-unsure", &unsure);
    let open = Screen::Verdict {
        rows: rows(&[row("Cardboard", 0.61), row("Copy paper", 0.33)]),
        sure: false,
        open: true,
    };
    each("verdict-open", &open);
    let long = Screen::Verdict {
        rows: rows(&[
            row(LONG, 1.0),
            row("White Art Board, smooth", 0.0),
            row("1", 0.0),
        ]),
        sure: true,
        open: false,
    };
    each("verdict-long", &long);
    let unknown = Screen::Unknown {
        like: rows(&[row("Cardboard", 0.98), row(LONG, 0.02)]),
    };
    each("unknown", &unknown);
    let changed = Screen::Changed {
        rows: rows(&[row("Cardboard", 0.98), row(LONG, 0.02)]),
    };
    each("changed", &changed);
}

fn draw_lists(each: &mut impl FnMut(&'static str, &Screen<'_>)) {
    let entries: Vec<Entry<'_>, LINES> = Vec::from_slice(&[
        Entry::Text(LONG),
        Entry::Text("felt"),
        Entry::Numbered(Name::try_from("sample 1").unwrap()),
        Entry::Text("new: spell it"),
    ])
    .unwrap();
    each(
        "choose",
        &Screen::Choose {
            title: "What is it?",
            at: 0,
            count: 120,
            entries: entries.clone(),
        },
    );
    // the chosen one is the second that is shown
    each(
        "choose-later",
        &Screen::Choose {
            title: "What is it?",
            at: 70,
            count: 120,
            entries,
        },
    );
    each(
        "spell",
        &Screen::Spell {
            text: "velve",
            wheel: wheel(19),
        },
    );
    each(
        "spell-full",
        &Screen::Spell {
            text: "fourteen chars",
            wheel: wheel(37),
        },
    );
    let list = |title, at, count, texts: &[&'static str]| Screen::Choose {
        title,
        at,
        count,
        entries: texts.iter().copied().map(Entry::Text).collect(),
    };
    let todo = [
        "is it the same as ..?",
        "about this probe",
        "nothing, go back",
    ];
    each("menu", &list("Menu", 0, 3, &todo));
    let references = ["Burlap", "Cardboard", "Cork", "Felt"];
    each("reference", &list("Same as", 102, 116, &references));
    for (name, same, open, trials, other) in [
        ("compared-same", Some(true), false, 15, "Cork"),
        ("compared-different", Some(false), false, 2, LONG),
        ("compared-again", None, true, 15, "Cork"),
        ("compared-unsure", None, false, 15, "Cork"),
    ] {
        let compared = Screen::Compared {
            name: other,
            same,
            open,
            trials,
        };
        each(name, &compared);
    }
}

fn draw_ends(each: &mut impl FnMut(&'static str, &Screen<'_>)) {
    each("saving", &Screen::Saving);
    let name = Name::try_from("velvet").unwrap();
    each("taught", &Screen::Learned(Ok(&name)));
    each(
        "taught-not",
        &Screen::Learned(Err(words(&MemoryError::Full))),
    );
    each("fault-silent", &Screen::Fault(&Trouble::Silent));
    each("fault-frozen", &Screen::Fault(&Trouble::Frozen));
    for (name, why) in [
        ("fault-table", MemoryError::StoredTable(TableError::Header)),
        (
            "fault-newest-table",
            MemoryError::NewestTable(TableError::Header),
        ),
    ] {
        each(name, &Screen::Fault(&Trouble::Memory(words(&why))));
    }
    let memory = Trouble::Memory(words(&MemoryError::Store(StoreError::Worn)));
    each("fault-memory", &Screen::Fault(&memory));
    let about = About {
        version: "0.1.0",
        awake: Some(0.1234),
        awake_at_rest: Some(0.0021),
        late: 0,
        lost: 0,
        calibrated: 20_261_123,
        memory: 0.365,
    };
    each("about", &Screen::About(about));
    each("dark", &Screen::Dark);
}

fn picture(screen: &Screen<'_>) -> Picture {
    let mut picture = Picture::new();
    let Ok(()) = draw(screen, &mut picture);
    picture
}

/// A plain PBM.
fn pbm(picture: &Picture) -> Text {
    let mut text = format!("P1\n{WIDTH} {HEIGHT}\n");
    for y in 0..HEIGHT {
        text.extend((0..WIDTH).map(|x| if picture.is_lit(x, y) { '1' } else { '0' }));
        text.push('\n');
    }
    text
}

/// All of them side by side.
fn sheet(pictures: &[(&'static str, Picture)]) -> Text {
    const COLUMNS: usize = 4;
    let (cell, line) = (WIDTH + 12, HEIGHT + 26);
    let lines = pictures.len().div_ceil(COLUMNS);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {} {}\" font-family=\"sans-serif\" font-size=\"8\">\n",
        COLUMNS * cell + 12,
        lines * line + 6,
    );
    for ((name, picture), number) in pictures.iter().zip(0..) {
        let (left, top) = (12 + number % COLUMNS * cell, 16 + number / COLUMNS * line);
        svg += &format!("<text x=\"{left}\" y=\"{}\">{name}</text>", top - 5);
        svg += &format!(
            "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"#111\"/><path fill=\"#bfe6ff\" d=\"",
            left - 2,
            top - 2,
            WIDTH + 4,
            HEIGHT + 4
        );
        for y in 0..HEIGHT {
            let mut x = 0;
            while x < WIDTH {
                let run = (x..WIDTH).take_while(|&x| picture.is_lit(x, y)).count();
                if run > 0 {
                    svg += &format!("M{} {}h{run}v1h-{run}z", left + x, top + y);
                }
                x += run.max(1);
            }
        }
        svg += "\"/>\n";
    }
    svg + "</svg>\n"
}

#[test]
fn every_screen_is_as_it_was_looked_at() {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("src/handheld/golden");
    let mut pictures: List<(&'static str, Picture)> = List::new();
    draw_all(|name, screen| pictures.push((name, picture(screen))));
    let mut files: List<(Text, Text)> = pictures
        .iter()
        .map(|(name, picture)| (format!("{name}.pbm"), pbm(picture)))
        .collect();
    files.push(("screens.svg".into(), sheet(&pictures)));
    if std::env::var("TACTUS_GOLDEN").as_deref() == Ok("write") {
        for (name, text) in &files {
            std::fs::write(folder.join(name), text).unwrap();
        }
    }
    for (name, text) in &files {
        let golden = std::fs::read_to_string(folder.join(name));
        assert!(
            golden.is_ok_and(|golden| golden == *text),
            "{name} is not what is drawn now: make it anew with TACTUS_GOLDEN=write, and look at it"
        );
    }
    let kept = std::fs::read_dir(&folder).unwrap().count();
    assert_eq!(kept, files.len(), "a file that no screen has");
}

/// Takes note of points outside of the display.
struct Edge(List<embedded_graphics::geometry::Point>);

impl embedded_graphics::geometry::OriginDimensions for Edge {
    fn size(&self) -> Size {
        Size::new(WIDTH as u32, HEIGHT as u32)
    }
}

impl DrawTarget for Edge {
    type Color = BinaryColor;
    type Error = core::convert::Infallible;

    fn draw_iter<I>(&mut self, pixels: I) -> Result<(), Self::Error>
    where
        I: IntoIterator<Item = embedded_graphics::Pixel<BinaryColor>>,
    {
        for embedded_graphics::Pixel(at, colour) in pixels {
            let inside = (0..WIDTH as i32).contains(&at.x) && (0..HEIGHT as i32).contains(&at.y);
            if !inside && colour == BinaryColor::On {
                self.0.push(at);
            }
        }
        Ok(())
    }
}

#[test]
fn nothing_is_drawn_beyond_the_edge() {
    draw_all(|name, screen| {
        let mut edge = Edge(List::new());
        let Ok(()) = draw(screen, &mut edge);
        assert!(edge.0.is_empty(), "{name}: {:?}", edge.0);
    });
}
