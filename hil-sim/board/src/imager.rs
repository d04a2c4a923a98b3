//! The camera's images: renders each exposure at the place where the sensor really was, on a thread of its own,
//! so that the emulator waits for a picture only where many are due ([`crate::pictures`]).

use std::{
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
        mpsc::{Receiver, SyncSender},
    },
    thread::JoinHandle,
};

use farnear_protocol::{
    BoardMicros,
    camera::{FRAME_HEADER, FrameHeader},
};
use farnear_scene::{Camera, Lens, Psf, Renderer, Scene};

use crate::{error::SimError, wiring::Shot};

/// A picture with when it was taken, for a camera that stamps its frames by a clock of its own.
#[derive(Clone, PartialEq, Debug)]
pub struct Picture {
    /// Start of the exposure, virtual nanoseconds.
    pub begin_ns: u64,
    /// What it is.
    pub header: FrameHeader,
    /// As the endpoint sends it.
    frame: Vec<u8>,
}

impl Picture {
    /// A picture of these pixels.
    pub fn new(begin_ns: u64, header: FrameHeader, pixels: &[u16]) -> Self {
        let mut frame = Vec::with_capacity(4 + header.length() as usize);
        frame.extend(header.length().to_le_bytes());
        frame.extend(header.to_bytes());
        frame.extend(pixels.iter().flat_map(|pixel| pixel.to_le_bytes()));
        Self { begin_ns, header, frame }
    }

    /// Its pixels row by row, 16 bits each, the lower byte first.
    pub fn pixels(&self) -> &[u8] {
        self.frame.get(4 + FRAME_HEADER..).unwrap_or_default()
    }
}

/// Renders exposures.
pub struct Imager {
    renderer: Renderer,
    camera: Camera,
    exposures: u32,
}

impl Imager {
    /// A camera before a scene; the seed makes its texture and noise.
    ///
    /// # Errors
    /// [`SimError::Scene`] where the scene, the lens or the camera make no picture.
    pub fn new(scene: &Scene, lens: &Lens, psf: &Psf, camera: Camera, seed: u64) -> Result<Self, SimError> {
        let renderer = Renderer::new(scene, lens, psf, &camera, seed)
            .map_err(|error| SimError::Scene(error.to_string()))?;
        if camera.width_px > usize::from(u16::MAX) || camera.height_px > usize::from(u16::MAX) {
            return Err(SimError::Scene(format!(
                "{} x {} pixels do not fit the endpoint's frames",
                camera.width_px, camera.height_px
            )));
        }
        Ok(Self { renderer, camera, exposures: 0 })
    }

    /// One exposure as the endpoint sends it: length, header, pixels.
    ///
    /// # Errors
    /// [`SimError::Scene`].
    pub fn frame(&mut self, shot: &Shot) -> Result<Vec<u8>, SimError> {
        Ok(self.picture(shot)?.frame)
    }

    fn picture(&mut self, shot: &Shot) -> Result<Picture, SimError> {
        let number = self.exposures;
        self.exposures += 1;
        let image = self
            .renderer
            .expose(shot.truth.sensor_mm, number)
            .map_err(|error| SimError::Scene(error.to_string()))?;
        let header = FrameHeader {
            shot_id: shot.id,
            exposure: BoardMicros(shot.board_us),
            width: self.camera.width_px as u16,
            height: self.camera.height_px as u16,
            bits: self.camera.noise.bits(),
        };
        let pixels: Vec<u16> = image.iter().copied().collect();
        Ok(Picture::new(shot.begin_ns, header, &pixels))
    }

    /// Renders what comes until nothing can come any more; counts `waiting` down with each. `second` gets all of it, too.
    ///
    /// # Errors
    /// [`SimError::Io`] where no thread can be started.
    pub fn watch(
        mut self,
        shots: Receiver<Shot>,
        frames: SyncSender<Vec<u8>>,
        mut second: Option<SyncSender<Picture>>,
        waiting: Arc<AtomicUsize>,
    ) -> Result<JoinHandle<()>, SimError> {
        std::thread::Builder::new()
            .name("camera".into())
            .spawn(move || {
                for shot in shots {
                    match self.picture(&shot) {
                        Ok(picture) => {
                            // A second camera that has ended is missed by nobody.
                            second = second.take().filter(|second| second.send(picture.clone()).is_ok());
                            if frames.send(picture.frame).is_err() {
                                return;
                            }
                        }
                        Err(error) => eprintln!("exposure {}: {error}", shot.id),
                    }
                    waiting.fetch_sub(1, Ordering::Relaxed);
                }
            })
            .map_err(|source| SimError::Io { what: "cannot start the camera's thread".into(), source })
    }
}
