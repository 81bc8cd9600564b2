//! Properties that differ from rig to rig, measured: serial number, motor current, forces.

use std::convert::Infallible;

use tactus_core::features::Movement;
use tactus_core::rig::Phase;
use tactus_core::rig::calibration::{LineFit, RigCalibration};
use tactus_core::rig::unloaded::UnloadedRuns;
use tactus_core::sensor::pressure::Calibration;
use tactus_core::sensor::{FingerName, biotac, slot};

use super::{SimError, SimRig, TICK_NS};

impl SimRig {
    /// Measures this rig's motor current without load, and takes it into the calibration.
    pub fn calibrate_current(&mut self) -> Result<RigCalibration, SimError> {
        let mut runs = UnloadedRuns::default();
        while let Some(speed_um_s) = runs.next_speed() {
            let (from, to, current_a) = self.run_unloaded(speed_um_s)?;
            runs.took(from, to, current_a);
        }
        let calibration = runs.finish(self.control.calibration())?;
        self.control.calibrate(calibration)?;
        Ok(calibration)
    }

    /// Place of the stage before a run over the sample and after it, and its mean motor current.
    fn run_unloaded(&mut self, speed_um_s: u32) -> Result<(f32, f32, Option<f32>), SimError> {
        let from = self.control.stage_mm();
        self.control.start_unloaded(speed_um_s)?;
        self.rest(|_| ())?;
        Ok((from, self.control.stage_mm(), self.control.mean_current_a()))
    }

    /// The sensor's serial number, asked for between two slots; the name of a finger that has none.
    /// Errors: it is not that of a BioTac.
    pub fn serial(&mut self) -> Result<[u8; 16], SimError> {
        let name = self.reader.model().name;
        if name != FingerName::Biotac {
            let mut serial = [0; 16];
            let bytes = name.as_str().bytes();
            serial
                .iter_mut()
                .zip(bytes)
                .for_each(|(to, from)| *to = from);
            return Ok(serial);
        }
        let mut bytes = biotac::IdentityBytes::default();
        for (transactions, place) in bytes.reads() {
            let Ok(answer) = slot::perform(&transactions, |transaction, miso| {
                let transfer = self.reader.transfer(transaction, self.now_ns);
                self.world.transfer(&transfer, transaction.out, miso);
                // the timer of the slots stands meanwhile
                self.now_ns += TICK_NS / 4;
                Ok::<(), Infallible>(())
            });
            biotac::keep(place, &answer);
        }
        let identity = bytes.decode()?;
        let mut serial = [0; 16];
        for (byte, character) in serial.iter_mut().zip(identity.serial.as_str().bytes()) {
            *byte = character;
        }
        Ok(serial)
    }

    /// Measures everything that differs from rig to rig: the motor current without load, newtons per ampere on the
    /// inclined stage, P_DC in the air, and its counts per newton on a force plate. `date` as 20261121.
    pub fn calibrate(&mut self, date: u32) -> Result<RigCalibration, SimError> {
        let serial = self.serial()?;
        let unloaded = self.calibrate_current()?;
        let mut incline = LineFit::default();
        for pull_n in [0.0f32, 1.0, 2.0, 3.0] {
            self.world.incline(pull_n.into());
            for _ in 0..2 {
                // to the right: the way of every slide
                if let (from, to, Some(current_a)) = self.run_unloaded(25_000)?
                    && to > from
                {
                    incline.push(pull_n, current_a);
                }
            }
        }
        self.world.incline(0.0);
        let (_, ampere_per_newton) = incline.line()?;
        // the plate lies under the finger, and reads the true force
        let mut plate = LineFit::default();
        for force_mn in [300, 600, 900, 1200] {
            let Ok(movement) = Movement::new(force_mn, 10_000) else {
                continue;
            };
            let mn_per_count = unloaded.pressure.force_mn_per_count;
            self.control.start(movement, 0.0)?;
            while self.control.phase() != Phase::Sliding {
                self.tick();
                if let Phase::Faulted(fault) = self.control.phase() {
                    return Err(fault.into());
                }
            }
            plate.push(
                self.control.force_mn() / mn_per_count,
                (self.world.truth().force_n * 1e3) as f32,
            );
            self.control.stop();
            self.rest(|_| ())?;
        }
        let (_, force_mn_per_count) = plate.line()?;
        let calibration = RigCalibration {
            pressure: Calibration {
                force_mn_per_count,
                ..unloaded.pressure
            },
            newton_per_ampere: 1.0 / ampere_per_newton,
            date,
            serial,
            ..unloaded
        };
        let air = self.control.air_counts();
        let calibration = air.map_or(calibration, |counts| calibration.with_air(counts));
        self.control.calibrate(calibration)?;
        Ok(calibration)
    }
}
