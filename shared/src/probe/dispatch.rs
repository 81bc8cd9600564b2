//! Every request, once: what is answered at any time, what waits for its turn, what is refused because the probe is
//! busy; and what is done when its turn has come.

use core::pin::pin;

use embedded_storage_async::nor_flash::NorFlash;

use super::memory::Memory;
use super::seams::{Events, Panel, RigHandle, StoredBytes};
use super::{Identification, calibrate, identify, teach, train, transfer};
use crate::dsp::Plan;
use crate::explorer::Answer;
use crate::rig::Phase;
use crate::rig::calibration::RigCalibration;
use crate::table::is_false_alarm;
use crate::wire::{Command, Event, Failure, Identify, Request, Status};

/// When a request is dealt with.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Turn {
    /// At once, whatever the probe is busy with.
    Now,
    /// It is queued: the probe has nothing else to do.
    Queue,
    /// Never: the probe has something else to do.
    Busy,
}

/// When this is dealt with by a probe that is busy with something else, or is not.
pub const fn turn(command: &Command, busy: bool) -> Turn {
    match command {
        Command::Status | Command::Stop | Command::Stream(_) | Command::ReadCalibration => {
            Turn::Now
        }
        Command::Arm(_) => Turn::Now,
        _ if busy => Turn::Busy,
        _ => Turn::Queue,
    }
}

/// True if this may erase a sector of the flash as often as a host asks for it: what takes its time between, as a
/// training, does not.
const fn may_erase(command: &Command) -> bool {
    matches!(
        command,
        Command::Label(_)
            | Command::Rename { .. }
            | Command::Forget(_)
            | Command::WriteCalibration(_)
            | Command::BeginTable(_)
            | Command::FactoryTable
            | Command::SetFalseAlarm(_)
            | Command::SetHighForce(_)
    )
}

/// Deals with a request that has just come: answers it, refuses it, or gives back that it is to be queued for
/// [`Probe::perform`]. `busy`: a request is queued or being worked on.
pub fn receive(request: &Request, busy: bool, panel: &mut impl Panel) -> Turn {
    let id = request.id;
    let turn = turn(&request.command, busy);
    match turn {
        Turn::Queue => return turn,
        Turn::Busy => panel.tell(Event::Refused {
            id,
            why: Failure::Busy,
        }),
        Turn::Now => {
            match request.command {
                Command::Status => panel.tell(Event::Status(status(panel))),
                Command::Stop => panel.stop(busy),
                Command::Stream(on) => panel.stream(on),
                Command::Arm(report) if !panel.arm(report) => {
                    let why = Failure::OtherProbe;
                    panel.tell(Event::Refused { id, why });
                    return turn;
                }
                Command::Arm(_) => {}
                _ => panel.tell(told(&panel.rig().calibration)),
            }
            panel.tell(Event::Done(id));
        }
    }
    turn
}

fn status(panel: &impl Panel) -> Status {
    let (rig, table) = (panel.rig(), panel.table());
    Status {
        phase: rig.phase.into(),
        fault: match rig.phase {
            Phase::Faulted(fault) => Some(fault),
            _ => None,
        },
        textures: table.textures,
        table_bytes: table.bytes,
        table_crc: table.crc,
        factory: table.factory,
        calibrated: rig.calibration.scale_day().unwrap_or(0),
        counts: panel.counts(),
        skin_mj: (
            (rig.skin.energy_j() * 1e3) as u32,
            (rig.skin.wear_j() * 1e3) as u32,
        ),
        false_alarm: table.false_alarm,
        high_force: rig.high_force,
        finger: panel.finger(),
    }
}

fn told(calibration: &RigCalibration) -> Event {
    Event::Calibration(calibration.to_bytes())
}

/// A probe: a rig and a memory, and who hears of them.
pub struct Probe<'m, R, F, B, E> {
    /// The rig.
    pub rig: R,
    /// Its memory.
    pub memory: Memory<'m, F, B>,
    /// Who hears what it does.
    pub events: E,
    /// The coefficients of every slide.
    pub plan: &'m Plan,
}

impl<R, F, B, E> Probe<'_, R, F, B, E>
where
    R: RigHandle,
    F: NorFlash,
    B: StoredBytes<F>,
    E: Events,
{
    /// Does what was asked for, as [`turn`] had it queued, and says that it is done or why it is not.
    pub async fn serve(&mut self, request: &Request) {
        let done = self.perform(&request.command).await.map(|_| ());
        self.answer(request.id, done);
    }

    pub(crate) fn answer(&mut self, id: u16, done: Result<(), Failure>) {
        self.events.tell(match done {
            Ok(()) => Event::Done(id),
            Err(why) => Event::Refused { id, why },
        });
    }

    /// Does what was asked for; an exploration has a result.
    pub async fn perform(&mut self, command: &Command) -> Result<Option<Identification>, Failure> {
        if may_erase(command) {
            self.memory.may_erase()?;
        }
        let done = self.do_it(command).await;
        self.memory.count_erasures(&mut self.events);
        done
    }

    async fn do_it(&mut self, command: &Command) -> Result<Option<Identification>, Failure> {
        match command {
            Command::Identify(wanted) => return self.identify(wanted, false).await.map(Some),
            Command::Verify(wanted) => return self.identify(wanted, true).await.map(Some),
            Command::Label(name) => self.memory.label(name, &mut self.events).await?,
            Command::Train(_) | Command::Rename { .. } | Command::Forget(_) => {
                self.learn(command).await?;
            }
            Command::ReadTable(_)
            | Command::BeginTable(_)
            | Command::WriteTable { .. }
            | Command::CommitTable
            | Command::FactoryTable
            | Command::SetFalseAlarm(_) => self.transfer(command).await?,
            _ => self.use_rig(command).await?,
        }
        Ok(None)
    }

    async fn identify(
        &mut self,
        wanted: &Identify,
        verify: bool,
    ) -> Result<Identification, Failure> {
        let Self {
            rig,
            memory,
            events,
            plan,
        } = self;
        if verify {
            events.go(false);
        }
        memory.episode = None;
        rig.begin(wanted.seed).await;
        let table = memory.table()?;
        let mut config = wanted.config(table.contents());
        config.verify = verify;
        config.false_alarm = config.false_alarm.or(memory.false_alarm);
        let tell = |event| events.tell(event);
        // awaited where it lies: moving it would take its size of the stack, twice
        let done = pin!(identify(wanted, config, rig, table, plan, tell)).await;
        memory.keep_skin(&rig.state().skin).await;
        let (episode, found) = done?;
        if verify {
            let same = found.answer == Some(Answer::Same);
            events.go(same);
        } else if wanted.learn {
            memory.learn_by_itself(&episode, events).await;
        }
        memory.episode = Some(episode);
        Ok(found)
    }

    async fn learn(&mut self, command: &Command) -> Result<(), Failure> {
        let Self {
            rig,
            memory,
            events,
            plan,
        } = self;
        if let Command::Train(wanted) = command {
            memory.episode = None;
            rig.begin(wanted.seed).await;
        }
        let (store, base, buffer) = memory.lend()?;
        let done = match command {
            Command::Rename { from, to } => {
                let done = teach::rename(from, to, &base, store, buffer).await;
                done.map_err(Failure::from)
            }
            Command::Forget(what) => {
                let done = teach::delete(what, &base, store, buffer).await;
                done.map_err(Failure::from)
            }
            Command::Train(wanted) => {
                let tell = |event| events.tell(event);
                train(wanted, rig, (store, base, buffer), plan, tell).await
            }
            _ => Ok(()),
        };
        memory.reload(events).await;
        if let Command::Train(_) = command {
            memory.keep_skin(&rig.state().skin).await;
        }
        done
    }

    async fn transfer(&mut self, command: &Command) -> Result<(), Failure> {
        let Self { memory, events, .. } = self;
        let done: Result<(), Failure> = match command {
            Command::ReadTable(offset) => {
                let part = transfer::read(memory.in_force(), *offset);
                events.tell(part.ok_or(Failure::NoSuchByte)?);
                return Ok(());
            }
            Command::BeginTable(length) => {
                return Ok(memory.store()?.begin_table(*length as usize).await?);
            }
            Command::WriteTable { offset, bytes } => {
                return Ok(transfer::write(memory.store()?, *offset, bytes).await?);
            }
            Command::CommitTable => memory.commit().await.map_err(Failure::from),
            Command::SetFalseAlarm(share) if !share.is_none_or(is_false_alarm) => {
                return Err(Failure::FalseAlarm);
            }
            Command::SetFalseAlarm(share) => {
                let done = memory.store()?.set_false_alarm(*share).await;
                done.map_err(Failure::from)
            }
            _ => {
                let done = memory.store()?.factory_table().await;
                done.map_err(Failure::from)
            }
        };
        memory.reload(events).await;
        done
    }

    async fn use_rig(&mut self, command: &Command) -> Result<(), Failure> {
        let Self {
            rig,
            memory,
            events,
            ..
        } = self;
        match command {
            Command::Home => {
                memory.episode = None;
                rig.home().await.map_err(Failure::Rig)?;
            }
            Command::Calibrate => {
                memory.episode = None;
                let calibration = rig.calibrate().await?;
                events.tell(told(&calibration));
                calibrate::keep(memory.store()?, &calibration).await?;
            }
            Command::WriteCalibration(bytes) => {
                if bytes.len() != RigCalibration::BYTES {
                    return Err(Failure::CalibrationLength);
                }
                let calibration = RigCalibration::from_bytes(bytes)?;
                rig.set_calibration(calibration)
                    .await
                    .map_err(Failure::Rig)?;
                calibrate::keep(memory.store()?, &calibration).await?;
            }
            Command::Weigh(mn) => {
                memory.episode = None;
                let counts = rig.weigh(*mn).await?;
                events.tell(Event::Weighed { mn: *mn, counts });
            }
            Command::TurnOver => {
                let turned = rig.turn_over().await?;
                memory.episode = None;
                events.tell(Event::Turned {
                    g_counts: turned.g_counts,
                    offset_counts: turned.offset_counts,
                });
            }
            Command::SetHighForce(allow) => rig.set_high_force(*allow, memory.store()).await?,
            // answered when it came, see `receive`
            _ => {}
        }
        Ok(())
    }
}
