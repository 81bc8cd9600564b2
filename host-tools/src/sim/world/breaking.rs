//! What breaks in the world, when, and how it is repaired.

use super::World;
use crate::sim::faults::{Fault, Faults};
use crate::sim::parts::{PartFault, Peers};

impl World {
    /// Breaks something now, or presses the stop. Faults add up.
    pub fn inject(&mut self, fault: Fault) {
        let position_mm = self.stage.position_at_mm(self.fraction());
        self.inject_at(fault, self.now_ns, position_mm);
    }

    pub(super) fn inject_at(&mut self, fault: Fault, at_ns: u64, position_mm: f64) {
        let now = self.switches();
        let faults = &mut self.faults;
        match fault {
            Fault::SensorUnplugged => match &mut self.peers {
                Peers::BioTac(sensor) => sensor.unplug(),
                peers => peers.break_part(at_ns, PartFault::Unplugged, &mut self.finger),
            },
            Fault::BitFlips { share } => faults.flip_share = share,
            Fault::WordNoise { share } => faults.noise_share = share,
            Fault::MisoStuck { high } => faults.miso_stuck = Some(high),
            Fault::SensorFrozen => faults.frozen = true,
            Fault::PdcDrift { counts_per_s } => faults.drift = Some((counts_per_s, at_ns)),
            Fault::PdcStuck => faults.pdc_stuck = true,
            Fault::PdcFades { seconds } => self.finger.fade_pdc(seconds),
            Fault::SkinLeaks { seconds } => self.finger.leak(seconds),
            Fault::PdcWeak { gain } => self.finger.weaken_pdc(gain),
            Fault::StageJammed => self.stage.jam(true),
            Fault::EncoderSwapped => self.encoder.swap(true, position_mm, at_ns),
            Fault::CurrentOffset { amperes } => faults.current = Some(amperes),
            Fault::CurrentSaturated => faults.current = Some(f64::INFINITY),
            Fault::SupplyDip { ms } => {
                faults.dip_ends_ns = at_ns + ms * 1_000_000;
                self.supply_motors();
            }
            Fault::BridgeOff => {
                faults.bridge_off = true;
                self.supply_motors();
            }
            Fault::FastDecay => self.stage.decay_fast(true),
            Fault::StageVibrates { um } => self.stage.vibrate(um),
            Fault::EncoderCut(cut) => self.encoder.set_cut(Some(cut), position_mm, at_ns),
            Fault::StageLimitStuck { upper, closed } => {
                faults.switches.stuck[1 + usize::from(upper)] = Some(closed);
            }
            Fault::LeverTopStuck { closed } => faults.switches.stuck[0] = Some(closed),
            Fault::SwitchesBounce { ms } => faults.switches.bounce(now, ms),
            Fault::LeverLosesSteps { share } => self.lever.lose_steps(share),
            Fault::LeverRunaway => self.lever.run_away_down(true),
            Fault::LeverDirInverted => self.lever.invert_dir(true),
            Fault::EStop => {
                faults.e_stop.press(at_ns);
                self.supply_motors();
            }
            Fault::EStopGlitch { us } => faults.e_stop.disturb(at_ns, us),
        }
    }

    /// Breaks something of the finger's parts; a BioTac has none.
    pub fn break_part(&mut self, fault: PartFault) {
        self.peers.break_part(self.now_ns, fault, &mut self.finger);
    }

    /// Lets something break at a time, to the tick: up to 76 us late.
    pub fn schedule(&mut self, at_ns: u64, fault: Fault) {
        self.scheduled.push((at_ns, fault));
        self.scheduled
            .sort_by_key(|(at_ns, _)| std::cmp::Reverse(*at_ns));
    }

    /// Repairs everything, and forgets what was scheduled; a sensor that is plugged in again starts up. What a fault has
    /// done stays: lost steps, lost counts, a lever that ran down.
    pub fn clear(&mut self) {
        self.faults = Faults::default();
        self.scheduled.clear();
        self.peers.mend(self.now_ns);
        self.finger.mend();
        self.stage.jam(false);
        self.stage.decay_fast(false);
        self.stage.vibrate(0.0);
        let position_mm = self.stage.position_at_mm(self.fraction());
        self.encoder.set_cut(None, position_mm, self.now_ns);
        self.encoder.swap(false, position_mm, self.now_ns);
        self.lever.lose_steps(0.0);
        self.lever.run_away_down(false);
        self.lever.invert_dir(false);
        self.supply_motors();
    }
}
