//! Notes in a table on its samples: whether they were moved or turned between the trials that it was learned from. A
//! slide on
//! the same track again says little about a texture.

use tactus_core::table::{EncodeError, Table, with_moved};

/// Returns what is true of all of these; `None` where it is not known of one, they differ, or there is none.
pub fn of_all(moved: impl IntoIterator<Item = Option<bool>>) -> Option<bool> {
    let mut moved = moved.into_iter();
    let first = moved.next()??;
    moved.all(|other| other == Some(first)).then_some(first)
}

/// The table with this note of each texture, by its index, in place of what it says of that.
pub fn note(bytes: &[u8], moved: impl Fn(u16) -> Option<bool>) -> Result<Vec<u8>, EncodeError> {
    let table = Table::read(bytes).map_err(EncodeError::Invalid)?;
    let says = |texture| table.moved(texture);
    if (0..table.textures()).all(|texture| says(texture) == moved(texture)) {
        return Ok(table.as_bytes().to_vec());
    }
    // a section of 5 bytes for each texture
    let mut noted = vec![0; table.as_bytes().len() + 8 + 5 * usize::from(table.textures())];
    let length = with_moved(&mut noted, &table, moved)?.as_bytes().len();
    noted.truncate(length);
    Ok(noted)
}

/// Statements about the trials of a training, and about those before it.
#[derive(Debug, Default)]
pub struct Trials {
    answers: Vec<Option<bool>>,
}

impl Trials {
    /// This was said of the next ones, or is known of those before this training; `None`: nothing.
    pub fn said(&mut self, moved: Option<bool>) {
        self.answers.push(moved);
    }

    /// The statement before a trial, from 0. Of the first one nobody is asked: it is as all others are.
    pub fn before_trial(&self, trial: usize) -> Option<bool> {
        match trial.checked_sub(1) {
            Some(asked) => *self.answers.get(asked)?,
            None => self.moved(),
        }
    }

    /// The note: what is true of all of them.
    pub fn moved(&self) -> Option<bool> {
        of_all(self.answers.iter().copied())
    }
}

/// The result of a note on how the sample of a texture was treated.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Noting {
    /// The table says so already, or does not know the texture.
    Nothing,
    /// The table with the note, which the probe is to use.
    Table(Vec<u8>),
    /// It cannot be noted, and why.
    Impossible(&'static str),
}

/// Notes how the trials of a texture were made, in the table that a probe uses.
pub fn noting(bytes: &[u8], name: &str, moved: Option<bool>) -> Result<Noting, EncodeError> {
    let table = Table::read(bytes).map_err(EncodeError::Invalid)?;
    let Some(texture) = table.find(name).filter(|&t| table.moved(t) != moved) else {
        return Ok(Noting::Nothing);
    };
    // it cannot be read without what the probe has learned by itself, which must not become a part of it
    if (0..table.textures()).any(|texture| table.tally(texture).itself > 0) {
        return Ok(Noting::Impossible(
            "the probe has learned by itself, and its table cannot be replaced without mixing that in",
        ));
    }
    let noted = note(bytes, |other| match other == texture {
        true => moved,
        false => table.moved(other),
    })?;
    Ok(Noting::Table(noted))
}

/// The fewest trials of a texture at a movement of the table; `None`: the table does not know it.
pub fn fewest(table: Table<'_>, name: &str) -> Option<u8> {
    let texture = table.find(name)?;
    let movements = (0..).zip(table.movements());
    movements.map(|(m, _)| table.trials(texture, m)).min()
}
