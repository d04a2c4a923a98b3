//! The boards that there is firmware for: the one place of the build that names them.

use std::path::{Path, PathBuf};

use crate::run::ROOT;

/// A board that the firmware is built for: a folder `firmware/<name>` with its own cargo workspace, whose program is
/// called `farnear-<name>`.
pub struct Board {
    /// Its name, as hello tells it.
    pub name: &'static str,
    pub flash_budget: u64,
    /// Largest size of variables, bytes; the rest of the RAM is the stack.
    pub ram_budget: u64,
}

/// All boards. Another one is a folder and a line here; one with another kind of core also needs its target in `thumb.rs`.
pub const BOARDS: [Board; 1] =
    [Board { name: "nucleo-f429zi", flash_budget: 160 * 1024, ram_budget: 64 * 1024 }];
/// The one that `farnear-sim` emulates, and that counts instructions.
pub const EMULATED: &Board = &BOARDS[0];

impl Board {
    /// The board's own cargo workspace.
    pub fn folder(&self) -> PathBuf {
        ROOT.join("firmware").join(self.name)
    }

    /// Name of its program, and of its package.
    pub fn program(&self) -> String {
        format!("farnear-{}", self.name)
    }

    /// The board whose program this is.
    pub fn of(elf: &Path) -> Option<&'static Self> {
        let program = elf.file_name()?.to_str()?;
        BOARDS.iter().find(|board| board.program() == program)
    }
}
