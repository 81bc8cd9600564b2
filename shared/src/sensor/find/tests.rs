use std::vec::Vec;

use super::*;
use crate::sensor::{AnyFinger, BadWord};

/// The answers of a finger's parts to those who look for one, by the first byte that is sent.
fn found(says: impl Fn(FingerName, &Transaction) -> Vec<u8>) -> Option<FingerName> {
    find(|finger, transaction, _| {
        let answer = says(finger, transaction);
        Answer::from_slice(&answer).unwrap()
    })
}

/// As many bytes as are asked for, all the same: a line that is stuck, or that nobody drives.
fn all(byte: u8) -> impl Fn(FingerName, &Transaction) -> Vec<u8> {
    move |_, transaction| std::vec![byte; transaction.answer.into()]
}

fn is(port: u8, first: u8, transaction: &Transaction) -> bool {
    transaction.port == port && transaction.out.first() == Some(&first)
}

#[test]
fn a_line_that_is_stuck_is_no_finger() {
    for byte in [0x00, 0xFF, 0xA5] {
        assert_eq!(found(all(byte)), None, "{byte:02X}");
    }
    assert_eq!(found(|_, _| Vec::new()), None, "the bus is off");
}

#[test]
fn each_finger_is_found_by_what_its_parts_say() {
    // either of the two parts, since the other one may be broken
    let accelerometer = |finger, transaction: &Transaction| match is(0, 0x8F, transaction) {
        true => std::vec![0x7B],
        false => all(0xFF)(finger, transaction),
    };
    assert_eq!(found(accelerometer), Some(FingerName::Mems));
    let cell = |finger, transaction: &Transaction| match is(1, 0x23, transaction) {
        true => std::vec![0x0E, 0xC4, 0xC0, 0x00],
        false => all(0xFF)(finger, transaction),
    };
    assert_eq!(found(cell), Some(FingerName::Mems));
    // words, and error frames with a known code
    for word in [[0x80, 0x01], [0xA5, 0x2D]] {
        let biotac = |finger, transaction: &Transaction| match transaction.answer {
            2 if finger == FingerName::Biotac => word.to_vec(),
            _ => all(0xFF)(finger, transaction),
        };
        assert_eq!(found(biotac), Some(FingerName::Biotac));
    }
    for undriven in [0xE0, 0x00] {
        let analog = |finger, transaction: &Transaction| match finger {
            FingerName::Analog => std::vec![undriven | 0x08, 0x00],
            _ => all(0xFF)(finger, transaction),
        };
        assert_eq!(found(analog), Some(FingerName::Analog));
    }
}

/// The parts of a finger that say something else than they should are not taken for another finger.
#[test]
fn what_a_bad_cable_makes_of_words_is_no_analog_finger() {
    let garbled = |finger, transaction: &Transaction| match finger {
        FingerName::Mems => all(0xFF)(finger, transaction),
        _ => all(0xA5)(finger, transaction),
    };
    assert_eq!(found(garbled), None);
    let n = core::cell::Cell::new(0u8);
    let jumps = |finger, transaction: &Transaction| match finger {
        FingerName::Analog => {
            n.set(n.get() + 1);
            std::vec![0xE0 | n.get(), 0x00]
        }
        _ => all(0xFF)(finger, transaction),
    };
    assert_eq!(found(jumps), None);
}

/// Bytes that would change another finger's part are not sent before that finger is ruled out.
#[test]
fn nobody_is_asked_what_could_harm_another_part() {
    let mut sent = Vec::new();
    let nobody = find(|_, transaction, _| {
        sent.push((transaction.port, transaction.out));
        Answer::new()
    });
    assert_eq!(nobody, None);
    // the second select is an ADS1220's alone; on the first one an accelerometer is read before anything else is sent
    let first = sent.iter().find(|(port, _)| *port == 0).unwrap();
    assert_eq!(first.1, [0x8F, 0x00]);
    // a BioTac would stream, and be deaf
    assert!(sent.iter().all(|(_, out)| out.first() != Some(&0xA1)));
    // an accelerometer that answers is asked nothing else
    let mut after = 0;
    let mems = find(|_, transaction, _| {
        let mut answer = Answer::new();
        if is(0, 0x8F, transaction) {
            answer.push(0x7B).unwrap();
        } else if transaction.port == 0 {
            after += 1;
        }
        answer
    });
    assert_eq!((mems, after), (Some(FingerName::Mems), 0));
}

#[test]
fn errors_are_counted_by_their_kind() {
    for (name, answer, kind) in [
        (FingerName::Analog, &[][..], BadWord::Silent),
        (FingerName::Biotac, &[0x81, 0x01], BadWord::Garbled),
        (FingerName::Biotac, &[0xA5, 0x2D], BadWord::Refused),
    ] {
        let mut finger = AnyFinger::new(name);
        let why = finger.decode(0, answer).unwrap_err();
        assert_eq!((why.kind(), finger.gravity()), (Some(kind), None));
    }
    for name in FingerName::ALL {
        assert_eq!(name.parts().model.name, name);
        let slots = name.parts().slots.len() as u32;
        assert_eq!(name.parts().slot(slots), name.parts().slot(0));
    }
}
