//! Learning a texture by touching it: which movement comes next, what its slide adds, and the table in the end.
//!
//! A [`Training`] touches nothing itself. Every [`TrainingRecord`] that it gives is to be stored before the next slide;
//! a training begun anew with the same name and table goes on where it stood when it is given them back:
//!
//! ```text
//! new -> resume per stored movement -> [ next -> slide -> took -> store ]* -> encode -> commit the table -> delete
//! ```
//!
//! A pilot (the paper's "Identifying the most useful exploratory movements") makes other movements than the table has,
//! so what it learns does not go into that table: its result is stored and reported. It makes a table only where there
//! is none, with the pilot's movements, or where the table has these already.

use crate::table::TrainingStats;
use heapless::Vec;

use crate::features::{Movement, Observation, PropertySet};
use crate::fill;
use crate::store::TrainingRecord;
use crate::table::{
    Change, Contents, Experience, MAX_MOVEMENTS, MAX_TEXTURES, Name, Table, Tally, TextureStats,
    Whitened, amend, encode, encoded_len,
};
use crate::wire::{LEAST_TRIALS, TrainingError};

/// The movements of a table that is begun: the three that the paper chose.
pub(crate) const FIRST_MOVEMENTS: [Movement; 3] = [
    Movement::FOR_TRACTION,
    Movement::FOR_FINENESS,
    Movement::FOR_ROUGHNESS,
];

/// Movements of a pilot: of the grid those that a rig presses, up to `most_mn`.
pub fn pilot_movements(most_mn: u16) -> impl Iterator<Item = Movement> {
    Movement::grid().filter(move |m| m.force_mn() <= most_mn)
}

/// A texture to learn.
#[derive(Clone, Copy, Debug)]
pub struct Wanted<'n> {
    /// Its name. One that the table knows goes on with the trials that it has there.
    pub name: &'n str,
    /// Wanted number of trials of each movement.
    pub trials: u8,
    /// [`pilot_movements`] instead of the table's.
    pub pilot: bool,
    /// The properties that the rig measures.
    pub measures: PropertySet,
    /// The largest force that it presses, mN.
    pub most_mn: u16,
}

/// Returns an error if what is wanted cannot be learned into such a table.
fn check(contents: Contents, wanted: &Wanted<'_>) -> Result<(), TrainingError> {
    match contents {
        Contents::Gaussians(measured) => {
            if wanted.trials < LEAST_TRIALS {
                return Err(TrainingError::Trials(wanted.trials));
            }
            if measured.is_empty() {
                return Err(TrainingError::Measures(None));
            }
            if let Some(missing) = measured.iter().find(|p| !wanted.measures.contains(*p)) {
                return Err(TrainingError::Measures(Some(missing)));
            }
        }
        Contents::Fused(set, _) => {
            if wanted.trials == 0 {
                return Err(TrainingError::Trials(0));
            }
            if !set.measured_by(wanted.measures) {
                return Err(TrainingError::Features(set));
            }
        }
    }
    Ok(())
}

/// A texture that is being learned.
#[derive(Clone, Debug)]
pub struct Training {
    name: Name,
    trials: u8,
    contents: Contents,
    table: Option<u32>,
    goes_on: bool,
    makes_table: bool,
    learned: Vec<(Movement, TrainingStats), MAX_MOVEMENTS>,
}

impl Training {
    /// Begins a training, or begins it again; `table` is the one in use, `buffer` the bytes that a table may have.
    ///
    /// Without a table its movements are the first ones, or the pilot's.
    /// Errors: everything that would keep the texture out of the table in the end: see [`TrainingError`].
    #[inline]
    pub fn new(
        wanted: Wanted<'_>,
        table: Option<&Table<'_>>,
        buffer: usize,
    ) -> Result<Self, TrainingError> {
        let length = wanted.name.len();
        let name = Name::try_from(wanted.name).map_err(|_| TrainingError::Name(length))?;
        if name.is_empty() {
            return Err(TrainingError::Name(0));
        }
        let makes_table = match table {
            Some(table) => !wanted.pilot || table.movements().eq(pilot_movements(wanted.most_mn)),
            None => true,
        };
        let contents = match table {
            Some(table) if makes_table => table.contents(),
            // a pilot is about properties
            Some(table) if !table.measured().is_empty() => table.contents(),
            _ => Contents::Gaussians(wanted.measures),
        };
        check(contents, &wanted)?;
        let untouched = match contents {
            Contents::Gaussians(_) => TrainingStats::Gaussians(Experience::default()),
            Contents::Fused(..) => TrainingStats::Fused(Whitened::default()),
        };
        let untouched = |movement| (movement, untouched);
        let known = table
            .filter(|_| makes_table)
            .and_then(|table| Some((table, table.find(&name)?)));
        let mut learned = Vec::new();
        match table.filter(|_| makes_table) {
            Some(table) => fill(
                &mut learned,
                table.movements().zip(0..).map(|(movement, index)| {
                    let known = known.map(|(table, texture)| match contents {
                        Contents::Gaussians(_) => {
                            TrainingStats::Gaussians(table.experience(texture, index))
                        }
                        Contents::Fused(..) => TrainingStats::Fused(table.whitened(texture, index)),
                    });
                    (movement, known.unwrap_or(untouched(movement).1))
                }),
            ),
            None if wanted.pilot => {
                fill(&mut learned, pilot_movements(wanted.most_mn).map(untouched))
            }
            None => fill(&mut learned, FIRST_MOVEMENTS.into_iter().map(untouched)),
        }
        if makes_table && known.is_none() {
            let textures = table.map_or(0, |table| usize::from(table.textures())) + 1;
            if textures > MAX_TEXTURES {
                return Err(TrainingError::Textures);
            }
            let names = table
                .into_iter()
                .flat_map(Table::names)
                .chain([wanted.name]);
            let names = names.map(|name| 1 + name.len()).sum();
            let length = encoded_len(contents, textures, learned.len(), names);
            if length > buffer {
                return Err(TrainingError::NoSpace(length));
            }
        }
        Ok(Self {
            name,
            trials: wanted.trials,
            contents,
            table: table.map(Table::crc),
            goes_on: known.is_some(),
            makes_table,
            learned,
        })
    }

    /// The texture's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The checksum under which progress is stored: of the table whose trials of this texture are counted in, `None`
    /// where there are none.
    pub fn table(&self) -> Option<u32> {
        self.table.filter(|_| self.goes_on)
    }

    /// True if there is to be a table in the end; a pilot beside another table has only a result.
    pub(crate) fn makes_table(&self) -> bool {
        self.makes_table
    }

    /// Movements and what has been learned at them.
    pub fn learned(&self) -> &[(Movement, TrainingStats)] {
        &self.learned
    }

    /// Takes up what was stored of this training at a movement.
    /// Errors: [`TrainingError::Movement`], [`TrainingError::Stats`].
    #[inline]
    pub fn resume(
        &mut self,
        movement: Movement,
        stats: TrainingStats,
    ) -> Result<(), TrainingError> {
        let fits = matches!(
            (stats, self.contents),
            (TrainingStats::Gaussians(_), Contents::Gaussians(_))
                | (TrainingStats::Fused(_), Contents::Fused(..))
        );
        let at = self.at(movement)?;
        if !fits {
            return Err(TrainingError::Stats);
        }
        *at = stats;
        Ok(())
    }

    /// The movement to be made next: the one made least often, of several the first; `None` when there are enough
    /// trials of all.
    pub fn next(&self) -> Option<Movement> {
        let (movement, experience) = self.learned.iter().min_by_key(|(_, e)| e.trials())?;
        (experience.trials() < self.trials).then_some(*movement)
    }

    /// Trials that are still to be made, of all movements.
    pub fn left(&self) -> u16 {
        self.learned
            .iter()
            .map(|(_, e)| u16::from(self.trials.saturating_sub(e.trials())))
            .sum()
    }

    /// Takes a slide in, and gives what is to be stored. `table` is the one that the training was begun with. Errors:
    /// [`TrainingError::Movement`], [`TrainingError::Missing`], [`TrainingError::Features`]: the slide does not count.
    #[inline]
    pub fn took(
        &mut self,
        table: Option<&Table<'_>>,
        movement: Movement,
        slide: &Observation,
    ) -> Result<TrainingRecord, TrainingError> {
        let contents = self.contents;
        let known = table.and_then(|table| table.find(&self.name));
        let stats = self.at(movement)?;
        match (&mut *stats, contents) {
            (TrainingStats::Gaussians(experience), Contents::Gaussians(measured)) => experience
                .learn(measured, &slide.properties)
                .map_err(TrainingError::Missing)?,
            (TrainingStats::Fused(whitened), Contents::Fused(set, features)) => {
                let white = slide.vector(set, features.into()).and_then(|vector| {
                    let table = table?;
                    let index = table.movements().position(|m| m == movement)? as u8;
                    let white = table.whiten(index, &vector)?;
                    let pace = table.pace_of(index, slide);
                    Some(table.at_movement_speed(known, index, &white, pace))
                });
                whitened.teach(&white.ok_or(TrainingError::Features(set))?);
            }
            _ => return Err(TrainingError::Stats),
        }
        let stats = *stats;
        Ok(TrainingRecord {
            stats,
            name: self.name.clone(),
            movement,
            table: self.table(),
        })
    }

    /// Writes the table with this texture into the beginning of `buffer`: `table`, the one in use, with all other
    /// textures as they are to the bit, or one of this texture alone. Errors: [`TrainingError::Unfinished`],
    /// [`TrainingError::Pilot`], [`TrainingError::Table`], [`TrainingError::Encode`].
    #[inline]
    pub fn encode<'r>(
        &self,
        table: Option<&Table<'_>>,
        buffer: &'r mut [u8],
    ) -> Result<Table<'r>, TrainingError> {
        if let Some(movement) = self.next() {
            return Err(TrainingError::Unfinished(movement));
        }
        if !self.makes_table {
            return Err(TrainingError::Pilot);
        }
        if table.map(Table::crc) != self.table {
            return Err(TrainingError::Table);
        }
        let (mut experience, mut whitened) = (
            Vec::<Experience, MAX_MOVEMENTS>::new(),
            Vec::<Whitened, MAX_MOVEMENTS>::new(),
        );
        for (_, stats) in &self.learned {
            // both have space: they are as long as `learned`
            let _ = match stats {
                TrainingStats::Gaussians(e) => experience.push(*e).is_ok(),
                TrainingStats::Fused(w) => whitened.push(*w).is_ok(),
            };
        }
        let known = match self.contents {
            Contents::Gaussians(_) => TextureStats::Gaussians(&experience),
            Contents::Fused(..) => TextureStats::Fused(&whitened),
        };
        let name = &self.name;
        match (table, self.contents) {
            (Some(table), _) => {
                let tally = self.tally(table);
                amend(buffer, table, Change::Put { name, known, tally })
            }
            (None, Contents::Gaussians(measured)) => {
                let movements: Vec<Movement, MAX_MOVEMENTS> =
                    self.learned.iter().map(|(m, _)| *m).collect();
                let texture = (name.as_str(), &experience[..]);
                encode(buffer, measured, &movements, [texture].into_iter())
            }
            (None, Contents::Fused(..)) => return Err(TrainingError::Table),
        }
        .map_err(TrainingError::Encode)
    }

    /// The slides that the table counts for the texture, and the user's trials since.
    fn tally(&self, table: &Table<'_>) -> Tally {
        let known = table.find(&self.name);
        let before = known.map_or(Tally::default(), |texture| table.tally(texture));
        let learned = self.learned.iter().zip(0..).map(|((_, stats), movement)| {
            let before = known.map_or(0, |texture| table.trials(texture, movement));
            stats.trials().saturating_sub(before)
        });
        Tally {
            user: learned.fold(before.user, u8::saturating_add),
            ..before
        }
    }

    fn at(&mut self, movement: Movement) -> Result<&mut TrainingStats, TrainingError> {
        self.learned
            .iter_mut()
            .find(|(m, _)| *m == movement)
            .map(|(_, stats)| stats)
            .ok_or(TrainingError::Movement(movement))
    }
}

#[cfg(test)]
mod tests;
