//! The board's serial port on a TCP port.

use std::fs::File;
use std::io::{ErrorKind, Read as _, Seek as _, Write as _};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::time::{Duration, Instant};

use anyhow::anyhow;
use clap::{Args as Arguments, ValueEnum};
use tactus_world::printer::{Kind, Printer};

use super::identify::print_log;
use crate::board::{Emulator, Options};
use crate::host::args::World;
use crate::host::learned::Chosen;

/// What is served, and where.
#[derive(Arguments)]
pub(crate) struct Args {
    #[command(flatten)]
    world: World,
    /// TCP port of this PC; 0 is any free one
    #[arg(long, value_name = "N", default_value_t = 0)]
    port: u16,
    /// Put the finger on a simulated 3D printer, whose line of G-code is this TCP port of this PC; 0 is any free one.
    /// For the firmware `tactus-arm`
    #[arg(long, value_name = "N")]
    printer_port: Option<u16>,
    /// Its firmware
    #[arg(long, value_enum, default_value_t = PrinterFirmware::Marlin)]
    printer_firmware: PrinterFirmware,
}

/// Firmware of a simulated printer.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
pub(crate) enum PrinterFirmware {
    /// Marlin with its emergency parser.
    Marlin,
    /// Marlin without it.
    OldMarlin,
    /// Klipper.
    Klipper,
}

impl PrinterFirmware {
    pub(crate) fn kind(self) -> Kind {
        match self {
            Self::Klipper => Kind::Klipper,
            kind => Kind::Marlin {
                emergency_parser: kind == Self::Marlin,
            },
        }
    }
}

/// Interval of the looks at the sockets, ms.
const STEP_MS: u64 = 1;

/// A line of bytes on a TCP port: whoever connects last has it, as a cable has two ends.
pub(super) struct TcpLine {
    listener: TcpListener,
    client: Option<TcpStream>,
}

impl TcpLine {
    pub(super) fn bind(port: u16) -> anyhow::Result<Self> {
        let listener = TcpListener::bind(("127.0.0.1", port)).map_err(|why| in_use(port, &why))?;
        listener.set_nonblocking(true)?;
        let client = None;
        Ok(Self { listener, client })
    }

    pub(super) fn address(&self) -> std::io::Result<SocketAddr> {
        self.listener.local_addr()
    }

    /// Sends what was said, and returns what came.
    fn exchange(&mut self, said: &[u8]) -> std::io::Result<Vec<u8>> {
        if let Ok((stream, _)) = self.listener.accept() {
            stream.set_nonblocking(true)?;
            stream.set_nodelay(true)?;
            self.client = Some(stream);
        }
        let Some(stream) = &mut self.client else {
            return Ok(Vec::new());
        };
        let exchanged = exchange(stream, said);
        if let Err(why) = &exchanged {
            eprintln!("the client is gone: {why}");
            self.client = None;
        }
        Ok(exchanged.unwrap_or_default())
    }
}

/// A board whose lines are served, no faster than real time.
pub(super) struct Served {
    pub(super) board: Emulator,
    pub(super) serial: TcpLine,
    pub(super) printer: Option<TcpLine>,
    /// The board's time is written there, ns.
    pub(super) clock: Option<File>,
    began: Instant,
    log: bool,
}

impl Served {
    pub(super) fn new(board: Emulator, serial: TcpLine, log: bool) -> Self {
        Self {
            board,
            serial,
            printer: None,
            clock: None,
            began: Instant::now(),
            log,
        }
    }

    /// Has a printer hold the finger, whose line is served, too.
    pub(super) fn print_on(&mut self, line: TcpLine, seeds: (u64, u64), kind: Kind) {
        let printer = Printer::new(seeds.0, seeds.1, kind);
        self.board.rig().world().mount_on_printer(printer);
        self.printer = Some(line);
    }

    /// Lets a millisecond pass.
    pub(super) fn step(&mut self) -> anyhow::Result<()> {
        let board = &mut self.board;
        board.run_ms(STEP_MS)?;
        let said: Vec<u8> = board.received().into_iter().map(|(_, byte)| byte).collect();
        let came = self.serial.exchange(&said)?;
        board.send(&came);
        if let Some(line) = &mut self.printer {
            let mut rig = board.rig();
            if let Some(printer) = rig.world().printer() {
                let said = printer.said();
                printer.receive(&line.exchange(&said)?);
            }
        }
        if self.log {
            print_log(board)?;
        }
        if let Some(clock) = &mut self.clock {
            clock.rewind()?;
            clock.write_all(&board.now_ns().to_le_bytes())?;
        }
        let ahead = Duration::from_nanos(board.now_ns()).saturating_sub(self.began.elapsed());
        std::thread::sleep(ahead);
        Ok(())
    }
}

/// Serves its lines until the process ends.
pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let world = &args.world;
    world.firmware.show(true)?;
    let chosen = Chosen::new(world)?;
    let serial = TcpLine::bind(args.port)?;
    let board = chosen
        .unknown
        .start(&world.firmware.elf, Options::default())?;
    let mut served = Served::new(board, serial, world.log);
    if let Some(port) = args.printer_port {
        let line = TcpLine::bind(port)?;
        println!("printer at {}", line.address()?);
        served.print_on(line, (world.seed, world.seed), args.printer_firmware.kind());
    }
    println!("serial port at {}, until Ctrl-C", served.serial.address()?);
    loop {
        served.step()?;
    }
}

fn in_use(port: u16, why: &std::io::Error) -> anyhow::Error {
    anyhow!("cannot listen on port {port}: {why}. Is it in use? 0 takes any free one")
}

fn exchange(stream: &mut TcpStream, said: &[u8]) -> std::io::Result<Vec<u8>> {
    let mut buffer = [0; 4096];
    let came = match stream.read(&mut buffer) {
        Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
        Ok(length) => buffer.get(..length).unwrap_or_default().to_vec(),
        Err(why) if why.kind() == ErrorKind::WouldBlock => Vec::new(),
        Err(why) => return Err(why),
    };
    // a client that does not read shall not stop the board for good
    stream.set_nonblocking(false)?;
    stream.set_write_timeout(Some(Duration::from_secs(1)))?;
    let written = stream.write_all(said);
    stream.set_nonblocking(true)?;
    written.map(|()| came)
}
