//! Any video through an installed ffmpeg with Y4M output.

use std::{
    io::{BufRead, BufReader, ErrorKind},
    path::{Path, PathBuf},
    process::{Child, ChildStdout, Command, Stdio},
    thread::JoinHandle,
};

use super::{VideoError, VideoFrame, timing::Timing, y4m::Y4m};

/// Without `-map` ffmpeg chooses a stream of each kind.
pub(super) const ONE_VIDEO_STREAM: [&str; 3] = ["-an", "-sn", "-dn"];
/// Errors quoted from ffmpeg's log.
const QUOTED: usize = 3;
/// Relative difference of two shapes of a frame.
const SAME_SHAPE: f64 = 0.02;

/// Frames of an ffmpeg process; dropping it ends the process.
pub(super) struct Ffmpeg {
    path: PathBuf,
    child: Child,
    log: Option<JoinHandle<Log>>,
    frames: Option<Y4m<BufReader<ChildStdout>>>,
    /// Notices about the decoding; complete at the end.
    pub remarks: Vec<String>,
}

/// Contents of ffmpeg's log.
#[derive(Debug, Default, PartialEq)]
struct Log {
    errors: usize,
    quoted: Vec<String>,
    last_line: String,
    /// Width, height and ratio of width to height as shown, each time they changed.
    sizes: Vec<(usize, usize, f64)>,
}

impl Log {
    fn of(lines: impl Iterator<Item = String>) -> Self {
        let mut log = Self::default();
        for line in lines {
            if let Some((_, error)) = line.split_once("[error] ").or_else(|| line.split_once("[fatal] ")) {
                log.errors += 1;
                if log.quoted.len() < QUOTED {
                    log.quoted.push(error.trim().to_owned());
                }
            }
            if !line.trim().is_empty() {
                log.last_line.clone_from(&line);
            }
            if let Some(size) = input_size(&line).filter(|size| log.sizes.last() != Some(size)) {
                log.sizes.push(size);
            }
        }
        log
    }

    fn is_turned(&self) -> bool {
        let ratios = self.sizes.iter().map(|(.., ratio)| ratio);
        let first = self.sizes.first().map_or(1.0, |(.., ratio)| *ratio);
        ratios.into_iter().any(|ratio| (ratio / first - 1.0).abs() > SAME_SHAPE)
    }

    fn sizes(&self) -> String {
        self.sizes.iter().map(|(width, height, _)| format!("{width}x{height}")).collect::<Vec<_>>().join(", ")
    }

    fn remarks(&self) -> Vec<String> {
        let damaged = (self.errors > 0).then(|| {
            format!(
                "ffmpeg reports {} errors ({}): frames are missing or damaged",
                self.errors,
                self.quoted.join("; ")
            )
        });
        let sizes = (self.sizes.len() > 1)
            .then(|| format!("its size changes ({}); all frames are scaled to the first", self.sizes()));
        damaged.into_iter().chain(sizes).collect()
    }
}

/// Size of the decoded frames in the line that ffmpeg writes when it sets up its filters:
/// `[graph 0 input from stream 0:0 @ 0x55] [verbose] w:160 h:120 pixfmt:yuv420p tb:1/1000 fr:25/1 sar:1/1`.
fn input_size(line: &str) -> Option<(usize, usize, f64)> {
    let (_, fields) = line.split_once("input from stream").filter(|_| line.starts_with("[graph "))?;
    let field = |name: &str| fields.split(' ').find_map(|field| field.strip_prefix(name));
    let (width, height) = (field("w:")?.parse().ok()?, field("h:")?.parse().ok()?);
    let (over, under) = field("sar:")?.split_once('/')?;
    let (over, under): (f64, f64) = (over.parse().ok()?, under.trim().parse().ok()?);
    let aspect = if over > 0.0 && under > 0.0 { over / under } else { 1.0 };
    Some((width, height, aspect * width as f64 / height as f64))
}

pub(super) fn open(path: &Path, timing: Option<&Timing>) -> Result<Ffmpeg, VideoError> {
    let child = Command::new("ffmpeg")
        .args(["-nostdin", "-nostats", "-loglevel", "level+verbose"])
        .args(timing.into_iter().flat_map(Timing::input_arguments))
        .arg("-i")
        .arg(as_file(path))
        .args(ONE_VIDEO_STREAM)
        .args(timing.into_iter().flat_map(Timing::output_arguments))
        .args(["-pix_fmt", "yuv444p", "-f", "yuv4mpegpipe", "-"])
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn();
    let mut child = child.map_err(|source| match source.kind() {
        ErrorKind::NotFound => VideoError::NoFfmpeg { path: path.into() },
        _ => VideoError::io(path, source),
    })?;
    // Read in its own thread, so that ffmpeg never blocks on the pipe.
    let log = child.stderr.take().map(|stderr| {
        let lines = BufReader::new(stderr).split(b'\n').map_while(Result::ok);
        std::thread::spawn(|| Log::of(lines.map(|line| String::from_utf8_lossy(&line).into_owned())))
    });
    let stdout = child.stdout.take();
    let mut ffmpeg = Ffmpeg { path: path.into(), child, log, frames: None, remarks: Vec::new() };
    let stream = stdout.map(|stdout| Y4m::new(path, BufReader::new(stdout)));
    match stream {
        Some(Ok(frames)) => ffmpeg.frames = Some(frames),
        // Without a header ffmpeg's error is clearer than the parser's.
        Some(Err(error)) => return Err(ffmpeg.end().unwrap_or(error)),
        None => return Err(ffmpeg.end().unwrap_or(VideoError::NoFrames { path: path.into() })),
    }
    Ok(ffmpeg)
}

/// ffmpeg takes the text before a colon for a protocol.
pub(super) fn as_file(path: &Path) -> PathBuf {
    if path.is_relative() { Path::new(".").join(path) } else { path.into() }
}

impl Ffmpeg {
    /// Waits for the end; `Some` on failure.
    fn end(&mut self) -> Option<VideoError> {
        self.frames = None;
        let status = self.child.wait();
        let log = self.log.take().and_then(|thread| thread.join().ok()).unwrap_or_default();
        match status {
            Ok(status) if status.success() && log.is_turned() => {
                Some(VideoError::Turned { path: self.path.clone(), sizes: log.sizes() })
            }
            Ok(status) if status.success() => {
                self.remarks = log.remarks();
                None
            }
            Ok(status) => Some(VideoError::Ffmpeg {
                path: self.path.clone(),
                status: status.to_string(),
                message: if log.errors > 0 { log.quoted.join("; ") } else { log.last_line },
            }),
            Err(source) => Some(VideoError::io(&self.path, source)),
        }
    }
}

impl Iterator for Ffmpeg {
    type Item = Result<VideoFrame, VideoError>;

    fn next(&mut self) -> Option<Self::Item> {
        match self.frames.as_mut()?.next() {
            Some(Ok(frame)) => Some(Ok(frame)),
            Some(Err(error)) => Some(Err(self.end().unwrap_or(error))),
            None => self.end().map(Err),
        }
    }
}

impl Drop for Ffmpeg {
    fn drop(&mut self) {
        if self.frames.is_some() {
            // It may have ended already.
            let _ = self.child.kill();
            let _ = self.child.wait();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn log(lines: &[&str]) -> Log {
        Log::of(lines.iter().map(ToString::to_string))
    }

    #[test]
    fn a_change_of_size_is_read_from_the_log() {
        let line = |size: &str, sar: &str| {
            format!(
                "[graph 0 input from stream 0:0 @ 0x55] [verbose] {size} pixfmt:yuv420p tb:1/25 fr:25/1 sar:{sar}"
            )
        };
        let lines = [line("w:160 h:120", "1/1"), line("w:160 h:120", "0/1"), line("w:320 h:240", "1/1")];
        let grown = log(&lines.each_ref().map(String::as_str));
        assert!(!grown.is_turned());
        assert_eq!(
            grown.remarks(),
            ["its size changes (160x120, 320x240); all frames are scaled to the first"]
        );
        assert!(log(&[&lines[0], &line("w:120 h:160", "1/1")]).is_turned());
        assert!(log(&[&line("w:720 h:576", "64/45"), &line("w:720 h:576", "16/15")]).is_turned());
    }

    #[test]
    fn errors_are_counted_and_the_first_are_quoted() {
        let errors =
            ["[h264 @ 0x55] [error] a", "[info] x", "[error] b", "[fatal] c", "[warning] y", "[error] d"];
        let remarks = log(&errors).remarks();
        assert_eq!(remarks, ["ffmpeg reports 4 errors (a; b; c): frames are missing or damaged"]);
        assert!(log(&["[warning] y", "[info] [error]"]).remarks().is_empty());
    }
}
