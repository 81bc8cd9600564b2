//! What a probe learns from what it felt: by itself where it is certain, from the user's answer where it is not; and how it
//! forgets.
//!
//! Two things are kept apart. What came with the table and what the user taught is in the stored table: every such change
//! writes it anew. What the probe has learned by itself lies beside it in the settings, and is put in place of the table's
//! own means in memory only ([`put_in_force`]); forgetting it gives back the rest to the bit.

use embedded_storage_async::nor_flash::NorFlash;
use heapless::Vec;

use crate::explorer::Visited;
use crate::features::Vector;
use crate::store::{SelfTaught, Store};
use crate::table::Whitened;
use crate::table::{Change, EncodeError, Known, MAX_MOVEMENTS, Table, Tally, amend, retell};
use crate::table::{MAX_TEXTURES, Name};
use crate::up_to;
use crate::wire::{Forget, Tell, Text, text};

/// Copies the stored table into `room`, with what the probe has learned by itself in its place: the table in force. Gives its
/// length.
///
/// # Errors
/// `room` is too small. What cannot be read of the settings is left out.
pub async fn put_in_force<F: NorFlash>(
    base: &Table<'_>,
    store: Option<&mut Store<F>>,
    room: &mut [u8],
) -> Result<usize, EncodeError> {
    let length = base.as_bytes().len();
    let table = room.get_mut(..length).ok_or(EncodeError::Room(length))?;
    // as long: `copy_from_slice` would panic if it were not
    table
        .iter_mut()
        .zip(base.as_bytes())
        .for_each(|(to, from)| *to = *from);
    let Some(store) = store else {
        return Ok(length);
    };
    let mut learned = |record: SelfTaught| {
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
    let _ = store.self_taught(base.lineage(), &mut learned).await;
    Ok(length)
}

/// Learns from a visit that the probe was certain of, into the store and into the table in force in `room`. Gives what there
/// is to tell; `None` where there is nothing to be learned.
///
/// # Errors
/// The store failed; the table in force is as it was.
pub async fn learn_by_itself<F: NorFlash>(
    visited: &Visited,
    store: &mut Store<F>,
    room: &mut [u8],
) -> Result<Option<Tell>, Text> {
    let table = Table::read(room).map_err(text)?;
    if !visited.certain || visited.table != table.crc() {
        return Ok(None);
    }
    let (texture, lineage) = (visited.texture, table.lineage());
    let number = table.number(texture);
    let mut record = SelfTaught {
        lineage,
        number,
        movements: Vec::new(),
    };
    let mut each = |kept: SelfTaught| {
        if kept.number == number {
            record = kept;
        }
    };
    let kept = store.self_taught(lineage, &mut each).await;
    kept.map_err(text)?;
    let mut learned = 0u8;
    for (movement, slides, mean) in &visited.felt {
        let known = table.whitened(texture, *movement);
        if let Some(at) = place(&mut record, *movement, known) {
            adapt(&mut at.2, *slides, mean);
            at.1 = at.1.saturating_add(*slides);
            learned = learned.saturating_add(*slides);
        }
    }
    if learned == 0 {
        return Ok(None);
    }
    let name = Name::try_from(table.name(texture).unwrap_or_default()).unwrap_or_default();
    let before = table.tally(texture);
    let tally = Tally {
        itself: before.itself.saturating_add(learned),
        ..before
    };
    store.set_self_taught(&record).await.map_err(text)?;
    for (movement, _, whitened) in &record.movements {
        retell(room, texture, *movement, whitened, tally).map_err(text)?;
    }
    Ok(Some(Tell::Taught {
        name,
        slides: learned,
        itself: true,
    }))
}

/// The record's entry of a movement; `None` where it has as many as it may have.
fn place(
    record: &mut SelfTaught,
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

/// Takes in so many slides of this mean.
fn adapt(known: &mut Whitened, slides: u8, mean: &Vector) {
    for _ in 0..slides {
        known.adapt(mean);
    }
}

/// Learns from the user's word what lay under the finger in the last exploration: a texture of the table, or a new one. The
/// store has a new table then. `base` is the stored table, `in_force` the one that was explored with; `room` takes the new
/// one, and is to be put in force anew.
///
/// # Errors
/// There is nothing to learn from, the table is full, or the store failed.
pub async fn answer<F: NorFlash>(
    visited: &Visited,
    name: &str,
    base: &Table<'_>,
    store: &mut Store<F>,
    room: &mut [u8],
) -> Result<Tell, Text> {
    let in_force = Table::read(room).map_err(text)?.crc();
    if visited.table != in_force {
        return Err(text(
            "the table has changed since the exploration: explore again",
        ));
    }
    if visited.felt.is_empty() {
        return Err(text("this kind of table learns by `train` only"));
    }
    let known = base.find(name);
    if known.is_none() && usize::from(base.textures()) >= MAX_TEXTURES {
        return Err(text("the table is full: forget a texture first"));
    }
    let mut whitened: Vec<Whitened, MAX_MOVEMENTS> = up_to(
        (0..base.movements().len() as u8)
            .map(|movement| known.map_or(Whitened::default(), |t| base.whitened(t, movement))),
    );
    let mut slides = 0u8;
    for (movement, count, mean) in &visited.felt {
        let Some(at) = whitened.get_mut(usize::from(*movement)) else {
            continue;
        };
        slides = slides.saturating_add(*count);
        if known.is_some() {
            adapt(at, *count, mean);
        } else {
            (0..*count).for_each(|_| at.teach(mean));
        }
    }
    let before = known.map_or(Tally::default(), |texture| base.tally(texture));
    let tally = Tally {
        user: before.user.saturating_add(slides),
        ..before
    };
    if known.is_none() {
        forget_stale(base, store).await?;
    }
    let known_as = Known::Fused(&whitened);
    let put = Change::Put {
        name,
        known: known_as,
        tally,
    };
    change(put, base, store, room).await?;
    if let Some(texture) = known {
        // what the probe had learned by itself goes the same way
        let (lineage, number) = (base.lineage(), base.number(texture));
        let mut record = None;
        let mut each = |kept: SelfTaught| {
            if kept.number == number {
                record = Some(kept);
            }
        };
        let kept = store.self_taught(lineage, &mut each).await;
        kept.map_err(text)?;
        if let Some(mut record) = record {
            for (movement, count, mean) in &visited.felt {
                let of_movement = record.movements.iter_mut().find(|m| m.0 == *movement);
                if let Some((.., whitened)) = of_movement {
                    adapt(whitened, *count, mean);
                }
            }
            store.set_self_taught(&record).await.map_err(text)?;
        }
    }
    Ok(Tell::Taught {
        name: Name::try_from(name).unwrap_or_default(),
        slides,
        itself: false,
    })
}

/// Forgets what a cut may have left of a texture that had the number that the next new one gets.
pub(crate) async fn forget_stale<F: NorFlash>(
    base: &Table<'_>,
    store: &mut Store<F>,
) -> Result<(), Text> {
    let of = Some((base.lineage(), base.next_number()));
    store.forget_self_taught(of).await.map_err(text)
}

/// Stores the table with one change.
async fn change<F: NorFlash>(
    change: Change<'_>,
    base: &Table<'_>,
    store: &mut Store<F>,
    room: &mut [u8],
) -> Result<(), Text> {
    let most = Store::<F>::MAX_TABLE.min(room.len());
    let room = room.get_mut(..most).unwrap_or_default();
    let length = amend(room, base, change).map_err(text)?.as_bytes().len();
    store.replace_table(room, length).await.map_err(text)
}

/// Gives a texture of the stored table another name.
///
/// # Errors
/// There is no such texture, the name is another's, or the store failed.
pub async fn rename<F: NorFlash>(
    from: &str,
    to: &str,
    base: &Table<'_>,
    store: &mut Store<F>,
    room: &mut [u8],
) -> Result<(), Text> {
    let texture = base.find(from).ok_or_else(|| unknown(from))?;
    if base.find(to).is_some() {
        return Err(text(format_args!("there is a texture {to} already")));
    }
    change(Change::Rename { texture, name: to }, base, store, room).await
}

/// Forgets something; a texture out of the stored table.
///
/// # Errors
/// There is no such texture, it is the last one, or the store failed.
pub async fn forget<F: NorFlash>(
    what: &Forget,
    base: &Table<'_>,
    store: &mut Store<F>,
    room: &mut [u8],
) -> Result<(), Text> {
    match what {
        Forget::Texture(name) => {
            let texture = base.find(name).ok_or_else(|| unknown(name))?;
            if base.textures() == 1 {
                return Err(text("a table cannot be without any texture"));
            }
            change(Change::Forget(texture), base, store, room).await?;
            let of = Some((base.lineage(), base.number(texture)));
            store.forget_self_taught(of).await.map_err(text)
        }
        Forget::SelfTaught => store.forget_self_taught(None).await.map_err(text),
        Forget::Training(name) => store.forget_trained(name).await.map_err(text),
    }
}

fn unknown(name: &str) -> Text {
    text(format_args!("there is no texture {name} in the table"))
}

#[cfg(test)]
mod tests;
