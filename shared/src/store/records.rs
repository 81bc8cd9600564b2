//! The records of the settings: their keys, their sizes, and how they are read.

use core::marker::PhantomData;

use embedded_storage_async::nor_flash::NorFlash;
use sequential_storage::cache::key_pointers::ArrayKeyPointers;
use sequential_storage::cache::{Cache, Uncached};
use sequential_storage::map::{self, MapStorage};
use serde::{Deserialize, Serialize};

use super::error::{SettingsError, StoreError};
use super::pages::Pages;
use crate::features::Movement;
use crate::table::{MAX_TEXTURES, Name, TrainingStats, Whitened};

/// Most records of training: a pilot of 36 movements and a texture of three. With all of them in use, 108 bytes each,
/// and everything self-learned besides, 84 bytes a texture, a page of 16 KB is not full.
pub const MAX_RECORDS: u8 = 40;
/// Movements of a texture that a probe learns by itself: an exploration rarely makes more.
pub const SELF_MOVEMENTS: usize = 2;

/// The version of the records.
pub(super) const KEY_SCHEMA: u8 = 0;
/// The calibration of rig and finger.
pub(super) const KEY_CALIBRATION: u8 = 1;
/// The way of the finger, and the work that the skin has seen.
pub(super) const KEY_SKIN: u8 = 2;
/// The share of false alarms that the probe's limits are for.
pub(super) const KEY_FALSE_ALARM: u8 = 3;
/// True if movements may press with up to 2 N.
pub(super) const KEY_HIGH_FORCE: u8 = 4;
/// The first of the unfinished trainings: a texture at one movement each.
pub(super) const KEY_TRAINED: u8 = 16;
/// The first of the textures that the probe learned by itself, one each.
pub(super) const KEY_SELF: u8 = 64;
pub(super) const KEYS: usize = KEY_SELF as usize + MAX_TEXTURES;
/// The longest record with its key, in whole words: one of training takes 99 bytes, a self-learned one 106; with fine
/// bands, 141 and 190.
pub(super) const RECORD: usize = 192;

/// The progress of the training of a texture at one movement.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct TrainingRecord {
    /// The texture.
    pub name: Name,
    /// The movement.
    pub movement: Movement,
    /// Checksum of the table whose trials of this texture are counted in; `None` for trials of its own only.
    pub table: Option<u32>,
    /// The statistics so far.
    pub stats: TrainingStats,
}

/// A record of which the settings hold several, each at a place of its own.
pub(super) trait Record: Serialize + for<'b> Deserialize<'b> {
    const FIRST: u8;
    const PLACES: u8;

    /// True if this record takes the place of `old`.
    fn replaces(&self, old: &Self) -> bool;

    /// True if `old` is given up for this record when space runs out.
    fn outlives(&self, old: &Self) -> bool;
}

impl Record for TrainingRecord {
    const FIRST: u8 = KEY_TRAINED;
    const PLACES: u8 = MAX_RECORDS;

    fn replaces(&self, old: &Self) -> bool {
        old.is(&self.name, self.movement, self.table)
    }

    fn outlives(&self, old: &Self) -> bool {
        self.table.is_some() && old.table.is_some() && self.table != old.table
    }
}

impl TrainingRecord {
    pub(super) fn is(&self, name: &str, movement: Movement, table: Option<u32>) -> bool {
        self.name == name && self.movement == movement && self.table == table
    }
}

impl Record for SelfLearnedRecord {
    const FIRST: u8 = KEY_SELF;
    const PLACES: u8 = MAX_TEXTURES as u8;

    fn replaces(&self, old: &Self) -> bool {
        self.lineage == old.lineage && self.number == old.number
    }

    fn outlives(&self, old: &Self) -> bool {
        self.lineage != old.lineage
    }
}

/// The probe's own learning of a texture, in place of the table's statistics at these movements.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct SelfLearnedRecord {
    /// [`crate::table::Table::lineage`] of the table: what is learned later does not change it.
    pub lineage: u32,
    /// [`crate::table::Table::number`] of the texture.
    pub number: u16,
    /// Per movement, slides that the probe learned by itself, and what it knows now.
    pub movements: heapless::Vec<(u8, u8, Whitened), SELF_MOVEMENTS>,
}

/// Remembers where the newest record of every key is, for one call. Without it, `sequential-storage` reads the whole
/// page for every record that it copies to the next page.
type Places = Cache<Uncached, Uncached, ArrayKeyPointers<u8, KEYS>, u8>;

pub(super) type Map<'f, F> = MapStorage<u8, Pages<'f, F>, Places>;
type Items<'m, 'f, F> = map::MapItemIter<'m, u8, Pages<'f, F>, Places>;

/// One pass over all records of a kind, oldest first: what a place held last counts.
pub(super) struct Records<'m, 'f, F: NorFlash, T> {
    items: Items<'m, 'f, F>,
    kind: PhantomData<T>,
    /// The key of one that is whole and no record of this kind: it hides no other.
    pub(super) foreign: Option<u8>,
}

impl<'m, 'f, F: NorFlash, T: Record> Records<'m, 'f, F, T> {
    pub(super) fn new(items: Items<'m, 'f, F>) -> Self {
        Self {
            items,
            kind: PhantomData,
            foreign: None,
        }
    }

    /// Place and record, `None` for a place that was cleared or holds none.
    pub(super) async fn next(&mut self) -> Result<Option<(u8, Option<T>)>, StoreError> {
        let mut buffer = [0; RECORD];
        while let Some((key, bytes)) = self.items.next::<&[u8]>(&mut buffer).await? {
            if (T::FIRST..T::FIRST + T::PLACES).contains(&key) {
                let record = decode(bytes).unwrap_or_else(|_| {
                    self.foreign = Some(key);
                    None
                });
                return Ok(Some((key - T::FIRST, record)));
            }
        }
        Ok(None)
    }
}

pub(super) fn decode<'b, T: Deserialize<'b>>(bytes: &'b [u8]) -> Result<T, StoreError> {
    postcard::from_bytes(bytes).map_err(|_| SettingsError::Corrupt.into())
}
