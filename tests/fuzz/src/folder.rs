//! Recordings and property tables: files that anybody may have written.

use std::fs;
use std::io::Write as _;
use std::path::Path;

use flate2::Compression;
use flate2::write::GzEncoder;
use sha2::{Digest as _, Sha256};
use tactus_lab::data::properties::PropertyTable;
use tactus_lab::data::recordings::{RecordingError, RecordingSet};
use tactus_lab::eval::experiment::Experiment;

/// Between manifest and file.
pub(crate) const RULE: &[u8] = b"\n---\n";

/// A folder of recordings in one of the formats, or a table of properties: the first byte says which.
///
/// The rest is the manifest; what follows a line `---` in it is the content of the file `a`, which is there as `a.npy`,
/// and compressed as `a.gz`. `HASH`, `PACKED_HASH`, `SIZE` and `PACKED_SIZE` in the manifest become theirs.
pub fn recordings(data: &[u8]) {
    drop(read(data));
}

/// Why it is refused, as it is shown to people.
fn read(data: &[u8]) -> Result<(), String> {
    let Some((&kind, body)) = data.split_first() else {
        return Ok(());
    };
    let at = body.windows(RULE.len()).position(|w| w == RULE);
    let (manifest, file) = match at {
        Some(at) => (&body[..at], &body[at + RULE.len()..]),
        None => (body, &[][..]),
    };
    let mut packer = GzEncoder::new(Vec::new(), Compression::fast());
    packer.write_all(file).expect("memory");
    let packed = packer.finish().expect("memory");
    let sha256 = |bytes: &[u8]| -> String {
        let digest = Sha256::digest(bytes);
        digest.iter().map(|b| format!("{b:02x}")).collect()
    };
    // the longer words first
    let told = [
        ("PACKED_HASH", sha256(&packed)),
        ("PACKED_SIZE", packed.len().to_string()),
        ("HASH", sha256(file)),
        ("SIZE", file.len().to_string()),
    ];
    // what is no text stays what it is
    let manifest = match std::str::from_utf8(manifest) {
        Ok(text) => told
            .iter()
            .fold(text.to_owned(), |text, (word, is)| text.replace(word, is))
            .into_bytes(),
        Err(_) => manifest.to_vec(),
    };
    let folder = Folder::new();
    let path = &folder.0;
    let manifest_is = |name: &str| {
        let file = path.join(name);
        fs::write(&file, &manifest).expect("a file in RAM");
        file
    };
    fs::write(path.join("a.npy"), file).expect("a file in RAM");
    fs::write(path.join("a.gz"), packed).expect("a file in RAM");
    match kind % 3 {
        0 => {
            manifest_is("manifest.csv");
            opened(path).map_err(|e| e.to_string())
        }
        1 => {
            manifest_is("manifest.json");
            opened(path).map_err(|e| e.to_string())
        }
        _ => {
            let file = manifest_is("properties.csv");
            let table = PropertyTable::read(&file).map_err(|e| e.to_string())?;
            let experiment = Experiment::given(&table, None, 1);
            experiment.map(drop).map_err(|e| e.to_string())
        }
    }
}

fn opened(folder: &Path) -> Result<(), RecordingError> {
    let set = RecordingSet::open(folder)?;
    for texture in 0..set.textures().len().min(4) {
        // a thousand are as good as more
        for slide in set.load_texture(texture)?.into_iter().take(1000) {
            let (steady, pac) = (slide.steady(2200), slide.pac());
            assert!(steady.end <= pac.len(), "the steady part lies in it");
            let plan = tactus_core::dsp::Plan::new();
            drop(tactus_lab::data::replay::measure(&plan, &slide));
        }
    }
    Ok(())
}

/// Gone at the end, in RAM where there is such a file system.
pub(crate) struct Folder(pub(crate) std::path::PathBuf);

impl Folder {
    pub(crate) fn new() -> Self {
        let root = [Path::new("/dev/shm"), &std::env::temp_dir()]
            .into_iter()
            .find(|root| root.is_dir())
            .map(|root| root.join(format!("tactus-fuzz-{}", std::process::id())));
        let root = root.expect("a folder for temporary files");
        fs::create_dir_all(&root).expect("a folder of our own");
        Self(root)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// Manifests of so many bytes that are right: every row another texture, or every row another slide of one.
pub fn many_rows(bytes: usize) -> Vec<Vec<u8>> {
    let seeds = seeds();
    let at = seeds[0].windows(RULE.len()).position(|w| w == RULE);
    let (manifest, file) = seeds[0].split_at(at.expect("our own seed"));
    let manifest = std::str::from_utf8(manifest).expect("our own text");
    let mut lines = manifest.lines();
    let (head, row) = (
        lines.next().unwrap_or_default(),
        lines.next().unwrap_or_default(),
    );
    let rest = row.strip_prefix("3,felt,1,").expect("our own row");
    let of = |begins: fn(usize) -> String| {
        // each of its three hashes becomes one of 64 digits
        let rows = 1..=bytes / (row.len() + 3 * 60 + 10);
        let rows = rows.map(|n| format!("{}{rest}\n", begins(n)));
        let text = rows.fold(format!("{head}\n"), |text, row| text + &row);
        [text.as_bytes(), file].concat()
    };
    let all = [
        of(|n| format!("{n},felt {n},1,")),
        of(|n| format!("3,felt,{n},")),
    ];
    let whole = all
        .into_iter()
        .inspect(|rows| assert_eq!(read(rows), Ok(())));
    whole.collect()
}

/// Folders that are whole, one of each kind.
pub(crate) fn seeds() -> Vec<Vec<u8>> {
    let columns = tactus_lab::data::recordings::own::COLUMNS.join(",");
    let own = format!(
        "{columns}\n3,felt,1,0.5,25,0.02,0.1,2.2,,,a.npy,2200,HASH,a.npy,100,HASH,,100,\n\
         3,felt,2,0.5,25,0.02,0.1,,a.npy,HASH,a.npy,2200,HASH,a.npy,100,HASH,a.npy,110,HASH\n"
    );
    let biotac = r#"{"slides":[1,2],"record":[{"name":"pac","count":220,"rate_hz":2200},
{"name":"pdc","count":10,"rate_hz":100},
{"name":"f_tangential","count":10,"rate_hz":100}],"motion":{"speed_mm_s":25.0},"steady_window_s":[0.02,0.1],
"files":[{"file":"a.gz","material":1,"name":"felt","n_slides":2,"bytes_gz":PACKED_SIZE,"bytes_raw":SIZE,
"sha256_gz":"PACKED_HASH","sha256_raw":"HASH"}]}"#;
    let properties = "texture,movement,trial,set,traction,roughness,fineness\n1,1,1,train,0.5,3.2,5.1\n\
        1,1,2,train,0.6,3.1,5.2\n2,1,1,train,0.9,2.2,4.1\n2,1,2,train,0.8,2.4,4.0\n1,1,1,validate,0.5,3.2,5.1\n";
    let wave = |n: usize| -> Vec<u8> {
        (0..n)
            .flat_map(|i| ((i * 37 % 100) as i16).to_le_bytes())
            .collect()
    };
    let mut npy =
        b"\x93NUMPY\x01\x00v\x00{'descr': '<i2', 'fortran_order': False, 'shape': (220,), }"
            .to_vec();
    npy.resize(127, b' ');
    npy.push(b'\n');
    npy.extend(wave(220));
    [
        (0u8, own.as_str(), npy),
        (1, biotac, wave(2 * 240)),
        (2, properties, Vec::new()),
    ]
    .into_iter()
    .map(|(kind, manifest, file)| [&[kind], manifest.as_bytes(), RULE, &file].concat())
    .inspect(|seed| assert_eq!(read(seed), Ok(()), "{}", String::from_utf8_lossy(seed)))
    .collect()
}
