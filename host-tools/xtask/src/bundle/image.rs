//! An image in the format that programmers take.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variables_lie_behind_the_code_and_gaps_are_erased_flash() {
        let image = joined(&[(FLASH, &[1, 2]), (FLASH + 4, &[3])]).unwrap();
        assert_eq!(image, [1, 2, 0xFF, 0xFF, 3]);
        assert!(joined(&[(0x2000_0000, &[1])]).is_err());
        assert!(joined(&[(FLASH + FLASH_LENGTH as u32, &[1])]).is_err());
        assert!(loads(b"no ELF").is_err());
    }
}
