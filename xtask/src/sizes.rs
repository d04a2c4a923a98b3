//! The firmware's flash and static RAM against their budgets.

use std::{fs, path::Path};

use anyhow::{Context, Result, bail};
use object::{Object, ObjectSection, SectionFlags, SectionKind, elf};

/// Flash budget in bytes.
pub const FLASH_BUDGET: u64 = 128 * 1024;
/// Static RAM budget in bytes (the stack has the other 128 KiB of the 192).
pub const RAM_BUDGET: u64 = 64 * 1024;

/// Bytes an image takes on the chip.
pub struct Sizes {
    /// Vectors, code, constants and the initial values of variables.
    pub flash: u64,
    /// Variables, zeroed, initialised or retained.
    pub ram: u64,
}

/// Reads the sizes from an ELF.
pub fn measure(elf: &Path) -> Result<Sizes> {
    let bytes = fs::read(elf).with_context(|| format!("cannot read {}", elf.display()))?;
    let file = object::File::parse(&*bytes).with_context(|| format!("{} is no ELF", elf.display()))?;
    let mut sizes = Sizes { flash: 0, ram: 0 };
    for section in file.sections() {
        let SectionFlags::Elf { sh_flags } = section.flags() else { continue };
        if sh_flags & u64::from(elf::SHF_ALLOC) == 0 {
            continue;
        }
        let writable = sh_flags & u64::from(elf::SHF_WRITE) != 0;
        if section.kind() != SectionKind::UninitializedData {
            sizes.flash += section.size();
        }
        if writable {
            sizes.ram += section.size();
        }
    }
    Ok(sizes)
}

/// Prints the sizes; fails where a budget is exceeded.
pub fn check(elf: &Path) -> Result<()> {
    let Sizes { flash, ram } = measure(elf)?;
    println!("flash {flash} of {FLASH_BUDGET} bytes, static RAM {ram} of {RAM_BUDGET} bytes");
    if flash > FLASH_BUDGET || ram > RAM_BUDGET {
        bail!(
            "the firmware is over its budget: flash {flash} of {FLASH_BUDGET}, RAM {ram} of {RAM_BUDGET} bytes"
        );
    }
    Ok(())
}
