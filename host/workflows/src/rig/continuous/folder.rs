//! A capture folder per pair or an image per exposure, and `frames.csv` with a row per frame.

use std::{
    fs::{self, File},
    io::{self, Write},
    path::{Path, PathBuf},
};

use farnear_capture::{
    Client,
    continuous::{Frame, Loss, Outcome},
    describe::drop_text,
    pair::pair_of,
    plan::SensorPair,
    record::{Circumstances, begin_folder, finish_folder, record_of},
    work::Moved,
};
use farnear_files::{
    image_file::encode_png,
    staging::{Staging, StagingError, write_file},
};

use crate::error::Result;

const ROWS: &str = "frames.csv";
const HEAD: &[u8] =
    b"frame,shot,repeat,trigger_number,trigger_us,strobe_end_us,settle_us,deviation_nm,dropped\n";

/// Dropping it removes the folder if it is new and nothing was captured.
pub struct Folder {
    path: PathBuf,
    is_new: bool,
    /// `None` before the first frame.
    rows: Option<File>,
    pairs: u32,
}

impl Drop for Folder {
    fn drop(&mut self) {
        if self.is_new && self.is_empty() {
            let _ = fs::remove_dir(&self.path); // fails if something else is in it
        }
    }
}

impl Folder {
    /// Creates the folder, which must be new or empty. Complete captures remain if the run ends early.
    pub fn begin(path: &Path) -> Result<Self> {
        let is_new = !path.exists();
        Staging::new_folder(path)
            .and_then(Staging::finish)
            .map_err(farnear_capture::record::RecordError::from)?;
        Ok(Self { path: path.into(), is_new, rows: None, pairs: 0 })
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    pub fn is_empty(&self) -> bool {
        self.rows.is_none()
    }

    pub fn note(&mut self, outcome: &Outcome) -> Result<()> {
        let row = match outcome {
            Outcome::Taken(frame) => {
                let (record, deviation) = (&frame.record, frame.deviation.0);
                format!(
                    "{},{},{},{},{},{},{},{deviation},\n",
                    frame.number,
                    record.index,
                    record.repeat,
                    record.trigger_number,
                    record.trigger.0,
                    record.strobe_end.0,
                    record.settle.0
                )
            }
            Outcome::Dropped { number, loss } => {
                let why = match loss {
                    Loss::Board(reason) => drop_text(*reason),
                    Loss::EventLost => "the board's event was lost".into(),
                    Loss::Image { reason, .. } => reason.clone(),
                };
                format!("{number},,,,,,,,\"{}\"\n", why.replace('"', "'"))
            }
        };
        self.write(row.as_bytes()).map_err(StagingError::at(&self.path.join(ROWS)))?;
        Ok(())
    }

    fn write(&mut self, row: &[u8]) -> io::Result<()> {
        let path = self.path.join(ROWS);
        let rows = match &mut self.rows {
            Some(rows) => {
                // The open file outlives its folder, which the next pair would create again.
                fs::metadata(&path)?;
                rows
            }
            none => {
                let rows = none.insert(File::create_new(&path)?);
                rows.write_all(HEAD)?;
                rows
            }
        };
        rows.write_all(row)
    }

    pub fn pair(
        &mut self,
        cycle: Vec<Frame>,
        (sensor, coarse): (&SensorPair, Moved),
        client: &Client,
        circumstances: &Circumstances,
    ) -> Result<()> {
        let both = cycle.into_iter().map(|frame| (frame.record, frame.image)).collect::<Vec<_>>();
        let Ok(both) = both.try_into() else { return Ok(()) }; // a cycle of another length is not a pair
        let pair = pair_of(both, sensor, coarse, &client.hello().limits)?;
        let folder = begin_folder(&self.path.join(format!("pair-{:05}", self.pairs)))?;
        finish_folder(folder, &pair, &record_of(&pair, client, circumstances.clone()))?;
        self.pairs += 1;
        Ok(())
    }

    pub fn image(&self, frame: &Frame) -> Result<()> {
        let path = self.path.join(format!("frame-{:06}-shot-{:02}.png", frame.number, frame.record.index));
        let image = encode_png(frame.image.pixels.view(), frame.image.bits)
            .map_err(farnear_capture::record::RecordError::from)?;
        Ok(write_file(&path, &image)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_without_a_frame_is_removed_and_a_moved_one_is_an_error() {
        let parent = tempfile::tempdir().unwrap();
        let out = parent.path().join("out");
        drop(Folder::begin(&out).unwrap());
        assert!(!out.exists());
        let dropped = Outcome::Dropped { number: 0, loss: Loss::EventLost };
        let mut folder = Folder::begin(&out).unwrap();
        folder.note(&dropped).unwrap();
        folder.note(&dropped).unwrap();
        drop(folder);
        assert_eq!(fs::read_to_string(out.join(ROWS)).unwrap().lines().count(), 1 + 2);

        let mut folder = Folder::begin(&parent.path().join("moved")).unwrap();
        folder.note(&dropped).unwrap();
        fs::rename(folder.path(), parent.path().join("elsewhere")).unwrap();
        let error = folder.note(&dropped).unwrap_err().to_string();
        assert!(error.contains(ROWS), "{error}");

        let own = parent.path().join("own");
        fs::create_dir(&own).unwrap();
        drop(Folder::begin(&own).unwrap());
        assert!(own.exists(), "it was there before");
    }
}
