//! A capture folder per pair or an image per exposure, and `frames.csv` with a row per frame.

use std::{
    fs::File,
    io::Write,
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

pub struct Folder {
    path: PathBuf,
    rows: File,
    pairs: u32,
}

impl Folder {
    /// Creates the folder, which must be new or empty. Complete captures remain if the run ends early.
    pub fn begin(path: &Path) -> Result<Self> {
        Staging::new_folder(path)
            .and_then(Staging::finish)
            .map_err(farnear_capture::record::RecordError::from)?;
        let head =
            b"frame,shot,repeat,trigger_number,trigger_us,strobe_end_us,settle_us,deviation_nm,dropped\n";
        let csv = path.join(ROWS);
        let rows = File::create_new(&csv).and_then(|mut rows| rows.write_all(head).map(|()| rows));
        Ok(Self { path: path.into(), rows: rows.map_err(StagingError::at(&csv))?, pairs: 0 })
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
        let written = self.rows.write_all(row.as_bytes());
        Ok(written.map_err(StagingError::at(&self.path.join(ROWS)))?)
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
