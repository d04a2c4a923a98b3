//! `farnear target`: figures, page and rejected input.

use std::fs;

use crate::common::{Folder, fails, farnear, figures, number, rig_optics};

#[test]
fn a_target_is_a_page_with_cells_of_whole_dots_true_to_scale() {
    let folder = Folder::new();
    let (a4, again, a3) = (folder.text("a4.pdf"), folder.text("again.pdf"), folder.text("a3.pdf"));
    let asked = ["target", "--optics", rig_optics(), "--json", "--out"];
    let found = figures(farnear(&asked).arg(&a4));
    // By hand: 7.4 um (933 - 50) / 50 = 0.13068 mm; 2.5 of them are 7.7 dots of 25.4/600 mm, so 8.
    assert_eq!(number(&found, "pixel_on_target_mm"), 0.1307);
    assert_eq!(number(&found, "cell_dots"), 8.0);
    assert_eq!(number(&found, "cell_mm"), 0.3387);
    let [columns, rows] = ["columns", "rows"].map(|key| number(&found, key));
    assert_eq!([columns, rows], [561.0, 764.0], "190 and 259 mm of 0.33867");
    let page = fs::read(&a4).unwrap();
    let text = String::from_utf8_lossy(&page);
    assert!(text.starts_with("%PDF-") && text.trim_end().ends_with("%%EOF"));
    for part in ["/MediaBox [0 0 595.27", "/Width 561", "/Height 764", "/PrintScaling /None"] {
        assert!(text.contains(part), "{part}");
    }
    figures(farnear(&asked).arg(&again));
    assert_eq!(fs::read(&again).unwrap(), page, "the same seed is the same page");
    let coarse =
        figures(farnear(&asked).args([&a3, "--paper", "A3", "--distance-mm", "480", "--dpi", "300"]));
    assert_eq!(number(&coarse, "cell_dots"), 2.0);
    assert!(number(&coarse, "columns") > columns);
    assert_eq!(folder.listing(), ["a3.pdf", "a4.pdf", "again.pdf"]);
}

#[test]
fn unprintable_targets_are_rejected_without_output() {
    let folder = Folder::new();
    let out = folder.text("target.pdf");
    let asked = ["target", "--optics", rig_optics(), "--out", &out];
    for (more, phrases) in [
        (["--distance-mm", "50"], ["distance 50", "more than the focal length, 50 mm"]),
        (["--distance-mm", "inf"], ["distance inf", "focal length"]),
        (["--distance-mm", "9e9"], ["paper 210x297 mm", "room for 48 cells"]),
        (["--dpi", "72"], ["dpi 72", "150 to 4800"]),
        (["--paper", "b5"], ["unknown paper `b5`", "WIDTHxHEIGHT"]),
        (["--paper", "90x90"], ["paper 90x90", "130 to 2000 mm"]),
    ] {
        fails(farnear(&asked).args(more), 2, &phrases);
    }
    let nowhere = folder.text("none/target.pdf");
    fails(
        &mut farnear(&["target", "--optics", rig_optics(), "--out", &nowhere]),
        2,
        &["none/target.pdf", "does not exist"],
    );
    assert!(folder.listing().is_empty(), "{:?}", folder.listing());
}
