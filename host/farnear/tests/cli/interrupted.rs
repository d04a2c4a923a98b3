//! Signals during long work.

#![cfg(unix)]

use std::{
    fs,
    os::unix::fs::PermissionsExt,
    process::{Child, Command, Stdio},
    time::{Duration, Instant},
};

use crate::common::{Folder, farnear, rig_optics, succeeds};

/// A rendered pair and a manifest with one job, `result`.
fn batch(folder: &Folder) -> String {
    let size = ["--width", "160", "--height", "120"];
    succeeds(farnear(&["render", "--optics", rig_optics(), "--out", &folder.text("pair")]).args(size));
    let job = "[[job]]\ndo = 'depth'\nfar = 'pair/far.png'\nnear = 'pair/near.png'\nout = 'result'\n";
    folder.file("jobs.toml", job)
}

/// Puts a stand-in for ffmpeg into the folder `bin`. It notes that it runs, and fails after some seconds.
fn slow_ffmpeg(folder: &Folder) -> String {
    fs::create_dir(folder.path("bin")).expect("a writable folder");
    let program = folder.file("bin/ffmpeg", "#!/bin/sh\n: > \"$0.runs\"\nsleep 3\nexit 1\n");
    fs::set_permissions(program, fs::Permissions::from_mode(0o755)).expect("a file");
    folder.file("clip.mp4", "no video");
    format!("{}:/usr/bin:/bin", folder.text("bin"))
}

/// Waits until the stand-in for ffmpeg runs, and sends a signal.
fn interrupt(folder: &Folder, child: &mut Child, signal: &str) {
    while !folder.path("bin/ffmpeg.runs").exists() {
        assert!(child.try_wait().expect("a process").is_none(), "it has ended");
        std::thread::sleep(Duration::from_millis(10));
    }
    send(signal, child);
}

fn send(signal: &str, child: &Child) {
    let sent = Command::new("kill").args([signal, &child.id().to_string()]).status();
    assert!(sent.expect("kill runs").success());
}

#[test]
fn an_interrupted_batch_ends_at_once_and_keeps_earlier_results() {
    let folder = Folder::new();
    let manifest = batch(&folder);
    succeeds(&mut farnear(&["batch", &manifest]));
    fs::write(&manifest, "[[job]]\ndo = 'silhouettes-video'\nvideo = 'clip.mp4'\nout = 'result'\n")
        .expect("a writable folder");
    let mut child = Command::new(env!("CARGO_BIN_EXE_farnear"))
        .args(["batch", &manifest])
        .env("PATH", slow_ffmpeg(&folder))
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("farnear runs");
    interrupt(&folder, &mut child, "-INT");
    let interrupted = Instant::now();
    let output = child.wait_with_output().expect("it ends");
    // 0.3 s are promised; other tests use the same processor.
    assert!(interrupted.elapsed() < Duration::from_secs(2), "{:?}", interrupted.elapsed());
    assert_eq!((output.status.code(), output.stdout), (Some(1), Vec::new()));
    let listing = folder.listing();
    assert!(listing.contains(&"result/depth.npy".into()), "{listing:?}");
    assert!(!listing.iter().any(|name| name.contains("partial") || name.contains("failures")), "{listing:?}");
}

#[test]
fn a_batch_ends_though_its_output_is_not_read() {
    let folder = Folder::new();
    // More output than a pipe holds.
    let job = "[[job]]\ndo = 'depth'\nfar = 'gone'\nnear = 'gone'\nout = 'result'\n";
    let manifest = folder.file("jobs.toml", job.repeat(2000));
    let command = format!("exec '{}' batch '{manifest}' 2>&1", env!("CARGO_BIN_EXE_farnear"));
    let mut child =
        Command::new("sh").args(["-c", &command]).stdout(Stdio::piped()).spawn().expect("sh runs");
    std::thread::sleep(Duration::from_secs(2));
    assert!(child.try_wait().expect("a process").is_none(), "the pipe is full");
    send("-INT", &child);
    let interrupted = Instant::now();
    while child.try_wait().expect("a process").is_none() {
        if interrupted.elapsed() > Duration::from_secs(2) {
            child.kill().expect("a process");
            panic!("it waits for its reader");
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[cfg(target_os = "linux")]
#[test]
fn nohup_keeps_a_batch_at_work() {
    let folder = Folder::new();
    let manifest = batch(&folder);
    let text = fs::read_to_string(&manifest).expect("the manifest");
    let clip = "[[job]]\ndo = 'silhouettes-video'\nvideo = 'clip.mp4'\nout = 'masks'\n";
    fs::write(&manifest, clip.to_owned() + &text).expect("a writable folder");
    let mut child = Command::new("nohup")
        .args([env!("CARGO_BIN_EXE_farnear"), "batch", &manifest, "--jobs", "1"])
        .env("XDG_CACHE_HOME", concat!(env!("CARGO_TARGET_TMPDIR"), "/cache"))
        .env("PATH", slow_ffmpeg(&folder))
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("nohup runs");
    interrupt(&folder, &mut child, "-HUP");
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(1), "the clip fails");
    assert!(folder.path("result/depth.npy").exists(), "the next job is done");
}
