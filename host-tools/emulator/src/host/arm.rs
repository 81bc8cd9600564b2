//! An arm that holds the finger of the emulated board, moved through a TCP port by a program in any language, as a real
//! arm's controller is by its driver.

use std::io::{BufRead as _, BufReader, ErrorKind, Write as _};
use std::net::{TcpListener, TcpStream};

use tactus_world::arm::Arm;

use crate::board::Emulator;

/// Puts the finger on an arm.
pub fn mount(board: &mut Emulator, seed: u64) {
    board.rig().world().mount_on(Arm::new(seed));
}

/// An arm behind a TCP port. A line "ALONG UP" commands velocities, mm/s; they hold until the next one, or until the
/// connection ends. Every 10 ms of the board's time the port sends "MS X HEIGHT ALONG": the time, the finger's place on
/// the sample and its height over it, mm, and its speed along it, mm/s, by the arm's encoders.
pub(crate) struct ArmPort {
    listener: TcpListener,
    client: Option<(BufReader<TcpStream>, String)>,
    said_ms: u64,
}

/// Time from one line of the arm to the next, ms.
const SAYS_MS: u64 = 10;

impl ArmPort {
    pub(crate) fn bind(port: u16) -> std::io::Result<Self> {
        let listener = TcpListener::bind(("127.0.0.1", port))?;
        listener.set_nonblocking(true)?;
        Ok(Self {
            listener,
            client: None,
            said_ms: 0,
        })
    }

    pub(crate) fn address(&self) -> std::io::Result<std::net::SocketAddr> {
        self.listener.local_addr()
    }

    /// Takes the received commands, and sends the arm's state: to be called every ms. An arm without a driver stands.
    pub(crate) fn look(&mut self, board: &mut Emulator) {
        if let Ok((stream, _)) = self.listener.accept()
            && stream.set_nonblocking(true).is_ok()
            && stream.set_nodelay(true).is_ok()
        {
            self.client = Some((BufReader::new(stream), String::new()));
        }
        let now_ms = board.now_ns() / 1_000_000;
        let says = now_ms >= self.said_ms + SAYS_MS;
        let mut rig = board.rig();
        let Some(arm) = rig.world().arm() else { return };
        let Some((stream, line)) = &mut self.client else {
            return;
        };
        let exchanged = take(stream, line, arm).and_then(|()| {
            if says {
                self.said_ms = now_ms;
                let (x, height, along) = (arm.x_mm(), arm.height_mm(), arm.speed_mm_s());
                let said = format!("{now_ms} {x:.4} {height:.4} {along:.3}\n");
                stream.get_mut().write_all(said.as_bytes())?;
            }
            Ok(())
        });
        if exchanged.is_err() {
            arm.go(0.0, 0.0);
            self.client = None;
        }
    }
}

/// Takes the lines that have come whole.
fn take(
    stream: &mut BufReader<TcpStream>,
    line: &mut String,
    arm: &mut Arm,
) -> std::io::Result<()> {
    loop {
        match stream.read_line(line) {
            Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
            Ok(_) if line.ends_with('\n') => {
                let mut numbers = line.split_whitespace().map(str::parse::<f64>);
                match (numbers.next(), numbers.next()) {
                    (Some(Ok(along)), Some(Ok(up))) if along.is_finite() && up.is_finite() => {
                        arm.go(along, up);
                    }
                    _ => return Err(ErrorKind::InvalidData.into()),
                }
                line.clear();
            }
            Ok(_) => {}
            Err(why) if why.kind() == ErrorKind::WouldBlock => return Ok(()),
            Err(why) => return Err(why),
        }
    }
}
