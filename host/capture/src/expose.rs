use std::time::{Duration, Instant};

use farnear_protocol::{
    message::{Axis, EventKind, Limits, Shot, ShotRecord, TriggerMode, sensor_distance_nm},
    units::{Micros, Nanometres},
};

use crate::{
    camera::{Camera, CameraError, Image},
    client::Client,
    error::ClientError,
    plan::PlanError,
    work::{Step, wrong_end},
};

const SLICE: Duration = Duration::from_millis(50);
/// Longest wait: a longer one may be beyond the end of the clock.
const A_DAY: Duration = Duration::from_secs(86_400);
/// Permitted difference of strobe and exposure, as of the board: cameras count exposure in lines of some 10 us.
const STROBE_OFF_US: u64 = 100;

#[derive(Debug, thiserror::Error)]
pub enum CaptureError {
    #[error(transparent)]
    Board(#[from] ClientError),
    #[error(transparent)]
    Plan(#[from] PlanError),
    #[error(transparent)]
    Camera(#[from] CameraError),
    #[error("camera {number} of {cameras}: {source}")]
    OneCamera { number: usize, cameras: usize, source: CameraError },
    #[error(
        "the far image has {far_width}x{far_height} pixels of {far_bits} bits, the near one {near_width}x{near_height} of {near_bits}"
    )]
    Unlike {
        far_width: usize,
        far_height: usize,
        far_bits: u8,
        near_width: usize,
        near_height: usize,
        near_bits: u8,
    },
    #[error("the board reported {reported} exposures, {asked} were requested")]
    Count { reported: usize, asked: usize },
    #[error(
        "shot {index} is triggered by {found}, the ones before by {first}; a program's shots must have one trigger"
    )]
    MixedTriggers { index: usize, found: &'static str, first: &'static str },
    #[error(
        "shot {index} exposes for {found} us, the ones before for {first} us; a camera of the kind `{camera}` exposes for the one \
         time that is set before the program: give all shots the same exposure_us, or set the camera to expose for the trigger pulse"
    )]
    MixedExposures { camera: &'static str, index: usize, found: u32, first: u32 },
}

/// Runs a program; passes each exposure with its image (within `image_wait`) to `on_image`, whose error stops the rig.
pub fn expose<E: From<CaptureError> + From<ClientError>>(
    client: &Client,
    camera: &mut dyn Camera,
    shots: &[Shot],
    image_wait: Duration,
    mut on_image: impl FnMut(ShotRecord, Image) -> Result<(), E>,
) -> Result<(), E> {
    expose_together(client, &mut [camera], shots, image_wait, |_, shot, image| on_image(shot, image))
}

/// As [`expose`] for any number of shots: one program after the other, each as long as the board can hold. The cameras
/// stay armed between them, so that a frame lost there is noticed. `on_image` receives the index of the shot in `shots`.
pub fn expose_in_parts<E: From<CaptureError> + From<ClientError>>(
    client: &Client,
    camera: &mut dyn Camera,
    shots: &[Shot],
    image_wait: Duration,
    mut on_image: impl FnMut(usize, ShotRecord, Image) -> Result<(), E>,
) -> Result<(), E> {
    let length = usize::from(client.hello().limits.shots_max.max(1));
    let formats = &mut [Format::default()];
    with_armed(&mut [camera], shots, |cameras| {
        shots.chunks(length).enumerate().try_for_each(|(part, shots)| {
            run_armed(client, cameras, formats, shots, image_wait, |_, record, image| {
                let (index, asked) = (usize::from(record.index), shots.len());
                if index >= asked {
                    return Err(CaptureError::Count { reported: index + 1, asked }.into());
                }
                on_image(part * length + index, record, image)
            })
        })
    })
}

/// As [`expose`] with several cameras on one trigger: `on_image` receives each image with its camera's index.
pub fn expose_together<E: From<CaptureError> + From<ClientError>>(
    client: &Client,
    cameras: &mut [&mut dyn Camera],
    shots: &[Shot],
    image_wait: Duration,
    on_image: impl FnMut(usize, ShotRecord, Image) -> Result<(), E>,
) -> Result<(), E> {
    let formats = &mut vec![Format::default(); cameras.len()];
    with_armed(cameras, shots, |cameras| run_armed(client, cameras, formats, shots, image_wait, on_image))
}

/// An exposure by an armed camera, whose count and time stamps later frames are compared with.
pub(crate) fn expose_first(
    client: &Client,
    camera: &mut dyn Camera,
    shot: Shot,
    image_wait: Duration,
) -> Result<(), CaptureError> {
    let once = [Shot { repeat: 1, ..shot }];
    run_armed(client, &mut [camera], &mut [Format::default()], &once, image_wait, |_, _, _| Ok(()))
}

fn of_camera(at: usize, count: usize) -> impl Fn(CameraError) -> CaptureError {
    move |source| match count {
        1 => CaptureError::Camera(source),
        cameras => CaptureError::OneCamera { number: at + 1, cameras, source },
    }
}

/// Size and bits of a camera's images, which stay the same during a program.
#[derive(Clone, Copy, Default)]
pub(crate) struct Format(Option<((usize, usize), u8)>);

impl Format {
    /// Fails for an image unlike the first one.
    pub(crate) fn check(&mut self, image: &Image, trigger_number: u32) -> Result<(), CameraError> {
        let now @ ((height, width), bits) = (image.pixels.dim(), image.bits);
        let first @ ((first_height, first_width), first_bits) = *self.0.get_or_insert(now);
        match now == first {
            true => Ok(()),
            false => Err(CameraError::Reformatted {
                trigger_number,
                width,
                height,
                bits,
                first_width,
                first_height,
                first_bits,
            }),
        }
    }
}

/// Arms the cameras for `work`.
fn with_armed<E: From<CaptureError>>(
    cameras: &mut [&mut dyn Camera],
    shots: &[Shot],
    work: impl FnOnce(&mut [&mut dyn Camera]) -> Result<(), E>,
) -> Result<(), E> {
    let (mode, exposure) = one_trigger(shots)?;
    for camera in cameras.iter_mut() {
        check_exposures(&mut **camera, shots)?;
    }
    let count = cameras.len();
    for (at, camera) in cameras.iter_mut().enumerate() {
        camera.arm(mode, exposure).map_err(of_camera(at, count))?;
    }
    let run = work(cameras);
    if mode != TriggerMode::FreeRunning {
        return run;
    }
    // Re-enables the cameras' trigger lines in any case.
    let disarm = |(at, camera): (usize, &mut &mut dyn Camera)| {
        camera.arm(TriggerMode::Hardware, exposure).map_err(of_camera(at, count))
    };
    let disarmed = cameras.iter_mut().enumerate().try_for_each(disarm);
    run?;
    disarmed?;
    Ok(())
}

/// Runs one program with armed cameras, each with the format of its earlier images.
fn run_armed<E: From<CaptureError> + From<ClientError>>(
    client: &Client,
    cameras: &mut [&mut dyn Camera],
    formats: &mut [Format],
    shots: &[Shot],
    image_wait: Duration,
    mut on_image: impl FnMut(usize, ShotRecord, Image) -> Result<(), E>,
) -> Result<(), E> {
    let count = cameras.len();
    let mut reported = 0;
    run_program(client, shots, |kind, received| -> Result<(), E> {
        match kind {
            EventKind::ShotReady { trigger_number, exposure, .. } => {
                for (at, camera) in cameras.iter_mut().enumerate() {
                    camera.trigger(*trigger_number, *exposure).map_err(of_camera(at, count))?;
                }
            }
            EventKind::ShotDone { shot, .. } => {
                reported += 1;
                for ((at, camera), format) in cameras.iter_mut().enumerate().zip(&mut *formats) {
                    camera.reported(shot, received);
                    let image = wait_for_image(client, &mut **camera, shot, image_wait);
                    let image = image.map_err(|error| match error {
                        CaptureError::Camera(source) => of_camera(at, count)(source),
                        other => other,
                    })?;
                    format.check(&image, shot.trigger_number).map_err(of_camera(at, count))?;
                    on_image(at, *shot, image)?;
                }
            }
            _ => {}
        }
        Ok(())
    })?;
    let asked = shots.iter().map(|shot| usize::from(shot.repeat)).sum();
    if reported != asked {
        return Err(CaptureError::Count { reported, asked }.into());
    }
    for (at, camera) in cameras.iter_mut().enumerate() {
        expect_no_more(client, &mut **camera).map_err(|error| match error {
            CaptureError::Camera(source) => of_camera(at, count)(source),
            other => other,
        })?;
    }
    Ok(())
}

/// As [`Client::run_program`], with the arrival time of each event.
fn run_program<E: From<CaptureError> + From<ClientError>>(
    client: &Client,
    shots: &[Shot],
    mut on_event: impl FnMut(&EventKind, Instant) -> Result<(), E>,
) -> Result<(), E> {
    client.arm(shots)?;
    let mut work = client.start_program(shots)?;
    loop {
        match work.step()? {
            Step::Event(kind) => on_event(&kind, work.received())?,
            Step::Done(EventKind::ProgramDone { .. }) => return Ok(()),
            Step::Done(other) => {
                return Err(wrong_end("running the exposure program", &other).into());
            }
        }
    }
}

/// Waits until surplus pictures of a program are impossible.
fn expect_no_more(client: &Client, camera: &mut dyn Camera) -> Result<(), CaptureError> {
    let until = Instant::now() + camera.quiet_time();
    loop {
        if client.interrupted() {
            let during = "waiting for surplus images".into();
            return Err(ClientError::Interrupted { during, stopped: true }.into());
        }
        camera.finish(until.saturating_duration_since(Instant::now()).min(SLICE))?;
        if Instant::now() >= until {
            return Ok(());
        }
    }
}

/// Whether the board can take these shots in one program, by its limits.
pub fn check_shots(client: &Client, shots: &[Shot]) -> Result<(), CaptureError> {
    let max = client.hello().limits.shots_max;
    if shots.is_empty() || shots.len() > usize::from(max) {
        return Err(PlanError::Shots { asked: shots.len(), max }.into());
    }
    check_each_shot(client, shots)
}

/// As [`check_shots`] for [`expose_in_parts`], without a limit of their number.
pub fn check_each_shot(client: &Client, shots: &[Shot]) -> Result<(), CaptureError> {
    one_trigger(shots)?;
    for shot in shots {
        check_exposure(client, shot.exposure)?;
        check_position(client, shot.axis, shot.target)?;
    }
    Ok(())
}

/// Whether a position is within the board's limits for this axis.
pub fn check_position(client: &Client, axis: Axis, asked: Nanometres) -> Result<(), PlanError> {
    let (min, max) = client.hello().limits.of(axis);
    match (min..=max).contains(&asked) {
        true => Ok(()),
        false => Err(PlanError::Position { axis: axis.name(), asked, min, max }),
    }
}

pub fn check_exposure(client: &Client, asked: Micros) -> Result<(), PlanError> {
    let limits = &client.hello().limits;
    let (min, max) = (limits.exposure_min, limits.exposure_max);
    match (min..=max).contains(&asked) {
        true => Ok(()),
        false => Err(PlanError::Exposure { asked, min, max }),
    }
}

/// Common trigger mode of a program, and its first exposure time.
pub(crate) fn one_trigger(shots: &[Shot]) -> Result<(TriggerMode, Micros), CaptureError> {
    let Some(first) = shots.first() else { return Ok((TriggerMode::Hardware, Micros(0))) };
    match shots.iter().position(|shot| shot.mode != first.mode) {
        None => Ok((first.mode, first.exposure)),
        Some(index) => Err(CaptureError::MixedTriggers {
            index,
            found: crate::describe::trigger_name(shots[index].mode),
            first: crate::describe::trigger_name(first.mode),
        }),
    }
}

/// Whether the camera can take these shots: one that sets its own exposure cannot change it within a program.
pub fn check_exposures(camera: &mut dyn Camera, shots: &[Shot]) -> Result<(), CaptureError> {
    let Some(first) = shots.first() else { return Ok(()) };
    match shots.iter().position(|shot| shot.exposure != first.exposure) {
        Some(index) if camera.sets_exposure(first.mode) => Err(CaptureError::MixedExposures {
            camera: camera.kind(),
            index,
            found: shots[index].exposure.0,
            first: first.exposure.0,
        }),
        _ => Ok(()),
    }
}

/// A message if the camera's strobe was longer or shorter than the exposure.
pub fn strobe_note(record: &ShotRecord) -> Option<String> {
    let asked_us = u64::from(record.exposure.0);
    let strobe_us = record.strobe_end.0.saturating_sub(record.strobe_start.0);
    (strobe_us.abs_diff(asked_us) > STROBE_OFF_US + asked_us / 100).then(|| {
        format!(
            "the strobe of exposure {} lasted {strobe_us} us, expected {asked_us} us; check the camera's own exposure time",
            record.trigger_number
        )
    })
}

/// Largest share of an exposure, as a divisor, that the board's light may miss without a message.
const UNLIT: u64 = 20;

/// A message if the board's light, which is on during the trigger pulse, missed more than a twentieth of the exposure.
pub fn unlit_note(record: &ShotRecord) -> Option<String> {
    let pulse_end = record.trigger.0.saturating_add(u64::from(record.exposure.0));
    let strobe_us = record.strobe_end.0.saturating_sub(record.strobe_start.0);
    let unlit_us = record.strobe_end.0.saturating_sub(pulse_end).min(strobe_us);
    (unlit_us.saturating_mul(UNLIT) > strobe_us).then(|| {
        format!(
            "the board's light is on during the trigger pulse only, and the camera exposes later: exposure {} was dark for {unlit_us} of its \
             {strobe_us} us; expose longer, or shorten the camera's trigger delay",
            record.trigger_number
        )
    })
}

/// Sensor distance by encoders and gauge, mm.
pub fn sensor_mm(record: &ShotRecord, limits: &Limits) -> f64 {
    sensor_distance_nm(limits.datum, |axis| record.measured(axis)) as f64 / 1e6
}

pub(crate) fn wait_for_image(
    client: &Client,
    camera: &mut dyn Camera,
    record: &ShotRecord,
    allowed: Duration,
) -> Result<Image, CaptureError> {
    let until = Instant::now() + allowed.min(A_DAY);
    loop {
        let left = until.saturating_duration_since(Instant::now());
        match camera.image(record, left.min(SLICE)) {
            Err(CameraError::Late { camera, trigger_number, .. }) => {
                if client.interrupted() {
                    let during = "waiting for the camera's image".into();
                    return Err(ClientError::Interrupted { during, stopped: true }.into());
                }
                if Instant::now() >= until {
                    return Err(CameraError::Late { camera, trigger_number, waited: allowed }.into());
                }
            }
            result => return Ok(result?),
        }
    }
}

#[cfg(test)]
mod tests {
    use farnear_protocol::units::BoardMicros;

    use super::*;
    use crate::continuous::tests::frame;

    #[test]
    fn reports_an_exposure_that_the_light_missed() {
        let note = |exposure_us: u32, delay_us: u64| {
            let strobe_start = BoardMicros(1_000 + delay_us);
            let strobe_end = BoardMicros(strobe_start.0 + u64::from(exposure_us));
            let (trigger, exposure) = (BoardMicros(1_000), Micros(exposure_us));
            unlit_note(&ShotRecord { trigger, strobe_start, strobe_end, exposure, ..frame(7, 0).record })
        };
        assert_eq!([note(400, 20), note(5_000, 20), note(1_000_000, 20_000)], [None, None, None]);
        let half = note(40, 20).unwrap_or_default();
        assert!(half.contains("exposure 7 was dark for 20 of its 40 us"), "{half}");
        let dark = note(1_000, 20_000).unwrap_or_default();
        assert!(dark.contains("for 1000 of its 1000 us"), "{dark}");
    }

    #[test]
    fn reports_a_strobe_of_another_length_than_the_exposure() {
        let note = |exposure_us: u32, strobe_us: u64| {
            strobe_note(&ShotRecord {
                strobe_start: BoardMicros(1_000),
                strobe_end: BoardMicros(1_000 + strobe_us),
                exposure: Micros(exposure_us),
                ..frame(7, 0).record
            })
        };
        assert_eq!([note(2_000, 1_900), note(2_000, 2_120), note(100_000, 101_000)], [None, None, None]);
        let longer = note(2_000, 5_000).unwrap_or_default();
        assert!(longer.contains("exposure 7 lasted 5000 us, expected 2000 us"), "{longer}");
        assert!(note(2_000, 1_000).is_some());
    }
}
