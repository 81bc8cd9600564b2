//! Tables with a valid checksum and contents that nobody should write.

use std::format;

use super::*;

/// A table of these names at one movement, two trials each, whatever they are.
fn of_names(names: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = b"TACT\x01\0\0\x07\0\0\0\0".to_vec();
    bytes.extend((names.len() as u16).to_le_bytes());
    bytes.extend([1, 0]);
    bytes.extend(MOVEMENTS[0].force_mn().to_le_bytes());
    bytes.extend(MOVEMENTS[0].speed_um_s().to_le_bytes());
    for _ in names {
        bytes.extend([100, 0, 8, 0].repeat(3));
    }
    bytes.extend(names.iter().map(|_| 2));
    bytes.extend([0; 4]);
    for number in 0..names.len() as u16 {
        let [low, high] = number.to_le_bytes();
        bytes.extend([low, high, 3, 0, 0]);
    }
    for name in names {
        bytes.push(name.len() as u8);
        bytes.extend(name);
    }
    let length = (bytes.len() + 4) as u32;
    bytes[8..12].copy_from_slice(&length.to_le_bytes());
    seal(bytes)
}

fn named(name: &str) -> Result<(), TableError> {
    Table::read(&of_names(&[b"felt".to_vec(), name.into()])).map(|_| ())
}

#[test]
fn a_table_has_no_more_textures_than_a_probe_takes() {
    let numbered =
        |count: usize| of_names(&(0..count).map(|n| n.to_string().into()).collect::<Vec<_>>());
    assert_eq!(Table::read(&numbered(128)).unwrap().textures(), 128);
    for count in [129, 1700, 2900] {
        assert_eq!(error(&numbered(count)), TableError::Textures(count as u16));
    }
    let mut out = vec![0; 100_000];
    let names: Vec<String> = (0..129).map(|n| n.to_string()).collect();
    let known = [Experience::default(); 2];
    let textures = names.iter().map(|name| (&**name, &known[..]));
    let written = encode(&mut out, PropertySet::ALL, &MOVEMENTS, textures).map(|_| ());
    assert_eq!(
        written,
        Err(EncodeError::Invalid(TableError::Textures(129)))
    );
}

#[test]
fn a_name_is_printable_text_of_1_to_40_bytes() {
    let most = "x".repeat(40);
    for good in [
        "a",
        &most,
        "Böse Überraschung",
        "絨毯 3",
        "עור",
        "سجاد",
        "naïve",
        "🧶",
        "a b",
    ] {
        assert_eq!(named(good), Ok(()), "{good}");
        assert_eq!(valid_name(good).as_deref(), Ok(good));
    }
    let unnamed = |why| Err(TableError::Unnamed(1, why));
    assert_eq!(named(""), unnamed(NameError::Empty));
    assert_eq!(named(" \u{3000}"), unnamed(NameError::Empty));
    for long in [41, 100, 255] {
        assert_eq!(named(&"y".repeat(long)), unnamed(NameError::Long(long)));
    }
    assert_eq!(
        named(&"語".repeat(14)),
        unnamed(NameError::Long(42)),
        "bytes, not characters"
    );
    // control, both ends of it; direction, joined, hidden, private
    for code in (0..0x20).chain(0x7f..0xa0).chain([
        0xad, 0x61c, 0x180e, 0x200b, 0x200e, 0x200f, 0x2028, 0x2029, 0x202a, 0x202b, 0x202c,
        0x202d, 0x202e, 0x2060, 0x2066, 0x2067, 0x2068, 0x2069, 0x206f, 0xe000, 0xfe0f, 0xfeff,
        0xfff9, 0xffff, 0xe_0001, 0xe_0041, 0x10_fffd,
    ]) {
        let hidden = char::from_u32(code).unwrap();
        for name in [
            format!("a{hidden}b"),
            format!("{hidden}b"),
            format!("b{hidden}"),
        ] {
            assert_eq!(
                named(&name),
                unnamed(NameError::Unprintable(code)),
                "{code:x}"
            );
        }
    }
    for not_text in [&b"\xff"[..], b"a\xc3", b"\xed\xa0\x80"] {
        let bytes = of_names(&[b"felt".to_vec(), not_text.to_vec()]);
        assert_eq!(error(&bytes), TableError::Name(1));
    }
    assert_eq!(named("felt"), Err(TableError::Name(1)));
}

/// Names whose checksums are those of others are compared, too.
#[test]
fn names_with_the_same_checksum_are_not_twins() {
    let (one, other) = ("plumless", "buckeroo");
    assert_eq!(crc32(one.as_bytes()), crc32(other.as_bytes()));
    let bytes = of_names(&[one.into(), other.into()]);
    assert_eq!(Table::read(&bytes).unwrap().find(other), Some(1));
    let bytes = of_names(&[one.into(), other.into(), one.into()]);
    assert_eq!(error(&bytes), TableError::Name(2));
}

#[test]
fn numbers_that_no_table_is_written_with_are_refused() {
    let good = of_names(&[b"felt".to_vec()]);
    assert!(Table::read(&good).is_ok());
    let least = |sd: u16| {
        let mut bytes = good[..good.len() - 4].to_vec();
        bytes[24..26].copy_from_slice(&sd.to_le_bytes());
        Table::read(&seal(bytes)).map(|_| ())
    };
    let action = act(0, Property::Traction);
    for sd in 0..8 {
        let why = TableError::Deviation { texture: 0, action };
        assert_eq!(
            least(sd),
            Err(why),
            "{sd} steps are less than is ever written"
        );
    }
    assert_eq!((least(8), least(u16::MAX)), (Ok(()), Ok(())));
}

#[test]
fn sections_that_nobody_knows_are_few() {
    let with = |count: u32, kind: u8| {
        let mut bytes = of_names(&[b"felt".to_vec()]);
        bytes.truncate(bytes.len() - 4);
        bytes.extend([kind, 0, 0, 0].repeat(count as usize));
        let length = (bytes.len() + 4) as u32;
        bytes[8..12].copy_from_slice(&length.to_le_bytes());
        Table::read(&seal(bytes)).map(|_| ())
    };
    assert_eq!(with(32, 99), Ok(()));
    for count in [33, 16_000] {
        assert_eq!(with(count, 99), Err(TableError::Sections));
    }
    assert_eq!(
        with(1, 5),
        Err(TableError::Section(5)),
        "a finger without its code"
    );
}
