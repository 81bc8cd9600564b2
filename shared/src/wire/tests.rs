use super::*;
use crate::explorer::Method;
use crate::features::{
    BLOCK, Block, FUSED_BANDS, Movement, Properties, Property, PropertySet, SlideError,
};
use crate::rig::{Fault, RigError};
use crate::table::{Action, MAX_TEXTURES, Name};
use heapless::Vec;
use proptest::prelude::*;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::vec;

fn frame(message: &impl Serialize) -> std::vec::Vec<u8> {
    let mut buffer = [0; MAX_FRAME + 1];
    encode(message, &mut buffer).unwrap().to_vec()
}

fn receive<M: DeserializeOwned>(bytes: &[u8]) -> std::vec::Vec<Result<M, FrameError>> {
    let mut receiver = Receiver::default();
    bytes
        .iter()
        .filter_map(|&byte| receiver.push(byte))
        .collect()
}

fn report(event: Event) -> Report {
    Report {
        number: 7,
        at_ms: 1234,
        event,
    }
}

/// The longest events; shorter ones have golden frames.
fn longest() -> vec::Vec<Report> {
    let action = Action {
        movement: 35,
        property: Some(Property::Fineness),
    };
    let observed = SlideReport {
        properties: [Some(1.0), Some(f32::MAX), Some(-2.5)],
        roughness_is_bound: true,
        background: 2.2,
        bands: Vec::from_slice(&[i16::MIN; FUSED_BANDS]).unwrap(),
        pressure: Some([i16::MAX, i16::MIN]),
        pace: Some(i16::MIN),
    };
    let outcome = ExpectedOutcome {
        action,
        uncertainty: 0.5,
        benefit: 0.7,
    };
    let text = || Text::try_from("ä".repeat(60).as_str()).unwrap();
    vec![
        report(Event::SlideReport {
            slide: 255,
            action,
            observed: observed.clone(),
            posterior: Vec::from_slice(&[0.25; MAX_TEXTURES]).unwrap(),
        }),
        report(Event::Chosen {
            slide: 1,
            movement: Movement::FOR_TRACTION,
            action,
            expected: Vec::from_slice(&[outcome; MAX_EXPECTED_OUTCOMES]).unwrap(),
        }),
        report(Event::Block(Block {
            number: u16::MAX,
            still: false,
            steady: Some((u32::MAX, u32::MAX)),
            pac: Vec::from_slice(&[i16::MIN; BLOCK]).unwrap(),
            shear_mn: Vec::from_slice(&[i16::MAX; BLOCK]).unwrap(),
            lost: u32::MAX,
        })),
        report(Event::TablePart {
            offset: u32::MAX,
            length: u32::MAX,
            bytes: Vec::from_slice(&[0; PART]).unwrap(),
        }),
        report(Event::Refused {
            id: u16::MAX,
            why: Failure::Said(text()),
        }),
    ]
}

/// The longest name there is.
fn name(letter: char) -> Name {
    core::iter::repeat_n(letter, Name::new().capacity()).collect()
}

/// The longest requests; shorter ones have golden frames.
fn requests() -> [Request; 3] {
    let identify = Identify {
        among: Vec::from_slice(&[u16::MAX; MAX_TEXTURES]).unwrap(),
        threshold: 0.999,
        max_slides: 255,
        method: Some(Method::Fused),
        strategy: crate::explorer::Strategy::Random,
        open: true,
        learn: true,
        seed: u32::MAX,
        false_alarm: Some(0.02),
    };
    let rename = Command::Rename {
        from: name('f'),
        to: name('t'),
    };
    let part = Command::WriteTable {
        offset: u32::MAX,
        bytes: Vec::from_slice(&[0; PART]).unwrap(),
    };
    let id = u16::MAX;
    [Command::Identify(identify), rename, part].map(|command| Request { id, command })
}

#[test]
fn the_longest_messages_fit() {
    for message in longest() {
        let bytes = frame(&message);
        assert_eq!(bytes.iter().filter(|&&b| b == 0).count(), 1, "only the end");
        assert_eq!(receive::<Report>(&bytes), [Ok(message)]);
    }
    for request in requests() {
        assert_eq!(receive::<Request>(&frame(&request)), [Ok(request)]);
    }
}

/// By hand: id 0x0102 as a varint 82 02, `Status` is variant 0; COBS by its definition; the CRC by another library.
#[test]
fn a_request_has_these_bytes() {
    let request = Request {
        id: 0x0102,
        command: Command::Status,
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
        command: Command::Stream(true),
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
        command: Command::Stop,
    };
    bytes.extend(frame(&request));
    assert_eq!(receive(&bytes), [Err(FrameError::TooLong), Ok(request)]);
}

#[test]
fn a_message_too_long_is_an_error() {
    let mut buffer = [0; MAX_FRAME + 1];
    let fits = ([1_u8; 32], [1_u8; 32], [1_u8; 32], [[1_u8; 32]; 21]);
    assert!(encode(&fits, &mut buffer).is_ok(), "768 bytes");
    assert_eq!(buffer.iter().position(|&b| b == 0), Some(MAX_FRAME));
    assert_eq!(encode(&(fits, 1_u8), &mut buffer), Err(TooLong));
}

#[test]
fn a_posterior_has_only_its_textures_that_are_possible() {
    let mut posterior = Vec::<f32, MAX_TEXTURES>::new();
    posterior.resize(117, 0.0).unwrap();
    posterior[3] = 0.75;
    // too little to count: a verdict must not wait for a hundred of these
    posterior[40] = 9e-7;
    posterior[116] = 0.25;
    #[derive(PartialEq, Debug, Serialize, Deserialize)]
    struct Posterior(#[serde(with = "sparse")] Vec<f32, MAX_TEXTURES>);
    let mut posterior = Posterior(posterior);
    let mut buffer = [0; 16];
    let bytes = postcard::to_slice(&posterior, &mut buffer).unwrap();
    // how many textures, how many possible ones, and each of these with its place
    assert_eq!(bytes, [117, 2, 3, 0, 0, 0x40, 0x3F, 116, 0, 0, 0x80, 0x3E]);
    posterior.0[40] = 0.0;
    assert_eq!(postcard::from_bytes(bytes), Ok(posterior));
    let read = |count: u8, places: [u8; 2]| {
        let [a, b] = places;
        let bytes = [count, 2, a, 0, 0, 0x40, 0x3F, b, 0, 0, 0x80, 0x3E];
        postcard::from_bytes::<Posterior>(&bytes).is_ok()
    };
    assert!(read(100, [3, 99]));
    assert!(!read(100, [3, 100]), "more than there are");
    assert!(!read(100, [3, 3]), "one twice");
    assert!(!read(100, [99, 3]), "in another order");
    let many = [129, 1, 0];
    assert!(postcard::from_bytes::<Posterior>(&many).is_err());
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
fn a_slide_report_goes_both_ways() {
    let observed = SlideReport {
        properties: [None, Some(2.0), Some(3.0)],
        roughness_is_bound: false,
        background: 1.0,
        bands: Vec::from_slice(&[-3, 5]).unwrap(),
        pressure: Some([7, 8]),
        pace: Some(-9),
    };
    let observation = observed.observation();
    assert_eq!(observation.properties, Properties::new(observed.properties));
    assert_eq!(observation.bands, [-3, 5]);
    assert_eq!(observation.pressure, Some([7, 8]));
    assert_eq!(observation.pace, Some(-9));
    let measured = observed.properties().measured();
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

#[test]
fn what_a_rig_gets_over_by_itself_asks_nothing_of_a_person() {
    let of = |fault| Rejection::Rig(RigError::Fault(fault));
    for (why, said) in [
        (Failure::Slide(of(Fault::LeverSlips)), "lever slips"),
        (
            Failure::Slide(of(Fault::EStop)),
            "emergency stop: release it, then reset",
        ),
        // the end of an exploration does
        (
            Failure::NoGoodSlide(of(Fault::LeverSlips)),
            "no movement gives a good slide: lever slips: check the lever's motor and its current, then reset",
        ),
        (
            Failure::Slide(Rejection::Slide(SlideError::Gap(3))),
            "samples were lost: 3",
        ),
    ] {
        assert_eq!(super::text(why).as_str(), said);
    }
}
