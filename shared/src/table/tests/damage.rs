//! Damage of every kind, and the check that names it.

use super::*;
use crate::features::{MovementError, Properties};

proptest! {
    #![proptest_config(fixed(512))]

    #[test]
    fn no_bytes_make_it_panic(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
        prop_assert!(Table::read(&bytes).is_err());
        // and the beginning of a table, so that something is read of it
        let mut begun = small();
        begun.truncate(12);
        begun.extend(&bytes);
        read_all(&begun);
        read_all(&seal(begun));
    }

    #[test]
    fn no_damage_makes_it_panic(
        changes in proptest::collection::vec((6usize..95, any::<u8>()), 1..4),
        length in 12usize..120,
    ) {
        for good in [small(), super::fused::small_fused()] {
            let mut bytes = good[..good.len() - CRC_BYTES].to_vec();
            for &(at, byte) in &changes { bytes[at] = byte; }
            read_all(&seal(bytes.clone()));
            bytes.resize(length, 0);
            bytes[8] = (length + CRC_BYTES) as u8;
            read_all(&seal(bytes));
        }
    }
}

/// Reads everything that a table offers, if it is one.
pub(super) fn read_all(bytes: &[u8]) {
    let Ok(table) = Table::read(bytes) else {
        return;
    };
    assert_eq!(table.names().count(), usize::from(table.textures()));
    assert!(table.movements().len() <= MAX_MOVEMENTS);
    for texture in 0..table.textures() {
        let _ = (table.moved(texture), table.check_samples());
        let _ = (table.learned_slides(), table.check_learned());
        for movement in 0..table.movements().len() as u8 {
            let mut whitened = table.whitened(texture, movement);
            whitened.teach(&[5; 14]);
            whitened.adapt(&[i16::MIN; 14]);
            let fused = matches!(table.contents(), Contents::Fused(..));
            assert_eq!(table.white_mean(texture, movement).len() > 0, fused);
            let white = table.whiten(movement, &[i16::MAX; 14]);
            assert_eq!(white.is_some(), fused);
        }
        assert_eq!(table.numbered(table.number(texture)), Some(texture));
        let _ = (table.tally(texture), table.lineage(), table.next_number());
        for action in table.actions() {
            let gaussian = table.gaussian(texture, action);
            assert!(gaussian.is_none_or(|g| g.mean.is_finite() && g.sd > 0.0));
            let mut experience = table.experience(texture, action.movement);
            experience
                .learn(PropertySet::ALL, &Properties::new([Some(1.0); 3]))
                .unwrap();
            assert!(
                experience
                    .gaussian(action.property.unwrap())
                    .is_none_or(|g| g.sd >= 0.0)
            );
        }
    }
}

#[test]
fn every_flipped_bit_and_every_truncation_is_noticed() {
    for good in [small(), super::fused::small_fused()] {
        let whole = good.len();
        for at in 0..8 * whole {
            let mut bytes = good.clone();
            bytes[at / 8] ^= 1 << (at % 8);
            let named = match (at / 8, error(&bytes)) {
                (0..4, why) => why == TableError::Magic(bytes[..4].try_into().unwrap()),
                (4..6, why) => why == TableError::Version(u16::from_le_bytes([bytes[4], bytes[5]])),
                (8..12, TableError::Truncated { got, wanted }) => got == whole && wanted > whole,
                (8..12, TableError::Length { header, contents }) => {
                    header < CRC_BYTES && contents == HEADER
                }
                (8..12, TableError::Crc { .. }) => usize::from(bytes[8]) < whole,
                (_, TableError::Crc { stored, computed }) => {
                    stored == crc_of(&bytes) && computed == crc32(&bytes[..whole - CRC_BYTES])
                }
                _ => false,
            };
            assert!(named, "bit {at}: {}", error(&bytes));
        }
        for got in 0..whole {
            let wanted = if got < HEADER { HEADER } else { whole };
            assert_eq!(error(&good[..got]), TableError::Truncated { got, wanted });
        }
    }
}

/// The stored checksum.
pub(super) fn crc_of(bytes: &[u8]) -> u32 {
    u32::from_le_bytes(bytes[bytes.len() - 4..].try_into().unwrap())
}

fn length(header: usize, contents: usize) -> TableError {
    TableError::Length { header, contents }
}

#[test]
fn every_check_names_what_is_wrong() {
    assert!(Table::read(&wrong(|_| ())).is_ok());
    let at = |at: usize, byte: u8| error(&wrong(|bytes| bytes[at] = byte));
    assert_eq!(at(3, b'Z'), TableError::Magic(*b"TACZ"));
    assert_eq!(at(5, 1), TableError::Version(257));
    assert_eq!(at(6, 2), TableError::Method(2));
    assert_eq!(
        at(8, 200),
        TableError::Truncated {
            got: 107,
            wanted: 200
        }
    );
    assert_eq!(at(8, 3), length(3, 16), "too short for a checksum");
    for (field, byte) in [(6, 1), (7, 0), (7, 8), (12, 0), (14, 0), (14, 37), (15, 1)] {
        assert_eq!(at(field, byte), TableError::Header, "byte {field}");
    }
    assert_eq!(
        at(14, 36),
        length(107, 16 + 36 * 6 + 2 * 36 * 13 + 4 + 2 * 5 + 4),
        "36 movements are not too many"
    );
    assert_eq!(at(12, 3), length(107, 16 + 12 + 3 * 26 + 4 + 3 * 5 + 4));
    assert_eq!(
        at(17, 0xff),
        TableError::Movement(0, MovementError::Force(0xffee))
    );
    let unknown = wrong(|bytes| bytes[22..24].fill(0));
    let unknown = Table::read(&unknown).unwrap();
    assert!(
        !unknown.movements().nth(1).unwrap().is_known(),
        "a force that is not known, which no probe takes"
    );
    assert_eq!(
        at(26, 3),
        TableError::Movement(1, MovementError::Speed(0x3_f678))
    );
    let tally_missing = wrong(|bytes| {
        bytes.truncate(93);
        bytes[8] = 97;
    });
    assert_eq!(error(&tally_missing), length(97, 98));
    let twin = error(&wrong(|bytes| bytes.copy_within(16..22, 22)));
    assert_eq!(twin, TableError::TwinMovement(1));
    let deviation = |texture, action| TableError::Deviation { texture, action };
    let fineness = error(&wrong(|bytes| bytes[38..40].fill(0)));
    assert_eq!(fineness, deviation(0, act(0, Property::Fineness)));
    assert_eq!(at(66, 0), deviation(1, act(1, Property::Traction)));
    assert_eq!(
        at(78, 2),
        deviation(1, act(0, Property::Traction)),
        "two trials need a deviation"
    );
    let unmeasured = wrong(|bytes| {
        bytes[7] = 0b110;
        bytes[66] = 0;
    });
    assert!(
        Table::read(&unmeasured).is_ok(),
        "only what is measured needs a deviation"
    );
    assert_eq!(at(89, 0), TableError::Number(1), "twins");
    assert_eq!(at(95, 0xff), TableError::Name(0), "not UTF-8");
    let named = |names: &[u8]| {
        let bytes = wrong(|bytes| {
            bytes.truncate(94);
            bytes.extend(names);
            bytes[8] = (bytes.len() + CRC_BYTES) as u8;
        });
        Table::read(&bytes).map(|table| table.names().map(String::from).collect::<Vec<_>>())
    };
    let unnamed = |texture| TableError::Unnamed(texture, NameError::Empty);
    assert_eq!(named(b"\x01a\x01b").unwrap(), ["a", "b"]);
    assert_eq!(named(b"\x01a\x01a"), Err(TableError::Name(1)), "twins");
    assert_eq!(named(b"\x01a\0"), Err(unnamed(1)), "empty");
    assert_eq!(named(b"\0\x01a"), Err(unnamed(0)), "empty");
    assert_eq!(named(b""), Err(length(98, 99)), "no name");
    assert_eq!(
        named(b"\x05felt"),
        Err(length(103, 104)),
        "one byte of the name is missing"
    );
    assert_eq!(named(b"\x01a"), Err(length(100, 101)), "no second name");
    assert_eq!(
        named(b"\x01a\x03oa"),
        Err(length(103, 104)),
        "one byte of the second name is missing"
    );
    assert_eq!(
        named(b"\x01a\x01bc"),
        Err(TableError::Sections),
        "a byte too many"
    );
    assert_eq!(
        error(&wrong(|bytes| bytes[0] ^= 1)[..16]),
        TableError::Magic(*b"UACT"),
        "before the length"
    );
}

#[test]
fn errors_count_from_one_and_say_what_was_found() {
    let action = act(1, Property::Fineness);
    let (mean, texture) = (8.5, 2);
    let invalid = [
        TableError::Truncated { got: 5, wanted: 16 },
        TableError::Magic(*b"PK\x03\x04"),
        TableError::Version(2),
        TableError::Method(7),
        length(90, 93),
        TableError::Crc {
            stored: 0xab,
            computed: 0x1234_5678,
        },
        TableError::Movement(0, MovementError::Force(99)),
        TableError::TwinMovement(1),
        TableError::Deviation { texture: 4, action },
        TableError::Whitening(2),
        TableError::Number(3),
        TableError::Section(9),
        TableError::Name(0),
    ];
    let others = [
        EncodeError::Texture(2),
        EncodeError::NoSpace(93),
        EncodeError::Movements(0),
        EncodeError::Name(1),
        EncodeError::Range {
            texture,
            action,
            mean,
        },
    ];
    let invalid = invalid.map(EncodeError::Invalid);
    for (error, message) in invalid.into_iter().chain(others).zip([
        "truncated: 5 bytes of 16",
        "not a texture table: it begins with [50, 4b, 03, 04], not `TACT`",
        "version 2, and this program reads version 1: learn the table anew, or use the program that wrote it",
        "method 7 is unknown",
        "the header says 90 bytes, the contents take 93",
        "damaged: checksum 12345678, and 000000ab was written",
        "movement 1: contact force 99 mN is outside",
        "movement 2 is there twice",
        "texture 5, movement 2, fineness: trials, but no standard deviation",
        "the whitening of movement 3 is damaged",
        "texture 4 has another's number",
        "section 9 is damaged",
        "the name of texture 1 is not UTF-8, or another's as well",
        "the table has no texture 3",
        "the table takes 93 bytes",
        "texture 1 was not learned at every movement",
        "the name of texture 2 is longer than 40 bytes",
        "texture 3, movement 2: fineness 8.5 is beyond the table's +-8",
    ]) {
        assert!(error.to_string().contains(message), "{error}");
    }
}
