//! The servo as a probe drives it: commands and samples across the executors.
use core::sync::atomic::Ordering::Relaxed;

use embassy_time::{Duration, with_timeout};
use heapless::spsc::Consumer;
use tactus_core::probe::RigState;
use tactus_core::probe::servo_rig::{LOOK_MS, RigCommand, Samples, Servo};
use tactus_core::rig::Refused;
use tactus_core::wire::Event;

use super::drive;
use super::outbox::{STREAM, tell};
use crate::chip::slots;

/// The probe's end of the servo.
pub(crate) struct ServoHandle<const HAS_STAGE: bool>(pub(crate) Consumer<'static, Samples>);

impl<const HAS_STAGE: bool> Servo for ServoHandle<HAS_STAGE> {
    const HAS_STAGE: bool = HAS_STAGE;

    async fn command(&mut self, command: RigCommand) -> Result<(), Refused> {
        drive::command(command).await
    }

    async fn wait(&mut self) {
        let _ = with_timeout(Duration::from_millis(LOOK_MS.into()), drive::ended()).await;
        drive::progress();
    }

    fn state(&self) -> RigState {
        drive::state()
    }

    fn samples(&mut self) -> Option<Samples> {
        self.0.dequeue()
    }

    fn gravity(&self) -> Option<f32> {
        slots::gravity()
    }

    fn lost(&self) -> u32 {
        let acquired = slots::LOST.load(Relaxed);
        acquired.wrapping_add(drive::LOST.load(Relaxed))
    }

    fn stop(&mut self) {
        drive::stop();
    }

    fn end_slide(&mut self) {
        drive::end_slide();
    }

    fn is_stopped(&self) -> bool {
        drive::is_stopped()
    }

    fn streams(&self) -> bool {
        STREAM.load(Relaxed)
    }

    fn tell(&mut self, event: Event) {
        tell(event);
    }
}
