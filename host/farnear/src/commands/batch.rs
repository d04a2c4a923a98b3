use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use farnear_workflows::batch::{self, BatchSettings, JobReport, Pattern, Shard};

use crate::{report, terminal};

/// Do many jobs on all cores.
///
/// A manifest in TOML names what jobs of a kind share, then every job. `do` is a command that writes --out and needs no rig, with
/// hyphens between its words (depth, focus-stack, calibrate-camera, silhouettes-video), or campaign. The other fields are the flags of
/// that command. Paths are relative to the manifest:
///
///     [depth]
///     optics = "rig.toml"
///     write = "npy,view"
///
///     [[job]]
///     do = "depth"
///     far = "001/far.png"
///     near = "001/near.png"
///     out = "001/depth"
///
/// A manifest in CSV has a header with the names of the fields and a row per job.
///
/// Each job prints a JSON line when it ends: "done", "already" (its result was made before from the same inputs and settings by
/// the same version, as batch.toml next to it records) or "failed", with its message. One that fails does not stop the others; failures
/// are also written to MANIFEST.failures.jsonl, and the exit code is 1. After Ctrl-C, a kill or a loss of power the same command
/// continues.
#[derive(Args)]
#[command(
    verbatim_doc_comment,
    after_help = "Example: farnear batch pairs.csv --generate depth --field 'far=*/far.png' --field 'near=*/near.png' --field 'out=*/depth'\n\
                  \x20        farnear batch pairs.csv --dry-run\n\
                  \x20        farnear batch pairs.csv --summary figures.csv\n\
                  \x20        farnear batch clips.csv --shard 2/4 > clips-2.jsonl"
)]
pub struct Arguments {
    /// The list of jobs: .toml or .csv.
    manifest: PathBuf,
    /// Jobs at a time, each on one core; 0 = as many as there are cores.
    #[arg(long, value_name = "N", default_value_t = 0)]
    jobs: usize,
    /// Do the I-th of N shares of the jobs only, so that N machines do all of them.
    #[arg(long, value_name = "I/N", default_value = "1/1")]
    shard: Shard,
    /// Look through results that are done already byte by byte, and make damaged ones again.
    #[arg(long)]
    verify: bool,
    /// File for failures, a JSON line each [default: MANIFEST's name with .failures.jsonl].
    #[arg(long, value_name = "FILE")]
    failures: Option<PathBuf>,
    /// Write a table (CSV) with a row per job and a column per figure, of results made now and before; share 2 of 4 writes FILE with .2of4 before its ending.
    #[arg(long, value_name = "FILE", conflicts_with = "dry_run")]
    summary: Option<PathBuf>,
    /// Only report the state of each job: "todo", "already", or "failed" with its message. Writes and removes no file.
    #[arg(long)]
    dry_run: bool,
    /// Exit with 0 even if jobs failed; they are in the file of failures.
    #[arg(long)]
    allow_failures: bool,
    /// Write MANIFEST (CSV) with a job for each file that the first --field matches, and do nothing else.
    #[arg(long, value_name = "KIND", requires = "field")]
    generate: Option<String>,
    /// Field of the jobs to generate; each * is replaced by the match of the same * of the first field. May be repeated.
    #[arg(long, value_name = "NAME=PATTERN", requires = "generate")]
    field: Vec<Pattern>,
}

pub fn run(arguments: Arguments) -> Result<()> {
    let Arguments {
        manifest,
        jobs,
        shard,
        verify,
        failures,
        summary,
        dry_run,
        allow_failures,
        generate,
        field,
    } = arguments;
    if let Some(kind) = generate {
        let written = batch::generate(&manifest, &kind, &field)?;
        terminal::say(&format!("wrote {} with {written} jobs\n", manifest.display()));
        return Ok(());
    }
    let settings =
        BatchSettings { manifest, jobs, shard, verify, failures, summary, dry_run, allow_failures };
    batch::run(&settings, &terminal::long_work()?, &report::line::<JobReport>)?;
    Ok(())
}
