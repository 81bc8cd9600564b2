//! A release: the images in the formats that programmers take, and how to check and flash them.
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use anyhow::{Context as _, Result, bail, ensure};
use object::elf::{FileHeader32, PT_LOAD};
use object::read::elf::{ElfFile, ProgramHeader as _};
use object::{Endianness, elf};

use crate::factory::TABLES;
use crate::firmware::{self, hash, shown};
use crate::sbom;
use crate::shell::root;

/// Where the chip's flash begins, and how much of it an image has (memory.x).
const FLASH: u32 = 0x0800_0000;
const FLASH_LENGTH: usize = 1024 << 10;
const SUMS: &str = "SHA256SUMS";
/// Every crate in the images, as CycloneDX.
const BILL: &str = "sbom.cdx.json";

/// Names and contents.
type Files = BTreeMap<String, Vec<u8>>;

/// Builds the firmware and writes the release.
pub(crate) fn bundle(out: &Path) -> Result<()> {
    let out = root().join(out);
    let mut images = Vec::new();
    for elf in firmware::all()? {
        let bytes = std::fs::read(&elf).with_context(|| elf.display().to_string())?;
        images.push((firmware::name(&elf)?.to_owned(), bytes));
    }
    let mut tables = Files::new();
    for name in TABLES.into_iter().flat_map(|(_, names)| names) {
        let table = root().join("firmware").join(name);
        let bytes = std::fs::read(&table).with_context(|| table.display().to_string())?;
        tables.insert((*name).to_owned(), bytes);
    }
    let files = files(images, tables, sbom::firmware()?)?;
    write(&out, &files)?;
    for (name, bytes) in &files {
        println!("{:>9}  {}", bytes.len(), shown(&out.join(name)));
    }
    Ok(())
}

/// Everything that is in a release.
fn files(images: Vec<(String, Vec<u8>)>, tables: Files, bill: Vec<u8>) -> Result<Files> {
    let mut files = Files::new();
    for (name, elf) in images {
        let flat = flat(&loads(&elf)?).with_context(|| name.clone())?;
        files.insert(format!("{name}.hex"), intel_hex(FLASH, &flat).into());
        files.insert(format!("{name}.bin"), flat);
        files.insert(format!("{name}.elf"), elf);
    }
    files.extend(tables);
    files.insert(BILL.into(), bill);
    let licences = [
        (
            "LICENSE-MIT",
            include_bytes!("../../../LICENSE-MIT").as_slice(),
        ),
        ("LICENSE-APACHE", include_bytes!("../../../LICENSE-APACHE")),
    ];
    files.extend(licences.map(|(name, text)| (name.to_owned(), text.to_owned())));
    files.insert("FLASHING.md".into(), flashing().into());
    files.insert(SUMS.into(), sums(&files).into());
    Ok(files)
}

/// In the format of sha256sum.
fn sums(files: &Files) -> String {
    files.iter().fold(String::new(), |mut sums, (name, bytes)| {
        let _ = writeln!(sums, "{}  {name}", hash(bytes));
        sums
    })
}

fn write(out: &Path, files: &Files) -> Result<()> {
    std::fs::create_dir_all(out).with_context(|| format!("cannot make {}", out.display()))?;
    for entry in std::fs::read_dir(out).with_context(|| out.display().to_string())? {
        let name = entry?.file_name();
        ensure!(
            name.to_str().is_some_and(|name| files.contains_key(name)),
            "{} holds {}, which is no file of a release: empty it, or give another folder with --out",
            out.display(),
            name.display()
        );
    }
    for (name, bytes) in files {
        let file = out.join(name);
        std::fs::write(&file, bytes).with_context(|| format!("cannot write {}", file.display()))?;
    }
    Ok(())
}

/// What an ELF puts into the chip: addresses and bytes.
fn loads(elf: &[u8]) -> Result<Vec<(u32, &[u8])>> {
    let file =
        ElfFile::<FileHeader32<Endianness>>::parse(elf).context("not an ELF for the chip")?;
    let endian = file.endian();
    ensure!(
        file.elf_header().e_machine.get(endian) == elf::EM_ARM,
        "not an ELF for the chip"
    );
    let headers = file.elf_program_headers().iter();
    headers
        .filter(|header| header.p_type(endian) == PT_LOAD && header.p_filesz(endian) > 0)
        .map(|header| {
            let bytes = header.data(endian, elf);
            let bytes = bytes.map_err(|()| anyhow::anyhow!("the ELF is cut off"))?;
            // variables are copied to RAM from here at start-up
            Ok((header.p_paddr(endian), bytes))
        })
        .collect()
}

/// One piece from the beginning of the flash on; what lies between is as erased.
fn flat(loads: &[(u32, &[u8])]) -> Result<Vec<u8>> {
    let mut image = Vec::new();
    for (address, bytes) in loads {
        let at = address.checked_sub(FLASH).map(|at| at as usize);
        let range = at.map(|at| at..at + bytes.len());
        let Some(range) = range.filter(|range| range.end <= FLASH_LENGTH) else {
            bail!(
                "{} bytes at {address:#010x} are outside of the image's flash",
                bytes.len()
            );
        };
        if image.len() < range.end {
            image.resize(range.end, 0xFF);
        }
        image[range].copy_from_slice(bytes);
    }
    Ok(image)
}

/// Intel HEX, 16 bytes a line.
fn intel_hex(address: u32, bytes: &[u8]) -> String {
    let mut text = String::new();
    let mut record = |kind: u8, offset: u16, data: &[u8]| {
        let mut line = vec![data.len() as u8];
        line.extend(offset.to_be_bytes());
        line.push(kind);
        line.extend(data);
        let sum = line.iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte));
        line.push(sum.wrapping_neg());
        let line = line.iter().fold(String::new(), |mut line, byte| {
            let _ = write!(line, "{byte:02X}");
            line
        });
        text.push(':');
        text.push_str(&line);
        text.push('\n');
    };
    let mut upper = None;
    for (number, data) in bytes.chunks(16).enumerate() {
        let at = address + 16 * number as u32;
        let [high, low] = [(at >> 16) as u16, at as u16];
        if upper != Some(high) {
            upper = Some(high);
            record(4, 0, &high.to_be_bytes());
        }
        record(0, low, data);
    }
    record(1, 0, &[]);
    text
}

fn flashing() -> String {
    include_str!("../flashing.md")
        .replace("{version}", env!("CARGO_PKG_VERSION"))
        .replace("{chip}", crate::flash::CHIP)
        .replace("{SUMS}", SUMS)
        .replace("{BILL}", BILL)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variables_lie_behind_the_code_and_gaps_are_erased_flash() {
        let image = flat(&[(FLASH, &[1, 2]), (FLASH + 4, &[3])]).unwrap();
        assert_eq!(image, [1, 2, 0xFF, 0xFF, 3]);
        assert!(flat(&[(0x2000_0000, &[1])]).is_err());
        assert!(flat(&[(FLASH + FLASH_LENGTH as u32, &[1])]).is_err());
        assert!(loads(b"no ELF").is_err());
    }

    #[test]
    fn hex_lines_have_their_checksums() {
        // the first line of data is the example of Intel's specification, moved
        let data: Vec<u8> = (0..17).collect();
        assert_eq!(
            intel_hex(FLASH, &data),
            ":020000040800F2\n\
             :10000000000102030405060708090A0B0C0D0E0F78\n\
             :0100100010DF\n\
             :00000001FF\n"
        );
        // a new upper half begins where the lower one ends
        assert!(intel_hex(0x0800_FFF0, &data).contains("\n:020000040801F1\n:0100000010EF\n"));
    }

    #[test]
    fn a_release_can_be_written_twice_and_leaves_other_files_alone() {
        let folder = tempfile::tempdir().unwrap();
        let release = || {
            files(
                Vec::new(),
                [("factory.tact".to_owned(), b"table".to_vec())].into(),
                b"{}".to_vec(),
            )
            .unwrap()
        };
        let names: Vec<_> = release().into_keys().collect();
        let licences = ["LICENSE-APACHE", "LICENSE-MIT"];
        let [apache, mit] = licences;
        assert_eq!(
            names,
            ["FLASHING.md", apache, mit, SUMS, "factory.tact", BILL]
        );
        write(folder.path(), &release()).unwrap();
        let first = std::fs::read(folder.path().join(SUMS)).unwrap();
        write(folder.path(), &release()).unwrap();
        assert_eq!(std::fs::read(folder.path().join(SUMS)).unwrap(), first);
        let table = hash(b"table");
        assert!(
            String::from_utf8(first)
                .unwrap()
                .contains(&format!("{table}  factory.tact\n"))
        );
        std::fs::write(folder.path().join("thesis.txt"), "mine").unwrap();
        let error = write(folder.path(), &release()).unwrap_err().to_string();
        assert!(error.contains("thesis.txt"), "{error}");
    }
}
