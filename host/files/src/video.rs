//! Video frames from a folder of pictures, a Y4M file, or any file through an installed ffmpeg. All frames must have
//! one size and be all grey or all RGB, 8 bits per sample. Nothing is read ahead, so a video may exceed memory.

mod ffmpeg;
pub mod pictures;
mod timing;
mod y4m;

use std::{
    io,
    path::{Path, PathBuf},
};

use ndarray::{Array2, Array3};

#[derive(Clone, Debug, PartialEq)]
pub struct VideoFrame {
    /// File name without extension, else `frame_000001` etc.
    pub name: String,
    pub pixels: Pixels,
}

#[derive(Clone, Debug, PartialEq)]
pub enum Pixels {
    /// (height, width).
    Grey(Array2<u8>),
    /// (height, width, 3).
    Rgb(Array3<u8>),
}

impl Pixels {
    pub fn kind(&self) -> Kind {
        match self {
            Self::Grey(pixels) => Kind { width: pixels.ncols(), height: pixels.nrows(), colour: false },
            Self::Rgb(pixels) => {
                let (height, width, _) = pixels.dim();
                Kind { width, height, colour: true }
            }
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Kind {
    pub width: usize,
    pub height: usize,
    pub colour: bool,
}

impl std::fmt::Display for Kind {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(out, "{}x{} {}", self.width, self.height, if self.colour { "in colour" } else { "in grey" })
    }
}

#[derive(Debug, thiserror::Error)]
pub enum VideoError {
    #[error("{}: {source}", path.display())]
    Io { path: PathBuf, source: io::Error },
    #[error("{}: no picture in this folder; expected files ending in {}", path.display(), pictures::EXTENSIONS.join(", "))]
    NoPictures { path: PathBuf },
    #[error("{} and {} have one name: they may be the same picture twice; move one of them away", first.display(), second.display())]
    SameStem { first: PathBuf, second: PathBuf },
    #[error("{}: a link to a file that does not exist, or no file: restore the picture, or remove the name", path.display())]
    NotAFile { path: PathBuf },
    #[error(
        "{}: a pipe, a device or another file that can be read only once; a video is read twice: save it as a file, and name that",
        path.display()
    )]
    NotRegular { path: PathBuf },
    #[error("{}: no frame in this video", path.display())]
    NoFrames { path: PathBuf },
    #[error("{}: not a picture that can be read: {reason}", path.display())]
    Picture { path: PathBuf, reason: String },
    #[error("{}: frame {frame} of the Y4M stream: {reason}", path.display())]
    Y4m {
        path: PathBuf,
        /// From 1; 0 for the header.
        frame: usize,
        reason: String,
    },
    #[error("{}: frame `{name}` is {found}, but the video began {expected}; all frames must be alike", path.display())]
    Changed { path: PathBuf, name: String, found: Kind, expected: Kind },
    #[error(
        "{}: only a folder of pictures and Y4M files are read directly, and there is no `ffmpeg` on the PATH for other \
         videos; install ffmpeg, or convert with it elsewhere: ffmpeg -i VIDEO -pix_fmt yuv444p out.y4m", path.display()
    )]
    NoFfmpeg { path: PathBuf },
    #[error(
        "{}: the shape of its frames changes ({sizes}): cut it into parts of one shape (ffmpeg -ss START -to END -i VIDEO PART)",
        path.display()
    )]
    Turned { path: PathBuf, sizes: String },
    #[error("{}: ffmpeg could not read it ({status}): {message}", path.display())]
    Ffmpeg {
        path: PathBuf,
        status: String,
        /// Its first errors.
        message: String,
    },
}

impl VideoError {
    fn io(path: &Path, source: io::Error) -> Self {
        Self::Io { path: path.into(), source }
    }
}

type Read = Result<VideoFrame, VideoError>;

enum Frames {
    Direct(Box<dyn Iterator<Item = Read>>),
    Ffmpeg(Box<ffmpeg::Ffmpeg>),
}

/// Iterator over frames; ends after the first error.
pub struct Video {
    path: PathBuf,
    frames: Frames,
    first: Option<Kind>,
    ended: bool,
    remarks: Vec<String>,
    rate_hz: Option<f64>,
}

impl std::fmt::Debug for Video {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        out.debug_struct("Video").field("path", &self.path).finish_non_exhaustive()
    }
}

impl Video {
    /// Opens a folder of pictures, a `.y4m` file, or any other file through ffmpeg. Frames report later errors. Fails for pipes
    /// and devices, because their times, or a background that is learned first, need a second reading.
    pub fn open(path: &Path) -> Result<Self, VideoError> {
        let metadata = path.metadata().map_err(|source| VideoError::io(path, source))?;
        let (frames, remark, rate_hz) = if metadata.is_dir() {
            (Frames::Direct(Box::new(pictures::open(path)?)), None, None)
        } else if !metadata.is_file() {
            return Err(VideoError::NotRegular { path: path.into() });
        } else if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("y4m")) {
            let file = std::fs::File::open(path).map_err(|source| VideoError::io(path, source))?;
            let video = y4m::Y4m::new(path, io::BufReader::new(file))?;
            let (remark, rate_hz) = (video.remark(), video.rate_hz());
            (Frames::Direct(Box::new(video)), remark, rate_hz)
        } else {
            let timing = timing::Timing::of(path);
            let remark = timing.as_ref().and_then(timing::Timing::remark);
            let rate_hz = timing.as_ref().map(|timing| timing.rate_hz);
            (Frames::Ffmpeg(Box::new(ffmpeg::open(path, timing.as_ref())?)), remark, rate_hz)
        };
        Ok(Self {
            path: path.into(),
            frames,
            first: None,
            ended: false,
            remarks: remark.into_iter().collect(),
            rate_hz,
        })
    }

    /// Frames per second; `None` for a folder of pictures, and where the file states none.
    pub fn rate_hz(&self) -> Option<f64> {
        self.rate_hz
    }

    /// New notices to the user about how it is read; some come at the end.
    pub fn take_remarks(&mut self) -> Vec<String> {
        let new = std::mem::take(&mut self.remarks);
        new.into_iter().map(|remark| format!("{}: {remark}", self.path.display())).collect()
    }
}

impl Iterator for Video {
    type Item = Read;

    fn next(&mut self) -> Option<Self::Item> {
        if self.ended {
            return None;
        }
        let next = match &mut self.frames {
            Frames::Direct(frames) => frames.next(),
            Frames::Ffmpeg(ffmpeg) => {
                let next = ffmpeg.next();
                self.remarks.append(&mut ffmpeg.remarks);
                next
            }
        };
        let next = match next {
            Some(Ok(frame)) => {
                let found = frame.pixels.kind();
                let expected = *self.first.get_or_insert(found);
                if found == expected {
                    return Some(Ok(frame));
                }
                Some(Err(VideoError::Changed { path: self.path.clone(), name: frame.name, found, expected }))
            }
            Some(Err(error)) => Some(Err(error)),
            None if self.first.is_none() => Some(Err(VideoError::NoFrames { path: self.path.clone() })),
            None => None,
        };
        self.ended = true;
        next
    }
}

fn numbered(number: usize) -> String {
    format!("frame_{number:06}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{GrayImage, Luma, Rgb, RgbImage};

    #[test]
    fn reads_a_folder_in_order_of_numbers() {
        let folder = tempfile::tempdir().unwrap();
        for number in [10_u8, 2, 1] {
            let picture = GrayImage::from_pixel(4, 3, Luma([number]));
            picture.save(folder.path().join(format!("in{number}.png"))).unwrap();
        }
        std::fs::write(folder.path().join("notes.txt"), "not a picture").unwrap();
        let frames: Vec<_> = Video::open(folder.path()).unwrap().map(Result::unwrap).collect();
        let names: Vec<_> = frames.iter().map(|frame| frame.name.as_str()).collect();
        assert_eq!(names, ["in1", "in2", "in10"]);
        assert_eq!(frames[2].pixels, Pixels::Grey(Array2::from_elem((3, 4), 10)));
    }

    #[test]
    fn frames_of_12_bits_in_16_keep_their_contrast() {
        let folder = tempfile::tempdir().unwrap();
        for (number, level) in [(1, 4095_u16), (2, 2048)] {
            let picture = image::ImageBuffer::from_pixel(4, 3, Luma([level]));
            picture.save(folder.path().join(format!("{number}.png"))).unwrap();
        }
        let frames = Video::open(folder.path()).unwrap().map(|frame| frame.unwrap().pixels);
        let levels = [255, 128].map(|level| Pixels::Grey(Array2::from_elem((3, 4), level)));
        assert_eq!(frames.collect::<Vec<_>>(), levels);
    }

    #[test]
    fn frames_of_8_bits_do_not_whiten_those_of_16() {
        let folder = tempfile::tempdir().unwrap();
        let path = |number: u8| folder.path().join(format!("{number}.png"));
        GrayImage::from_pixel(4, 3, Luma([128])).save(path(1)).unwrap();
        for (number, level) in [(2, u16::MAX), (3, 128 * 257)] {
            image::ImageBuffer::from_pixel(4, 3, Luma([level])).save(path(number)).unwrap();
        }
        let frames = Video::open(folder.path()).unwrap().map(|frame| frame.unwrap().pixels);
        let levels = [128, 255, 128].map(|level| Pixels::Grey(Array2::from_elem((3, 4), level)));
        assert_eq!(frames.collect::<Vec<_>>(), levels);
    }

    #[test]
    fn a_frame_of_another_size_ends_the_video_with_its_name() {
        let folder = tempfile::tempdir().unwrap();
        RgbImage::from_pixel(4, 3, Rgb([1, 2, 3])).save(folder.path().join("a.png")).unwrap();
        RgbImage::from_pixel(5, 3, Rgb([1, 2, 3])).save(folder.path().join("b.png")).unwrap();
        RgbImage::from_pixel(4, 3, Rgb([1, 2, 3])).save(folder.path().join("c.png")).unwrap();
        let mut video = Video::open(folder.path()).unwrap();
        assert!(video.next().unwrap().is_ok());
        let text = video.next().unwrap().unwrap_err().to_string();
        assert!(text.contains("`b`") && text.contains("5x3") && text.contains("4x3"), "{text}");
        assert!(video.next().is_none());
    }

    #[test]
    fn an_empty_folder_and_a_missing_file_are_errors() {
        let folder = tempfile::tempdir().unwrap();
        let empty = Video::open(folder.path()).unwrap_err();
        assert!(matches!(empty, VideoError::NoPictures { .. }), "{empty}");
        let missing = Video::open(&folder.path().join("none.y4m")).unwrap_err();
        assert!(missing.to_string().contains("none.y4m"), "{missing}");
    }

    #[cfg(unix)]
    #[test]
    fn a_pipe_is_refused_without_waiting() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["walk.y4m", "walk.mp4"] {
            let pipe = folder.path().join(name);
            assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
            let error = Video::open(&pipe).unwrap_err();
            assert!(matches!(error, VideoError::NotRegular { .. }), "{error}");
            assert!(error.to_string().contains(name) && error.to_string().contains("save it"), "{error}");
        }
    }

    #[test]
    fn names_a_damaged_picture() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a.png"), b"\x89PNG\r\n\x1a\nrubbish").unwrap();
        let error = Video::open(folder.path()).unwrap().next().unwrap().unwrap_err();
        assert!(error.to_string().contains("a.png"), "{error}");
    }

    /// What ffmpeg writes for its own test picture with these arguments.
    fn by_ffmpeg(arguments: &str) -> Vec<u8> {
        let output = std::process::Command::new("ffmpeg")
            .args(["-nostdin", "-v", "error"])
            .args(arguments.split(' '))
            .arg("-")
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        output.stdout
    }

    /// Frames written by ffmpeg with the times of `filter`, read back.
    fn through_ffmpeg(filter: &str) -> (usize, Option<String>) {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("recorded.webm");
        let recorded = by_ffmpeg(&format!(
            "-f lavfi -i testsrc=size=64x48:rate=30:duration=2 -vf {filter} -vsync passthrough -enc_time_base 1/1000 -c:v libvpx \
             -f webm"
        ));
        std::fs::write(&file, recorded).unwrap();
        let mut video = Video::open(&file).unwrap();
        let frames = video.by_ref().map(Result::unwrap).count();
        (frames, video.take_remarks().pop())
    }

    #[test]
    #[cfg_attr(not(ffmpeg), ignore = "needs ffmpeg")]
    fn uneven_times_of_a_browser_are_resampled_to_the_nominal_rate() {
        // Every seventh frame dropped, the others late by up to 2 ms, and a pause of half a second.
        let filter = "select='not(eq(mod(n\\,7)\\,3))',settb=1/1000,setpts='PTS+mod(N*7\\,3)+500*gt(N\\,20)'";
        let (frames, remark) = through_ffmpeg(filter);
        assert!((74..=76).contains(&frames), "{frames} frames of 2.5 s at 30 frames/s");
        let remark = remark.expect("a remark");
        assert!(remark.contains("frame rate varies") && remark.contains("30.00 frames/s"), "{remark}");
    }

    #[test]
    #[cfg_attr(not(ffmpeg), ignore = "needs ffmpeg")]
    fn pixels_that_are_not_square_are_widened() {
        let (_, remark) = through_ffmpeg("setsar=2/1");
        assert!(remark.is_some_and(|remark| remark.contains("2.000 times as wide as high")));
    }

    /// A recording whose size changes after one second, as browsers' meetings do.
    fn of_two_sizes(second: &str) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        let parts = [("64x48", 0), (second, 1)].map(|(size, offset)| {
            by_ffmpeg(&format!(
                "-f lavfi -i testsrc=size={size}:rate=30:duration=1 -output_ts_offset {offset} -c:v mpeg2video -f mpegts"
            ))
        });
        std::fs::write(folder.path().join("call.ts"), parts.concat()).unwrap();
        folder
    }

    #[test]
    #[cfg_attr(not(ffmpeg), ignore = "needs ffmpeg")]
    fn of_several_streams_the_default_one_is_read_and_reported() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("two.mkv");
        let source = |size: &str| format!("-f lavfi -i testsrc=size={size}:rate=30:duration=1");
        let recorded = by_ffmpeg(&format!(
            "{} {} -map 0:v -map 1:v -c:v mpeg2video -disposition:v:0 0 -disposition:v:1 default -f matroska",
            source("64x48"),
            source("128x96")
        ));
        std::fs::write(&file, recorded).unwrap();
        let mut video = Video::open(&file).unwrap();
        let remark = video.take_remarks().concat();
        assert!(remark.contains("0:0 (64x48), 0:1 (128x96): ffmpeg chose 0:1"), "{remark}");
        let kind = video.next().unwrap().unwrap().pixels.kind().to_string();
        assert!(kind.contains("128x96"), "{kind}");
    }

    #[test]
    #[cfg_attr(not(ffmpeg), ignore = "needs ffmpeg")]
    fn frames_after_a_change_of_size_are_kept_and_another_shape_is_refused() {
        let [larger, turned] = ["128x96", "48x64"].map(of_two_sizes);
        let mut video = Video::open(&larger.path().join("call.ts")).unwrap();
        let frames = video.by_ref().map(Result::unwrap).count();
        assert!((58..=61).contains(&frames), "{frames}");
        assert!(video.take_remarks().concat().contains("64x48, 128x96"));
        let last = Video::open(&turned.path().join("call.ts")).unwrap().last().unwrap();
        assert!(matches!(last, Err(VideoError::Turned { .. })), "{last:?}");
    }

    #[test]
    #[cfg_attr(not(ffmpeg), ignore = "needs ffmpeg")]
    fn frames_without_presentation_times_are_all_read() {
        let folder = tempfile::tempdir().unwrap();
        for (name, form) in [("b.avi", "mpeg4 -bf 2 -f avi"), ("b.mpg", "mpeg2video -bf 2 -f mpeg")] {
            let recorded =
                by_ffmpeg(&format!("-f lavfi -i testsrc=size=64x48:rate=25:duration=4 -c:v {form}"));
            std::fs::write(folder.path().join(name), recorded).unwrap();
            let mut video = Video::open(&folder.path().join(name)).unwrap();
            let rate_hz = video.rate_hz();
            assert_eq!((video.by_ref().map(Result::unwrap).count(), rate_hz), (100, Some(25.0)), "{name}");
            assert_eq!(video.take_remarks(), Vec::<String>::new(), "{name}");
        }
    }

    #[test]
    #[cfg_attr(not(ffmpeg), ignore = "needs ffmpeg")]
    fn a_constant_rate_in_milliseconds_is_read_frame_by_frame() {
        for filter in ["settb=1/1000", "settb=1/1000,setpts=N*59"] {
            assert_eq!(through_ffmpeg(filter), (60, None), "{filter}");
        }
    }
}
