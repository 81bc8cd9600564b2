//! The rig that the servo moves, as an exploration sees it: one movement after the other, its samples into the features.
use core::sync::atomic::Ordering::Relaxed;

use embassy_time::{Duration, with_timeout};
use heapless::Vec;
use heapless::spsc::Consumer;
use tactus_core::features::{PropertySet, Slide};
use tactus_core::kernels::Kernels;
use tactus_core::movement::Movement;
use tactus_core::rig::Rig;
use tactus_core::rig::control::{Ended, Phase, Refused};
use tactus_core::rig::guard::Fault;
use tactus_core::rig::patience::{Patience, Wait};
use tactus_core::rig::pins::Felt;
use tactus_core::session::{Blocks, Random};
use tactus_core::wire::Tell;

use crate::acquire;
use crate::link::{STREAM, tell};
use crate::servo::{self, Command, Samples, Snapshot};

/// How often the samples are looked after.
const LOOK_MS: u64 = 10;
/// Samples of a slide that are given to the core at once: those between two looks, and some more after a late one.
const GATHERED: usize = 32;

/// Why a movement of this probe failed.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum ProbeError {
    Refused(Refused),
    Fault(Fault),
    Stopped,
    Hangs,
}

impl core::fmt::Display for ProbeError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Refused(why) => why.fmt(f),
            Self::Fault(fault) => {
                write!(f, "{fault}: {}", fault.recovery())
            }
            Self::Stopped => f.write_str("stopped"),
            Self::Hangs => f.write_str("the rig does not come to an end: home it"),
        }
    }
}

impl core::error::Error for ProbeError {}

/// The rig that the servo moves, as the exploration sees it.
pub(crate) struct Probe {
    samples: Consumer<'static, Samples>,
    random: Random,
}

impl Probe {
    pub(crate) fn new(samples: Consumer<'static, Samples>) -> Self {
        Self {
            samples,
            random: Random::new(1),
        }
    }

    /// Something new begins: another sample may lie under the finger, and slides begin where these numbers say.
    pub(crate) async fn begin(&mut self, seed: u32) {
        self.random = Random::new(seed);
        // never refused
        let _ = servo::command(Command::SampleChanged).await;
    }

    /// Waits until the rig is at rest.
    async fn rest(&mut self) -> Result<Snapshot, ProbeError> {
        self.until(|rig| rig.at_rest, |_| ()).await
    }

    /// Waits until the rig is as it is to be; `each` is called at least every [`LOOK_MS`], and once more at the end.
    async fn until(
        &mut self,
        over: impl Fn(&Snapshot) -> bool,
        mut each: impl FnMut(&mut Consumer<'static, Samples>),
    ) -> Result<Snapshot, ProbeError> {
        let mut patience = Patience::default();
        loop {
            let _ = with_timeout(Duration::from_millis(LOOK_MS), servo::ended()).await;
            // before the samples, so that none of a movement that is over is left behind
            let rig = servo::snapshot();
            each(&mut self.samples);
            servo::progress();
            match (patience.wait(LOOK_MS as u32, over(&rig)), rig.phase) {
                (Wait::On, _) => {}
                (Wait::Stop, _) => servo::stop(),
                (Wait::Over | Wait::Hangs, Phase::Faulted(fault)) if rig.at_rest => {
                    return Err(ProbeError::Fault(fault));
                }
                (Wait::Over, _) => return Ok(rig),
                (Wait::Hangs, _) => return Err(ProbeError::Hangs),
            }
        }
    }

    /// Lifts the finger to its limit switch; the stage stays where it is.
    pub(crate) async fn lift(&mut self) -> Result<(), ProbeError> {
        self.command(Command::Lift).await?;
        self.rest().await.map(|_| ())
    }

    /// Finds the limit switches, the lever's first; after a fault once the finger is lifted.
    pub(crate) async fn home(&mut self) -> Result<(), ProbeError> {
        // the fault is what the user homes after
        let _ = self.rest().await;
        self.command(Command::Home).await?;
        match self.rest().await?.phase {
            Phase::Ready => Ok(()),
            _ => Err(ProbeError::Stopped),
        }
    }

    /// Has something begun, unless all was stopped.
    async fn command(&self, command: Command) -> Result<(), ProbeError> {
        if servo::is_stopped() {
            return Err(ProbeError::Stopped);
        }
        servo::command(command).await.map_err(ProbeError::Refused)?;
        // it was stopped in the same millisecond, before it began
        if servo::is_stopped() {
            servo::stop();
        }
        Ok(())
    }

    /// A run without load, there or back: where it began and ended, mm, and its mean current, A.
    pub(crate) async fn run_unloaded(
        &mut self,
        speed_um_s: u32,
    ) -> Result<(f32, f32, Option<f32>), ProbeError> {
        let from_mm = servo::snapshot().stage_mm;
        self.command(Command::StartUnloaded(speed_um_s)).await?;
        let rig = self.rest().await?;
        match rig.ended {
            Some(Ended::Whole) => Ok((from_mm, rig.stage_mm, rig.mean_current_a)),
            _ => Err(ProbeError::Stopped),
        }
    }
}

impl Rig for Probe {
    type Error = ProbeError;

    fn measures(&self) -> PropertySet {
        PropertySet::ALL
    }

    async fn perform<K: Kernels>(
        &mut self,
        movement: Movement,
        slide: &mut Slide<'_, K>,
    ) -> Result<(), ProbeError> {
        if servo::snapshot().phase == Phase::Parked {
            self.home().await?;
        }
        while self.samples.dequeue().is_some() {}
        let lost = || {
            acquire::LOST
                .load(Relaxed)
                .wrapping_add(servo::LOST.load(Relaxed))
        };
        let lost_before = lost();
        let start = self.random.next_f32();
        self.command(Command::Start(movement, start)).await?;
        let mut blocks = STREAM.load(Relaxed).then(Blocks::default);
        let ended = self
            .until(
                |rig| rig.at_rest || rig.ended.is_some(),
                |queue| {
                    let mut gathered = Vec::new();
                    while let Some(samples) = queue.dequeue() {
                        feel(&samples, &mut gathered, slide);
                        let block = blocks
                            .as_mut()
                            .and_then(|b| b.put(&samples.felt, &samples.pac, samples.shear_mn));
                        if let Some(block) = block {
                            tell(Tell::Block(block));
                        }
                    }
                    slide.push(&gathered);
                },
            )
            .await
            .map(|rig| rig.ended);
        let gap = match ended {
            Ok(Some(Ended::Gap(samples))) => samples,
            _ => 0,
        };
        let gap = gap + lost().wrapping_sub(lost_before);
        if gap > 0 {
            slide.lose(gap);
        }
        if let Some(blocks) = blocks {
            tell(Tell::Block(blocks.end(gap)));
        }
        match ended? {
            Some(Ended::Whole | Ended::Gap(_)) => Ok(()),
            Some(Ended::Stopped) | None => {
                self.rest().await?;
                Err(ProbeError::Stopped)
            }
        }
    }

    async fn lifted(&mut self) -> Result<(), ProbeError> {
        self.rest().await.map(|_| ())
    }
}

/// Gives what a tick felt to the core. Samples of a slide are gathered first: the core takes many at once for little more
/// than a few. Whoever has no more of them gives it the last.
fn feel<K: Kernels>(
    samples: &Samples,
    gathered: &mut Vec<i16, GATHERED>,
    slide: &mut Slide<'_, K>,
) {
    let is_slide = samples.felt == Felt::Slide;
    if !is_slide || gathered.len() + samples.pac.len() > GATHERED {
        slide.push(gathered);
        gathered.clear();
    }
    match &samples.felt {
        Felt::Nothing => return,
        Felt::Still => return slide.push_still(&samples.pac),
        Felt::Begin(steady) => slide.start(steady.clone()),
        Felt::Slide => {}
    }
    // there is room
    let _ = gathered.extend_from_slice(&samples.pac);
    slide.push_shear(samples.shear_mn.as_slice());
}
