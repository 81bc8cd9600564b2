//! Requests that come while the probe is busy.

use super::*;

/// The desk that everybody may see and touch.
#[derive(Default)]
struct Desk {
    told: vec::Vec<Event>,
    stopped: vec::Vec<bool>,
    streams: bool,
}

impl Panel for Desk {
    fn finger(&self) -> FingerCode {
        FingerCode::BIOTAC
    }

    fn rig(&self) -> RigState {
        RigState {
            phase: Phase::Faulted(crate::rig::Fault::EStop),
            skin: SkinCare::after(1.5, 0.25),
            ..RigState::parked(CALIBRATION)
        }
    }

    fn table(&self) -> TableInUse {
        TableInUse {
            textures: 3,
            bytes: 200,
            crc: 77,
            factory: false,
            false_alarm: Some(0.1),
        }
    }

    fn counts(&self) -> Counts {
        Counts {
            late_slots: 5,
            ..Counts::default()
        }
    }

    fn stop(&mut self, all: bool) {
        self.stopped.push(all);
    }

    fn stream(&mut self, on: bool) {
        self.streams = on;
    }

    fn tell(&mut self, event: Event) {
        self.told.push(event);
    }
}

#[test]
fn what_comes_while_the_probe_is_busy_is_answered_or_refused() {
    let mut desk = Desk::default();
    let sent =
        |command: Command, busy, desk: &mut Desk| receive(&Request { id: 9, command }, busy, desk);
    assert_eq!(sent(Command::Status, true, &mut desk), Turn::Now);
    let [Event::Status(status), Event::Done(9)] = &desk.told[..] else {
        panic!("{:?}", desk.told);
    };
    assert_eq!(
        *status,
        Status {
            phase: crate::wire::Phase::Faulted,
            fault: Some(crate::rig::Fault::EStop),
            textures: 3,
            table_bytes: 200,
            table_crc: 77,
            factory: false,
            calibrated: 20_261_121,
            counts: desk.counts(),
            skin_mj: (1500, 250),
            false_alarm: Some(0.1),
            high_force: false,
            finger: FingerCode::BIOTAC,
        }
    );
    desk.told.clear();
    sent(Command::ReadCalibration, true, &mut desk);
    let bytes = CALIBRATION.to_bytes();
    assert!(
        matches!(&desk.told[..], [Event::Calibration(told), Event::Done(9)] if told[..] == bytes)
    );
    desk.told.clear();
    // nothing to stop for good where nothing was asked for
    sent(Command::Stop, false, &mut desk);
    sent(Command::Stop, true, &mut desk);
    assert_eq!(desk.stopped, [false, true]);
    sent(Command::Stream(true), false, &mut desk);
    assert!(desk.streams);
    sent(Command::Stream(false), true, &mut desk);
    assert!(!desk.streams);
    assert_eq!(
        desk.told,
        [
            Event::Done(9),
            Event::Done(9),
            Event::Done(9),
            Event::Done(9)
        ]
    );
    desk.told.clear();
    assert_eq!(sent(Command::Home, true, &mut desk), Turn::Busy);
    assert!(
        matches!(&desk.told[..], [Event::Refused { id: 9, why }] if *why == Failure::Busy),
        "{:?}",
        desk.told
    );
    desk.told.clear();
    assert_eq!(sent(Command::Home, false, &mut desk), Turn::Queue);
    assert_eq!(desk.told, [], "it has its answer when it is done");
}

#[test]
fn a_request_is_answered_by_its_number_when_it_is_over() {
    let mut probe = probe();
    let request = |id, command| Request { id, command };
    block_on(probe.serve(&request(3, Command::Home)));
    probe.rig.refuses = true;
    block_on(probe.serve(&request(4, Command::Home)));
    let jams = Event::Refused {
        id: 4,
        why: Failure::Rig(JAMS),
    };
    assert_eq!(probe.events.told, [Event::Done(3), jams]);
    assert_eq!(probe.rig.homed, 1);
}
