//! What the keys of the monitor do.

use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use tactus_core::table::Name;
use tactus_link::say::name_of;

use super::state::{Monitor, Weight};
use crate::cmd::names;

/// The keys and what they do, as the help has them; and in a word, for the last line.
pub(crate) const KEYS: [(&str, &str, &str); 6] = [
    ("i", "identify", "find out what lies under the finger"),
    (
        "h",
        "home",
        "find the switches; ends a fault that is mended",
    ),
    ("s", "stop", "stop and lift the finger (also Esc)"),
    (
        "t",
        "teach",
        "name what it explored last: the probe learns it",
    ),
    ("q", "quit", "end; the rig is stopped and lifted"),
    ("?", "help", "these keys; any key closes them"),
];

/// What a key has asked for.
#[derive(Clone, PartialEq, Debug)]
pub(crate) enum Act {
    Quit,
    Interrupt,
    Stop,
    Identify,
    Home,
    Teach(Name),
}

/// Takes in a key; `busy`: something that was asked for is not over.
pub(crate) fn press(monitor: &mut Monitor, key: KeyEvent, busy: bool) -> Option<Act> {
    if key.code == KeyCode::Char('c') && key.modifiers.contains(KeyModifiers::CONTROL) {
        return Some(Act::Interrupt);
    }
    if std::mem::take(&mut monitor.help) {
        return None;
    }
    if let Some(typed) = monitor.typed.take() {
        return type_name(monitor, typed, key.code);
    }
    match key.code {
        KeyCode::Char('q') => Some(Act::Quit),
        KeyCode::Char('s') | KeyCode::Esc => Some(Act::Stop),
        KeyCode::Char('?') => {
            monitor.help = true;
            None
        }
        KeyCode::Char('i' | 'h' | 't') if busy => {
            monitor.note(Weight::Message, "it is busy: wait, or stop it with s");
            None
        }
        KeyCode::Char('i') => Some(Act::Identify),
        KeyCode::Char('h') => Some(Act::Home),
        KeyCode::Char('t') => {
            monitor.typed = Some(String::new());
            None
        }
        _ => None,
    }
}

/// A key while a name is typed.
fn type_name(monitor: &mut Monitor, mut typed: String, key: KeyCode) -> Option<Act> {
    let known: Vec<&str> = monitor.names.iter().map(String::as_str).collect();
    match key {
        KeyCode::Esc => return None,
        KeyCode::Enter if typed.trim().is_empty() => return None,
        KeyCode::Enter => {
            let name = names::find(&typed, &known).unwrap_or(&typed);
            match name_of(name) {
                Ok(name) => return Some(Act::Teach(name)),
                Err(why) => monitor.note(Weight::Message, why.to_string()),
            }
        }
        KeyCode::Tab => {
            let begins = |name: &&&str| name.to_lowercase().starts_with(&typed.to_lowercase());
            if let Some(name) = known.iter().find(begins) {
                typed = (*name).to_owned();
            }
        }
        KeyCode::Backspace => drop(typed.pop()),
        KeyCode::Char(c) => typed.push(c),
        _ => {}
    }
    monitor.typed = Some(typed);
    None
}
