//! Rig workflows with a scripted board on a port.

mod cancelling;
mod checklist;
mod jobs;
mod twice;

use std::{path::Path, sync::Mutex, time::Duration};

use farnear_protocol::Micros;
use farnear_workflows::{
    Cancel, Context, Progress, Questions, Result,
    rig::{
        AxisName,
        camera::{CameraAddress, CameraSettings},
        sequence::SequenceRequest,
    },
};

/// Records messages and confirms every question.
#[derive(Default)]
struct Face {
    messages: Mutex<Vec<String>>,
}

impl Face {
    fn context(&self) -> Context<'_> {
        Context::new(self, self, Cancel::default())
    }

    fn heard(&self, phrase: &str) -> bool {
        self.messages.lock().unwrap().iter().any(|messages| messages.contains(phrase))
    }
}

impl Progress for Face {
    fn info(&self, what: &str) {
        self.messages.lock().unwrap().push(what.into());
    }
}

impl Questions for Face {
    fn ask(&self, question: &str, _: &Cancel) -> Result<String> {
        self.info(question);
        Ok("\n".into())
    }
}

/// A camera that watches a folder, which is empty unless a test adds images.
fn camera(folder: &Path) -> CameraSettings {
    CameraSettings {
        address: CameraAddress::Folder(folder.into()),
        exposure: Micros(5_000),
        image_wait: Duration::from_secs(30),
        settings: Vec::new(),
        light: None,
    }
}

/// The optics of the rig in docs/, within the scripted board's reach.
fn optics() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/rig.toml")
}

fn stack() -> SequenceRequest {
    SequenceRequest {
        axis: Some(AxisName::Fine),
        from: Some(20.0),
        to: Some(180.0),
        steps: Some(3),
        ..SequenceRequest::default()
    }
}
