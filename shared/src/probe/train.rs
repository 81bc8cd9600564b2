//! A training performed: movement after movement, every trial stored at once.

use embedded_storage_async::nor_flash::NorFlash;
use heapless::Vec;

use super::identify::clipped;
use super::memory::Lent;
use super::teach::delete_stale;
use super::training::{Training, Wanted};
use crate::dsp::Plan;
use crate::features::{Measurement, Movement, Observation, Slide};
use crate::rig::{MAX_REJECTED, Refused, Rig, RigError};
use crate::store::{Store, TrainingRecord};
use crate::table::{MAX_MOVEMENTS, Table};
use crate::up_to;
use crate::wire::{Event, Failure, Rejection, Train};

/// Learns the texture under the finger on top of `table`, and goes on where an earlier training of it stopped: every
/// trial is stored at once. In the end the store has a new table, which is to be used from then on. `buffer` holds a
/// whole table. Errors: the texture cannot be learned, see [`crate::wire::TrainingError`]; the rig does not press as
/// hard as one of the movements; the rig or the store failed; [`MAX_REJECTED`] slides in a row were no good.
pub async fn train<R, F>(
    wanted: &Train,
    rig: &mut R,
    (store, table, buffer): Lent<'_, F>,
    plan: &Plan,
    mut tell: impl FnMut(Event),
) -> Result<(), Failure>
where
    R: Rig<Error = RigError>,
    F: NorFlash,
{
    let name = wanted.name.as_str();
    let mut training = Training::new(
        Wanted {
            name,
            trials: wanted.trials,
            pilot: wanted.pilot,
            measures: rig.measures(),
            most_mn: rig.most_mn(),
        },
        Some(&table),
        Store::<F>::MAX_TABLE.min(buffer.len()),
    )?;
    let movements: Vec<Movement, MAX_MOVEMENTS> = up_to(training.learned().iter().map(|(m, _)| *m));
    let mut forces = movements.iter().map(|movement| movement.force_mn());
    if let Some(force_mn) = forces.find(|mn| *mn > rig.most_mn()) {
        return Err(Failure::Rig(Refused::Force(force_mn).into()));
    }
    for &movement in &movements {
        let before = store
            .training_record(name, movement, training.table())
            .await;
        if let Some(stats) = before? {
            training.resume(movement, stats)?;
        }
    }
    let mut rejected = 0;
    while let Some(movement) = training.next() {
        let mut slide = Slide::new(plan, movement);
        let made = match rig.perform(&mut slide).await {
            Ok(()) => rig.lifted().await,
            failed => failed,
        };
        let measured = match made {
            Err(why) if !rig.recover(&why).await => return Err(Failure::Rig(why)),
            Err(why) => Err(Rejection::Rig(why)),
            Ok(()) => take(&mut training, &table, &mut slide),
        };
        match measured {
            Ok((training_record, measurement)) => {
                rejected = 0;
                clipped(&measurement).map(&mut tell);
                store.set_training_record(&training_record).await?;
                tell(Event::TrainingSlide {
                    movement,
                    trial: training_record.stats.trials(),
                    left: training.left(),
                    observed: (&measurement).into(),
                });
            }
            Err(why) => {
                rejected += 1;
                tell(Event::Rejected {
                    slide: rejected,
                    why: Failure::Slide(why),
                });
                if rejected == MAX_REJECTED {
                    return Err(Failure::Rejected);
                }
            }
        }
    }
    if training.makes_table() {
        keep(&training, (store, table, buffer)).await?;
    }
    Ok(())
}

async fn keep<F: NorFlash>(
    training: &Training,
    (store, table, buffer): Lent<'_, F>,
) -> Result<(), Failure> {
    let new = training.encode(Some(&table), buffer)?;
    let number = new.find(training.name()).map(|texture| new.number(texture));
    let (length, lineage) = (new.as_bytes().len(), new.lineage());
    if table.find(training.name()).is_none() {
        delete_stale(&table, store).await?;
    }
    store.replace_table(buffer, length).await?;
    if let Some(number) = number {
        // the user's training replaces what the probe had learned by itself
        store.delete_self_learned(Some((lineage, number))).await?;
    }
    // what the table holds now need not be kept beside it
    store.delete_training_records(training.name()).await?;
    Ok(())
}

fn take(
    training: &mut Training,
    table: &Table<'_>,
    slide: &mut Slide<'_>,
) -> Result<(TrainingRecord, Measurement), Rejection> {
    let movement = slide.movement();
    let measurement = slide.finish().map_err(Rejection::Slide)?;
    let record = training
        .took(Some(table), movement, &Observation::from(&measurement))
        .map_err(Rejection::Training)?;
    Ok((record, measurement))
}
