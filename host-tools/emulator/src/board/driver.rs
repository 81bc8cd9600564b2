//! The work at every access and stop of the emulated core: pins to the rig, the flash array, the log, and the owner's
//! commands.

use std::sync::mpsc::{Receiver, Sender};

use rigless::emulator::{self, Access, AccessKind, Host, Settled, Stop, StopReason};
use rigless::mcu::{Mcu as _, Operate as _};
use rigless::session::Session;
use rigless::soc::Width;
use rigless::soc::stm32f427::generated::flash::Register as FlashRegister;
use rigless::time::VirtualNanos;

use super::chip::Board;
use super::flash::{self, FlashWrite};
use super::halt::Halt;
use super::handler_profile::HandlerProfiler;
use super::log::Log;
use super::pins::{self, PinId};
use super::referee::Referee;
use super::rig::{SharedRig, lock};
use super::upset::Switch;

const SPI1_CR1: u64 = 0x4001_3000;
const SPI4_CR1: u64 = 0x4001_3400;
const I2C1_CR1: u64 = 0x4000_5400;
const TIM5_SR: u64 = 0x4000_0C10;
const TIM5_EGR: u64 = 0x4000_0C14;
const RCC_CR: u64 = 0x4002_3800;
const HSEON: u64 = 1 << 16;
const FLASH_CR: u64 = 0x4002_3C10;
/// Ports A to F, 1 KB each.
const PORTS: std::ops::Range<u64> = 0x4002_0000..0x4002_1800;
/// In a port: MODER, AFRL and AFRH.
const CONFIGURATION: [u64; 3] = [0x00, 0x20, 0x24];

/// The run between two instructions, for its owner.
pub(crate) struct Standing<'a> {
    pub(crate) session: &'a mut Session<Board>,
    pub(crate) host: &'a mut dyn Host,
    pub(crate) driver: &'a mut Driver,
}

/// The owner's commands.
pub(crate) enum Command {
    /// Go on until then, ns.
    RunUntil(u64),
    /// Look or change something.
    With(Box<dyn FnOnce(&mut Standing<'_>) + Send>),
}

pub(crate) struct Driver {
    pub(crate) rig: SharedRig,
    pub(crate) commands: Receiver<Command>,
    /// gets every time that is reached
    pub(crate) reached: Sender<u64>,
    pub(crate) log: Option<Log>,
    pub(crate) profiler: Option<HandlerProfiler>,
    /// instructions since power-up, without the time that the core slept
    pub(crate) instructions: u64,
    pub(crate) tick_ns: u64,
    pub(crate) next_tick_ns: u64,
    pub(crate) until_ns: u64,
    pub(crate) resets: usize,
    /// lever top, e-stop, stage lower, stage upper, as they were driven last
    pub(crate) switches: [Option<bool>; 4],
    /// the debug probe gives its 8 MHz
    pub(crate) clock: bool,
    /// BOR_LEV of the option bytes
    pub(crate) brown_out: u8,
    /// what the firmware did to the store's sectors
    pub(crate) stored: Vec<FlashWrite>,
    /// an erase was under way when CR of the flash was written last
    pub(crate) flash_busy: bool,
    /// an erase never ends
    pub(crate) flash_stuck: bool,
    /// an erase takes twice its typical time
    pub(crate) flash_slow: bool,
    /// a switch that cannot be turned on
    pub(crate) held_off: Option<Switch>,
    /// level of the display's clock, by the port
    pub(crate) scl: bool,
    /// judges what the firmware does to the chip, from the first instruction on
    pub(crate) referee: Option<Referee>,
    /// a debugger has halted the core
    pub(super) halt: Option<Halt>,
}

impl Driver {
    /// Before the first instruction.
    pub(crate) fn power_up(&mut self, session: &mut Session<Board>) {
        self.referee = Some(Referee::new(session.board_mut().part.bus()));
        self.restarted(session.board_mut(), VirtualNanos(0));
        self.switch(session.board_mut(), VirtualNanos(0));
    }

    /// Brings the levels of a port's outputs to the rig.
    fn port(&mut self, board: &mut Board, now_ns: u64, port: usize) {
        let rig = self.rig.clone();
        let mut rig = lock(&rig);
        let [scl, sda] = pins::DISPLAY_I2C;
        if scl.port() == port && rig.display().holds() {
            let high = by_port(board, scl, pins::I2C1_FUNCTION) == Some(true);
            if high && !std::mem::replace(&mut self.scl, high) {
                rig.display_mut().clock();
            }
            self.scl = high;
            if !rig.display().holds() {
                board.drive(VirtualNanos(now_ns), sda, None);
            }
        }
        let mut at = |pin: PinId| (pin.port() == port).then(|| board.level(pin));
        for (part, pin) in (0..).zip([pins::SENSOR_CS, pins::SENSOR_CS_2]) {
            if let Some(high) = at(pin) {
                rig.select_part(now_ns, part, !high);
            }
        }
        if let Some(high) = at(pins::MOTION_CS) {
            rig.motion().select(!high);
        }
        // DIR before EN and STEP, as it is set before them
        if let Some(high) = at(pins::LEVER_DIR) {
            rig.lever_dir(now_ns, high);
        }
        if let Some(high) = at(pins::LEVER_ENABLE) {
            rig.lever_enable(now_ns, high);
        }
        if let Some(high) = at(pins::STAGE_DIR) {
            rig.stage_dir(now_ns, high);
        }
        if let Some(high) = at(pins::STAGE_ENABLE) {
            rig.stage_enable(now_ns, high);
        }
        if pins::LEVER_STEP.port() == port {
            let level = by_port(board, pins::LEVER_STEP, pins::TIM1_FUNCTION);
            rig.step_port(now_ns, level);
        }
        if pins::STAGE_PWM.port() == port {
            let level = by_port(board, pins::STAGE_PWM, pins::TIM3_4_FUNCTION);
            rig.stage_port(now_ns, level);
        }
    }

    fn wire(&self, board: &mut Board) {
        let sensor = pins::SENSOR_SPI
            .iter()
            .all(|pin| board.function(*pin) == Some(pins::SPI1_FUNCTION));
        let motion = pins::MOTION_SPI
            .iter()
            .all(|pin| board.function(*pin) == Some(pins::SPI4_FUNCTION));
        let encoder = pins::ENCODER
            .iter()
            .all(|pin| board.function(*pin) == Some(pins::TIM3_4_FUNCTION));
        let display = pins::DISPLAY_I2C
            .iter()
            .all(|pin| board.function(*pin) == Some(pins::I2C1_FUNCTION));
        let mut rig = lock(&self.rig);
        rig.wire(sensor, encoder);
        rig.motion().wire(motion);
        rig.display_mut().wire(display);
    }

    /// Brings the levels that drive the sensor's and the encoder's wires to the pins that the chip reads as a port: by
    /// their alternate functions SPI and timer have them to the byte and to the edge.
    fn lines(&self, board: &mut Board, at: VirtualNanos) {
        let ids = [
            pins::SENSOR_SPI[1],
            pins::SENSOR_SPI[2],
            pins::ENCODER[0],
            pins::ENCODER[1],
        ];
        let levels = lock(&self.rig).read_pins();
        for (id, level) in ids.into_iter().zip(levels) {
            if board.function(id).is_none() {
                board.drive(at, id, level);
            }
        }
    }

    /// The chip is as after a reset: its pins are let go, and outside drivers must drive them again.
    fn restarted(&mut self, board: &mut Board, at: VirtualNanos) {
        board.redrive(at);
        if let Some(slot) = board.part.bus().slot_of("FLASH") {
            let registers = board.part.bus_mut().slot_mut(slot).registers_mut();
            let options = registers.get(FlashRegister::Optcr);
            let options = flash::with_brown_out(options, self.brown_out);
            registers.set(FlashRegister::Optcr, options);
        }
        {
            let mut rig = lock(&self.rig);
            rig.step_timer(at.0, false);
            rig.stage_duty(at.0, 0.0);
            rig.spi_control(0);
            rig.motion().control(0);
        }
        self.wire(board);
        for port in 0..=5 {
            self.port(board, at.0, port);
        }
    }

    /// Brings the rig's switches to the pins. They are normally closed to ground, the chip pulls up.
    fn switch(&mut self, board: &mut Board, at: VirtualNanos) {
        let now = {
            let mut rig = lock(&self.rig);
            let world = rig.world();
            let (lower, upper) = world.stage_limits();
            [world.lever_top(), world.e_stop(), lower, upper]
        };
        let ids = [
            pins::LEVER_TOP,
            pins::E_STOP,
            pins::STAGE_LOWER,
            pins::STAGE_UPPER,
        ];
        for ((id, actuated), shown) in ids.into_iter().zip(now).zip(&mut self.switches) {
            if *shown != Some(actuated) {
                *shown = Some(actuated);
                board.drive(at, id, (!actuated).then_some(false));
            }
        }
    }

    /// A store to the flash array, or to the register that erases it.
    fn flash(
        &mut self,
        session: &mut Session<Board>,
        host: &mut dyn Host,
        access: &Access,
    ) -> Result<(), emulator::Error> {
        let bus = session.board_mut().part.bus_mut();
        let Some(slot) = bus.slot_of("FLASH") else {
            return Ok(());
        };
        let registers = bus.slot_mut(slot).registers_mut();
        let (cr, sr) = (
            registers.get(FlashRegister::Cr),
            registers.get(FlashRegister::Sr),
        );
        if flash::ARRAY.contains(&access.address) {
            let there = host.read(access.address, access.width)?;
            if let Some(referee) = &mut self.referee {
                referee.programs(access, cr, there);
            }
            match flash::refusal(cr, access.width) {
                // programming only clears bits
                0 => {
                    let new = there & access.value & access.width.mask();
                    host.program(access.address, access.width, new)?;
                    let stored = FlashWrite::program(access.address, access.width, new);
                    self.stored.extend(stored);
                }
                flags => registers.set(FlashRegister::Sr, sr | flags),
            }
            return Ok(());
        }
        let is_busy = sr & flash::BSY != 0;
        if let Some(referee) = &mut self.referee {
            referee.controls(access, sr, self.flash_busy && is_busy);
        }
        self.flash_busy = is_busy;
        if access.value & flash::STRT != 0
            && let Some(addresses) = flash::erased(cr, sr)
        {
            self.stored.extend(FlashWrite::erase(&addresses));
            for address in addresses.step_by(8) {
                host.program(address, Width::W64, u64::MAX)?;
            }
        }
        Ok(())
    }

    /// The erase that began last is not over.
    fn keep_busy(&self, board: &mut Board) {
        let bus = board.part.bus_mut();
        if let Some(slot) = bus.slot_of("FLASH") {
            let registers = bus.slot_mut(slot).registers_mut();
            let sr = registers.get(FlashRegister::Sr);
            registers.set(FlashRegister::Sr, sr | flash::BSY);
        }
    }

    fn write(&mut self, session: &mut Session<Board>, host: &mut dyn Host, access: &Access) {
        let now = access.virtual_time;
        if let Some(switch) = self.held_off {
            switch.hold(&mut session.board_mut().part, now, access.address);
        }
        match access.address {
            address if PORTS.contains(&address) => {
                let port = ((address - PORTS.start) >> 10) as usize;
                let board = session.board_mut();
                let configures = CONFIGURATION.contains(&(address & 0x3FF));
                if configures {
                    self.wire(board);
                }
                self.port(board, now.0, port);
                if configures {
                    self.lines(board, now);
                }
            }
            I2C1_CR1 if lock(&self.rig).display_mut().holds() => {
                Switch::I2c1.off(&mut session.board_mut().part, now);
            }
            SPI1_CR1 => lock(&self.rig).spi_control(access.value),
            SPI4_CR1 => lock(&self.rig).motion().control(access.value),
            // The model raises CC1IF to CC4IF with UG while the counter stands. embassy's clock, on TIM5, would count
            // half a period too many: it would start at 65.5 ms, and some timers would come 65.5 ms late.
            TIM5_EGR => {
                let part = &mut session.board_mut().part;
                // the register is there, and its clock is on: EGR has just been written
                let _ = part.write(now, TIM5_SR, Width::W32, !0x1E);
            }
            // To rigless a pin without a crystal gets ready too. Here it does not: before its time it is off again.
            RCC_CR if !self.clock && access.value & HSEON != 0 => {
                let part = &mut session.board_mut().part;
                // the register is there
                let _ = part.write(now, RCC_CR, Width::W32, access.value & !HSEON);
            }
            address if address == FLASH_CR || flash::ARRAY.contains(&address) => {
                // the array is there as a whole
                let _ = self.flash(session, host, access);
                let slower = flash::slower(access.value).filter(|_| self.flash_slow);
                if let Some(cr) = slower.filter(|_| address == FLASH_CR) {
                    let part = &mut session.board_mut().part;
                    // the register is there
                    let _ = part.write(now, FLASH_CR, Width::W32, cr);
                }
            }
            _ => {}
        }
    }

    /// The owner's turn; `false` ends the run.
    fn obey(
        &mut self,
        session: &mut Session<Board>,
        host: &mut dyn Host,
        at: VirtualNanos,
    ) -> bool {
        if self.reached.send(at.0).is_err() {
            return false;
        }
        while let Ok(command) = self.commands.recv() {
            match command {
                Command::RunUntil(until_ns) => {
                    self.until_ns = until_ns;
                    // faults may have been injected
                    self.switch(session.board_mut(), at);
                    return true;
                }
                Command::With(act) => act(&mut Standing {
                    session,
                    host,
                    driver: self,
                }),
            }
        }
        false
    }
}

/// The level of a pin that is not left to a timer.
fn by_port(board: &mut Board, pin: PinId, timer: u8) -> Option<bool> {
    match board.function(pin) {
        Some(function) if function == timer => None,
        Some(_) => Some(false),
        None => Some(board.level(pin)),
    }
}

impl emulator::Driver<Board> for Driver {
    fn on_settled(&mut self, session: &mut Session<Board>, host: &mut dyn Host, settled: Settled) {
        if session.resets().len() != self.resets {
            self.resets = session.resets().len();
            if let Some(reset) = session.resets().last() {
                let at = reset.at;
                self.restarted(session.board_mut(), at);
            }
            if let Some(referee) = &mut self.referee {
                referee.reset();
            }
            self.flash_busy = false;
            self.held_off = None;
        }
        if let (Settled::Access { access, .. }, Some(referee)) = (&settled, &mut self.referee) {
            referee.access(access);
        }
        match settled {
            Settled::Access { access, .. } if access.kind == AccessKind::Write => {
                self.write(session, host, &access);
            }
            Settled::Hit(hit) => {
                if let Some(referee) = &mut self.referee {
                    referee.arrived(&hit, host);
                }
                if let Some(profiler) = &mut self.profiler {
                    profiler.hit(&hit, host);
                }
            }
            _ => {}
        }
    }

    fn on_stop(
        &mut self,
        session: &mut Session<Board>,
        stop: Stop,
        host: &mut dyn Host,
    ) -> Option<VirtualNanos> {
        let now = stop.at;
        self.instructions = stop.instruction_count;
        if now.0 >= self.next_tick_ns && stop.reason != StopReason::Reset {
            self.next_tick_ns = now.0 + self.tick_ns;
            let buzzes = session.board_mut().function(pins::BUZZER) == Some(pins::TIM8_FUNCTION);
            let tone = buzzes.then(|| session.board_mut().tone()).flatten();
            {
                let mut rig = lock(&self.rig);
                rig.tick(now.0);
                rig.buzzer(now.0, tone);
            }
            self.switch(session.board_mut(), now);
            if self.flash_stuck && self.flash_busy {
                self.keep_busy(session.board_mut());
            }
            if let Some(halt) = &self.halt {
                halt.last(&mut session.board_mut().part, now);
            }
            if let Some(log) = &mut self.log {
                log.drain(now.0, host);
            }
        }
        if now.0 >= self.until_ns && !self.obey(session, host, now) {
            return None;
        }
        Some(VirtualNanos(
            self.next_tick_ns.min(self.until_ns).max(now.0),
        ))
    }
}
