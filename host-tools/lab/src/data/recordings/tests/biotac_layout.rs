//! The layout of data/biotac.
use std::io::Write as _;

use flate2::{Compression, write::GzEncoder};

use super::*;

/// A folder like data/biotac, but with other numbers of everything: 2 materials, 3 slides, 8 + 2 + 3 + 2 values.
pub(super) fn biotac() -> TempDir {
    let folder = TempDir::new().unwrap();
    let files: Vec<_> = [(4_u32, "felt"), (9, "silk")]
        .map(|(material, name)| {
            let values: Vec<i16> = (0..45).map(|i| i + 100 * material as i16).collect();
            biotac_file(folder.path(), material, name, &bytes_of(&values))
        })
        .into();
    let manifest = serde_json::json!({
        "slides": [3, 30, 6],
        "record": [
            {"name": "pac", "count": 8, "rate_hz": 2200},
            {"name": "f_normal", "count": 2, "rate_hz": 100},
            {"name": "pdc", "count": 3, "rate_hz": 500},
            {"name": "f_tangential", "count": 2, "rate_hz": 400},
        ],
        "motion": {"speed_mm_s": 25.0},
        "steady_window_s": [0.001, 0.003],
        "files": files,
    });
    fs::write(
        folder.path().join(files::BIOTAC_MANIFEST),
        manifest.to_string(),
    )
    .unwrap();
    folder
}

fn bytes_of(values: &[i16]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

fn gzip(raw: &[u8]) -> Vec<u8> {
    let mut packed = GzEncoder::new(Vec::new(), Compression::fast());
    packed.write_all(raw).unwrap();
    packed.finish().unwrap()
}

fn biotac_file(folder: &Path, material: u32, name: &str, raw: &[u8]) -> serde_json::Value {
    let packed = gzip(raw);
    let file = format!("m{material}.gz");
    fs::write(folder.join(&file), &packed).unwrap();
    serde_json::json!({
        "file": file, "material": material, "name": name, "n_slides": 3,
        "bytes_gz": packed.len(), "bytes_raw": raw.len(),
        "sha256_gz": sha256(&packed), "sha256_raw": sha256(raw),
    })
}

#[test]
fn biotac_layout_is_taken_from_the_manifest() {
    let folder = biotac();
    let set = RecordingSet::open(folder.path()).unwrap();
    assert_eq!(set.textures(), [texture(4, "felt"), texture(9, "silk")]);
    let movement = Movement::from_si(0.8, 25.0).unwrap();
    assert_eq!(set.movements(), [movement]);
    let slides = set.load_texture(1).unwrap();
    assert_eq!(
        slides.iter().map(|s| s.number).collect::<Vec<_>>(),
        [3, 6, 30]
    );
    // number 6 is the third record of the file: values 30..45
    let pac: Vec<i16> = (930..938).collect();
    let expected = Recording {
        texture: 1,
        number: 6,
        movement,
        window: (0.001, 0.003),
        blocks: Vec::new(),
        background: Some(2.2),
        pdc: (940..943).collect(),
        pdc_rate_hz: 500.0,
        outside_mn: None,
        pace: None,
        shear_rate_hz: 400.0,
        highest_hz: None,
    };
    let expected = expected.cut(&[], &pac, Some(&[943, 944])).unwrap();
    assert_eq!(slides[1], expected);
    assert_eq!(slides[1].pac(), pac);
}

#[test]
fn biotac_manifest_errors_name_the_entry() {
    const CASES: &str = r#"
"slides" | "runs" | manifest.json: line 1 | missing field `slides`
[3,30,6] | [3,30,3] | manifest.json: slides, entry 3 | slide 3 of texture 4 is listed twice
[3,30,6] | [3,30] | manifest.json: files, m4.gz | n_slides is 3, but "slides" lists 2
[3,30,6] | [] | manifest.json | texture 4 (felt) has no slide
"n_slides":3 | "n_slides":0 | manifest.json | (felt) has no slide
"speed_mm_s":25.0 | "speed_mm_s":0 | motion.speed_mm_s | sliding speed 0 um/s is outside
"name":"pac" | "name":"p" | manifest.json: record | no pac
"name":"pdc" | "name":"pac" | manifest.json: record | pac is listed twice
2200 | 2000 | manifest.json: record | pac at 2000 Hz
"count":8 | "count":4611686018427387904 | manifest.json: record | pac with 4611686018427387904 values
"count":8 | "count":7 | files, m4.gz | bytes_raw is 90
"bytes_gz": | "bytes_gz":9999999999 | files, m4.gz | far more than the 90 bytes
"material":9 | "material":4 | manifest.json: texture 4 | "felt" and "silk"
m9.gz | ../m9.gz | manifest.json: names the file "../m9.gz" | not inside this folder
m9.gz | a/../../m9.gz | a/../../m9.gz | not inside this folder
[0.001,0.003] | [0.001,0.005] | manifest.json: slide 3 of m4.gz | P_AC (samples: 8
m9.gz | m8.gz | m8.gz | No such file
"#;
    for [from, to, place, cause] in cells(CASES) {
        let folder = biotac();
        edit(&folder.path().join(files::BIOTAC_MANIFEST), from, to);
        fails(folder.path(), &[place, cause]);
    }
}

#[test]
fn damaged_gzip_files_are_refused() {
    // the manifest tells of the file that was meant
    let folder = biotac();
    let path = folder.path().join("m9.gz");
    let good = fs::read(&path).unwrap();
    fs::write(&path, &good[..good.len() - 7]).unwrap();
    fails(folder.path(), &["m9.gz: truncated", "fetch it again"]);
    let mut flipped = good.clone();
    flipped[20] ^= 4;
    fs::write(&path, flipped).unwrap();
    fails(
        folder.path(),
        &["m9.gz: SHA-256 of the gzip file", "damaged or changed"],
    );
    fs::write(&path, [good.as_slice(), b"more"].concat()).unwrap();
    fails(folder.path(), &["m9.gz: longer than"]);

    // the manifest has the hash of a file that is wrong itself
    let whole = gzip(&[0; 90]);
    for (packed, parts) in [
        (
            gzip(&[0; 89]),
            ["m9.gz: unpacks to 89 bytes, an odd number", "says 90"],
        ),
        (gzip(&[0; 30]), ["m9.gz: unpacks to 30 bytes", "says 90"]),
        // half a megabyte in 2 kB: not more than one byte too many is unpacked
        (
            gzip(&[0; 1 << 19]),
            ["m9.gz: unpacks to 91 or more bytes", "says 90"],
        ),
        (
            gzip(&[0; 90]),
            [
                "m9.gz: SHA-256 of the unpacked samples",
                "damaged or changed",
            ],
        ),
        (
            whole[..whole.len() - 9].to_vec(),
            ["m9.gz: no whole gzip stream", "fetch it again"],
        ),
        (
            b"no gzip".to_vec(),
            ["m9.gz: no whole gzip stream", "fetch it again"],
        ),
    ] {
        let folder = biotac();
        let manifest = folder.path().join(files::BIOTAC_MANIFEST);
        let path = folder.path().join("m9.gz");
        let old = fs::read(&path).unwrap();
        edit(&manifest, &sha256(&old), &sha256(&packed));
        let mut json: serde_json::Value =
            serde_json::from_slice(&fs::read(&manifest).unwrap()).unwrap();
        json["files"][1]["bytes_gz"] = packed.len().into();
        fs::write(&manifest, json.to_string()).unwrap();
        fs::write(&path, &packed).unwrap();
        fails(folder.path(), &parts);
    }
}
