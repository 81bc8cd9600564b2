//! What a host asks a probe for, from beginning to end: an exploration, a training. Every step of it is told in the words
//! of [`crate::wire`], so that the host can follow each decision.

use core::fmt;

use embedded_storage_async::nor_flash::NorFlash;
use heapless::Vec;

use crate::explorer::{Config, Explorer, Method, Outlook};
use crate::features::{Plan, Slide};
use crate::fused::{Observation, Vector};
use crate::kernels::Kernels;
use crate::movement::Movement;
use crate::rig::guard::Fault;
use crate::rig::pins::Felt;
use crate::rig::{Event, MAX_REJECTED, Rig, explore};
use crate::store::Store;
use crate::table::{Contents, MAX_MOVEMENTS, Table};
use crate::teaching::forget_stale;
use crate::training::{Training, Wanted};
use crate::up_to;
use crate::wire::{Block, Identify, MAX_OUTLOOK, MAX_TEXTURES, Name, Promise, Tell, Text, Train};

pub use crate::wire::text;

/// Random numbers for choices and for where slides begin (xorshift, Marsaglia 2003); not for secrets.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Random(u32);

impl Random {
    /// A row of numbers.
    pub const fn new(seed: u32) -> Self {
        // 0 would stay 0
        Self(if seed == 0 { 0x9E37_79B9 } else { seed })
    }

    /// The next number.
    pub fn next_u32(&mut self) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        self.0
    }

    /// The next number from 0 to 1, without 1.
    pub fn next_f32(&mut self) -> f32 {
        (self.next_u32() >> 8) as f32 / (1 << 24) as f32
    }
}

/// What an exploration can teach, until the next one begins.
#[derive(Clone, Debug)]
pub struct Visited {
    /// Checksum of the table that was explored with.
    pub table: u32,
    /// The most probable texture.
    pub texture: u16,
    /// Whether the probe may learn from it by itself.
    pub certain: bool,
    /// The movements made, with the number of slides and their whitened mean; none with a table of Gaussians.
    pub felt: Vec<(u8, u8, Vector), MAX_MOVEMENTS>,
}

/// Explores what lies under the finger until there is an answer, which is told; the error is why there is none.
///
/// # Errors
/// The request makes no sense with this table, or the exploration failed: see [`crate::rig::ExploreError`].
pub async fn identify<R, K>(
    wanted: &Identify,
    rig: &mut R,
    table: Table<'_>,
    plan: &Plan,
    mut tell: impl FnMut(Tell),
) -> Result<Visited, Text>
where
    R: Rig,
    R::Error: fmt::Display,
    K: Kernels,
{
    let contents = table.contents();
    let config = Config {
        method: wanted.method.unwrap_or(Method::of(contents)),
        strategy: wanted.strategy,
        threshold: wanted.threshold,
        max_slides: wanted.max_slides,
        open: wanted.open,
    };
    let all = if wanted.among.is_empty() {
        0..table.textures()
    } else {
        0..0
    };
    let candidates = wanted.among.iter().copied().chain(all);
    let mut explorer = Explorer::<'_, MAX_TEXTURES, K>::empty(table);
    explorer
        .consider(rig.measures(), config, candidates)
        .map_err(text)?;
    let mut random = Random::new(wanted.seed);
    let mut slide: u8 = 1;
    let verdict = explore(
        rig,
        &mut explorer,
        plan,
        || random.next_u32(),
        |event| match event {
            Event::Chosen(action, outlook) => {
                if let Some(movement) = table.movement(action.movement) {
                    tell(Tell::Chosen {
                        slide,
                        movement,
                        action,
                        outlook: best(outlook),
                    });
                }
            }
            Event::Felt(action, measurement, posterior) => {
                tell(Tell::Felt {
                    slide,
                    action,
                    felt: measurement.into(),
                    posterior: Vec::from_slice(posterior).unwrap_or_default(),
                });
                slide = slide.saturating_add(1);
            }
            Event::Rejected(_, why) => tell(Tell::Rejected {
                slide,
                why: text(why),
            }),
            Event::Decided {
                verdict,
                slides,
                certain,
            } => tell(Tell::Verdict {
                texture: verdict.texture,
                name: Name::try_from(table.name(verdict.texture).unwrap_or_default())
                    .unwrap_or_default(),
                probability: verdict.probability,
                sure: verdict.sure,
                unknown: verdict.unknown,
                log_odds: verdict.log_odds,
                slides,
                asks: matches!(contents, Contents::Fused(..)) && !certain,
            }),
        },
    )
    .await
    .map_err(text)?;
    Ok(Visited {
        table: table.crc(),
        texture: verdict.texture,
        certain: explorer.is_certain(),
        felt: up_to(explorer.felt()),
    })
}

/// The most useful actions, best first. One after the other, for sorting them all takes the chip 2 KB.
fn best(outlook: &[Outlook]) -> Vec<Promise, MAX_OUTLOOK> {
    let mut best: Vec<Promise, MAX_OUTLOOK> = Vec::new();
    for o in outlook {
        let better = |p: &Promise| p.benefit.total_cmp(&o.benefit).is_ge();
        if best.is_full() {
            if best.last().is_some_and(better) {
                continue;
            }
            best.pop();
        }
        // there is room
        let _ = best.push(Promise {
            action: o.action,
            uncertainty: o.uncertainty,
            benefit: o.benefit,
        });
        let mut rest = best.as_mut_slice();
        while let [.., before, last] = rest
            && !better(before)
        {
            core::mem::swap(before, last);
            (rest, _) = rest.split_at_mut(rest.len().saturating_sub(1));
        }
    }
    best
}

/// Learns the texture under the finger on top of `table`, and goes on where an earlier training of it stopped: every trial
/// is stored at once. In the end the store has a new table, which is to be used from then on. `room` holds a whole table.
///
/// # Errors
/// The texture cannot be learned, see [`crate::training::TrainingError`]; the rig or the store failed; [`MAX_REJECTED`]
/// slides in a row were no good.
pub async fn train<R, F, K>(
    wanted: &Train,
    rig: &mut R,
    store: &mut Store<F>,
    table: Table<'_>,
    plan: &Plan,
    room: &mut [u8],
    mut tell: impl FnMut(Tell),
) -> Result<(), Text>
where
    R: Rig,
    R::Error: fmt::Display,
    F: NorFlash,
    K: Kernels,
{
    let name = wanted.name.as_str();
    let mut training = Training::new(
        Wanted {
            name,
            trials: wanted.trials,
            pilot: wanted.pilot,
            measures: rig.measures(),
        },
        Some(&table),
        Store::<F>::MAX_TABLE.min(room.len()),
    )
    .map_err(text)?;
    let movements: Vec<Movement, MAX_MOVEMENTS> = up_to(training.learned().iter().map(|(m, _)| *m));
    for &movement in &movements {
        let before = store.trained(name, movement, training.table()).await;
        if let Some(lesson) = before.map_err(text)? {
            training.resume(movement, lesson).map_err(text)?;
        }
    }
    let mut rejected = 0;
    while let Some(movement) = training.next() {
        let mut slide = Slide::<K>::new(plan);
        rig.perform(movement, &mut slide).await.map_err(text)?;
        rig.lifted().await.map_err(text)?;
        let felt = match slide.finish() {
            Ok(measurement) => {
                match training.took(Some(&table), movement, &Observation::from(&measurement)) {
                    Ok(trained) => Ok((trained, measurement)),
                    Err(why) => Err(text(why)),
                }
            }
            Err(why) => Err(text(why)),
        };
        match felt {
            Ok((trained, measurement)) => {
                rejected = 0;
                store.set_trained(&trained).await.map_err(text)?;
                tell(Tell::Learned {
                    movement,
                    trial: trained.lesson.trials(),
                    left: training.left(),
                    felt: (&measurement).into(),
                });
            }
            Err(why) => {
                rejected += 1;
                tell(Tell::Rejected {
                    slide: rejected,
                    why,
                });
                if rejected == MAX_REJECTED {
                    return Err(text(Fault::Rejected));
                }
            }
        }
    }
    if training.makes_table() {
        let new = training.encode(Some(&table), room).map_err(text)?;
        let number = new.find(name).map(|texture| new.number(texture));
        let (length, lineage) = (new.as_bytes().len(), new.lineage());
        if table.find(name).is_none() {
            forget_stale(&table, store).await?;
        }
        commit(store, room, length).await?;
        if let Some(number) = number {
            // what the user teaches stands in place of what the probe had taught itself
            let self_taught = store.forget_self_taught(Some((lineage, number))).await;
            self_taught.map_err(text)?;
        }
        // what the table holds now need not be kept beside it
        store.forget_trained(name).await.map_err(text)?;
    }
    Ok(())
}

/// Makes the table at the beginning of `room` the one in use.
pub(crate) async fn commit<F: NorFlash>(
    store: &mut Store<F>,
    room: &mut [u8],
    length: usize,
) -> Result<(), Text> {
    store.begin_table(length).await.map_err(text)?;
    let table = room.get(..length).unwrap_or_default();
    store.write_table(0, table).await.map_err(text)?;
    store.commit_table(room).await.map_err(text)?;
    Ok(())
}

/// The raw samples of one movement on their way to the host, in blocks.
#[derive(Clone, Debug)]
pub struct Blocks {
    block: Block,
}

impl Default for Blocks {
    fn default() -> Self {
        Self {
            block: Self::empty(0, true),
        }
    }
}

impl Blocks {
    const fn empty(number: u16, still: bool) -> Block {
        Block {
            number,
            still,
            steady: None,
            pac: Vec::new(),
            shear_mn: Vec::new(),
            lost: 0,
        }
    }

    /// The block so far, and an empty one in its place.
    fn take(&mut self, still: bool) -> Option<Block> {
        if self.block.pac.is_empty() && self.block.shear_mn.is_empty() {
            self.block.still = still;
            return None;
        }
        let next = Self::empty(self.block.number.wrapping_add(1), still);
        Some(core::mem::replace(&mut self.block, next))
    }

    /// Takes in what a tick felt: at most [`crate::rig::pins::MAX_WORDS`] samples. Gives the block before it, if it is full
    /// or of another kind.
    pub fn put(&mut self, felt: &Felt, pac: &[i16], shear_mn: Option<i16>) -> Option<Block> {
        let still = match felt {
            Felt::Nothing => return None,
            Felt::Still => true,
            Felt::Begin(_) | Felt::Slide => false,
        };
        let full = self.block.pac.len() + pac.len() > self.block.pac.capacity()
            || self.block.shear_mn.is_full();
        let done = if full || still != self.block.still || matches!(felt, Felt::Begin(_)) {
            self.take(still)
        } else {
            None
        };
        if let Felt::Begin(steady) = felt {
            self.block.steady = Some((steady.start, steady.end));
        }
        // there is room for it: the block is empty, or not full
        let _ = self.block.pac.extend_from_slice(pac);
        if let Some(shear_mn) = shear_mn {
            let _ = self.block.shear_mn.push(shear_mn);
        }
        done
    }

    /// The last block; so many samples of the movement were lost.
    pub fn end(mut self, lost: u32) -> Block {
        self.block.lost = lost;
        self.block
    }
}

#[cfg(test)]
mod tests;
