//! Renders each exposure at the sensor's true position, on its own thread.

use std::{
    sync::{
        Arc,
        mpsc::{Receiver, SyncSender, sync_channel},
    },
    thread::JoinHandle,
};

use farnear_protocol::{
    BoardMicros,
    camera::{FRAME_HEADER, FREE_RUNNING, FrameHeader},
};
use farnear_scene::{Camera, Lens, Psf, Renderer, Scene, View};
use ndarray::Array2;

use crate::{
    error::SimError,
    parts::{HalfMirrorParts, LightParts},
    pictures::Pictures,
    wiring::Shot,
};

/// A picture with its capture time, for cameras that stamp frames by their own clock.
#[derive(Clone, PartialEq, Debug)]
pub struct Picture {
    pub begin_ns: u64,
    pub header: FrameHeader,
    frame: Vec<u8>,
}

impl Picture {
    pub fn new(begin_ns: u64, header: FrameHeader, pixels: &[u16]) -> Self {
        let mut frame = Vec::with_capacity(4 + header.length() as usize);
        frame.extend(header.length().to_le_bytes());
        frame.extend(header.to_bytes());
        frame.extend(pixels.iter().flat_map(|pixel| pixel.to_le_bytes()));
        Self { begin_ns, header, frame }
    }

    fn for_gige(&self) -> farnear_gige::Picture {
        let pixels = self.frame.get(4 + FRAME_HEADER..).unwrap_or_default().to_vec();
        farnear_gige::Picture { begin_ns: self.begin_ns, header: self.header, pixels }
    }
}

/// Separates the second camera's noise from the first's and from nearby seeds.
const OF_THE_SECOND: u64 = 0x5ec0_0d00_0000_0000;

/// The light on the sensor during an exposure, before noise.
struct OpticalImage {
    radiance: Array2<f32>,
    camera: Arc<Camera>,
    noise_seed: u64,
    exposure_number: u32,
    mirrored: bool,
    begin_ns: u64,
    header: FrameHeader,
}

impl OpticalImage {
    fn expose(self) -> Picture {
        let codes = self.camera.expose(self.radiance.view(), self.noise_seed, self.exposure_number);
        let pixels: Vec<u16> = match self.mirrored {
            true => codes.rows().into_iter().flat_map(|row| row.into_iter().rev()).copied().collect(),
            false => codes.into_iter().collect(),
        };
        Picture::new(self.begin_ns, self.header, &pixels)
    }
}

pub struct Imager {
    renderer: Renderer,
    camera: Arc<Camera>,
    noise_seed: u64,
    view: View,
    speed_px_per_s: [f64; 2],
    light: Option<LightParts>,
    further_mm: f64,
    mirrored: bool,
    exposures: u32,
}

impl Imager {
    /// `seed` sets texture and noise. Fails if scene, lens or camera cannot produce a picture.
    pub fn new(scene: &Scene, lens: &Lens, psf: &Psf, camera: Camera, seed: u64) -> Result<Self, SimError> {
        let renderer = Renderer::new(scene, lens, psf, &camera, seed)
            .map_err(|error| SimError::Scene(error.to_string()))?;
        if camera.width_px > usize::from(u16::MAX) || camera.height_px > usize::from(u16::MAX) {
            return Err(SimError::Scene(format!(
                "{} x {} pixels do not fit the endpoint's frames",
                camera.width_px, camera.height_px
            )));
        }
        let (view, speed_px_per_s) = (View::default(), [0.0; 2]);
        Ok(Self {
            renderer,
            camera: Arc::new(camera),
            noise_seed: seed,
            view,
            speed_px_per_s,
            light: None,
            further_mm: 0.0,
            mirrored: false,
            exposures: 0,
        })
    }

    /// The second camera behind a half mirror: its own distance, noise and hot pixels.
    #[must_use]
    pub fn as_second(self, further_mm: f64, mirror: &HalfMirrorParts, seed: u64) -> Self {
        let view = mirror.second_view();
        let (renderer, noise_seed) = (self.renderer.seen_by(view), seed ^ OF_THE_SECOND);
        Self { renderer, noise_seed, view, further_mm, mirrored: mirror.second_mirrored, ..self }
    }

    /// Moves the scene from power-on, without motion blur (exact below a pixel per exposure).
    #[must_use]
    pub fn moving(self, speed_px_per_s: [f64; 2]) -> Self {
        Self { speed_px_per_s, ..self }
    }

    #[must_use]
    pub fn lit_by(self, light: LightParts) -> Self {
        Self { light: Some(light), ..self }
    }

    /// One exposure as the endpoint sends it: length, header, pixels.
    pub fn frame(&mut self, shot: &Shot) -> Result<Vec<u8>, SimError> {
        Ok(self.picture(shot)?.frame)
    }

    fn picture(&mut self, shot: &Shot) -> Result<Picture, SimError> {
        Ok(self.optical_image(shot)?.expose())
    }

    fn optical_image(&mut self, shot: &Shot) -> Result<OpticalImage, SimError> {
        let number = self.exposures;
        self.exposures += 1;
        if self.speed_px_per_s != [0.0; 2] {
            let middle_s = 0.5e-9 * (shot.begin_ns + shot.end_ns) as f64;
            let [right, down] = self.view.shift_px;
            let [right_px_per_s, down_px_per_s] = self.speed_px_per_s;
            let shift_px = [right + right_px_per_s * middle_s, down + down_px_per_s * middle_s];
            self.renderer.look(View { shift_px, ..self.view });
        }
        let exposed_ns = (shot.begin_ns, shot.end_ns);
        let brightness = self.light.map_or((1.0, 0.0), |light| light.brightness(exposed_ns, shot.light));
        let radiance = self
            .renderer
            .lit_radiance(shot.truth.sensor_mm + self.further_mm, brightness)
            .map_err(|error| SimError::Scene(error.to_string()))?;
        let header = FrameHeader {
            shot_id: shot.id,
            exposure: BoardMicros(shot.board_us),
            width: self.camera.width_px as u16,
            height: self.camera.height_px as u16,
            bits: self.camera.noise.bits(),
        };
        Ok(OpticalImage {
            radiance,
            camera: Arc::clone(&self.camera),
            noise_seed: self.noise_seed,
            exposure_number: number,
            mirrored: self.mirrored,
            begin_ns: shot.begin_ns,
            header,
        })
    }
}

/// Renders exposures until the channel closes. `gige` gets all pictures of the first camera. A second thread adds the
/// noise, while this one renders the next exposure.
pub fn watch(
    cameras: Vec<(Imager, SyncSender<Vec<u8>>)>,
    shots: Receiver<Shot>,
    gige: Option<SyncSender<farnear_gige::Picture>>,
    pictures: Arc<Pictures>,
) -> Result<JoinHandle<()>, SimError> {
    let start = |source| SimError::Io { what: "cannot start the camera's thread".into(), source };
    let (mut imagers, frames): (Vec<_>, Vec<_>) = cameras.into_iter().unzip();
    let (images, exposed) = sync_channel(1);
    let done = Arc::clone(&pictures);
    let sensor = std::thread::Builder::new()
        .name("sensor".into())
        .spawn(move || expose(exposed, frames, gige, &done))
        .map_err(start)?;
    let render = move || {
        for (number, shot) in shots.into_iter().enumerate() {
            let dropped = shot.id == FREE_RUNNING && pictures.is_of_ended_run(number);
            let mut rendered = Vec::new();
            for (at, imager) in imagers.iter_mut().enumerate() {
                if dropped || !pictures.wants(at, number) {
                    imager.exposures += 1; // later exposures keep their noise
                    continue;
                }
                match imager.optical_image(&shot) {
                    Ok(image) => rendered.push((at, image)),
                    Err(error) => eprintln!("exposure {}: {error}", shot.id),
                }
            }
            if images.send(rendered).is_err() {
                break; // a client has gone
            }
        }
        drop(images);
        let _ = sensor.join(); // it has reported its panic
    };
    std::thread::Builder::new().name("camera".into()).spawn(render).map_err(start)
}

/// Exposes the images of each shot, with the number of their camera, until the channel or a client closes.
fn expose(
    images: Receiver<Vec<(usize, OpticalImage)>>,
    frames: Vec<SyncSender<Vec<u8>>>,
    mut gige: Option<SyncSender<farnear_gige::Picture>>,
    pictures: &Pictures,
) {
    for shot in images {
        for (at, image) in shot {
            let picture = image.expose();
            if at == 0 {
                // A client that has disconnected is removed.
                gige = gige.take().filter(|gige| gige.send(picture.for_gige()).is_ok());
            }
            if frames[at].send(picture.frame).is_err() {
                return;
            }
        }
        pictures.finish();
    }
}

#[cfg(test)]
mod tests {
    use farnear_scene::{Noise, OpticsFile, standard};

    use super::*;
    use crate::{parts::Parts, plant::ExposureTruth};

    fn shot(begin_ns: u64, sensor_mm: f64) -> Shot {
        let truth = ExposureTruth {
            sensor_mm,
            coarse_um: 0.0,
            lens_um: 0.0,
            piezo_um: 0.0,
            piezo_min_um: 0.0,
            piezo_max_um: 0.0,
        };
        Shot { id: 0, board_us: 0, begin_ns, end_ns: begin_ns + 5_000_000, truth, light: [0.0; 2] }
    }

    fn codes(imager: &mut Imager, shot: &Shot) -> Vec<i32> {
        let picture = imager.picture(shot).expect("a picture");
        picture
            .for_gige()
            .pixels
            .chunks(2)
            .map(|code| i32::from(u16::from_le_bytes([code[0], code[1]])))
            .collect()
    }

    fn imager(parts: &str) -> (Imager, f64) {
        imager_with(parts, Noise::None)
    }

    fn imager_with(parts: &str, noise: Noise) -> (Imager, f64) {
        let imaging = Parts::parse(parts).expect("good parts").imaging;
        let optics = OpticsFile::parse(standard::OPTICS).expect("optics");
        let lens = imaging.lens(Lens::from_optics(&optics).expect("a lens"));
        let camera = Camera { defects: imaging.defects(), ..Camera::new(64, 48, noise) };
        let scene: Scene = "plane:900".parse().expect("a scene");
        let far_mm = lens.sensor_far_mm;
        let imager = Imager::new(&scene, &lens, &standard::PSF, camera, 3).expect("an imager");
        (imager.moving(imaging.scene_px_per_s), far_mm)
    }

    #[test]
    fn a_moving_scene_shifts_the_image() {
        let (mut imager, far_mm) = imager("[imaging]\nscene_px_per_s = [40.0, -20.0]");
        let (before, after) = (shot(0, far_mm), shot(100_000_000, far_mm));
        let (before, after) = (codes(&mut imager, &before), codes(&mut imager, &after));
        // Shift of 4 px right and 2 px up, away from the borders that the blur reaches.
        for row in 10..38 {
            for column in 10..54 {
                let (was, is) = (before[row * 64 + column - 4], after[(row - 2) * 64 + column]);
                // Whole pixels need no interpolation; only f32 sums round.
                assert!((was - is).abs() <= 2, "{was} {is} at row {row}, column {column}");
            }
        }
        assert_ne!(before, after);
    }

    #[test]
    fn lamps_add_to_the_rooms_light_and_flicker_averages_out_over_whole_periods() {
        let light =
            LightParts { room: 0.5, flicker: 0.4, lamps: [0.3, 1.0], ..Parts::default().imaging.light };
        // Per 5 ms.
        let over = |begin_us: u64, length_us: u64| {
            let exposed_ns = (1_000 * begin_us, 1_000 * (begin_us + length_us));
            5_000.0 / length_us as f64 * light.brightness(exposed_ns, [0.5, 0.1]).0
        };
        for begin_us in [0, 1_300, 2_500, 7_500] {
            let lamps = 0.15 + 0.1;
            assert!((over(begin_us, 10_000) - (0.5 + lamps)).abs() < 1e-9, "from {begin_us} us");
            // 1 ms sees the flicker's phase: from its lowest to its highest at 2.5 and 7.5 ms.
            assert!((over(begin_us, 1_000) - (0.5 + lamps)).abs() < 0.2 + 1e-9);
        }
        assert!(over(2_000, 1_000) > over(7_000, 1_000) + 0.39);
        let (lit, far_mm) = imager("");
        let mean = |imager: &mut Imager, outputs: [f64; 2]| {
            let codes = codes(imager, &Shot { light: outputs, ..shot(0, far_mm) });
            codes.iter().map(|code| f64::from(*code)).sum::<f64>() / codes.len() as f64
        };
        let mut lit = lit.lit_by(LightParts { flicker: 0.0, ..light });
        let (dark, bright) = (mean(&mut lit, [0.0; 2]), mean(&mut lit, [1.0, 0.0]));
        assert!((bright / dark - 1.6).abs() < 0.01, "{dark} {bright}");
    }

    #[test]
    fn a_blank_wall_has_structure_only_under_the_projectors_pattern() {
        let blank =
            LightParts { room: 0.5, lamps: [0.0, 0.5], blank_walls: true, ..Parts::default().imaging.light };
        let contrast = |light: LightParts, outputs: [f64; 2]| {
            let (imager, far_mm) = imager("");
            let codes = codes(&mut imager.lit_by(light), &Shot { light: outputs, ..shot(0, far_mm) });
            let mean = codes.iter().map(|code| f64::from(*code)).sum::<f64>() / codes.len() as f64;
            let variance = codes.iter().map(|code| (f64::from(*code) - mean).powi(2)).sum::<f64>();
            (variance / codes.len() as f64).sqrt() / mean
        };
        let textured = contrast(LightParts { blank_walls: false, ..blank }, [0.0; 2]);
        assert!(contrast(blank, [0.0; 2]) < 1e-4, "a wall without a pattern");
        // Half of the light is the room's, which is even.
        let projected = contrast(blank, [0.0, 1.0]);
        assert!((projected / textured - 0.5).abs() < 0.05, "{projected} {textured}");
    }

    #[test]
    fn the_second_camera_is_further_away_with_independent_noise() {
        let parts = Parts::parse("[half_mirror]\nsecond_shift_px = [3.0, -2.0]").expect("good parts");
        let (moved, plain) = (parts.half_mirror, Parts::default().half_mirror);
        let ((mut near, far_mm), (behind, _), (aside, _)) = (imager(""), imager(""), imager(""));
        let further_mm = 0.156;
        let near = codes(&mut near, &shot(0, far_mm + further_mm));
        let far = shot(0, far_mm);
        assert_eq!(codes(&mut behind.as_second(further_mm, &plain, 3), &far), near);
        let aside = codes(&mut aside.as_second(further_mm, &moved, 3), &far);
        for row in 10..38 {
            for column in 10..54 {
                let (was, is) = (near[row * 64 + column - 3], aside[(row - 2) * 64 + column]);
                // Whole pixels need no interpolation; only f32 sums round.
                assert!((was - is).abs() <= 2, "{was} {is} at row {row}, column {column}");
            }
        }

        let noisy = || imager_with("", Noise::EightBit).0;
        let first = codes(&mut noisy(), &far);
        let second = codes(&mut noisy().as_second(0.0, &plain, 3), &far);
        let differ = first.iter().zip(&second).filter(|(first, second)| first != second).count();
        // Shot noise of 9000 of 20,000 electrons is 1.2 codes of 255: some 80 % of two draws differ.
        assert!(differ > first.len() / 2, "{differ} of {}", first.len());
        let mirrored = HalfMirrorParts { second_mirrored: true, ..plain };
        let turned = codes(&mut noisy().as_second(0.0, &mirrored, 3), &far);
        let rows = |codes: &[i32]| codes.chunks(64).map(<[i32]>::to_vec).collect::<Vec<_>>();
        let back: Vec<Vec<i32>> =
            rows(&turned).iter().map(|row| row.iter().rev().copied().collect()).collect();
        assert_eq!(rows(&second), back);
    }

    #[test]
    fn the_parts_file_sets_lens_and_light() {
        let (mut plain, far_mm) = imager("");
        let plain = codes(&mut plain, &shot(0, far_mm));
        for parts in [
            "field_curvature = 0.45",
            "vignetting = 0.2",
            "uneven_light = [0.3, 0.0]",
            "hot_pixel_share = 0.01",
        ] {
            let (mut other, _) = imager(&format!("[imaging]\n{parts}"));
            assert_ne!(codes(&mut other, &shot(0, far_mm)), plain, "{parts}");
        }
        assert!(Parts::parse("[imaging]\nvignetting = 2.0").is_ok_and(|parts| {
            let camera = Camera { defects: parts.imaging.defects(), ..Camera::default() };
            let lens =
                Lens::from_optics(&OpticsFile::parse(standard::OPTICS).expect("optics")).expect("a lens");
            let scene: Scene = "plane:900".parse().expect("a scene");
            Imager::new(&scene, &lens, &standard::PSF, camera, 3)
                .is_err_and(|error| error.to_string().contains("vignetting = 2"))
        }));
    }
}
