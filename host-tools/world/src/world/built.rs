//! Mistakes in a world from the beginning, and a person's operations before anything moves.

use super::World;
use crate::faults::Stop;
use crate::parts::Peers;
use crate::wiring::Miswired;

impl World {
    /// Builds a mistake into the rig. To be called before time passes; mistakes add up.
    pub fn miswire(&mut self, mistake: Miswired) {
        self.wires.take(mistake);
        let position_mm = self.stage.position_mm;
        match mistake {
            Miswired::LeverCoilOpen => self.lever.coil_open = true,
            Miswired::LeverMicrosteps(per_pulse) => self.lever.per_pulse = per_pulse,
            Miswired::EncoderLines(share) => self.encoder.set_lines(share, position_mm),
            _ => {}
        }
    }

    /// Has an MCP3202 read these counts at its inputs, and not a finger.
    pub fn wire_converter(&mut self, inputs: [u16; 2]) {
        if let Peers::Analog(converter) = &mut self.peers {
            converter.inputs = Some(inputs);
        }
    }

    /// Levels at the chip's MISO and MOSI while the sensor is selected and has no clock; `None` if nothing drives them.
    pub fn data_lines(&self) -> [Option<bool>; 2] {
        let plugged = match &self.peers {
            Peers::BioTac(sensor) => sensor.powered_ns.is_some(),
            _ => true,
        };
        let selected = plugged && !self.wires.have(Miswired::SelectOpen);
        // an idle sensor holds its output low (chosen)
        let sensor = selected.then_some(false);
        match self.wires.have(Miswired::DataExchanged) {
            true => [self.faults.miso_stuck, sensor],
            false => [self.faults.miso_stuck.or(sensor), None],
        }
    }

    /// Lines A and B of the encoder at the chip, each if something drives it.
    pub fn encoder_levels(&self, (a, b): (bool, bool)) -> [Option<bool>; 2] {
        let (a_wired, b_wired) = self.encoder.is_wired();
        [a_wired.then_some(a), b_wired.then_some(b)]
    }

    /// Pushes the stage by hand to a place, mm from its lower hard stop.
    pub fn push_stage(&mut self, to_mm: f64) {
        self.stage.push(to_mm);
    }

    /// Puts a resistor of so many ohm in the place of the stage's motor, or the motor back.
    pub fn replace_motor(&mut self, ohm: Option<f64>) {
        self.stage.resistor = ohm;
    }

    /// Turns the emergency stop back.
    pub fn release_stop(&mut self) {
        self.faults.e_stop = Stop::default();
        self.supply_motors();
    }

    /// Returns true if the motors' drivers have their supply.
    pub fn has_motor_supply(&self) -> bool {
        !self.faults.e_stop.cuts_power() || self.wires.have(Miswired::EStopKeepsSupply)
    }

    /// Holds a limit switch of the stage, or the lever's, actuated with a finger, or lets it go.
    pub fn hold_switch(&mut self, switch: Reached, held: bool) {
        match switch {
            Reached::Lower => self.stage.held = (held, false),
            Reached::Upper => self.stage.held = (false, held),
            Reached::Top => self.lever.held = held,
        }
    }
}

/// A switch that a person can reach.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Reached {
    /// The stage's, at its lower end.
    Lower,
    /// At its upper end.
    Upper,
    /// The lever's.
    Top,
}
