//! An image in the formats that programmers take.
use std::fmt::Write as _;

use anyhow::{Context as _, Result, bail, ensure};
use object::elf::{FileHeader32, PT_LOAD};
use object::read::elf::{ElfFile, ProgramHeader as _};
use object::{Endianness, elf};

/// Where the chip's flash begins, and how much of it an image has (memory.x).
const FLASH: u32 = 0x0800_0000;
const FLASH_LENGTH: usize = 1024 << 10;

/// An ELF as one piece of memory, and as Intel HEX.
pub(super) fn formats(elf: &[u8]) -> Result<(Vec<u8>, String)> {
    let flat = flat(&loads(elf)?)?;
    let hex = intel_hex(FLASH, &flat);
    Ok((flat, hex))
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
}
