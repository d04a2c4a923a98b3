use super::*;
use farnear_protocol::{
    message::Axis,
    units::{BoardMicros, Micros, Nanometres},
};
use proptest::prelude::*;

fn shot(trigger_number: u32, strobe_us: u64) -> ShotRecord {
    ShotRecord {
        index: 0,
        repeat: 0,
        trigger_number,
        axis: Axis::SensorFine,
        asked: Nanometres(0),
        coarse: Nanometres(0),
        fine: Nanometres(0),
        lens: Nanometres(0),
        settle: Micros(0),
        trigger: BoardMicros(strobe_us),
        strobe_start: BoardMicros(strobe_us),
        strobe_end: BoardMicros(strobe_us + 5_000),
        exposure: Micros(5_000),
    }
}

fn long_shot(trigger_number: u32, strobe_us: u64) -> ShotRecord {
    ShotRecord { settle: Micros(10_000), ..shot(trigger_number, strobe_us) }
}

fn arrive(pairing: &mut Pairing, shot: ShotRecord, arrived_ms: u64) -> Result<Belongs, CameraError> {
    let armed = pairing.armed.unwrap();
    let reported = armed
        + Duration::from_micros(shot.strobe_end.0 - pairing.begin_us.unwrap_or(990_000))
        + Duration::from_millis(3);
    pairing.reported(&shot, reported);
    let arrived = Some(armed + Duration::from_millis(arrived_ms));
    pairing.judge("ffmpeg", Evidence { arrived, ..Evidence::default() }, &shot)
}

#[test]
fn refuses_a_picture_that_arrived_before_its_exposure() {
    let mut pairing = Pairing::default();
    pairing.begin();
    assert_eq!(arrive(&mut pairing, long_shot(1, 1_000_000), 18).unwrap(), Belongs::Here);
    // A second picture of the first trigger, 400 ms later: the second exposure begins after 1010 ms.
    let error = arrive(&mut pairing, long_shot(2, 2_000_000), 418).unwrap_err();
    assert!(matches!(error, CameraError::Stale { wanted: 2, .. }), "{error:?}");
    assert!(error.to_string().contains("-fps_mode passthrough"), "{error}");
    assert_eq!(pairing.quiet_time(), QUIET);
}

#[test]
fn a_slow_camera_is_watched_for_longer_than_it_takes_for_a_picture() {
    let mut pairing = Pairing::default();
    pairing.begin();
    // Reported after 18 and 38 ms; each picture takes a second.
    for (number, strobe_us, arrived_ms) in [(1, 1_000_000, 1_018), (2, 1_020_000, 2_018)] {
        arrive(&mut pairing, long_shot(number, strobe_us), arrived_ms).unwrap();
        assert_eq!(pairing.quiet_time(), Duration::from_millis(1_500));
    }
}

#[test]
fn a_missing_picture_without_a_count_is_found_by_the_delay_of_the_later_ones() {
    // Exposures 100 ms apart, pictures 12 to 20 ms after them.
    let delays_ms = [15, 12, 20, 14];
    let run = |lost: Option<u32>, delayed: Option<u32>| {
        let mut pairing = Pairing::default();
        pairing.begin();
        (1..=20).find_map(|number| {
            let of = number + u32::from(lost.is_some_and(|lost| number >= lost));
            let delay = delays_ms[number as usize % 4] + if delayed == Some(number) { 90 } else { 0 };
            let arrived_ms = 100 * u64::from(of) + 15 - 90 + delay;
            let shot = long_shot(number, 900_000 + 100_000 * u64::from(number));
            arrive(&mut pairing, shot, arrived_ms).err().map(|error| (number, error))
        })
    };
    assert!(run(None, None).is_none());
    assert!(run(None, Some(9)).is_none(), "a single late picture is only late");
    let (number, error) = run(Some(7), None).unwrap();
    assert_eq!(number, 10);
    assert!(matches!(error, CameraError::Mispaired { wanted: 10, .. }), "{error:?}");
    assert!(error.to_string().contains("a picture is missing"), "{error}");
}

#[test]
fn accepts_pictures_whose_board_runs_faster_than_the_clock() {
    let mut pairing = Pairing::default();
    pairing.begin();
    let armed = pairing.armed.unwrap();
    for (number, arrived_ms) in [(1, 3), (2, 4), (3, 5)] {
        let shot = ShotRecord { repeat: number as u16, ..long_shot(number, u64::from(number) * 1_000_000) };
        pairing.reported(&shot, armed + Duration::from_millis(arrived_ms));
        let arrived = Some(armed + Duration::from_millis(arrived_ms));
        let evidence = Evidence { arrived, ..Evidence::default() };
        assert_eq!(pairing.judge("c", evidence, &shot).unwrap(), Belongs::Here);
    }
    assert_eq!(pairing.quiet_time(), Duration::from_secs(1));
}

#[test]
fn the_frame_after_a_lost_one_is_that_of_its_own_exposure() {
    let mut pairing = Pairing::default();
    pairing.begin();
    let frame = |count: u64| Frame {
        image: Image {
            pixels: ndarray::Array2::from_elem((1, 1), count as u16),
            bits: 8,
            coding_variance: 0.0,
        },
        stamp: Stamp { count: Some(count), time: None },
    };
    let code = |image: Option<Image>| image.map(|image| image.pixels[(0, 0)]);
    assert_eq!(code(pairing.image("c", frame(1), &shot(7, 1_000_000)).unwrap()), Some(1));
    // Frame 2 is lost.
    let lost = pairing.image("c", frame(3), &shot(8, 2_000_000)).unwrap_err();
    assert!(matches!(lost, CameraError::Skipped { wanted: 8, came: 9 }), "{lost:?}");
    let kept = pairing.early().unwrap();
    assert_eq!(code(pairing.image("c", kept, &shot(9, 3_000_000)).unwrap()), Some(3));
    assert!(pairing.early().is_none());
    assert_eq!(code(pairing.image("c", frame(4), &shot(10, 4_000_000)).unwrap()), Some(4));
}

/// The board may be ahead by 200 ppm: 100 s of it last 99.98 s here.
#[test]
fn an_exposure_may_be_early_by_the_drift_of_the_clocks_and_no_more() {
    let after_100_s = |arrived_ms| {
        let mut pairing = Pairing::default();
        pairing.begin();
        arrive(&mut pairing, long_shot(1, 1_000_000), 18).unwrap();
        arrive(&mut pairing, long_shot(2, 100_990_000), arrived_ms)
    };
    // A picture counts as arrived 10 ms later.
    assert_eq!(after_100_s(99_971).unwrap(), Belongs::Here);
    let error = after_100_s(99_969).unwrap_err();
    assert!(matches!(error, CameraError::Stale { wanted: 2, .. }), "{error:?}");
}

#[test]
fn rejects_repeated_pixels_unless_the_picture_is_uniform() {
    let image = |pixels: [u16; 3]| Image::new(ndarray::array![pixels], 8);
    assert_eq!(content(&image([7, 7, 7])), None);
    assert_ne!(content(&image([1, 2, 3])), content(&image([3, 2, 1])));
    let mut pairing = Pairing::default();
    pairing.begin();
    let of = |pixels| Evidence { content: content(&image(pixels)), ..Evidence::default() };
    pairing.judge("c", of([1, 2, 3]), &shot(4, 0)).unwrap();
    let error = pairing.judge("c", of([1, 2, 3]), &shot(5, 9)).unwrap_err();
    assert!(matches!(error, CameraError::Doubled { earlier: 4, wanted: 5, .. }), "{error:?}");
}

#[test]
fn refuses_an_older_picture_after_a_newer_one() {
    let at = |seconds, name: &str| Evidence {
        taken: Some((SystemTime::UNIX_EPOCH + Duration::from_secs(seconds), name.into())),
        ..Evidence::default()
    };
    let judge = |first: Evidence, second: Evidence| {
        let mut pairing = Pairing::default();
        pairing.begin();
        pairing.judge("c", first, &shot(1, 0)).unwrap();
        pairing.judge("c", second, &shot(2, 9))
    };
    assert!(matches!(judge(at(9, "a.jpg"), at(8, "b.jpg")), Err(CameraError::Reordered { .. })));
    assert!(judge(at(8, "b.jpg"), at(9, "a.jpg")).is_ok());
    // Within one clock tick the number decides; it wraps after 9999.
    assert!(judge(at(9, "IMG_0007.jpg"), at(9, "IMG_0006.jpg")).is_err());
    assert!(judge(at(9, "IMG_9999.jpg"), at(9, "IMG_0001.jpg")).is_ok());
    assert!(judge(at(9, "IMG_0001.jpg"), at(9, "IMG_9999.jpg")).is_err());
    // Transferred in another order than exposed, with the transfers' times, also within one second of EXIF.
    assert!(judge(at(8, "IMG_0007.jpg"), at(9, "IMG_0006.jpg")).is_err());
    assert!(judge(at(8, "IMG_9999.jpg"), at(9, "IMG_0001.jpg")).is_ok());
    let exposed = |evidence| Evidence { exposed: Some("2026:11:25 20:00:00.".into()), ..evidence };
    assert!(judge(exposed(at(8, "IMG_0007.jpg")), exposed(at(9, "IMG_0006.jpg"))).is_err());
}

#[test]
fn counters_of_four_digits_wrap_and_only_over_half_of_their_range() {
    let order = |a: &str, b: &str| by_number(Path::new(a), Path::new(b));
    assert_eq!(order("IMG_0001.jpg", "IMG_5001.jpg"), Some(Ordering::Less));
    assert_eq!(order("IMG_0001.jpg", "IMG_5002.jpg"), Some(Ordering::Greater));
    assert_eq!(order("DSC00001.jpg", "DSC09999.jpg"), Some(Ordering::Greater));
    assert_eq!(order("P1010001.jpg", "P1019999.jpg"), Some(Ordering::Greater));
    assert_eq!(order("DSC00001.jpg", "DSC10000.jpg"), Some(Ordering::Less));
    assert_eq!(order("20261125_200001.jpg", "20261125_201000.jpg"), Some(Ordering::Less));
    assert_eq!(order("1764561600001.jpg", "1764561609000.jpg"), Some(Ordering::Less));
    assert_eq!(order("IMG_10000.jpg", "IMG_4000.jpg"), Some(Ordering::Greater));
    assert_eq!(order("IMG_4000.jpg", "IMG_10000.jpg"), Some(Ordering::Less));
    assert_eq!(order("IMG_0001.jpg", "DSC_0002.jpg"), None);
}

#[test]
fn short_counts_skip_nought_and_wrap_the_shorter_way() {
    for (from, to, advance) in [(65_535, 1, 1), (1, 65_535, -1), (65_530, 3, 8), (3, 65_530, -8)] {
        assert_eq!(counted(from, to), advance, "{from} to {to}");
    }
    // Half of the range is 32767 in either direction.
    for (from, to, advance) in
        [(1, 32_768, 32_767), (32_768, 1, -32_767), (1, 32_769, -32_767), (32_769, 1, 32_767)]
    {
        assert_eq!(counted(from, to), advance, "{from} to {to}");
    }
    assert_eq!((counted(65_535, 65_536), counted(65_536, 1)), (1, -65_535), "longer counts do not wrap");
    assert_eq!((counted(0, u64::MAX), counted(u64::MAX, 0)), (i64::MAX, i64::MIN));
}

fn stamp(count: Option<u64>, time_us: Option<u64>) -> Stamp {
    Stamp { count, time: time_us.map(Duration::from_micros) }
}

#[test]
fn count_and_time_must_agree() {
    let mut pairing = Pairing::default();
    let mut judge = |count, time, shot: ShotRecord| pairing.judge("c", stamp(count, time), &shot);
    assert_eq!(judge(Some(65_534), Some(9_000_000), shot(4, 100_000)).unwrap(), Belongs::Here);
    assert_eq!(judge(Some(65_535), Some(9_100_500), shot(5, 200_000)).unwrap(), Belongs::Here);
    // Wraps past 0 to 1.
    assert_eq!(judge(Some(1), Some(9_200_000), shot(6, 300_000)).unwrap(), Belongs::Here);
    assert_eq!(judge(Some(3), Some(9_400_000), shot(7, 400_000)).unwrap(), Belongs::Later(1));
    assert_eq!(judge(Some(65_535), Some(9_100_000), shot(7, 400_000)).unwrap(), Belongs::Earlier);
    let error = judge(Some(2), Some(9_400_000), shot(7, 400_000)).unwrap_err().to_string();
    assert!(error.contains("exposure 7") && error.contains("200ms") && error.contains("100ms"), "{error}");
    // A clock of 32 bits has wrapped.
    let error = judge(Some(2), Some(5_000), shot(7, 400_000)).unwrap_err().to_string();
    assert!(error.contains("9.195s before that of the picture before it"), "{error}");
}

#[test]
fn a_trigger_that_the_camera_missed_is_recognised_by_time() {
    let mut pairing = Pairing::default();
    let mut judge = |count, time, shot| pairing.judge("c", stamp(Some(count), Some(time)), &shot).unwrap();
    assert_eq!(judge(1, 5_000, shot(1, 100_000)), Belongs::Here);
    // Trigger 2 gave neither strobe nor frame.
    assert_eq!(judge(2, 205_100, shot(3, 300_000)), Belongs::Here);
    assert_eq!(judge(3, 305_100, shot(4, 400_000)), Belongs::Here);
    // Trigger 5 gave a frame, and the strobe was lost.
    assert_eq!(judge(4, 405_100, shot(6, 600_000)), Belongs::Earlier);
    assert_eq!(judge(5, 505_100, shot(6, 600_000)), Belongs::Here);
}

#[test]
fn time_stamps_reveal_a_lost_frame_without_a_count() {
    let mut pairing = Pairing::default();
    let mut judge = |time, shot: ShotRecord| pairing.judge("c", stamp(None, time), &shot);
    assert_eq!(judge(Some(50), shot(0, 1_000)).unwrap(), Belongs::Here);
    // The frame of trigger 1 was lost; that of trigger 2 takes its place.
    let error = judge(Some(80_050), shot(1, 41_000)).unwrap_err();
    assert!(matches!(error, CameraError::Mispaired { wanted: 1, .. }), "{error:?}");
}

/// Two crystals of 100 ppm drift apart by 200 ppm at most: 200 ms in 1000 s, and the jitter of a stamp.
#[test]
fn clocks_may_drift_apart_by_two_hundred_ppm_and_no_more() {
    let after_1000_s = |camera_us: u64| {
        let mut pairing = Pairing::default();
        pairing.judge("c", stamp(None, Some(0)), &shot(0, 0)).unwrap();
        pairing.judge("c", stamp(None, Some(camera_us)), &shot(1, 1_000_000_000))
    };
    for drift_us in [190_000, 150_000, 0] {
        assert_eq!(after_1000_s(1_000_000_000 + drift_us).unwrap(), Belongs::Here, "{drift_us}");
        assert_eq!(after_1000_s(1_000_000_000 - drift_us).unwrap(), Belongs::Here, "-{drift_us}");
    }
    let most_us = 200_000 + JITTER.as_micros() as u64;
    assert_eq!(after_1000_s(1_000_000_000 + most_us).unwrap(), Belongs::Here);
    let beyond_us = most_us + 1;
    assert!(after_1000_s(1_000_000_000 + beyond_us).is_err());
    assert!(after_1000_s(1_000_000_000 - beyond_us).is_err());
}

#[test]
fn frames_without_count_or_time_require_consecutive_triggers() {
    let mut pairing = Pairing::default();
    let nothing = Stamp::default();
    assert_eq!(pairing.judge("c", nothing, &shot(8, 0)).unwrap(), Belongs::Here);
    assert_eq!(pairing.judge("c", nothing, &shot(9, 0)).unwrap(), Belongs::Here);
    assert!(pairing.judge("c", nothing, &shot(11, 0)).is_err());
}

#[test]
fn the_picture_that_the_first_exposure_waited_for_in_vain_is_not_the_next_ones() {
    let mut pairing = Pairing::default();
    pairing.begin();
    let (first, second) = (long_shot(1, 1_000_000), long_shot(2, 1_040_000));
    pairing.reported(&first, Instant::now());
    let error = arrive(&mut pairing, second, 200).unwrap_err();
    assert!(matches!(error, CameraError::Mispaired { wanted: 2, .. }), "{error:?}");
    assert!(error.to_string().contains("exposure 1 before it has no picture"), "{error}");
}

proptest! {
    // Also, no received frame is rejected.
    #[test]
    fn lost_frames_never_shift_the_others(
        lost in prop::collection::vec(prop::bool::weighted(0.1), 2..300),
        start in prop_oneof![1_u64..70_000, Just(65_530_u64)],
        period_us in 5_000_u64..200_000,
        drift_ppm in -100_i64..100,
    ) {
        let mut pairing = Pairing::default();
        for (index, lost) in lost.iter().enumerate().map(|(index, lost)| (index as u64, *lost)) {
            if lost {
                continue; // the camera reports `Late` or `Incomplete`
            }
            let of_short_count = start <= 65_535;
            let count = if of_short_count { (start + index - 1) % 65_535 + 1 } else { start + index };
            let board_us = index * period_us;
            let camera_us = (board_us as i64 + board_us as i64 * drift_ppm / 1_000_000) as u64;
            let exposure = shot(index as u32, board_us);
            let came = pairing.judge("c", stamp(Some(count), Some(77 + camera_us)), &exposure).unwrap();
            prop_assert_eq!(came, Belongs::Here);
            // For the next exposure the same frame is an earlier one.
            let next = shot(index as u32 + 1, board_us + period_us);
            let again = pairing.judge("c", stamp(Some(count), Some(77 + camera_us)), &next).unwrap();
            prop_assert_eq!(again, Belongs::Earlier);
        }
    }
}
