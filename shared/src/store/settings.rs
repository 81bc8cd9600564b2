//! The settings: one record per key in a `sequential-storage` map.

use core::mem;

use embedded_storage_async::nor_flash::NorFlash;
use sequential_storage::cache::key_pointers::ArrayKeyPointers;
use sequential_storage::cache::{Cache, Uncached};
use sequential_storage::map::{MapConfig, MapStorage};
use serde::{Deserialize, Serialize};

use super::error::{Setting, SettingsError, StoreError};
use super::layout::SCHEMA;
use super::pages::{Pages, page_size};
use super::records::{
    KEY_CALIBRATION, KEY_FALSE_ALARM, KEY_HIGH_FORCE, KEY_SCHEMA, KEY_SELF, KEY_SKIN, KEY_TRAINED,
    Map, RECORD, Record, Records, SelfLearnedRecord, TrainingRecord, decode,
};
use super::sectors::Store;
use crate::features::Movement;
use crate::rig::calibration::RigCalibration;
use crate::rig::skin::SkinCare;
use crate::table::{MAX_TEXTURES, TrainingStats, is_false_alarm};

/// A record is stored so often at most: three wrong bits can be in the way of three.
const TRIES: u8 = 4;

/// The use of a place for a record, for a new record.
#[derive(Clone, Copy, PartialEq)]
enum Use {
    Free,
    Taken,
    /// The record may be given up.
    Stale,
    /// The record is the one that is meant.
    Same,
}

impl<F: NorFlash> Store<F> {
    /// True if the settings can be used. If not, [`Store::erase_settings`] makes them so; the tables are not concerned.
    /// Errors: why not.
    pub fn settings(&self) -> Result<(), SettingsError> {
        self.settings.map(|_| ())
    }

    /// What of the settings [`Store::mend`] could not put right, and is as it was before; it ends with the next record
    /// of its kind.
    pub fn damaged_record(&self) -> Option<SettingsError> {
        self.lost.map(|key| {
            SettingsError::Record(match key {
                KEY_CALIBRATION => Setting::Calibration,
                KEY_SKIN => Setting::Skin,
                KEY_TRAINED..KEY_SELF => Setting::Training,
                KEY_SELF.. => Setting::SelfLearned,
                _ => Setting::Limits,
            })
        })
    }

    /// Erases all settings: calibration, skin care, false alarm and unfinished training.
    pub async fn erase_settings(&mut self) -> Result<(), StoreError> {
        self.settings = Err(SettingsError::Corrupt);
        self.lost = None;
        Pages(&mut self.flash, &mut self.erasures)
            .wipe()
            .await
            .map_err(StoreError::flash)?;
        self.open_settings().await
    }

    /// The calibration of this rig; `None` if there was none.
    pub async fn calibration(&mut self) -> Result<Option<RigCalibration>, StoreError> {
        let mut buffer = [0; RECORD];
        let Some(bytes) = self.fetch(KEY_CALIBRATION, &mut buffer).await? else {
            return Ok(None);
        };
        RigCalibration::from_bytes(bytes)
            .map(Some)
            .map_err(StoreError::Calibration)
    }

    /// Stores the calibration of this rig.
    /// Errors: [`StoreError::Calibration`] for one that could not be used, [`StoreError::Flash`],
    /// [`StoreError::Settings`], [`StoreError::Worn`].
    pub async fn set_calibration(
        &mut self,
        calibration: &RigCalibration,
    ) -> Result<(), StoreError> {
        calibration.check().map_err(StoreError::Calibration)?;
        self.store(KEY_CALIBRATION, &calibration.to_bytes()).await
    }

    /// Sliding since the skin was replaced; none if nothing is stored.
    /// Errors: what is stored is no work, whatever its checksum says.
    pub async fn skin(&mut self) -> Result<SkinCare, StoreError> {
        let (energy_j, wear_j) = self.value(KEY_SKIN).await?.unwrap_or_default();
        let is_work = |joules: f32| (0.0..f32::INFINITY).contains(&joules);
        if !(is_work(energy_j) && is_work(wear_j)) {
            return Err(SettingsError::Record(Setting::Skin).into());
        }
        Ok(SkinCare::after(energy_j, wear_j))
    }

    /// Stores the sliding since the skin was replaced.
    pub async fn set_skin(&mut self, skin: &SkinCare) -> Result<(), StoreError> {
        let record = (skin.energy_j(), skin.wear_j());
        self.encode(KEY_SKIN, &record).await
    }

    /// Share of false alarms that limits are for; `None`: each table's own.
    pub async fn false_alarm(&mut self) -> Result<Option<f32>, StoreError> {
        let share = self.value::<Option<f32>>(KEY_FALSE_ALARM).await?.flatten();
        Ok(share.filter(|share| is_false_alarm(*share)))
    }

    /// Stores the share of false alarms that limits are for.
    pub async fn set_false_alarm(&mut self, share: Option<f32>) -> Result<(), StoreError> {
        self.encode(KEY_FALSE_ALARM, &share).await
    }

    /// Returns whether movements may press with up to 2 N; never while a record is lost, see [`Store::damaged_record`]:
    /// the one before it may have allowed what it forbade.
    pub async fn high_force(&mut self) -> Result<bool, StoreError> {
        let allowed = self.value(KEY_HIGH_FORCE).await?.unwrap_or(false);
        Ok(allowed && self.lost.is_none())
    }

    /// Stores whether movements may press with up to 2 N.
    pub async fn set_high_force(&mut self, allow: bool) -> Result<(), StoreError> {
        self.encode(KEY_HIGH_FORCE, &allow).await
    }

    /// What the training of a texture has learned so far at a movement, on top of the table with this checksum, or of
    /// its own only.
    pub async fn training_record(
        &mut self,
        name: &str,
        movement: Movement,
        table: Option<u32>,
    ) -> Result<Option<TrainingStats>, StoreError> {
        self.settings?;
        let mut found = None;
        let mut buffer = [0; RECORD];
        let mut map = self.map();
        let mut records =
            Records::<F, TrainingRecord>::new(map.fetch_all_items(&mut buffer).await?);
        while let Some((place, record)) = records.next().await? {
            match record {
                Some(record) if record.is(name, movement, table) => {
                    found = Some((place, record.stats));
                }
                // the place went to another
                _ if found.is_some_and(|(at, _)| at == place) => found = None,
                _ => {}
            }
        }
        Ok(found.map(|(_, stats)| stats))
    }

    /// Stores how far a training has come, in place of what was stored for this texture, movement and table. When space
    /// runs out, progress on top of other tables than this record's is given up.
    pub async fn set_training_record(&mut self, new: &TrainingRecord) -> Result<(), StoreError> {
        self.put(new).await
    }

    /// Deletes the unfinished training of a texture, movement by movement: after a cut some may be left.
    pub async fn delete_training_records(&mut self, name: &str) -> Result<(), StoreError> {
        self.clear(|record: &TrainingRecord| record.name == name)
            .await
    }

    /// What the probe has learned by itself of the textures of the table with this lineage, one after the other: `each`
    /// receives the newest record of every texture.
    pub async fn self_learned(
        &mut self,
        lineage: u32,
        each: &mut dyn FnMut(SelfLearnedRecord),
    ) -> Result<(), StoreError> {
        self.settings?;
        // which record of every place is the last: only that one counts
        let mut last = [0u16; MAX_TEXTURES];
        let mut buffer = [0; RECORD];
        let mut map = self.map();
        let mut records =
            Records::<F, SelfLearnedRecord>::new(map.fetch_all_items(&mut buffer).await?);
        let mut number = 0;
        while let Some((place, _)) = records.next().await? {
            number += 1;
            if let Some(last) = last.get_mut(usize::from(place)) {
                *last = number;
            }
        }
        let mut map = self.map();
        let mut records =
            Records::<F, SelfLearnedRecord>::new(map.fetch_all_items(&mut buffer).await?);
        let mut number = 0;
        while let Some((place, record)) = records.next().await? {
            number += 1;
            let is_last = last.get(usize::from(place)) == Some(&number);
            if let Some(record) = record.filter(|record| is_last && record.lineage == lineage) {
                each(record);
            }
        }
        Ok(())
    }

    /// Stores what the probe has learned by itself of a texture, in place of what was stored of it. When space runs
    /// out, what belongs to tables of another lineage is given up.
    pub async fn set_self_learned(&mut self, new: &SelfLearnedRecord) -> Result<(), StoreError> {
        self.put(new).await
    }

    /// Deletes what the probe has learned by itself: of the texture with this number of that lineage, or all of it.
    pub(crate) async fn delete_self_learned(
        &mut self,
        of: Option<(u32, u16)>,
    ) -> Result<(), StoreError> {
        let is_its =
            |record: &SelfLearnedRecord| of.is_none_or(|of| (record.lineage, record.number) == of);
        self.clear(is_its).await
    }

    /// Stores a record in the place of the one that it replaces; otherwise in a free place, or in that of one that it
    /// outlives.
    async fn put<T: Record>(&mut self, new: &T) -> Result<(), StoreError> {
        let old = |old: &T| {
            if new.replaces(old) {
                Use::Same
            } else if new.outlives(old) {
                Use::Stale
            } else {
                Use::Taken
            }
        };
        let uses = self.uses(old).await?;
        let uses = uses.iter().take(T::PLACES.into());
        let place = [Use::Same, Use::Free, Use::Stale]
            .into_iter()
            .find_map(|wanted| uses.clone().position(|now| *now == wanted))
            .and_then(|place| u8::try_from(place).ok())
            .ok_or(SettingsError::Full)?;
        self.encode(T::FIRST + place, &Some(new)).await
    }

    async fn clear<T: Record>(&mut self, is_such: impl Fn(&T) -> bool) -> Result<(), StoreError> {
        let such = |record: &T| match is_such(record) {
            true => Use::Same,
            false => Use::Taken,
        };
        let uses = self.uses(such).await?;
        for (key, now) in (T::FIRST..T::FIRST + T::PLACES).zip(uses) {
            if now == Use::Same {
                self.encode(key, &None::<()>).await?;
            }
        }
        Ok(())
    }

    async fn uses<T: Record>(
        &mut self,
        of: impl Fn(&T) -> Use,
    ) -> Result<[Use; MAX_TEXTURES], StoreError> {
        self.settings?;
        let mut uses = [Use::Free; MAX_TEXTURES];
        let mut buffer = [0; RECORD];
        let mut map = self.map();
        let mut records = Records::<F, T>::new(map.fetch_all_items(&mut buffer).await?);
        while let Some((place, record)) = records.next().await? {
            if let Some(slot) = uses.get_mut(usize::from(place)) {
                *slot = record.as_ref().map_or(Use::Free, &of);
            }
        }
        Ok(uses)
    }

    /// Brings the pages into order, and looks whether they can be read.
    pub(super) async fn open_settings(&mut self) -> Result<(), StoreError> {
        Pages(&mut self.flash, &mut self.erasures)
            .recover()
            .await
            .map_err(StoreError::flash)?;
        self.look_at_settings().await
    }

    pub(super) async fn look_at_settings(&mut self) -> Result<(), StoreError> {
        self.settings = match self.read_all().await {
            Ok(schema_written) => Ok(schema_written),
            Err(StoreError::Settings(why)) => Err(why),
            Err(why) => return Err(why),
        };
        Ok(())
    }

    /// Reads every record once; whether there is any.
    async fn read_all(&mut self) -> Result<bool, StoreError> {
        let mut buffer = [0; RECORD];
        let mut map = self.map();
        let schema = map.fetch_item::<&[u8]>(&mut buffer, &KEY_SCHEMA).await?;
        match schema.map(decode::<u16>).transpose()? {
            Some(SCHEMA) => {}
            Some(other) => return Err(SettingsError::Schema(other).into()),
            None => {
                // the schema is the first record of all
                let mut items = map.fetch_all_items(&mut buffer).await?;
                let mut buffer = [0; RECORD];
                return match items.next::<&[u8]>(&mut buffer).await? {
                    None => Ok(false),
                    Some(_) => Err(SettingsError::Corrupt.into()),
                };
            }
        }
        let mut records =
            Records::<F, TrainingRecord>::new(map.fetch_all_items(&mut buffer).await?);
        while records.next().await?.is_some() {}
        let mut foreign = records.foreign;
        let mut map = self.map();
        let mut records =
            Records::<F, SelfLearnedRecord>::new(map.fetch_all_items(&mut buffer).await?);
        while records.next().await?.is_some() {}
        foreign = foreign.or(records.foreign);
        self.lost = self.lost.or(foreign);
        Ok(true)
    }

    fn map(&mut self) -> Map<'_, F> {
        let config = const { MapConfig::new(0..2 * page_size::<F>() as u32) };
        MapStorage::new(
            Pages(&mut self.flash, &mut self.erasures),
            config,
            Cache::new(Uncached, Uncached, ArrayKeyPointers::new()),
        )
    }

    async fn fetch<'b>(
        &mut self,
        key: u8,
        buffer: &'b mut [u8; RECORD],
    ) -> Result<Option<&'b [u8]>, StoreError> {
        self.settings?;
        Ok(self.map().fetch_item(buffer, &key).await?)
    }

    async fn value<T: for<'b> Deserialize<'b>>(
        &mut self,
        key: u8,
    ) -> Result<Option<T>, StoreError> {
        let mut buffer = [0; RECORD];
        let bytes = self.fetch(key, &mut buffer).await?;
        bytes.map(decode).transpose()
    }

    async fn encode(&mut self, key: u8, value: &impl Serialize) -> Result<(), StoreError> {
        let mut buffer = [0; RECORD];
        let bytes = postcard::to_slice(value, &mut buffer).map_err(|_| SettingsError::Corrupt)?;
        self.store(key, bytes).await
    }

    /// Stores a record, the first one behind one of the schema.
    async fn store(&mut self, key: u8, bytes: &[u8]) -> Result<(), StoreError> {
        if !self.settings? {
            let mut record = [0; RECORD];
            let schema =
                postcard::to_slice(&SCHEMA, &mut record).map_err(|_| SettingsError::Corrupt)?;
            self.store_checked(KEY_SCHEMA, schema).await?;
            self.settings = Ok(true);
        }
        self.store_checked(key, bytes).await
    }

    /// Stores a record and reads it back as the next start will. Where bits of the flash no longer change, it is stored
    /// behind them.
    pub(super) async fn store_checked(&mut self, key: u8, bytes: &[u8]) -> Result<(), StoreError> {
        let mut buffer = [0; RECORD];
        for _ in 0..TRIES {
            // after a write that failed, or was given up
            if mem::replace(&mut self.is_unsure, true) {
                let sealed = Pages(&mut self.flash, &mut self.erasures).seal().await;
                sealed.map_err(StoreError::flash)?;
            }
            self.map().store_item(&mut buffer, &key, &bytes).await?;
            // by a map that does not know where it was written, as after the next start
            let back = self.map().fetch_item::<&[u8]>(&mut buffer, &key).await;
            match back.map_err(StoreError::from) {
                Ok(back) if back == Some(bytes) => {
                    self.is_unsure = false;
                    return Ok(());
                }
                Ok(_) | Err(StoreError::Settings(_)) => {}
                Err(why) => return Err(why),
            }
        }
        Err(StoreError::Worn)
    }
}
