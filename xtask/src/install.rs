use std::fs;

use anyhow::{Context, Result};

use crate::{boards::BOARDS, firmware, host, run::cargo_home};

/// Copies the programs and the firmware's ELF into cargo's bin folder.
pub fn run() -> Result<()> {
    firmware::build()?;
    let built = host::build_release()?;
    let home = cargo_home()
        .context("no home folder: set CARGO_HOME to the folder with the bin/ for the programs")?;
    let bin = home.join("bin");
    fs::create_dir_all(&bin).with_context(|| format!("cannot create {}", bin.display()))?;
    let programs = host::PROGRAMS.map(String::from);
    for name in programs.into_iter().chain(BOARDS.iter().map(|board| format!("{}.elf", board.program()))) {
        // A running program can be replaced but not overwritten.
        let (aside, place) = (bin.join(format!(".{name}.new")), bin.join(&name));
        fs::copy(built.join(&name), &aside)
            .and_then(|_| fs::rename(&aside, &place))
            .with_context(|| format!("cannot write {}", place.display()))?;
        println!("{}", place.display());
    }
    Ok(())
}
