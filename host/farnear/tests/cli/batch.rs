//! `farnear batch`: each job gives what its command gives; killed, edited, damaged and failing jobs.

use std::{
    collections::BTreeMap,
    fs,
    io::{BufRead, BufReader},
    path::Path,
    process::{Command, Stdio},
};

use serde_json::{Value, json};

use crate::common::{Folder, fails, farnear, figures, rig_optics, succeeds};

/// The report of a run on its jobs, in the manifest's order.
#[track_caller]
fn lines(stdout: &[u8]) -> Vec<Value> {
    let text = std::str::from_utf8(stdout).expect("UTF-8");
    let mut lines: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).expect(line)).collect();
    lines.sort_by_key(|line| line["job"].as_u64());
    lines
}

#[track_caller]
fn states(arguments: &[&str]) -> Vec<String> {
    let (stdout, _) = succeeds(&mut farnear(arguments));
    lines(stdout.as_bytes()).iter().map(|line| line["state"].as_str().expect("a state").into()).collect()
}

fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(folder).expect("a folder") {
        let entry = entry.expect("an entry");
        let name = entry.file_name().to_string_lossy().into_owned();
        if entry.path().is_dir() {
            found.extend(
                files(&entry.path()).into_iter().map(|(below, bytes)| (format!("{name}/{below}"), bytes)),
            );
        } else {
            found.insert(name, fs::read(entry.path()).expect("a file"));
        }
    }
    found
}

/// A rendered pair, its optics and a manifest of `jobs` maps with different windows.
fn pairs(folder: &Folder, jobs: usize) -> String {
    let size = ["--width", "160", "--height", "120", "--scene", "slant"];
    succeeds(farnear(&["render", "--optics", rig_optics(), "--out", &folder.text("pair")]).args(size));
    let mut text = String::from("[depth]\nfar = 'pair/far.png'\nnear = 'pair/near.png'\nwrite = 'npy'\n");
    for job in 0..jobs {
        text += &format!("[[job]]\ndo = 'depth'\nwindow = {}\nout = 'maps/{job}'\n", 2 * (job % 8) + 3);
    }
    folder.file("pairs.toml", text)
}

#[test]
fn a_killed_batch_resumes_with_the_same_result() {
    const JOBS: usize = 24;
    let [whole, killed] = [Folder::new(), Folder::new()];
    let manifests = [&whole, &killed].map(|folder| pairs(folder, JOBS));
    assert_eq!(states(&["batch", &manifests[0]]), vec!["done"; JOBS]);
    for _ in 0..3 {
        let mut process = Command::new(env!("CARGO_BIN_EXE_farnear"))
            .env("XDG_CACHE_HOME", concat!(env!("CARGO_TARGET_TMPDIR"), "/cache"))
            .args(["batch", &manifests[1], "--jobs", "2"])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("the program starts");
        // The first job has ended, others are running.
        let lines = BufReader::new(process.stdout.take().expect("a pipe")).lines();
        let done = lines.map_while(Result::ok).find(|line| line.contains("\"done\""));
        process.kill().expect("a process to kill");
        process.wait().expect("a process that ends");
        assert!(done.is_some(), "all was done before it could be killed");
    }
    let resumed = states(&["batch", &manifests[1]]);
    let count = |state: &str| resumed.iter().filter(|found| *found == state).count();
    assert!(count("already") >= 3 && count("done") > 0 && resumed.len() == JOBS, "{resumed:?}");
    let (expected, found) = (files(&whole.path("maps")), files(&killed.path("maps")));
    assert_eq!(
        found.keys().collect::<Vec<_>>(),
        expected.keys().collect::<Vec<_>>(),
        "hidden ones are left too"
    );
    assert!(found == expected, "other bytes than of an unbroken run");
}

#[test]
fn a_bad_job_does_not_stop_the_others() {
    let folder = Folder::new();
    let manifest = pairs(&folder, 2);
    fs::create_dir(folder.path("mine")).expect("a writable folder");
    folder.file("mine/notes.txt", "of the user");
    let good = fs::read_to_string(&manifest).expect("the manifest");
    let wrong: [(&str, &[&str]); 7] = [
        ("do = 'depth'\nnear = 'gone.png'\nout = 'maps/a'", &["gone.png"]),
        ("do = 'magic'\nout = 'maps/b'", &["magic", "depth, focus-stack, correct"]),
        ("do = 'depth'\nwindo = 3\nout = 'maps/c'", &["windo", "window"]),
        ("do = 'depth'\nout = ", &["line"]),
        ("do = 'depth'\nout = 'mine'", &["mine", "was not made by a batch"]),
        ("do = 'depth'\nwindow = 4\nout = 'maps/d'", &["window", "odd"]),
        // The first job's folder.
        ("do = 'depth'\nwindow = 9\nout = 'maps/0'", &["another job", "maps/0"]),
    ];
    let bad: String = wrong.iter().map(|(job, _)| format!("[[job]]\n{job}\n")).collect();
    fs::write(&manifest, good.clone() + &bad).expect("a writable folder");
    // One after the other, so that the order of the two jobs with one folder is known.
    fails(&mut farnear(&["batch", &manifest, "--jobs", "5000"]), 2, &["jobs 5000", "0 to 1024"]);
    let output = farnear(&["batch", &manifest, "--jobs", "1"]).output().expect("the program starts");
    assert_eq!(output.status.code(), Some(1));
    let reports = lines(&output.stdout);
    assert_eq!(reports.len(), 9);
    assert!(reports[..2].iter().all(|line| line["state"] == "done"), "{reports:?}");
    for (line, (job, phrases)) in reports[2..].iter().zip(wrong) {
        let error = line["error"].as_str().expect("a message");
        assert!(
            line["state"] == "failed" && phrases.iter().all(|phrase| error.contains(phrase)),
            "{job}: {line}"
        );
    }
    let kept = fs::read(folder.path("pairs.toml.failures.jsonl")).expect("failures");
    assert_eq!(lines(&kept), reports[2..], "kept apart with their messages");
    assert_eq!(files(&folder.path("mine")).len(), 1);
    assert!(!folder.listing().iter().any(|name| name.contains("partial")), "{:?}", folder.listing());

    fs::write(&manifest, good).expect("a writable folder");
    assert_eq!(states(&["batch", &manifest]), ["already"; 2]);
    assert!(!folder.path("pairs.toml.failures.jsonl").exists());
}

#[test]
fn only_changed_jobs_run_again() {
    let folder = Folder::new();
    let manifest = pairs(&folder, 2);
    let again = || states(&["batch", &manifest]);
    assert_eq!(again(), ["done"; 2]);
    let before = files(&folder.path("maps"));
    let edit = |from: &str, to: &str| {
        let text = fs::read_to_string(&manifest).expect("the manifest");
        assert!(text.contains(from));
        fs::write(&manifest, text.replace(from, to)).expect("a writable folder");
    };
    edit("window = 5", "window = 7");
    assert_eq!(again(), ["already", "done"], "a setting");
    // One pixel of the far image: both results depend on it.
    let far = folder.path("pair/far.png");
    let mut picture = image::open(&far).expect("a picture").into_luma8();
    picture.get_pixel_mut(80, 60).0[0] ^= 0x10;
    picture.save(&far).expect("a writable folder");
    assert_eq!(again(), ["done"; 2], "an image");
    // The optics next to the pair; no field names them.
    let optics = fs::read_to_string(folder.path("pair/optics.toml")).expect("optics");
    folder.file("pair/optics.toml", format!("{optics}# looked through\n"));
    assert_eq!(again(), ["done"; 2], "optics");
    assert_eq!(again(), ["already"; 2]);
    // A truncated file is found immediately, a changed byte only by verification.
    let cut = before["0/depth.npy"].len() as u64 - 4;
    let map = fs::File::options().write(true).open(folder.path("maps/0/depth.npy")).expect("a map");
    map.set_len(cut).expect("a writable file");
    assert_eq!(again(), ["done", "already"], "a cut map");
    let mut bytes = fs::read(folder.path("maps/1/depth.npy")).expect("a map");
    *bytes.last_mut().expect("bytes") ^= 1;
    fs::write(folder.path("maps/1/depth.npy"), bytes).expect("a writable file");
    assert_eq!(again(), ["already"; 2]);
    assert_eq!(states(&["batch", &manifest, "--verify"]), ["already", "done"], "another byte");
    // Files in an earlier format do not stay next to new ones; files of the user do.
    folder.file("maps/0/notes.txt", "of the user");
    edit("'npy'", "'png'");
    assert_eq!(again(), ["done"; 2]);
    assert!(!folder.path("maps/0/depth.npy").exists() && folder.path("maps/0/depth.png").exists());
    assert!(folder.path("maps/0/notes.txt").exists());
    // A job that fails removes its earlier result, a dry run does not.
    fs::remove_file(folder.path("pair/near.png")).expect("an image");
    let allowed = ["batch", &manifest, "--allow-failures", "--dry-run"];
    assert_eq!(states(&allowed), ["failed"; 2]);
    assert!(folder.path("maps/0/depth.png").exists());
    assert_eq!(states(&allowed[..3]), ["failed"; 2]);
    assert_eq!(files(&folder.path("maps")).into_keys().collect::<Vec<_>>(), ["0/notes.txt"]);
    assert!(!folder.path("maps/1").exists(), "an empty folder does not stay");
}

/// In the second run the first job has nothing to do, and its result is not the second one's to replace.
#[test]
fn two_jobs_with_one_folder_fail_in_every_run() {
    let folder = Folder::new();
    let manifest = pairs(&folder, 1);
    let job = fs::read_to_string(&manifest).expect("the manifest");
    let other = "[[job]]\ndo = 'depth'\nwindow = 9\nout = 'maps/0'\n";
    fs::write(&manifest, job + other).expect("a writable folder");
    let run = || {
        let output = farnear(&["batch", &manifest, "--jobs", "1"]).output().expect("the program starts");
        let states = lines(&output.stdout).iter().map(|line| line["state"].to_string()).collect::<Vec<_>>();
        (output.status.code(), states.join(" "), files(&folder.path("maps")))
    };
    let first = run();
    assert_eq!((first.0, first.1.as_str()), (Some(1), r#""done" "failed""#));
    let second = run();
    assert_eq!((second.0, second.1.as_str()), (Some(1), r#""already" "failed""#));
    assert!(second.2 == first.2, "the first job's result stays");
}

#[test]
fn shards_do_all_jobs_together() {
    let [whole, shared] = [Folder::new(), Folder::new()];
    let manifests = [&whole, &shared].map(|folder| pairs(folder, 5));
    states(&["batch", &manifests[0]]);
    assert_eq!(states(&["batch", &manifests[1], "--shard", "1/2"]).len(), 3);
    assert_eq!(states(&["batch", &manifests[1], "--shard", "2/2"]).len(), 2);
    assert!(files(&whole.path("maps")) == files(&shared.path("maps")), "other bytes than of one run");
    fails(&mut farnear(&["batch", &manifests[0], "--shard", "3/2"]), 2, &["3/2", "1/N to N/N"]);
}

/// A job of every kind and the command that does the same.
#[test]
fn each_kind_gives_what_its_command_gives() {
    let folder = Folder::new();
    pairs(&folder, 0);
    let targets =
        ["a", "b", "c", "d", "e", "f"].into_iter().zip([932.0_f32, 923.0, 914.0, 905.0, 896.0, 888.0]);
    let list = targets.map(|(name, true_mm)| {
        let found = ndarray::Array2::from_elem((30, 40), true_mm + 1.0);
        folder.file(&format!("{name}.npy"), farnear_files::npy::write(found.view()));
        format!("[[pattern]]\ndepth = \"{name}.npy\"\ntrue_mm = {true_mm:?}\n")
    });
    let list: String = list.collect();
    folder.file("patterns.toml", list);
    folder.file("suit.toml", "name = 'box'\n[[part]]\nname = 'body'\nmarkers = ['B1', 'B2', 'B3', 'B4']\n");
    let corners = "0,0,0,400,0,0,0,0,1000,400,100,1000";
    let names = [1, 2, 3, 4].map(|i| format!("B{i}_x,B{i}_y,B{i}_z")).join(",");
    folder.file("walk.csv", format!("frame,{names}\n1,{corners}\n2,{corners}\n"));
    folder.file("camera.toml", "[camera]\nheight_m = 0.8\nazimuth_deg = 140.0\npitch_deg = 0.0\nfocal_length_mm = 4.0\npixel_um = 6.0\n");
    for (folder_name, level) in [("masks", 255), ("video", 200)] {
        fs::create_dir(folder.path(folder_name)).expect("a writable folder");
        for frame in 0..16_u32 {
            let inside =
                |x: u32, y: u32| (100 + 4 * frame..130 + 4 * frame).contains(&x) && (60..200).contains(&y);
            let level = |x, y| {
                if inside(x, y) {
                    level
                } else if level == 255 {
                    0
                } else {
                    90 + (x * 7 + y * 3 + frame) as u8 % 5
                }
            };
            let picture = image::GrayImage::from_fn(640, 480, |x, y| image::Luma([level(x, y)]));
            picture.save(folder.path(&format!("{folder_name}/{frame:02}.png"))).expect("a picture");
        }
    }
    let run = |command: &str| {
        let arguments: Vec<&str> = command.split(' ').collect();
        // A job of a batch has one thread; some sums differ in their last bit with the number of threads.
        succeeds(farnear(&arguments).current_dir(folder.path("")).env("RAYON_NUM_THREADS", "1"));
    };
    for command in [
        "calibrate correction patterns.toml --method clsf --out learned.toml",
        "silhouettes synthetic --subjects 2 --activities walk,dig --views 1 --rate-hz 6 --mm-per-px 25 --out people",
        "activity train people/samples.toml --no-search --out model.fnm",
        "depth pair/far.png pair/near.png --method whitened --fill --threads 1 --out c/depth",
        "correct a.npy --correction learned.toml --out c/corrected.npy",
        "silhouettes video video --learn-first --centred --out c/video",
        "silhouettes markers walk.csv --template suit.toml --views 2 --out c/markers",
        "shadow remove masks --camera camera.toml --lat 52.38 --lon -1.56 --time 2014-06-23T11:30:00Z --out c/clean",
    ] {
        if command.contains("correct a.npy") {
            fs::create_dir_all(folder.path("c")).expect("a writable folder");
        }
        run(command);
    }
    let manifest = folder.file(
        "all.csv",
        "do,far,near,depth,file,video,masks,views,method,out,fill,correction,learn_first,centred,template,camera,lat,lon,time,model,among\n\
         depth,pair/far.png,pair/near.png,,,,,,whitened,b/depth,surface,,,,,,,,,,\n\
         correct,,,a.npy,,,,,,b/corrected.npy,,learned.toml,,,,,,,,,\n\
         silhouettes-video,,,,,video,,,,b/video,,,true,true,,,,,,,\n\
         silhouettes-markers,,,,walk.csv,,,2,,b/markers,,,,,suit.toml,,,,,,\n\
         shadow-remove,,,,,,masks,,,b/clean,,,,,,camera.toml,52.38,-1.56,2014-06-23T11:30:00Z,,\n\
         activity-recognise,,,,,,,people/p01-dig-1/view1,,b/answer,,,,,,,,,,model.fnm,\n\
         activity-recognise,,,,,,,people/p01-dig-1/view1,,b/shipped,,,,,,,,,,everyday,dig;kick\n",
    );
    assert_eq!(states(&["batch", &manifest]), ["done"; 7]);
    assert_eq!(states(&["batch", &manifest]), ["already"; 7]);
    let mut made = files(&folder.path("b"));
    for (place, model) in [("answer", &["model.fnm"][..]), ("shipped", &["everyday", "--among", "dig,kick"])]
    {
        let recognise = || {
            let mut command = farnear(&["activity", "recognise", "people/p01-dig-1/view1", "--model"]);
            command.args(model).current_dir(folder.path(""));
            command
        };
        let answers = made.remove(&format!("{place}/answers.jsonl")).expect("answers");
        let (stdout, _) = succeeds(&mut recognise());
        assert_eq!(answers.split(|byte| *byte == b'\n').count(), stdout.lines().count());
        let answer = made.remove(&format!("{place}/recognition.json")).expect("an answer");
        let mut answer: Value = serde_json::from_slice(&answer).expect("JSON");
        let whole = figures(recognise().arg("--json"));
        answer["seconds_per_frame"] = whole["seconds_per_frame"].clone();
        assert_eq!(answer, whole);
    }
    made.retain(|name, _| !name.ends_with("batch.toml"));
    let expected = files(&folder.path("c"));
    assert_eq!(made.keys().collect::<Vec<_>>(), expected.keys().collect::<Vec<_>>());
    let other: Vec<&String> = made.keys().filter(|name| made[*name] != expected[*name]).collect();
    assert!(other.is_empty(), "other bytes than the command's: {other:?}");
}

#[test]
fn methods_and_models_are_evaluated_as_jobs() {
    let folder = Folder::new();
    let people = "--subjects 3 --activities walk,dig --views 1 --rate-hz 6 --mm-per-px 25".split(' ');
    succeeds(farnear(&["silhouettes", "synthetic", "--out", &folder.text("people")]).args(people));
    let manifest = folder.file(
        "compared.toml",
        "[activity-evaluate]\nsamples = 'people/samples.toml'\n\
         [[job]]\ndo = 'activity-evaluate'\nleave_one_subject_out = true\nno_search = true\nout = 'b/others'\n\
         [[job]]\ndo = 'activity-evaluate'\nmodel = 'everyday'\nout = 'b/shipped'\n\
         [[job]]\ndo = 'activity-evaluate'\nout = 'b/none'\n\
         [[job]]\ndo = 'activity-evaluate'\nmodel = 'everyday'\nsame = 'dig'\nout = 'b/same'\n\
         [[job]]\ndo = 'activity-train'\nsamples = 'people/samples.toml'\nno_search = true\nmode = 'ordered'\nout = 'b/model.fnm'\n",
    );
    let run = || {
        let output = farnear(&["batch", &manifest]).output().expect("the program starts");
        assert_eq!(output.status.code(), Some(1));
        lines(&output.stdout)
    };
    let reports = run();
    for (line, phrase) in reports[2..].iter().zip(["leave-one-subject-out", "NAME IN THE SAMPLES"]) {
        assert!(line["error"].as_str().expect("a message").contains(phrase), "{line}");
    }
    let samples = folder.text("people/samples.toml");
    // The names of a blind set are as secret as its clips.
    let text = fs::read_to_string(&samples).expect("samples");
    let blind = folder.file("people/blind.toml", format!("blind = 'kept'\n{text}"));
    let unopened = ["activity", "evaluate", &blind, "--model", "everyday", "--same", "x=walk"];
    fails(&mut farnear(&unopened), 1, &["--open-blind-set"]);
    for (arguments, name) in
        [(&["--leave-one-subject-out", "--no-search"][..], "others"), (&["--model", "everyday"], "shipped")]
    {
        let mut expected = figures(farnear(&["activity", "evaluate", &samples, "--json"]).args(arguments));
        let kept = fs::read(folder.path(&format!("b/{name}/figures.json"))).expect("figures");
        let kept: Value = serde_json::from_slice(&kept).expect("JSON");
        expected.as_object_mut().expect("figures").retain(|name, _| !name.starts_with("seconds"));
        assert_eq!(kept, expected);
    }
    assert_eq!((&reports[4]["state"], &reports[4]["figures"]["mode"]), (&json!("done"), &json!("ordered")));
    assert!(folder.path("b/model.fnm").is_file());
    // A mask that the samples name, not the manifest.
    let masks = files(&folder.path("people/p01-dig-1/view1"));
    let first = masks.keys().next().expect("a mask");
    fs::remove_file(folder.path("people/p01-dig-1/view1").join(first)).expect("a mask");
    let again: Vec<Value> = run().iter().map(|line| line["state"].clone()).collect();
    assert_eq!(again, ["done", "done", "failed", "failed", "done"]);
}

#[test]
fn an_invalid_manifest_is_rejected_before_any_job() {
    let folder = Folder::new();
    fails(&mut farnear(&["batch", &folder.text("gone.toml")]), 1, &["gone.toml", "No such file"]);
    for (name, text) in
        [("empty.toml", ""), ("empty.csv", "do,far\n"), ("shared.toml", "[depth]\nwindow = 7\n")]
    {
        fails(&mut farnear(&["batch", &folder.file(name, text)]), 1, &[name, "no jobs"]);
    }
}

#[test]
fn a_second_run_repeats_the_figures_of_the_first() {
    let folder = Folder::new();
    let manifest = pairs(&folder, 2);
    let run = |more: &[&str]| {
        let (stdout, _) = succeeds(farnear(&["batch", &manifest]).args(more));
        lines(stdout.as_bytes())
    };
    let first = run(&[]);
    assert!(
        first.iter().all(|line| line["state"] == "done" && line["figures"]["valid_fraction"].is_number()),
        "{first:?}"
    );
    // Found before the jobs, not after them.
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("absent", folder.text("link")).expect("a link");
        let nowhere = folder.text("link/figures.csv");
        let refused =
            farnear(&["batch", &manifest, "--summary", &nowhere]).output().expect("the program starts");
        assert!(!refused.status.success() && refused.stdout.is_empty());
    }
    let table = folder.text("tables/figures.csv");
    let second = run(&["--summary", &table]);
    for (mut first, second) in first.into_iter().zip(&second) {
        assert_eq!(second["state"], "already");
        // Only the first run has a duration.
        first["figures"].as_object_mut().expect("figures").remove("seconds");
        assert_eq!(first["figures"], second["figures"]);
    }
    let table = fs::read_to_string(&table).expect("a table");
    assert_eq!(table.lines().count(), 3);
    assert!(table.starts_with("job,line,do,out,state,error,") && table.contains("valid_fraction"), "{table}");
}

#[test]
fn a_dry_run_reports_what_would_be_done_and_does_nothing() {
    let folder = Folder::new();
    let manifest = pairs(&folder, 2);
    assert_eq!(states(&["batch", &manifest, "--dry-run"]), ["todo"; 2]);
    assert!(!folder.path("maps").exists());
    succeeds(&mut farnear(&["batch", &manifest, "--shard", "2/2"]));
    assert_eq!(states(&["batch", &manifest, "--dry-run"]), ["todo", "already"]);
    // It neither removes nor writes reports, and no failures.
    let text = fs::read_to_string(&manifest).expect("the manifest");
    let bad = "[[job]]\ndo = 'depth'\nnear = 'gone.png'\nout = 'maps/a'\n";
    fs::write(&manifest, text + bad).expect("a writable folder");
    let failures = folder.path("pairs.toml.failures.jsonl");
    let output = farnear(&["batch", &manifest, "--dry-run"]).output().expect("the program starts");
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(1) && message.contains("1 of 3 jobs would fail"), "{message}");
    assert!(!failures.exists());
    let report = format!("{}\n", json!({"job": 3, "state": "failed"}));
    fs::write(&failures, &report).expect("a writable folder");
    succeeds(&mut farnear(&["batch", &manifest, "--dry-run", "--allow-failures"]));
    assert_eq!(fs::read_to_string(&failures).expect("failures of an earlier run"), report);
    let both = ["--dry-run", "--summary", "figures.csv"];
    fails(farnear(&["batch", &manifest]).args(both), 2, &["--summary", "--dry-run"]);
}

#[test]
fn a_manifest_is_generated_from_patterns() {
    let folder = Folder::new();
    pairs(&folder, 0);
    fs::copy(rig_optics(), folder.path("rig.toml")).expect("a writable folder");
    let manifest = folder.text("all.csv");
    let fields = ["far=*/far.png", "near=*/near.png", "out=*/depth", "optics=rig.toml", "write=npy"];
    let fields: Vec<&str> = fields.iter().flat_map(|field| ["--field", *field]).collect();
    succeeds(farnear(&["batch", &manifest, "--generate", "depth"]).args(fields));
    // As a spreadsheet with decimal commas writes it.
    let text = fs::read_to_string(&manifest).expect("a manifest").replace(',', ";");
    fs::write(&manifest, text).expect("a writable folder");
    assert_eq!(states(&["batch", &manifest]), ["done"]);
    assert!(folder.path("pair/depth/depth.npy").exists());
}
