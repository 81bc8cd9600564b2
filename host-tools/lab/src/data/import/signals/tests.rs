use proptest::prelude::*;

use super::*;
use crate::data::cells;

fn signals(text: &str) -> std::result::Result<Signals, String> {
    Signals::of(text.replace('~', "\n").as_bytes())
}

#[test]
fn tables_are_read_however_they_are_written() {
    const CASES: &str = r#"
t,x~0,1.5~1,-2                     | comma and header
0,1.5~1,-2                         | comma, no header
t;x~0;1,5~1;-2,0                   | decimal comma
# made by hand~t	x~0	1.5~1	-2     | tabs and a comment
t,x,~0,1.5,~1,-2,                  | a mark too many
t x~0 1.5~1 -2                     | blanks
"#;
    for [text, what] in cells(CASES) {
        let read = signals(text).unwrap_or_else(|why| panic!("{what}: {why}"));
        let column: Vec<&[f64]> = read.channels.iter().map(|(_, x)| &x[..]).collect();
        assert_eq!(column[..2], [&[0.0, 1.0][..], &[1.5, -2.0]], "{what}");
    }
    let bom = Signals::of(b"\xef\xbb\xbftime,x\r\n0,1\r\n1,2\r\n").unwrap();
    assert_eq!(bom.channels[0].0, "time");
    let words = signals("x,what~1,silk~2,silk~3,cork").unwrap();
    assert_eq!(
        words.words,
        [(
            "what".to_owned(),
            vec![("silk".to_owned(), 2), ("cork".to_owned(), 3)]
        )]
    );
}

#[test]
fn what_is_wrong_is_said_with_its_place() {
    const CASES: &str = r#"
x,y~1,2~3           | line 3: 1 fields where there are 2
x,y~1,2~3,oops~5,6  | row 2 of column "y": "oops"
x,x~1,2~3,4         | two columns are called "x"
x~1                 | fewer than two samples
a,b~c,d             | no column of numbers
x~1~NaN~2           | row 2 of column "x": "NaN"
"#;
    for [text, place] in cells(CASES) {
        let why = signals(text).unwrap_err();
        assert!(why.contains(place), "{place:?} is not in {why:?}");
    }
    for bytes in [
        &b"RIFF\x04\0\0\0WAVE"[..],
        b"\x1f\x8bxx",
        b"",
        b"\xff\xfe\0x",
        b"\x93NUMPY\x01\0",
    ] {
        assert!(Signals::of(bytes).is_err());
    }
}

#[test]
fn wav_of_every_kind_is_the_same_signal() {
    let wave: Vec<f64> = (0..100).map(|n| 0.5 * (f64::from(n) * 0.3).sin()).collect();
    for (bits, sample_format) in [
        (16, hound::SampleFormat::Int),
        (24, hound::SampleFormat::Int),
        (32, hound::SampleFormat::Int),
        (32, hound::SampleFormat::Float),
    ] {
        let spec = hound::WavSpec {
            channels: 2,
            sample_rate: 44_100,
            bits_per_sample: bits,
            sample_format,
        };
        let mut bytes = Cursor::new(Vec::new());
        let mut writer = hound::WavWriter::new(&mut bytes, spec).unwrap();
        for x in &wave {
            for x in [*x, 0.25] {
                match sample_format {
                    hound::SampleFormat::Float => writer.write_sample(x as f32).unwrap(),
                    hound::SampleFormat::Int => {
                        let full = f64::from(1_u32 << (bits - 1));
                        writer.write_sample((x * full).round() as i32).unwrap();
                    }
                }
            }
        }
        writer.finalize().unwrap();
        let read = Signals::of(bytes.get_ref()).unwrap();
        assert_eq!(read.rate_hz, Some(44_100.0));
        assert_eq!(read.channels.len(), 2);
        for (x, wanted) in read.channels[0].1.iter().zip(&wave) {
            assert!((x - wanted).abs() < 4e-5, "{bits} bits: {x}, {wanted}");
        }
    }
}

#[test]
fn arrays_of_every_kind_are_read() {
    let array = |kind: &str, shape: &[usize], data: &[u8]| {
        Signals::of(&npy::array(kind, shape, data)).map(|s| s.channels)
    };
    let two = |x: Vec<(String, Vec<f64>)>| x.into_iter().map(|(_, x)| x).collect::<Vec<_>>();
    let i2: Vec<u8> = [1_i16, -2, 3, 4, 5, 6]
        .iter()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    assert_eq!(
        two(array("<i2", &[6], &i2).unwrap()),
        [[1.0, -2.0, 3.0, 4.0, 5.0, 6.0]]
    );
    assert_eq!(
        two(array("<i2", &[3, 2], &i2).unwrap()),
        [[1.0, 3.0, 5.0], [-2.0, 4.0, 6.0]]
    );
    assert_eq!(
        two(array("<i2", &[2, 3], &i2).unwrap()),
        [[1.0, -2.0, 3.0], [4.0, 5.0, 6.0]]
    );
    let f8: Vec<u8> = [1.5_f64, -2.5]
        .iter()
        .flat_map(|x| x.to_be_bytes())
        .collect();
    assert_eq!(two(array(">f8", &[2], &f8).unwrap()), [[1.5, -2.5]]);
    assert!(array("<i2", &[7], &i2).is_err() && array("<c8", &[1], &f8).is_err());
    let nan = f64::NAN.to_le_bytes().repeat(2);
    assert!(
        array("<f8", &[2], &nan)
            .unwrap_err()
            .contains("value 1 is NaN")
    );
}

#[test]
fn words_come_with_where_they_end() {
    let read = signals("x,what~1,a~2,a~3,~4,7~5,b~6,b").unwrap();
    let runs = [("a", 2), ("", 3), ("7", 4), ("b", 6)].map(|(word, end)| (word.to_owned(), end));
    assert_eq!(read.words, [("what".to_owned(), runs.to_vec())]);
    // times of day name no textures
    let rows: String = (0..2000).map(|n| format!("{n},{n}:00~")).collect();
    assert_eq!(signals(&rows).unwrap().words, [("2".to_owned(), vec![])]);
}

proptest! {
    /// A table of any numbers is read as it was written, with any mark between them and any decimal mark.
    #[test]
    fn tables_of_any_numbers_are_read(
        numbers in proptest::collection::vec(-1e9..1e9_f64, 2..40),
        columns in 1_usize..4,
        mark in prop_oneof![Just(','), Just(';'), Just('\t'), Just(' ')],
        comma in any::<bool>(),
        quoted in any::<bool>(),
    ) {
        // between blanks a comma may be either
        let comma = comma && (mark == ';' || mark == '\t');
        let text = |x: &f64| {
            let text = format!("{x:.3}");
            let text = if comma { text.replace('.', ",") } else { text };
            if quoted { format!("\"{text}\"") } else { text }
        };
        let rows: Vec<&[f64]> = numbers.chunks_exact(columns).collect();
        prop_assume!(rows.len() > 1);
        let line = |row: &&[f64]| row.iter().map(text).collect::<Vec<_>>().join(&mark.to_string());
        let file = rows.iter().map(line).collect::<Vec<_>>().join("\r\n");
        // one column without a mark has its decimal comma as one
        prop_assume!(columns > 1 || !comma);
        let read = Signals::of(file.as_bytes()).unwrap();
        prop_assert_eq!(read.channels.len(), columns);
        for (at, (_, channel)) in read.channels.iter().enumerate() {
            for (x, row) in channel.iter().zip(&rows) {
                prop_assert!((x - row[at]).abs() <= 5.1e-4);
            }
        }
    }

    /// Bytes of any kind end in signals that are whole, or in a sentence.
    #[test]
    fn any_bytes_end(
        kind in 0_usize..4,
        at in 0_usize..200,
        bytes in proptest::collection::vec(any::<u8>(), 0..64),
    ) {
        let heads: [&[u8]; 4] = [
            b"",
            b"RIFF\x40\0\0\0WAVEfmt \x10\0\0\0\x01\0\x02\0\x98\x08\0\0\x60\x22\0\0\x04\0\x10\0data\x10\0\0\0",
            b"\x93NUMPY\x01\0\x36\0{'descr': '<i2', 'fortran_order': False, 'shape': (8,4)}\n",
            b"t,x,what\n1,2,a\n2,3,a\n",
        ];
        let mut file = heads[kind].to_vec();
        let at = at.min(file.len());
        file.splice(at..(at + bytes.len() / 8).min(file.len()), bytes);
        if let Ok(read) = Signals::of(&file) {
            let samples = read.channels[0].1.len();
            prop_assert!(samples > 1);
            prop_assert!(read.channels.iter().all(|(_, all)| all.len() == samples));
        }
    }
}
