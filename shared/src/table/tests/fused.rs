//! Fused tables against one written by hand; learning, renaming and deleting in tables of either kind.

use super::damage::read_all;
use super::*;
use crate::table::tests::whitening::{Noise, by_hand};

const BANDS: FeatureSet = FeatureSet::Bands;

/// Two textures, two movements and two features, field by field as the module's page has it: movements begin at byte
/// 16, whitenings at 28, cells at 52, trials at 68, the lineage at 72, numbers and tallies at 76, names at 86.
pub(super) fn small_fused() -> Vec<u8> {
    let mut bytes = b"TACT\x01\0\x01\x06\x67\0\0\0\x02\0\x02\x02".to_vec();
    bytes.extend(b"\xee\x04\x10\x27\0\0"); // 1262 mN, 10000 um/s
    bytes.extend(b"\xc8\0\x78\xf6\0\0"); // 200 mN, 63096 um/s
    bytes.extend(by_hand());
    bytes.extend(b"\0\0\0\0\x0e\x0e\0\x40\0\0\0\0\0\x40"); // the straight one
    bytes.extend(b"\0\x01\0\xff"); // felt, 1: 256, -256
    bytes.extend(b"\0\0\0\0"); // felt, 2: no slide
    bytes.extend(b"\xff\x7f\0\x80"); // oak, 1: the ends
    bytes.extend(b"\x01\0\x02\0"); // oak, 2: 1, 2
    bytes.extend(b"\x05\0\x01\xff");
    bytes.extend([0; 4]); // made from no other
    bytes.extend(b"\0\0\x05\0\0"); // felt: number 0, 5 slides from the factory
    bytes.extend(b"\x01\0\xff\0\0"); // oak: number 1, 255 and more
    bytes.extend(b"\x04felt\x03oak");
    seal(bytes)
}

fn wrong_fused(change: impl FnOnce(&mut Vec<u8>)) -> Vec<u8> {
    let mut bytes = small_fused();
    bytes.truncate(bytes.len() - CRC_BYTES);
    change(&mut bytes);
    seal(bytes)
}

fn steps(slides: u8, mean: [i16; 2]) -> Whitened {
    let mut whitened = Whitened {
        slides,
        ..Whitened::default()
    };
    whitened.mean[..2].copy_from_slice(&mean);
    whitened
}

fn rows() -> [(&'static str, Vec<Whitened>); 2] {
    let felt = vec![steps(5, [256, -256]), steps(0, [0, 0])];
    let oak = vec![steps(1, [i16::MAX, i16::MIN]), steps(255, [1, 2])];
    [("felt", felt), ("oak", oak)]
}

fn movements() -> [(Movement, Whitening); 2] {
    [
        (MOVEMENTS[0], Whitening::read(&by_hand(), 2).unwrap()),
        (MOVEMENTS[1], straight(2)),
    ]
}

fn write<'a>(
    set: FeatureSet,
    movements: &[(Movement, Whitening)],
    textures: &'a [(&'a str, Vec<Whitened>)],
) -> Result<Vec<u8>, EncodeError> {
    let mut out = vec![0xa5; 100_000];
    let textures = textures
        .iter()
        .map(|(name, known)| (*name, known.as_slice()));
    let table = encode_fused(&mut out, set, movements, textures)?;
    Ok(table.as_bytes().to_vec())
}

#[test]
fn the_fused_form_is_the_documented_one() {
    assert_eq!(write(BANDS, &movements(), &rows()).unwrap(), small_fused());
    let names = 4 + 1 + 3 + 1;
    assert_eq!(encoded_len(Contents::Fused(BANDS, 2), 2, 2, names), 103);
    let bytes = small_fused();
    let table = Table::read(&bytes).unwrap();
    assert_eq!(table.contents(), Contents::Fused(BANDS, 2));
    assert_eq!(
        (table.textures(), table.measured()),
        (2, PropertySet::default())
    );
    assert_eq!(table.movements().collect::<Vec<_>>(), MOVEMENTS);
    assert_eq!(table.actions().count(), 0);
    for (movement, (_, whitening)) in (0..).zip(movements()) {
        assert_eq!(table.whitening(movement), Some(whitening));
    }
    for (texture, (name, known)) in (0..).zip(rows()) {
        assert_eq!(table.name(texture), Some(name));
        for (movement, known) in (0..).zip(known) {
            assert_eq!(table.whitened(texture, movement), known);
            assert_eq!(table.trials(texture, movement), known.slides);
            assert!(
                table
                    .white_mean(texture, movement)
                    .eq(known.mean[..2].iter().copied())
            );
        }
        assert_eq!(
            (table.number(texture), table.numbered(texture)),
            (texture, Some(texture))
        );
    }
    let factory = |factory| Tally {
        factory,
        ..Tally::default()
    };
    assert_eq!([0, 1].map(|t| table.tally(t)), [factory(5), factory(255)]);
    assert_eq!((table.next_number(), table.numbered(2)), (2, None));
    assert_eq!(
        (table.crc(), table.lineage()),
        (crc32(&bytes[..99]), table.crc())
    );
    // as in the whitening's own test: (1, 2) above g is (-1, 3)
    assert_eq!(table.whiten(0, &[2048, 1536]).unwrap(), [-256, 768]);
    assert_eq!(table.whiten(1, &[2048, 1536]).unwrap(), [512, 384]);
    // outside there is nothing
    assert_eq!((table.whitening(2), table.whiten(2, &[1, 2])), (None, None));
    for (texture, movement) in [(2, 0), (0, 2), (1, 2), (u16::MAX, u8::MAX)] {
        assert_eq!(table.whitened(texture, movement), Whitened::default());
        assert_eq!(table.white_mean(texture, movement).len(), 0);
    }
    assert_eq!((table.number(2), table.tally(2)), (0, Tally::default()));
    assert_eq!(table.gaussian(0, act(0, Property::Traction)), None);
    let gaussians = small();
    let gaussians = Table::read(&gaussians).unwrap();
    assert_eq!(
        (gaussians.whitening(0), gaussians.white_mean(0, 0).len()),
        (None, 0)
    );
}

proptest! {
    #![proptest_config(fixed(512))]

    #[test]
    fn no_bytes_behind_a_fused_header_make_it_panic(bytes in proptest::collection::vec(any::<u8>(), 0..300),
        set in 3u8..9, features in 0u8..30) {
        let length = (16 + bytes.len() + CRC_BYTES) as u32;
        let mut begun = b"TACT\x01\0\x01".to_vec();
        begun.push(set);
        begun.extend(length.to_le_bytes());
        begun.extend([1, 0, 1, features]);
        begun.extend(b"\xee\x04\x10\x27\0\0");
        begun.extend(bytes);
        begun.truncate(length as usize - CRC_BYTES);
        read_all(&seal(begun));
    }
}

#[test]
fn every_check_of_a_fused_table_names_what_is_wrong() {
    assert!(Table::read(&wrong_fused(|_| ())).is_ok());
    let at = |at: usize, byte: u8| error(&wrong_fused(|bytes| bytes[at] = byte));
    assert_eq!(at(6, 2), TableError::Method(2));
    // no such set, features that it cannot have, and Gaussians of features
    for (field, byte) in [(7, 8), (7, 3), (15, 0), (15, 27), (7, 7), (7, 5), (6, 0)] {
        assert_eq!(at(field, byte), TableError::Header, "byte {field}");
    }
    assert_eq!(at(28 + 4, 31), TableError::Whitening(0));
    assert_eq!(at(42 + 5, 31), TableError::Whitening(1));
    assert!(Table::read(&wrong_fused(|bytes| bytes[47] = 30)).is_ok());
    assert_eq!(at(85, 0), TableError::Number(1));
    assert_eq!(at(91, 0xff), TableError::Name(0));
    let contents = 16 + 12 + 28 + 3 * (8 + 2) + 4 + 3 * 5 + 4;
    let header = 103;
    assert_eq!(at(12, 3), TableError::Length { header, contents });
    // one slide needs no deviation
    assert!(Table::read(&wrong_fused(|bytes| bytes[72..76].fill(1))).is_ok());
}

#[test]
fn what_is_no_fused_table_is_not_written() {
    let [felt, oak] = rows();
    let movements = movements();
    for set in [FeatureSet::Pressure, FeatureSet::Properties] {
        assert_eq!(write(set, &movements, &rows()), Err(EncodeError::Contents));
    }
    assert!(write(FeatureSet::Force, &movements, &rows()).is_ok());
    assert_eq!(write(BANDS, &[], &rows()), Err(EncodeError::Contents));
    let mixed = [movements[0].clone(), (MOVEMENTS[1], straight(3))];
    assert_eq!(write(BANDS, &mixed, &rows()), Err(EncodeError::Contents));
    assert_eq!(write(BANDS, &movements, &[]), Err(EncodeError::Empty));
    let short = [felt.clone(), ("oak", vec![oak.1[0]])];
    assert_eq!(
        write(BANDS, &movements, &short),
        Err(EncodeError::Movements(1))
    );
    let twins = [felt.clone(), ("felt", oak.1)];
    let twin = EncodeError::Invalid(TableError::Name(1));
    assert_eq!(write(BANDS, &movements, &twins), Err(twin));
    let mut out = [0; 102];
    let none = encode_fused(
        &mut out,
        BANDS,
        &movements,
        [("felt", &felt.1[..]); 1].into_iter(),
    );
    assert_eq!(none.unwrap().textures(), 1);
    let both = rows();
    let both = both.iter().map(|(name, known)| (*name, known.as_slice()));
    let none = encode_fused(&mut out, BANDS, &movements, both).map(|_| ());
    assert_eq!(none, Err(EncodeError::NoSpace(103)));
}

/// Everything that a table has of a texture but its place.
fn whole(table: &Table<'_>, name: &str) -> (u16, Tally, Vec<Vec<u8>>, Vec<u8>) {
    let texture = table.find(name).unwrap();
    let movements = 0..table.movements().len() as u8;
    let cells = movements
        .clone()
        .map(|m| table.cell_bytes(texture, m).unwrap().to_vec());
    (
        table.number(texture),
        table.tally(texture),
        cells.collect(),
        movements.map(|m| table.trials(texture, m)).collect(),
    )
}

/// Header without length and count, movements and whitenings.
fn frame(table: &Table<'_>) -> Vec<u8> {
    let bytes = table.as_bytes();
    [&bytes[..8], &bytes[14..table.layout().cells]].concat()
}

/// Five textures of either kind at three movements.
fn five() -> [Vec<u8>; 2] {
    let noise = &mut Noise(9);
    let mut cell = || core::array::from_fn(|_| (noise.normal() as f32, 0.3));
    let cells: Vec<Vec<_>> = (0..5)
        .map(|_| (0..3).map(|_| around(cell())).collect())
        .collect();
    let mut fused = || {
        let mean: Vec<f64> = (0..4).map(|_| 3.0 * noise.normal()).collect();
        super::known(1 + noise.below(9) as u8, &mean)
    };
    let known: Vec<Vec<_>> = (0..5).map(|_| (0..3).map(|_| fused()).collect()).collect();
    let whitenings = [straight(4), straight(4), straight(4)];
    [
        table_of(PropertySet::ALL, &cells),
        fused_of(FeatureSet::Force, &whitenings, &known),
    ]
}

/// Checks the parts of a table that a change must leave for these names.
fn unchanged(old: &Table<'_>, new: &Table<'_>, names: &[&str]) {
    assert_eq!(frame(new), frame(old));
    assert_eq!(new.lineage(), old.lineage());
    for name in names {
        assert_eq!(whole(new, name), whole(old, name), "{name}");
    }
}

#[test]
fn a_change_leaves_all_others_as_they_are() {
    let user = Tally {
        factory: 1,
        user: 2,
        itself: 3,
    };
    for bytes in five() {
        let first = Table::read(&bytes).unwrap();
        let is_fused = matches!(first.contents(), Contents::Fused(..));
        let gaussians = [learned(&[[0.25, 1.0, 1.5], [0.75, 2.0, 2.5]]); 3];
        let whitened = [1, 7, 200].map(|n| super::known(n, &[1.0, -2.0, 3.0, f64::from(n) / 8.0]));
        let known = if is_fused {
            TextureStats::Fused(&whitened)
        } else {
            TextureStats::Gaussians(&gaussians)
        };
        let is_it = |table: &Table<'_>, name: &str| {
            let texture = table.find(name).unwrap();
            for movement in 0..3 {
                let at = usize::from(movement);
                if is_fused {
                    assert_eq!(table.whitened(texture, movement), whitened[at]);
                } else {
                    let traction = table.gaussian(texture, act(movement, Property::Traction));
                    assert_eq!(traction.unwrap().mean, 0.5);
                    assert_eq!(table.trials(texture, movement), 2);
                }
            }
            assert_eq!(table.tally(texture), user);
        };
        let (mut a, mut b) = (vec![0; 4096], vec![0; 4096]);
        // one more
        let tally = user;
        let name = "oak";
        let put = Change::Put { name, known, tally };
        let more = amend(&mut a, &first, put).unwrap();
        unchanged(&first, &more, &["t0", "t1", "t2", "t3", "t4"]);
        assert_eq!(
            more.names().collect::<Vec<_>>(),
            ["t0", "t1", "t2", "t3", "t4", "oak"]
        );
        is_it(&more, "oak");
        assert_eq!((more.number(5), more.lineage()), (5, first.crc()));
        assert_ne!(more.crc(), first.crc());
        // one less
        let less = amend(&mut b, &more, Change::Forget(1)).unwrap();
        unchanged(&more, &less, &["t0", "t2", "t3", "t4", "oak"]);
        assert_eq!((less.textures(), less.find("t1")), (5, None));
        assert_eq!((less.numbered(1), less.numbered(5)), (None, Some(4)));
        assert_eq!((less.lineage(), less.next_number()), (first.crc(), 6));
        // another name
        let rename = Change::Rename {
            texture: 4,
            name: "bog oak",
        };
        let renamed = amend(&mut a, &less, rename).unwrap();
        unchanged(&less, &renamed, &["t0", "t2", "t3", "t4"]);
        assert_eq!(whole(&renamed, "bog oak"), whole(&less, "oak"));
        assert_eq!(renamed.find("oak"), None);
        // in the place of another
        let put = Change::Put {
            name: "t2",
            known,
            tally,
        };
        let replaced = amend(&mut b, &renamed, put).unwrap();
        unchanged(&renamed, &replaced, &["t0", "t3", "t4", "bog oak"]);
        is_it(&replaced, "t2");
        assert!(replaced.names().eq(renamed.names()), "in the same place");
        assert_eq!(replaced.number(1), 2, "and with the same number");
        // a name to itself changes nothing at all
        let rename = Change::Rename {
            texture: 1,
            name: "t2",
        };
        let same = amend(&mut a, &replaced, rename).unwrap();
        assert_eq!(same.as_bytes(), replaced.as_bytes());
    }
}

#[test]
fn a_change_that_cannot_be_is_refused() {
    let [gaussians, fused] = five();
    let mut out = vec![0; 4096];
    let experience = [learned(&[[0.25, 1.0, 1.5]]); 3];
    let whitened = [super::known(1, &[1.0; 4]); 3];
    let tally = Tally::default();
    let put = |name, known| Change::Put { name, known, tally };
    for bytes in [&gaussians, &fused] {
        let table = Table::read(bytes).unwrap();
        let mut refused = |change| amend(&mut out, &table, change).map(|_| ()).unwrap_err();
        assert_eq!(refused(Change::Forget(5)), EncodeError::Texture(5));
        let rename = |texture, name| Change::Rename { texture, name };
        assert_eq!(refused(rename(5, "oak")), EncodeError::Texture(5));
        let name = |index| EncodeError::Invalid(TableError::Name(index));
        assert_eq!(refused(rename(4, "t1")), name(4));
        assert_eq!(refused(rename(0, "t1")), name(1));
        let unnamed = TableError::Unnamed(2, NameError::Empty);
        assert_eq!(refused(rename(2, "")), EncodeError::Invalid(unnamed));
        let long = "x".repeat(41);
        assert_eq!(refused(rename(2, &long)), EncodeError::Name(2));
        let is_fused = matches!(table.contents(), Contents::Fused(..));
        let (mine, other, short) = if is_fused {
            let short = TextureStats::Fused(&whitened[..2]);
            (
                TextureStats::Fused(&whitened),
                TextureStats::Gaussians(&experience),
                short,
            )
        } else {
            let short = TextureStats::Gaussians(&experience[..2]);
            (
                TextureStats::Gaussians(&experience),
                TextureStats::Fused(&whitened),
                short,
            )
        };
        for name in ["oak", "t3"] {
            assert_eq!(refused(put(name, other)), EncodeError::Contents);
            let index = if name == "oak" { 5 } else { 3 };
            assert_eq!(refused(put(name, short)), EncodeError::Movements(index));
        }
        let length = amend(&mut out, &table, put("oak", mine))
            .unwrap()
            .as_bytes()
            .len();
        let less = amend(&mut out[..length - 1], &table, put("oak", mine)).map(|_| ());
        assert_eq!(less, Err(EncodeError::NoSpace(length)));
    }
    // the last one
    let one = fused_of(BANDS, &[straight(4)], &[vec![super::known(1, &[0.0; 4])]]);
    let none = amend(&mut out, &Table::read(&one).unwrap(), Change::Forget(0)).map(|_| ());
    assert_eq!(none, Err(EncodeError::Empty));
}

#[test]
fn retelling_changes_one_mean_only() {
    let [gaussians, fused] = five();
    let old = Table::read(&fused).unwrap();
    let tally = Tally {
        factory: 7,
        user: 8,
        itself: 9,
    };
    let new = super::known(6, &[-1.0, 2.0, -3.0, 4.0]);
    let mut bytes = fused.clone();
    bytes.extend([0x5a; 20]);
    retell(&mut bytes, 3, 1, &new, tally).unwrap();
    assert_eq!(bytes[fused.len()..], [0x5a; 20], "what is behind it stays");
    let table = Table::read_first(&bytes).unwrap();
    assert_eq!(table.crc(), crc32(&bytes[..fused.len() - 4]));
    assert_eq!((table.lineage(), table.whitened(3, 1)), (old.crc(), new));
    assert_eq!((table.tally(3), table.number(3)), (tally, 3));
    unchanged(&old, &table, &["t0", "t1", "t2", "t4"]);
    assert!(table.names().eq(old.names()));
    for movement in [0, 2] {
        assert_eq!(table.whitened(3, movement), old.whitened(3, movement));
    }
    // and again, from what was told already
    let lineage = old.crc();
    let mut twice = table.as_bytes().to_vec();
    retell(&mut twice, 0, 2, &new, tally).unwrap();
    let table = Table::read(&twice).unwrap();
    assert_eq!((table.lineage(), table.whitened(0, 2)), (lineage, new));
    assert_eq!(table.whitened(3, 1), new);
    // what cannot be
    for (texture, movement) in [(5, 0), (0, 3)] {
        let before = twice.clone();
        let none = retell(&mut twice, texture, movement, &new, tally);
        assert_eq!(none, Err(EncodeError::Texture(texture)));
        assert_eq!(twice, before);
    }
    let mut gaussians = gaussians;
    let none = retell(&mut gaussians, 0, 0, &new, tally);
    assert_eq!(none, Err(EncodeError::Contents));
    twice[40] ^= 1;
    let none = retell(&mut twice, 0, 0, &new, tally);
    assert!(matches!(
        none,
        Err(EncodeError::Invalid(TableError::Crc { .. }))
    ));
}
