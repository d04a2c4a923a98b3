//! Pairs frames with exposures. One set of rules for all cameras, based on frame count, time stamps, arrival,
//! file time and pixels. From arming to the end of the last program the n-th frame belongs to the n-th trigger.
//! The camera's count must advance with the board's trigger number, apart from triggers that the camera missed, and its
//! time stamps with the strobe.
//! Contradictions are errors, never guesses. A surplus or missing frame is found at the end of the program at
//! the latest ([`super::Camera::finish`]).

use std::{
    cmp::Ordering,
    collections::VecDeque,
    path::{Path, PathBuf},
    time::{Duration, Instant, SystemTime},
};

use farnear_protocol::message::ShotRecord;

use super::{CameraError, Frame, Image};

/// Jitter of stamps against the strobe: GigE Vision a microsecond, Video4Linux an interrupt or some lines of read-out.
const JITTER: Duration = Duration::from_millis(2);
/// Delay until a picture from a pipe is stamped; it never counts as earlier.
const ARRIVAL_JITTER: Duration = Duration::from_millis(10);
/// Pictures in a row, all late by an exposure, that prove one missing: a single one may be delayed.
const LATE_MAX: u32 = 4;
/// Part of the exposures' interval by which a picture counts as late.
const LATE: f64 = 0.7;
/// Exposures that may wait for their pictures.
const REPORTED_MAX: usize = 256;
/// Shortest quiet time after a program.
const QUIET: Duration = Duration::from_millis(200);
/// Two crystals differ by 50 ppm each, plus a margin.
const DRIFT_PPM: u64 = 200;
/// Longest wait for a surplus picture because earlier ones came late.
const QUIET_MAX: Duration = Duration::from_secs(5);
/// Cameras number their files from 0001 to 9999 (DCF).
const COUNTER_RANGE: u64 = 10_000;
/// GigE Vision 1.x counts from 1 to this, skipping 0.
const SHORT_COUNT_MAX: u64 = 65_535;

#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Stamp {
    /// Frame number of the camera, including lost frames.
    pub count: Option<u64>,
    /// Exposure time by a camera or driver clock with arbitrary origin.
    pub time: Option<Duration>,
}

#[derive(Clone, PartialEq, Debug, Default)]
pub struct Evidence {
    pub stamp: Stamp,
    /// Local arrival time, if known to a few milliseconds.
    pub arrived: Option<Instant>,
    /// File and its time, by one clock for all pictures of the camera.
    pub taken: Option<(SystemTime, PathBuf)>,
    /// Time of the exposure in the file (EXIF). It comes before the file's time, which synchronisation changes.
    pub exposed: Option<String>,
    /// [`content`] hash, if nothing else identifies it.
    pub content: Option<u64>,
}

impl From<Stamp> for Evidence {
    fn from(stamp: Stamp) -> Self {
        Self { stamp, ..Self::default() }
    }
}

/// Hash of the pixels. `None` for a uniform picture (lens cap, saturation), which may repeat.
pub fn content(image: &Image) -> Option<u64> {
    let first = image.pixels.first()?;
    if image.pixels.iter().all(|pixel| pixel == first) {
        return None;
    }
    Some(hash(image.pixels.iter().map(|pixel| u64::from(*pixel))))
}

/// FNV-1a.
pub(super) fn hash(values: impl Iterator<Item = u64>) -> u64 {
    let add = |hash: u64, value: u64| (hash ^ value).wrapping_mul(0x0000_0100_0000_01b3);
    values.fold(0xcbf2_9ce4_8422_2325, add)
}

/// Relation of a frame to an exposure.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Belongs {
    Earlier,
    Here,
    /// Number of skipped triggers.
    Later(u64),
}

#[derive(Clone, Debug)]
pub struct Pairing {
    last: Option<(Evidence, ShotRecord)>,
    jitter: Duration,
    armed: Option<Instant>,
    /// Board time of the program's first move, us.
    begin_us: Option<u64>,
    /// Whether board time follows the local clock; an emulated board may run faster.
    in_real_time: bool,
    contents: Vec<(u64, u32)>,
    /// Longest interval of two exposures, or one and a half times the longest wait for a picture without a stamp, at most
    /// [`QUIET_MAX`]: a surplus one may be as late.
    longest: Duration,
    last_arrival: Option<Instant>,
    delays: Delays,
    /// Of a later exposure, whose image it is.
    early: Option<Frame>,
}

impl Default for Pairing {
    fn default() -> Self {
        Self::with_jitter(JITTER)
    }
}

impl Pairing {
    /// For cameras with larger jitter than hardware stamps.
    pub fn with_jitter(jitter: Duration) -> Self {
        Self {
            last: None,
            jitter,
            armed: None,
            begin_us: None,
            in_real_time: false,
            contents: Vec::new(),
            longest: Duration::ZERO,
            last_arrival: None,
            delays: Delays::default(),
            early: None,
        }
    }

    pub fn begin(&mut self) {
        *self = Self::with_jitter(self.jitter);
        self.armed = Some(Instant::now());
    }

    pub fn reported(&mut self, shot: &ShotRecord, received: Instant) {
        if self.begin_us.is_none() {
            self.begin_us = Some(shot.trigger.0.saturating_sub(u64::from(shot.settle.0)));
            self.in_real_time = true;
        }
        let over = self.at_least(shot.strobe_end.0);
        self.in_real_time &= over.is_some_and(|over| over <= received);
        if self.delays.reported.len() == REPORTED_MAX {
            self.delays.reported.pop_front();
        }
        self.delays.reported.push_back((shot.trigger_number, received));
    }

    /// The program began after arming.
    fn at_least(&self, board_us: u64) -> Option<Instant> {
        let since_us = board_us.saturating_sub(self.begin_us?);
        let drift_us = since_us.saturating_mul(DRIFT_PPM) / 1_000_000;
        Some(self.armed? + Duration::from_micros(since_us - drift_us))
    }

    pub fn quiet_time(&self) -> Duration {
        self.longest.max(QUIET)
    }

    /// A program set the time of a file that was judged.
    pub fn retimed(&mut self, path: &Path, written: SystemTime) {
        if let Some((Evidence { taken: Some((at, of)), .. }, _)) = &mut self.last
            && of == path
        {
            *at = written;
        }
    }

    /// The frame that was ahead of the last exposure.
    pub fn early(&mut self) -> Option<Frame> {
        self.early.take()
    }

    /// The image of the next frame if it belongs to the exposure, `None` if it is older. A newer frame is
    /// [`CameraError::Skipped`] and kept for its exposure. Other errors as of [`Self::judge`].
    pub fn image(
        &mut self,
        camera: &str,
        frame: Frame,
        shot: &ShotRecord,
    ) -> Result<Option<Image>, CameraError> {
        let wanted = shot.trigger_number;
        match self.judge(camera, frame.stamp, shot)? {
            Belongs::Here => Ok(Some(frame.image)),
            Belongs::Earlier => Ok(None),
            Belongs::Later(by) => {
                self.early = Some(frame);
                let by = u32::try_from(by).unwrap_or(u32::MAX);
                Err(CameraError::Skipped { wanted, came: wanted.wrapping_add(by) })
            }
        }
    }

    /// Checks the next frame against the pending exposure. `camera` is for messages. Returns [`CameraError::Mispaired`]
    /// if count and time contradict each other; [`CameraError::Doubled`], [`CameraError::Reordered`],
    /// [`CameraError::Stale`] for an impossible picture.
    pub fn judge(
        &mut self,
        camera: &str,
        evidence: impl Into<Evidence>,
        shot: &ShotRecord,
    ) -> Result<Belongs, CameraError> {
        let evidence = evidence.into();
        let wanted = shot.trigger_number;
        let same = self.contents.iter().find(|(content, _)| Some(*content) == evidence.content);
        if let Some((_, earlier)) = same {
            return Err(CameraError::Doubled { camera: camera.into(), earlier: *earlier, wanted });
        }
        if let Some((last, _)) = &self.last
            && let (Some((before, _)), Some((at, path))) = (&last.taken, &evidence.taken)
        {
            // A file's time may be that of its transfer; a counter that goes back contradicts it.
            let by_file = || at.cmp(before).min(self.by_name(path));
            let exposed = evidence.exposed.as_ref().zip(last.exposed.as_ref());
            if exposed.map_or(Ordering::Equal, |(at, before)| at.cmp(before)).then_with(by_file)
                == Ordering::Less
            {
                return Err(CameraError::Reordered { path: path.clone() });
            }
        }
        let belongs = self.by_stamp(camera, evidence.stamp, shot)?;
        if belongs != Belongs::Here {
            return Ok(belongs);
        }
        let came = evidence.arrived.unwrap_or_else(Instant::now);
        let reported = self.delays.reported_at(wanted).filter(|_| evidence.stamp == Stamp::default());
        // Until the picture before it came, the camera was busy with that one.
        let begun = reported.max(reported.and(self.last_arrival));
        let waited = begun.map_or(Duration::ZERO, |begun| came.saturating_duration_since(begun));
        let earliest = self.at_least(shot.strobe_start.0).filter(|_| self.in_real_time);
        if let (Some(arrived), Some(earliest)) = (evidence.arrived, earliest)
            && let Some(early) = earliest.checked_duration_since(arrived + ARRIVAL_JITTER)
        {
            return Err(CameraError::Stale { camera: camera.into(), wanted, early });
        }
        if let (None, Some(arrived), true) = (evidence.stamp.count, evidence.arrived, self.in_real_time) {
            let interval =
                self.last.as_ref().map(|(_, last)| shot.strobe_start.0.saturating_sub(last.strobe_start.0));
            if let Some(reason) = self.delays.one_is_missing(wanted, arrived, interval) {
                return Err(mispaired(camera, shot, reason));
            }
        }
        self.contents.extend(evidence.content.map(|content| (content, wanted)));
        let (from, to) = match &self.last {
            Some((_, last)) if (last.index, last.repeat) < (shot.index, shot.repeat) => {
                (last.strobe_start.0, shot.strobe_start.0)
            }
            // The first of a program: the time since the program before does not count.
            _ => (shot.trigger.0.saturating_sub(u64::from(shot.settle.0)), shot.strobe_end.0),
        };
        let interval = Duration::from_micros(to.saturating_sub(from));
        self.longest = self.longest.max(interval).max((waited * 3 / 2).min(QUIET_MAX));
        self.last_arrival = Some(came);
        self.last = Some((evidence, *shot));
        Ok(Belongs::Here)
    }

    fn by_name(&self, path: &Path) -> Ordering {
        let last = self.last.as_ref().and_then(|(last, _)| last.taken.as_ref());
        last.and_then(|(_, last)| by_number(path, last)).unwrap_or(Ordering::Equal)
    }

    fn by_stamp(&self, camera: &str, stamp: Stamp, shot: &ShotRecord) -> Result<Belongs, CameraError> {
        let awaited = self.delays.reported.front().map(|(earlier, _)| *earlier);
        if let (None, None, Some(earlier)) = (&self.last, stamp.count, awaited)
            && (shot.trigger_number.wrapping_sub(earlier) as i32) > 0
        {
            return Err(mispaired(camera, shot, format!("exposure {earlier} before it has no picture")));
        }
        if let Some((Evidence { stamp: last, .. }, last_shot)) = &self.last {
            let triggers = shot.trigger_number.wrapping_sub(last_shot.trigger_number);
            let strobes = shot.strobe_start.0.saturating_sub(last_shot.strobe_start.0);
            let by_board = Duration::from_micros(strobes);
            let drift = Duration::from_micros(strobes.saturating_mul(DRIFT_PPM) / 1_000_000);
            let by_camera = last.time.zip(stamp.time).map(|(from, to)| to.saturating_sub(from));
            let off = by_camera.map(|by_camera| by_camera.abs_diff(by_board));
            if let (Some(from), Some(to)) = (last.count, stamp.count) {
                let ahead = counted(from, to).saturating_sub(i64::from(triggers));
                // A camera does not count a trigger that it missed; a continuous run continues after it.
                let limit = JITTER + drift;
                let missed = ahead < 0
                    && drift < JITTER
                    && off.is_some_and(|off| off <= limit)
                    && by_board / triggers.max(1) > 2 * limit;
                if ahead != 0 && !missed {
                    return Ok(u64::try_from(ahead).map_or(Belongs::Earlier, Belongs::Later));
                }
            } else if triggers != 1 {
                // Without a count the skipped triggers are unknown.
                let reason = format!("the one before it was of exposure {}", last_shot.trigger_number);
                return Err(mispaired(camera, shot, reason));
            }
            if let (Some(by_camera), Some(off)) = (by_camera, off)
                && off > self.jitter + drift
            {
                let back = last.time.zip(stamp.time).and_then(|(from, to)| from.checked_sub(to));
                let reason = match back.filter(|back| !back.is_zero()) {
                    Some(back) => format!(
                        "its time stamp lies {back:?} before that of the picture before it, so the camera's clock has probably started again"
                    ),
                    None => format!(
                        "its time stamp lies {by_camera:?} after that of the picture before it, their strobes {by_board:?} apart"
                    ),
                };
                return Err(mispaired(camera, shot, reason));
            }
        }
        Ok(Belongs::Here)
    }
}

/// Delays of pictures after the reports of their exposures. Without a count, a missing picture makes each later one
/// the next exposure's, which is late by an interval of exposures.
#[derive(Clone, Debug, Default)]
struct Delays {
    /// Trigger numbers of exposures without a picture, and when the board reported them.
    reported: VecDeque<(u32, Instant)>,
    least_s: Option<f64>,
    shortest_interval_s: Option<f64>,
    late_in_a_row: u32,
}

impl Delays {
    fn reported_at(&self, trigger_number: u32) -> Option<Instant> {
        self.reported.iter().find(|(number, _)| *number == trigger_number).map(|(_, at)| *at)
    }

    /// Why a picture before this one is missing. `interval_us` is the time since the exposure before.
    fn one_is_missing(
        &mut self,
        trigger_number: u32,
        arrived: Instant,
        interval_us: Option<u64>,
    ) -> Option<String> {
        let reported = loop {
            let (number, reported) = self.reported.pop_front()?;
            if number == trigger_number {
                break reported;
            }
        };
        let delay_s = match arrived.checked_duration_since(reported) {
            Some(after) => after.as_secs_f64(),
            None => -reported.duration_since(arrived).as_secs_f64(),
        };
        let least_s = self.least_s.map_or(delay_s, |least| least.min(delay_s));
        self.least_s = Some(least_s);
        let interval_s = interval_us? as f64 * 1e-6;
        let shortest_s = self.shortest_interval_s.map_or(interval_s, |shortest| shortest.min(interval_s));
        self.shortest_interval_s = Some(shortest_s);
        let is_late = delay_s - least_s > LATE * shortest_s;
        self.late_in_a_row = if is_late { self.late_in_a_row + 1 } else { 0 };
        (self.late_in_a_row == LATE_MAX).then(|| {
            format!(
                "it and the {} before it came {:.0} ms later after their exposures than earlier ones, and exposures are \
                 {:.0} ms apart, so that a picture is missing or the program cannot keep up",
                LATE_MAX - 1,
                1e3 * (delay_s - least_s),
                1e3 * shortest_s
            )
        })
    }
}

/// Orders two files by their trailing number; cameras' counters of four digits wrap after 9999, also where the name has
/// digits before them (`DSC09999`, `P1019999`). `None` if more differs.
pub fn by_number(a: &Path, b: &Path) -> Option<Ordering> {
    let split = |path: &Path| {
        let stem = path.file_stem()?.to_str()?.to_owned();
        let digits = stem.bytes().rev().take_while(u8::is_ascii_digit).count();
        let (name, number) = stem.split_at(stem.len() - digits);
        Some((name.to_owned(), number.parse::<u64>().ok()?, digits))
    };
    let ((name_a, a, digits_a), (name_b, b, digits_b)) = (split(a)?, split(b)?);
    if name_a != name_b {
        return None;
    }
    // Half of the counter exceeds any distance within a program. Numbers of six digits are times of day, longer ones times.
    let rolled_over = digits_a == digits_b
        && matches!(digits_a, 4 | 5 | 7)
        && a / COUNTER_RANGE == b / COUNTER_RANGE
        && a.abs_diff(b) > COUNTER_RANGE / 2;
    Some(if rolled_over { b.cmp(&a) } else { a.cmp(&b) })
}

fn mispaired(camera: &str, shot: &ShotRecord, reason: String) -> CameraError {
    CameraError::Mispaired { camera: camera.into(), wanted: shot.trigger_number, reason }
}

/// Signed advance of a count. Short counts wrap, and half of one exceeds any delay.
pub fn counted(from: u64, to: u64) -> i64 {
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
mod tests;
