//! `farnear depth --write`: the written files and their content.

use exr::prelude::*;
use farnear_files::map;

use crate::common::{Folder, fails, farnear, render, rig_optics, succeeds};

fn written(folder: &Folder, out: &str) -> Vec<String> {
    let below = format!("{out}/");
    folder.listing().iter().filter_map(|name| name.strip_prefix(&below).map(str::to_owned)).collect()
}

#[test]
fn a_map_is_written_as_asked() {
    let folder = Folder::new();
    render(&folder, "cone", "pair");
    let [far, near] = ["pair/far.png", "pair/near.png"].map(|name| folder.text(name));
    let depth = |out: &str, more: &[&str]| {
        let out = folder.text(out);
        succeeds(farnear(&["depth", &far, &near, "--optics", rig_optics(), "--out", &out]).args(more));
    };
    let usual = [
        "confidence.npy",
        "depth.npy",
        "depth.png",
        "depth.tiff",
        "depth.toml",
        "mesh.ply",
        "reason.png",
        "view.png",
    ];
    depth("usual", &[]);
    assert_eq!(written(&folder, "usual"), usual);
    depth("all", &["--write", "npy,tiff,png,mesh,glb,view,exr"]);
    let all = written(&folder, "all");
    assert_eq!(all.len(), usual.len() + 2);
    assert!(std::fs::read(folder.path("all/mesh.glb")).unwrap().starts_with(b"glTF"));
    for name in usual.iter().filter(|name| **name != "depth.toml") {
        let bytes = |out: &str| std::fs::read(folder.path(&format!("{out}/{name}"))).unwrap();
        assert!(bytes("usual") == bytes("all"), "{name}");
    }
    depth("some", &["--write", "mesh, tiff"]);
    assert_eq!(
        written(&folder, "some"),
        ["confidence.npy", "depth.tiff", "depth.toml", "mesh.ply", "reason.png"]
    );
    let record = |out: &str| std::fs::read_to_string(folder.path(&format!("{out}/depth.toml"))).unwrap();
    assert!(record("some").contains("write = \"tiff,mesh\"") && !record("some").contains("[png]"));
    assert!(!record("usual").contains("write = ") && record("usual").contains("[png]"));
    let unknown = ["depth", &far, &near, "--optics", rig_optics(), "--write", "npy,jpg"];
    fails(&mut farnear(&unknown), 2, &["jpg", "npy,tiff,png,mesh,glb,view,exr"]);
}

#[test]
fn a_folder_holds_the_files_of_one_run_with_hashes_of_its_inputs() {
    let folder = Folder::new();
    render(&folder, "cone", "cone");
    render(&folder, "slant", "slant");
    let out = folder.text("out");
    let depth = |pair: &str, more: &[&str]| {
        let [far, near] = ["far.png", "near.png"].map(|name| folder.text(&format!("{pair}/{name}")));
        succeeds(farnear(&["depth", &far, &near, "--optics", rig_optics(), "--out", &out]).args(more));
    };
    depth("cone", &["--uncertainty", "--write", "npy,tiff,png,mesh,glb,view,exr"]);
    folder.file("out/notes.txt", "mine");
    depth("slant", &["--write", "npy"]);
    let left = ["confidence.npy", "depth.npy", "depth.toml", "notes.txt", "reason.png"];
    assert_eq!(written(&folder, "out"), left);
    let record: toml::Table =
        std::fs::read_to_string(folder.path("out/depth.toml")).unwrap().parse().unwrap();
    let input = record["input"].as_array().unwrap();
    let names: Vec<_> = input.iter().map(|file| file["file"].as_str().unwrap()).collect();
    assert_eq!(names[..2], ["../slant/far.png", "../slant/near.png"]);
    assert!(names[2].ends_with("examples/rig.toml"), "{names:?}");
    let bytes = std::fs::read(folder.path("slant/near.png")).unwrap();
    assert_eq!(input[1]["bytes"].as_integer(), Some(bytes.len() as i64));
    assert_eq!(input[1]["sha256"].as_str().unwrap().len(), 64);
    assert_ne!(input[0]["sha256"], input[1]["sha256"]);
    // A failed run leaves the earlier result unchanged.
    fails(&mut farnear(&["depth", &out, &out, "--optics", rig_optics(), "--out", &out]), 1, &[]);
    assert_eq!(written(&folder, "out"), left);
}

#[test]
fn an_exr_holds_depth_confidence_deviation_and_what_made_them() {
    let folder = Folder::new();
    render(&folder, "slant", "pair");
    let [far, near, out] = ["pair/far.png", "pair/near.png", "out"].map(|name| folder.text(name));
    let depth = ["depth", &far, &near, "--optics", rig_optics(), "--out", &out];
    succeeds(farnear(&depth).args(["--uncertainty", "--write", "exr,npy"]));
    let picture = read_first_flat_layer_from_file(folder.path("out/depth.exr")).unwrap();
    let channels = &picture.layer_data.channel_data.list;
    let files = ["depth.npy", "confidence.npy", "uncertainty.npy"];
    assert_eq!(channels.len(), files.len());
    for (channel, (name, file)) in
        channels.iter().zip(["Z", "confidence", "deviation"].into_iter().zip(files))
    {
        assert_eq!(channel.name.to_string(), name);
        let map = map::read(&folder.path(&format!("out/{file}"))).unwrap();
        let FlatSamples::F32(values) = &channel.sample_data else { panic!("{name} is not float") };
        assert!(values.iter().zip(&map).all(|(a, b)| a.to_bits() == b.to_bits()), "{name}");
    }
    let text = |name: &str| match &picture.layer_data.attributes.other[&Text::from(name)] {
        AttributeValue::Text(text) => text.to_string(),
        other => panic!("{name}: {other:?}"),
    };
    assert_eq!(text("farnear:units"), "mm");
    assert!(text("farnear:optics").contains("focal_length_mm = 50.0"));
    assert_eq!(text("farnear:record"), std::fs::read_to_string(folder.path("out/depth.toml")).unwrap());
}
