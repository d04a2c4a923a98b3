//! A program as a camera: `ffmpeg`, `rpicam-vid` or vendor tools that write Y4M or raw frames of a given size and
//! format to standard output, one per trigger (external-trigger mode), while the camera is open. Pictures have neither
//! number nor time, only their order: a surplus or missing one fails the whole program of exposures.

use std::{
    io::{BufRead, BufReader, Read},
    process::{Child, ChildStdout, Command, Stdio},
    str::FromStr,
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicUsize, Ordering},
        mpsc::{Receiver, RecvTimeoutError, SyncSender, TryRecvError, sync_channel},
    },
    time::{Duration, Instant},
};

use farnear_protocol::{
    message::{ShotRecord, TriggerMode},
    units::Micros,
};

use super::{
    Camera, CameraError, Frame, Image, Stamp,
    pairing::{Belongs, Evidence, Pairing, content},
    pixels::{BadFrame, Layout},
};
use crate::describe::trigger_name;

/// Picture queue; a full queue blocks the program and bounds the memory.
const QUEUE: usize = 16;
/// Programs that cannot work usually end within this time.
const EARLY_END: Duration = Duration::from_millis(300);
const MESSAGES: usize = 400;
const LONGEST_SIDE_PX: usize = 16_384;

#[derive(Clone, PartialEq, Eq, Debug)]
pub struct CommandLine {
    words: Vec<String>,
    /// Raw frame format; `None`: Y4M.
    raw: Option<Raw>,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct Raw {
    width: usize,
    height: usize,
    stride: usize,
    layout: Layout,
}

impl Raw {
    fn new(width: usize, height: usize, stride: Option<usize>, layout: Layout) -> Result<Self, String> {
        if !(1..=LONGEST_SIDE_PX).contains(&width) || !(1..=LONGEST_SIDE_PX).contains(&height) {
            return Err(format!("{width}x{height} px: expected 1 to {LONGEST_SIDE_PX} a side"));
        }
        let row = layout.row_bytes(width).unwrap_or(width);
        let stride = stride.unwrap_or(row);
        if !(row..=8 * LONGEST_SIDE_PX).contains(&stride)
            || !stride.is_multiple_of(layout.row_bytes(1).unwrap_or(1))
        {
            return Err(format!("a stride of {stride} bytes: a row of {width} px has {row} bytes"));
        }
        Ok(Self { width, height, stride, layout })
    }

    fn bytes(self) -> Option<usize> {
        self.layout.padded_frame_bytes(self.stride, self.height)
    }

    fn decode(self, bytes: &[u8]) -> Result<Image, BadFrame> {
        let Self { width, height, stride, layout } = self;
        if layout.row_bytes(width) == Some(stride) {
            return layout.decode(bytes, width, height);
        }
        let bytes = layout.without_padding(bytes, width, height, stride)?;
        // The colour planes are ignored.
        let layout =
            if let Layout::Grey8 { .. } = layout { Layout::Grey8 { colour_twelfths: 0 } } else { layout };
        layout.decode(&bytes, width, height)
    }

    fn padding_hint(self) -> String {
        let Self { width, height, layout, .. } = self;
        let row = layout.row_bytes(width).unwrap_or(width);
        let padded = row.div_ceil(PADDING) * PADDING;
        let format = RAW_FORMAT;
        match padded == row {
            true => format!("are size, stride and format right ({format})?"),
            false => format!(
                "a row of {width} px has {row} bytes; programs often pad rows to a multiple of {PADDING} bytes: \
                 if so, name the stride, {width}x{height}/{padded} ({format})"
            ),
        }
    }
}

/// Row padding of the Raspberry Pi's programs and many others.
const PADDING: usize = 64;
const RAW_FORMAT: &str = "WIDTHxHEIGHT[/STRIDE]:FORMAT:PROGRAM";

impl FromStr for CommandLine {
    type Err = String;

    /// `PROGRAM ARGUMENTS` with shell quoting, or `WIDTHxHEIGHT[/STRIDE]:FORMAT:PROGRAM ARGUMENTS`.
    fn from_str(text: &str) -> Result<Self, String> {
        let size = |part: &str| {
            let (width, height) = part.split_once('x')?;
            let (height, stride) = match height.split_once('/') {
                Some((height, stride)) => (height, Some(stride.parse().ok()?)),
                None => (height, None),
            };
            Some((width.parse().ok()?, height.parse().ok()?, stride))
        };
        let mut parts = text.splitn(3, ':');
        let raw = match (parts.next().and_then(size), parts.next(), parts.next()) {
            (Some(size), Some(format), Some(program)) => Some((size, format, program)),
            (Some(_), ..) => {
                return Err("after a size expected a format and a program: 640x480:gray12le:PROGRAM".into());
            }
            (None, ..) => None,
        };
        let program = raw.map_or(text, |(.., program)| program);
        let words = shlex::split(program).ok_or("its quotes do not match")?;
        if words.is_empty() {
            return Err("expected a program".into());
        }
        let raw = match raw {
            Some(((width, height, stride), format, _)) => {
                Some(Raw::new(width, height, stride, format.parse()?)?)
            }
            None => None,
        };
        Ok(Self { words, raw })
    }
}

type Arrived = (Image, Instant);

pub struct CommandCamera {
    name: String,
    child: Child,
    frames: Receiver<Result<Arrived, String>>,
    partial: Arc<AtomicUsize>,
    raw: Option<Raw>,
    /// End of the program's standard error.
    messages: Arc<Mutex<Vec<u8>>>,
    pairing: Pairing,
    ended: Option<String>,
}

impl CommandCamera {
    /// Starts the program. Fails if it cannot start or ends immediately.
    pub fn start(line: &CommandLine) -> Result<Self, CameraError> {
        let name = line.words[0].clone();
        let unusable = |reason: String| CameraError::Unusable { camera: format!("`{name}`"), reason };
        let mut command = Command::new(&line.words[0]);
        command.args(&line.words[1..]);
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        // Own process group: grandchildren end with it, and Ctrl-C goes to this program only.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        #[cfg(windows)] // CREATE_NEW_PROCESS_GROUP
        std::os::windows::process::CommandExt::creation_flags(&mut command, 0x200);
        let mut child = command.spawn().map_err(|error| match error.kind() {
            std::io::ErrorKind::NotFound => {
                unusable("no such program; check its path and installation".into())
            }
            _ => unusable(format!("it cannot be started: {error}")),
        })?;
        let (sender, frames) = sync_channel(QUEUE);
        let messages = Arc::new(Mutex::new(Vec::new()));
        let (output, errors) = (child.stdout.take(), child.stderr.take());
        let kept = Arc::clone(&messages);
        // Not joined: these threads end with the pipes or the receiver.
        std::thread::spawn(move || errors.map(|errors| keep_messages(errors, &kept)));
        let raw = line.raw;
        let partial = Arc::new(AtomicUsize::new(0));
        let incoming = Arc::clone(&partial);
        std::thread::spawn(move || output.map(|output| read_frames(output, raw, &sender, &incoming)));
        let pairing = Pairing::default();
        let mut camera = Self { name, child, frames, partial, raw, messages, pairing, ended: None };
        camera.take(EARLY_END)?;
        Ok(camera)
    }

    /// The next picture; `None` at the timeout.
    fn take(&mut self, wait: Duration) -> Result<Option<Arrived>, CameraError> {
        if self.ended.is_none() {
            match self.frames.recv_timeout(wait) {
                Ok(Ok(arrived)) => return Ok(Some(arrived)),
                Err(RecvTimeoutError::Timeout) => return Ok(None),
                Ok(Err(reason)) => self.ended = Some(reason),
                Err(RecvTimeoutError::Disconnected) => self.ended = Some("it has ended".into()),
            }
        }
        Err(self.failed())
    }

    /// Why no more frames come, with exit status and messages.
    fn failed(&mut self) -> CameraError {
        let mut reason = self.ended.clone().unwrap_or_default();
        // The program usually ends shortly after its output and explains why. The message thread holds an `Arc` until
        // then.
        let until = Instant::now() + EARLY_END;
        let status = loop {
            let status = self.child.try_wait().ok().flatten();
            let said_all = Arc::strong_count(&self.messages) == 1;
            if (status.is_some() && said_all) || Instant::now() >= until {
                break status;
            }
            std::thread::sleep(Duration::from_millis(10));
        };
        if let Some(status) = status {
            reason += &format!(" ({status})");
        }
        let messages = self.messages.lock().unwrap_or_else(PoisonError::into_inner);
        let messages = String::from_utf8_lossy(&messages);
        // A progress display ends its lines with a carriage return.
        let lines = messages.split(['\n', '\r']).map(str::trim).filter(|line| !line.is_empty());
        let lines: Vec<&str> = lines.collect();
        if !lines.is_empty() {
            reason += &format!("; it said: {}", lines.join(" | "));
        }
        CameraError::Unusable { camera: format!("`{}`", self.name), reason }
    }

    fn drain(&mut self) -> Result<(), CameraError> {
        while self.take(Duration::ZERO)?.is_some() {}
        Ok(())
    }
}

impl Camera for CommandCamera {
    fn kind(&self) -> &'static str {
        "command"
    }

    fn arm(&mut self, mode: TriggerMode, _: Micros) -> Result<(), CameraError> {
        // Pictures of a free-running program cannot be assigned to exposures.
        if mode != TriggerMode::Hardware {
            return Err(CameraError::Trigger { camera: self.kind(), mode: trigger_name(mode) });
        }
        self.pairing.begin();
        self.drain()
    }

    fn pairs_by_frames_before(&self) -> bool {
        true
    }

    fn trigger(&mut self, _: u32, _: Micros) -> Result<(), CameraError> {
        Err(CameraError::Trigger { camera: self.kind(), mode: trigger_name(TriggerMode::Software) })
    }

    fn image(&mut self, shot: &ShotRecord, wait: Duration) -> Result<Image, CameraError> {
        let camera = format!("`{}`", self.name);
        match self.take(wait)? {
            Some((image, arrived)) => {
                let evidence =
                    Evidence { arrived: Some(arrived), content: content(&image), ..Evidence::default() };
                match self.pairing.judge(&camera, evidence, shot)? {
                    Belongs::Here => Ok(image),
                    Belongs::Earlier | Belongs::Later(_) => Err(CameraError::Surplus { camera }),
                }
            }
            None => Err(CameraError::Late { camera, trigger_number: shot.trigger_number, waited: wait }),
        }
    }

    fn reported(&mut self, shot: &ShotRecord, received: Instant) {
        self.pairing.reported(shot, received);
    }

    fn quiet_time(&self) -> Duration {
        self.pairing.quiet_time()
    }

    fn finish(&mut self, wait: Duration) -> Result<(), CameraError> {
        match self.frames.recv_timeout(wait) {
            Ok(Ok(_)) => return Err(CameraError::Surplus { camera: format!("`{}`", self.name) }),
            // The program may end after its last picture; the next one reports it.
            Ok(Err(reason)) => self.ended = Some(reason),
            Err(RecvTimeoutError::Timeout) => {}
            // The channel of an ended program does not block.
            Err(RecvTimeoutError::Disconnected) => std::thread::sleep(wait),
        }
        match (self.partial.load(Ordering::Relaxed), self.raw) {
            (0, _) | (_, None) => Ok(()),
            (bytes, Some(raw)) => {
                let reason =
                    format!("{bytes} bytes are left over after the last picture; {}", raw.padding_hint());
                Err(CameraError::Unusable { camera: format!("`{}`", self.name), reason })
            }
        }
    }

    fn watch(&mut self) -> Result<(), CameraError> {
        self.drain()
    }

    fn newest(&mut self, wait: Duration) -> Result<Option<Frame>, CameraError> {
        let Some((mut image, _)) = self.take(wait)? else { return Ok(None) };
        for _ in 0..QUEUE {
            match self.frames.try_recv() {
                Ok(Ok((newer, _))) => image = newer,
                Ok(Err(reason)) => self.ended = Some(reason),
                Err(TryRecvError::Empty | TryRecvError::Disconnected) => break,
            }
        }
        Ok(Some(Frame { image, stamp: Stamp::default() }))
    }
}

impl Drop for CommandCamera {
    fn drop(&mut self) {
        #[cfg(unix)]
        if let Ok(Some(group)) = i32::try_from(self.child.id()).map(rustix::process::Pid::from_raw) {
            let _ = rustix::process::kill_process_group(group, rustix::process::Signal::KILL);
        }
        let _ = self.child.kill();
        // Reaps the killed process, so that no zombie remains.
        let _ = self.child.wait();
    }
}

/// Keeps the end. Not by lines, because a program may never end one.
fn keep_messages(mut errors: impl Read, kept: &Mutex<Vec<u8>>) {
    let mut bytes = [0; 4096];
    loop {
        let count = match errors.read(&mut bytes) {
            Ok(0) => return,
            Ok(count) => count,
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => continue,
            Err(_) => return,
        };
        let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
        kept.extend_from_slice(&bytes[..count]);
        let surplus = kept.len().saturating_sub(MESSAGES);
        let within_a_letter = kept[surplus..].iter().take_while(|byte| **byte & 0xc0 == 0x80).count();
        kept.drain(..surplus + within_a_letter);
    }
}

/// Sends frames until the program or the receiver ends, then the reason.
fn read_frames(
    output: ChildStdout,
    raw: Option<Raw>,
    frames: &SyncSender<Result<Arrived, String>>,
    partial: &AtomicUsize,
) {
    let mut output = BufReader::with_capacity(1 << 16, output);
    let reason = match raw {
        Some(raw) => read_raw(&mut output, raw, frames, partial),
        None => read_y4m(output, frames),
    };
    if let Some(reason) = reason {
        let _ = frames.send(Err(reason)); // the receiver may have gone
    }
}

/// Returns why the program ended; `None` if the receiver has gone.
fn read_raw(
    output: &mut impl Read,
    raw: Raw,
    frames: &SyncSender<Result<Arrived, String>>,
    partial: &AtomicUsize,
) -> Option<String> {
    let Raw { width, height, .. } = raw;
    let due = raw.bytes()?;
    let mut bytes = vec![0; due];
    for number in 1.. {
        let mut filled = 0;
        while filled < due {
            match output.read(&mut bytes[filled..]) {
                Ok(0) => break,
                Ok(count) => filled += count,
                Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
                Err(error) => return Some(format!("its output cannot be read: {error}")),
            }
            partial.store(filled % due, Ordering::Relaxed);
        }
        let arrived = Instant::now();
        match filled {
            0 => return Some("its output has ended".into()),
            came if came < due => {
                return Some(format!(
                    "its output ends within frame {number}, after {came} of {due} bytes of {width}x{height} px; {}",
                    raw.padding_hint()
                ));
            }
            _ => {}
        }
        match raw.decode(&bytes) {
            Ok(image) => frames.send(Ok((image, arrived))).ok()?,
            Err(error) => {
                return Some(format!("frame {number}: {error}; {}", raw.padding_hint()));
            }
        }
    }
    None
}

fn read_y4m(
    mut output: BufReader<ChildStdout>,
    frames: &SyncSender<Result<Arrived, String>>,
) -> Option<String> {
    let begins = match output.fill_buf() {
        Ok([]) => return Some("it has ended without a picture".into()),
        Ok(bytes) => String::from_utf8_lossy(&bytes[..bytes.len().min(16)]).into_owned(),
        Err(error) => return Some(format!("its output cannot be read: {error}")),
    };
    let limits = y4m::Limits { bytes: 6 * LONGEST_SIDE_PX * LONGEST_SIDE_PX };
    let mut decoder = match y4m::Decoder::new_with_limits(output, limits) {
        Ok(decoder) => decoder,
        Err(y4m::Error::UnknownColorspace) => {
            return Some(
                "its Y4M has another colour space than mono, 420, 422 and 444 of 8, 10 or 12 bits; raw frames may have more".into(),
            );
        }
        Err(error) => {
            return Some(format!(
                "its output is not Y4M ({error}; it begins with {begins:?}); raw frames need their size and format"
            ));
        }
    };
    let (width, height) = (decoder.get_width(), decoder.get_height());
    let layout = match decoder.get_bit_depth() {
        8 => Layout::Grey8 { colour_twelfths: 0 },
        bits => Layout::Grey16 { bits: bits as u8 },
    };
    for number in 1.. {
        let image = match decoder.read_frame() {
            Ok(frame) => layout.decode(frame.get_y_plane(), width, height).map_err(|error| error.to_string()),
            Err(y4m::Error::EOF) => return Some("its output has ended".into()),
            Err(error) => Err(error.to_string()),
        };
        match image {
            Ok(image) => frames.send(Ok((image, Instant::now()))).ok()?,
            Err(reason) => return Some(format!("frame {number} is damaged: {reason}")),
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Standard error without a line's end. What came so far is kept by the second read.
    struct Endless<'a>(&'a Mutex<Vec<u8>>, usize);

    impl Read for Endless<'_> {
        fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
            self.1 += 1;
            let kept = self.0.lock().unwrap().len();
            assert!(kept <= MESSAGES && (kept > 0 || self.1 == 1), "{kept} bytes at read {}", self.1);
            let text = "\u{fc}".repeat(MESSAGES);
            match self.1 {
                1..9 => text.as_bytes().read(buffer),
                9 => b"the end".as_slice().read(buffer),
                _ => Ok(0),
            }
        }
    }

    #[test]
    fn messages_without_a_line_end_are_kept_and_bounded() {
        let kept = Mutex::new(Vec::new());
        keep_messages(Endless(&kept, 0), &kept);
        let kept = String::from_utf8(kept.into_inner().unwrap()).unwrap();
        assert!(kept.ends_with("the end") && kept.len() > MESSAGES / 2, "{kept}");
    }

    #[test]
    fn splits_commands_like_a_shell_and_parses_raw_formats() {
        let line: CommandLine = "ffmpeg -i 'my clip.mkv' -f yuv4mpegpipe -".parse().unwrap();
        assert_eq!(line.words, ["ffmpeg", "-i", "my clip.mkv", "-f", "yuv4mpegpipe", "-"]);
        assert_eq!(line.raw, None);
        let line: CommandLine = "640x480:gray12le:grab --url http://a:80/x".parse().unwrap();
        assert_eq!(line.words, ["grab", "--url", "http://a:80/x"]);
        assert_eq!(line.raw, Some(Raw::new(640, 480, None, Layout::Grey16 { bits: 12 }).unwrap()));
        let padded: CommandLine = "1456x1088/1472:yuv420p:rpicam-vid".parse().unwrap();
        assert_eq!(padded.raw.unwrap().bytes(), Some(1472 * 1088 * 3 / 2));
        for (text, phrase) in [
            ("", "expected a program"),
            ("a 'b", "quotes"),
            ("640x480:grey:a", "gray10le"),
            ("640x480:gray", "a program"),
            ("0x480:gray:a", "expected 1 to"),
            ("99999x480:gray:a", "expected 1 to"),
            ("640x480/639:gray:a", "a row of 640 px has 640 bytes"),
        ] {
            let error = text.parse::<CommandLine>().unwrap_err();
            assert!(error.contains(phrase), "{text}: {error}");
        }
    }
}
