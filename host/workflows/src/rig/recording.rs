//! Recorded live depth: pairs with times and optics in one file. Playback computes depth again, at the
//! recorded pace or as fast as possible.
//!
//! File format, little-endian:
//! ```text
//! "FNPAIRS1" | u32 length of the optics | optics (TOML) | pairs
//! pair: u64 microseconds since the first | u16 width | u16 height | u8 bits | far: u16 per pixel | near: u16 per pixel
//! ```

use std::{
    fs::{self, File},
    io::{BufReader, ErrorKind, Read, Write},
    path::{Path, PathBuf},
    sync::mpsc::{self, Receiver, SyncSender},
    thread,
    time::{Duration, Instant},
};

use farnear_capture::camera::{Image, pixels::Layout};
use farnear_depth::{measure::Measurement, optics::Optics, stream::Stream};
use farnear_files::staging::{StagingError, rename};
use ndarray::Array2;
use serde::Serialize;

use super::live_depth::{LiveDepth, measure, stream};
use crate::{
    context::Context,
    error::{Result, WorkflowError},
    figures::rounded,
    optics::{GivenOptics, another_size},
    quantile,
};

const MAGIC: &[u8; 8] = b"FNPAIRS1";
const EXPECTED: &str = "recorded pairs";
/// Longest recording: 2.5 GB at 640x480 px.
pub const PAIRS_MAX: usize = 2000;
const OPTICS_MAX: u32 = 1 << 20;
const PIXELS_MAX: usize = 1 << 26;
/// Pairs of each lane that are read before they are due.
const AHEAD: usize = 2;
/// Pairs that are computed at once in fast play. Two pairs on one thread each end sooner than one after the other on two.
const LANES: usize = 2;
const LOOK: Duration = Duration::from_millis(20);

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct RecordingFigures {
    pub pairs: usize,
    pub seconds: f64,
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct PlayFigures {
    pub pairs: usize,
    /// Their two images show different scenes: no depth.
    pub unrelated_pairs: usize,
    /// Over the computing time.
    pub maps_per_second: f64,
    /// Median, from a pair's grey values to its map, by the host's clock.
    pub latency_ms: f64,
    pub seconds: f64,
}

pub struct Recorder {
    file: File,
    /// Length of the header and complete pairs.
    whole_bytes: u64,
    partial: PathBuf,
    target: PathBuf,
    begin: Option<Instant>,
    last: Duration,
    pairs: usize,
    finished: bool,
}

impl Recorder {
    pub fn begin(target: &Path, optics: &GivenOptics) -> Result<Self> {
        let folder = target.parent().unwrap_or(Path::new("."));
        fs::create_dir_all(folder)
            .map_err(|source| WorkflowError::Folder { folder: folder.into(), source })?;
        let name = target.file_name().unwrap_or_default().to_string_lossy();
        let partial = folder.join(format!(".{name}.partial"));
        let text = toml::to_string(&optics.table)?;
        let head = [MAGIC, &(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat();
        let mut recorder = Self {
            file: File::create(&partial).map_err(StagingError::at(target))?,
            whole_bytes: 0,
            partial,
            target: target.into(),
            begin: None,
            last: Duration::ZERO,
            pairs: 0,
            finished: false,
        };
        recorder.append(&head)?;
        Ok(recorder)
    }

    /// Writes all bytes, or truncates to the last complete pair, for instance if the disk is full.
    fn append(&mut self, bytes: &[u8]) -> Result<()> {
        if let Err(error) = self.file.write_all(bytes) {
            self.file.set_len(self.whole_bytes).map_err(StagingError::at(&self.target))?;
            return Err(StagingError::at(&self.target)(error).into());
        }
        self.whole_bytes += bytes.len() as u64;
        Ok(())
    }

    /// Adds a pair; returns whether there is room for more.
    pub fn add(&mut self, far: &Image, near: &Image) -> Result<bool> {
        let (height, width) = far.pixels.dim();
        let (Ok(width), Ok(height)) = (u16::try_from(width), u16::try_from(height)) else {
            return Err(WorkflowError::parameter(
                "image",
                format!("{width}x{height}"),
                "at most 65535 px along each side",
            ));
        };
        if far.pixels.dim() != near.pixels.dim() || far.bits != near.bits {
            return Err(WorkflowError::parameter(
                "pair",
                self.pairs,
                "both images have one size and depth of bits",
            ));
        }
        let at = self.begin.get_or_insert_with(Instant::now).elapsed();
        let mut bytes = Vec::with_capacity(13 + 4 * far.pixels.len());
        bytes.extend((at.as_micros() as u64).to_le_bytes());
        bytes.extend(width.to_le_bytes());
        bytes.extend(height.to_le_bytes());
        bytes.push(far.bits);
        bytes.extend(far.pixels.iter().chain(&near.pixels).flat_map(|code| code.to_le_bytes()));
        self.append(&bytes)?;
        self.last = at;
        self.pairs += 1;
        Ok(self.pairs < PAIRS_MAX)
    }

    pub fn finish(mut self) -> Result<RecordingFigures> {
        rename(&self.partial, &self.target).map_err(StagingError::at(&self.target))?;
        self.finished = true;
        Ok(RecordingFigures { pairs: self.pairs, seconds: rounded(self.last.as_secs_f64(), 3) })
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        if !self.finished {
            let _ = fs::remove_file(&self.partial); // it may have gone
        }
    }
}

#[derive(Clone, PartialEq, Debug)]
pub struct RecordedPair {
    pub at: Duration,
    pub far: Image,
    pub near: Image,
}

pub struct Recording {
    file: BufReader<File>,
    path: PathBuf,
    optics: Optics,
    read: usize,
}

impl Recording {
    pub fn open(path: &Path) -> Result<Self> {
        let file = File::open(path).map_err(WorkflowError::read("the recording", path))?;
        let mut file = BufReader::new(file);
        let wrong = WorkflowError::file(path, EXPECTED);
        let mut head = [0; 12];
        if file.read_exact(&mut head).is_err() || head[..8] != *MAGIC {
            return Err(wrong("it does not begin with FNPAIRS1"));
        }
        let length = u32::from_le_bytes([head[8], head[9], head[10], head[11]]);
        if length > OPTICS_MAX {
            return Err(wrong("its optics are longer than any"));
        }
        let mut text = vec![0; length as usize];
        file.read_exact(&mut text).map_err(WorkflowError::read("the recording", path))?;
        let text = String::from_utf8_lossy(&text).into_owned();
        let optics = GivenOptics::parse(&text, path)?.optics;
        Ok(Self { file, path: path.into(), optics, read: 0 })
    }

    /// Returns `None` at the end.
    pub fn next_pair(&mut self) -> Result<Option<RecordedPair>> {
        let (path, number) = (self.path.clone(), self.read + 1);
        let wrong = |what: &str| WorkflowError::file(&path, EXPECTED)(format!("pair {number} {what}"));
        let mut head = [0; 13];
        match self.file.read(&mut head[..1]) {
            Ok(0) => return Ok(None),
            Ok(_) => {}
            Err(error) => return Err(WorkflowError::read("the recording", &path)(error)),
        }
        let cut = |error: std::io::Error| match error.kind() {
            ErrorKind::UnexpectedEof => wrong("is cut short"),
            _ => WorkflowError::read("the recording", &path)(error),
        };
        self.file.read_exact(&mut head[1..]).map_err(cut)?;
        let [t0, t1, t2, t3, t4, t5, t6, t7, w0, w1, h0, h1, bits] = head;
        let micros = u64::from_le_bytes([t0, t1, t2, t3, t4, t5, t6, t7]);
        let (width, height) = (u16::from_le_bytes([w0, w1]), u16::from_le_bytes([h0, h1]));
        let pixels = usize::from(width) * usize::from(height);
        if pixels == 0 || pixels > PIXELS_MAX || !(8..=16).contains(&bits) {
            return Err(wrong(&format!("has {width}x{height} pixels of {bits} bits")));
        }
        let mut image = || -> Result<Image> {
            let mut bytes = vec![0; 2 * pixels];
            self.file.read_exact(&mut bytes).map_err(cut)?;
            let layout = Layout::Grey16 { bits };
            layout
                .decode(&bytes, usize::from(width), usize::from(height))
                .map_err(|bad| wrong(&format!("has {bad}")))
        };
        let (far, near) = (image()?, image()?);
        self.read = number;
        Ok(Some(RecordedPair { at: Duration::from_micros(micros), far, near }))
    }
}

/// A pair with its grey values, prepared while depth of the previous pair is computed.
struct Ready {
    pair: RecordedPair,
    grey: [Array2<f32>; 2],
}

/// Reads up to [`AHEAD`] pairs in advance until the end, an error, or a closed receiver. The lanes get pairs in turn.
fn read_ahead(mut recording: Recording, lanes: &[SyncSender<Result<Ready>>]) {
    for to in lanes.iter().cycle() {
        let ready = match recording.next_pair() {
            Ok(Some(pair)) => Ok(Ready { grey: [&pair.far, &pair.near].map(Image::grey), pair }),
            Ok(None) => return,
            Err(error) => Err(error),
        };
        let last = ready.is_err();
        if to.send(ready).is_err() || last {
            return;
        }
    }
}

struct Computed {
    pair: RecordedPair,
    /// `None` for two images of different scenes.
    found: Option<Measurement>,
    arrived: Instant,
    /// To the map.
    latency_ms: f64,
}

/// Computes depth of each pair when it is due after `begin`, or at once without it; ends as [`read_ahead`].
fn compute(
    depths: &mut Stream,
    pairs: Receiver<Result<Ready>>,
    begin: Option<Instant>,
    context: &Context<'_>,
    to: &SyncSender<Result<Computed>>,
) {
    let mut next = |ready: Result<Ready>| {
        let Ready { pair, grey } = ready?;
        let left = || begin.map_or(Duration::ZERO, |begin| pair.at.saturating_sub(begin.elapsed()));
        while !left().is_zero() {
            context.cancel.check("playing a recording")?;
            thread::sleep(LOOK.min(left()));
        }
        context.cancel.check("playing a recording")?;
        let arrived = Instant::now();
        let found = measure(depths, grey, context)?;
        Ok(Computed { found, pair, arrived, latency_ms: arrived.elapsed().as_secs_f64() * 1e3 })
    };
    for ready in pairs {
        let computed = next(ready);
        let last = computed.is_err();
        if to.send(computed).is_err() || last {
            return;
        }
    }
}

/// Plays a recording and passes each pair with its depth to `on_depth`, while other threads read and compute the next. In fast
/// play each lane has its own noise and registration, from the pairs that it computes.
pub fn play(
    path: &Path,
    fast: bool,
    context: &Context<'_>,
    mut on_depth: impl FnMut(LiveDepth<'_>, &Optics) -> Result<()>,
) -> Result<PlayFigures> {
    let recording = Recording::open(path)?;
    let optics = recording.optics;
    let lanes = if fast { LANES } else { 1 };
    let threads = rayon::current_num_threads().div_ceil(lanes);
    let (begin, mut latencies_ms, mut seconds) = (Instant::now(), Vec::new(), 0.0);
    let mut unrelated_pairs = 0;
    thread::scope(|scope| {
        // Each thread ends when its receiver is dropped, the last of them at the end of this closure.
        let (mut to_lanes, mut maps) = (Vec::new(), Vec::new());
        for _ in 0..lanes {
            let mut depths = stream(&optics)?;
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            let pool = pool.map_err(|error| WorkflowError::Thread { reason: error.to_string() })?;
            let (to, pairs) = mpsc::sync_channel(AHEAD);
            let (computed, map) = mpsc::sync_channel(0);
            to_lanes.push(to);
            maps.push(map);
            let due = (!fast).then_some(begin);
            scope.spawn(move || pool.install(|| compute(&mut depths, pairs, due, context, &computed)));
        }
        scope.spawn(move || read_ahead(recording, &to_lanes));
        // After the last pair the next lane in turn is closed.
        for map in maps.iter().cycle().map_while(|lane| lane.recv().ok()) {
            let Computed { pair: RecordedPair { at, far, near }, found, arrived, latency_ms } = map?;
            if latencies_ms.is_empty()
                && unrelated_pairs == 0
                && let Some(doubt) = another_size(&optics, far.pixels.dim())
            {
                context.progress.warn(&doubt.to_string());
            }
            let Some(found) = found else {
                unrelated_pairs += 1;
                continue;
            };
            latencies_ms.push(latency_ms);
            seconds = at.as_secs_f64();
            context.progress.advance("pairs", latencies_ms.len(), None);
            // In fast play a map waits for its turn.
            let latency_ms = if fast { latency_ms } else { arrived.elapsed().as_secs_f64() * 1e3 };
            on_depth(LiveDepth { far: &far, near: &near, found: &found, pair_ms: 0.0, latency_ms }, &optics)?;
        }
        Ok::<_, WorkflowError>(())
    })?;
    let pairs = latencies_ms.len();
    Ok(PlayFigures {
        pairs,
        unrelated_pairs,
        maps_per_second: rounded(pairs as f64 / begin.elapsed().as_secs_f64().max(1e-9), 2),
        latency_ms: rounded(quantile::of_values(latencies_ms, 0.5).unwrap_or_default(), 2),
        seconds: rounded(seconds, 3),
    })
}

#[cfg(test)]
mod tests {
    use ndarray::Array2;

    use super::*;

    fn image(code: u16) -> Image {
        Image::new(Array2::from_shape_fn((3, 5), |(y, x)| code + (5 * y + x) as u16), 12)
    }

    fn optics() -> GivenOptics {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/rig.toml");
        GivenOptics::read(&path).expect("the example's optics")
    }

    #[test]
    fn pairs_come_back_as_they_were_and_a_cut_file_says_where() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.pairs");
        let mut recorder = Recorder::begin(&path, &optics()).expect("begins");
        for code in [10, 200] {
            assert!(recorder.add(&image(code), &image(code + 1)).expect("room"));
        }
        assert!(!path.exists(), "the file has its name when it is whole");
        assert_eq!(recorder.finish().expect("a file").pairs, 2);
        let mut recording = Recording::open(&path).expect("pairs");
        for code in [10, 200] {
            let pair = recording.next_pair().expect("whole").expect("there");
            assert_eq!((pair.far, pair.near), (image(code), image(code + 1)));
        }
        assert_eq!(recording.next_pair().expect("whole"), None);
        let bytes = fs::read(&path).expect("a file");
        fs::write(&path, &bytes[..bytes.len() - 3]).expect("writable");
        let mut recording = Recording::open(&path).expect("pairs");
        assert!(recording.next_pair().is_ok());
        let error = recording.next_pair().expect_err("cut").to_string();
        assert!(error.contains("pair 2 is cut short"), "{error}");
        fs::write(&path, b"something else").expect("writable");
        assert!(Recording::open(&path).err().expect("refused").to_string().contains("FNPAIRS1"));
    }

    /// A texture, and a blurred one.
    fn textured() -> [Image; 2] {
        let code = |y: usize, x: usize| ((y * 7919 + x * 104_729 + x * y * 31) % 3001) as u16 + 500;
        let mean =
            |y: usize, x: usize| (0..9).map(|i| u32::from(code(y + i / 3, x + i % 3))).sum::<u32>() / 9;
        let far = Array2::from_shape_fn((48, 64), |(y, x)| code(y + 1, x + 1));
        let near = Array2::from_shape_fn((48, 64), |(y, x)| mean(y, x) as u16);
        [far, near].map(|pixels| Image::new(pixels, 12))
    }

    #[test]
    fn a_recording_is_played_in_its_order_and_ends_with_the_first_error() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.pairs");
        let mut recorder = Recorder::begin(&path, &optics()).expect("begins");
        let [far, near] = textured();
        for number in 0..4 {
            let mut far = far.clone();
            far.pixels[(0, 0)] = number;
            recorder.add(&far, &near).expect("room");
        }
        recorder.finish().expect("a file");
        let context = Context::unattended();
        let mut order = Vec::new();
        let figures = play(&path, true, &context, |map, _| {
            order.push(map.far.pixels[(0, 0)]);
            Ok(())
        });
        let figures = figures.expect("played");
        assert_eq!((order, figures.pairs, figures.unrelated_pairs), (vec![0, 1, 2, 3], 4, 0));
        let mut shown = 0;
        let error = play(&path, true, &context, |_, _| {
            shown += 1;
            context.cancel.cancel();
            context.cancel.check("showing")
        });
        assert!(error.expect_err("cancelled").is_cancelled());
        assert_eq!(shown, 1);
    }

    /// The system limits this process's files to 4 kB (8 kB if the shell counts in KiB).
    #[test]
    #[cfg(target_os = "linux")]
    fn a_disk_that_fills_up_ends_a_recording_with_the_last_whole_pair() {
        const WITHIN: &str = "FARNEAR_TEST_SMALL_FILES";
        if std::env::var_os(WITHIN).is_none() {
            let name =
                "rig::recording::tests::a_disk_that_fills_up_ends_a_recording_with_the_last_whole_pair";
            let script = r#"trap "" XFSZ; ulimit -f 8; exec "$0" --exact "$1""#;
            let program = std::env::current_exe().expect("this program");
            let run = std::process::Command::new("sh")
                .args(["-c", script])
                .arg(program)
                .arg(name)
                .env(WITHIN, "1")
                .output();
            let ended = run.expect("a shell");
            let said = String::from_utf8_lossy(&ended.stdout);
            assert!(ended.status.success() && said.contains("1 passed"), "{said}");
            return;
        }
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.pairs");
        let mut recorder = Recorder::begin(&path, &optics()).expect("begins");
        let large = Image::new(Array2::from_elem((12, 20), 7), 12);
        let mut whole = 0;
        let error = loop {
            match recorder.add(&large, &large) {
                Ok(_) => whole += 1,
                Err(error) => break error.to_string(),
            }
        };
        assert!(error.contains("cannot write"), "{error}");
        assert!(whole > 1, "{whole}");
        assert_eq!(recorder.finish().expect("complete pairs").pairs, whole);
        let mut recording = Recording::open(&path).expect("pairs");
        for _ in 0..whole {
            assert_eq!(recording.next_pair().expect("whole").expect("there").near, large);
        }
        assert_eq!(recording.next_pair().expect("nothing of the next"), None);
        assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 1);
    }

    #[test]
    fn a_recording_that_is_not_finished_leaves_nothing() {
        let folder = tempfile::tempdir().expect("a folder");
        let mut recorder = Recorder::begin(&folder.path().join("a.pairs"), &optics()).expect("begins");
        recorder.add(&image(1), &image(2)).expect("room");
        drop(recorder);
        assert_eq!(fs::read_dir(folder.path()).expect("a folder").count(), 0);
    }
}
