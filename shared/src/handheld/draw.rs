//! Draws what the display shows: the same on chip and PC.
//!
//! The display is 22 mm wide and read at arm's length: nothing is smaller than 6 x 10 points, and the main text is
//! twice that. A line on top names the page; a line at the bottom the button's actions.

use core::fmt::Write as _;

use embedded_graphics::draw_target::DrawTarget;
use embedded_graphics::geometry::{Point, Size};
use embedded_graphics::pixelcolor::BinaryColor;
use embedded_graphics::primitives::Rectangle;
use heapless::String;

mod calibration;
mod letters;

use self::letters::{Anchor, BOLD, Font, LARGE, SMALL};
use super::guidance::{Again, Way, ZONE_MN};
use super::screen::{About, Entry, Row, Screen, Trouble, first_line};
use super::spelling::{Place, WHEEL};

const BAR_MN: f32 = 1200.0;
/// A slide is too fast or too slow when it is off by this part of its way.
const AHEAD: f32 = 0.15;
const WIDTH: i32 = super::picture::WIDTH as i32;
const MIDDLE: i32 = WIDTH / 2;

struct Brush<'d, D>(&'d mut D);

type Done<D> = Result<(), <D as DrawTarget>::Error>;

fn ink(inverted: bool) -> BinaryColor {
    if inverted {
        BinaryColor::Off
    } else {
        BinaryColor::On
    }
}

/// `text`, cut to so many letters, with two points in place of the rest.
fn cut(text: &str, most: usize) -> String<40> {
    let letters = text.chars().count();
    let mut cut = String::new();
    let kept = if letters > most {
        most.saturating_sub(2)
    } else {
        letters
    };
    // 40 letters are more than any line has
    text.chars().take(kept).all(|c| cut.push(c).is_ok());
    if letters > most {
        let _ = cut.push_str("..");
    }
    cut
}

impl<D: DrawTarget<Color = BinaryColor>> Brush<'_, D> {
    fn write(
        &mut self,
        text: &str,
        at: (i32, i32),
        font: &Font,
        anchor: Anchor,
        inverted: bool,
    ) -> Done<D> {
        letters::write(self.0, text, at, font, anchor, ink(inverted))
    }

    fn left(&mut self, text: &str, x: i32, y: i32) -> Done<D> {
        self.write(text, (x, y), &SMALL, Anchor::Left, false)
    }

    fn right(&mut self, text: &str, y: i32) -> Done<D> {
        self.write(text, (WIDTH, y), &SMALL, Anchor::Right, false)
    }

    fn centre(&mut self, text: &str, y: i32, font: &Font) -> Done<D> {
        self.write(text, (MIDDLE, y), font, Anchor::Middle, false)
    }

    /// In the middle, in the largest of three fonts that it fits.
    fn headline(&mut self, text: &str, y: i32) -> Done<D> {
        match text.chars().count() {
            0..=12 => self.centre(text, y, &LARGE),
            13..=18 => self.centre(text, y + 3, &BOLD),
            _ => self.centre(&cut(text, 21), y + 5, &SMALL),
        }
    }

    fn fill(&mut self, x: i32, y: i32, width: i32, height: i32, inverted: bool) -> Done<D> {
        let size = Size::new(width.max(0) as u32, height.max(0) as u32);
        let area = Rectangle::new(Point::new(x, y), size);
        self.0.fill_solid(&area, ink(inverted))
    }

    /// A frame one point wide, without its corners.
    fn frame(&mut self, x: i32, y: i32, width: i32, height: i32) -> Done<D> {
        for y in [y, y + height - 1] {
            self.fill(x + 1, y, width - 2, 1, false)?;
        }
        for x in [x, x + width - 1] {
            self.fill(x, y + 1, 1, height - 2, false)?;
        }
        Ok(())
    }

    fn disc(&mut self, x: i32, y: i32, radius: i32, inverted: bool) -> Done<D> {
        for up in -radius..=radius {
            let most = radius * radius + radius / 2 - up * up;
            let half = (0..=radius).rev().find(|half| half * half <= most);
            if let Some(half) = half {
                self.fill(x - half, y + up, 2 * half + 1, 1, inverted)?;
            }
        }
        Ok(())
    }

    /// A triangle on its point, or on its base, of this height; twice as wide but for a point.
    fn triangle(&mut self, x: i32, y: i32, height: i32, on_base: bool) -> Done<D> {
        for row in 0..height {
            let half = if on_base { row } else { height - 1 - row };
            self.fill(x - half, y + row, 2 * half + 1, 1, false)?;
        }
        Ok(())
    }

    fn title(&mut self, title: &str, right: &str) -> Done<D> {
        self.fill(0, 0, WIDTH, 12, false)?;
        self.write(title, (3, 1), &SMALL, Anchor::Left, true)?;
        self.write(right, (WIDTH - 3, 1), &SMALL, Anchor::Right, true)
    }

    fn button(&mut self, press: &str, hold: &str) -> Done<D> {
        if !press.is_empty() {
            self.disc(4, 59, 2, false)?;
            self.fill(3, 58, 3, 3, true)?;
            self.left(press, 10, 54)?;
        }
        if !hold.is_empty() {
            let width = 6 * hold.chars().count() as i32;
            let x = WIDTH - 2 - width - 11;
            self.fill(x, 58, 8, 3, false)?;
            self.left(hold, x + 11, 54)?;
        }
        Ok(())
    }

    fn force(&mut self, force_mn: f32, y: i32) -> Done<D> {
        const INSIDE: i32 = WIDTH - 4;
        let x = |mn: f32| 2 + (INSIDE as f32 * (mn / BAR_MN).clamp(0.0, 1.0)) as i32;
        self.frame(0, y, WIDTH, 12)?;
        self.fill(2, y + 2, x(force_mn) - 2, 8, false)?;
        let (low, high) = (x(*ZONE_MN.start()), x(*ZONE_MN.end()));
        for edge in [low, high] {
            // posts that stand out above and below, and from the bar
            self.fill(edge - 2, y + 1, 4, 10, true)?;
            self.fill(edge - 1, y - 4, 2, 20, false)?;
        }
        self.fill(low, y - 4, high - low, 1, false)
    }

    fn rows(&mut self, rows: &[Row<'_>], y: i32) -> Done<D> {
        for (row, y) in rows.iter().zip((y..).step_by(11)) {
            self.left(&cut(row.name, 11), 0, y)?;
            let p = row.probability.clamp(0.0, 1.0);
            self.fill(69, y + 8, 32, 1, false)?;
            self.fill(69, y + 2, (32.0 * p) as i32, 7, false)?;
            self.right(&percent(p), y)?;
        }
        Ok(())
    }
}

/// Whole percents; only the whole is 100, and only nothing is 0.
fn percent(p: f32) -> String<8> {
    let mut text = String::new();
    // eight letters are enough
    let _ = if p > 0.995 && p < 1.0 {
        text.push_str(">99%")
    } else if p > 0.0 && p < 0.005 {
        text.push_str("<1%")
    } else {
        write!(text, "{}%", libm::roundf(100.0 * p) as u8).map_err(|_| Default::default())
    };
    text
}

/// Year, month and day of a number such as 20261121.
const fn date(day: u32) -> (u32, u32, u32) {
    (day / 10_000, day / 100 % 100, day % 100)
}

/// "slide 2 of 5", or "slide 2" if the number of slides is unknown.
fn count(slide: u8, of: u8) -> String<40> {
    match of {
        0 => say(format_args!("slide {slide}")),
        of => say(format_args!("slide {slide} of {of}")),
    }
}

fn perhaps(rows: &[Row<'_>]) -> String<40> {
    let name = rows.first().map_or("?", |row| row.name);
    say(format_args!("{}?", cut(name, 20)))
}

fn below(name: &str) -> String<40> {
    say(format_args!(" {}", cut(name, 20)))
}

fn say(text: core::fmt::Arguments<'_>) -> String<40> {
    let mut said = String::new();
    // cut off if it is too long
    let _ = said.write_fmt(text);
    said
}

/// Draws a screen onto a dark display.
pub fn draw<D: DrawTarget<Color = BinaryColor>>(screen: &Screen<'_>, display: &mut D) -> Done<D> {
    let brush = &mut Brush(display);
    match screen {
        Screen::Dark => Ok(()),
        Screen::Air => {
            brush.title("Tactus", "")?;
            brush.centre("Hold it", 18, &LARGE)?;
            brush.centre("in the air", 38, &LARGE)
        }
        Screen::Ready { textures } => brush.ready(*textures),
        Screen::Press {
            slide,
            of,
            force_mn,
            down,
        } => {
            brush.title("Press", &count(*slide, *of))?;
            brush.press(*force_mn, *down)
        }
        Screen::Slide {
            slide,
            of,
            force_mn,
            progress,
            way,
        } => {
            brush.title("Slide", &count(*slide, *of))?;
            brush.pace(*progress, *way, *force_mn)?;
            brush.force(*force_mn, 48)
        }
        Screen::Lift { slide } => {
            match slide {
                0 => brush.title("Tactus", "")?,
                _ => brush.title("Good", &say(format_args!("slide {slide}")))?,
            }
            brush.centre("Lift", 18, &LARGE)?;
            brush.centre("the finger", 38, &LARGE)
        }
        Screen::Weigh { mn, force_mn } => brush.weigh(*mn, *force_mn),
        Screen::Turn { over } => brush.turn(*over),
        Screen::Again { why, lift } => brush.again(*why, *lift),
        Screen::Thinking { slide } => {
            brush.title("Thinking", &say(format_args!("slide {slide}")))?;
            for (x, radius) in [(44, 4), (64, 6), (84, 4)] {
                brush.disc(x, 38, radius, false)?;
            }
            Ok(())
        }
        Screen::Verdict { rows, sure, open } => brush.verdict(rows, *sure, *open),
        Screen::Changed { rows } => brush.changed(rows),
        Screen::Unknown { like } => brush.unknown(like),
        Screen::Compared {
            name,
            same,
            open,
            trials,
        } => brush.compared(name, *same, *open, *trials),
        Screen::Choose {
            title,
            at,
            count,
            entries,
        } => brush.choose(title, *at, *count, entries),
        Screen::Spell { text, wheel } => brush.spell(text, wheel),
        Screen::Saving => {
            brush.title("Teach", "")?;
            brush.headline("Learning", 18)?;
            brush.centre("Leave it on", 42, &SMALL)
        }
        Screen::Learned(Ok(name)) => brush.learned(name),
        Screen::Learned(Err(why)) => brush.sentence("Not learned", why),
        Screen::Fault(trouble) => brush.fault(trouble),
        Screen::About(about) => brush.about_probe(about),
    }
}

impl<D: DrawTarget<Color = BinaryColor>> Brush<'_, D> {
    fn press(&mut self, force_mn: f32, down: bool) -> Done<D> {
        let order = match force_mn {
            _ if !down => "Press",
            mn if mn < *ZONE_MN.start() => "Harder",
            mn if mn > *ZONE_MN.end() => "Lighter",
            _ => "Hold still",
        };
        self.centre(order, 15, &LARGE)?;
        self.force(force_mn, 42)
    }

    fn changed(&mut self, rows: &[Row<'_>]) -> Done<D> {
        self.headline(&perhaps(rows), -1)?;
        let like = "Feels like it, but";
        self.lines([like, "not as I learned it.", "Is it the same one?"])?;
        self.button("no", "yes")
    }

    fn unknown(&mut self, like: &[Row<'_>]) -> Done<D> {
        self.headline("Unknown", -1)?;
        let nearest = below(like.first().map_or("?", |row| row.name));
        self.lines(["None of those I know.", "The nearest one is", &nearest])?;
        self.button("next", "teach")
    }

    fn again(&mut self, why: Again, lift: bool) -> Done<D> {
        self.title("Again", "")?;
        self.headline(why.why(), 17)?;
        let (first, second) = match why {
            Again::TooHard | Again::TooLight => ("Keep the bar", "between the posts"),
            Again::TooShort => ("Slide on until", "the bar is full"),
            Again::TooUneven => ("Slide at one pace,", "as the bar fills"),
            Again::Disturbed => ("A sample was lost", ""),
        };
        if lift {
            return self.centre("Lift the finger", 46, &BOLD);
        }
        self.centre(first, 40, &SMALL)?;
        self.centre(second, 51, &SMALL)
    }

    fn verdict(&mut self, rows: &[Row<'_>], sure: bool, open: bool) -> Done<D> {
        if sure {
            self.headline(rows.first().map_or("?", |row| row.name), -1)?;
        } else {
            self.headline(&perhaps(rows), -1)?;
        }
        self.rows(rows, 20)?;
        if open {
            self.left("Slide on to be sure", 0, 42)?;
        }
        self.button("next", "teach")
    }

    fn compared(&mut self, name: &str, same: Option<bool>, open: bool, trials: u8) -> Done<D> {
        // fewer than `ENOUGH_TRIALS` are shown
        let next = match trials {
            1 => "learned from 1 slide",
            2 => "learned from 2 slides",
            _ => "Touch the next one.",
        };
        let may = "It may or may not be";
        let (is, how, hint) = match (same, open) {
            (Some(true), _) => ("Same", "It feels like", next),
            (Some(false), _) => ("Different", "It does not feel like", next),
            (None, true) => ("Not sure yet", may, "Slide again."),
            (None, false) => ("Not sure", may, "The slides cannot say"),
        };
        self.headline(is, -1)?;
        self.lines([how, &below(name), hint])?;
        self.button("end", "other")
    }

    fn learned(&mut self, name: &str) -> Done<D> {
        self.title("Learned", "")?;
        self.headline(name, 16)?;
        // a tick
        for step in 0..=7 {
            self.fill(54 + step, 48 + step, 1, 3, false)?;
        }
        for step in 0..=14 {
            self.fill(61 + step, 55 - step, 1, 3, false)?;
        }
        Ok(())
    }

    fn ready(&mut self, textures: u16) -> Done<D> {
        let ending = if textures == 1 { "" } else { "s" };
        self.title("Tactus", &say(format_args!("{textures} texture{ending}")))?;
        // a finger on a surface
        self.fill(8, 16, 21, 17, false)?;
        self.disc(18, 32, 10, false)?;
        self.fill(10, 16, 17, 17, true)?;
        self.disc(18, 32, 8, true)?;
        self.fill(0, 44, 40, 1, false)?;
        for (x, step) in (0..40)
            .step_by(8)
            .flat_map(|x| (0..4).map(move |step| (x, step)))
        {
            self.fill(x + step, 49 - step, 1, 1, false)?;
        }
        self.write("Press", (44, 13), &LARGE, Anchor::Left, false)?;
        self.write("and hold", (44, 31), &LARGE, Anchor::Left, false)?;
        self.button("menu", "teach")
    }

    /// The desired and the actual way of the slide, if a sensor sees it: 5 cm while the bar fills.
    fn pace(&mut self, progress: Option<f32>, way: Way, force_mn: f32) -> Done<D> {
        let Some(progress) = progress else {
            self.centre("Slide", 12, &LARGE)?;
            return self.centre("5 cm in 2 s", 31, &SMALL);
        };
        let place = |part: f32| 10 + (107.0 * part.clamp(0.0, 1.0)) as i32;
        let end = place(progress);
        self.fill(0, 26, WIDTH, 3, false)?;
        // centimetres
        for x in (4..=124).step_by(24) {
            self.fill(x, 29, 1, 5, false)?;
        }
        // the finger's place
        self.triangle(end, 14, 11, false)?;
        let mut ahead = 0.0;
        if let Way::Seen(way) = way {
            self.fill(0, 29, place(way), 4, false)?;
            ahead = way - progress;
        }
        let order = match force_mn {
            mn if mn < *ZONE_MN.start() => "press harder",
            mn if mn > *ZONE_MN.end() => "press lighter",
            _ if way == Way::Unseen => "speed not seen",
            _ if ahead > AHEAD => "slower",
            _ if ahead < -AHEAD => "faster",
            _ => "keep going",
        };
        self.centre(order, 34, &SMALL)
    }

    fn choose(&mut self, title: &str, at: u16, count: u16, entries: &[Entry<'_>]) -> Done<D> {
        let place = say(format_args!("{} of {count}", at.saturating_add(1)));
        self.title(title, &place)?;
        let first = first_line(at, count);
        for ((entry, number), y) in entries.iter().zip(first..).zip((13..).step_by(10)) {
            let chosen = number == at;
            if chosen {
                self.fill(0, y - 1, WIDTH, 10, false)?;
            }
            let text = match entry {
                Entry::Text(text) => cut(text, 21),
                Entry::Numbered(name) => say(format_args!("new: {name}")),
            };
            self.write(&text, (1, y - 1), &SMALL, Anchor::Left, chosen)?;
        }
        self.button("next", "take")
    }

    fn spell(&mut self, text: &str, wheel: &[Place; WHEEL]) -> Done<D> {
        self.title("Spell it", "")?;
        self.write(text, (1, 15), &BOLD, Anchor::Left, false)?;
        let cursor = 1 + 7 * text.chars().count() as i32;
        self.fill(cursor, 29, 6.min(WIDTH - cursor), 2, false)?;
        for (place, n) in wheel.iter().zip(0..) {
            let chosen = n == WHEEL as i32 / 2;
            let x = MIDDLE + (n - WHEEL as i32 / 2) * 19;
            if chosen {
                self.fill(x - 10, 33, 20, 20, false)?;
            }
            let mut letter: String<4> = String::new();
            let (text, font, y) = match place {
                Place::Done => ("OK", &BOLD, 36),
                Place::Rub => ("<-", &BOLD, 36),
                Place::Letter(' ') => ("_", &LARGE, 32),
                Place::Letter(c) => {
                    // a letter fits
                    let _ = letter.push(*c);
                    (letter.as_str(), &LARGE, 33)
                }
            };
            self.write(text, (x, y), font, Anchor::Middle, chosen)?;
        }
        self.button("next", "take")
    }

    fn fault(&mut self, trouble: &Trouble) -> Done<D> {
        let (what, first, second) = match trouble {
            Trouble::Silent => ("No sensor", "Check its cable", "and its power"),
            Trouble::Frozen => ("Sensor hangs", "Switch it off", "and on again"),
            Trouble::Memory(why) => {
                return self.sentence("Fault", why);
            }
        };
        self.title("Fault", "")?;
        self.triangle(12, 16, 13, true)?;
        self.fill(11, 19, 3, 5, true)?;
        self.fill(11, 26, 3, 2, true)?;
        self.write(what, (28, 19), &BOLD, Anchor::Left, false)?;
        self.centre(first, 41, &SMALL)?;
        self.centre(second, 52, &SMALL)
    }

    fn about_probe(&mut self, about: &About) -> Done<D> {
        self.title("About", &say(format_args!("Tactus {}", about.version)))?;
        let share = |p: Option<f32>| match p {
            // whole numbers: code to write others takes 9 kB
            Some(p) => {
                let tenths = libm::roundf(1000.0 * p) as u32;
                say(format_args!("{}.{} %", tenths / 10, tenths % 10))
            }
            None => say(format_args!("-")),
        };
        let left = 100 - libm::roundf(100.0 * about.memory.clamp(0.0, 1.0)) as u32;
        self.row("Memory left", &say(format_args!("{left} %")), 12)?;
        let (year, month, day) = date(about.calibrated);
        let calibrated = match about.calibrated {
            0 => say(format_args!("never")),
            1 => say(format_args!("day unknown")),
            _ => say(format_args!("{year}-{month:02}-{day:02}")),
        };
        self.row("Force set", &calibrated, 22)?;
        let both = say(format_args!(
            "{}/{}",
            share(about.awake),
            share(about.awake_at_rest)
        ));
        self.row("Awake", &both, 32)?;
        let slots = say(format_args!("late {}, lost {}", about.late, about.lost));
        self.row("Slots", &cut(&slots, 15), 42)?;
        self.button("go on", "")
    }

    fn row(&mut self, name: &str, value: &str, y: i32) -> Done<D> {
        self.left(name, 1, y)?;
        self.right(value, y)
    }

    fn lines(&mut self, lines: [&str; 3]) -> Done<D> {
        for (line, y) in lines.iter().zip((19..).step_by(11)) {
            self.left(line, 1, y)?;
        }
        Ok(())
    }

    /// A sentence, and the button moves on.
    fn sentence(&mut self, title: &str, text: &str) -> Done<D> {
        self.title(title, "")?;
        self.paragraph(text)?;
        self.button("go on", "")
    }

    /// A sentence over four lines, broken at blanks.
    fn paragraph(&mut self, text: &str) -> Done<D> {
        const LETTERS: usize = 21;
        let mut line: String<LETTERS> = String::new();
        let mut at = (14..).step_by(10).take(4);
        for word in text.split(' ') {
            let blank = usize::from(!line.is_empty());
            if line.len() + blank + word.len() > LETTERS && !line.is_empty() {
                let Some(y) = at.next() else {
                    return Ok(());
                };
                self.left(&line, 1, y)?;
                line.clear();
            }
            if !line.is_empty() {
                // the line has space: its length was checked
                let _ = line.push(' ');
            }
            let word = cut(word, LETTERS);
            word.chars().all(|c| line.push(c).is_ok());
        }
        match at.next() {
            Some(y) => self.left(&line, 1, y),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests;
