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

use farnear_protocol::{BoardMicros, camera::FrameHeader};
use farnear_scene::{Camera, Lens, Psf, Renderer, Scene};

use crate::{error::SimError, wiring::Shot};

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
        let mut bytes = Vec::with_capacity(4 + header.length() as usize);
        bytes.extend(header.length().to_le_bytes());
        bytes.extend(header.to_bytes());
        bytes.extend(image.iter().flat_map(|pixel| pixel.to_le_bytes()));
        Ok(bytes)
    }

    /// Renders what comes until nothing can come any more; counts `waiting` down with each.
    ///
    /// # Errors
    /// [`SimError::Io`] where no thread can be started.
    pub fn watch(
        mut self,
        shots: Receiver<Shot>,
        frames: SyncSender<Vec<u8>>,
        waiting: Arc<AtomicUsize>,
    ) -> Result<JoinHandle<()>, SimError> {
        std::thread::Builder::new()
            .name("camera".into())
            .spawn(move || {
                for shot in shots {
                    match self.frame(&shot) {
                        Ok(frame) => {
                            if frames.send(frame).is_err() {
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
