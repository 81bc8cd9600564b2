//! A training performed: movement after movement, every trial stored at once.

use core::fmt;

use embedded_storage_async::nor_flash::NorFlash;
use heapless::Vec;

use super::teach::forget_stale;
use super::training::{Training, Wanted};
use crate::dsp::Plan;
use crate::explorer::Kernels;
use crate::features::{Movement, Observation, Slide};
use crate::rig::{Fault, MAX_REJECTED, Rig};
use crate::store::Store;
use crate::table::{MAX_MOVEMENTS, Table};
use crate::up_to;
use crate::wire::{Tell, Text, Train, text};

/// Learns the texture under the finger on top of `table`, and goes on where an earlier training of it stopped: every trial
/// is stored at once. In the end the store has a new table, which is to be used from then on. `room` holds a whole table.
///
/// # Errors
/// The texture cannot be learned, see [`crate::probe::training::TrainingError`]; the rig or the store failed; [`MAX_REJECTED`]
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
        store.replace_table(room, length).await.map_err(text)?;
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
