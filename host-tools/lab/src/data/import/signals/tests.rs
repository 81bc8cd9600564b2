use proptest::prelude::*;

use super::*;
use crate::data::cells;
use crate::data::recordings::npy;

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
time,x~s,m/s2~0,1.5~1,-2           | a row of units
Sensor: ADXL345~Author;me~t;x~0;1.5~1;-2 | lines before the table
"t","x"~"0","1,5"~"1","-2,0"       | decimal commas in quotes
"t";"x"~"0";"1.001,5"~"1";"-2,0"   | points between thousands
"#;
    for [text, what] in cells(CASES) {
        let read = signals(text).unwrap_or_else(|why| panic!("{what}: {why}"));
        let column: Vec<&[f64]> = read.channels.iter().map(|(_, x)| &x[..]).collect();
        let first = if what.contains("thousands") {
            1001.5
        } else {
            1.5
        };
        assert_eq!(column[..2], [&[0.0, 1.0][..], &[first, -2.0]], "{what}");
    }
    // the first of the usual rows has whole numbers
    let whole = signals("t;x~0;1~1;2~2;3~3;4,5~4;5").unwrap();
    assert_eq!(whole.channels[1].1, [1.0, 2.0, 3.0, 4.5, 5.0]);
    let bars = signals("t|x~0|1.5~1|-2").unwrap();
    assert_eq!(bars.channels[1].1, [1.5, -2.0]);
    let utf16 = |mark: &[u8], of: fn(u16) -> [u8; 2]| {
        let text = "t;\u{e4}~0;1,5~1;-2,0~".replace('~', "\r\n");
        let letters = text.encode_utf16().flat_map(of);
        Signals::of(&mark.iter().copied().chain(letters).collect::<Vec<u8>>()).unwrap()
    };
    for read in [
        utf16(b"\xff\xfe", u16::to_le_bytes),
        utf16(b"", u16::to_le_bytes),
        utf16(b"\xfe\xff", u16::to_be_bytes),
    ] {
        assert_eq!(read.channels[1], ("\u{e4}".to_owned(), vec![1.5, -2.0]));
    }
    let latin = Signals::of(b"t,B (\xb5T)\n0,1.5\n1,-2\n").unwrap();
    assert_eq!(latin.channels[1].0, "B (\u{b5}T)");
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
x~1~2~inf~2         | row 3 of column "x": "inf"
t,x~9:00:00,1~9:00:01,2~7,3 | column "t" has numbers and times of day
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
fn what_tables_say_beside_their_numbers_is_kept() {
    let read = signals("time,ax,ay~ms,m/s2,m/s2~0,1,~5,2,7~10,nan,8~15,4,9").unwrap();
    let names: Vec<&str> = read
        .channels
        .iter()
        .map(|(name, _)| name.as_str())
        .collect();
    assert_eq!(names, ["time (ms)", "ax (m/s2)", "ay (m/s2)"]);
    // on straight lines where they are missing
    assert_eq!(read.channel("AX").unwrap().1, [1.0, 2.0, 3.0, 4.0]);
    assert_eq!(read.channel("ay").unwrap().1, [7.0, 7.0, 8.0, 9.0]);
    assert_eq!(
        (
            &read.missing["ax (m/s2)"][..],
            &read.missing["ay (m/s2)"][..]
        ),
        (&[2][..], &[0][..])
    );
    // numbers as labels
    let read = signals("x,label~1,7~2,7~3,~4,8~").unwrap();
    let runs = [("7", 2), ("", 3), ("8", 4)].map(|(word, end)| (word.to_owned(), end));
    assert_eq!(read.runs("label").unwrap(), &runs[..]);
    // a header that comes again
    let read = signals("x,y~1,2~3,4~x,y~5,6~7,8").unwrap();
    let rows: Vec<_> = read.pieces.iter().map(|piece| piece.rows.clone()).collect();
    assert_eq!((rows, read.channels[1].1.len()), (vec![0..2, 2..4], 4));
    for (line, rate) in [
        ("# Sample rate: 1600 Hz", Some(1600.0)),
        ("fs = 10 kHz", Some(10_000.0)),
        ("\"Sample rate (Hz)\",512.5", Some(512.5)),
        ("offset 7, hz", None),
    ] {
        let read = signals(&format!("{line}~x,y~1,2~3,4~5,6")).unwrap();
        assert_eq!(read.rate_hz, rate, "{line}");
    }
    for [instants, step] in [
        ["2026-11-28T10:00:00.125Z", "2026-11-28T10:00:00.250Z"],
        ["28.11.2026 23:59:59.9375", "29.11.2026 00:00:00.0625"],
        ["9:59:59,5", "9:59:59,625"],
        [
            "2024/02/29 23:59:59.875+01:00",
            "2024/03/01 00:00:00.000+01:00",
        ],
        [
            "2025-12-31 23:59:59.9-05:00",
            "2026-01-01 00:00:00.025-05:00",
        ],
    ] {
        let read = signals(&format!("when;x~{instants};1~{step};2~")).unwrap();
        let (name, times) = &read.channels[0];
        assert!(
            name == "when (s)" && (times[1] - times[0] - 0.125).abs() < 1e-6,
            "{instants}"
        );
    }
    // seconds since 1970, as GNU's date says
    let read = signals("when,x~2026-11-28T10:00:00Z,1~2026-11-28T10:00:01Z,2").unwrap();
    assert_eq!(read.channels[0].1[0], 1_795_860_000.0);
}

/// A WAV file with a chunk of its own before the samples.
fn wav(
    head: &[u8; 4],
    format: &[u16],
    rate: u32,
    bits: u16,
    (length, data): (u32, &[u8]),
) -> Vec<u8> {
    let mut file = head.to_vec();
    let ended = [u32::MAX, 100][usize::from(length > 0)];
    file.extend(ended.to_le_bytes());
    file.extend(b"WAVEds64\x1c\0\0\0");
    file.extend(0_u64.to_le_bytes());
    file.extend((data.len() as u64).to_le_bytes());
    file.extend([0; 12]);
    // an odd one is followed by a byte that does not count
    file.extend(b"LIST\x05\0\0\0INFOx\0fmt ");
    let extra = if format.len() > 2 { 24 } else { 0 };
    file.extend((16 + extra as u32).to_le_bytes());
    file.extend(format[0].to_le_bytes());
    file.extend(format[1].to_le_bytes());
    file.extend(rate.to_le_bytes());
    file.extend([0; 6]);
    file.extend(bits.to_le_bytes());
    if let Some(kind) = format.get(2) {
        file.extend([22, 0, bits as u8, 0, 3, 0, 0, 0]);
        file.extend(kind.to_le_bytes());
        file.extend([0; 14]);
    }
    file.extend(b"data");
    file.extend(length.to_le_bytes());
    file.extend(data);
    file
}

#[test]
fn wav_of_every_kind_is_the_same_signal() {
    let wave: Vec<f64> = (0..100).map(|n| 0.5 * (f64::from(n) * 0.3).sin()).collect();
    let stereo = || wave.iter().flat_map(|x| [*x, 0.25]);
    let integers = |bits: u32| -> Vec<u8> {
        let full = f64::from(1_u32 << (bits - 1));
        let sample =
            |x: f64| ((x * full).round() as i32).to_le_bytes()[..bits as usize / 8].to_vec();
        stereo().flat_map(sample).collect()
    };
    let eight: Vec<u8> = stereo()
        .map(|x| (x * 128.0 + 128.0).round() as u8)
        .collect();
    let f4: Vec<u8> = stereo().flat_map(|x| (x as f32).to_le_bytes()).collect();
    let f8: Vec<u8> = stereo().flat_map(f64::to_le_bytes).collect();
    let length = |data: &[u8]| data.len() as u32;
    for (what, head, format, bits, data, length) in [
        ("8", b"RIFF", &[1, 2][..], 8, &eight, length(&eight)),
        ("16", b"RIFF", &[1, 2], 16, &integers(16), 400),
        ("24", b"RIFF", &[1, 2], 24, &integers(24), 600),
        ("32", b"RIFF", &[1, 2], 32, &integers(32), 800),
        ("float", b"RIFF", &[3, 2], 32, &f4, 800),
        ("double", b"RIFF", &[3, 2], 64, &f8, 1600),
        (
            "extensible",
            b"RIFF",
            &[0xfffe, 2, 1],
            24,
            &integers(24),
            600,
        ),
        ("extensible float", b"RIFF", &[0xfffe, 2, 3], 32, &f4, 800),
        ("RF64", b"RF64", &[1, 2], 16, &integers(16), u32::MAX),
        ("never ended", b"RIFF", &[1, 2], 16, &integers(16), 0),
    ] {
        let read = Signals::of(&wav(head, format, 44_100, bits, (length, data))).unwrap();
        assert_eq!(
            (read.rate_hz, read.channels.len()),
            (Some(44_100.0), 2),
            "{what}"
        );
        for (x, wanted) in read.channels[0].1.iter().zip(&wave) {
            let least = if bits == 8 { 4e-3 } else { 4e-5 };
            assert!((x - wanted).abs() < least, "{what}: {x}, {wanted}");
        }
        assert_eq!(read.channels[0].1.len(), 100, "{what}");
    }
    for (format, length, part) in [
        (1, 500, "last sample is cut off"),
        (1, 399, "last sample"),
        (7, 400, "format 7 with 16 bits"),
    ] {
        let why = Signals::of(&wav(
            b"RIFF",
            &[format, 2],
            8000,
            16,
            (length, &integers(16)),
        ));
        assert!(why.as_ref().unwrap_err().contains(part), "{why:?}");
    }
}

#[test]
fn files_of_other_kinds_say_what_to_do() {
    for (begin, part) in [
        (&b"fLaC\0"[..], "flac -d"),
        (b"OggS\0", "WAV"),
        (b"\x89HDF\r\n", "numpy.save"),
        (b"MATLAB 5.0", "numpy.save"),
        (b"\x7fELF\x02\x01\x01\0", "save it as one of them"),
        (b"PK\x03\x04xx", "save it again"),
        (b"PAR1xx", "pandas.read_parquet"),
    ] {
        let why = Signals::of(begin).unwrap_err();
        assert!(why.contains(part), "{why}");
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
    let half: Vec<u8> = [0x3e00_u16, 0xc100, 0x0001, 0x7bff]
        .iter()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    assert_eq!(
        two(array("<f2", &[4], &half).unwrap()),
        [[1.5, -2.5, 2_f64.powi(-24), 65504.0]]
    );
    let fortran = npy::array("<i2", &[3, 2], &i2);
    let at = fortran.windows(5).position(|w| w == b"False").unwrap();
    let mut fortran = fortran;
    fortran[at..at + 5].copy_from_slice(b"True ");
    let read = Signals::of(&fortran).unwrap().channels;
    assert_eq!(two(read), [[1.0, -2.0, 3.0], [4.0, 5.0, 6.0]]);
    let objects = array("|O", &[2], &[0; 16]).unwrap_err();
    assert!(objects.contains("integers, floats or words"), "{objects}");
    let nan = f64::NAN.to_le_bytes().repeat(2);
    assert!(
        array("<f8", &[2], &nan)
            .unwrap_err()
            .contains("value 1 is NaN")
    );
}

#[test]
fn npz_is_channels_or_a_row_for_each_slide() {
    let f8 = |values: &[f64], shape: &[usize]| {
        npy::array(
            "<f8",
            shape,
            &values
                .iter()
                .flat_map(|x| x.to_le_bytes())
                .collect::<Vec<_>>(),
        )
    };
    let zip = |arrays: &[(&str, Vec<u8>)]| Signals::of(&npy::zipped(arrays).unwrap());
    let read = zip(&[
        ("fs", f8(&[800.0], &[])),
        ("z", f8(&[1.0, 2.0, 3.0], &[3])),
        ("xy", f8(&[1.0, 4.0, 2.0, 5.0, 3.0, 6.0], &[3, 2])),
        ("what", npy::words(["silk", "silk", "cork"].into_iter())),
        ("other", f8(&[1.0], &[1])),
    ])
    .unwrap();
    assert_eq!(read.rate_hz, Some(800.0));
    let names: Vec<&str> = read
        .channels
        .iter()
        .map(|(name, _)| name.as_str())
        .collect();
    assert_eq!(names, ["z", "xy_1", "xy_2"]);
    assert_eq!(
        (&read.channels[2].1[..], &read.words[0].1[1]),
        (&[4.0, 5.0, 6.0][..], &("cork".to_owned(), 3))
    );

    let rows: Vec<f64> = (0..300).map(f64::from).collect();
    let labels = || npy::words(["silk", "cork", "silk"].into_iter());
    let read = zip(&[
        ("X", f8(&rows, &[3, 100])),
        ("y", labels()),
        ("session", f8(&[1.0, 2.0, 2.0], &[3])),
    ])
    .unwrap();
    let piece = |n: usize, texture: &str, session: &str| Piece {
        rows: 100 * n..100 * (n + 1),
        texture: Some(texture.to_owned()),
        session: Some(session.to_owned()),
        run: Some(String::new()),
    };
    assert_eq!(
        read.pieces,
        [
            piece(0, "silk", "1"),
            piece(1, "cork", "2"),
            piece(2, "silk", "2")
        ]
    );
    assert_eq!(read.channels[0].1, rows);
    // channels before the samples, or behind them
    for (shape, second) in [([1, 3, 100], 100.0), ([1, 100, 3], 1.0)] {
        let read = zip(&[
            ("X", f8(&rows, &shape)),
            ("y", npy::words(["silk"].into_iter())),
        ])
        .unwrap();
        assert_eq!((read.channels.len(), read.channels[1].1[0]), (3, second));
    }
    assert!(zip(&[]).is_err());
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
        kind in 0_usize..7,
        at in 0_usize..200,
        bytes in proptest::collection::vec(any::<u8>(), 0..64),
    ) {
        let i2 = npy::array("<i2", &[2, 64], &[7; 256]);
        let npz = npy::zipped(&[("X", i2), ("y", npy::words(["a", "b"].into_iter()))]).unwrap();
        let heads: [&[u8]; 7] = [
            b"",
            b"RIFF\x40\0\0\0WAVEfmt \x10\0\0\0\x01\0\x02\0\x98\x08\0\0\x60\x22\0\0\x04\0\x10\0data\x10\0\0\0",
            b"\x93NUMPY\x01\0\x36\0{'descr': '<i2', 'fortran_order': False, 'shape': (8,4)}\n",
            b"t,x,what\n1,2,a\n2,3,a\n",
            b"\xff\xfet\0\n\x001\0\n\x002\0\n\0",
            b"RF64\xff\xff\xff\xffWAVEds64\x10\0\0\0\0\0\0\0\0\0\0\0\x08\0\0\0\0\0\0\0fmt \x10\0\0\0\
              \x03\0\x01\0\x98\x08\0\0\x60\x22\0\0\x04\0\x20\0data\xff\xff\xff\xff\0\0\0\0\0\0\0\0",
            &npz,
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
