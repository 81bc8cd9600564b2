//! The bus between the chip and the finger.

use super::World;
use crate::faults::Miso;
use crate::parts::{ClockMode, Peers};
use crate::sensor::SensorPeer;
use crate::slot::Transfer;

impl World {
    /// One transfer with the finger's first part in mode 0, chip select low from `now_ns` for `duration_ns`; fills
    /// `miso`.
    pub fn spi(&mut self, now_ns: u64, duration_ns: u64, mosi: &[u8], miso: &mut [u8]) {
        let transfer = Transfer {
            part: 0,
            mode: ClockMode::of(0),
            begins_ns: now_ns,
            takes_ns: duration_ns,
        };
        self.transfer(&transfer, mosi, miso);
    }

    /// The same with any part in any mode.
    pub fn transfer(&mut self, transfer: &Transfer, mosi: &[u8], miso: &mut [u8]) {
        self.spi_select_part(transfer.begins_ns, transfer.part, transfer.mode);
        for (mosi, miso) in mosi.iter().zip(miso) {
            *miso = self.spi_byte(*mosi);
        }
        self.spi_deselect(transfer.begins_ns + transfer.takes_ns);
    }

    /// The sensor's end of the bus, of a BioTac.
    ///
    /// # Panics
    /// It is another finger.
    pub fn sensor(&self) -> &SensorPeer {
        match &self.peers {
            Peers::BioTac(sensor) => sensor,
            _ => panic!("the finger is no BioTac"),
        }
    }

    /// Complaints of the finger's parts: writes to reserved bits, and unknown commands. A BioTac's are
    /// [`SensorPeer::complaints`].
    pub fn complaints(&self) -> u64 {
        self.peers.complaints()
    }

    /// The chip select of a part falls, with the bus in this mode.
    pub fn spi_select_part(&mut self, now_ns: u64, part: u8, mode: ClockMode) {
        self.advance_to(now_ns);
        if self.wires.reach_sensor() {
            self.peers.select(now_ns, part, mode);
            self.selected = Some(0);
        }
    }

    /// A byte to the sensor, and MISO meanwhile. The sample of a command is that of the time reached; FF without chip
    /// select, by MISO's pull-up.
    pub fn spi_byte(&mut self, mosi: u8) -> u8 {
        let Some(count) = self.selected else {
            return self.idle_miso();
        };
        let fraction = self.fraction();
        let said = self
            .peers
            .byte(self.now_ns, mosi, &mut self.finger, fraction);
        self.selected = Some(count + 1);
        let Peers::BioTac(sensor) = &mut self.peers else {
            return self.miso.disturb(said, &self.faults);
        };
        if count == 0 {
            let line = sensor.line();
            self.miso.pass(self.now_ns, mosi, line, &self.faults);
        }
        let line = sensor.line().get(count).copied();
        line.unwrap_or(self.idle_miso())
    }

    /// MISO of a part that drives nothing: its pull-up, or the level that it is tied to.
    pub fn idle_miso(&self) -> u8 {
        Miso::idle(&self.faults)
    }

    /// The sensor's chip select rises; time does not pass by it.
    pub fn spi_deselect(&mut self, now_ns: u64) {
        self.selected = None;
        self.peers.deselect(now_ns);
    }
}
