//! Recordings beyond 65,535 frames, trimmed headers, unknown units, and parameters of points.

use farnear_silhouettes::readers::{
    self,
    recording::{Choices, Recording, RecordingError, Source, Unit, Up},
};

/// Markers that move by 1 unit a frame.
struct Made {
    labels: &'static [&'static str],
    /// Names and texts of `POINT`.
    texts: &'static [(&'static str, &'static str)],
    frames: usize,
    /// First and last frame by the header.
    header: (u16, u16),
    /// `TRIAL:ACTUAL_START_FIELD` and `ACTUAL_END_FIELD`.
    trial: Option<(u32, u32)>,
    /// Whether the trial's parameters are real numbers, not two words.
    is_trial_real: bool,
    /// `POINT:FRAMES` as a real number.
    point_frames: Option<f32>,
    units: &'static str,
}

impl Default for Made {
    fn default() -> Self {
        Self {
            labels: &["HEAD"],
            texts: &[],
            frames: 10,
            header: (1, 10),
            trial: None,
            is_trial_real: false,
            point_frames: None,
            units: "mm",
        }
    }
}

fn group(bytes: &mut Vec<u8>, name: &str, id: i8) {
    bytes.extend([name.len() as u8, -id as u8]);
    bytes.extend(name.as_bytes());
    bytes.extend(3_u16.to_le_bytes());
    bytes.push(0);
}

fn parameter(bytes: &mut Vec<u8>, name: &str, group: u8, element: i8, dimensions: &[u8], data: &[u8]) {
    bytes.extend([name.len() as u8, group]);
    bytes.extend(name.as_bytes());
    bytes.extend((5 + dimensions.len() as u16 + data.len() as u16).to_le_bytes());
    bytes.extend([element as u8, dimensions.len() as u8]);
    bytes.extend(dimensions);
    bytes.extend(data);
    bytes.push(0);
}

impl Made {
    fn bytes(&self) -> Vec<u8> {
        let mut header = vec![0_u8; 512];
        let mut word = |number: usize, value: u16| {
            header[2 * (number - 1)..2 * number].copy_from_slice(&value.to_le_bytes());
        };
        for (number, value) in
            [(1, 0x5002), (2, self.labels.len() as u16), (4, self.header.0), (5, self.header.1), (9, 4)]
        {
            word(number, value);
        }
        header[12..16].copy_from_slice(&(-1.0_f32).to_le_bytes());
        header[20..24].copy_from_slice(&100.0_f32.to_le_bytes());
        let mut section = vec![0, 0, 2, 84];
        group(&mut section, "POINT", 1);
        group(&mut section, "TRIAL", 2);
        let labels: Vec<u8> =
            self.labels.iter().flat_map(|label| format!("{label:8}").into_bytes()).collect();
        parameter(&mut section, "LABELS", 1, -1, &[8, self.labels.len() as u8], &labels);
        for (name, text) in self.texts {
            parameter(&mut section, name, 1, -1, &[text.len() as u8, 1], text.as_bytes());
        }
        parameter(&mut section, "UNITS", 1, -1, &[self.units.len() as u8], self.units.as_bytes());
        if let Some((first, last)) = self.trial {
            for (name, value) in [("ACTUAL_START_FIELD", first), ("ACTUAL_END_FIELD", last)] {
                if self.is_trial_real {
                    parameter(&mut section, name, 2, 4, &[], &(value as f32).to_le_bytes());
                } else {
                    parameter(&mut section, name, 2, 2, &[2], &value.to_le_bytes());
                }
            }
        }
        if let Some(frames) = self.point_frames {
            parameter(&mut section, "FRAMES", 1, 4, &[], &frames.to_le_bytes());
        }
        section.resize(1024, 0);
        let frame = |n: usize| {
            [n as f32 + 1.0, 500.0, 1700.0, 0.0].map(f32::to_le_bytes).concat().repeat(self.labels.len())
        };
        [header, section, (0..self.frames).flat_map(frame).collect()].concat()
    }

    fn read(&self, choices: Choices) -> Result<Recording, RecordingError> {
        readers::read(&self.bytes(), "c3d", choices)
    }
}

#[track_caller]
fn whole(made: &Made) -> Vec<String> {
    let found = made.read(Choices::default()).expect("a recording");
    assert_eq!(found.frames.len(), made.frames);
    let last = found.by_name(made.frames - 1)["HEAD"][0];
    assert_eq!(last, made.frames as f64);
    found.remarks()
}

#[test]
fn recordings_beyond_the_sixteen_bits_of_the_header_are_read_whole() {
    // The header wraps round, stops at its largest number, or counts the rest of 65,536.
    for header in [(1, 4464), (1, 65_535), (1, 0)] {
        for (trial, point_frames) in [(Some((1, 70_000)), None), (None, Some(70_000.0))] {
            let made = Made { frames: 70_000, header, trial, point_frames, ..Made::default() };
            let remarks = whole(&made);
            assert!(remarks.iter().any(|remark| remark.contains("70000")), "{header:?}: {remarks:?}");
        }
    }
    let without = Made { frames: 70_000, header: (1, 4464), ..Made::default() };
    assert!(!whole(&without).is_empty(), "room for one turn of the header more");
}

#[test]
fn a_trimmed_header_yields_to_the_parameters_and_what_is_left_over_is_reported() {
    let trimmed = Made { frames: 500, header: (1, 1), trial: Some((101, 600)), ..Made::default() };
    assert!(whole(&trimmed)[0].contains("the header counts 1 frames, 500"));
    assert_eq!(whole(&Made { is_trial_real: true, ..trimmed }).len(), 1);
    let more = Made { frames: 500, header: (1, 100), ..Made::default() };
    let found = more.read(Choices::default()).expect("a recording");
    assert_eq!(found.frames.len(), 100);
    assert!(found.remarks()[0].contains("room for 500 frames, 100"), "{:?}", found.remarks());
    assert!(whole(&Made::default()).is_empty());
}

#[test]
fn the_callers_unit_overrides_an_unknown_one() {
    let made = Made { units: "yard", ..Made::default() };
    let error = made.read(Choices::default()).expect_err("an unknown unit").to_string();
    assert!(error.contains("yard"), "{error}");
    let choices = Choices { unit: Some(Unit { mm: 10.0 }), ..Choices::default() };
    assert_eq!(made.read(choices).expect("a recording").by_name(0)["HEAD"], [10.0, 5000.0, 17_000.0]);
    let unstated = Made { units: "", ..Made::default() }.read(Choices::default()).expect("a recording");
    assert_eq!((unstated.unit.value, &unstated.unit.source), (Unit::MM, &Source::Format));
    // Metres, cut to four characters.
    let metres = Made { units: "mete", ..Made::default() };
    assert_eq!(metres.read(Choices::default()).expect("a recording").unit.value.mm, 1000.0);
}

#[test]
fn the_vertical_axis_of_the_screen_is_up() {
    let made = Made { texts: &[("Y_SCREEN", "-Z")], ..Made::default() };
    let found = made.read(Choices::default()).expect("a recording");
    assert_eq!((found.up.value, &found.up.source), (Up::MinusZ, &Source::File));
    assert_eq!(found.by_name(0)["HEAD"], [1.0, -500.0, -1700.0]);
}

#[test]
fn model_outputs_are_not_points() {
    let labels = &["HEAD", "LHipAng", "LHipMom"];
    let texts = &[("ANGLES", "LHipAng"), ("MOMENTS", "LHipMom")];
    let found = Made { labels, texts, ..Made::default() }.read(Choices::default()).expect("a recording");
    assert_eq!((found.names.as_slice(), found.frames[0].len()), (["HEAD".to_owned()].as_slice(), 1));
    assert_eq!(found.remarks(), ["2 model outputs (angles, moments) are not read"]);
    let unnamed = Made { labels, ..Made::default() }.read(Choices::default()).expect("a recording");
    assert_eq!(unnamed.names.len(), 3);
}
