//! What a probe learns from its slides, by itself where it is certain and from the user's label where it is not; and
//! how it deletes what it learned.
//!
//! Two things are kept apart. The stored table holds what came with it and what the probe learned from the user; every
//! such change writes the table anew. What the probe has learned by itself lies beside it in the settings, and replaces
//! the table's own means in memory only ([`put_in_force`]); deleting it restores the table to the bit.

use embedded_storage_async::nor_flash::NorFlash;
use heapless::Vec;

use crate::explorer::EpisodeSummary;
use crate::features::Vector;
use crate::store::{SelfLearnedRecord, Store, StoreError};
use crate::table::Whitened;
use crate::table::{Change, EncodeError, MAX_MOVEMENTS, Table, Tally, TextureStats, amend, retell};
use crate::table::{MAX_TEXTURES, Name};
use crate::up_to;
use crate::wire::{Event, Forget, MemoryError, TextureLearned};

/// Copies the stored table into `buffer`, with what the probe has learned by itself in its place: the table in force.
/// Returns its length.
/// Errors: `buffer` is too small. What cannot be read of the settings is left out.
pub async fn put_in_force<F: NorFlash>(
    base: &Table<'_>,
    store: Option<&mut Store<F>>,
    buffer: &mut [u8],
) -> Result<usize, EncodeError> {
    let length = base.as_bytes().len();
    let table = buffer
        .get_mut(..length)
        .ok_or(EncodeError::NoSpace(length))?;
    // as long: `copy_from_slice` would panic if it were not
    table
        .iter_mut()
        .zip(base.as_bytes())
        .for_each(|(to, from)| *to = *from);
    let Some(store) = store else {
        return Ok(length);
    };
    let mut learned = |record: SelfLearnedRecord| {
        let Some(texture) = base.numbered(record.number) else {
            return;
        };
        let slides = record.movements.iter().map(|(_, slides, _)| *slides);
        let tally = Tally {
            itself: slides.fold(0, u8::saturating_add),
            ..base.tally(texture)
        };
        for (movement, _, whitened) in &record.movements {
            // a movement that the table does not have is left out
            let _ = retell(table, texture, *movement, whitened, tally);
        }
    };
    // settings that cannot be read have nothing to say
    let _ = store.self_learned(base.lineage(), &mut learned).await;
    Ok(length)
}

/// Learns from an episode that the probe was certain of, into the store and into the table in force in `buffer`; `base`
/// is the stored table, which a person taught. Returns the event to send; `None` where there is nothing to learn.
/// Errors: the table names too many new textures, the texture has shifted too far, or many have shifted the same way
/// ([`shift`]), or the store failed; the table in force is as it was.
pub(crate) async fn learn_by_itself<F: NorFlash>(
    episode: &EpisodeSummary,
    base: &Table<'_>,
    store: &mut Store<F>,
    buffer: &mut [u8],
) -> Result<Option<Event>, MemoryError> {
    let table = Table::read_first(buffer)?;
    if table.open_set().is_some_and(|of| !of.may_learn()) {
        return Err(MemoryError::NamesNew);
    }
    if !episode.certain || episode.table != table.crc() {
        return Ok(None);
    }
    let (texture, lineage) = (episode.texture, table.lineage());
    let number = table.number(texture);
    let mut record = SelfLearnedRecord {
        lineage,
        number,
        movements: Vec::new(),
    };
    let mut each = |kept: SelfLearnedRecord| {
        if kept.number == number {
            record = kept;
        }
    };
    store.self_learned(lineage, &mut each).await?;
    let mut learned = 0u8;
    for (movement, slides, mean) in observed(episode, &table, Some(texture)) {
        let known = table.whitened(texture, movement);
        if let Some(at) = place(&mut record, movement, known) {
            adapt(&mut at.2, slides, &mean);
            at.1 = at.1.saturating_add(slides);
            learned = learned.saturating_add(slides);
        }
    }
    if learned == 0 {
        return Ok(None);
    }
    let name = name_of(table.name(texture).unwrap_or_default());
    if shift::is_too_far(base, texture, &record) {
        return Err(MemoryError::TooFar(name));
    }
    // all that this episode made, one movement after the other
    for (movement, ..) in &record.movements {
        let mut common = shift::CommonShift::at(*movement);
        common.take(base, &record);
        let mut each = |kept: SelfLearnedRecord| {
            if kept.number != number {
                common.take(base, &kept);
            }
        };
        store.self_learned(lineage, &mut each).await?;
        if common.is_no_chance() {
            return Err(MemoryError::CommonShift);
        }
    }
    let before = table.tally(texture);
    let tally = Tally {
        itself: before.itself.saturating_add(learned),
        ..before
    };
    store.set_self_learned(&record).await?;
    for (movement, _, whitened) in &record.movements {
        retell(buffer, texture, *movement, whitened, tally)?;
    }
    Ok(Some(Event::TextureLearned(TextureLearned {
        name,
        slides: learned,
        itself: true,
    })))
}

/// What was observed in an episode, as it is learned if the texture is this one of the table, or a new one: at the
/// movement's speed.
fn observed<'a>(
    episode: &'a EpisodeSummary,
    table: &'a Table<'_>,
    texture: Option<u16>,
) -> impl Iterator<Item = (u8, u8, Vector)> + 'a {
    let paces = episode.paces.iter().copied().chain(core::iter::repeat(0));
    let observed = episode.observed.iter().zip(paces);
    observed.map(move |((movement, slides, mean), pace)| {
        let mean = table.at_movement_speed(texture, *movement, mean, pace);
        (*movement, *slides, mean)
    })
}

/// The record's entry of a movement; `None` where it has as many as it may have.
fn place(
    record: &mut SelfLearnedRecord,
    movement: u8,
    known: Whitened,
) -> Option<&mut (u8, u8, Whitened)> {
    let at = match record.movements.iter().position(|m| m.0 == movement) {
        Some(at) => at,
        None => {
            record.movements.push((movement, 0, known)).ok()?;
            record.movements.len() - 1
        }
    };
    record.movements.get_mut(at)
}

fn adapt(known: &mut Whitened, slides: u8, mean: &Vector) {
    for _ in 0..slides {
        known.adapt(mean);
    }
}

/// Learns from the user's word what lay under the finger in the last exploration: a texture of the table, or a new one.
/// The store has a new table then. `base` is the stored table, `in_force` the one that was explored with; `buffer`
/// takes the new one, and is to be put in force anew. Errors: there is nothing to learn from, the table is full, or the
/// store failed.
pub async fn label<F: NorFlash>(
    episode: &EpisodeSummary,
    name: &str,
    base: &Table<'_>,
    store: &mut Store<F>,
    buffer: &mut [u8],
) -> Result<Event, MemoryError> {
    let in_force = Table::read_first(buffer)?.crc();
    if episode.table != in_force {
        return Err(MemoryError::TableChanged);
    }
    if episode.observed.is_empty() {
        return Err(MemoryError::TrainOnly);
    }
    let known = base.find(name);
    if known.is_none() && usize::from(base.textures()) >= MAX_TEXTURES {
        return Err(MemoryError::Full);
    }
    let mut whitened: Vec<Whitened, MAX_MOVEMENTS> = up_to(
        (0..base.movements().len() as u8)
            .map(|movement| known.map_or(Whitened::default(), |t| base.whitened(t, movement))),
    );
    let mut slides = 0u8;
    for (movement, count, mean) in observed(episode, base, known) {
        let Some(at) = whitened.get_mut(usize::from(movement)) else {
            continue;
        };
        slides = slides.saturating_add(count);
        if known.is_some() {
            adapt(at, count, &mean);
        } else {
            (0..count).for_each(|_| at.teach(&mean));
        }
    }
    let before = known.map_or(Tally::default(), |texture| base.tally(texture));
    let tally = Tally {
        user: before.user.saturating_add(slides),
        ..before
    };
    if known.is_none() {
        delete_stale(base, store).await?;
    }
    let known_as = TextureStats::Fused(&whitened);
    let put = Change::Put {
        name,
        known: known_as,
        tally,
    };
    change(put, base, store, buffer).await?;
    if let Some(texture) = known {
        // what the probe had learned by itself goes the same way
        let (lineage, number) = (base.lineage(), base.number(texture));
        let mut record = None;
        let mut each = |kept: SelfLearnedRecord| {
            if kept.number == number {
                record = Some(kept);
            }
        };
        store.self_learned(lineage, &mut each).await?;
        if let Some(mut record) = record {
            for (movement, count, mean) in observed(episode, base, known) {
                let of_movement = record.movements.iter_mut().find(|m| m.0 == movement);
                if let Some((.., whitened)) = of_movement {
                    adapt(whitened, count, &mean);
                }
            }
            store.set_self_learned(&record).await?;
        }
    }
    Ok(Event::TextureLearned(TextureLearned {
        name: name_of(name),
        slides,
        itself: false,
    }))
}

/// Deletes what a power cut may have left of an earlier texture whose number the next new texture gets.
pub(crate) async fn delete_stale<F: NorFlash>(
    base: &Table<'_>,
    store: &mut Store<F>,
) -> Result<(), StoreError> {
    let of = Some((base.lineage(), base.next_number()));
    store.delete_self_learned(of).await
}

async fn change<F: NorFlash>(
    change: Change<'_>,
    base: &Table<'_>,
    store: &mut Store<F>,
    buffer: &mut [u8],
) -> Result<(), MemoryError> {
    let most = Store::<F>::MAX_TABLE.min(buffer.len());
    let buffer = buffer.get_mut(..most).unwrap_or_default();
    let length = amend(buffer, base, change)?.as_bytes().len();
    store.replace_table(buffer, length).await?;
    Ok(())
}

/// Gives a texture of the stored table another name.
/// Errors: there is no such texture, the name is another's, or the store failed.
pub async fn rename<F: NorFlash>(
    from: &str,
    to: &str,
    base: &Table<'_>,
    store: &mut Store<F>,
    buffer: &mut [u8],
) -> Result<(), MemoryError> {
    let texture = base
        .find(from)
        .ok_or_else(|| MemoryError::Unknown(name_of(from)))?;
    if base.find(to).is_some() {
        return Err(MemoryError::Taken(name_of(to)));
    }
    change(Change::Rename { texture, name: to }, base, store, buffer).await
}

/// Deletes a texture from the stored table, what the probe learned by itself, or an unfinished training.
/// Errors: there is no such texture, it is the last one, or the store failed.
pub async fn delete<F: NorFlash>(
    what: &Forget,
    base: &Table<'_>,
    store: &mut Store<F>,
    buffer: &mut [u8],
) -> Result<(), MemoryError> {
    match what {
        Forget::Texture(name) => {
            let texture = base
                .find(name)
                .ok_or_else(|| MemoryError::Unknown(name_of(name)))?;
            if base.textures() == 1 {
                return Err(MemoryError::LastTexture);
            }
            change(Change::Forget(texture), base, store, buffer).await?;
            let of = Some((base.lineage(), base.number(texture)));
            store.delete_self_learned(of).await?;
        }
        Forget::SelfLearned => store.delete_self_learned(None).await?,
        Forget::Training(name) => store.delete_training_records(name).await?,
    }
    Ok(())
}

fn name_of(name: &str) -> Name {
    Name::try_from(name).unwrap_or_default()
}

mod shift;
#[cfg(test)]
mod tests;
