//! Captures and measurements in them.

use std::{fs, path::Path, process::Command};

use farnear_files::image_file::encode_png;
use ndarray::Array2;
use serde_json::{Value, json};

use super::client::{Served, Socket};

const RECORD: &str = include_str!("../../../workflows/src/sessions/capture.toml");

/// A textured plane; the near image is a little softer.
pub fn put(served: &Served, name: &str, seed: usize) {
    let folder = served.session.join(name);
    fs::create_dir_all(&folder).unwrap();
    fs::write(folder.join("capture.toml"), RECORD).unwrap();
    let sharp = Array2::from_shape_fn((64, 96), |(y, x)| ((x * 7919 + y * 104_729 + seed) % 199) as u16 + 20);
    let soft = Array2::from_shape_fn((64, 96), |(y, x)| (sharp[[y, x]] + sharp[[y, (x + 1).min(95)]]) / 2);
    fs::write(folder.join("far.png"), encode_png(soft.view(), 8).unwrap()).unwrap();
    fs::write(folder.join("near.png"), encode_png(sharp.view(), 8).unwrap()).unwrap();
}

fn computed(served: &Served, client: &str, name: &str, request: &Value) -> Value {
    let begun = served.post(&format!("/api/captures/{name}/depth"), client, &request.to_string());
    assert_eq!(begun.status, 200, "{begun:?}");
    served.ended("computation", &begun.json()["job"])
}

#[test]
fn depth_is_computed_measured_compared_and_taken_along() {
    let served = Served::captures_only();
    let client = Socket::open(&served).secret.clone();
    served.state_when(|state| state["control"]["holder"].is_null());
    let socket = Socket::open(&served);
    assert_eq!(
        served.post("/api/captures/pair-001/depth", &client, "{}").status,
        403,
        "its socket has closed"
    );
    let client = socket.secret.clone();
    put(&served, "pair-001", 0);
    put(&served, "pair-002", 77);
    for name in ["pair-001", "pair-002"] {
        let job = computed(&served, &client, name, &json!({ "min_confidence": 0.05 }));
        assert_eq!(job["phase"], "done", "{job:#}");
        assert_eq!((&job["result"]["width"], &job["result"]["height"]), (&96.into(), &64.into()));
    }
    let job = computed(&served, &client, "pair-001", &json!({ "method": "subbarao", "variant": "subbarao" }));
    assert_eq!(job["phase"], "done", "{job:#}");
    let map = served.get("/api/captures/pair-001/variants/subbarao/depth.npy");
    assert!(map.status == 200 && map.body.starts_with(b"\x93NUMPY"));

    let one = served.get("/api/captures/pair-001").json();
    assert_eq!(one["capture"]["variants"], json!(["subbarao"]));
    assert_eq!(one["capture"]["has_depth"], true);
    let region =
        served.post("/api/captures/pair-001/region", "", r#"{"x":8,"y":8,"width":40,"height":30}"#).json();
    assert!(region["figures"]["mean_mm"].as_f64().unwrap() > 800.0, "{region:#}");
    let outside = served.post("/api/captures/pair-001/region", "", r#"{"x":90,"y":0,"width":40,"height":1}"#);
    assert_eq!(outside.status, 400);
    let profile = served.post("/api/captures/pair-001/profile", "", r#"{"from":[0,9],"to":[95,9]}"#).json();
    assert_eq!(profile["figures"]["points"].as_array().unwrap().len(), 96);
    let difference = served.get("/api/captures/pair-001/difference/pair-002").json();
    assert!(difference["figures"]["pixels"].as_u64().unwrap() > 1000, "{difference:#}");
    assert!(served.get("/api/captures/pair-001/difference/pair-002/map.npy").body.starts_with(b"\x93NUMPY"));
    assert!(served.get("/api/captures/pair-001/mesh.ply").body.starts_with(b"ply\n"));
    let zip = served.get("/api/captures/pair-001/zip");
    assert!(
        zip.body.starts_with(b"PK") && zip.headers.contains("filename=\"pair-001.zip\""),
        "{}",
        zip.headers
    );
    let report = served.get("/api/captures/pair-001/report.html");
    assert!(report.headers.contains("content-security-policy: default-src 'none'"), "{}", report.headers);
    assert!(String::from_utf8_lossy(&report.body).contains("<h1>pair-001</h1>"));
}

#[test]
fn notes_are_stored_and_searched_and_broken_captures_reported() {
    let served = Served::captures_only();
    put(&served, "pair-001", 0);
    put(&served, "pair-002", 1);
    fs::write(served.session.join("pair-002/capture.toml"), "format = \"?\"").unwrap();
    let socket = Socket::open(&served);
    let client = [("x-farnear-client", socket.secret.as_str())];
    let note = json!({ "rating": 5, "text": "sandpaper" }).to_string();
    assert_eq!(served.ask("PUT", "/api/captures/pair-001/note", &[], &note).status, 403);
    assert_eq!(served.ask("PUT", "/api/captures/pair-001/note", &client, &note).status, 200);
    assert_eq!(served.ask("PUT", "/api/captures/absent/note", &client, &note).status, 404);
    let too_good = json!({ "rating": 6, "text": "" }).to_string();
    assert_eq!(served.ask("PUT", "/api/captures/pair-001/note", &client, &too_good).status, 400);
    let found = served.get("/api/captures?search=SandPaper").json();
    assert_eq!(found["captures"].as_array().unwrap().len(), 1);
    let all = served.get("/api/captures").json();
    assert!(all["captures"][1]["broken"].as_str().is_some_and(|reason| reason.contains("format")), "{all:#}");
}

#[test]
fn optics_are_checked_before_they_are_kept() {
    let served = Served::captures_only();
    let socket = Socket::open(&served);
    let client = [("x-farnear-client", socket.secret.as_str())];
    let mut optics = served.get("/api/optics").json();
    optics["optics"]["focus"]["far_mm"] = json!(800.0);
    assert_eq!(served.ask("PUT", "/api/optics", &client, &optics.to_string()).status, 200);
    assert!(fs::read_to_string(served.session.join("optics.toml")).unwrap().contains("far_mm = 800.0"));
    let before = fs::read(served.session.join("optics.toml")).unwrap();
    optics["optics"]["focus"]["far_mm"] = json!(20.0);
    let refused = served.ask("PUT", "/api/optics", &client, &optics.to_string());
    assert!(refused.status == 400 && refused.error().contains("far_mm"), "{refused:?}");
    assert_eq!(fs::read(served.session.join("optics.toml")).unwrap(), before);
    let typed =
        json!({ "optics": served.get("/api/optics").json()["optics"], "readings": { "far_mm": 5.17 } });
    let found = served.post("/api/optics/calculate", "", &typed.to_string()).json();
    assert!((found["figures"]["reading_near"]["mm"].as_f64().unwrap() - 5.3263).abs() < 1e-3, "{found:#}");
}

#[test]
fn the_light_of_the_session_stays_when_its_lens_changes() {
    let served = Served::captures_only();
    let socket = Socket::open(&served);
    let client = [("x-farnear-client", socket.secret.as_str())];
    let file = served.session.join("optics.toml");
    let text = fs::read_to_string(&file).unwrap();
    fs::write(&file, format!("{text}\n[light]\nfirst = 30.25\nsecond = 0.0\n")).unwrap();
    let mut given = served.get("/api/optics").json();
    let write = |given: &Value| served.ask("PUT", "/api/optics", &client, &given.to_string());
    let first = || served.get("/api/optics").json()["optics"]["light"]["first"].as_f64();
    assert_eq!(first(), Some(30.25));
    // As the page sends a calculated or a calibrated lens.
    given["optics"].as_object_mut().unwrap().remove("light");
    given["optics"]["focus"]["far_mm"] = json!(800.0);
    assert_eq!(write(&given).status, 200);
    assert_eq!(first(), Some(30.25));
    given["optics"]["light"] = json!({ "first": 5.5, "second": 100.0 });
    assert_eq!((write(&given).status, first()), (200, Some(5.5)));
    given["optics"]["light"] = json!({ "first": 101.0 });
    let refused = write(&given);
    assert!(refused.status == 400 && refused.error().contains("101"), "{refused:?}");
    assert_eq!(first(), Some(5.5));
}

/// The files of a capture, including temporary ones.
fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let mut names: Vec<_> =
        entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

/// The file size limit (8 or 16 kB, by shell) is above the size of the images and below that of the maps.
#[test]
fn a_full_disk_fails_the_job_and_leaves_no_partial_files() {
    const WITHIN: &str = "FARNEAR_TEST_SMALL_FILES";
    if std::env::var_os(WITHIN).is_none() {
        let script = r#"trap "" XFSZ; ulimit -f 16; exec "$0" --exact captures::a_full_disk_fails_the_job_and_leaves_no_partial_files"#;
        let program = std::env::current_exe().unwrap();
        let ended = Command::new("sh").args(["-c", script]).arg(program).env(WITHIN, "1").output().unwrap();
        assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stdout));
        return;
    }
    let served = Served::captures_only();
    let socket = Socket::open(&served);
    put(&served, "pair-001", 0);
    let folder = served.session.join("pair-001");
    let before = names(&folder);
    let job = computed(&served, &socket.secret, "pair-001", &json!({}));
    assert_eq!(job["phase"], "failed", "{job:#}");
    assert!(job["error"].as_str().is_some_and(|error| error.contains("cannot write")), "{job:#}");
    assert_eq!(names(&folder), before);
    // Everything else works: files are served, and a note is small enough.
    assert_eq!(served.get("/api/captures/pair-001/files/far.png").status, 200);
    let note = json!({ "rating": 1, "text": "the disk is full" }).to_string();
    let client = [("x-farnear-client", socket.secret.as_str())];
    assert_eq!(served.ask("PUT", "/api/captures/pair-001/note", &client, &note).status, 200);
}

#[test]
fn changes_of_the_session_by_other_programs_are_reported() {
    let served = Served::captures_only();
    let socket = Socket::open(&served);
    let listed = || served.get("/api/captures").json()["captures"].as_array().unwrap().len();
    put(&served, "pair-001", 0);
    put(&served, "pair-002", 1);
    assert_eq!(listed(), 2);
    // A capture is moved, loses an image, or is not a folder any more.
    fs::rename(served.session.join("pair-001"), served.session.join("moved")).unwrap();
    assert_eq!((listed(), served.get("/api/captures/pair-001").status), (2, 404));
    assert_eq!(served.get("/api/captures/moved").status, 200);
    fs::remove_file(served.session.join("moved/near.png")).unwrap();
    let job = computed(&served, &socket.secret, "moved", &json!({}));
    assert!(job["error"].as_str().is_some_and(|error| error.contains("near.png")), "{job:#}");
    fs::write(served.session.join("pair-002/far.png"), b"no picture").unwrap();
    let job = computed(&served, &socket.secret, "pair-002", &json!({}));
    assert!(job["error"].as_str().is_some_and(|error| error.contains("far.png")), "{job:#}");
    fs::remove_dir_all(served.session.join("pair-002")).unwrap();
    fs::write(served.session.join("pair-002"), b"a file").unwrap();
    let refused = served.get("/api/captures/pair-002");
    assert!(refused.status == 404 && refused.error().contains("pair-002"), "{refused:?}");
    // The optics become invalid, then valid again.
    let whole = fs::read(served.session.join("optics.toml")).unwrap();
    fs::write(served.session.join("optics.toml"), "[lens]\nfocal_length_mm = \"?\"\n").unwrap();
    let spoiled = served.get("/api/optics");
    assert!(spoiled.status >= 400 && spoiled.error().contains("optics.toml"), "{spoiled:?}");
    fs::write(served.session.join("optics.toml"), whole).unwrap();
    assert_eq!(served.get("/api/optics").status, 200);
    // The whole session folder disappears.
    fs::remove_dir_all(&served.session).unwrap();
    assert_eq!(served.get("/api/state").status, 200);
    assert!(served.get("/api/captures/moved").status >= 400);
}

#[test]
fn captures_with_blanks_are_opened_renamed_and_deleted_by_the_browser_in_control() {
    let served = Served::captures_only();
    let (holder, watcher) = (Socket::open(&served), Socket::open(&served));
    put(&served, "a & b", 0);
    put(&served, "taken", 0);
    assert_eq!(served.get("/api/captures/a%20%26%20b").status, 200);
    assert_eq!(served.get("/api/captures/a%20%26%20b/files/far.png").status, 200);
    let rename = |client: &str, to: &str| {
        served.post("/api/captures/a%20%26%20b/rename", client, &json!({ "name": to }).to_string()).status
    };
    assert_eq!(rename(&watcher.secret, "c"), 403);
    assert_eq!((rename(&holder.secret, "taken"), rename(&holder.secret, "people")), (400, 400));
    assert_eq!(rename(&holder.secret, "step 2 mm"), 200);
    assert!(served.session.join("step 2 mm/far.png").is_file());
    let delete = |client: &str| {
        served.ask("DELETE", "/api/captures/step%202%20mm", &[("x-farnear-client", client)], "{}").status
    };
    assert_eq!((delete(&watcher.secret), delete(&holder.secret), delete(&holder.secret)), (403, 200, 404));
    assert!(!served.session.join("step 2 mm").exists() && served.session.join("taken").exists());
}
