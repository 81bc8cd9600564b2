//! The stage: a trapezoidal profile, and the velocity PI that follows it a thousand times a second.

use super::fault::Fault;

/// Constants of one stage.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct StageConstants {
    /// Travel per encoder count, mm.
    pub mm_per_count: f32,
    /// Length of the travel between the limit switches, mm.
    pub travel_mm: f32,
    /// Acceleration of every ramp, mm/s^2.
    pub(crate) acceleration_mm_s2: f32,
    /// Feed-forward: duty per mm/s, and per mm/s^2.
    pub(crate) duty_per_mm_s: f32,
    pub(crate) duty_per_mm_s2: f32,
    /// Feed-forward: duty that overcomes the friction of the moving stage, with a finger on it.
    pub(crate) duty_friction: f32,
    /// Proportional gain: duty per mm/s of velocity error.
    pub p: f32,
    /// Integral gain: duty per mm; the integral of the velocity error is the position error.
    pub i: f32,
    /// Supply of the bridge, V.
    pub supply_v: f32,
    pub(crate) resistance_ohm: f32,
    pub(crate) emf_v_per_mm_s: f32,
}

impl StageConstants {
    /// The reference stage: 12 V, a 10 mm screw, 16.4 N/A, 1.2 kg, an encoder of 1 um. The gains hold the speed within
    /// 1 % where a real finger's tangential force jumps; with 1.5 ms of delay they leave a phase margin of 38 degrees.
    pub const REFERENCE: Self = Self {
        mm_per_count: 1e-3,
        travel_mm: 77.0,
        acceleration_mm_s2: 1000.0,
        duty_per_mm_s: 1.37e-3,
        duty_per_mm_s2: 4.7e-5,
        duty_friction: 0.03,
        p: 0.02,
        i: 2.8,
        supply_v: 12.0,
        resistance_ohm: 7.5,
        emf_v_per_mm_s: 0.0164,
    };

    /// Speed in mm/s at which the motor must be turning, from its voltage and current: tells a blocked stage from a
    /// silent encoder.
    pub(crate) fn emf_speed_mm_s(&self, duty: f32, current_a: f32) -> f32 {
        (duty * self.supply_v - current_a * self.resistance_ohm) / self.emf_v_per_mm_s
    }
}

/// Largest distance between profile and stage that is still following: so many mm, and the way of so many s. Long
/// enough for the guard to find why the stage stands.
const FOLLOWING_MM: f32 = 1.0;
const FOLLOWING_S: f32 = 0.04;
/// Velocity is taken over this many ms of encoder counts.
const VELOCITY_MS: usize = 2;
/// Distance kept from the limit switches, mm.
pub(super) const MARGIN_MM: f32 = 1.0;
/// Most duty from the integral: enough for a loaded stage, and not for one that runs away without an encoder.
const MAX_INTEGRAL: f32 = 0.25;
/// The same while homing, when no guard tells a blocked stage from a silent encoder: less is allowed.
const HOMING_FOLLOWING_MM: f32 = 0.5;
/// The switch is searched at this speed; it is 4 mm before the hard stop, and the shorted motor brakes within one. Then
/// ...
const SEARCH_MM_S: f32 = 40.0;
/// ... it is touched again at this speed, in which the 3 ms until it is believed are 30 um.
const TOUCH_MM_S: f32 = 10.0;
/// The touch begins [`MARGIN_MM`] from the switch, and goes at most so far.
const TOUCH_MM: f32 = 3.0 * MARGIN_MM;
/// The stage has arrived when it stands this near, mm: friction holds it within 0.2 mm, and every move begins where it
/// stands.
const ARRIVED_MM: f32 = 0.3;
/// It has time for that after the profile's end, ms.
const ARRIVE_MS: u32 = 300;

#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum StageState {
    /// The position is unknown; the motor is off.
    Unknown,
    /// Towards the left limit switch.
    Homing(Profile),
    Standing,
    Moving(Profile),
}

#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Profile {
    from_mm: f32,
    direction: f32,
    distance_mm: f32,
    speed_mm_s: f32,
    acceleration_mm_s2: f32,
    /// Duration of a ramp, and of the whole way, s.
    ramp_s: f32,
    duration_s: f32,
    ms: u32,
}

impl Profile {
    fn new(from_mm: f32, to_mm: f32, speed_mm_s: f32, acceleration_mm_s2: f32) -> Self {
        let way = to_mm - from_mm;
        let distance_mm = libm::fabsf(way);
        // a short way has no constant part
        let speed_mm_s = speed_mm_s.min(libm::sqrtf(distance_mm * acceleration_mm_s2));
        let ramp_s = speed_mm_s / acceleration_mm_s2;
        let duration_s = if speed_mm_s > 0.0 {
            distance_mm / speed_mm_s + ramp_s
        } else {
            0.0
        };
        Self {
            from_mm,
            direction: if way < 0.0 { -1.0 } else { 1.0 },
            distance_mm,
            speed_mm_s,
            acceleration_mm_s2,
            ramp_s,
            duration_s,
            ms: 0,
        }
    }

    /// Ends it as soon as its ramp allows: from now on the ramp down. One that is on its ramp down continues.
    fn brake(&mut self) {
        let t = self.ms as f32 * 1e-3;
        // on the ramp up it has not reached its speed yet
        let ramp_s = self.ramp_s.min(t);
        if t + ramp_s < self.duration_s {
            self.speed_mm_s = self.acceleration_mm_s2 * ramp_s;
            self.ramp_s = ramp_s;
            self.duration_s = t + ramp_s;
            self.distance_mm = self.speed_mm_s * t;
        }
    }

    pub(crate) fn duration_s(&self) -> f32 {
        self.duration_s
    }

    pub(crate) fn velocity_mm_s(&self) -> f32 {
        self.at(self.ms as f32 * 1e-3).1
    }

    /// Position in mm, velocity in mm/s and acceleration in mm/s^2 at `t` seconds.
    pub(crate) fn at(&self, t: f32) -> (f32, f32, f32) {
        let (ramp, end) = (self.ramp_s, self.duration_s);
        let a = self.acceleration_mm_s2;
        let (way, v, a) = if t >= end {
            (self.distance_mm, 0.0, 0.0)
        } else if t < ramp {
            (a * t * t / 2.0, a * t, a)
        } else if t < end - ramp {
            (self.speed_mm_s * (t - ramp / 2.0), self.speed_mm_s, 0.0)
        } else {
            let left = end - t;
            (self.distance_mm - a * left * left / 2.0, a * left, -a)
        };
        (
            self.from_mm + self.direction * way,
            self.direction * v,
            self.direction * a,
        )
    }
}

#[derive(Clone, Debug)]
pub(crate) struct Stage {
    constants: StageConstants,
    state: StageState,
    /// Encoder count at position 0, the left limit switch.
    zero: i32,
    counts: [i32; VELOCITY_MS + 1],
    /// The limit switch was found in search, and is to be touched slowly.
    searched: bool,
}

impl Stage {
    /// A stage whose position is unknown.
    pub(crate) fn new(constants: StageConstants) -> Self {
        Self {
            constants,
            state: StageState::Unknown,
            zero: 0,
            counts: [0; VELOCITY_MS + 1],
            searched: false,
        }
    }

    pub(crate) fn state(&self) -> StageState {
        self.state
    }

    pub(crate) fn constants(&self) -> &StageConstants {
        &self.constants
    }

    /// Position in mm from the left limit switch.
    pub(crate) fn position_mm(&self) -> f32 {
        (self.now() - self.zero) as f32 * self.constants.mm_per_count
    }

    pub(crate) fn velocity_mm_s(&self) -> f32 {
        let [oldest, ..] = self.counts;
        (self.now() - oldest) as f32 * self.constants.mm_per_count * (1000.0 / VELOCITY_MS as f32)
    }

    fn now(&self) -> i32 {
        let [.., newest] = self.counts;
        newest
    }

    /// Looks for the left limit switch: in search first, and when that has found it and the stage is off it again,
    /// slowly.
    pub(crate) fn home(&mut self) {
        let (way, speed_mm_s) = if self.searched {
            (TOUCH_MM, TOUCH_MM_S)
        } else {
            (1.25 * self.constants.travel_mm, SEARCH_MM_S)
        };
        self.state = StageState::Homing(self.profile(self.position_mm() - way, speed_mm_s));
    }

    fn profile(&self, to_mm: f32, speed_mm_s: f32) -> Profile {
        let acceleration = self.constants.acceleration_mm_s2;
        Profile::new(self.position_mm(), to_mm, speed_mm_s, acceleration)
    }

    /// Returns true if the limit switch still has to be touched slowly: call [`Stage::home`] once more.
    pub(crate) fn is_searched(&self) -> bool {
        self.searched
    }

    /// Moves to `to_mm`, kept [`MARGIN_MM`] from the limit switches. Only a standing stage does; the profile gives the
    /// time.
    #[inline]
    pub(crate) fn go(&mut self, to_mm: f32, speed_mm_s: f32) -> Option<Profile> {
        if self.state != StageState::Standing {
            return None;
        }
        let to_mm = to_mm
            .min(self.constants.travel_mm - MARGIN_MM)
            .max(MARGIN_MM);
        let profile = self.profile(to_mm, speed_mm_s);
        self.state = StageState::Moving(profile);
        Some(profile)
    }

    /// The motor goes off, and the stage no longer knows where it is.
    pub(crate) fn forget(&mut self) {
        self.state = StageState::Unknown;
        self.searched = false;
    }

    pub(crate) fn stop(&mut self) {
        if self.searched || matches!(self.state, StageState::Unknown | StageState::Homing(_)) {
            self.forget();
        } else {
            self.state = StageState::Standing;
        }
    }

    /// Ends a way as soon as the acceleration of its ramps allows; the stage stands then as at the end of any.
    #[inline]
    pub(crate) fn brake(&mut self) {
        if let StageState::Moving(profile) = &mut self.state {
            profile.brake();
        }
    }

    /// One millisecond: the encoder's count, and whether the left limit switch is pressed. Returns the duty of the
    /// motor, -1 to 1.
    /// Errors: the motor is to be off.
    #[inline]
    pub(crate) fn tick(&mut self, count: i32, at_left: bool) -> Result<f32, Fault> {
        self.counts.rotate_left(1);
        let [.., newest] = &mut self.counts;
        *newest = count;
        let c = self.constants;
        let homes = matches!(self.state, StageState::Homing(_));
        let (StageState::Homing(mut profile) | StageState::Moving(mut profile)) = self.state else {
            return Ok(0.0);
        };
        if homes && at_left {
            self.zero = count;
            self.searched = !self.searched;
            self.state = StageState::Standing;
            return Ok(0.0);
        }
        profile.ms += 1;
        let t = profile.ms as f32 * 1e-3;
        let (x, v, a) = profile.at(t);
        let off = x - self.position_mm();
        let over = profile
            .ms
            .saturating_sub(libm::ceilf(profile.duration_s() * 1e3) as u32);
        if homes {
            if libm::fabsf(off) > HOMING_FOLLOWING_MM || over > 0 {
                return Err(Fault::StageNotHome);
            }
            self.state = StageState::Homing(profile);
        } else {
            let following = FOLLOWING_MM + FOLLOWING_S * profile.speed_mm_s;
            if libm::fabsf(off) > following || over > ARRIVE_MS {
                return Err(Fault::StageOff);
            }
            if over > 0 && libm::fabsf(off) < ARRIVED_MM && libm::fabsf(self.velocity_mm_s()) < 0.5
            {
                self.state = StageState::Standing;
                return Ok(0.0);
            }
            self.state = StageState::Moving(profile);
        }
        // the velocity lags by half of its averaging time
        let lag_s = VELOCITY_MS as f32 * 0.5e-3;
        let v_then = if t < lag_s {
            0.0
        } else {
            profile.at(t - lag_s).1
        };
        let friction = if v == 0.0 {
            0.0
        } else {
            libm::copysignf(c.duty_friction, v)
        };
        let duty = c.duty_per_mm_s * v
            + friction
            + c.duty_per_mm_s2 * a
            + c.p * (v_then - self.velocity_mm_s())
            + (c.i * off).clamp(-MAX_INTEGRAL, MAX_INTEGRAL);
        Ok(duty.clamp(-1.0, 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The profile against sums of its own acceleration and velocity, in f64.
    fn integrates(from: f32, to: f32, speed: f32) {
        let profile = Profile::new(from, to, speed, 1000.0);
        let (mut x, mut v) = (f64::from(from), 0.0);
        let dt = 1e-5;
        let steps = (f64::from(profile.duration_s()) / dt) as u32;
        for n in 0..steps {
            let t = (f64::from(n) + 0.5) * dt;
            let (_, _, a) = profile.at(t as f32);
            v += f64::from(a) * dt;
            x += v * dt;
            let (at, velocity, _) = profile.at((t + 0.5 * dt) as f32);
            assert!(
                (f64::from(velocity) - v).abs() < 0.05,
                "{t}: {velocity} {v}"
            );
            assert!((f64::from(at) - x).abs() < 0.01, "{t}: {at} {x}");
            assert!(velocity.abs() <= speed + 1e-3);
        }
        assert!((x - f64::from(to)).abs() < 0.01);
        assert_eq!(profile.at(profile.duration_s() + 1.0), (to, 0.0, 0.0));
    }

    #[test]
    fn profiles_go_from_rest_to_rest() {
        integrates(1.0, 61.0, 63.1);
        integrates(61.0, 1.0, 50.0);
        // too short to reach its speed
        integrates(10.0, 10.5, 100.0);
        assert_eq!(Profile::new(5.0, 5.0, 50.0, 1000.0).duration_s(), 0.0);
    }

    #[test]
    fn a_brake_stands_after_v2_over_2a_without_a_jolt() {
        for (to, speed) in [(40.0, 63.0), (5.0, 40.0), (20.5, 10.0)] {
            let whole = Profile::new(20.0, to, speed, 1000.0);
            let last = (whole.duration_s() * 1e3) as u32;
            for ms in 0..last + 5 {
                let mut profile = Profile { ms, ..whole };
                let t = ms as f32 * 1e-3;
                let (x, v, a) = profile.at(t);
                profile.brake();
                let (x_then, v_then, _) = profile.at(t);
                assert!(
                    (x_then - x).abs() < 1e-3 && (v_then - v).abs() < 1e-2,
                    "{ms}"
                );
                // a stage that was braking already continues
                let slows = a * v < 0.0;
                let way = v * v / 2000.0 * v.signum();
                let stands = profile.at(1e3).0;
                assert!(
                    (stands - (x + way)).abs() < 0.02,
                    "{ms}: {stands} {x} {way}"
                );
                assert!(slows || profile.duration_s() <= whole.duration_s() + 1e-4);
                let over = profile.duration_s() - t;
                assert!(over < v.abs() / 1000.0 + 2e-3, "{ms}: {over}");
                for after in 0..200 {
                    let (_, now, a) = profile.at(t + after as f32 * 1e-3);
                    assert!(a.abs() <= 1000.0 && now.abs() <= v.abs() + 1e-2);
                }
            }
        }
    }

    #[test]
    fn a_stage_that_does_not_know_where_it_is_does_not_move() {
        let mut stage = Stage::new(StageConstants::REFERENCE);
        assert_eq!(stage.go(30.0, 50.0), None);
        assert_eq!(stage.tick(0, false), Ok(0.0));
        stage.home();
        assert!(stage.tick(0, false).unwrap() < 0.0, "to the left");
        assert_eq!(stage.tick(-20, true), Ok(0.0));
        assert_eq!(stage.position_mm(), 0.0, "the switch is the origin");
        // once more, slowly, from where it stands
        assert!(stage.is_searched());
        for _ in 0..VELOCITY_MS {
            assert_eq!(stage.tick(-20, false), Ok(0.0));
        }
        stage.home();
        assert!(stage.tick(-20, false).unwrap() < 0.0, "to the left");
        assert_eq!(stage.tick(-20, true), Ok(0.0));
        assert!(!stage.is_searched());
        // outside the travel is brought inside
        stage.go(500.0, 50.0).unwrap();
        assert!(stage.tick(-20, true).unwrap() > 0.0);
        assert_eq!(stage.go(10.0, 50.0), None, "busy");
        stage.stop();
        assert_eq!(stage.state(), StageState::Standing);
    }

    /// Follows the profile exactly, or stands still, without ever closing the switch; returns the way.
    fn searches(stage: &mut Stage, follows: bool) -> f32 {
        stage.home();
        let mut furthest = 0.0f32;
        for _ in 0..60_000 {
            let at = stage.position_mm();
            let StageState::Homing(profile) = stage.state() else {
                panic!("it homes");
            };
            let (to, ..) = profile.at((profile.ms + 1) as f32 * 1e-3);
            furthest = furthest.max(-at);
            let count = stage.now() + if follows { ((to - at) * 1e3) as i32 } else { 0 };
            match stage.tick(count, false) {
                Ok(_) => {}
                Err(why) => {
                    assert_eq!(why, Fault::StageNotHome);
                    return furthest;
                }
            }
        }
        panic!("no end in a minute");
    }

    #[test]
    fn a_switch_that_is_not_found_has_an_end() {
        let new = || Stage::new(StageConstants::REFERENCE);
        assert_eq!(searches(&mut new(), false), 0.0);
        assert!((searches(&mut new(), true) - 1.25 * 77.0).abs() < 0.1);
        let mut found = new();
        found.home();
        assert_eq!(found.tick(0, true), Ok(0.0));
        assert!((searches(&mut found, true) - TOUCH_MM).abs() < 0.1);
        // a place that was only searched is not known
        let mut found = new();
        found.home();
        assert_eq!(found.tick(0, true), Ok(0.0));
        found.stop();
        assert_eq!(found.state(), StageState::Unknown);
        assert!(!found.is_searched());
    }

    #[test]
    fn back_emf_tells_a_blocked_stage_from_one_that_turns() {
        let c = StageConstants::REFERENCE;
        // 2 V over a standing motor
        assert!(c.emf_speed_mm_s(2.0 / 12.0, 2.0 / 7.5).abs() < 1e-3);
        // 63 mm/s is 1.03 V
        assert!((c.emf_speed_mm_s((1.0348 + 0.3) / 12.0, 0.3 / 7.5) - 63.1).abs() < 0.1);
    }
}
