//! Flash and static RAM of the firmware compared with the board's budgets.

use std::{fs, path::Path};

use anyhow::{Context, Result, bail};
use object::{Object, ObjectSection, SectionFlags, SectionKind, elf};

use crate::boards::Board;

pub struct Sizes {
    /// Vectors, code, constants and initial values of variables.
    pub flash: u64,
    /// Variables: zeroed, initialised or retained.
    pub ram: u64,
}

pub fn measure(elf: &Path) -> Result<Sizes> {
    let bytes = fs::read(elf).with_context(|| format!("cannot read {}", elf.display()))?;
    let file =
        object::File::parse(&*bytes).with_context(|| format!("{} is not an ELF file", elf.display()))?;
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

/// Prints the sizes; fails above a budget.
pub fn check(elf: &Path) -> Result<()> {
    let board =
        Board::of(elf).with_context(|| format!("{} is not the program of any board", elf.display()))?;
    let Sizes { flash, ram } = measure(elf)?;
    let Board { name, flash_budget, ram_budget } = board;
    println!("{name}: flash {flash} of {flash_budget} bytes, static RAM {ram} of {ram_budget} bytes");
    if flash > *flash_budget || ram > *ram_budget {
        bail!(
            "the firmware of {name} is over its budget: flash {flash} of {flash_budget}, RAM {ram} of {ram_budget} bytes"
        );
    }
    Ok(())
}
