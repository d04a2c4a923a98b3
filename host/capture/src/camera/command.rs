//! A program as a camera: whatever writes pictures to its standard output, as YUV4MPEG2 (Y4M) or as raw frames of a size and format
//! that the user tells. `ffmpeg`, `rpicam-vid`, a maker's tool.
//!
//! The program runs from the moment the camera is opened. For a rig it must give one picture for each trigger (a camera in external-trigger
//! mode behind it): its pictures bear neither number nor time, so their order is all there is, and a picture too many or too few
//! makes the whole program of exposures an error.

use std::{
    io::{BufRead, BufReader, Read},
    process::{Child, ChildStdout, Command, Stdio},
    str::FromStr,
    sync::{
        Arc, Mutex, PoisonError,
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
    pairing::{Belongs, Pairing},
    pixels::Layout,
};
use crate::describe::trigger_name;

/// Pictures that wait to be fetched; then the program is held up, and memory stays bounded.
const QUEUE: usize = 16;
/// A program that cannot work mostly says so at once.
const EARLY_END: Duration = Duration::from_millis(300);
/// After the last picture of a program of exposures nothing may come for so long.
const QUIET: Duration = Duration::from_millis(200);
/// What is kept of the program's messages.
const MESSAGES: usize = 400;
/// No side may be longer: a damaged header must not ask for all memory.
const LONGEST_SIDE_PX: usize = 16_384;

/// A program, and what it writes.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct CommandLine {
    words: Vec<String>,
    /// Width, height and format of raw frames; Y4M where there is none.
    raw: Option<(usize, usize, Layout)>,
}

impl FromStr for CommandLine {
    type Err = String;

    /// `PROGRAM ARGUMENTS`, quoted as for a shell, or `WIDTHxHEIGHT:FORMAT:PROGRAM ARGUMENTS`.
    fn from_str(text: &str) -> Result<Self, String> {
        let size = |part: &str| {
            let (width, height) = part.split_once('x')?;
            Some((width.parse().ok()?, height.parse().ok()?))
        };
        let mut parts = text.splitn(3, ':');
        let raw = match (parts.next().and_then(size), parts.next(), parts.next()) {
            (Some((width, height)), Some(format), Some(program)) => Some((width, height, format, program)),
            (Some(_), ..) => {
                return Err("after a size expected a format and a program: 640x480:gray12le:PROGRAM".into());
            }
            (None, ..) => None,
        };
        let program = raw.map_or(text, |(_, _, _, program)| program);
        let words = shlex::split(program).ok_or("its quotes do not match")?;
        if words.is_empty() {
            return Err("expected a program".into());
        }
        let raw = match raw {
            Some((width, height, format, _)) => {
                if !(1..=LONGEST_SIDE_PX).contains(&width) || !(1..=LONGEST_SIDE_PX).contains(&height) {
                    return Err(format!("{width}x{height} px: expected 1 to {LONGEST_SIDE_PX} a side"));
                }
                Some((width, height, format.parse()?))
            }
            None => None,
        };
        Ok(Self { words, raw })
    }
}

/// A running program.
pub struct CommandCamera {
    /// The program's name, for messages.
    name: String,
    child: Child,
    frames: Receiver<Result<Image, String>>,
    /// The end of what the program wrote to its standard error.
    messages: Arc<Mutex<String>>,
    pairing: Pairing,
    /// Nothing more comes, and why.
    ended: Option<String>,
}

impl CommandCamera {
    /// Starts the program.
    ///
    /// # Errors
    /// [`CameraError::Unusable`] where it cannot be started or ends at once.
    pub fn start(line: &CommandLine) -> Result<Self, CameraError> {
        let name = line.words[0].clone();
        let unusable = |reason: String| CameraError::Unusable { camera: format!("`{name}`"), reason };
        let mut command = Command::new(&line.words[0]);
        command.args(&line.words[1..]);
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        // A group of its own, so that what the program starts ends with it, and Ctrl-C is ours to hear.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command.spawn().map_err(|error| match error.kind() {
            std::io::ErrorKind::NotFound => {
                unusable("there is no such program; is it installed, is its path right?".into())
            }
            _ => unusable(format!("it cannot be started: {error}")),
        })?;
        let (sender, frames) = sync_channel(QUEUE);
        let messages = Arc::new(Mutex::new(String::new()));
        let (output, errors) = (child.stdout.take(), child.stderr.take());
        let kept = Arc::clone(&messages);
        // Neither is waited for at the end: they end when the pipes do, or when nobody takes pictures any more.
        std::thread::spawn(move || errors.map(|errors| keep_messages(errors, &kept)));
        let raw = line.raw;
        std::thread::spawn(move || output.map(|output| read_frames(output, raw, &sender)));
        let mut camera = Self { name, child, frames, messages, pairing: Pairing::default(), ended: None };
        camera.take(EARLY_END)?;
        Ok(camera)
    }

    /// The next picture; `None` when time is up.
    fn take(&mut self, wait: Duration) -> Result<Option<Image>, CameraError> {
        if self.ended.is_none() {
            match self.frames.recv_timeout(wait) {
                Ok(Ok(image)) => return Ok(Some(image)),
                Err(RecvTimeoutError::Timeout) => return Ok(None),
                Ok(Err(reason)) => self.ended = Some(reason),
                Err(RecvTimeoutError::Disconnected) => self.ended = Some("it has ended".into()),
            }
        }
        Err(self.failed())
    }

    /// Why nothing more comes, with how the program ended and what it said.
    fn failed(&mut self) -> CameraError {
        let mut reason = self.ended.clone().unwrap_or_default();
        // Its output has ended or is of no use; a moment later it has mostly ended itself and said why. The thread that keeps its
        // messages holds them as long as there may be more.
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
        let said = self.messages.lock().unwrap_or_else(PoisonError::into_inner);
        if !said.trim().is_empty() {
            reason += &format!("; it said: {}", said.trim().replace('\n', " | "));
        }
        CameraError::Unusable { camera: format!("`{}`", self.name), reason }
    }

    /// Throws away what waits.
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
        // Of a program that runs freely nobody could tell which picture belongs to which exposure.
        if mode != TriggerMode::Hardware {
            return Err(CameraError::Trigger { camera: self.kind(), mode: trigger_name(mode) });
        }
        self.pairing.begin();
        self.drain()
    }

    fn trigger(&mut self, _: u32, _: Micros) -> Result<(), CameraError> {
        Err(CameraError::Trigger { camera: self.kind(), mode: trigger_name(TriggerMode::Software) })
    }

    fn image(&mut self, shot: &ShotRecord, wait: Duration) -> Result<Image, CameraError> {
        let camera = format!("`{}`", self.name);
        match self.take(wait)? {
            Some(image) => match self.pairing.judge(&camera, Stamp::default(), shot)? {
                Belongs::Here => Ok(image),
                Belongs::Earlier | Belongs::Later(_) => Err(CameraError::Surplus { camera }),
            },
            None => Err(CameraError::Late { camera, trigger_number: shot.trigger_number, waited: wait }),
        }
    }

    fn finish(&mut self) -> Result<(), CameraError> {
        match self.frames.recv_timeout(QUIET) {
            Ok(Ok(_)) => Err(CameraError::Surplus { camera: format!("`{}`", self.name) }),
            // A program that ends after its last picture has done what it was there for; the next one is told.
            Ok(Err(reason)) => {
                self.ended = Some(reason);
                Ok(())
            }
            Err(_) => Ok(()),
        }
    }

    fn watch(&mut self) -> Result<(), CameraError> {
        self.drain()
    }

    fn newest(&mut self, wait: Duration) -> Result<Option<Frame>, CameraError> {
        let Some(mut image) = self.take(wait)? else { return Ok(None) };
        for _ in 0..QUEUE {
            match self.frames.try_recv() {
                Ok(Ok(newer)) => image = newer,
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
        // Killed, it ends at once; waited for, it leaves no zombie.
        let _ = self.child.wait();
    }
}

fn keep_messages(errors: impl Read, kept: &Mutex<String>) {
    for line in BufReader::new(errors).split(b'\n').map_while(Result::ok) {
        let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
        kept.push_str(&String::from_utf8_lossy(&line));
        kept.push('\n');
        let surplus = kept.len().saturating_sub(MESSAGES);
        let cut = (surplus..=kept.len()).find(|at| kept.is_char_boundary(*at)).unwrap_or(0);
        kept.drain(..cut);
    }
}

/// Sends frames until there are none any more, or nobody takes them; at last why there are none.
fn read_frames(
    output: ChildStdout,
    raw: Option<(usize, usize, Layout)>,
    frames: &SyncSender<Result<Image, String>>,
) {
    let mut output = BufReader::with_capacity(1 << 16, output);
    let reason = match raw {
        Some((width, height, layout)) => read_raw(&mut output, width, height, layout, frames),
        None => read_y4m(output, frames),
    };
    if let Some(reason) = reason {
        let _ = frames.send(Err(reason)); // nobody takes them any more: nobody asks why
    }
}

/// Gives why it ended; nothing where nobody takes frames any more.
fn read_raw(
    output: &mut impl Read,
    width: usize,
    height: usize,
    layout: Layout,
    frames: &SyncSender<Result<Image, String>>,
) -> Option<String> {
    let due = layout.frame_bytes(width, height)?;
    for number in 1.. {
        let mut bytes = Vec::with_capacity(due);
        if let Err(error) = output.by_ref().take(due as u64).read_to_end(&mut bytes) {
            return Some(format!("its output cannot be read: {error}"));
        }
        match bytes.len() {
            0 => return Some("its output has ended".into()),
            came if came < due => {
                return Some(format!(
                    "its output ends within frame {number}, after {came} of {due} bytes; are {width}x{height} px and the format right?"
                ));
            }
            _ => {}
        }
        match layout.decode(&bytes, width, height) {
            Ok(image) => frames.send(Ok(image)).ok()?,
            Err(error) => {
                return Some(format!("frame {number}: {error}; are the size and the format right?"));
            }
        }
    }
    None
}

fn read_y4m(
    mut output: BufReader<ChildStdout>,
    frames: &SyncSender<Result<Image, String>>,
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
            Ok(image) => frames.send(Ok(image)).ok()?,
            Err(reason) => return Some(format!("frame {number} is damaged: {reason}")),
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_is_split_as_a_shell_does_and_raw_frames_have_a_size() {
        let line: CommandLine = "ffmpeg -i 'my clip.mkv' -f yuv4mpegpipe -".parse().unwrap();
        assert_eq!(line.words, ["ffmpeg", "-i", "my clip.mkv", "-f", "yuv4mpegpipe", "-"]);
        assert_eq!(line.raw, None);
        let line: CommandLine = "640x480:gray12le:grab --url http://a:80/x".parse().unwrap();
        assert_eq!(line.words, ["grab", "--url", "http://a:80/x"]);
        assert_eq!(line.raw, Some((640, 480, Layout::Grey16 { bits: 12 })));
        for (text, phrase) in [
            ("", "expected a program"),
            ("a 'b", "quotes"),
            ("640x480:grey:a", "gray10le"),
            ("640x480:gray", "a program"),
            ("0x480:gray:a", "expected 1 to"),
            ("99999x480:gray:a", "expected 1 to"),
        ] {
            let error = text.parse::<CommandLine>().unwrap_err();
            assert!(error.contains(phrase), "{text}: {error}");
        }
    }
}
