use super::*;
use crate::features::PropertySet;
use proptest::prelude::*;
use std::vec;

fn frame(message: &impl Serialize) -> std::vec::Vec<u8> {
    let mut room = [0; MAX_FRAME + 1];
    encode(message, &mut room).unwrap().to_vec()
}

fn receive<M: DeserializeOwned>(bytes: &[u8]) -> std::vec::Vec<Result<M, FrameError>> {
    let mut receiver = Receiver::default();
    bytes
        .iter()
        .filter_map(|&byte| receiver.push(byte))
        .collect()
}

fn report(tell: Tell) -> Report {
    Report {
        number: 7,
        at_ms: 1234,
        tell,
    }
}

/// The longest of each kind that carries lists.
fn longest() -> vec::Vec<Report> {
    let action = Action {
        movement: 35,
        property: Property::Fineness,
    };
    let felt = Felt {
        properties: [Some(1.0), None, Some(-2.5)],
        roughness_is_bound: true,
        background: 2.2,
        ln_bands: [0.1; 8],
    };
    let promise = Promise {
        action,
        uncertainty: 0.5,
        benefit: 0.7,
    };
    let text = || Text::try_from("ä".repeat(60).as_str()).unwrap();
    vec![
        report(Tell::Felt {
            slide: 255,
            action,
            felt,
            posterior: Vec::from_slice(&[0.25; MAX_TEXTURES]).unwrap(),
        }),
        report(Tell::Chosen {
            slide: 1,
            movement: Movement::FOR_TRACTION,
            action,
            outlook: Vec::from_slice(&[promise; MAX_OUTLOOK]).unwrap(),
        }),
        report(Tell::Block(Block {
            number: u16::MAX,
            still: false,
            steady: Some((u32::MAX, u32::MAX)),
            pac: Vec::from_slice(&[i16::MIN; BLOCK]).unwrap(),
            shear_mn: Vec::from_slice(&[i16::MAX; BLOCK]).unwrap(),
            lost: u32::MAX,
        })),
        report(Tell::TablePart {
            offset: u32::MAX,
            length: u32::MAX,
            bytes: Vec::from_slice(&[0; PART]).unwrap(),
        }),
        report(Tell::Refused {
            id: u16::MAX,
            why: text(),
        }),
        report(Tell::Booted {
            protocol: PROTOCOL,
            version: String::try_from("0.1.0").unwrap(),
            reset: Reset::Watchdog,
            last_words: Some(text()),
        }),
    ]
}

#[test]
fn the_longest_messages_fit() {
    for message in longest() {
        let bytes = frame(&message);
        assert_eq!(bytes.iter().filter(|&&b| b == 0).count(), 1, "only the end");
        assert_eq!(receive::<Report>(&bytes), [Ok(message)]);
    }
}

/// By hand: id 0x0102 as a varint 82 02, `Status` is variant 0; COBS by its definition; the CRC by another library.
#[test]
fn a_request_has_these_bytes() {
    let request = Request {
        id: 0x0102,
        ask: Ask::Status,
    };
    // crc32(82 02 00) by Python's zlib
    let crc = 0x2fc6_747e_u32.to_le_bytes();
    assert_eq!(
        frame(&request),
        [3, 0x82, 0x02, 5, crc[0], crc[1], crc[2], crc[3], 0]
    );
}

#[test]
fn a_damaged_frame_is_dropped_and_the_next_one_understood() {
    let request = |id| Request {
        id,
        ask: Ask::Stream(true),
    };
    let mut bytes = frame(&request(1));
    bytes[2] ^= 0x40;
    bytes.extend(frame(&request(2)));
    assert_eq!(receive(&bytes), [Err(FrameError::Crc), Ok(request(2))]);
    // half a frame, then a whole one behind it: the 0 between them was lost
    let mut bytes = frame(&request(1));
    bytes.pop();
    bytes.extend(frame(&request(2)));
    bytes.extend(frame(&request(3)));
    let got = receive::<Request>(&bytes);
    assert!(got[0].is_err());
    assert_eq!(got[1], Ok(request(3)));
}

#[test]
fn an_endless_frame_is_one_error() {
    let mut bytes = vec![1; 5 * MAX_FRAME];
    bytes.push(0);
    let request = Request {
        id: 9,
        ask: Ask::Stop,
    };
    bytes.extend(frame(&request));
    assert_eq!(receive(&bytes), [Err(FrameError::TooLong), Ok(request)]);
}

#[test]
fn a_message_too_long_is_an_error() {
    let mut room = [0; MAX_FRAME + 1];
    let fits = ([1_u8; 32], [1_u8; 32], [1_u8; 32], [[1_u8; 32]; 21]);
    assert!(encode(&fits, &mut room).is_ok(), "768 bytes");
    assert_eq!(room.iter().position(|&b| b == 0), Some(MAX_FRAME));
    assert_eq!(encode(&(fits, 1_u8), &mut room), Err(TooLong));
}

#[test]
fn values_that_cannot_be_are_no_message() {
    // a movement of 50 N: whole frame, right CRC
    let wrong = (7_u16, 1234_u32, (7_u8, 1_u8, (50_000_u16, 10_000_u32)));
    assert_eq!(
        receive::<Report>(&frame(&wrong)),
        [Err(FrameError::Message)]
    );
    let unknown = (7_u16, 200_u8);
    assert_eq!(
        receive::<Request>(&frame(&unknown)),
        [Err(FrameError::Message)]
    );
    let trailing = (7_u16, 0_u8, 1_u8);
    assert_eq!(
        receive::<Request>(&frame(&trailing)),
        [Err(FrameError::Message)]
    );
}

#[test]
fn what_was_felt_goes_both_ways() {
    let felt = Felt {
        properties: [None, Some(2.0), Some(3.0)],
        roughness_is_bound: false,
        background: 1.0,
        ln_bands: [0.0; 8],
    };
    let measured = felt.properties().measured();
    let expected: PropertySet = [Property::Roughness, Property::Fineness]
        .into_iter()
        .collect();
    assert_eq!(measured, expected);
}

proptest! {
    #[test]
    fn any_bytes_are_survived(bytes in proptest::collection::vec(any::<u8>(), 0..2000)) {
        for got in receive::<Request>(&bytes) {
            // a CRC of 32 bits does not fit by chance
            prop_assert!(got.is_err());
        }
    }

    #[test]
    fn one_wrong_byte_is_noticed(at in 0_usize..600, flip in 1_u8..) {
        let message = &longest()[0];
        let mut bytes = frame(message);
        let at = at % bytes.len();
        bytes[at] ^= flip;
        let got = receive::<Report>(&bytes);
        prop_assert!(got.iter().all(Result::is_err), "{got:?}");
    }
}
