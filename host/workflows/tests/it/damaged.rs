//! Manual lists with damaged words are accepted or rejected in limited time and memory.

use std::{cell::RefCell, fs, path::Path};

use farnear_test_data::damaged;
use farnear_workflows::{
    Context,
    activity::samples::Samples,
    batch::{self, BatchSettings, JobReport},
};
use image::{GrayImage, Luma};
use proptest::prelude::*;

use crate::cases;

const SAMPLES: &str = r#"[[sample]]
masks = "a"
subject = "ann"
activity = "walk"
view = 1
clip = "one"

[[sample]]
masks = "b"
subject = "ann"
activity = "walk"
view = 2
clip = "one"

[[sample]]
masks = "c"
subject = "ben"
activity = "sit down"
"#;

const JOBS: &str = r#"[shadow-remove]
camera = "camera.toml"
lat = 52.38
lon = -1.56

[[job]]
do = "shadow-remove"
masks = "a"
time = "2014-06-23T11:30:00Z"
out = "one"

[[job]]
do = "depth"
far = "far.png"
near = "near.png"
out = "two"
"#;

const JOBS_CSV: &str = "do,masks,camera,lamp,out\nshadow-remove,a,camera.toml,\"-1.5,6,3\",one\nshadow-remove,b,camera.toml,,two\n";

const CAMERA: &str = "[camera]\nheight_m = 1.2\nazimuth_deg = 140.0\nfocal_length_mm = 4.0\npixel_um = 120.0\nwidth_px = 32\nheight_px = 32\n";

/// Three folders of small masks (a person, half of one, another person), and their camera.
pub fn folder() -> tempfile::TempDir {
    let root = tempfile::tempdir().expect("a folder");
    fs::write(root.path().join("camera.toml"), CAMERA).expect("a file");
    for (name, rows) in [("a", 30), ("b", 12), ("c", 28)] {
        fs::create_dir(root.path().join(name)).expect("a folder");
        let level = |x, y| Luma([if (12..20).contains(&x) && y < rows { 255 } else { 0 }]);
        GrayImage::from_fn(32, 32, level).save(root.path().join(name).join("m1.png")).expect("a picture");
    }
    root
}

/// Runs a list's jobs and returns the number of reports.
fn done(list: &Path) -> usize {
    let settings = BatchSettings { allow_failures: false, ..crate::batch::settings(list) };
    let warnings = std::sync::atomic::AtomicUsize::new(0);
    let on_job = |_: &JobReport| {
        warnings.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        Ok(())
    };
    let _ = batch::run(&settings, &Context::unattended(), &on_job);
    warnings.into_inner()
}

fn config(usual: u32) -> ProptestConfig {
    ProptestConfig { cases: cases(usual), failure_persistence: None, ..ProptestConfig::default() }
}

thread_local! {
    /// One folder for all cases of a property.
    static FOLDER: RefCell<tempfile::TempDir> = RefCell::new(folder());
}

proptest! {
    #![proptest_config(config(100))]

    #[test]
    fn damaged_samples_are_read_or_refused(
        words in proptest::collection::vec((any::<usize>(), any::<usize>()), 0..5),
        lost in proptest::option::of(any::<usize>()),
    ) {
        let text = damaged(SAMPLES, &words, lost);
        let read = FOLDER.with_borrow(|root| {
            let list = root.path().join("samples.toml");
            fs::write(&list, &text).expect("a file");
            let _ = Samples::folders(&list);
            Samples::read(&list, &Context::unattended())
        });
        if let Ok(samples) = read {
            let views: usize = samples.clips.iter().map(|clip| clip.views.len()).sum();
            prop_assert!(views > 0 && views <= text.matches("[[sample]]").count());
            prop_assert!(samples.clips.iter().all(|clip| !clip.subject.is_empty() && !clip.activity.is_empty()));
            prop_assert_eq!(samples.split().len(), views);
        }
    }

    #[test]
    fn damaged_lists_of_jobs_are_gone_through_or_refused(
        words in proptest::collection::vec((any::<usize>(), any::<usize>()), 0..5),
        lost in proptest::option::of(any::<usize>()),
    ) {
        for (name, text) in [("jobs.toml", JOBS), ("jobs.csv", JOBS_CSV)] {
            let text = damaged(text, &words, lost);
            let warnings = FOLDER.with_borrow(|root| {
                let list = root.path().join(name);
                fs::write(&list, &text).expect("a file");
                done(&list)
            });
            prop_assert!(warnings <= text.lines().count(), "{warnings} of\n{text}");
        }
    }
}

#[test]
fn undamaged_lists_are_read() {
    let root = folder();
    let list = |name: &str, text: &str| {
        let path = root.path().join(name);
        fs::write(&path, text).expect("a file");
        path
    };
    let samples = Samples::read(&list("samples.toml", SAMPLES), &Context::unattended()).expect("read");
    assert_eq!((samples.clips.len(), samples.frames, samples.full_frames), (2, 3, true));
    assert_eq!(done(&list("jobs.toml", JOBS)), 2);
    assert!(root.path().join("one/shadow.toml").exists(), "the first of them can be done");
    assert_eq!(done(&list("jobs.csv", JOBS_CSV)), 2);
}
