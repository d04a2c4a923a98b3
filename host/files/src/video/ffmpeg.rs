//! Any video through an installed ffmpeg with Y4M output.

use std::{
    io::{BufReader, ErrorKind, Read},
    path::{Path, PathBuf},
    process::{Child, ChildStdout, Command, Stdio},
    thread::JoinHandle,
};

use super::{VideoError, VideoFrame, timing::Timing, y4m::Y4m};

/// Characters of ffmpeg's messages quoted in errors.
const QUOTED_CHARS: usize = 400;

/// Frames of an ffmpeg process; dropping it ends the process.
struct Ffmpeg {
    path: PathBuf,
    child: Child,
    complaint: Option<JoinHandle<String>>,
    frames: Option<Y4m<BufReader<ChildStdout>>>,
}

pub(super) fn open(
    path: &Path,
    timing: Option<&Timing>,
) -> Result<impl Iterator<Item = Result<VideoFrame, VideoError>> + 'static, VideoError> {
    let child = Command::new("ffmpeg")
        .args(["-nostdin", "-v", "error", "-i"])
        .arg(path)
        .args(["-map", "0:v:0"])
        .args(timing.into_iter().flat_map(Timing::arguments))
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
    let complaint = child.stderr.take().map(|mut stderr| {
        std::thread::spawn(move || {
            let mut bytes = Vec::new();
            let _ = stderr.read_to_end(&mut bytes);
            String::from_utf8_lossy(&bytes).into_owned()
        })
    });
    let stdout = child.stdout.take();
    let mut ffmpeg = Ffmpeg { path: path.into(), child, complaint, frames: None };
    let stream = stdout.map(|stdout| Y4m::new(path, BufReader::new(stdout)));
    match stream {
        Some(Ok(frames)) => ffmpeg.frames = Some(frames),
        // Without a header ffmpeg's error is clearer than the parser's.
        Some(Err(error)) => return Err(ffmpeg.failure().unwrap_or(error)),
        None => return Err(ffmpeg.failure().unwrap_or(VideoError::NoFrames { path: path.into() })),
    }
    Ok(ffmpeg)
}

impl Ffmpeg {
    /// Waits for the end; `Some` on failure.
    fn failure(&mut self) -> Option<VideoError> {
        self.frames = None;
        let status = self.child.wait();
        let message = self.complaint.take().and_then(|thread| thread.join().ok()).unwrap_or_default();
        let message = message.trim();
        let tail = message.char_indices().rev().nth(QUOTED_CHARS).map_or(message, |(at, _)| &message[at..]);
        match status {
            Ok(status) if status.success() => None,
            Ok(status) => Some(VideoError::Ffmpeg {
                path: self.path.clone(),
                status: status.to_string(),
                message: tail.into(),
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
            Some(Err(error)) => Some(Err(self.failure().unwrap_or(error))),
            None => self.failure().map(Err),
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
