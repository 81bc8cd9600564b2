//! Every fault of a folder of fabrics, with its message; and random damage.
use proptest::prelude::*;

use super::*;

/// The message of the error that opening `folder` gives must have all of `parts`.
#[track_caller]
fn fails(folder: &Path, parts: &[&str]) {
    let message = FabricSet::open(folder)
        .expect_err("must be refused")
        .to_string();
    for part in parts {
        assert!(message.contains(part), "{part:?} is not in {message:?}");
    }
}

/// [`small`] with its manifest changed must be refused.
#[track_caller]
fn refuses(change: impl FnOnce(&mut Value), parts: &[&str]) {
    let folder = small();
    let path = folder.path().join(MANIFEST);
    let mut json: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    change(&mut json);
    fs::write(&path, json.to_string()).unwrap();
    fails(folder.path(), parts);
}

#[test]
fn a_folder_without_fabrics_says_so() {
    let folder = TempDir::new().unwrap();
    fails(
        &folder.path().join("nowhere"),
        &["nowhere: no such folder", "layout of data/fabricslide"],
    );
    fails(
        folder.path(),
        &["no manifest.json", "layout of data/fabricslide"],
    );
    refuses(
        |json| json["files"] = json!([]),
        &["manifest.json: files: no fabric is listed"],
    );
    fs::write(folder.path().join(MANIFEST), "{\"files\": [\n{}]}").unwrap();
    fails(
        folder.path(),
        &[
            "manifest.json: line 2, column 2",
            "missing field `file`",
            "the layout is that of data/fabricslide",
        ],
    );
}

#[test]
fn a_file_outside_the_folder_is_not_opened() {
    for name in ["../A.u16le.gz", "/etc/passwd", ""] {
        refuses(
            |json| json["files"][0]["file"] = json!(name),
            &[
                "manifest.json",
                &format!("{name:?}"),
                "not inside this folder",
            ],
        );
    }
    refuses(
        |json| json["files"][1]["file"] = json!("C.u16le.gz"),
        &["C.u16le.gz: no such file", "take B out of the manifest"],
    );
}

#[test]
fn recordings_that_contradict_each_other_are_refused_where_they_are() {
    type Case = (&'static str, Value, &'static str);
    let cases: [Case; 8] = [
        ("rep", json!(2), "rep is 2; the two repetitions are 0 and 1"),
        ("n", json!(0), "the rows, 0 of 16 values"),
        ("n", json!(u64::MAX), "correct the manifest"),
        ("n", json!(1 << 24), "a file no more than"),
        ("offset_values", json!(u64::MAX), "correct the manifest"),
        (
            "offset_values",
            json!(4801),
            "offset_values is 4801, but the recording before it ends at 4800",
        ),
        (
            "offset_values",
            json!(4784),
            "offset_values is 4784, but the recording before it ends at 4800",
        ),
        (
            "rep",
            json!(0),
            "set-point 120 at 10 mm/s, direction -1, rep 0 is listed twice",
        ),
    ];
    for (field, value, message) in cases {
        refuses(
            |json| json["files"][1]["slides"][1][field] = value,
            &[
                "manifest.json: files, B.u16le.gz, slides, entry 2: ",
                message,
            ],
        );
    }
    refuses(
        |json| json["files"][1]["slides"][0]["pressure_setpoint"] = json!(70_000),
        &[
            "manifest.json: line 1",
            "the layout is that of data/fabricslide",
        ],
    );
    refuses(
        |json| json["files"][1]["slides"] = json!([]),
        &["manifest.json: files, B.u16le.gz: the slides listed are 0"],
    );
    refuses(
        |json| json["files"][1]["fabric"] = json!("A"),
        &["manifest.json: files, B.u16le.gz: a second file of the fabric \"A\""],
    );
}

#[test]
fn fabrics_without_a_movement_in_common_are_refused() {
    let (a, b) = (
        recordings_of(&[(120, 10)], &[-1]),
        recordings_of(&[(120, 20)], &[-1]),
    );
    fails(
        folder(&[a.clone(), b]).path(),
        &[
            "manifest.json: no movement that all 2 fabrics have",
            "take out the fabric",
        ],
    );
    fails(
        folder(&[a.clone(), recordings_of(&[(120, 10)], &[1])]).path(),
        &["no movement that all 2 fabrics have"],
    );
    fails(
        folder(&[a[..1].to_vec(), a]).path(),
        &["no movement that all 2 fabrics have with both repetitions"],
    );
}

#[test]
fn a_shared_movement_must_be_one() {
    let odd = recordings_of(&[(90, 10)], &[-1]);
    fails(
        folder(&[odd.clone(), odd]).path(),
        &[
            "manifest.json: set-point 90 at 10 mm/s",
            "outside 100..=2000",
            "take this movement out",
        ],
    );
    let fast = recordings_of(&[(120, 300)], &[-1]);
    fails(
        folder(&[fast]).path(),
        &["set-point 120 at 300 mm/s", "outside 5000..=150000"],
    );
    // but not one that is not shared
    let (a, mut b) = (
        recordings_of(&[(120, 10)], &[-1]),
        recordings_of(&[(120, 10)], &[-1]),
    );
    b.push((50, 900, -1, 0, 300));
    assert!(FabricSet::open(folder(&[a, b]).path()).is_ok());
}

#[test]
fn slides_that_cannot_be_measured_are_named() {
    let mut short = recordings_of(&[(120, 10)], &[-1]);
    short[1].4 = 66;
    fails(
        folder(&[short]).path(),
        &[
            "A.u16le.gz: set-point 120 at 10 mm/s, direction -1, rep 1: a slide of 31 samples is too short, 32 are the \
             least",
        ],
    );

    let folder = TempDir::new().unwrap();
    let list = recordings_of(&[(120, 10)], &[-1]);
    let dead = |t: usize, taxel: usize| {
        if t < 450 {
            noise(0)(t, taxel)
        } else {
            t as u16
        }
    };
    let entry = fabric(folder.path(), "A", &list, &rows(600, dead));
    manifest(folder.path(), &[entry]);
    fails(folder.path(), &["rep 1: no taxel moves", "record it again"]);
}

#[test]
fn changed_samples_are_refused() {
    refuses(
        |json| json["files"][0]["sha256_gz"] = json!("00"),
        &[
            "A.u16le.gz: SHA-256 of the gzip file",
            "the manifest says 00",
            "fetch or record it again",
        ],
    );
    refuses(
        |json| json["files"][0]["sha256_raw"] = json!("00"),
        &["A.u16le.gz: SHA-256 of the unpacked samples"],
    );
    refuses(
        |json| json["files"][0]["slides"][3]["n"] = json!(299),
        &[
            "A.u16le.gz: unpacks to 38369 or more bytes",
            "the manifest says 38368",
        ],
    );
    refuses(
        |json| json["files"][0]["slides"][3]["n"] = json!(301),
        &[
            "A.u16le.gz: unpacks to 38400 bytes",
            "the manifest says 38432",
        ],
    );

    let list = recordings_of(&[(120, 10)], &[-1]);
    for (packed, cause) in [
        (b"no gzip at all".to_vec(), "no whole gzip stream"),
        (gzip(&[1; 19_200])[..20].to_vec(), "no whole gzip stream"),
        // four megabytes in twenty kilobytes: not unpacked
        (gzip(&vec![0; 4 << 20]), "unpacks to 19201 or more bytes"),
        (vec![0; 50_000], "longer than the 42496 bytes it can have"),
    ] {
        let folder = TempDir::new().unwrap();
        let mut entry = fabric(folder.path(), "A", &list, &[1; 19_200]);
        entry["sha256_gz"] = json!(tactus_lab::data::recordings::files::sha256(&packed));
        fs::write(folder.path().join("A.u16le.gz"), &packed).unwrap();
        manifest(folder.path(), &[entry]);
        fails(folder.path(), &["A.u16le.gz: ", cause]);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn noise_for_a_manifest_is_refused(bytes in proptest::collection::vec(any::<u8>(), 0..500)) {
        let folder = TempDir::new().unwrap();
        fs::write(folder.path().join(MANIFEST), bytes).unwrap();
        prop_assert!(FabricSet::open(folder.path()).is_err());
    }

    /// A manifest with a few bytes changed: nearer to what happens than noise.
    #[test]
    fn damaged_manifests_never_panic(
        changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
    ) {
        let folder = small();
        let path = folder.path().join(MANIFEST);
        let mut bytes = fs::read(&path).unwrap();
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        fs::write(&path, bytes).unwrap();
        let _ = FabricSet::open(folder.path());
    }

    /// Well-formed, but any number anywhere.
    #[test]
    fn misleading_manifests_never_panic(
        changes in proptest::collection::vec((
            0_usize..2, 0_usize..4,
            prop::sample::select(vec!["pressure_setpoint", "speed_mm_s", "direction", "rep", "n", "offset_values"]),
            prop_oneof![
                any::<u64>().prop_map(|x| json!(x)),
                any::<i64>().prop_map(|x| json!(x)),
                any::<f64>().prop_map(|x| json!(x)),
                (0_u32..400).prop_map(|x| json!(x)),
                (-1_i8..3).prop_map(|x| json!(x)),
            ],
        ), 1..4),
    ) {
        let folder = small();
        let path = folder.path().join(MANIFEST);
        let mut json: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
        for (file, slide, field, value) in changes {
            json["files"][file]["slides"][slide][field] = value;
        }
        fs::write(&path, json.to_string()).unwrap();
        let _ = FabricSet::open(folder.path());
    }

    /// Any samples, of any length, with the right hashes: refused or finite.
    #[test]
    fn whatever_the_samples_all_figures_are_finite(
        lengths in (1_usize..400, 1_usize..400),
        loud: bool,
        taxels in any::<u16>(),
        seed: usize,
    ) {
        let folder = TempDir::new().unwrap();
        let list = [(120, 10, -1, 0, lengths.0), (120, 10, -1, 1, lengths.1)];
        let value = |t: usize, taxel: usize| {
            let x = noise(seed % 1000)(t, taxel);
            if taxels >> taxel & 1 == 0 { 9 } else if loud { x.wrapping_mul(1021) } else { x % 2 }
        };
        let entry = fabric(folder.path(), "A", &list, &rows(lengths.0 + lengths.1, value));
        manifest(folder.path(), &[entry]);
        match FabricSet::open(folder.path()) {
            Ok(set) => {
                prop_assert_eq!(set.slides.len(), 4);
                for slide in set.slides {
                    prop_assert!(slide.ln_bands.iter().chain(&slide.properties).all(|x| x.is_finite()));
                }
            }
            Err(e) => prop_assert!(matches!(e, FabricError::Slide { .. }), "{}", e),
        }
    }

    #[test]
    fn damaged_gzip_files_never_panic(at: prop::sample::Index, byte: u8) {
        let folder = small();
        let path = folder.path().join("A.u16le.gz");
        let mut bytes = fs::read(&path).unwrap();
        let at = at.index(bytes.len());
        let same = bytes[at] == byte;
        bytes[at] = byte;
        fs::write(&path, &bytes).unwrap();
        prop_assert_eq!(FabricSet::open(folder.path()).is_ok(), same);
        // and if the hash were right
        let manifest = folder.path().join(MANIFEST);
        let mut json: Value = serde_json::from_slice(&fs::read(&manifest).unwrap()).unwrap();
        json["files"][0]["sha256_gz"] = json!(tactus_lab::data::recordings::files::sha256(&bytes));
        fs::write(&manifest, json.to_string()).unwrap();
        let _ = FabricSet::open(folder.path());
    }
}
