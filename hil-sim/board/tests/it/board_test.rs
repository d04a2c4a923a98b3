//! The test of a real board (`cargo xtask board-test`) on the emulated one.

use farnear_sim::{board_test, firmware};

fn report(wired: bool) -> String {
    let firmware = firmware::find(None).expect("a firmware");
    let mut elf = firmware.with_file_name(board_test::PROGRAM);
    if let Some(extension) = firmware.extension() {
        elf.set_extension(extension);
    }
    board_test::report(&elf, wired).unwrap_or_else(|error| panic!("{error}"))
}

fn verdicts<'a>(report: &'a str, verdict: &str) -> Vec<&'a str> {
    let mut names: Vec<&str> = report
        .lines()
        .filter_map(|line| line.split_once('\t'))
        .filter(|(_, rest)| rest.split('\t').next() == Some(verdict))
        .map(|(name, _)| name)
        .collect();
    names.dedup();
    names.sort_unstable();
    names.dedup();
    names
}

#[test]
fn the_test_of_a_real_board_passes_on_the_emulated_one_and_finds_missing_wires() {
    let with = report(true);
    println!("{with}");
    let all = [
        "FRAM",
        "board",
        "brown-out reset",
        "control tick",
        "converter bus",
        "emergency stop",
        "exposures",
        "external clock",
        "link",
        "stack overflow",
        "steps",
        "time base",
        "watchdog",
    ];
    assert_eq!((verdicts(&with, "pass"), verdicts(&with, "fail")), (all.to_vec(), vec![]));
    let without = report(false);
    assert_eq!(
        verdicts(&without, "fail"),
        ["converter bus", "emergency stop", "exposures", "steps"],
        "{without}"
    );
}
