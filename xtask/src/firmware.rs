//! Builds every board's firmware and copies the ELFs next to the host programs, where `farnear-sim` finds its own.

use std::{
    fs,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result, bail};

use crate::{
    boards::{BOARDS, Board, EMULATED},
    run::{finish, step, target_folder},
    sizes,
    thumb::{TARGET, Way},
};

/// Counts the instructions of the on-board routines.
const COUNTER: &str = "farnear-count";
/// Tests a real board.
const BOARD_TEST: &str = "farnear-board-test";

fn built(board: &Board, program: &str) -> Result<PathBuf> {
    let elf = board.folder().join("target").join(TARGET).join("release").join(program);
    if !elf.exists() {
        bail!("the build succeeded without creating {}", elf.display());
    }
    Ok(elf)
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Selection {
    All,
    Firmware,
}

fn build_board(board: &Board, way: Way, selection: Selection) -> Result<PathBuf> {
    let program = board.program();
    let mut cargo = way.cargo(&board.folder(), "build");
    cargo.args(["--release", "--locked"]);
    if selection == Selection::Firmware {
        cargo.args(["--bin", &program]);
    }
    finish(&mut cargo)?;
    let elf = built(board, &program)?;
    put_beside(&elf, &program)?;
    if selection == Selection::All {
        put_beside(&built(board, BOARD_TEST)?, BOARD_TEST)?;
    }
    Ok(elf)
}

/// Copies an ELF next to the host programs.
fn put_beside(elf: &Path, program: &str) -> Result<()> {
    for profile in ["debug", "release"] {
        let beside = target_folder().join(profile);
        let copy = beside.join(format!("{program}.elf"));
        fs::create_dir_all(&beside)
            .and_then(|()| fs::copy(elf, &copy))
            .with_context(|| format!("cannot write {}", copy.display()))?;
    }
    Ok(())
}

pub fn board_test() -> Result<PathBuf> {
    built(EMULATED, BOARD_TEST)
}

pub fn counter() -> Result<PathBuf> {
    built(EMULATED, COUNTER)
}

/// Returns the emulated board's ELF.
pub fn build() -> Result<PathBuf> {
    step("firmware");
    build_with(Way::find()?)
}

/// Only what the emulated board runs.
pub fn build_emulated(way: Way) -> Result<PathBuf> {
    build_board(EMULATED, way, Selection::Firmware)
}

pub fn build_with(way: Way) -> Result<PathBuf> {
    let elf = build_board(EMULATED, way, Selection::All)?;
    for board in BOARDS.iter().filter(|board| board.name != EMULATED.name) {
        sizes::check(&build_board(board, way, Selection::All)?)?;
    }
    Ok(elf)
}
