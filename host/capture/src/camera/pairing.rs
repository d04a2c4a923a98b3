//! Which frame belongs to which exposure.
//!
//! Between arming and the end of a program every trigger gives one frame, so the n-th frame belongs to the n-th trigger. What a camera says
//! of its frames is held against what the board says of its exposures: the camera's own count must advance as the board's trigger number
//! does, and its time stamps must be as far apart as the starts of the strobe. What does not agree is an error, never a guess; a whole
//! program counts, because a frame that came too often or not at all shows at its end ([`super::Camera::finish`]) at the latest.

use std::time::Duration;

use farnear_protocol::message::ShotRecord;

use super::CameraError;

/// A camera's stamp may jitter by so much against the strobe: GigE Vision cameras stamp to a microsecond, drivers of Video4Linux in an
/// interrupt, some a line or two of the read-out late.
const JITTER: Duration = Duration::from_millis(2);
/// Two free crystals differ by 50 ppm each at most, and some margin.
const DRIFT_PPM: u64 = 200;
/// The count of GigE Vision 1.x goes from 1 to this and around, past 0.
const SHORT_COUNT_MAX: u64 = 65_535;

/// What a camera says of a frame.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Stamp {
    /// Running number by the camera itself, which counts frames that were lost on the way, too.
    pub count: Option<u64>,
    /// When it was exposed, by a clock of the camera's or the driver's that starts at any time.
    pub time: Option<Duration>,
}

/// Where a frame stands to an exposure.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Belongs {
    /// It came of an earlier trigger.
    Earlier,
    /// It is the exposure's.
    Here,
    /// It came of a later trigger: so many were passed over.
    Later(u64),
}

/// The frames since a camera was armed.
#[derive(Clone, Debug)]
pub struct Pairing {
    /// The last frame that was paired, with its exposure.
    last: Option<(Stamp, ShotRecord)>,
    jitter: Duration,
}

impl Default for Pairing {
    fn default() -> Self {
        Self { last: None, jitter: JITTER }
    }
}

impl Pairing {
    /// For a camera whose stamps jitter by more than those of hardware.
    pub fn with_jitter(jitter: Duration) -> Self {
        Self { last: None, jitter }
    }

    /// Forgets what was paired: the camera is armed anew.
    pub fn begin(&mut self) {
        self.last = None;
    }

    /// Judges the next frame that came against the exposure that waits for one. `camera` is for messages.
    ///
    /// # Errors
    /// [`CameraError::Mispaired`] where count and time contradict each other.
    pub fn judge(&mut self, camera: &str, stamp: Stamp, shot: &ShotRecord) -> Result<Belongs, CameraError> {
        if let Some((last, last_shot)) = &self.last {
            let triggers = shot.trigger_number.wrapping_sub(last_shot.trigger_number);
            if let (Some(from), Some(to)) = (last.count, stamp.count) {
                let ahead = counted(from, to).saturating_sub(i64::from(triggers));
                if ahead != 0 {
                    return Ok(u64::try_from(ahead).map_or(Belongs::Earlier, Belongs::Later));
                }
            } else if triggers != 1 {
                // Nobody counts but we: what became of the triggers in between cannot be told.
                let reason = format!("the one before it was of exposure {}", last_shot.trigger_number);
                return Err(mispaired(camera, shot, reason));
            }
            if let (Some(from), Some(to)) = (last.time, stamp.time) {
                let by_camera = to.saturating_sub(from);
                let strobes = shot.strobe_start.0.saturating_sub(last_shot.strobe_start.0);
                let by_board = Duration::from_micros(strobes);
                let drift = Duration::from_micros(strobes.saturating_mul(DRIFT_PPM) / 1_000_000);
                if by_camera.abs_diff(by_board) > self.jitter + drift {
                    let reason = format!(
                        "its time stamp lies {by_camera:?} after that of the picture before it, their strobes {by_board:?} apart"
                    );
                    return Err(mispaired(camera, shot, reason));
                }
            }
        }
        self.last = Some((stamp, *shot));
        Ok(Belongs::Here)
    }
}

fn mispaired(camera: &str, shot: &ShotRecord, reason: String) -> CameraError {
    CameraError::Mispaired { camera: camera.into(), wanted: shot.trigger_number, reason }
}

/// How far a count has come; less than 0 for an earlier frame. A short count goes around, and half of it is further than any frame is late.
fn counted(from: u64, to: u64) -> i64 {
    let way = i128::from(to) - i128::from(from);
    let around = i128::from(SHORT_COUNT_MAX);
    let way = match from.max(to) <= SHORT_COUNT_MAX {
        true if way > around / 2 => way - around,
        true if way < -(around / 2) => way + around,
        _ => way,
    };
    i64::try_from(way).unwrap_or(if way < 0 { i64::MIN } else { i64::MAX })
}

#[cfg(test)]
mod tests {
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

    fn stamp(count: Option<u64>, time_us: Option<u64>) -> Stamp {
        Stamp { count, time: time_us.map(Duration::from_micros) }
    }

    #[test]
    fn count_and_time_must_agree() {
        let mut pairing = Pairing::default();
        let mut judge = |count, time, shot: ShotRecord| pairing.judge("c", stamp(count, time), &shot);
        assert_eq!(judge(Some(65_534), Some(9_000_000), shot(4, 100_000)).unwrap(), Belongs::Here);
        assert_eq!(judge(Some(65_535), Some(9_100_500), shot(5, 200_000)).unwrap(), Belongs::Here);
        // Around, past 0: 1 is the next one.
        assert_eq!(judge(Some(1), Some(9_200_000), shot(6, 300_000)).unwrap(), Belongs::Here);
        assert_eq!(judge(Some(3), Some(9_400_000), shot(7, 400_000)).unwrap(), Belongs::Later(1));
        assert_eq!(judge(Some(65_535), Some(9_100_000), shot(7, 400_000)).unwrap(), Belongs::Earlier);
        let error = judge(Some(2), Some(9_400_000), shot(7, 400_000)).unwrap_err().to_string();
        assert!(
            error.contains("exposure 7") && error.contains("200ms") && error.contains("100ms"),
            "{error}"
        );
    }

    #[test]
    fn without_a_count_the_time_tells_a_lost_frame() {
        let mut pairing = Pairing::default();
        let mut judge = |time, shot: ShotRecord| pairing.judge("c", stamp(None, time), &shot);
        assert_eq!(judge(Some(50), shot(0, 1_000)).unwrap(), Belongs::Here);
        // The frame of trigger 1 was lost; that of trigger 2 comes in its place.
        let error = judge(Some(80_050), shot(1, 41_000)).unwrap_err();
        assert!(matches!(error, CameraError::Mispaired { wanted: 1, .. }), "{error:?}");
    }

    #[test]
    fn with_nothing_but_their_order_frames_go_with_consecutive_triggers_only() {
        let mut pairing = Pairing::default();
        let nothing = Stamp::default();
        assert_eq!(pairing.judge("c", nothing, &shot(8, 0)).unwrap(), Belongs::Here);
        assert_eq!(pairing.judge("c", nothing, &shot(9, 0)).unwrap(), Belongs::Here);
        assert!(pairing.judge("c", nothing, &shot(11, 0)).is_err());
    }

    proptest! {
        // Whatever is lost on the way, no exposure is given the frame of another one, and none that came is refused.
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
                    continue; // told by `Late` or `Incomplete`; the next exposure goes on
                }
                let of_short_count = start <= 65_535;
                let count = if of_short_count { (start + index - 1) % 65_535 + 1 } else { start + index };
                let board_us = index * period_us;
                let camera_us = (board_us as i64 + board_us as i64 * drift_ppm / 1_000_000) as u64;
                let exposure = shot(index as u32, board_us);
                let came = pairing.judge("c", stamp(Some(count), Some(77 + camera_us)), &exposure).unwrap();
                prop_assert_eq!(came, Belongs::Here);
                // The same frame for the exposure after it is an earlier one.
                let next = shot(index as u32 + 1, board_us + period_us);
                let again = pairing.judge("c", stamp(Some(count), Some(77 + camera_us)), &next).unwrap();
                prop_assert_eq!(again, Belongs::Earlier);
            }
        }
    }
}
