//! Runs the jobs of a manifest on all cores, each once, also after interruptions. A job is done if its result is
//! complete and `batch.toml` lists the same settings, input hashes and program version. Results are moved into place
//! when complete. Memory grows by some bytes for each job.

mod campaign;
mod error;
mod fields;
mod generate;
mod jobs;
mod manifest;
mod order;
mod outs;
mod place;
mod provenance;
mod summary;
mod tally;

use std::{
    ffi::{OsStr, OsString},
    fs, io,
    path::{Path, PathBuf},
    sync::{Arc, Mutex, PoisonError},
    time::Instant,
};

use farnear_files::staging::write_file;
use serde::Serialize;
use serde_json::Value;

pub(crate) use self::place::{RECORD, final_place, is_unfinished, result_of};
pub use self::{
    error::BatchError,
    generate::{Pattern, generate},
};
use self::{
    fields::Fields,
    manifest::{Entry, Manifest},
    order::{Running, Turn},
    outs::{Outs, are_same},
    place::{Found, Place},
    provenance::{Provenance, Sums},
    summary::Summary,
    tally::Tally,
};
use crate::{
    cache::Cache,
    context::{Cancel, Context, Progress, Unattended},
    error::{Result, WorkflowError},
    figures::rounded,
    parameters::{THREADS, within},
    request::{PathKind, Task, outputs::check_folder},
};

const WARNINGS_MAX: usize = 20;

#[derive(Clone, PartialEq, Eq, Debug)]
pub struct BatchSettings {
    pub manifest: PathBuf,
    /// Parallel jobs, one core each; 0 = number of cores.
    pub jobs: usize,
    pub shard: Shard,
    /// Verify finished results by hash, not only by file length.
    pub verify: bool,
    /// JSON lines of failures. Default: `MANIFEST.failures.jsonl` next to the manifest.
    pub failures: Option<PathBuf>,
    /// CSV table of the shard's jobs with their figures; `figures.2of4.csv` for one of several shards. A dry run writes none.
    pub summary: Option<PathBuf>,
    pub dry_run: bool,
    /// Return success even if jobs failed.
    pub allow_failures: bool,
}

/// One of `count` interleaved parts of a manifest.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Shard {
    index: usize,
    of: usize,
}

#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("`{0}` is not a shard: expected I/N, from 1/N to N/N")]
pub struct UnknownShard(String);

impl Default for Shard {
    fn default() -> Self {
        Self { index: 1, of: 1 }
    }
}

impl std::str::FromStr for Shard {
    type Err = UnknownShard;

    fn from_str(text: &str) -> Result<Self, UnknownShard> {
        let parts =
            text.split_once('/').and_then(|(index, of)| Some((index.parse().ok()?, of.parse().ok()?)));
        match parts {
            Some((index, of)) if (1..=of).contains(&index) => Ok(Self { index, of }),
            _ => Err(UnknownShard(text.into())),
        }
    }
}

impl Shard {
    /// `number` counts from 1.
    fn has(self, number: usize) -> bool {
        (number - 1) % self.of == self.index - 1
    }

    /// A file next to `path`: the number of the shard, if there are several, comes between `name` and `ending`.
    fn report(self, path: &Path, name: Option<&OsStr>, ending: &OsStr) -> PathBuf {
        let Self { index, of } = self;
        let mut name = name.unwrap_or_default().to_os_string();
        if of > 1 {
            name.push(format!(".{index}of{of}"));
        }
        name.push(ending);
        path.with_file_name(name)
    }

    /// Number of jobs in this shard, of `jobs`.
    fn share(self, jobs: usize) -> usize {
        (jobs + self.of - self.index) / self.of
    }
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum State {
    Done,
    /// Done by an earlier run.
    Already,
    /// Pending, in a dry run.
    Todo,
    Failed,
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct JobReport {
    /// Number in the manifest, from 1.
    pub job: usize,
    pub line: usize,
    #[serde(rename = "do")]
    pub kind: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub out: Option<String>,
    pub state: State,
    pub seconds: f64,
    /// Output of the command of the same name.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub figures: Option<Value>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
}

#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct BatchFigures {
    pub jobs: usize,
    pub done: usize,
    pub already: usize,
    #[serde(skip_serializing_if = "is_zero")]
    pub todo: usize,
    pub failed: usize,
    pub seconds: f64,
}

fn is_zero(count: &usize) -> bool {
    *count == 0
}

/// Runs a manifest's jobs and calls `on_job` as each ends, one at a time. Returns [`BatchError::Failed`]
/// after the last job if any failed, in a dry run [`BatchError::WouldFail`]. An error from `on_job` stops the run.
pub fn run(
    settings: &BatchSettings,
    context: &Context<'_>,
    on_job: &(dyn Fn(&JobReport) -> io::Result<()> + Sync),
) -> Result<BatchFigures> {
    within("jobs", settings.jobs, &THREADS, "")?;
    let start = Instant::now();
    let outs = Outs::of(&settings.manifest)?;
    if outs.jobs() == 0 {
        return Err(BatchError::Empty { path: settings.manifest.clone() }.into());
    }
    let total = settings.shard.share(outs.jobs());
    let failures = settings.failures.clone().unwrap_or_else(|| failures_file(settings));
    outs.check_report("failures", &failures, Tally::begins)?;
    if settings.failures.is_some() && !settings.dry_run {
        prepare_report("failures", &failures)?;
    }
    let table = summary_file(settings);
    if let Some(path) = &table {
        outs.check_report("summary", path, Summary::begins)?;
        if are_same(path, &failures)? {
            let reason = "the failures are written there".into();
            return Err(BatchError::Report { what: "summary", path: path.clone(), reason }.into());
        }
        prepare_report("summary", path)?;
    }
    let summary = Mutex::new(Summary::default());
    let on_job = |report: &JobReport| {
        if table.is_some() {
            summary.lock().unwrap_or_else(PoisonError::into_inner).add(report);
        }
        on_job(report)
    };
    let kept = (!settings.dry_run).then_some(failures.as_path());
    let tally = Tally::new(total, kept, context, &on_job)?;
    let work = Work {
        settings,
        outs,
        base: settings.manifest.parent().unwrap_or(Path::new("")).to_path_buf(),
        manifest: Mutex::new(Manifest::open(&settings.manifest)?),
        running: Running::default(),
        sums: Sums::default(),
        cache: Arc::clone(&context.cache),
        tally: &tally,
        cancel: &context.cancel,
        stop: Cancel::default(),
    };
    work.on_all_cores()?;
    let figures = BatchFigures { seconds: rounded(start.elapsed().as_secs_f64(), 3), ..tally.end() };
    let BatchFigures { jobs, done, already, todo, failed, seconds } = figures;
    let planned = if settings.dry_run { format!("{todo} to do, ") } else { String::new() };
    let sum = format!("{planned}{done} done, {already} already done, {failed} failed, of {jobs} jobs");
    context.cancel.check(&format!("doing jobs ({sum}); the same command continues"))?;
    context.info(&format!("{sum}, in {seconds} s"));
    if let Some(path) = &table {
        let text = summary.lock().unwrap_or_else(PoisonError::into_inner).csv();
        let unwritable = |error: csv::Error| BatchError::Write { path: path.clone(), source: error.into() };
        write_file(path, &text.map_err(unwritable)?)?;
    }
    if failed > 0 && !settings.allow_failures {
        if settings.dry_run {
            return Err(BatchError::WouldFail { failed, jobs }.into());
        }
        return Err(BatchError::Failed { failed, jobs, failures }.into());
    }
    Ok(figures)
}

/// Creates the folder of a report. Checks before the jobs that the report can be written.
fn prepare_report(what: &'static str, path: &Path) -> Result<()> {
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder).map_err(|source| BatchError::Write { path: path.into(), source })?;
    }
    check_folder(what, path)
}

fn failures_file(settings: &BatchSettings) -> PathBuf {
    let manifest = &settings.manifest;
    settings.shard.report(manifest, manifest.file_name(), ".failures.jsonl".as_ref())
}

/// `None` in a dry run.
fn summary_file(settings: &BatchSettings) -> Option<PathBuf> {
    let path = settings.summary.as_deref().filter(|_| !settings.dry_run)?;
    let mut ending = OsString::new();
    if let Some(extension) = path.extension() {
        ending.push(".");
        ending.push(extension);
    }
    Some(settings.shard.report(path, path.file_stem(), &ending))
}

struct Work<'a> {
    settings: &'a BatchSettings,
    outs: Outs,
    base: PathBuf,
    manifest: Mutex<Manifest>,
    running: Running,
    sums: Sums,
    cache: Arc<Cache>,
    tally: &'a Tally<'a>,
    cancel: &'a Cancel,
    /// Cancels all threads after an error in one of them.
    stop: Cancel,
}

impl Work<'_> {
    fn on_all_cores(&self) -> Result<()> {
        let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        let threads = if self.settings.jobs == 0 { cores } else { self.settings.jobs };
        let pools = (0..threads).map(|_| rayon::ThreadPoolBuilder::new().num_threads(1).build());
        let pools = pools.collect::<Result<Vec<_>, _>>();
        let pools = pools.map_err(|error| BatchError::Threads(error.to_string()))?;
        std::thread::scope(|scope| {
            let work = |pool: rayon::ThreadPool| pool.install(|| self.until_the_end());
            let threads: Vec<_> = pools.into_iter().map(|pool| scope.spawn(move || work(pool))).collect();
            let ended = threads
                .into_iter()
                .map(|thread| thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
            // Wait for all threads before returning an error.
            ended.collect::<Vec<Result<()>>>().into_iter().collect()
        })
    }

    fn until_the_end(&self) -> Result<()> {
        while !self.cancel.is_cancelled() && !self.stop.is_cancelled() {
            let next = self.next();
            let done = next.and_then(|next| match next {
                Some((entry, _turn)) => self.do_one(entry).map(|()| true),
                None => Ok(false),
            });
            match done {
                Ok(true) => {}
                Ok(false) => return Ok(()),
                Err(error) => {
                    self.stop.cancel();
                    return Err(error);
                }
            }
        }
        Ok(())
    }

    fn next(&self) -> Result<Option<(Entry, Turn<'_>)>> {
        let mut manifest = self.manifest.lock().unwrap_or_else(PoisonError::into_inner);
        while let Some(entry) = manifest.next()? {
            if self.settings.shard.has(entry.number) {
                let turn = self.running.begin(entry.line);
                return Ok(Some((entry, turn)));
            }
        }
        Ok(None)
    }

    /// Runs and reports a job. Returns only errors of the batch itself.
    fn do_one(&self, entry: Entry) -> Result<()> {
        let start = Instant::now();
        let Entry { number, line, job } = entry;
        let (kind, fields, unreadable) = match job {
            Ok((kind, fields)) => (kind, fields, None),
            Err(error) => (String::new(), Fields::default(), Some(error)),
        };
        let warnings = Warnings::default();
        let cache = Arc::clone(&self.cache);
        let context = Context { cache, ..Context::new(&warnings, &Unattended, self.cancel.clone()) };
        let out = fields.text("out").ok();
        let refused = out.as_deref().and_then(|out| self.outs.check(line, out).err());
        let ours = refused.is_none();
        let ended = match unreadable.or(refused) {
            Some(error) => Err(error.into()),
            None => self.job(line, &kind, &fields, &context, &warnings),
        };
        let (state, figures, error) = match ended {
            Ok((state, figures)) => (state, figures, None),
            // The next run does it. A job may also fail because the same Ctrl-C ended its ffmpeg.
            Err(error) if error.is_cancelled() || self.cancel.is_cancelled() => return Ok(()),
            Err(error) => {
                if ours && !is_in_use(&error) && !self.settings.dry_run {
                    self.discard(&kind, out.as_deref());
                }
                (State::Failed, None, Some(error.to_string()))
            }
        };
        let seconds = rounded(start.elapsed().as_secs_f64(), 6);
        let mut warnings = warnings.all();
        // Report warnings once.
        if figures.as_ref().is_some_and(|figures| figures.get("warnings").is_some()) {
            warnings.clear();
        }
        self.tally.tell(&JobReport { job: number, line, kind, out, state, seconds, figures, warnings, error })
    }

    fn discard(&self, kind: &str, out: Option<&str>) {
        let (Ok(kind), Some(out)) = (jobs::kind(kind), out) else { return };
        let place = Place::new(self.base.join(out), makes_file(kind));
        // If removal fails, the job's own error most likely has the same cause.
        let _ = place.discard();
    }

    fn job(
        &self,
        line: usize,
        kind: &str,
        fields: &Fields,
        context: &Context<'_>,
        warnings: &Warnings,
    ) -> Result<(State, Option<Value>)> {
        let kind = jobs::kind(kind)?;
        jobs::check_outputs(kind, fields)?;
        let out = fields.base().join(fields.text("out")?);
        let mut is_made_first = false;
        for path in kind.files(&fields.all(), fields.base()) {
            let Some(maker) = self.outs.maker_of(&path, line)? else { continue };
            if maker > line {
                return Err(BatchError::Order { path, line: maker }.into());
            }
            self.running.wait_for(maker);
            is_made_first |= self.settings.dry_run && !path.exists();
        }
        context.cancel.check("waiting for another job")?;
        if is_made_first {
            return Ok((State::Todo, None));
        }
        // Now, because a text is the name of a file only if that exists.
        let work = (kind.job)(fields.all(), fields.base())?;
        let input = self.sums.of(&work.inputs(), &self.base, &|path: &Path| self.outs.makes(path))?;
        let wanted = Provenance::new(kind.name, fields, input);
        let place = Place::new(out, makes_file(kind));
        match place.look(&wanted, self.settings.verify)? {
            Found::Done(figures, earlier) => {
                earlier.iter().for_each(|warning| warnings.warn(warning));
                Ok((State::Already, figures))
            }
            Found::ToDo if self.settings.dry_run => Ok((State::Todo, None)),
            Found::ToDo => {
                let figures = place.fill(wanted, |out| work.run(out, context), || warnings.all())?;
                Ok((State::Done, Some(figures)))
            }
        }
    }
}

/// Whether another batch makes the result now. It is then not this one's to remove.
fn is_in_use(error: &WorkflowError) -> bool {
    let WorkflowError::Library(error) = error else { return false };
    matches!(error.downcast_ref(), Some(BatchError::InUse { .. }))
}

fn makes_file(task: &Task) -> bool {
    matches!(task.output(), Some((_, PathKind::OutputFile)))
}

/// Collects a job's warnings; discards steps and counts.
#[derive(Default)]
struct Warnings(Mutex<Vec<String>>);

impl Warnings {
    fn all(&self) -> Vec<String> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl Progress for Warnings {
    fn info(&self, _: &str) {}

    fn warn(&self, what: &str) {
        let mut warnings = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if warnings.len() < WARNINGS_MAX {
            warnings.push(what.into());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_share_all_jobs() {
        for jobs in [0, 1, 7, 12] {
            let shards = (1..=3).map(|index| Shard { index, of: 3 });
            assert_eq!(shards.clone().map(|shard| shard.share(jobs)).sum::<usize>(), jobs);
            for number in 1..=jobs {
                assert_eq!(shards.clone().filter(|shard| shard.has(number)).count(), 1);
            }
            for shard in shards {
                assert_eq!((1..=jobs).filter(|number| shard.has(*number)).count(), shard.share(jobs));
            }
        }
        assert_eq!("2/3".parse(), Ok(Shard { index: 2, of: 3 }));
        for wrong in ["0/3", "4/3", "1", "a/b", "1/0", ""] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn each_shard_has_its_own_reports() {
        let settings = |shard: &str| BatchSettings {
            manifest: "a/pairs.toml".into(),
            jobs: 0,
            shard: shard.parse().expect("a shard"),
            verify: false,
            failures: None,
            summary: Some("b/figures.csv".into()),
            dry_run: false,
            allow_failures: false,
        };
        assert_eq!(failures_file(&settings("1/1")), Path::new("a/pairs.toml.failures.jsonl"));
        let table = BatchSettings { manifest: "a/pairs.csv".into(), ..settings("1/1") };
        assert_eq!(failures_file(&table), Path::new("a/pairs.csv.failures.jsonl"));
        assert_eq!(failures_file(&settings("2/3")), Path::new("a/pairs.toml.2of3.failures.jsonl"));
        assert_eq!(summary_file(&settings("1/1")), Some("b/figures.csv".into()));
        assert_eq!(summary_file(&settings("2/3")), Some("b/figures.2of3.csv".into()));
        assert_eq!(summary_file(&BatchSettings { dry_run: true, ..settings("1/1") }), None);
    }
}
