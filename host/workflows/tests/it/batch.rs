//! Files of a user and results of other jobs stay when a batch writes its own.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::Mutex,
};

use farnear_workflows::{
    Context,
    batch::{self, BatchSettings, JobReport, Shard, State},
};

use crate::damaged::folder;

const SHARED: &str =
    "[shadow-remove]\ncamera = 'camera.toml'\nlat = 52.38\nlon = -1.56\ntime = '2014-06-23T11:30:00Z'\n";

pub fn settings(manifest: &Path) -> BatchSettings {
    BatchSettings {
        manifest: manifest.into(),
        jobs: 1,
        shard: Shard::default(),
        verify: false,
        failures: None,
        summary: None,
        dry_run: false,
        allow_failures: true,
    }
}

/// The reports of all jobs in their order, or the error of the batch.
fn run(settings: &BatchSettings) -> Result<Vec<JobReport>, String> {
    let reports = Mutex::new(Vec::new());
    let on_job = |report: &JobReport| {
        reports.lock().unwrap().push(report.clone());
        Ok(())
    };
    batch::run(settings, &Context::unattended(), &on_job).map_err(|error| error.to_string())?;
    Ok(reports.into_inner().unwrap())
}

fn states(reports: &[JobReport]) -> Vec<State> {
    reports.iter().map(|report| report.state).collect()
}

/// A manifest with a job for each pair of masks and `out`.
fn manifest(folder: &Path, jobs: &[(&str, &str)]) -> PathBuf {
    let job = |(masks, out): &(&str, &str)| {
        format!("[[job]]\ndo = 'shadow-remove'\nmasks = '{masks}'\nout = '{out}'\n")
    };
    let path = folder.join("jobs.toml");
    fs::write(&path, SHARED.to_owned() + &jobs.iter().map(job).collect::<String>()).unwrap();
    path
}

#[test]
fn a_report_replaces_only_an_earlier_one() {
    let root = folder();
    let manifest = manifest(root.path(), &[("a", "one"), ("gone", "two")]);
    fs::write(root.path().join("jobs.toml.failures.jsonl"), "of the user").unwrap();
    let expect_refused = |settings: &BatchSettings, file: &str| {
        let path = root.path().join(file);
        let before = fs::read(&path).ok();
        let error = run(settings).unwrap_err();
        let name = path.file_name().unwrap().to_string_lossy();
        assert!(error.contains(&*name) && error.contains("name another file"), "{file}: {error}");
        assert!(fs::read(&path).ok() == before, "{file} was replaced");
        assert!(!root.path().join("one").exists(), "no job begins");
    };
    expect_refused(&settings(&manifest), "jobs.toml.failures.jsonl");
    fs::remove_file(root.path().join("jobs.toml.failures.jsonl")).unwrap();
    let mut files =
        vec!["jobs.toml", "camera.toml", "a/m1.png", "a", "one", "one/new.csv", "b/../one/new.csv"];
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("jobs.toml", root.path().join("link")).unwrap();
        files.push("link");
    }
    for file in files {
        let path = Some(root.path().join(file));
        expect_refused(&BatchSettings { summary: path.clone(), ..settings(&manifest) }, file);
        expect_refused(&BatchSettings { failures: path, ..settings(&manifest) }, file);
    }
    let one = BatchSettings {
        summary: Some(root.path().join("new.csv")),
        failures: Some(root.path().join("a/../new.csv")),
        ..settings(&manifest)
    };
    expect_refused(&one, "new.csv");

    fs::write(root.path().join("empty.jsonl"), "").unwrap();
    let both = BatchSettings {
        summary: Some(root.path().join("new.csv")),
        failures: Some(root.path().join("empty.jsonl")),
        ..settings(&manifest)
    };
    for state in [State::Done, State::Already] {
        assert_eq!(states(&run(&both).unwrap()), [state, State::Failed]);
        assert_eq!(fs::read_to_string(root.path().join("new.csv")).unwrap().lines().count(), 3);
        assert_eq!(fs::read_to_string(root.path().join("empty.jsonl")).unwrap().lines().count(), 1);
    }
    let exchanged = BatchSettings { summary: both.failures, failures: both.summary, ..settings(&manifest) };
    assert!(run(&exchanged).unwrap_err().contains("name another file"));
}

#[test]
fn a_place_for_failures_is_made_before_the_jobs() {
    let root = folder();
    let manifest = manifest(root.path(), &[("a", "one"), ("gone", "two")]);
    let failures = root.path().join("logs/failures.jsonl");
    let given = BatchSettings { failures: Some(failures.clone()), ..settings(&manifest) };
    assert_eq!(states(&run(&given).unwrap()), [State::Done, State::Failed]);
    assert!(failures.exists());
}

#[test]
fn the_first_of_two_jobs_with_one_place_has_it() {
    let root = folder();
    let absolute = root.path().join("one").display().to_string();
    let mut names = vec!["one", "./one", ".//one/", "new/../one", &absolute];
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(".", root.path().join("link")).unwrap();
        names.push("link/one");
    }
    let mut expected = [State::Done, State::Failed];
    for name in names {
        let manifest = manifest(root.path(), &[("a", "one"), ("b", name)]);
        for dry_run in [false, true, false] {
            let reports = run(&BatchSettings { dry_run, ..settings(&manifest) }).unwrap();
            assert_eq!(states(&reports), expected, "{name}");
            let error = reports[1].error.as_deref().unwrap();
            assert!(error.contains(name) && error.contains("another job (line 6)"), "{error}");
            expected[0] = State::Already;
        }
        let shard = "2/2".parse().unwrap();
        let reports = run(&BatchSettings { shard, ..settings(&manifest) }).unwrap();
        assert_eq!(states(&reports), [State::Failed], "{name} in a share without the first job");
    }
}

/// Two threads could replace the outer folder while or after the inner job writes there.
#[test]
fn no_job_writes_into_the_result_of_another() {
    let root = folder();
    for jobs in [[("a", "one"), ("b", "one/two")], [("b", "one/two"), ("a", "one")]] {
        let reports = run(&settings(&manifest(root.path(), &jobs))).unwrap();
        for report in reports {
            let inner = report.out.as_deref() == Some("one/two");
            assert_eq!(report.state == State::Failed, inner, "{report:?}");
        }
    }
}

#[test]
fn results_in_the_folder_of_the_input_are_not_inputs() {
    let root = folder();
    let manifest = manifest(root.path(), &[("a", "a/clean"), ("a", "a/other"), ("a/m1.png", "b/clean")]);
    assert_eq!(states(&run(&settings(&manifest)).unwrap()), [State::Done; 3]);
    // Unfinished files of another process.
    for name in [".clean.partial-1", ".third.batch-partial"] {
        fs::create_dir(root.path().join("a").join(name)).unwrap();
        fs::write(root.path().join("a").join(name).join("half.png"), "").unwrap();
    }
    assert_eq!(states(&run(&settings(&manifest)).unwrap()), [State::Already; 3]);
    fs::copy(root.path().join("a/m1.png"), root.path().join("a/m2.png")).unwrap();
    let expected = [State::Done, State::Done, State::Already];
    assert_eq!(states(&run(&settings(&manifest)).unwrap()), expected, "another picture");
}

#[test]
fn a_job_that_reads_the_result_of_another_begins_after_it() {
    let root = folder();
    let chain = manifest(root.path(), &[("a", "one"), ("one", "two"), ("two/m1.png", "three")]);
    let together = BatchSettings { jobs: 3, ..settings(&chain) };
    assert_eq!(states(&run(&BatchSettings { dry_run: true, ..together.clone() }).unwrap()), [State::Todo; 3]);
    assert_eq!(states(&run(&together).unwrap()), [State::Done; 3]);
    assert_eq!(states(&run(&together).unwrap()), [State::Already; 3]);
    fs::copy(root.path().join("b/m1.png"), root.path().join("a/m1.png")).unwrap();
    assert_eq!(states(&run(&together).unwrap()), [State::Done; 3], "another picture");

    let backwards = manifest(root.path(), &[("one", "two"), ("a", "one")]);
    let reports = run(&settings(&backwards)).unwrap();
    assert_eq!(states(&reports), [State::Failed, State::Already]);
    let error = reports[0].error.as_deref().unwrap();
    assert!(error.contains("line 10") && error.contains("move this job behind"), "{error}");
}

#[test]
fn a_field_for_a_further_result_is_refused() {
    let root = folder();
    let path = manifest(root.path(), &[("a", "one")]);
    let text = fs::read_to_string(&path).unwrap() + "stages = 'stages'\n";
    fs::write(&path, text).unwrap();
    let reports = run(&settings(&path)).unwrap();
    let error = reports[0].error.as_deref().unwrap();
    assert!(error.contains("`stages`") && error.contains("leave `stages` out in a batch"), "{error}");
    assert!(!root.path().join("stages").exists() && !root.path().join("one").exists());
}

#[cfg(unix)]
#[test]
fn a_result_that_another_batch_makes_is_left_to_it() {
    let root = folder();
    let manifest = manifest(root.path(), &[("a", "one")]);
    assert_eq!(states(&run(&settings(&manifest)).unwrap()), [State::Done]);
    fs::write(&manifest, fs::read_to_string(&manifest).unwrap().replace("11:30", "12:30")).unwrap();
    let aside = root.path().join(".one.batch-partial");
    fs::create_dir(&aside).unwrap();
    let lock = fs::File::open(&aside).unwrap();
    lock.lock().unwrap();
    let reports = run(&settings(&manifest)).unwrap();
    let error = reports[0].error.as_deref().unwrap();
    assert!(error.contains("another batch is making") && error.contains("run the batch again"), "{error}");
    assert!(root.path().join("one/shadow.toml").exists(), "the result belongs to the other batch");
    drop(lock);
    assert_eq!(states(&run(&settings(&manifest)).unwrap()), [State::Done]);
}
