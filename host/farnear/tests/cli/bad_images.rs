//! Invalid images and maps: a clear message each, and no output.

use std::fs;

use crate::common::{Folder, fails, farnear, render, rig_optics, succeeds};

#[track_caller]
fn depth_fails(folder: &Folder, far: &str, near: &str, phrases: &[&str]) {
    let before = folder.listing();
    let out = folder.text("out");
    for out in [vec![], vec!["--out", &out]] {
        fails(farnear(&["depth", far, near, "--optics", rig_optics()]).args(out), 1, phrases);
        assert_eq!(folder.listing(), before);
    }
}

#[test]
fn broken_images_are_named() {
    let folder = Folder::new();
    render(&folder, "slant", "pair");
    let [far, near] = ["pair/far.png", "pair/near.png"].map(|name| folder.text(name));
    let whole = fs::read(&far).expect("the far image");
    let empty = folder.file("empty.png", "");
    let cut = folder.file("cut.png", &whole[..whole.len() / 2]);
    let head = folder.file("head.png", &whole[..8]);
    let text = folder.file("text.png", "these are words, no pixels, and long enough for any header");
    let absent = folder.text("absent.png");
    for (broken, phrases) in [
        (&empty, ["empty.png", "is empty"]),
        (&cut, ["cut.png", "is not an image that farnear reads (PNG, TIFF, JPEG, BMP, PGM)"]),
        (&head, ["head.png", "is not an image"]),
        (&text, ["text.png", "is not an image"]),
        (&absent, ["absent.png", "No such file"]),
        (&folder.text("pair"), ["pair", "Is a directory"]),
    ] {
        depth_fails(&folder, broken, &near, &phrases);
        depth_fails(&folder, &far, broken, &phrases);
    }
    depth_fails(&folder, &far, &far, &["far.png", "the same image"]);
}

#[test]
fn images_of_different_size_do_not_make_a_pair() {
    let folder = Folder::new();
    render(&folder, "slant", "pair");
    let small = folder.file("small.pgm", [b"P5 20 30 255\n".as_slice(), &[7; 600]].concat());
    let phrases = ["far.png", "small.pgm", "320x240", "20x30", "one size"];
    depth_fails(&folder, &folder.text("pair/far.png"), &small, &phrases);
}

#[test]
fn images_without_texture_or_too_small_have_no_depth() {
    let folder = Folder::new();
    let flat = |value: u8| [b"P5 32 32 255\n".as_slice(), &[value; 1024]].concat();
    let (black, white) = (folder.file("black.pgm", flat(0)), folder.file("white.pgm", flat(255)));
    depth_fails(&folder, &black, &white, &["black.pgm", "constant", "texture"]);
    let tiny = |value: u8| [b"P5 3 2 255\n".as_slice(), &[value, 1, 2, 3, 4, 5]].concat();
    let (a, b) = (folder.file("a.pgm", tiny(0)), folder.file("b.pgm", tiny(9)));
    depth_fails(&folder, &a, &b, &["3x2", "too small", "16x16"]);
}

#[test]
fn a_swapped_pair_is_reported() {
    let folder = Folder::new();
    render(&folder, "slant", "pair");
    let [far, near] = ["pair/far.png", "pair/near.png"].map(|name| folder.text(name));
    let swapped = ["depth", &near, &far, "--optics", rig_optics()];
    let (_, stderr) = succeeds(farnear(&swapped).args(["--out", &folder.text("a")]));
    assert!(
        stderr.contains("warning: the pair looks swapped") && stderr.contains("near.png was given as FAR"),
        "{stderr}"
    );
    let right = ["depth", &far, &near, "--optics", rig_optics()];
    let (_, stderr) = succeeds(farnear(&right).args(["--out", &folder.text("b")]));
    assert!(!stderr.contains("swapped"), "{stderr}");
}

#[test]
fn invalid_maps_are_named_in_the_error() {
    let folder = Folder::new();
    render(&folder, "slant", "pair");
    let truth = folder.text("pair/truth.npy");
    let whole = fs::read(&truth).expect("the truth");
    let empty = folder.file("empty.npy", "");
    let cut = folder.file("cut.npy", &whole[..whole.len() - 9]);
    let head = folder.file("head.npy", &whole[..9]);
    let integers = folder.text("pair/far.png");
    for (map, phrases) in [
        (&empty, ["empty.npy", "is empty"]),
        (&cut, ["cut.npy", "is not a map"]),
        (&head, ["head.npy", "is not a map"]),
        (&integers, ["far.png", "8-bit integers, not mm"]),
        (&folder.text("absent.npy"), ["absent.npy", "No such file"]),
        (&folder.text("pair"), ["pair/depth.npy", "No such file"]),
    ] {
        fails(&mut farnear(&["compare", map, &truth]), 1, &phrases);
        fails(&mut farnear(&["compare", &truth, map]), 1, &phrases);
    }
    let rim = ["compare", &truth, &truth, "--border", "200"];
    fails(&mut farnear(&rim), 1, &["no pixel to compare"]);
    let small = folder.file("small.pgm", [b"P5 20 30 255\n".as_slice(), &[7; 600]].concat());
    fails(&mut farnear(&["compare", &truth, &truth, "--mask", &small]), 1, &["20x30", "320x240"]);
}

#[test]
fn a_place_that_cannot_be_written_is_named() {
    let folder = Folder::new();
    render(&folder, "slant", "pair");
    let [far, near] = ["pair/far.png", "pair/near.png"].map(|name| folder.text(name));
    let file = folder.file("file", "in the way");
    let below = folder.text("file/below");
    let before = folder.listing();
    for out in [&file, &below] {
        fails(
            &mut farnear(&["depth", &far, &near, "--optics", rig_optics(), "--out", out]),
            1,
            &["cannot write", "file"],
        );
        fails(
            &mut farnear(&["render", "--optics", rig_optics(), "--out", out]),
            1,
            &["cannot write", "file"],
        );
    }
    let operators = ["operators", "--optics", rig_optics(), "--out", &below];
    fails(&mut farnear(&operators), 2, &["below", "file is not a folder"]);
    assert_eq!(folder.listing(), before);
}
