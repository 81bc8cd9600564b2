//! The emulator's interface for its users.
use std::path::Path;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard};
use std::thread::JoinHandle;

use rigless::device::ResetCause;
use rigless::emulator::{Start, run};
use rigless::image::Image;
use rigless::mcu::Operate as _;
use rigless::session::Session;
use rigless::soc::Width;
use rigless::time::VirtualNanos;
use tactus_world::faults::Fault;
use tactus_world::world::Setup;

use super::chip::Board;
use super::driver::{Command, Driver, Standing};
use super::error::Error;
use super::flash::{self, FlashWrite};
use super::halt::Halt;
use super::handler_profile::HandlerProfiler;
use super::log::Log;
use super::options::Options;
use super::pins::{self, PinId};
use super::referee::{Referee, Violation};
use super::rig::{Rig, SharedRig, lock};
use super::symbols::symbols;
use super::upset::Switch;

/// A reset of the chip.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Reset {
    /// Its time, ns.
    pub at_ns: u64,
    /// By what: the core itself, or an instance such as IWDG.
    pub cause: ResetCause,
}

/// A board that runs an ELF, with the rig on its pins. It runs only in [`Emulator::run_until`] and its like.
/// Access to the chip is an error once the run is over ([`Error::Ended`]).
pub struct Emulator {
    rig: SharedRig,
    commands: Option<Sender<Command>>,
    reached: Receiver<u64>,
    thread: Option<JoinHandle<Result<(), Error>>>,
    now_ns: u64,
    /// name, address without the Thumb bit, size in bytes
    symbols: Vec<(String, u64, u64)>,
}

impl Emulator {
    /// Powers up a board with the ELF at `path` in its flash, and the rig of `setup` on its pins; stands at time 0.
    pub fn start(path: &Path, setup: Setup, options: Options) -> Result<Self, Error> {
        let elf = std::fs::read(path).map_err(|source| Error::Read {
            path: path.into(),
            source,
        })?;
        let bad = |source| Error::Elf {
            path: path.into(),
            source,
        };
        let symbols = symbols(&elf).map_err(bad)?;
        let block = symbols.iter().find(|(name, ..)| name == "_SEGGER_RTT");
        let log = block.and_then(|(_, address, _)| Log::new(&elf, *address));
        let mut images = vec![Image::new(path, elf, None)?];
        if let Some(store) = &options.store {
            let at = Some(flash::STORE.start);
            images.push(Image::new(Path::new("store"), store.clone(), at)?);
        }
        let rig = Arc::new(Mutex::new(Rig::new(setup, &options)));
        let (commands, commanded) = channel();
        let (reaches, reached) = channel();
        let mut driver = Driver {
            rig: rig.clone(),
            commands: commanded,
            reached: reaches,
            log,
            profiler: None,
            instructions: 0,
            tick_ns: options.tick_ns.max(1),
            next_tick_ns: 0,
            until_ns: 0,
            resets: 0,
            switches: [None; 4],
            clock: options.clock,
            brown_out: options.brown_out,
            stored: Vec::new(),
            flash_busy: false,
            flash_stuck: false,
            flash_slow: false,
            held_off: None,
            scl: true,
            referee: None,
            halt: None,
        };
        let shared = rig.clone();
        let thread = std::thread::spawn(move || {
            let board = Board::new(&shared, options.instructions_per_second, options.mpu)?;
            let mut session = Session::new(Box::new(board), 0, VirtualNanos(0))?;
            driver.power_up(&mut session);
            let mut start = Start::new(&images);
            // without it a `bkpt` of the firmware would be a fault
            start.semihosting = true;
            run(session, &start, driver)?;
            Ok(())
        });
        let mut emulator = Self {
            rig,
            commands: Some(commands),
            reached,
            thread: Some(thread),
            now_ns: 0,
            symbols,
        };
        emulator.wait()?;
        emulator.with(|standing| {
            if let Some(referee) = &mut standing.driver.referee {
                referee.watch(standing.host);
            }
        })?;
        Ok(emulator)
    }

    fn wait(&mut self) -> Result<(), Error> {
        match self.reached.recv() {
            Ok(now_ns) => {
                self.now_ns = now_ns;
                Ok(())
            }
            Err(_) => Err(self.end()),
        }
    }

    fn end(&mut self) -> Error {
        self.commands = None;
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(Err(why))) => why,
            Some(Err(panic)) => std::panic::resume_unwind(panic),
            Some(Ok(Ok(()))) | None => Error::Ended,
        }
    }

    /// Virtual time since power-up, ns.
    pub fn now_ns(&self) -> u64 {
        self.now_ns
    }

    /// Goes on to a virtual time, ns; one that is past is now. Errors: [`Error::Ended`] if the firmware ended the run
    /// by semihosting, else the emulator's.
    pub fn run_until(&mut self, until_ns: u64) -> Result<(), Error> {
        if until_ns <= self.now_ns {
            return Ok(());
        }
        let sent = self
            .commands
            .as_ref()
            .map(|commands| commands.send(Command::RunUntil(until_ns)));
        match sent {
            Some(Ok(())) => self.wait(),
            _ => Err(self.end()),
        }
    }

    /// Goes on for so many ms.
    pub fn run_ms(&mut self, ms: u64) -> Result<(), Error> {
        self.run_until(self.now_ns + ms * 1_000_000)
    }

    /// Runs in steps of `step_ns` until `done` returns true, at most until `limit_ns`; returns true if it did.
    pub(crate) fn run_to(
        &mut self,
        limit_ns: u64,
        step_ns: u64,
        mut done: impl FnMut(&mut Rig) -> bool,
    ) -> Result<bool, Error> {
        while !done(&mut lock(&self.rig)) {
            if self.now_ns >= limit_ns {
                return Ok(false);
            }
            self.run_until((self.now_ns + step_ns.max(1)).min(limit_ns))?;
        }
        Ok(true)
    }

    /// The rig on the board's pins. Let go of it before the emulator runs on.
    pub fn rig(&self) -> MutexGuard<'_, Rig> {
        lock(&self.rig)
    }

    /// Breaks something on the rig now.
    pub fn inject(&mut self, fault: Fault) {
        self.rig().world().inject(fault);
    }

    /// Lets something break on the rig at a virtual time, ns, to its tick of 76 us.
    pub fn schedule(&mut self, at_ns: u64, fault: Fault) {
        self.rig().world().schedule(at_ns, fault);
    }

    /// Bytes to the firmware by USART3, as fast as the line takes them.
    pub fn send(&mut self, bytes: &[u8]) {
        self.rig().to_say.extend(bytes);
    }

    /// Bytes that the firmware sent by USART3 since the last call, with the time at which each was over, ns.
    pub fn received(&mut self) -> Vec<(u64, u8)> {
        std::mem::take(&mut self.rig().heard)
    }

    fn with<T: Send + 'static>(
        &mut self,
        act: impl FnOnce(&mut Standing<'_>) -> T + Send + 'static,
    ) -> Result<T, Error> {
        let (answer, answered) = channel();
        let command = Command::With(Box::new(move |standing| {
            // the owner waits for it below
            let _ = answer.send(act(standing));
        }));
        let sent = self.commands.as_ref().map(|to| to.send(command));
        if let Some(Ok(())) = sent
            && let Ok(answer) = answered.recv()
        {
            return Ok(answer);
        }
        Err(self.end())
    }

    /// Lines of the firmware's log since the last call, with the time at which they were read, ns.
    pub fn log(&mut self) -> Result<Vec<(u64, String)>, Error> {
        self.with(|standing| {
            let log = standing.driver.log.as_mut();
            log.map(Log::take).unwrap_or_default()
        })
    }

    /// Resets of the chip since power-up, in the order of time.
    pub fn resets(&mut self) -> Result<Vec<Reset>, Error> {
        self.with(|standing| {
            let resets = standing.session.resets().iter();
            resets
                .map(|reset| Reset {
                    at_ns: reset.at.0,
                    cause: reset.cause,
                })
                .collect()
        })
    }

    /// Registers that the firmware used and no model implements, "SYSCFG.EXTICR4" and so on.
    fn unimplemented(&mut self) -> Result<Vec<String>, Error> {
        self.with(|standing| {
            let registers = standing.session.unimplemented().values();
            registers
                .map(|used| format!("{}.{}", used.instance, used.register))
                .collect()
        })
    }

    /// Addresses that the firmware used and that are empty.
    fn unmapped(&mut self) -> Result<Vec<u64>, Error> {
        self.with(|standing| {
            let unmapped = standing.session.unmapped().into_iter();
            // stores to the array are listed, since the driver programs it
            unmapped
                .map(|access| access.address)
                .filter(|address| !flash::ARRAY.contains(address))
                .collect()
        })
    }

    /// The firmware's violations of the vendor's rules so far, and the reports of the models themselves. There should
    /// be none.
    pub fn violations(&mut self) -> Result<Vec<Violation>, Error> {
        let mut found = self.with(|standing| {
            let referee = standing.driver.referee.as_ref();
            let mut found = referee.map(Referee::found).unwrap_or_default();
            let session = &standing.session;
            let refused = session.refused().iter();
            found.extend(refused.map(|(address, why)| {
                Violation::of_models(format!("{address:#x} is refused: {why}"))
            }));
            let told = session.told();
            found.extend(told.map(|told| {
                let (instance, register) = (told.instance, told.register);
                Violation::of_models(format!("{instance}.{register}: {}", told.reason))
            }));
            found
        })?;
        let unmapped = self.unmapped()?.into_iter();
        found.extend(unmapped.map(|at| Violation::of_models(format!("nothing is at {at:#x}"))));
        // which pin gives an edge: the board does what SYSCFG does
        let unimplemented = self.unimplemented()?.into_iter();
        let unimplemented = unimplemented.filter(|name| !name.starts_with("SYSCFG"));
        found
            .extend(unimplemented.map(|name| Violation::of_models(format!("no model has {name}"))));
        Ok(found)
    }

    /// Presses the board's button or lets it go.
    pub fn press(&mut self, pressed: bool) -> Result<(), Error> {
        let at = VirtualNanos(self.now_ns);
        self.with(move |standing| {
            let board = standing.session.board_mut();
            board.drive(at, pins::BUTTON, Some(pressed));
        })
    }

    /// A resistor that holds a pin while the chip leaves it alone is missing.
    pub fn leave_open(&mut self, pin: PinId) -> Result<(), Error> {
        let at = VirtualNanos(self.now_ns);
        self.with(move |standing| standing.session.board_mut().drive(at, pin, None))
    }

    /// Levels of the green, the blue and the red LED: true is on.
    pub fn leds(&mut self) -> Result<[bool; 3], Error> {
        self.with(|standing| pins::LEDS.map(|led| standing.session.board_mut().level(led)))
    }

    /// Returns true if the go / no-go output is high.
    pub fn go(&mut self) -> Result<bool, Error> {
        self.with(|standing| standing.session.board_mut().level(pins::GO))
    }

    /// The debug probe's 8 MHz stop, for good. The chip's clock security system, where the firmware has turned it on,
    /// does all that it does but the NMI, which rigless cannot raise: write ICSR by code of your own.
    pub fn stop_clock(&mut self) -> Result<(), Error> {
        let at = VirtualNanos(self.now_ns);
        self.with(move |standing| {
            standing.driver.clock = false;
            let f427 = &mut standing.session.board_mut().part.f427;
            f427.drive_clocks(at, |rcc, registers, context| {
                rcc.fail_hse(registers, context);
            });
        })
    }

    /// Makes the flash's interrupt clear its flags without waking a task, by new code for its handler. Returns the
    /// original code and its address. Errors: [`Error::Symbol`] and [`Error::NoSpace`].
    pub fn lose_flash_interrupts(&mut self) -> Result<(u64, Vec<u8>), Error> {
        const HANDLER: &str = "FLASH";
        let (address, size) = self.symbol(HANDLER)?;
        let address = address & !1;
        // ldr r0, [pc, #4]; ldr r1, [r0]; str r1, [r0]; bx lr; FLASH_SR
        let mut code = vec![0x4801_u16, 0x6801, 0x6001, 0x4770, 0x3C0C, 0x4002];
        if !address.is_multiple_of(4) {
            // nop: the word at the end is read from a multiple of 4
            code.insert(0, 0xBF00);
        }
        let bytes: Vec<u8> = code.iter().flat_map(|c| c.to_le_bytes()).collect();
        let (name, needed) = (HANDLER, bytes.len() as u64);
        if needed > size {
            return Err(Error::NoSpace { name, size, needed });
        }
        let whole = self.read(address, needed)?;
        self.write(address, &bytes)?;
        Ok((address, whole))
    }

    /// A switch goes off; with `lasting` nothing but a reset of the chip turns it on again.
    pub fn upset(&mut self, switch: Switch, lasting: bool) -> Result<(), Error> {
        let at = VirtualNanos(self.now_ns());
        self.with(move |standing| {
            switch.off(&mut standing.session.board_mut().part, at);
            standing.driver.held_off = lasting.then_some(switch);
        })
    }

    /// The display holds its data line down until it has got so many clocks. The bus is busy meanwhile: its start is
    /// never made (chosen: I2C1 is off, as rigless has no busy bus).
    pub fn hold_display(&mut self, clocks: u32) -> Result<(), Error> {
        let at = VirtualNanos(self.now_ns);
        self.with(move |standing| {
            lock(&standing.driver.rig).display_mut().hold(clocks);
            let board = standing.session.board_mut();
            board.drive(at, pins::DISPLAY_I2C[1], Some(false));
            Switch::I2c1.off(&mut board.part, at);
        })
    }

    /// Makes every erase endless from now on: the flash stays busy.
    pub fn stick_flash(&mut self) -> Result<(), Error> {
        self.with(|standing| standing.driver.flash_stuck = true)
    }

    /// From now on an erase takes as long as with words of 8 bits: twice the typical time, which is the longest that
    /// the data sheet allows.
    pub fn slow_erases(&mut self) -> Result<(), Error> {
        self.with(|standing| standing.driver.flash_slow = true)
    }

    /// A register as the core would read it, a word.
    pub fn register(&mut self, address: u64) -> Result<u32, Error> {
        let at = VirtualNanos(self.now_ns());
        let read = self.with(move |standing| {
            let part = &mut standing.session.board_mut().part;
            part.read(at, address, Width::W32).ok()
        })?;
        read.map(|word| word as u32)
            .ok_or(Error::Memory { address })
    }

    /// A debugger halts the core, until [`Emulator::go_on`]: time passes, and everything runs that DBGMCU does not
    /// stop. With `watchdog_stands` its tool has set DBGMCU to stop the watchdog.
    pub fn halt(&mut self, watchdog_stands: bool) -> Result<(), Error> {
        let at = VirtualNanos(self.now_ns);
        self.with(move |standing| {
            standing.host.hold(true);
            let part = &mut standing.session.board_mut().part;
            standing.driver.halt = Some(Halt::begin(part, at, watchdog_stands));
        })
    }

    /// The debugger resumes the core.
    pub fn go_on(&mut self) -> Result<(), Error> {
        let at = VirtualNanos(self.now_ns);
        self.with(move |standing| {
            if let Some(halt) = standing.driver.halt.take() {
                halt.end(&mut standing.session.board_mut().part, at);
            }
            standing.host.hold(false);
        })
    }

    /// Resets the chip by its pin.
    pub fn reset(&mut self) -> Result<(), Error> {
        let at = VirtualNanos(self.now_ns);
        self.with(move |standing| standing.session.reset_by_pin(at, 0, standing.host))
    }

    /// The firmware's store as it is now; it survives a power cut.
    pub fn store(&mut self) -> Result<Vec<u8>, Error> {
        self.read(flash::STORE.start, flash::STORE.end - flash::STORE.start)
    }

    /// The firmware's writes to its store since the last call, in the order of time.
    pub fn store_writes(&mut self) -> Result<Vec<FlashWrite>, Error> {
        self.with(|standing| std::mem::take(&mut standing.driver.stored))
    }

    /// Instructions since power-up; a core that sleeps makes none.
    pub fn instructions(&mut self) -> Result<u64, Error> {
        self.with(|standing| standing.driver.instructions)
    }

    /// Counts from now on the instructions of the handlers at these addresses.
    pub(crate) fn count_handlers(&mut self, addresses: Vec<u64>) -> Result<(), Error> {
        self.with(move |standing| {
            standing.driver.profiler = Some(HandlerProfiler::new(addresses, standing.host));
        })
    }

    /// Instructions of all handlers since they are counted.
    pub fn handlers(&mut self) -> Result<u64, Error> {
        self.with(|standing| {
            let profiler = standing.driver.profiler.as_ref();
            profiler.map_or(0, |profiler| profiler.instructions)
        })
    }

    /// The address and the size, in bytes, of the one symbol that has `name` as its path or in it.
    pub fn symbol(&self, name: &str) -> Result<(u64, u64), Error> {
        let exact: Vec<_> = self.symbols.iter().filter(|(n, ..)| n == name).collect();
        let found = if exact.is_empty() {
            let within = self.symbols.iter().filter(|(n, ..)| n.contains(name));
            within.collect()
        } else {
            exact
        };
        match found[..] {
            [(_, address, size)] => Ok((*address, *size)),
            _ => Err(Error::Symbol {
                name: name.into(),
                count: found.len(),
                examples: found
                    .iter()
                    .take(5)
                    .map(|(n, ..)| n.as_str())
                    .collect::<Vec<_>>()
                    .join(", "),
            }),
        }
    }

    /// Reads memory.
    pub fn read(&mut self, address: u64, length: u64) -> Result<Vec<u8>, Error> {
        self.with(move |standing| {
            let bytes = (address..address + length).map(|address| {
                let byte = standing.host.read(address, Width::W8);
                byte.map(|byte| byte as u8)
                    .map_err(|_| Error::Memory { address })
            });
            bytes.collect()
        })?
    }

    /// Writes memory, flash too: to break code on purpose, put `[0xFE, 0xE7]`, a branch to itself, or `[0x00, 0xDE]`,
    /// an undefined instruction, at the address of a function.
    pub fn write(&mut self, address: u64, bytes: &[u8]) -> Result<(), Error> {
        let bytes = bytes.to_vec();
        self.with(move |standing| {
            for (address, byte) in (address..).zip(bytes) {
                let done = if flash::ARRAY.contains(&address) {
                    standing.host.program(address, Width::W8, byte.into())
                } else {
                    standing.host.write(address, Width::W8, byte.into())
                };
                done.map_err(|_| Error::Memory { address })?;
            }
            Ok(())
        })?
    }
}

impl Drop for Emulator {
    fn drop(&mut self) {
        // the run ends when its commands end
        self.commands = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
