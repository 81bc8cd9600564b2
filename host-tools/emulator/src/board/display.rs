//! The handheld's display: an SSD1306 of 128 x 64 points on I2C1, from the bytes on the wire (Solomon Systech, SSD1306
//! rev 1.1, chapters 8 to 10).

use embedded_graphics::Drawable as _;
use embedded_graphics::geometry::Point;
use embedded_graphics::mono_font::ascii::{FONT_6X10, FONT_7X13_BOLD, FONT_10X20};
use embedded_graphics::mono_font::{MonoFont, MonoTextStyle};
use embedded_graphics::pixelcolor::BinaryColor;
use embedded_graphics::text::{Baseline, Text};
use tactus_core::handheld::picture::{HEIGHT, Picture, WIDTH};

/// SA0 to ground.
const ADDRESS: u8 = 0x3C;
const FONTS: [&MonoFont<'_>; 3] = [&FONT_6X10, &FONT_7X13_BOLD, &FONT_10X20];

/// The meaning of a transfer's next byte.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Next {
    Control,
    /// The rest of the transfer, or one byte and then another control byte.
    Command {
        rest: bool,
    },
    Data {
        rest: bool,
    },
}

/// The display.
#[derive(Clone, Debug)]
pub struct Display {
    wired: bool,
    plugged: bool,
    /// clocks that it wants until it lets go of the data line, which it holds down
    holds: u32,
    next: Next,
    /// a command with its parameters so far
    command: Vec<u8>,
    ram: [u8; WIDTH * HEIGHT / 8],
    on: bool,
    /// all points are lit, whatever is in the memory
    lit: bool,
    pump: bool,
    inverted: bool,
    /// turned by half a turn in each direction
    remapped: (bool, bool),
    mode: u8,
    columns: (u8, u8),
    pages: (u8, u8),
    at: (u8, u8),
    unknown: Vec<u8>,
    bytes: u64,
    /// the last whole picture that differed from the one before it, and the time of its last byte, ns
    whole: [u8; WIDTH * HEIGHT / 8],
    whole_ns: Option<u64>,
}

impl Default for Display {
    fn default() -> Self {
        Self {
            wired: false,
            plugged: true,
            holds: 0,
            next: Next::Control,
            command: Vec::new(),
            ram: [0; WIDTH * HEIGHT / 8],
            on: false,
            lit: false,
            pump: false,
            inverted: false,
            remapped: (false, false),
            mode: 2,
            columns: (0, 127),
            pages: (0, 7),
            at: (0, 0),
            unknown: Vec::new(),
            bytes: 0,
            whole: [0; WIDTH * HEIGHT / 8],
            whole_ns: None,
        }
    }
}

impl Display {
    /// The visible picture, as the module is held with its pins on top; `None` when it is off.
    pub fn picture(&self) -> Option<Picture> {
        if !(self.on && self.pump) {
            return None;
        }
        let mut seen = [0; WIDTH * HEIGHT / 8];
        for y in 0..HEIGHT {
            for x in 0..WIDTH {
                let column = if self.remapped.0 { x } else { WIDTH - 1 - x };
                let row = if self.remapped.1 { y } else { HEIGHT - 1 - y };
                let lit = self.lit || self.ram[row / 8 * WIDTH + column] >> (row % 8) & 1 == 1;
                seen[y / 8 * WIDTH + x] |= u8::from(lit != self.inverted) << (y % 8);
            }
        }
        Some(Picture::from_bytes(seen))
    }

    /// Returns true if a text is visible, in any of the fonts, dark on light as well.
    pub fn shows(&self, text: &str) -> bool {
        self.shows_in(text, &FONTS)
    }

    /// Returns true if a text is visible in one of the larger fonts, as headlines of up to 18 letters are.
    pub(crate) fn shows_large(&self, text: &str) -> bool {
        self.shows_in(text, &[&FONT_7X13_BOLD, &FONT_10X20])
    }

    fn shows_in(&self, text: &str, fonts: &[&MonoFont<'_>]) -> bool {
        self.picture().is_some_and(|picture| {
            let picture = rows(&picture);
            fonts.iter().any(|font| {
                let width = font.character_size.width as usize * text.chars().count();
                let height = font.character_size.height as usize;
                width <= WIDTH && is_in(&picture, &write(text, font), width, height)
            })
        })
    }

    /// Commands that it was sent and does not have.
    pub fn unknown(&self) -> &[u8] {
        &self.unknown
    }

    /// Bytes that came to it.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Time when its picture was wholly written, ns; `None` before the first picture. The same picture again is no new
    /// one.
    pub(crate) fn written_ns(&self) -> Option<u64> {
        self.whole_ns
    }

    /// It holds the data line down until it has got so many clocks, as in the middle of a byte.
    pub(super) fn hold(&mut self, clocks: u32) {
        self.holds = clocks;
    }

    /// Returns true while it holds the data line down: the bus is busy, and nothing begins on it.
    pub(super) fn holds(&self) -> bool {
        self.holds > 0
    }

    /// A clock by the port, which the bus has not got.
    pub(super) fn clock(&mut self) {
        self.holds = self.holds.saturating_sub(1);
    }

    /// Pulls its plug, or puts it in again: then it is as after its reset.
    pub fn plug(&mut self, plugged: bool) {
        *self = Self {
            wired: self.wired,
            plugged,
            ..Self::default()
        };
    }

    pub(crate) fn wire(&mut self, wired: bool) {
        self.wired = wired;
    }

    pub(super) fn start(&mut self, address: u8, read: bool) -> bool {
        self.next = Next::Control;
        self.command.clear();
        self.wired && self.plugged && address == ADDRESS && !read
    }

    /// A byte, which is over now.
    pub(super) fn byte(&mut self, now_ns: u64, byte: u8) {
        self.bytes += 1;
        match self.next {
            Next::Control => {
                let rest = byte & 0x80 == 0;
                self.next = if byte & 0x40 == 0 {
                    Next::Command { rest }
                } else {
                    Next::Data { rest }
                };
            }
            Next::Command { rest } => {
                self.command.push(byte);
                self.obey();
                if !rest {
                    self.next = Next::Control;
                }
            }
            Next::Data { rest } => {
                self.put(byte);
                self.look_at_whole(now_ns);
                if !rest {
                    self.next = Next::Control;
                }
            }
        }
    }

    /// Obeys the command once its parameters are there.
    fn obey(&mut self) {
        match self.command[..] {
            // with parameters that are yet to come
            [0x20 | 0x81 | 0xA8 | 0xD3 | 0xD5 | 0xD9 | 0xDA | 0xDB | 0x8D]
            | [0x21 | 0x22]
            | [0x21 | 0x22, _] => return,
            [0x20, mode] => self.mode = mode & 3,
            [0x21, from, to] => {
                self.columns = (from & 0x7F, to & 0x7F);
                self.at.0 = self.columns.0;
            }
            [0x22, from, to] => {
                self.pages = (from & 7, to & 7);
                self.at.1 = self.pages.0;
            }
            [0x8D, pump] => self.pump = pump & 4 != 0,
            [low @ 0x00..=0x0F] => self.at.0 = self.at.0 & 0x70 | low,
            [high @ 0x10..=0x17] => self.at.0 = self.at.0 & 0x0F | (high & 7) << 4,
            [page @ 0xB0..=0xB7] => self.at.1 = page & 7,
            [remap @ 0xA0..=0xA1] => self.remapped.0 = remap & 1 == 1,
            [0xC0] => self.remapped.1 = false,
            [0xC8] => self.remapped.1 = true,
            [inverted @ 0xA6..=0xA7] => self.inverted = inverted & 1 == 1,
            [lit @ 0xA4..=0xA5] => self.lit = lit & 1 == 1,
            [on @ 0xAE..=0xAF] => self.on = on & 1 == 1,
            // contrast, multiplex, offset, clock, precharge, COM pins, VCOMH, start line 0, RAM shown, no scrolling,
            // nothing
            [0x81 | 0xD5 | 0xD9 | 0xDB, _]
            | [0xA8, 63]
            | [0xD3, 0]
            | [0xDA, 0x12]
            | [0x40 | 0x2E | 0xE3] => {}
            [command, ..] => self.unknown.push(command),
            [] => {}
        }
        self.command.clear();
    }

    /// After a byte of the picture: if it was the last one of an area, the picture is whole.
    fn look_at_whole(&mut self, now_ns: u64) {
        let first = (self.columns.0, self.pages.0);
        if self.at == first && self.whole != self.ram {
            self.whole = self.ram;
            self.whole_ns = Some(now_ns);
        }
    }

    /// A byte of the picture: eight points of a column.
    fn put(&mut self, byte: u8) {
        let (column, page) = self.at;
        self.ram[usize::from(page) * WIDTH + usize::from(column)] = byte;
        let step = |at: u8, (from, to): (u8, u8), most: u8| {
            if at == to {
                (from, true)
            } else {
                ((at + 1) & most, false)
            }
        };
        match self.mode {
            // along the row, then the next page
            0 => {
                let (column, over) = step(column, self.columns, 127);
                self.at.0 = column;
                if over {
                    self.at.1 = step(page, self.pages, 7).0;
                }
            }
            // down, then the next column
            1 => {
                let (page, over) = step(page, self.pages, 7);
                self.at.1 = page;
                if over {
                    self.at.0 = step(column, self.columns, 127).0;
                }
            }
            _ => self.at.0 = (column + 1) & 127,
        }
    }
}

/// A text in the corner of a picture.
fn write(text: &str, font: &MonoFont<'_>) -> Picture {
    let mut picture = Picture::new();
    let style = MonoTextStyle::new(font, BinaryColor::On);
    let Ok(_) = Text::with_baseline(text, Point::zero(), style, Baseline::Top).draw(&mut picture);
    picture
}

/// The rows of a picture, a point a bit: words are looked for at every step of a run, and point by point that took a
/// tenth of it.
fn rows(picture: &Picture) -> [u128; HEIGHT] {
    let lit = |x: usize, y: usize| u128::from(picture.is_lit(x, y)) << x;
    std::array::from_fn(|y| (0..WIDTH).fold(0, |row, x| row | lit(x, y)))
}

/// Returns true if that corner of `part` is somewhere in `whole`, inverted or not.
fn is_in(whole: &[u128; HEIGHT], part: &Picture, width: usize, height: usize) -> bool {
    let part = &rows(part)[..height];
    let wide = u128::MAX.checked_shr((WIDTH - width) as u32).unwrap_or(0);
    // headlines begin a row above the glass, with a row of the font that is empty, and what ends at its right edge
    // leaves the gap to the next letter, a column, beyond it
    let is_at = |left: usize, rows_above: usize, top: usize, inverted: u128| {
        let on_glass = u128::MAX.checked_shr(left as u32).unwrap_or(0) & wide;
        part.iter().enumerate().all(|(y, row)| {
            let seen = (top + y).checked_sub(rows_above).map_or(0, |at| {
                (whole[at] ^ inverted).checked_shr(left as u32).unwrap_or(0) & on_glass
            });
            seen == *row
        })
    };
    (0..=WIDTH - width + 1)
        .any(|x| (0..=HEIGHT - height + 1).any(|y| is_at(x, 1, y, 0) || is_at(x, 1, y, u128::MAX)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn send_at(display: &mut Display, at_ns: u64, bytes: &[u8]) {
        assert!(display.start(ADDRESS, false));
        bytes.iter().for_each(|byte| display.byte(at_ns, *byte));
    }

    fn send(display: &mut Display, bytes: &[u8]) {
        send_at(display, 0, bytes);
    }

    #[test]
    fn bytes_on_the_wire_make_a_picture_that_can_be_read() {
        let mut display = Display::default();
        assert!(!display.start(ADDRESS, false), "not wired");
        display.wire(true);
        assert!(!display.start(0x3D, false) && !display.start(ADDRESS, true));
        assert!(display.picture().is_none());
        send(
            &mut display,
            &[0x00, 0x8D, 0x14, 0xA1, 0xC8, 0x20, 0x00, 0xAF],
        );
        send(&mut display, &[0x00, 0x21, 0, 127, 0x22, 0, 7]);
        let text = write("Tactus", &FONT_7X13_BOLD);
        send(&mut display, &[&[0x40], &text.bytes()[..500]].concat());
        send(&mut display, &[&[0x40], &text.bytes()[500..]].concat());
        assert!(display.picture() == Some(text));
        assert_eq!(display.written_ns(), Some(0));
        // the same picture again is not new, and half a picture is not whole
        let again = [&[0x40], &write("Tactus", &FONT_7X13_BOLD).bytes()[..]].concat();
        send_at(&mut display, 5, &again);
        send_at(&mut display, 6, &[0x40; 500]);
        assert_eq!(display.written_ns(), Some(0));
        send_at(&mut display, 7, &[&[0x40], &[0; 525][..]].concat());
        assert_eq!(display.written_ns(), Some(7));
        send_at(&mut display, 8, &again);
        assert_eq!(display.written_ns(), Some(8));
        assert!(display.shows("Tactus") && display.shows("act") && !display.shows("cat"));
        // at the edges
        let mut edges = Picture::new();
        let style = MonoTextStyle::new(&FONT_6X10, BinaryColor::On);
        let end = Point::new(WIDTH as i32 + 1 - 6 * 6, 20);
        let Ok(_) = Text::with_baseline("lost 0", end, style, Baseline::Top).draw(&mut edges);
        let other = Display {
            ram: *edges.bytes(),
            ..display.clone()
        };
        assert!(other.shows("lost 0") && !other.shows("lost 8") && !other.shows("lost 0 "));
        // turned round, it cannot be read; inverted, it can
        send(&mut display, &[0x80, 0xA0, 0x80, 0xA7]);
        assert!(!display.shows("Tactus"));
        send(&mut display, &[0x00, 0xA1]);
        assert!(display.shows("Tactus"));
        assert_eq!(display.unknown(), [0u8; 0]);
        send(&mut display, &[0x00, 0xFF]);
        assert_eq!(display.unknown(), [0xFF_u8]);
        display.plug(false);
        assert!(!display.start(ADDRESS, false) && !display.shows("Tactus"));
    }
}
