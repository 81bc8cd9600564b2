//! What the monitor showed of a session, as a moving picture: the reports of its log, drawn by the monitor's own [`view`] on a
//! terminal in memory.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::ops::Range;
use std::path::Path;

use anyhow::Context as _;
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::buffer::{Buffer, Cell};
use ratatui::style::{Color, Modifier};
use tactus_core::table::Table;
use tactus_core::wire::{Event, Report};
use tactus_lab::data::whole::write_whole;
use tactus_study::chart::escaped;

use super::state::Monitor;
use super::view;
use crate::cmd::device::log::{Line, TableParts, read};
use crate::cmd::progress::notice;

/// Between two frames, at least; and frames at most.
const EVERY_MS: u64 = 200;
const MAX_FRAMES: u64 = 300;
/// How long the picture takes at most, s: a longer session is shown faster. The last frame stays.
const LONGEST_S: f64 = 60.0;
const LAST_S: f64 = 3.0;

/// Of a cell, px. Letters are 14 px high: of 60 columns a phone shows them 10 px high.
const CELL: (f64, f64) = (8.4, 17.0);
const EM: f64 = 14.0;
const MARGIN: f64 = 8.0;

/// The terminal's own colours.
const PAPER: &str = "#14181d";
const INK: &str = "#e6e6e6";

/// What a log lacks that nobody has talked to.
const NO_STATUS: &str =
    "the probe does not say in this log how it is; `tactus device identify --log FILE` writes one";

/// The probe's time from its first report on, over its restarts.
#[derive(Default)]
struct Clock {
    last_ms: Option<u32>,
    ms: u64,
}

impl Clock {
    fn at(&mut self, report: &Report) -> u64 {
        let before = self.last_ms.replace(report.at_ms).unwrap_or(report.at_ms);
        self.ms += u64::from(report.at_ms.saturating_sub(before));
        self.ms
    }
}

/// Draws what the monitor shows of a log.
pub(crate) fn film(path: &Path, out: &Path, size: (u16, u16)) -> anyhow::Result<()> {
    let (mut place, mut first, mut clock) = (String::new(), None, Clock::default());
    read(path, |line| match line {
        Line::Session { port, .. } => place = port.into_owned(),
        Line::Command(_) => {}
        Line::Report(report) => {
            clock.at(&report);
            if let Event::Status(status) = &report.event {
                first.get_or_insert_with(|| status.clone());
            }
        }
    })?;
    let mut monitor = Monitor::new(&place, first.context(NO_STATUS)?, Vec::new());
    let mut film = Film::new(size, clock.ms);
    let (mut clock, mut parts) = (Clock::default(), TableParts::default());
    read(path, |line| match line {
        Line::Session { .. } => {}
        Line::Command(command) => monitor.asked(&command),
        Line::Report(report) => {
            if let Event::TablePart {
                offset,
                length,
                bytes,
            } = &report.event
                && let Some(whole) = parts.take(*offset, *length, bytes)
                && let Ok(table) = Table::read(&whole)
            {
                monitor.take_table(table);
            }
            monitor.hear(&report);
            film.see(clock.at(&report), &monitor);
        }
    })?;
    film.end(clock.ms, &monitor);
    let said: Vec<&str> = monitor
        .notes
        .iter()
        .map(|note| note.text.as_str())
        .collect();
    let about = format!(
        "{:.0} s of a probe at {place}: {}",
        clock.ms as f64 * 1e-3,
        said.join("; ")
    );
    write_whole(out, film.svg(&about)).with_context(|| format!("--out {}", out.display()))?;
    notice(&format!("wrote {}", out.display()));
    Ok(())
}

/// Letters of one look that stand side by side.
#[derive(Clone, PartialEq)]
struct Run {
    column: usize,
    text: String,
    columns: usize,
    fg: Color,
    bg: Color,
    modifier: Modifier,
}

/// A line of the screen; blank runs are left out.
type Row = Vec<Run>;

/// The film of a session, frame by frame.
pub(super) struct Film {
    terminal: Terminal<TestBackend>,
    size: (u16, u16),
    every_ms: u64,
    /// when each frame begins, and its lines
    frames: Vec<(u64, Vec<Row>)>,
    end_ms: u64,
}

impl Film {
    /// One on a terminal of this size, of a session that took so long.
    pub(super) fn new(size: (u16, u16), session_ms: u64) -> Self {
        let Ok(terminal) = Terminal::new(TestBackend::new(size.0, size.1));
        Self {
            terminal,
            size,
            every_ms: EVERY_MS.max(session_ms / MAX_FRAMES),
            frames: Vec::new(),
            end_ms: 0,
        }
    }

    /// The monitor is so since `at_ms`, by the session's own time.
    pub(super) fn see(&mut self, at_ms: u64, monitor: &Monitor) {
        let due = self.frames.last().map_or(0, |(at, _)| at + self.every_ms);
        if at_ms >= due {
            self.take(at_ms, monitor);
        }
    }

    /// The same, and the session is over.
    pub(super) fn end(&mut self, at_ms: u64, monitor: &Monitor) {
        self.take(at_ms, monitor);
        self.end_ms = at_ms;
    }

    fn take(&mut self, at_ms: u64, monitor: &Monitor) {
        let Ok(frame) = self.terminal.draw(|frame| view::draw(monitor, frame));
        let rows = rows(frame.buffer);
        if self.frames.last().is_none_or(|(_, last)| *last != rows) {
            self.frames.push((at_ms, rows));
        }
    }

    /// The picture; `about` says what it shows to those who cannot see it.
    pub(super) fn svg(&self, about: &str) -> String {
        let first = self.frames.first().map_or(0, |(at, _)| *at);
        let session_s = (self.end_ms - first) as f64 * 1e-3;
        let pace = (LONGEST_S / session_s.max(1e-3)).min(1.0);
        let total_s = session_s * pace + LAST_S;
        let percent = |frame: usize| {
            let at = self.frames.get(frame).map_or(self.end_ms, |(at, _)| *at);
            100.0 * (at - first) as f64 * 1e-3 * pace / total_s
        };
        let (columns, lines) = (usize::from(self.size.0), usize::from(self.size.1));
        let (mut body, mut shown) = (String::new(), BTreeSet::new());
        for line in 0..lines {
            for frames in self.same(line) {
                let Some(row) = self.frames[frames.start].1.get(line) else {
                    continue;
                };
                if row.is_empty() {
                    continue;
                }
                if frames.len() == self.frames.len() {
                    body += "<g>";
                } else {
                    let _ = write!(body, "<g class=\"k{}_{}\">", frames.start, frames.end);
                    shown.insert((frames.start, frames.end));
                }
                row.iter().for_each(|run| draw(run, line, &mut body));
                body += "</g>\n";
            }
        }
        let mut css = String::new();
        for (start, end) in shown {
            let name = format!("k{start}_{end}");
            let _ = write!(css, ".{name}{{animation-name:{name}}}@keyframes {name}{{");
            if start > 0 {
                css += "0%{visibility:hidden}";
            }
            let _ = write!(css, "{:.3}%{{visibility:visible}}", percent(start));
            if end < self.frames.len() {
                let _ = write!(css, "{:.3}%{{visibility:hidden}}", percent(end));
            }
            css += "}\n";
        }
        let width = CELL.0 * columns as f64 + 2.0 * MARGIN;
        let height = CELL.1 * lines as f64 + 2.0 * MARGIN;
        // who wants no motion sees the last frame
        let last = total_s - LAST_S / 2.0;
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" width=\"{width:.0}\" height=\"{height:.0}\" style=\"max-width:100%;height:auto\" role=\"img\">\n\
             <title>The monitor during a session</title>\n<desc>{}</desc>\n<style>\n\
             text{{font:{EM}px ui-monospace,Menlo,Consolas,\"DejaVu Sans Mono\",monospace;fill:{INK};white-space:pre;dominant-baseline:central}}.b{{font-weight:bold}}\n\
             [class^=k]{{animation:0s step-end infinite;animation-duration:{total_s:.2}s}}\n\
             {css}@media(prefers-reduced-motion:reduce){{*{{animation-play-state:paused!important;animation-delay:-{last:.2}s!important}}}}\n</style>\n\
             <rect width=\"{width:.0}\" height=\"{height:.0}\" rx=\"6\" fill=\"{PAPER}\"/>\n<g transform=\"translate({MARGIN} {MARGIN})\">\n{body}</g>\n</svg>\n",
            escaped(about)
        )
    }

    /// The frames in which a line stays the same, one range after the other.
    fn same(&self, line: usize) -> Vec<Range<usize>> {
        let mut ranges: Vec<Range<usize>> = Vec::new();
        for (number, (_, rows)) in self.frames.iter().enumerate() {
            match ranges.last_mut() {
                Some(last) if self.frames[last.start].1.get(line) == rows.get(line) => {
                    last.end = number + 1;
                }
                _ => ranges.push(number..number + 1),
            }
        }
        ranges
    }
}

fn rows(buffer: &Buffer) -> Vec<Row> {
    let width = usize::from(buffer.area.width).max(1);
    buffer.content.chunks(width).map(row).collect()
}

fn row(cells: &[Cell]) -> Row {
    let mut row = Row::new();
    for (column, cell) in cells.iter().enumerate() {
        match row.last_mut() {
            Some(run) if (run.fg, run.bg, run.modifier) == (cell.fg, cell.bg, cell.modifier) => {
                run.text += cell.symbol();
                run.columns += 1;
            }
            _ => row.push(Run {
                column,
                text: cell.symbol().to_owned(),
                columns: 1,
                fg: cell.fg,
                bg: cell.bg,
                modifier: cell.modifier,
            }),
        }
    }
    row.retain(|run| !run.text.trim().is_empty() || has_paper(run));
    row
}

/// Whether it lies on another colour than the screen.
fn has_paper(run: &Run) -> bool {
    run.bg != Color::Reset || run.modifier.contains(Modifier::REVERSED)
}

fn draw(run: &Run, line: usize, body: &mut String) {
    let x = |column: usize| CELL.0 * column as f64;
    let y = CELL.1 * line as f64;
    let (mut ink, mut paper) = (colour(run.fg, INK), colour(run.bg, PAPER));
    if run.modifier.contains(Modifier::REVERSED) {
        std::mem::swap(&mut ink, &mut paper);
    }
    if has_paper(run) {
        let (x, width, height) = (x(run.column), x(run.columns), CELL.1);
        let _ = write!(
            body,
            "<rect x=\"{x:.1}\" y=\"{y}\" width=\"{width:.1}\" height=\"{height}\" fill=\"{paper}\"/>"
        );
    }
    let text = run.text.trim_start();
    let before = run.text.chars().count() - text.chars().count();
    let text = text.trim_end();
    let long = text.chars().count();
    if long == 0 {
        return;
    }
    let fill = match ink {
        INK => String::new(),
        other => format!(" style=\"fill:{other}\""),
    };
    let bold = if run.modifier.contains(Modifier::BOLD) {
        " class=\"b\""
    } else {
        ""
    };
    let _ = write!(
        body,
        "<text x=\"{:.1}\" y=\"{}\" textLength=\"{:.1}\" lengthAdjust=\"spacingAndGlyphs\"{bold}{fill}>{}</text>",
        x(run.column + before),
        y + CELL.1 / 2.0,
        x(long),
        escaped(text)
    );
}

/// A colour of the 256 that terminals have, of those that the monitor takes.
fn colour(colour: Color, reset: &'static str) -> &'static str {
    match colour {
        view::BLUE => "#00afff",
        view::ORANGE => "#ffaf00",
        view::VERMILLION => "#ff5f00",
        view::DIM => "#8a8a8a",
        Color::Black => "#000000",
        _ => reset,
    }
}
