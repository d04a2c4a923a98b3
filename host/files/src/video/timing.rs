//! Frame times and the shape of pixels from ffmpeg's list of packets (without decoding), and the rate for reading. Browsers, phones and
//! meetings record at no constant rate, and their files state 1000 frames a second or none: ffmpeg would repeat frames. Of several video
//! streams ffmpeg's choice is read, by size and default mark.

use std::{
    path::Path,
    process::{Command, Stdio},
};

use super::ffmpeg::{ONE_VIDEO_STREAM, as_file};

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
/// Least deviation of a pixel from a square.
const SQUARE: f64 = 0.005;
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
    /// Time of the first frame after the start of the file.
    first_s: f64,
    /// Width of a pixel over its height.
    aspect: f64,
    /// Notice about the choice among several video streams.
    choice: Option<String>,
}

impl Timing {
    /// Times of the video stream that is read; `None` if ffmpeg cannot list them.
    pub fn of(path: &Path) -> Option<Self> {
        let listed = Command::new("ffmpeg")
            .args(["-nostdin", "-nostats", "-v", "info", "-i"])
            .arg(as_file(path))
            .args(ONE_VIDEO_STREAM)
            .args(["-c", "copy", "-f", "framecrc", "-"])
            .stdin(Stdio::null())
            .output()
            .ok()?;
        let packets = parsed(&String::from_utf8_lossy(&listed.stdout))?;
        Some(Self { choice: choice(&String::from_utf8_lossy(&listed.stderr)), ..packets.timing()? })
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
            first_s: times.first().copied().unwrap_or(0.0),
            longest_s: sorted.last().copied().unwrap_or(median),
            aspect: 1.0,
            choice: None,
        })
    }

    /// For regular intervals every frame comes once, regardless of its time; else the first frame is at 0.
    pub fn input_arguments(&self) -> [String; 2] {
        match self.regular {
            true => ["-r".into(), format!("{:.6}", self.rate_hz)],
            false => ["-itsoffset".into(), format!("{:.6}", -self.first_s)],
        }
    }

    /// Square pixels and, for irregular intervals, frames at the nominal rate by time stamp.
    pub fn output_arguments(&self) -> Vec<String> {
        let rate = format!("{:.6}", self.rate_hz);
        let times = (!self.regular).then(|| format!("fps={rate}"));
        let shape = (!self.is_square()).then(|| "scale=round(iw*sar):ih,setsar=1".to_owned());
        let filters: Vec<String> = times.into_iter().chain(shape).collect();
        let filters =
            (!filters.is_empty()).then(|| ["-vf".to_owned(), filters.join(",")]).into_iter().flatten();
        filters.chain(["-r".into(), rate]).collect()
    }

    fn is_square(&self) -> bool {
        (self.aspect - 1.0).abs() < SQUARE
    }

    /// Notice to the user about several streams, irregular times and pixels that are not square.
    pub fn remark(&self) -> Option<String> {
        let times = (!self.regular).then(|| {
            format!(
                "the frame rate varies: {} frames in {:.2} s, at most {:.2} s apart; resampled by their time stamps to {:.2} frames/s",
                self.frames, self.seconds, self.longest_s, self.rate_hz
            )
        });
        let shape = (!self.is_square()).then(|| {
            format!(
                "as stored, its pixels are {:.3} times as wide as high: the frames are scaled to square pixels",
                self.aspect
            )
        });
        let remarks: Vec<String> = self.choice.iter().cloned().chain(times).chain(shape).collect();
        (!remarks.is_empty()).then(|| remarks.join("; "))
    }
}

/// Which of several video streams is read, by ffmpeg's log:
/// `  Stream #0:1: Video: h264 (High), yuv420p, 480x270, 25 fps (default)` for each, and `  Stream #0:1 -> #0:0 (copy)`.
fn choice(log: &str) -> Option<String> {
    let (inputs, _) = log.split_once("Output #")?;
    let videos: Vec<&str> = streams(inputs)
        .filter(|text| text.contains(": Video: ") && !text.contains("(attached pic)"))
        .collect();
    let chosen = streams(log).find(|text| text.contains(" -> #0:0")).map(number)?;
    if videos.len() < 2 {
        return None;
    }
    let listed: Vec<String> =
        videos.iter().map(|text| format!("0:{} ({})", number(text), size(text))).collect();
    Some(format!(
        "it has {} video streams, {}: ffmpeg chose 0:{chosen} by size and default mark; for another one write it to a file \
         (ffmpeg -i VIDEO -map 0:NUMBER -c copy PART.mkv)",
        videos.len(),
        listed.join(", ")
    ))
}

fn streams(log: &str) -> impl Iterator<Item = &str> {
    log.lines().filter_map(|line| line.trim_start().strip_prefix("Stream #0:"))
}

/// Number at the begin of a stream's text.
fn number(text: &str) -> &str {
    text.split(|c: char| !c.is_ascii_digit()).next().unwrap_or_default()
}

fn size(text: &str) -> &str {
    let is_size = |word: &&str| {
        let sides = word.split_once('x').map(|(width, height)| [width, height]);
        // Not the code `0x31637661`.
        sides.is_some_and(|sides| sides.iter().all(|side| side.parse::<u32>().is_ok_and(|side| side > 0)))
    };
    text.split([' ', ',']).find(is_size).unwrap_or("of unknown size")
}

/// ffmpeg's list of packets.
#[derive(Debug, PartialEq)]
struct Listed {
    tick_s: f64,
    decoded: Vec<i64>,
    /// Packets of AVI files and MPEG program streams may have no presentation time.
    presented: Vec<i64>,
    aspect: f64,
}

impl Listed {
    /// By presentation times. If some are missing, regular decoding times are better: they begin before the first frame is
    /// shown, which counts for irregular ones only.
    fn timing(&self) -> Option<Timing> {
        let of = |ticks: &[i64]| {
            let timing = Timing::of_times(ticks.iter().map(|tick| *tick as f64 * self.tick_s).collect())?;
            Some(Timing { aspect: self.aspect, ..timing })
        };
        let is_whole = self.presented.len() >= self.decoded.len();
        let decoded = of(&self.decoded).filter(|timing| timing.regular && !is_whole);
        decoded.or_else(|| of(&self.presented)).or_else(|| of(&self.decoded))
    }
}

fn parsed(text: &str) -> Option<Listed> {
    /// ffmpeg's mark of a packet without a time.
    const NO_TIME: i64 = i64::MIN;
    let (mut tick_s, mut aspect) = (None, 1.0);
    let (mut decoded, mut presented) = (Vec::new(), Vec::new());
    let ratio = |text: &str| {
        let (over, under) = text.trim().split_once('/')?;
        let ratio = over.parse::<f64>().ok()? / under.parse::<f64>().ok()?;
        (ratio.is_finite() && ratio > 0.0).then_some(ratio)
    };
    for line in text.lines() {
        if let Some(base) = line.strip_prefix("#tb 0:") {
            tick_s = ratio(base);
        } else if let Some(shape) = line.strip_prefix("#sar 0:") {
            aspect = ratio(shape).unwrap_or(1.0);
        } else if !line.starts_with('#') {
            // Stream, decoding time, presentation time, duration, size, checksum.
            let mut times = line.split(',').skip(1).map(|cell| cell.trim().parse::<i64>());
            for ticks in [&mut decoded, &mut presented] {
                ticks.extend(times.next().and_then(Result::ok).filter(|tick| *tick != NO_TIME));
            }
        }
    }
    Some(Listed { tick_s: tick_s?, decoded, presented, aspect })
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
        let remark = timing.remark().expect("a remark");
        // The number of frames that can be decoded is not known yet.
        assert!(remark.ends_with("by their time stamps to 30.00 frames/s"), "{remark}");
    }

    #[test]
    fn decoding_times_replace_missing_presentation_times() {
        // As ffmpeg lists an AVI file with two B-frames between others: presentation times of the B-frames alone.
        let packet = |n: i64| {
            let presented = if n > 0 && n % 3 != 1 { n } else { i64::MIN };
            format!("0, {n}, {presented}, 1, 640, 0x96991d38, F=0x0\n")
        };
        let list = "#tb 0: 1/25\n".to_owned() + &(0..60).map(packet).collect::<String>();
        let timing = parsed(&list).expect("a list").timing().expect("times");
        assert_eq!((timing.regular, timing.rate_hz, timing.frames), (true, 25.0, 60));
    }

    #[test]
    fn irregular_decoding_times_replace_no_presentation_times() {
        let packet = |n: i64| {
            let time = 40 * n + 15 * (n % 3);
            let presented = if n == 30 { i64::MIN } else { time };
            format!("0, {}, {presented}, 40, 640, 0x96991d38\n", time - 80)
        };
        let list = "#tb 0: 1/1000\n".to_owned() + &(0..60).map(packet).collect::<String>();
        let timing = parsed(&list).expect("a list").timing().expect("times");
        assert_eq!((timing.regular, timing.first_s, timing.frames), (false, 0.0, 59));
    }

    #[test]
    fn packets_without_any_time_are_left_out_and_pixels_have_a_shape() {
        let listed = parsed(
            "#tb 0: 1/90000\n#sar 0: 64/45\n0, 0, 0, 3600, 28, 0xd3\n0, -9223372036854775808, -9223372036854775808, 3600, 11, 0xe3\n0, 3600, 3600, 3600, 9, 0x1\n",
        )
        .expect("a list");
        let ticks = vec![0, 3600];
        let expected =
            Listed { tick_s: 1.0 / 90_000.0, decoded: ticks.clone(), presented: ticks, aspect: 64.0 / 45.0 };
        assert_eq!(listed, expected);
        let wide = listed.timing().expect("times");
        assert_eq!(wide.output_arguments()[1], "scale=round(iw*sar):ih,setsar=1");
        assert!(wide.remark().expect("a remark").contains("1.422 times as wide"));
        // A video that is rotated when shown is scaled by the inverse ratio.
        let remark = Timing { aspect: 0.55, ..wide }.remark().expect("a remark");
        assert_eq!(
            remark,
            "as stored, its pixels are 0.550 times as wide as high: the frames are scaled to square pixels"
        );
        assert_eq!(parsed("#tb 0: 1/25\n#sar 0: 0/1\n").expect("a list").aspect, 1.0);
    }

    #[test]
    fn the_stream_that_is_read_is_reported_where_there_are_several() {
        let log = |streams: &str, chosen: u8| {
            format!(
                "Input #0, matroska,webm, from 'two.mkv':\n{streams}Output #0, framecrc, to 'pipe:':\n  Stream #0:0: Video: h264 \
                 (High), yuv420p, 480x270, q=2-31 (default)\nStream mapping:\n  Stream #0:{chosen} -> #0:0 (copy)\n"
            )
        };
        let small = "  Stream #0:0[0x1](und): Video: h264 (High) (avc1 / 0x31637661), yuv420p, 160x120 [SAR 1:1 DAR 4:3], 25 fps\n";
        let large = "  Stream #0:1: Video: h264 (High), yuv420p(tv, progressive), 480x270, 25 fps, 1k tbn (default)\n";
        let cover = "  Stream #0:2: Video: png, rgb24(pc), 600x600, 90k tbr (attached pic)\n";
        let sound = "  Stream #0:3: Audio: aac (LC), 44100 Hz, mono, fltp (default)\n";
        let remark = choice(&log(&[small, large, cover, sound].concat(), 1)).expect("a remark");
        assert!(
            remark.contains("2 video streams, 0:0 (160x120), 0:1 (480x270): ffmpeg chose 0:1"),
            "{remark}"
        );
        assert_eq!(choice(&log(&[small, cover, sound].concat(), 0)), None);
        assert_eq!(choice(""), None);
        let timing =
            Timing { choice: Some(remark), ..Timing::of_times(vec![0.0, 0.04, 0.08]).expect("times") };
        assert!(timing.remark().is_some_and(|remark| remark.contains("ffmpeg chose 0:1")));
    }

    #[test]
    fn one_frame_or_no_list_has_no_rate() {
        assert_eq!(Timing::of_times(vec![0.0]), None);
        assert_eq!(parsed("nothing"), None);
    }
}
