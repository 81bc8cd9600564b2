//! The lists that one button goes through: the menu, the texture to compare with, the name of a texture.

use heapless::Vec;

use crate::handheld::judge::{Judgement, free_name};
use crate::handheld::screen;
use crate::table::{Name, Table};

/// The person's label for the texture.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Choice {
    /// The texture with this index.
    Known(u16),
    /// A new one, with the first free number as its name.
    Numbered,
    /// A new one, or a known one, of this name.
    Spelled(Name),
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum List {
    /// The menu.
    Menu,
    /// The texture that the next slides are compared with.
    Reference,
    /// The name of the touched texture.
    Name,
}

impl List {
    pub(super) const fn title(self) -> &'static str {
        match self {
            Self::Menu => "Menu",
            Self::Reference => "Same as",
            Self::Name => "What is it?",
        }
    }
}

pub(super) enum Entry {
    Compare,
    About,
    Known(u16),
    Numbered,
    Spell,
    Nothing,
}

/// A list, with the number of textures in the table and the last judgement.
#[derive(Clone, Copy)]
pub(super) struct Entries<'j> {
    pub(super) list: List,
    pub(super) judgement: Option<&'j Judgement>,
    pub(super) textures: u16,
}

impl<'j> Entries<'j> {
    /// Number of entries. Names: the leading textures, a new one with a number, a new one that is spelled, nothing, and
    /// all other textures.
    pub(super) fn count(self) -> u16 {
        match self.list {
            List::Menu => 3,
            List::Reference => self.textures.saturating_add(1),
            List::Name => self.textures.saturating_add(3),
        }
    }

    pub(super) fn leading(self) -> impl Iterator<Item = u16> + Clone + 'j {
        let leading = self.judgement.into_iter().flat_map(|j| j.leading.iter());
        leading.map(|(texture, _)| *texture)
    }

    pub(super) fn entry(self, at: u16) -> Entry {
        match (self.list, at) {
            (List::Menu, 0) => return Entry::Compare,
            (List::Menu, 1) => return Entry::About,
            (List::Reference, at) if at < self.textures => return Entry::Known(at),
            (List::Menu | List::Reference, _) => return Entry::Nothing,
            (List::Name, _) => {}
        }
        let leading = self.leading().count() as u16;
        if let Some(texture) = self.leading().nth(at.into()) {
            return Entry::Known(texture);
        }
        match at.saturating_sub(leading) {
            0 => Entry::Numbered,
            1 => Entry::Spell,
            2 => Entry::Nothing,
            other => {
                let mut others =
                    (0..self.textures).filter(|t| self.leading().all(|leading| leading != *t));
                others
                    .nth(usize::from(other) - 3)
                    .map_or(Entry::Nothing, Entry::Known)
            }
        }
    }

    /// The entries about one of them, as they are shown.
    pub(super) fn around<'s>(
        self,
        at: u16,
        table: Option<&Table<'s>>,
    ) -> Vec<screen::Entry<'s>, { screen::LINES }> {
        let first = screen::first_line(at, self.count());
        let shown = (first..self.count()).take(screen::LINES);
        shown
            .map(|at| {
                screen::Entry::Text(match self.entry(at) {
                    Entry::Compare => "is it the same as ..?",
                    Entry::About => "about this probe",
                    Entry::Known(texture) => table.and_then(|t| t.name(texture)).unwrap_or("?"),
                    Entry::Numbered => {
                        return screen::Entry::Numbered(table.map_or(Name::new(), free_name));
                    }
                    Entry::Spell => "new: spell it",
                    Entry::Nothing => "nothing, go back",
                })
            })
            .collect()
    }
}
