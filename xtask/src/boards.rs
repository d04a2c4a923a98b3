//! Table of boards with firmware, the only one in the build.

use std::path::{Path, PathBuf};

use crate::run::ROOT;

/// A board's firmware is in `firmware/<name>`, its own cargo workspace, with the program `farnear-<name>`.
pub struct Board {
    /// Name in the hello answer.
    pub name: &'static str,
    pub flash_budget: u64,
    /// Limit of variables, bytes; the rest of the RAM is the stack.
    pub ram_budget: u64,
}

/// Another board is a folder and a line here; another kind of core also needs its target in `thumb.rs`.
pub const BOARDS: [Board; 1] =
    [Board { name: "nucleo-f429zi", flash_budget: 176 * 1024, ram_budget: 64 * 1024 }];
/// The board that `farnear-sim` emulates and that counts instructions.
pub const EMULATED: &Board = &BOARDS[0];

impl Board {
    pub fn folder(&self) -> PathBuf {
        ROOT.join("firmware").join(self.name)
    }

    pub fn program(&self) -> String {
        format!("farnear-{}", self.name)
    }

    pub fn of(elf: &Path) -> Option<&'static Self> {
        let program = elf.file_name()?.to_str()?;
        BOARDS.iter().find(|board| board.program() == program)
    }
}
