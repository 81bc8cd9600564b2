//! What the monitor looks like. Colours are the ones that colour-blind people tell apart (blue, orange, vermillion),
//! and say nothing that is not also said in words.

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Style, Stylize as _};
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Axis, Block, BorderType, Chart, Dataset, GraphType, Paragraph};
use tactus_core::features::Movement;
use tactus_core::table::is_printable;
use tactus_core::wire::Phase;
use tactus_lab::eval::show::count;
use tactus_link::say::phase_name;

use super::KEYS;
use super::state::{Monitor, SHOWN, Weight};

// of the 256 colours that every terminal has, the nearest to Okabe's and Ito's
pub(super) const BLUE: Color = Color::Indexed(39);
pub(super) const ORANGE: Color = Color::Indexed(214);
pub(super) const VERMILLION: Color = Color::Indexed(202);
pub(super) const DIM: Color = Color::Indexed(245);

/// The force guard trips here, N.
const MOST_N: f32 = 2.1;
/// Textures less probable than this are not listed.
const WORTH_LISTING: f32 = 0.001;
/// The lever's step, mm (the reference rig's).
const STEP_MM: f32 = 0.000_625;

const LEAST: (u16, u16) = (76, 21);

pub(crate) fn draw(monitor: &Monitor, frame: &mut Frame<'_>) {
    let area = frame.area();
    let (width, height) = LEAST;
    if area.width < width || area.height < height {
        let text = format!(
            "Too small: {} x {}.\nThe monitor needs {width} x {height}.\nq: quit",
            area.width, area.height
        );
        frame.render_widget(Paragraph::new(text), area);
        return;
    }
    let [header, trace, panels, notes, keys] = Layout::vertical([
        Constraint::Length(1),
        Constraint::Min(6),
        Constraint::Length(9),
        Constraint::Length(4),
        Constraint::Length(1),
    ])
    .areas(area);
    let [rig, textures] =
        Layout::horizontal([Constraint::Length(24), Constraint::Fill(1)]).areas(panels);
    draw_header(monitor, frame, header);
    draw_trace(monitor, frame, trace);
    draw_rig(monitor, frame, rig);
    draw_textures(monitor, frame, textures);
    draw_notes(monitor, frame, notes);
    let spans = KEYS.map(|(key, what)| {
        let key = Span::from(format!(" {key} ")).bold().reversed();
        [key, Span::from(format!(" {what}   "))]
    });
    frame.render_widget(Line::from(spans.concat()), keys);
    // names and words of the probe are in it
    for cell in &mut frame.buffer_mut().content {
        if !cell.symbol().chars().all(is_printable) {
            cell.set_symbol("?");
        }
    }
}

fn panel(title: impl Into<Line<'static>>) -> Block<'static> {
    Block::bordered()
        .border_type(BorderType::Rounded)
        .border_style(Style::new().fg(DIM))
        .title(title)
}

fn dim(text: impl Into<String>) -> Span<'static> {
    Span::from(text.into()).fg(DIM)
}

fn draw_header(monitor: &Monitor, frame: &mut Frame<'_>, area: Rect) {
    let status = &monitor.status;
    let whose = if status.factory { " (factory)" } else { "" };
    let left = Line::from(vec![
        Span::from(" Tactus ").bold().reversed(),
        Span::from(format!(" {}  ", monitor.place)),
        dim(format!("{}{whose}", count(status.textures, "texture"))),
    ]);
    let (damaged, missing) = monitor.losses;
    let late = status.counts.late_slots;
    let lost = status.counts.lost_samples;
    let right = match (monitor.silent, status.fault) {
        (Some(silent), _) => warning(format!(" SILENT for {} s ", silent.as_secs())),
        (None, Some(fault)) => warning(format!(" FAULT: {fault} ")),
        (None, None) if damaged + missing > 0 || late + lost > 0 => Span::styled(
            format!("line {damaged} damaged {missing} lost, slots {late} late {lost} lost "),
            Style::new().fg(ORANGE),
        ),
        (None, None) => dim(format!("nothing lost, up {} ", clock(monitor.at_ms))),
    };
    // what is wrong goes before what is always the same
    let width = Constraint::Length(right.width() as u16 + 1);
    let [at_left, at_right] = Layout::horizontal([Constraint::Fill(1), width]).areas(area);
    frame.render_widget(left, at_left);
    frame.render_widget(Line::from(right).right_aligned(), at_right);
}

fn warning(text: String) -> Span<'static> {
    Span::from(text).fg(Color::Black).bg(VERMILLION).bold()
}

fn clock(at_ms: u32) -> String {
    let s = at_ms / 1000;
    format!("{}:{:02}:{:02}", s / 3600, s / 60 % 60, s % 60)
}

fn draw_trace(monitor: &Monitor, frame: &mut Frame<'_>, area: Rect) {
    let pac: Vec<i16> = monitor.pac.iter().copied().collect();
    let largest = pac.iter().map(|s| s.unsigned_abs()).max().unwrap_or(0);
    // a scale that does not jump with every sample
    let top = f64::from(largest.next_power_of_two().max(32));
    // the extremes of a column, so that no peak is lost
    let columns = usize::from(area.width.max(8)) * 2;
    let chunk = SHOWN.div_ceil(columns);
    let points: Vec<(f64, f64)> = pac
        .chunks(chunk)
        .zip(0..)
        .flat_map(|(part, n)| {
            let x = f64::from(n) * chunk as f64;
            let low = part.iter().min().copied().unwrap_or(0);
            let high = part.iter().max().copied().unwrap_or(0);
            [(x, f64::from(low)), (x, f64::from(high))]
        })
        .collect();
    let line = Dataset::default()
        .marker(Marker::Braille)
        .graph_type(GraphType::Line);
    let (title, color) = match (monitor.is_sampling(), pac.is_empty()) {
        (true, _) | (_, true) => (" P_AC, counts, 1 s ", BLUE),
        (false, false) => (" P_AC of the last slide ", DIM),
    };
    let line = line.fg(color).data(&points);
    let chart = Chart::new(vec![line])
        .block(panel(title))
        .x_axis(Axis::default().bounds([0.0, SHOWN as f64]).fg(DIM))
        .y_axis(
            Axis::default()
                .bounds([-top, top])
                .fg(DIM)
                .labels([-top, 0.0, top].map(|label| dim(format!("{label:>5}")))),
        );
    frame.render_widget(chart, area);
}

/// "force   0.998 N"
fn row(name: &str, value: String) -> Line<'static> {
    Line::from(vec![dim(format!("{name:<7} ")), Span::from(value)])
}

fn draw_rig(monitor: &Monitor, frame: &mut Frame<'_>, area: Rect) {
    let block = panel(" Rig ");
    let inner = block.inner(area);
    let phase = match monitor.status.phase {
        Phase::Parked => "parked",
        phase => phase_name(phase),
    };
    let phase = match phase {
        "ready" | "parked" => Span::from(phase),
        moving => Span::from(moving).fg(ORANGE),
    };
    let mut lines = vec![Line::from(vec![dim("phase   "), phase.bold()])];
    match &monitor.live {
        Some(live) => {
            let force_n = f32::from(live.force_mn) * 1e-3;
            let wanted_n = monitor.movement.map(Movement::force_n);
            let mm = live.stage_um as f32 * 1e-3;
            let mm_s = live.speed_um_s as f32 * 1e-3;
            let lever_mm = live.steps as f32 * STEP_MM;
            lines.extend([
                row("force", format!("{force_n:5.3} N")),
                gauge(force_n, wanted_n, inner.width),
                row("speed", format!("{mm_s:5.1} mm/s")),
                row("stage", format!("{mm:5.1} mm")),
                row("lever", format!("{lever_mm:5.2} mm")),
                row("motor", format!("{:5} mA", live.current_ma)),
            ]);
        }
        None => {
            let (joule, wear) = monitor.status.skin_mj;
            lines.extend([
                row("force", "at rest".into()),
                Line::default(),
                row("skin", format!("{:.1} J", f64::from(joule) * 1e-3)),
                row("wear", format!("{:.1} J", f64::from(wear) * 1e-3)),
            ]);
        }
    }
    frame.render_widget(Paragraph::new(lines).block(block), area);
}

/// The force as a bar up to where the guard trips, with a mark at what the movement wants.
fn gauge(force_n: f32, wanted_n: Option<f32>, width: u16) -> Line<'static> {
    let width = usize::from(width.saturating_sub(6));
    let place = |n: f32| ((n / MOST_N).clamp(0.0, 1.0) * width as f32).round() as usize;
    let full = place(force_n);
    let mark = wanted_n.map(|n| place(n).min(width.saturating_sub(1)));
    let bar = |range: std::ops::Range<usize>| -> String {
        range
            .map(|n| match n {
                n if Some(n) == mark => '┃',
                n if n < full => '█',
                _ => '░',
            })
            .collect()
    };
    Line::from(vec![
        Span::styled(bar(0..full), Style::new().fg(BLUE)),
        Span::styled(bar(full..width), Style::new().fg(DIM)),
        dim(format!(" {MOST_N} N")),
    ])
}

fn draw_textures(monitor: &Monitor, frame: &mut Frame<'_>, area: Rect) {
    let block = panel(" What it may be ");
    let inner = block.inner(area);
    let mut lines = Vec::new();
    if let Some(answer) = &monitor.answer {
        lines.push(Line::from(answer.clone()).bold());
    }
    let buffer = usize::from(inner.height).saturating_sub(lines.len());
    let width = usize::from(inner.width);
    // a name may be cut, a bar too short says nothing
    let name_width = width.saturating_sub(18).clamp(8, 24);
    let bar_width = width.saturating_sub(name_width + 10);
    let ranked = monitor.ranked();
    if ranked.is_empty() {
        let hint = if monitor.movement.is_some() {
            "the rig makes the first slide ..."
        } else {
            "i: find out what lies under the finger"
        };
        lines.push(Line::from(dim(hint)));
    }
    // the rest takes a line
    let most = buffer.saturating_sub(usize::from(ranked.len() > buffer));
    let worth = ranked.iter().filter(|(p, _)| *p >= WORTH_LISTING).count();
    let listed = worth.max(1).min(most).min(ranked.len());
    let (listed, others) = ranked.split_at(listed);
    for ((probability, texture), place) in listed.iter().zip(0..) {
        let full = ((probability * bar_width as f32).round() as usize).min(bar_width);
        let name: String = monitor.name(*texture).chars().take(name_width).collect();
        let color = if place == 0 { BLUE } else { DIM };
        lines.push(Line::from(vec![
            Span::from(format!("{name:<name_width$} ")),
            Span::styled("█".repeat(full), Style::new().fg(color)),
            dim("░".repeat(bar_width - full)),
            Span::from(format!(" {:5.1} %", probability * 100.0)),
        ]));
    }
    if !others.is_empty() {
        let rest: f32 = others.iter().map(|(p, _)| p).sum();
        let (text, percent) = (format!("{} others", others.len()), rest * 100.0);
        let space = name_width + 1 + bar_width;
        lines.push(Line::from(dim(format!("{text:<space$} {percent:5.1} %"))));
    }
    frame.render_widget(Paragraph::new(lines).block(block), area);
}

fn draw_notes(monitor: &Monitor, frame: &mut Frame<'_>, area: Rect) {
    let block = panel(" Messages ");
    let buffer = usize::from(block.inner(area).height);
    let from = monitor.notes.len().saturating_sub(buffer);
    let lines: Vec<Line<'_>> = monitor
        .notes
        .iter()
        .skip(from)
        .map(|note| {
            let mut line = vec![dim(format!("{} ", clock(note.at_ms)))];
            if note.weight == Weight::Fault {
                line.push(warning(" ! ".into()));
                line.push(Span::from(" "));
            }
            line.push(Span::from(note.text.clone()));
            Line::from(line)
        })
        .collect();
    frame.render_widget(Paragraph::new(lines).block(block), area);
}
