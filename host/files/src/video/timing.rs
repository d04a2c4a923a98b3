//! Frame times from ffmpeg's list of packets (without decoding), and the rate for reading. Browsers, phones and
//! meetings record at no constant rate, and their files state 1000 frames a second or none: ffmpeg would repeat frames.

use std::{
    path::Path,
    process::{Command, Stdio},
};

/// Relative deviation of an irregular interval. Millisecond time stamps of 60 frames/s are off by 6 %.
const IRREGULAR: f64 = 0.25;
/// Usual camera rates, frames per second.
const USUAL_HZ: [f64; 13] = [
    5.0,
    10.0,
    12.5,
    15.0,
    20.0,
    24_000.0 / 1001.0,
    24.0,
    25.0,
    30_000.0 / 1001.0,
    30.0,
    50.0,
    60_000.0 / 1001.0,
    60.0,
];
/// Relative tolerance for a usual rate.
const NEAR: f64 = 0.0004;
/// The same with irregular time stamps, where the rate is an estimate.
const ROUGHLY_NEAR: f64 = 0.04;

#[derive(Clone, Debug, PartialEq)]
pub(super) struct Timing {
    /// Nominal frames per second.
    pub rate_hz: f64,
    pub regular: bool,
    frames: usize,
    seconds: f64,
    longest_s: f64,
}

impl Timing {
    /// Times of the first video stream; `None` if ffmpeg cannot list them.
    pub fn of(path: &Path) -> Option<Self> {
        let listed = Command::new("ffmpeg")
            .args(["-nostdin", "-v", "error", "-i"])
            .arg(path)
            .args(["-map", "0:v:0", "-c", "copy", "-f", "framecrc", "-"])
            .stdin(Stdio::null())
            .stderr(Stdio::null())
            .output()
            .ok()?;
        let (tick_s, ticks) = parsed(&String::from_utf8_lossy(&listed.stdout))?;
        Self::of_times(ticks.into_iter().map(|tick| tick as f64 * tick_s).collect())
    }

    fn of_times(mut times: Vec<f64>) -> Option<Self> {
        times.sort_by(f64::total_cmp);
        times.dedup();
        let intervals: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let mut sorted = intervals.clone();
        sorted.sort_by(f64::total_cmp);
        let median = *sorted.get(sorted.len() / 2).filter(|median| **median > 0.0)?;
        let usual = |interval: &&f64| (**interval - median).abs() <= IRREGULAR * median;
        let (count, sum) = intervals
            .iter()
            .filter(usual)
            .fold((0_usize, 0.0), |(count, sum), interval| (count + 1, sum + interval));
        let regular = count == intervals.len();
        let measured = count as f64 / sum;
        let near = if regular { NEAR } else { ROUGHLY_NEAR };
        let off = |rate: &f64| (rate / measured - 1.0).abs();
        // An irregular rate has no accuracy of a thousandth.
        let candidates = USUAL_HZ.into_iter().filter(|rate| regular || rate.fract() == 0.0);
        let nearest = candidates.min_by(|a, b| off(a).total_cmp(&off(b)));
        let seconds = intervals.iter().sum();
        // Resolution of millisecond stamps in a short recording.
        let resolution = 0.001 / seconds;
        Some(Self {
            rate_hz: nearest.filter(|rate| off(rate) <= near.max(resolution)).unwrap_or(measured),
            regular,
            frames: times.len(),
            seconds,
            longest_s: sorted.last().copied().unwrap_or(median),
        })
    }

    /// Arguments that give every frame once or, for irregular intervals, frames at the nominal rate by time stamp.
    pub fn arguments(&self) -> [String; 4] {
        let rate = self.rate_hz;
        let filter = match self.regular {
            true => format!("setpts=N/({rate:.6}*TB)"),
            false => format!("fps={rate:.6}"),
        };
        ["-vf".into(), filter, "-r".into(), format!("{rate:.6}")]
    }

    /// Notice to the user about irregular times.
    pub fn remark(&self) -> Option<String> {
        let read = (self.seconds * self.rate_hz).round() as usize + 1;
        (!self.regular).then(|| {
            format!(
                "the frame rate varies: {} frames in {:.2} s, at most {:.2} s apart; resampled by their time stamps to {read} \
                 frames at {:.2} frames/s",
                self.frames, self.seconds, self.longest_s, self.rate_hz
            )
        })
    }
}

/// Seconds per tick, and the presentation times in ticks.
fn parsed(text: &str) -> Option<(f64, Vec<i64>)> {
    let mut tick_s = None;
    let mut ticks = Vec::new();
    for line in text.lines() {
        if let Some(base) = line.strip_prefix("#tb 0:") {
            let (over, under) = base.trim().split_once('/')?;
            tick_s = Some(over.parse::<f64>().ok()? / under.parse::<f64>().ok()?);
        } else if !line.starts_with('#') {
            // Stream, decoding time, presentation time, duration, size, checksum.
            ticks.extend(line.split(',').nth(2).and_then(|cell| cell.trim().parse::<i64>().ok()));
        }
    }
    Some((tick_s?, ticks))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn millisecond_stamps_of_a_constant_rate_are_regular() {
        for rate in [30_000.0 / 1001.0, 30.0, 25.0, 60.0, 17.0] {
            let times = (0..400).map(|n| (f64::from(n) * 1000.0 / rate).round() / 1000.0).collect();
            let timing = Timing::of_times(times).expect("times");
            assert!(timing.regular && (timing.rate_hz - rate).abs() < 0.002, "{rate}: {timing:?}");
            assert_eq!(timing.remark(), None);
        }
    }

    #[test]
    fn dropped_and_late_frames_leave_the_nominal_rate() {
        let times =
            (0..90).filter(|n| n % 7 != 3).map(|n| f64::from(n) / 30.0 + f64::from(n % 3) * 0.003).collect();
        let timing = Timing::of_times(times).expect("times");
        assert_eq!((timing.regular, timing.rate_hz), (false, 30.0));
        assert!(timing.remark().expect("a remark").contains("30.00 frames/s"));
    }

    #[test]
    fn one_frame_or_no_list_has_no_rate() {
        assert_eq!(Timing::of_times(vec![0.0]), None);
        assert_eq!(parsed("nothing"), None);
    }
}
