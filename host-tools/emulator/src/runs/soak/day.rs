//! The day: the core's sessions on the simulated rig, with the store on a flash in RAM.

use std::convert::Infallible;

use embassy_futures::block_on;
use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};
use tactus::collection::{calibrated, texture_name};
use tactus::simulated::{SimError, SimRig};
use tactus_core::features;
use tactus_core::kernels::Plain;
use tactus_core::pressure::SLOTS_HZ;
use tactus_core::rig::skin::SkinCare;
use tactus_core::session::{self, Visited};
use tactus_core::store::{SECTORS, Store, StoreError};
use tactus_core::table::{EncodeError, Table, TableError};
use tactus_core::teaching;
use tactus_core::wire::{Forget, Tell, Text};

use super::visits::{FACTORY, HOMINGS, MOST_N, Plan, Visits, world};

/// Bytes of a sector, as on the chip.
const SECTOR: usize = 16 * 1024;
/// The last exchange with the sensor may end after the tick in which it began, and the world's time with it: by less than a slot.
const SLOT_NS: i64 = 1_000_000_000 / SLOTS_HZ as i64;
/// The power is off for a moment after so many visits.
const RESTARTED_EVERY: u32 = 10;
/// Something is forgotten after so many.
const FORGETS_EVERY: u32 = 15;

/// Why there is no day to judge.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DayError {
    /// The rig.
    #[error("the simulated rig: {0}")]
    Rig(#[from] SimError),
    /// The store.
    #[error("the store: {0}")]
    Store(#[from] StoreError<Infallible>),
    /// The table.
    #[error("the table: {0}")]
    Table(#[from] TableError),
    /// The table in force.
    #[error("the table in force: {0}")]
    Encode(#[from] EncodeError),
    /// The session.
    #[error("at {at_s:.0} s: {why}")]
    Session {
        /// When, virtual s.
        at_s: f64,
        /// What it says.
        why: String,
    },
}

/// What became of a day.
#[derive(Clone, Debug, Default)]
pub struct Day {
    /// Virtual seconds.
    pub virtual_s: f64,
    /// The visits.
    pub visits: Visits,
    /// Slots that were served, and those that the time had.
    pub slots: (u64, u64),
    /// How far the rig's clock is from the world's at the end, ns.
    pub drift_ns: i64,
    /// Most force on the finger, N.
    pub force_max_n: f64,
    /// Times that the store was opened again, and erases of its sectors.
    pub restarts: u32,
    /// See [`Day::restarts`].
    pub erases: u32,
    /// Skins that were worn out.
    pub skins: u32,
    /// What is not as it must be.
    pub missed: Vec<String>,
}

impl Day {
    /// For programs.
    pub fn json(&self) -> Value {
        let mut json = self.visits.json();
        json["virtual_seconds"] = self.virtual_s.into();
        json["slots"] = self.slots.0.into();
        json["slots_due"] = self.slots.1.into();
        json["drift_ns"] = self.drift_ns.into();
        json["force_max_n"] = self.force_max_n.into();
        json["store_opened_again"] = self.restarts.into();
        json["sectors_erased"] = self.erases.into();
        json["skins_worn_out"] = self.skins.into();
        json["missed"] = json!(self.missed);
        json
    }

    /// For people.
    pub fn text(&self) -> String {
        format!(
            "PC rig: {:.2} virtual hours\n  {}\n  slots {} of {}, drift {} ns, force {:.3} N at most; store opened again {} times, \
             {} sectors erased, {} skins worn out",
            self.virtual_s / 3600.0,
            self.visits.text(),
            self.slots.0,
            self.slots.1,
            self.drift_ns,
            self.force_max_n,
            self.restarts,
            self.erases,
            self.skins
        )
    }
}

/// A flash in RAM.
struct Flash {
    bytes: Vec<u8>,
    erases: u32,
}

impl ErrorType for Flash {
    type Error = Infallible;
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = 4;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Infallible> {
        let at = offset as usize;
        bytes.copy_from_slice(&self.bytes[at..at + bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.bytes.len()
    }
}

impl NorFlash for Flash {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Infallible> {
        self.bytes[from as usize..to as usize].fill(0xFF);
        self.erases += (to - from) / SECTOR as u32;
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Infallible> {
        let at = offset as usize;
        // bits are only cleared
        let there = &mut self.bytes[at..at + bytes.len()];
        there.iter_mut().zip(bytes).for_each(|(cell, b)| *cell &= b);
        Ok(())
    }
}

/// What a probe knows, as on the board.
struct Memory {
    store: Store<Flash>,
    room: Vec<u8>,
    base: Vec<u8>,
    length: usize,
    base_length: usize,
}

impl Memory {
    fn open(flash: Flash) -> Result<Self, DayError> {
        let mut memory = Self {
            store: block_on(Store::open(flash))?,
            room: vec![0; SECTOR],
            base: vec![0; SECTOR],
            length: 0,
            base_length: 0,
        };
        memory.reload()?;
        Ok(memory)
    }

    /// Puts the table in force.
    fn reload(&mut self) -> Result<(), DayError> {
        let stored = block_on(self.store.read_table(&mut self.base))?;
        self.base_length = match stored {
            Some(table) => table.as_bytes().len(),
            None => {
                self.base[..FACTORY.len()].copy_from_slice(FACTORY);
                FACTORY.len()
            }
        };
        let base = Table::read(&self.base[..self.base_length])?;
        let in_force = teaching::put_in_force(&base, Some(&mut self.store), &mut self.room);
        self.length = block_on(in_force)?;
        Ok(())
    }

    fn table(&self) -> Result<Table<'_>, TableError> {
        Table::read(&self.room[..self.length])
    }

    /// Learns from the user's word.
    fn answer(&mut self, visited: &Visited, name: &str) -> Result<Result<(), Text>, DayError> {
        let base = Table::read(&self.base[..self.base_length])?;
        let (store, room) = (&mut self.store, &mut self.room);
        let answered = block_on(teaching::answer(visited, name, &base, store, room));
        self.reload()?;
        Ok(answered.map(|_| ()))
    }

    fn forget(&mut self, what: &Forget) -> Result<Result<(), Text>, DayError> {
        let base = Table::read(&self.base[..self.base_length])?;
        let (store, room) = (&mut self.store, &mut self.room);
        let forgotten = block_on(teaching::forget(what, &base, store, room));
        self.reload()?;
        Ok(forgotten)
    }

    fn skin(&mut self) -> Result<SkinCare, DayError> {
        Ok(block_on(self.store.skin())?)
    }
}

/// Visits texture after texture for so many virtual seconds; `each` hears of the time.
///
/// # Errors
/// See [`DayError`].
pub fn day(virtual_s: f64, seed: u64, mut each: impl FnMut(f64)) -> Result<Day, DayError> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let setup = world().setup(1, 1 + seed);
    let mut rig = SimRig::new(setup);
    let calibration = calibrated(setup)?;
    rig.control()
        .calibrate(calibration)
        .map_err(SimError::from)?;
    rig.home()?;
    let mut memory = Memory::open(Flash {
        bytes: vec![0xFF; SECTORS * SECTOR],
        erases: 0,
    })?;
    block_on(memory.store.set_calibration(&calibration))?;
    let plan = features::Plan::new();
    let mut day = Day::default();
    while rig.now().as_secs_f64() < virtual_s {
        day.visits.made += 1;
        visit(
            &mut day,
            &mut rig,
            &mut memory,
            &plan,
            Plan::draw(&mut random),
        )?;
        if day.visits.made.is_multiple_of(FORGETS_EVERY) {
            let table = memory.table()?;
            let texture = random.random_range(0..table.textures());
            let name = table.name(texture).unwrap_or_default();
            let what = if random.random_range(0..3) == 0 {
                Forget::SelfTaught
            } else {
                Forget::Texture(name.try_into().unwrap_or_default())
            };
            match memory.forget(&what)? {
                Ok(()) => day.visits.forgotten += 1,
                Err(why) => day.missed.push(format!("{what:?}: {why}")),
            }
        }
        if day.visits.made.is_multiple_of(RESTARTED_EVERY) {
            memory = restarted(memory, &mut day)?;
        }
        each(rig.now().as_secs_f64());
    }
    day.virtual_s = rig.now().as_secs_f64();
    let now_ns = rig.now().as_nanos();
    day.slots = (
        rig.slots(),
        (now_ns * u128::from(SLOTS_HZ)).div_ceil(1_000_000_000) as u64,
    );
    day.drift_ns = (now_ns as i128 - i128::from(rig.world().now_ns())) as i64;
    day.force_max_n = day.force_max_n.max(rig.world().truth().force_max_n);
    day.erases = memory.store.close().erases;
    if day.slots.0 != day.slots.1 {
        let (served, due) = day.slots;
        day.missed.push(format!("{served} slots of {due}"));
    }
    if day.drift_ns.abs() >= SLOT_NS {
        day.missed.push(format!("clock off by {} ns", day.drift_ns));
    }
    if day.force_max_n > MOST_N {
        day.missed.push(format!("{:.3} N", day.force_max_n));
    }
    Ok(day)
}

/// An exploration, and what is learned from it.
fn visit(
    day: &mut Day,
    rig: &mut SimRig,
    memory: &mut Memory,
    plan: &features::Plan,
    drawn: Plan,
) -> Result<(), DayError> {
    if rig.place(drawn.texture).is_err() {
        // a thick sample, and a finger that is not all the way up
        recover(day, rig)?;
        rig.place(drawn.texture)?;
    }
    // a slide begins the world's maximum anew
    day.force_max_n = day.force_max_n.max(rig.world().truth().force_max_n);
    let began_ns = rig.now().as_nanos() as u64;
    if let Some((at_ns, fault)) = drawn.fault {
        rig.world().schedule(began_ns + at_ns, fault);
    }
    let truth = texture_name(drawn.texture);
    let known = memory.table()?.find(truth).is_some();
    let mut verdict = None;
    let mut rejected = Vec::new();
    let done = block_on(session::identify::<_, Plain>(
        &drawn.identify,
        rig,
        memory.table()?,
        plan,
        |tell| match tell {
            Tell::Verdict {
                name,
                unknown,
                sure,
                ..
            } => verdict = Some((name, unknown, sure)),
            Tell::Rejected { why, .. } => rejected.push(why),
            _ => {}
        },
    ));
    let at_s = rig.now().as_secs_f64();
    day.force_max_n = day.force_max_n.max(rig.world().truth().force_max_n);
    for slide in rig.take_performed() {
        day.force_max_n = day.force_max_n.max(slide.force_max_n);
    }
    let came = drawn
        .fault
        .filter(|(at_ns, _)| began_ns + at_ns <= rig.now().as_nanos() as u64);
    match (came, &done) {
        (Some((_, fault)), done) => day.visits.broke(fault, done.is_err()),
        (None, Ok(_)) => {
            let sure = verdict.as_ref().is_some_and(|(_, _, sure)| *sure);
            let found = verdict.filter(|(_, unknown, _)| !unknown);
            let found = found.as_ref().map(|(name, ..)| name.as_str());
            day.visits.judge(at_s, truth, known, found, sure);
        }
        (None, Err(why)) => day.missed.push(format!("{at_s:.0} s: {truth}: {why}")),
    }
    if came.is_none() {
        let rejected = rejected
            .iter()
            .map(|why| format!("{at_s:.0} s: {truth}: {why}"));
        day.visits.rejected.extend(rejected);
    }
    if drawn.fault.is_some() || done.is_err() {
        recover(day, rig)?;
    }
    block_on(memory.store.set_skin(rig.control().skin()))?;
    if let Ok(visited) = done
        && came.is_none()
    {
        learn(day, memory, &drawn, &visited, truth, at_s)?;
    }
    if rig.control().skin().is_worn() {
        recover(day, rig)?;
        if rig.world().replace_skin().is_ok() {
            rig.control().skin().replaced();
            day.skins += 1;
        }
    }
    Ok(())
}

fn learn(
    day: &mut Day,
    memory: &mut Memory,
    drawn: &Plan,
    visited: &Visited,
    truth: &str,
    at_s: f64,
) -> Result<(), DayError> {
    let failed = |why: Text| DayError::Session {
        at_s,
        why: why.as_str().to_owned(),
    };
    if drawn.answer {
        memory.answer(visited, truth)?.map_err(failed)?;
        day.visits.taught.0 += 1;
    } else if drawn.identify.learn {
        let (store, room) = (&mut memory.store, &mut memory.room);
        let learned = block_on(teaching::learn_by_itself(visited, store, room));
        day.visits.taught.1 += u32::from(learned.map_err(failed)?.is_some());
    }
    Ok(())
}

/// Repairs the rig and has it find its switches.
fn recover(day: &mut Day, rig: &mut SimRig) -> Result<(), DayError> {
    rig.world().clear();
    let mut last = None;
    for _ in 0..HOMINGS {
        // it may still be lifting
        let _ = rig.rest(|_| ());
        // refused where there is no fault
        let _ = rig.control().reset();
        match rig.home() {
            Ok(()) => return Ok(()),
            Err(why) => last = Some(why),
        }
    }
    day.missed
        .extend(last.map(|why| format!("the rig does not home: {why}")));
    Ok(last.map_or(Ok(()), Err)?)
}

/// The power is off for a moment: all that was stored is there.
fn restarted(mut memory: Memory, day: &mut Day) -> Result<Memory, DayError> {
    let skin = memory.skin()?;
    let calibration = block_on(memory.store.calibration())?;
    let in_force = memory.room[..memory.length].to_vec();
    let mut memory = Memory::open(memory.store.close())?;
    day.restarts += 1;
    if memory.room[..memory.length] != in_force {
        day.missed
            .push(format!("restart {}: another table", day.restarts));
    }
    if block_on(memory.store.calibration())? != calibration || memory.skin()? != skin {
        day.missed
            .push(format!("restart {}: other settings", day.restarts));
    }
    Ok(memory)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn minutes_of_a_day_are_as_they_must_be() {
        let day = day(400.0, 5, |_| ()).unwrap();
        eprintln!("{}\n{:?}", day.text(), day.visits);
        assert_eq!(day.missed, [""; 0]);
        assert!(day.visits.sound > 5 && day.visits.broken().came > 0);
        let (known, right) = day.visits.known;
        assert!(right * 10 >= known * 9);
    }

    #[test]
    fn a_restart_notices_what_the_flash_lost() {
        let flash = Flash {
            bytes: vec![0xFF; SECTORS * SECTOR],
            erases: 0,
        };
        let mut memory = Memory::open(flash).unwrap();
        block_on(memory.store.set_skin(&SkinCare::after(1.0, 1.0))).unwrap();
        let mut day = Day::default();
        let mut memory = restarted(memory, &mut day).unwrap();
        assert_eq!(day.missed, [""; 0]);
        // the table in force is not what the store has
        memory.room[20] ^= 1;
        restarted(memory, &mut day).unwrap();
        assert_eq!(day.missed, ["restart 2: another table"]);
    }
}
