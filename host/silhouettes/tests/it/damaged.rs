//! Files of every kind with damaged words, to reach beyond the first line.

use farnear_silhouettes::readers::{self, c3d, csv, kinect, matlab, ntu, recording::Choices, trc};
use farnear_silhouettes::silhouette::template::Template;
use farnear_test_data::{cases, damaged};
use proptest::prelude::*;
use std::fmt::Write;

pub fn ntu_file() -> String {
    let mut text = String::from("3\n");
    for frame in 0..3 {
        text += "1\n72057594037944738 0 0 1 1 0 1 0.1 0.2 2\n25\n";
        for joint in 0..25 {
            let up = 0.07 * f64::from(joint);
            writeln!(text, "0.{frame} {up} 3.1 1 2 3 4 0.1 0.2 0.3 0.4 2").expect("a string");
        }
    }
    text
}

fn kinect_file() -> String {
    let row = |frame: usize| (0..60).map(|i| format!("{}.{frame}", i % 3)).collect::<Vec<_>>().join(" ");
    (0..4).map(row).collect::<Vec<_>>().join("\n")
}

const TRC: &str = "PathFileType\t4\t(X/Y/Z)\twalk.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames\n100\t100\t2\t2\tmm\t100\t1\t2\nFrame#\tTime\tA\t\t\tB\t\t\n\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n\n1\t0.0\t1\t2\t3\t4\t5\t6\n2\t0.01\t1\t2\t3\t4\t5\t6\n";
pub const CSV: &str =
    "frame,HEAD_x,HEAD_y,HEAD_z,HIP_x,HIP_y,HIP_z\n0,0,0,1700,0,0,900\n1,0,0,1690,0,0,890\n";
/// A row for each point.
const LONG: &str = "frame,person_id,keypoint,x,y,score\n0,1,nose,10,20,0.9\n0,1,left_knee,10,80,0.9\n0,2,nose,50,20,0.9\n1,1,nose,11,20,0.9\n";

fn keypoints() -> String {
    let points =
        |x: usize| (0..17).map(|n| format!("{}, {}, 0.9", x + n, 10 * n)).collect::<Vec<_>>().join(", ");
    let person = |image: usize| {
        format!("{{ \"image_id\" : {image} , \"idx\" : 1 , \"keypoints\" : [ {} ] }}", points(20 * image + 1))
    };
    format!("[ {} , {} ]", person(1), person(3))
}

const TEMPLATE: &str =
    "name = 'doll'\n[[part]]\nname = 'trunk'\nmarkers = ['HEAD', 'HIP']\nthickness_mm = 120.0\n";

proptest! {
    #![proptest_config(ProptestConfig { cases: cases(200), failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn damaged_texts_are_read_or_refused(
        words in proptest::collection::vec((any::<usize>(), any::<usize>()), 1..6),
        lost in proptest::option::of(any::<usize>()),
    ) {
        let hurt = |text: &str| damaged(text, &words, lost);
        let _ = ntu::read(hurt(&ntu_file()).as_bytes());
        let _ = kinect::read(hurt(&kinect_file()).as_bytes());
        let _ = trc::read(hurt(TRC).as_bytes());
        let _ = csv::read(hurt(CSV).as_bytes(), Choices::default());
        let _ = csv::read(hurt(LONG).as_bytes(), Choices::default());
        let _ = Template::parse(&hurt(TEMPLATE));
        // Accepted data are also turned upright and their units guessed.
        for (text, ending) in [(TRC.to_owned(), "trc"), (CSV.to_owned(), "csv"), (ntu_file(), "skeleton"), (kinect_file(), "txt"), (keypoints(), "json")] {
            let _ = readers::read(hurt(&text).as_bytes(), ending, Choices::default());
        }
    }

    #[test]
    fn binary_files_with_their_own_beginning_are_read_or_refused(mut bytes in proptest::collection::vec(any::<u8>(), 600..3000), blocks in 0..6_u8) {
        // C3D: parameters in block 2, the key 0x50, a processor; MATLAB 5: 124 bytes of text, version, byte
        // order.
        bytes[..4].copy_from_slice(&[2, 0x50, blocks, 0]);
        bytes[512..516].copy_from_slice(&[1, 0x50, blocks, 84]);
        let _ = c3d::read(&bytes);
        bytes[..116].fill(b' ');
        bytes[124..128].copy_from_slice(&[0, 1, b'I', b'M']);
        let _ = matlab::read(&bytes);
    }
}
