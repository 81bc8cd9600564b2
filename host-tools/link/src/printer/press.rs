//! Down until the finger feels something, the force that is wanted, and up again.

use std::time::Duration;

use tactus_core::rig::arm::ArmMovement;

use super::moves::{LIFTS_MM_S, MOVES_MM_S, PLACE_OFF_MM, TOO_HARD};
use super::{Press, Printer, PrinterError, Result};

/// A step on the way down in the air, mm: a finger of 1 N/mm^1.5 is pressed with 0.09 N by it.
const STEP_MM: f64 = 0.2;
/// Height over an expected touch from which it goes down by steps, mm.
const CLEAR_MM: f64 = 0.5;
/// An axis arrives from one side of its play: it goes back by so much before, upwards and downwards, mm.
const BACK_MM: [f64; 2] = [0.25, 0.12];
/// A sample rises by this share of its length at most.
const RISES_MOST: f64 = 0.01;
/// The plane of a sample that nobody moved is felt again within this, mm; and nobody changes one within this time.
const SAME_MM: f64 = 0.5;
const CHANGES: Duration = Duration::from_secs(3);
/// A sample that rises by more along a slide is followed upwards, mm.
const RISES_MM: f64 = 0.005;
/// A way that is shorter may not be made at all (Marlin: MIN_STEPS_PER_SEGMENT of 6), mm.
const SHORTEST_MM: f64 = 0.018;
/// Force that is a touch, N.
const TOUCH_N: f64 = 0.03;
/// The largest force of a touch that measures the sample's height, N.
const LIGHT_N: f64 = 0.1;
/// The force is right within this share, and N.
const RIGHT: (f64, f64) = (0.02, 0.004);
/// Corrections of a force before it is given up.
const TRIES: usize = 16;
/// Time for which a still skin gives way, s.
const RELAXES: Duration = Duration::from_millis(400);

impl Printer {
    /// Goes down by steps at `along` until the finger feels something.
    async fn come_down(&self, along: f64, mm_s: f64, newton: f64) -> Result<()> {
        let floor = self.set_up()?.floor_mm;
        loop {
            let z = self.state().at[1] - STEP_MM;
            if z < floor {
                return Err(PrinterError::NoSample(floor));
            }
            self.go(along, z, mm_s).await?;
            self.state().down = true;
            let force = self.feel().await?;
            let too_hard = TOO_HARD.0 * newton + TOO_HARD.1;
            if force > too_hard {
                return Err(PrinterError::Unsteady(newton));
            }
            if force >= TOUCH_N {
                return Ok(());
            }
        }
    }

    /// Goes to a height from the side from which its play is taken up: from above, or where it is to go `up` next, from
    /// below.
    async fn arrive(&self, along: f64, z: f64, mm_s: f64, up: bool) -> Result<()> {
        let from = self.state().at[1];
        let way = if up { z - from } else { from - z };
        if way < SHORTEST_MM {
            let back = if up { -BACK_MM[1] } else { BACK_MM[0] };
            self.go(along, z + back, mm_s).await?;
        }
        self.go(along, z, mm_s).await
    }

    /// Brings the force from what it is to `newton`; the height at which it is that, and the stiffness there, N/mm.
    async fn trim(&self, along: f64, newton: f64, mm_s: f64, up: bool) -> Result<[f64; 2]> {
        let (share, least) = RIGHT;
        let mut before: Option<[f64; 2]> = None;
        let mut force = self.feel().await?;
        // that of a half sphere of silicone on its core, unless it is measured
        let mut stiffness = 1.5 * newton.cbrt();
        let mut arrived = !up;
        for _ in 0..TRIES {
            let z = self.state().at[1];
            if let Some([z0, force0]) = before
                && (z0 - z).abs() > SHORTEST_MM
                && (force - force0).abs() > 0.01
            {
                let measured = (force - force0) / (z0 - z);
                stiffness = measured.clamp(0.5 * stiffness, 2.0 * stiffness);
            }
            let missing = newton - force;
            let is_right = missing.abs() <= share * newton + least;
            if is_right && arrived {
                return Ok([z - missing / stiffness, stiffness]);
            }
            before = Some([z, force]);
            let way = (0.8 * missing / stiffness).min(STEP_MM);
            // on the way down it comes near first
            let turns = up && (arrived || missing < 0.1 * newton);
            arrived = turns || !up;
            self.arrive(along, z - way, mm_s, turns).await?;
            force = self.feel().await?;
            if force > TOO_HARD.0 * newton + TOO_HARD.1 {
                return Err(PrinterError::Unsteady(newton));
            }
        }
        Err(PrinterError::Unsteady(newton))
    }

    /// Touches the sample at `along` from a height; the height at which it presses with `newton`.
    async fn touch(&self, along: f64, from_mm: f64, newton: f64, mm_s: f64) -> Result<[f64; 2]> {
        let lifted = self.set_up()?.lifted_mm;
        self.go(along, lifted, MOVES_MM_S).await?;
        if from_mm < lifted {
            self.go(along, from_mm, LIFTS_MM_S).await?;
        }
        self.come_down(along, mm_s, newton).await?;
        self.trim(along, newton, mm_s, false).await
    }

    /// Presses the finger where the slide begins, and learns how the sample lies.
    pub(super) async fn press(&self, movement: ArmMovement) -> Result<()> {
        let setup = self.set_up()?;
        let path = setup.path(&movement)?;
        let newton = f64::from(movement.force_mn) * 1e-3;
        let mm_s = f64::from(movement.approach_um_s.min(setup.approach_um_s())) * 1e-3;
        self.state().path = Some(path);
        self.rise(setup.lifted_mm).await?;
        let light = LIGHT_N.min(0.6 * newton);
        let (known, is_same) = {
            let state = self.state();
            if let Some(off) = state.elsewhere {
                return Err(PrinterError::Elsewhere(off));
            }
            let since = state.lifted.map(|at| state.now.saturating_sub(at));
            (state.press, since.is_none_or(|since| since < CHANGES))
        };
        let near = |along: f64| {
            let press = known?;
            Some(press.touched_mm + press.slope * along + CLEAR_MM)
        };
        let high = setup.lifted_mm;
        let [far, _] = self
            .touch(path.to_mm, near(path.to_mm).unwrap_or(high), light, mm_s)
            .await?;
        self.rise(high).await?;
        let most = RISES_MOST * (path.to_mm - path.from_mm).abs();
        let expected = far + CLEAR_MM + most;
        let [close, _] = self
            .touch(path.from_mm, expected.min(high), light, mm_s)
            .await?;
        let slope = (far - close) / (path.to_mm - path.from_mm);
        let at = |press: Press, along: f64| press.touched_mm + press.slope * along;
        // beside the sample, the finger would be driven against its side
        let uneven = ((far - close).abs() - most).max(0.0);
        let off = known.filter(|_| is_same).map_or(uneven, |known| {
            let far = (far - at(known, path.to_mm)).abs();
            uneven.max(far).max((close - at(known, path.from_mm)).abs())
        });
        if off > SAME_MM {
            self.state().elsewhere = Some(off);
            return Err(PrinterError::Elsewhere(off));
        }
        // a slide goes on in the direction in which the axis has arrived
        let up = far - close > RISES_MM;
        let [_, stiffness_n_mm] = self.trim(path.from_mm, newton, mm_s, up).await?;
        // the skin gives way a little
        self.pause(RELAXES).await?;
        self.trim(path.from_mm, newton, mm_s, up).await?;
        let press = Press {
            stiffness_n_mm,
            backlash_mm: 0.0,
            touched_mm: close - slope * path.from_mm,
            slope,
        };
        let mut state = self.state();
        state.press = Some(press);
        state.presses.push(press);
        Ok(())
    }

    /// Lifts the finger to a height, carefully where it presses.
    async fn rise(&self, to_mm: f64) -> Result<()> {
        let [along, z] = self.state().at;
        if self.state().down {
            let before = self.state().felt().ok();
            let mut risen = 0.0;
            if self.state().measures_backlash
                && let Some(force) = before
                && force > 2.0 * TOUCH_N
            {
                risen = self.measure_play(force).await?;
            }
            self.go(along, z + risen + 0.1, LIFTS_MM_S.min(1.0)).await?;
            // without the probe there is nobody to ask
            if let Some(before) = before
                && self.feel().await.is_ok_and(|after| after > before + 0.06)
            {
                return Err(PrinterError::WrongWay);
            }
            self.state().down = false;
        }
        if z < to_mm {
            self.go(along, to_mm, LIFTS_MM_S).await?;
        }
        Ok(())
    }

    /// Goes up in small steps until the force falls; the way of that, mm.
    async fn measure_play(&self, force: f64) -> Result<f64> {
        let [along, z] = self.state().at;
        let mut risen = 0.0;
        while risen < BACK_MM[0] {
            risen += 0.02;
            self.go(along, z + risen, 1.0).await?;
            let left = self.feel().await?;
            if left < 0.96 * force - 0.01 {
                let mut state = self.state();
                if let Some(press) = state.presses.last_mut() {
                    press.backlash_mm = (risen - (force - left) / press.stiffness_n_mm).max(0.0);
                }
                break;
            }
        }
        Ok(risen)
    }

    /// Lifts the finger off the sample, and parks it there.
    pub(super) async fn lift(&self) -> Result<()> {
        if self.state().lost {
            return self.rescue().await;
        }
        let lifted = self.set_up()?.lifted_mm;
        match self.rise(lifted).await {
            // the order under way is that
            Ok(()) | Err(PrinterError::Replaced) => {}
            Err(why) => return Err(why),
        }
        let mut state = self.state();
        state.parked = state.at[1] >= lifted - PLACE_OFF_MM;
        Ok(())
    }
}
