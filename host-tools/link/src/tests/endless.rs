//! Requests without an end, high forces that want a button, and echoes.

use super::*;

/// The longest that a request goes on while such a probe says this every 50 ms, s; the error at its end.
fn goes_on<E: Transaction>(request: E, event: &Event, times: usize) -> (u64, String)
where
    E::Outcome: std::fmt::Debug,
{
    let time = Duration::from_secs(5);
    let host = crate::Probe::new("here", time, time);
    let mut probe = Probe::default();
    let mut get = std::pin::pin!(host.get(request));
    let mut context = std::task::Context::from_waker(std::task::Waker::noop());
    for ms in (0..).step_by(50) {
        let says: Vec<u8> = (0..times)
            .flat_map(|_| probe.event(event.clone()))
            .collect();
        host.carry(&says, Duration::from_millis(ms));
        host.to_send();
        host.said();
        if let Poll::Ready(done) = get.as_mut().poll(&mut context) {
            return (ms / 1000, done.unwrap_err().to_string());
        }
    }
    unreachable!()
}

#[test]
fn no_request_goes_on_without_an_end() {
    let live = Event::Live(wire::Live {
        ..wire::Live::default()
    });
    let (s, why) = goes_on(Request::status(), &live, 1);
    assert_eq!(s, 30);
    let status = ["the request Status", "30s", "switch it off and on"];
    assert!(status.iter().all(|words| why.contains(words)), "{why}");
    // as many bytes as the line carries in that time, at once
    let (s, why) = goes_on(Request::status(), &live, 20_000);
    assert!(s < 5 && why.contains("the request Status"), "{s} s: {why}");
    let (s, why) = goes_on(Request::command(Command::Home), &live, 1);
    assert_eq!(s, 270);
    assert!(
        why.contains("the request Home") && why.contains("emergency stop"),
        "{why}"
    );
    let (slides, movements) = (u64::from(identify().max_slides), 36);
    let (s, why) = goes_on(Request::identify(identify()), &live, 1);
    assert_eq!(s, 30 + (slides + 2 * movements) * 135, "{why}");
    let (s, why) = goes_on(ReadTable::default(), &Event::Phase(Phase::Ready), 1);
    assert_eq!(s, 300);
    assert!(why.contains("the request ReadTable"), "{why}");
}

/// A probe waits for its button for 30 s: what to press is said once, and its own answer comes before any limit.
#[test]
fn high_forces_want_the_button_and_say_so() {
    let time = Duration::from_secs(5);
    let host = crate::Probe::new("here", time, time);
    let mut probe = Probe::default();
    let status = wire::Status {
        phase: Phase::Ready,
        textures: 3,
        table_bytes: 900,
        table_crc: 7,
        calibrated: 20_261_121,
        skin_mj: (1, 1),
        // so that nobody is asked for mount or stop
        high_force: true,
        ..wire::Status::default()
    };
    let mut set = std::pin::pin!(crate::operations::set_high_force(&host, true));
    let mut context = std::task::Context::from_waker(std::task::Waker::noop());
    let mut waits = None;
    for ms in (0..60_000).step_by(50) {
        let mut says = Vec::new();
        for byte in host.to_send() {
            let Some(Ok(asked)) = probe.receiver.push::<wire::Request>(byte) else {
                continue;
            };
            match asked.command {
                Command::SetHighForce(true) => drop(waits.get_or_insert((asked.id, ms))),
                _ => says.extend([Event::Status(status.clone()), Event::Done(asked.id)]),
            }
        }
        if let Some((id, since)) = waits {
            if (ms - since) % 1000 == 0 {
                says.push(Event::Prompt(wire::Prompt::Button));
            }
            if ms - since == 30_000 {
                let why = Failure::NotPressed;
                says.push(Event::Refused { id, why });
            }
        }
        let says: Vec<u8> = says
            .into_iter()
            .flat_map(|event| probe.event(event))
            .collect();
        host.carry(&says, Duration::from_millis(ms));
        host.said();
        if let Poll::Ready(done) = set.as_mut().poll(&mut context) {
            let why = done.unwrap_err().to_string();
            assert!(why.contains("nobody pressed the blue button"), "{why}");
            let words = String::from_utf8(host.take_words()).unwrap();
            assert_eq!(words.matches("press the blue button").count(), 1, "{words}");
            return;
        }
    }
    panic!("no end");
}

#[test]
fn an_echo_is_none_of_another_version() {
    let requests = [
        Command::Status,
        Command::Home,
        Command::ReadTable(300),
        Command::Stream(true),
    ];
    for command in requests {
        let (mut session, mut send) = (Session::default(), Vec::new());
        let request = Request::command(command.clone());
        let mut job = Job::begin(request, &mut session, &mut send).unwrap();
        let sent = std::mem::take(&mut send);
        let polled = job.poll(&mut session, &sent, &mut send, |_| ());
        assert!(
            matches!(polled, Poll::Ready(Err(LinkError::Echo))),
            "{command:?}"
        );
    }
}
