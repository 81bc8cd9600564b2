//! The board's serial port on a TCP port.

use std::io::{ErrorKind, Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::time::{Duration, Instant};

use anyhow::anyhow;
use clap::Args as Arguments;

use super::identify::print_log;
use crate::board::{Emulator, Options};
use crate::host::args::World;
use crate::host::arm::{ArmPort, mount};
use crate::host::learned::Chosen;

/// What is served, and where.
#[derive(Arguments)]
pub(crate) struct Args {
    #[command(flatten)]
    world: World,
    /// TCP port of this PC; 0 is any free one
    #[arg(long, value_name = "N", default_value_t = 0)]
    port: u16,
    /// Put the finger on a simulated arm, which a program moves through this TCP port of this PC; 0 is any free one.
    /// For the firmware `tactus-arm`
    #[arg(long, value_name = "N")]
    arm_port: Option<u16>,
}

/// Interval of the looks at the socket, ms.
const STEP_MS: u64 = 1;

/// Gives the line to whoever connects last, until the process ends.
pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let Args {
        world,
        port,
        arm_port,
    } = args;
    world.firmware.show(true)?;
    let chosen = Chosen::new(world)?;
    let listener = TcpListener::bind(("127.0.0.1", *port)).map_err(|why| in_use(*port, &why))?;
    listener.set_nonblocking(true)?;
    let mut board = chosen
        .unknown
        .start(&world.firmware.elf, Options::default())?;
    let mut arm = None;
    if let Some(port) = *arm_port {
        mount(&mut board, world.seed);
        let bound = ArmPort::bind(port).map_err(|why| in_use(port, &why))?;
        println!("arm at {}", bound.address()?);
        arm = Some(bound);
    }
    println!("serial port at {}, until Ctrl-C", listener.local_addr()?);
    let began = Instant::now();
    let mut client: Option<TcpStream> = None;
    loop {
        board.run_ms(STEP_MS)?;
        if let Some(arm) = &mut arm {
            arm.look(&mut board);
        }
        // the latest one has the line, as a cable has two ends
        if let Ok((stream, _)) = listener.accept() {
            stream.set_nonblocking(true)?;
            stream.set_nodelay(true)?;
            client = Some(stream);
        }
        let said: Vec<u8> = board.received().into_iter().map(|(_, byte)| byte).collect();
        if let Some(stream) = &mut client
            && let Err(why) = exchange(stream, &said, &mut board)
        {
            eprintln!("the client is gone: {why}");
            client = None;
        }
        if world.log {
            print_log(&mut board)?;
        }
        let ahead = Duration::from_nanos(board.now_ns()).saturating_sub(began.elapsed());
        std::thread::sleep(ahead);
    }
}

fn in_use(port: u16, why: &std::io::Error) -> anyhow::Error {
    anyhow!("cannot listen on port {port}: {why}. Is it in use? 0 takes any free one")
}

fn exchange(stream: &mut TcpStream, said: &[u8], board: &mut Emulator) -> std::io::Result<()> {
    let mut buffer = [0; 4096];
    match stream.read(&mut buffer) {
        Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
        Ok(length) => board.send(&buffer[..length]),
        Err(why) if why.kind() == ErrorKind::WouldBlock => {}
        Err(why) => return Err(why),
    }
    // a client that does not read shall not stop the board for good
    stream.set_nonblocking(false)?;
    stream.set_write_timeout(Some(Duration::from_secs(1)))?;
    let written = stream.write_all(said);
    stream.set_nonblocking(true)?;
    written
}
