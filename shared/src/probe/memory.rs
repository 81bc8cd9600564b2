//! What a probe knows: the store, and the table in force.

use embedded_storage_async::nor_flash::NorFlash;

use super::seams::{Events, StoredBytes};
use super::status::TableInUse;
use super::teach::{self, put_in_force};
use crate::explorer::EpisodeSummary;
use crate::rig::skin::SkinCare;
use crate::store::{Store, StoreError};
use crate::table::{Table, TableError};
use crate::wire::{Event, Failure, MemoryError};

pub(super) type Lent<'a, F> = (&'a mut Store<F>, Table<'a>, &'a mut [u8]);

/// Erasures since boot that need not wait, and the time that each one after them takes.
const FREE_ERASURES: u32 = 10;
const ERASURE_MS: u32 = 1000;

/// The wear of the flash by requests of a host.
#[derive(Default)]
struct Wear {
    /// The time of the request; unknown where no clock tells it, and then nothing is bounded.
    now_ms: Option<u32>,
    counted: u32,
    /// When sectors were erased last, and how many.
    erased_ms: u32,
    erased: u32,
}

/// The memory of a probe.
pub struct Memory<'m, F, B> {
    /// Or why it could not be opened.
    store: Result<Store<F>, StoreError>,
    stored: B,
    factory: &'m [u8],
    /// Begins with the table in force: the stored one or the factory's, with what the probe has learned by itself. A
    /// new table is made here too; afterwards [`Memory::reload`] is due.
    buffer: &'m mut [u8],
    length: Result<usize, MemoryError>,
    is_factory: bool,
    instead: Option<MemoryError>,
    /// Generation of a stored table that is not to be read: see [`Memory::distrust`].
    distrusted: Option<u32>,
    wear: Wear,
    /// Share of false alarms that limits are for; the table's own, unless set.
    pub false_alarm: Option<f32>,
    /// Summary of the last exploration, until the rig moves again.
    pub episode: Option<EpisodeSummary>,
}

/// The table that all learning begins with: the stored one, or the factory's, and then why the stored one is none.
#[inline(never)]
fn base<'b, F: NorFlash, B: StoredBytes<F>>(
    store: &mut Result<Store<F>, StoreError>,
    stored: &'b mut B,
    factory: &'b [u8],
    distrusted: Option<u32>,
) -> (&'b [u8], Option<TableError>) {
    let store = store.as_mut().ok();
    let store = store.filter(|store| !is_distrusted(store, distrusted));
    let finger = stored.finger();
    match store.and_then(|store| stored.bytes(store)) {
        None => (factory, None),
        // one that another version of this firmware wrote is not understood, or is another finger's
        Some(bytes) => match Table::read(bytes).and_then(|table| table.of_finger(finger)) {
            Ok(_) => (bytes, None),
            Err(why) => (factory, Some(why)),
        },
    }
}

fn is_distrusted<F: NorFlash>(store: &Store<F>, distrusted: Option<u32>) -> bool {
    let stored = store.table().map(|table| table.generation);
    stored.is_some() && stored == distrusted
}

impl<'m, F: NorFlash, B: StoredBytes<F>> Memory<'m, F, B> {
    /// A memory without a table in force: [`Memory::reload`] is due. `buffer` takes the longest table.
    pub fn new(
        store: Result<Store<F>, StoreError>,
        stored: B,
        factory: &'m [u8],
        buffer: &'m mut [u8],
    ) -> Self {
        Self {
            store,
            stored,
            factory,
            buffer,
            length: Ok(0),
            is_factory: true,
            instead: None,
            distrusted: None,
            wear: Wear::default(),
            false_alarm: None,
            episode: None,
        }
    }

    /// Gives store, factory's table and buffer back.
    pub fn close(self) -> (Result<Store<F>, StoreError>, &'m [u8], &'m mut [u8]) {
        (self.store, self.factory, self.buffer)
    }

    /// Tells the time of the next request, in ms since boot: from the tenth erasure on, sectors are erased at most once
    /// a second for a host, which could wear the flash out in less than an hour otherwise.
    pub fn at(&mut self, now_ms: u32) {
        self.wear.now_ms = Some(now_ms);
    }

    fn erasures(&self) -> u32 {
        self.store.as_ref().map_or(0, Store::erasures)
    }

    /// Errors: so many sectors were erased that this request has to wait.
    pub(super) fn may_erase(&self) -> Result<(), MemoryError> {
        let erasures = self.erasures();
        let Wear {
            now_ms: Some(now_ms),
            erased_ms,
            erased,
            ..
        } = self.wear
        else {
            return Ok(());
        };
        let wait_ms = ERASURE_MS.saturating_mul(erased);
        if erasures >= FREE_ERASURES && now_ms.wrapping_sub(erased_ms) < wait_ms {
            return Err(StoreError::TooSoon(erasures).into());
        }
        Ok(())
    }

    /// Counts what the request has erased.
    pub(super) fn count_erasures(&mut self, events: &mut impl Events) {
        let erasures = self.erasures();
        if erasures != self.wear.counted {
            self.wear.erased = erasures.wrapping_sub(self.wear.counted);
            self.wear.counted = erasures;
            self.wear.erased_ms = self.wear.now_ms.unwrap_or(0);
            events.erased(erasures);
        }
    }

    /// Leaves the stored table unread, which reset the probe when it read it: the firmware's is in its place until
    /// another table is stored.
    pub fn distrust(&mut self) {
        let stored = self.store.as_ref().ok().and_then(Store::table);
        self.distrusted = stored.map(|table| table.generation);
    }

    /// Puts the table in force, with the limits that are set, which `events` hears of.
    pub async fn reload(&mut self, events: &mut impl Events) {
        let damaged = self.store.as_ref().ok().and_then(Store::damaged_table);
        // settings that cannot be read are reported when the calibration is restored
        if let Ok(store) = &mut self.store {
            self.false_alarm = store.false_alarm().await.unwrap_or(None);
        }
        let finger = self.stored.finger();
        let is_unread = |store| is_distrusted(store, self.distrusted);
        let is_unread = self.store.as_ref().is_ok_and(is_unread);
        let distrusted = self.distrusted;
        let (base, why) = base(&mut self.store, &mut self.stored, self.factory, distrusted);
        self.is_factory = core::ptr::eq(base, self.factory);
        let instead = if self.is_factory {
            MemoryError::StoredTable
        } else {
            MemoryError::NewestTable
        };
        let unread = is_unread.then_some(MemoryError::Unread);
        self.instead = unread.or(why.or(damaged).map(instead));
        if let Some(why) = &self.instead {
            events.tell(Event::Trouble(why.clone().into()));
        }
        self.length = match Table::read(base).and_then(|table| table.of_finger(finger)) {
            Ok(base) => put_in_force(&base, self.store.as_mut().ok(), self.buffer)
                .await
                .map_err(MemoryError::from),
            Err(why) => Err(MemoryError::NoTable(why)),
        };
        if let Err(why) = &self.length {
            events.tell(Event::Trouble(why.clone().into()));
        }
        self.publish(events);
    }

    fn publish(&self, events: &mut impl Events) {
        if let Ok(table) = self.table() {
            events.table(TableInUse {
                textures: table.textures(),
                bytes: self.in_force().len() as u32,
                crc: table.crc(),
                factory: self.is_factory,
                false_alarm: self.false_alarm,
            });
        }
    }

    /// The bytes of the table in force.
    pub fn in_force(&self) -> &[u8] {
        let length = *self.length.as_ref().unwrap_or(&0);
        self.buffer.get(..length).unwrap_or_default()
    }

    /// The table in force.
    pub fn table(&self) -> Result<Table<'_>, MemoryError> {
        match &self.length {
            Ok(_) => Ok(Table::read(self.in_force())?),
            Err(why) => Err(why.clone()),
        }
    }

    /// The reason why there is no table in force, or another one than was stored last.
    pub fn trouble(&self) -> Option<&MemoryError> {
        self.length.as_ref().err().or(self.instead.as_ref())
    }

    /// The store.
    pub fn store(&mut self) -> Result<&mut Store<F>, MemoryError> {
        self.store.as_mut().map_err(|why| MemoryError::Broken(*why))
    }

    /// Lends the parts that learning needs; [`Memory::reload`] is due after it.
    #[inline(never)]
    pub(super) fn lend(&mut self) -> Result<Lent<'_, F>, MemoryError> {
        let distrusted = self.distrusted;
        let (bytes, _) = base(&mut self.store, &mut self.stored, self.factory, distrusted);
        let base = Table::read(bytes).map_err(MemoryError::NoTable)?;
        let store = self
            .store
            .as_mut()
            .map_err(|why| MemoryError::Broken(*why))?;
        Ok((store, base, self.buffer))
    }

    pub(super) async fn commit(&mut self) -> Result<(), MemoryError> {
        let store = self
            .store
            .as_mut()
            .map_err(|why| MemoryError::Broken(*why))?;
        let finger = self.stored.finger();
        store.commit_table(Some(finger), self.buffer).await?;
        Ok(())
    }

    /// Keeps what the skin has been through: worth keeping, but no reason to fail.
    pub(super) async fn keep_skin(&mut self, skin: &SkinCare) {
        if let Ok(store) = &mut self.store {
            let _ = store.set_skin(skin).await;
        }
    }

    /// Learns from an exploration that the probe is certain of, and reports it. If that fails, the answer of the
    /// exploration still stands.
    pub(super) async fn learn_by_itself(
        &mut self,
        episode: &EpisodeSummary,
        events: &mut impl Events,
    ) {
        let Ok((store, base, buffer)) = self.lend() else {
            return;
        };
        match teach::learn_by_itself(episode, &base, store, buffer).await {
            Ok(Some(learned)) => {
                self.publish(events);
                events.tell(learned);
            }
            Ok(None) => {}
            Err(why) => {
                events.tell(Event::Trouble(Failure::NotLearned(why)));
                self.reload(events).await;
            }
        }
    }

    /// Learns the slides of the last exploration under the user's label, puts the new table in force and reports it.
    /// After an error the exploration can be labelled again, with another name. Errors: the rig has moved since the
    /// exploration; those of [`teach::label`].
    pub async fn label(&mut self, name: &str, events: &mut impl Events) -> Result<(), MemoryError> {
        let episode = self.episode.take().ok_or(MemoryError::NoEpisode)?;
        let (store, base, buffer) = self.lend()?;
        let learned = teach::label(&episode, name, &base, store, buffer).await;
        self.reload(events).await;
        match learned {
            Ok(learned) => {
                events.tell(learned);
                Ok(())
            }
            Err(why) => {
                self.episode = Some(episode);
                Err(why)
            }
        }
    }
}
