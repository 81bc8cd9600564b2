//! The list of what a texture can be called.

use heapless::Vec;

use crate::handheld::judge::{Judgement, free_name};
use crate::handheld::screen;
use crate::table::{Name, Table};

/// The person's label for the texture.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Choice {
    /// The texture with this index.
    Known(u16),
    /// A new one, named by [`free_name`].
    Numbered,
    /// A new one, or a known one, of this name.
    Spelled(Name),
}

/// What can be chosen for an episode.
pub(super) enum Entry {
    Known(u16),
    Numbered,
    Spell,
    Nothing,
}

/// The list for what was judged last, by a table of so many textures.
#[derive(Clone, Copy)]
pub(super) struct Naming<'j> {
    pub(super) judgement: Option<&'j Judgement>,
    pub(super) textures: u16,
}

impl<'j> Naming<'j> {
    /// Entries of the page that asks for a name: the leading textures, a new one with a number, a new one that is spelled,
    /// nothing, and all other textures.
    pub(super) fn entries(self) -> u16 {
        self.textures.saturating_add(3)
    }

    /// The leading textures of the last judgement.
    pub(super) fn leading(self) -> impl Iterator<Item = u16> + Clone + 'j {
        let leading = self.judgement.into_iter().flat_map(|j| j.leading.iter());
        leading.map(|(texture, _)| *texture)
    }

    /// What an entry stands for; `None` is nothing.
    pub(super) fn entry(self, at: u16) -> Entry {
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
        let first = screen::first_line(at, self.entries());
        let shown = (first..self.entries()).take(screen::LINES);
        shown
            .map(|at| match self.entry(at) {
                Entry::Known(texture) => {
                    let name = table.and_then(|table| table.name(texture));
                    screen::Entry::Known(name.unwrap_or("?"))
                }
                Entry::Numbered => screen::Entry::Numbered(table.map_or(Name::new(), free_name)),
                Entry::Spell => screen::Entry::Spell,
                Entry::Nothing => screen::Entry::Nothing,
            })
            .collect()
    }
}
