//! Flash and static RAM of the firmware compared with the board's budgets.

use std::{fs, path::Path};

use anyhow::{Context, Result, bail};
use object::{Object, ObjectSection, SectionFlags, SectionKind, elf};

use crate::boards::Board;

/// Bytes of flash (vectors, code, constants, initial values) and of RAM (zeroed, initialised and retained variables).
fn measure(elf: &Path) -> Result<[u64; 2]> {
    let bytes = fs::read(elf).with_context(|| format!("cannot read {}", elf.display()))?;
    let file =
        object::File::parse(&*bytes).with_context(|| format!("{} is not an ELF file", elf.display()))?;
    let [mut flash, mut ram] = [0, 0];
    for section in file.sections() {
        let SectionFlags::Elf { sh_flags } = section.flags() else { continue };
        if sh_flags & u64::from(elf::SHF_ALLOC) == 0 {
            continue;
        }
        if section.kind() != SectionKind::UninitializedData {
            flash += section.size();
        }
        if sh_flags & u64::from(elf::SHF_WRITE) != 0 {
            ram += section.size();
        }
    }
    Ok([flash, ram])
}

/// Prints the sizes; fails above a budget.
pub fn check(elf: &Path) -> Result<()> {
    let board =
        Board::of(elf).with_context(|| format!("{} is not the program of any board", elf.display()))?;
    let [flash, ram] = measure(elf)?;
    let Board { name, flash_budget, ram_budget } = board;
    println!("{name}: flash {flash} of {flash_budget} bytes, static RAM {ram} of {ram_budget} bytes");
    if flash > *flash_budget || ram > *ram_budget {
        bail!(
            "the firmware of {name} is over its budget: flash {flash} of {flash_budget}, RAM {ram} of {ram_budget} bytes"
        );
    }
    Ok(())
}
