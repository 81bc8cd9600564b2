//! Jobs of the handheld on the table, for the task that owns it.

use embedded_storage_async::nor_flash::NorFlash;

use super::judge::{Judgement, free_name, judge};
use super::states::{Choice, Handheld, Job};
use crate::probe::Memory;
use crate::probe::seams::{Events, StoredBytes};
use crate::store::StoreError;
use crate::table::Name;
use crate::wire::MemoryError;

/// The outcome of a job, for the log.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Outcome<'j> {
    /// So many slides were judged.
    Judged {
        /// Their number.
        slides: usize,
        /// Name of the leading texture, and its probability.
        leading: (&'j str, f32),
        /// The judgement.
        judgement: &'j Judgement,
    },
    /// This texture was learned.
    Learned(&'j Name),
    /// Nothing was learned.
    NotLearned(&'static str),
}

/// Does a job, and gives the handheld its outcome; `log` gets it first.
pub async fn work<F: NorFlash, B: StoredBytes<F>>(
    job: Job,
    handheld: &mut Handheld<'_>,
    memory: &mut Memory<'_, F, B>,
    events: &mut impl Events,
    mut log: impl FnMut(Outcome<'_>),
) {
    match job {
        Job::Judge { slides, reference } => {
            let table = match memory.table() {
                Ok(table) => table,
                Err(why) => return handheld.memory_failed(words(&why)),
            };
            let judged =
                judge(table, &slides, reference, memory.false_alarm).map(|(judgement, episode)| {
                    if let Some((texture, p)) = judgement.leading.first() {
                        log(Outcome::Judged {
                            slides: slides.len(),
                            leading: (table.name(*texture).unwrap_or_default(), *p),
                            judgement: &judgement,
                        });
                    }
                    (judgement, episode)
                });
            match judged {
                Ok((judgement, episode)) => {
                    memory.episode = Some(episode);
                    handheld.judged(Ok(judgement));
                }
                Err(why) => handheld.judged(Err(why)),
            }
        }
        Job::Teach(choice) => {
            let learned = teach(choice, memory, events).await;
            log(match &learned {
                Ok(name) => Outcome::Learned(name),
                Err(why) => Outcome::NotLearned(why),
            });
            let textures = memory.table().map_or(0, |table| table.textures());
            handheld.learned(learned, textures);
        }
    }
}

async fn teach<F: NorFlash, B: StoredBytes<F>>(
    choice: Choice,
    memory: &mut Memory<'_, F, B>,
    events: &mut impl Events,
) -> Result<Name, &'static str> {
    let table = memory.table().map_err(|why| words(&why))?;
    let name = match choice {
        Choice::Known(texture) => {
            Name::try_from(table.name(texture).unwrap_or_default()).unwrap_or_default()
        }
        Choice::Numbered => free_name(&table),
        Choice::Spelled(name) => name,
    };
    if memory.episode.is_none() {
        return Err(words(&MemoryError::NoEpisode));
    }
    let learned = memory.label(&name, events).await;
    learned.map_err(|why| words(&why))?;
    Ok(name)
}

/// The error in the display's four lines of 21 letters; the host gets its parts.
pub fn words(why: &MemoryError) -> &'static str {
    match why {
        MemoryError::NoEpisode => "There is no slide to learn from. Slide first.",
        MemoryError::TableChanged => "The textures changed meanwhile. Slide again.",
        MemoryError::TrainOnly => "This table learns only with a computer.",
        MemoryError::Full | MemoryError::Encode(_) => {
            "The memory is full. Forget a texture with a computer."
        }
        MemoryError::Unknown(_) | MemoryError::Taken(_) | MemoryError::LastTexture => {
            "The textures do not allow that."
        }
        // only a host asks it to learn by itself
        MemoryError::TooFar(_) | MemoryError::CommonShift | MemoryError::NamesNew => {
            "It may have changed. Teach it."
        }
        MemoryError::Store(StoreError::Worn) => "The memory is worn out and keeps nothing new.",
        MemoryError::NoTable(_) | MemoryError::Table(_) => {
            "The textures cannot be read. Load them with a computer."
        }
        MemoryError::StoredTable(_) | MemoryError::Unread => {
            "Your textures are damaged. The built-in ones are in use."
        }
        MemoryError::NewestTable(_) => {
            "Your textures are damaged. Those before the last change are in use."
        }
        MemoryError::Broken(_) | MemoryError::Store(_) => {
            "The memory does not answer. Switch off and on."
        }
    }
}
