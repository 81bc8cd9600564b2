//! An image in the format that programmers take.
use std::fmt::Write as _;

use anyhow::{Context as _, Result, bail, ensure};
use object::elf::{FileHeader32, PT_LOAD};
use object::read::elf::{ElfFile, ProgramHeader as _};
use object::{Endianness, elf};

/// Where the chip's flash begins, and how much of it an image has (memory.x).
const FLASH: u32 = 0x0800_0000;
const FLASH_LENGTH: usize = 1024 << 10;

pub(super) fn flat(elf: &[u8]) -> Result<Vec<u8>> {
    joined(&loads(elf)?)
}

/// The addresses and bytes that an ELF puts into the chip.
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
fn joined(loads: &[(u32, &[u8])]) -> Result<Vec<u8>> {
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

/// The same as Intel HEX: records of 16 bytes, each with the sum of its bytes.
pub(super) fn hex(image: &[u8]) -> String {
    let record = |text: &mut String, at: u16, kind: u8, data: &[u8]| {
        let [high, low] = at.to_be_bytes();
        let mut sum = 0_u8;
        text.push(':');
        for byte in [data.len() as u8, high, low, kind].iter().chain(data) {
            sum = sum.wrapping_sub(*byte);
            let _ = write!(text, "{byte:02X}");
        }
        let _ = writeln!(text, "{sum:02X}");
    };
    let mut text = String::new();
    for (n, bytes) in image.chunks(16).enumerate() {
        let at = FLASH + 16 * n as u32;
        if at.trailing_zeros() >= 16 {
            record(&mut text, 0, 4, &((at >> 16) as u16).to_be_bytes());
        }
        record(&mut text, at as u16, 0, bytes);
    }
    record(&mut text, 0, 1, &[]);
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Intel's specification, revision A of 1988: types 0, 1 and 4.
    #[test]
    fn hex_records_have_their_addresses_and_sums() {
        let mut image = vec![0xFF; 0x1_0000];
        image.extend([0x02, 0x33, 0x7A]);
        let text = hex(&image);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0], ":020000040800F2");
        assert_eq!(lines[2], ":10001000FFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFFF0");
        assert_eq!(
            lines[lines.len() - 3..],
            [":020000040801F1", ":0300000002337A4E", ":00000001FF"]
        );
    }

    #[test]
    fn variables_lie_behind_the_code_and_gaps_are_erased_flash() {
        let image = joined(&[(FLASH, &[1, 2]), (FLASH + 4, &[3])]).unwrap();
        assert_eq!(image, [1, 2, 0xFF, 0xFF, 3]);
        assert!(joined(&[(0x2000_0000, &[1])]).is_err());
        assert!(joined(&[(FLASH + FLASH_LENGTH as u32, &[1])]).is_err());
        assert!(loads(b"no ELF").is_err());
    }
}
