//! Transactions over a port, and losses that want a copy and a yes.

use super::*;

/// A line that gives what the probe answers, piece by piece, and times out in between.
struct Line {
    probe: Probe,
    answer: VecDeque<u8>,
    silent: bool,
}

impl Read for Line {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let n = self.answer.len().min(buffer.len()).min(7);
        if n == 0 {
            return Err(io::ErrorKind::WouldBlock.into());
        }
        for (to, from) in buffer.iter_mut().zip(self.answer.drain(..n)) {
            *to = from;
        }
        Ok(n)
    }
}

impl Write for Line {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if !self.silent {
            self.answer.extend(self.probe.receive(bytes));
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[test]
fn a_port_runs_transactions() {
    let bytes = table(20);
    let line = Line {
        probe: Probe {
            parts: 1,
            ..Probe::default()
        },
        answer: VecDeque::new(),
        silent: false,
    };
    let time = Duration::from_millis(50);
    let probe = crate::Probe::new("here", time, time);
    let mut port = Port::new(line, probe.clone());
    let push = PushTable::new(&bytes).unwrap();
    port.run(probe.get(push)).unwrap();
    assert_eq!(*port.run(probe.table()).unwrap(), *bytes);
    assert_eq!(probe.losses(), (0, 0));
    port.stream.silent = true;
    // pulled once, and known from then on
    assert_eq!(*port.run(probe.table()).unwrap(), *bytes);
    let silent = port.run(probe.get(ReadTable::default())).unwrap_err();
    assert!(
        silent
            .to_string()
            .starts_with("here: the probe said nothing for"),
        "{silent}"
    );
}

/// Disturbance of a stretch of bytes on the line.
/// Sends without end, and nothing of it is a report.
struct Noise;

impl Read for Noise {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        buffer.fill(0x55);
        Ok(buffer.len())
    }
}

impl Write for Noise {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[test]
fn bytes_without_end_are_no_answer() {
    for request in [Command::Stop, Command::Home].map(Request::command) {
        let time = Duration::from_millis(1);
        let probe = crate::Probe::new("here", time, time);
        let mut port = Port::new(Noise, probe.clone());
        let began = Instant::now();
        let why = port.run(probe.get(request)).unwrap_err();
        assert!(began.elapsed() < Duration::from_secs(10));
        let is_garbage = |why: &PortError| matches!(why, PortError::Garbage(1..));
        let garbage = matches!(&why, OperationError::Port { why, .. } if is_garbage(why));
        assert!(garbage, "{why}");
    }
}

/// Does an operation; its file is kept or not, and its question answered like this.
fn does<T>(
    operation: impl Future<Output = T>,
    host: &crate::Probe,
    probe: &mut Probe,
    (keeps, says): (bool, bool),
) -> T {
    let (mut operation, mut now) = (std::pin::pin!(operation), Duration::ZERO);
    let mut context = std::task::Context::from_waker(std::task::Waker::noop());
    loop {
        if let Poll::Ready(done) = operation.as_mut().poll(&mut context) {
            return done;
        }
        now += Duration::from_millis(10);
        host.carry(&probe.receive(&host.to_send()), now);
        if let Some(backup) = host.backup() {
            assert_eq!(backup.bytes, probe.table);
            let full = Err("the disk is full".to_owned());
            host.kept(if keeps { Ok(backup.name) } else { full });
        }
        if host.question().is_some() {
            host.answer(says);
        }
    }
}

#[test]
fn nothing_is_lost_without_a_copy_and_a_yes() {
    let mut probe = Probe {
        parts: usize::MAX,
        table: table(3),
        ..Probe::default()
    };
    let time = Duration::from_secs(5);
    let host = crate::Probe::new("here", time, time);
    let forget = || operations::forget(&host, Forget::SelfLearned);
    let forgets = |command: &Command| matches!(command, Command::Forget(_));
    let reads = |command: &Command| matches!(command, Command::ReadTable(_));
    for (answers, why) in [
        ((false, true), "the disk is full"),
        ((true, false), "nothing was changed"),
    ] {
        let said = does(forget(), &host, &mut probe, answers).unwrap_err();
        assert_eq!(said.to_string(), why);
        assert!(!probe.asked.iter().any(forgets));
    }
    does(forget(), &host, &mut probe, (true, true)).unwrap();
    assert!(probe.asked.iter().any(forgets));
    // pulled once, and once more after it may have become another one
    let pulled = |probe: &Probe| probe.asked.iter().filter(|c| reads(c)).count();
    assert_eq!(pulled(&probe), 1);
    does(host.table(), &host, &mut probe, (true, true)).unwrap();
    assert_eq!(pulled(&probe), 2);
}
