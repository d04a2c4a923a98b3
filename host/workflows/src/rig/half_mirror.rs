//! Captures a far- and a near-focused image in one exposure, by two cameras behind a half mirror.

use farnear_capture::{
    camera::Camera,
    half_mirror::capture_behind_mirror,
    pair::Exposures,
    plan::SensorPair,
    record::{HalfMirrorRecord, begin_folder, finish_folder},
};
use farnear_depth::optics::Optics;
use ndarray::Axis;

use super::{
    RigAddress,
    camera::{CameraAddress, CameraSettings, OTHERS},
    pair::{CaptureRequest, PairFigures, noted, unlit, warn_of_images},
};
use crate::{
    context::Context,
    error::{Result, WorkflowError},
    optics::GivenOptics,
    parameters::within,
    request::Request,
};

/// Distance between both sensors along the axis, um: a thousandth of a piezo's travel to far more than any lens needs.
const FURTHER_UM: std::ops::RangeInclusive<f64> = 0.1..=10_000.0;
/// Relative difference from the optics' distance that gives a warning: depth is off by about the same share.
const UNLIKE: f64 = 0.005;

/// Homes if needed, moves to the far focus, triggers both cameras. Checks everything before any motion.
pub(super) fn capture(settings: &CaptureRequest, context: &Context<'_>) -> Result<PairFigures> {
    let CaptureRequest { camera, average: averaged, out, .. } = settings;
    let optics = GivenOptics::read(&settings.optics)?;
    settings.check()?;
    let range = optics.optics.working_range();
    let sensor = SensorPair { far_mm: range.sensor_far_mm, near_mm: range.sensor_near_mm };
    let further_um = settings.second_further_um.unwrap_or((sensor.near_mm - sensor.far_mm) * 1e3);
    within("second-further-um", further_um, &FURTHER_UM, "um")?;
    let second = CameraSettings { address: second_address(settings)?, ..camera.clone() };
    if let Some(doubt) = doubt(&optics.optics, &sensor, further_um) {
        context.progress.warn(&doubt);
    }
    let folder = begin_folder(out)?;
    let address = match &settings.rig {
        RigAddress::Emulated(scenery) => {
            let mut scenery = scenery.clone();
            scenery.half_mirror_um = Some(further_um);
            RigAddress::Emulated(scenery)
        }
        other => other.clone(),
    };
    let early = camera.open_early(&address, context)?;
    let early_second = second.open_early(&address, context)?;
    let (mut equipped, mut second) = early.connect_both(early_second, &address, Some(&optics), context)?;
    let exposures = Exposures {
        exposure: camera.exposure,
        image_wait: camera.image_wait,
        averaged: *averaged,
        ..Exposures::default()
    };
    let cameras: [&mut dyn Camera; 2] = [equipped.camera.as_mut(), second.as_mut()];
    let say = &mut |what: &str| context.info(what);
    let client = &equipped.rig.client;
    let mut pair = capture_behind_mirror(client, cameras, &sensor, further_um * 1e-3, &exposures, say)?;
    if settings.second_mirrored {
        pair.near.image.pixels.invert_axis(Axis(1));
    }
    if let Some(doubt) = camera.light_with(Some(&optics)).and_then(|_| unlit(&pair)) {
        context.progress.warn(&doubt);
    }
    warn_of_images(&pair, context);
    let mut record = noted(&pair, &equipped, &optics, camera, *averaged);
    record.half_mirror = Some(HalfMirrorRecord {
        second_camera: second.kind().into(),
        second_further_um: further_um,
        second_mirrored: settings.second_mirrored,
    });
    finish_folder(folder, &pair, &record)?;
    context.info(&format!("wrote {}", out.display()));
    Ok(PairFigures::from(&pair))
}

fn second_address(settings: &CaptureRequest) -> Result<CameraAddress> {
    let CaptureRequest { rig, camera, camera_frames: frames, .. } = settings;
    let named: Option<CameraAddress> = settings.second_camera.as_deref().map(str::parse).transpose()?;
    let second =
        |value: &str, expected: String| Err(WorkflowError::parameter("second-camera", value, expected));
    if let Some(frames) = frames {
        let expected =
            "the dark and flat frames of one camera are not the other's: leave them out".to_string();
        return Err(WorkflowError::parameter("camera-frames", frames.display(), expected));
    }
    match &named {
        Some(CameraAddress::Emulated) | None
            if camera.address != CameraAddress::Emulated || !rig.is_emulated() =>
        {
            second(
                "none",
                format!(
                    "a half mirror needs a second camera, which takes the near image: name one of {OTHERS}; the emulated rig \
                 has two by itself"
                ),
            )
        }
        Some(address) if *address == camera.address && *address != CameraAddress::Emulated => second(
            "as the first",
            "it is the camera that takes the far image already: name another one".into(),
        ),
        Some(address) => Ok(address.clone()),
        None => Ok(CameraAddress::Emulated),
    }
}

fn doubt(optics: &Optics, sensor: &SensorPair, further_um: f64) -> Option<String> {
    let asked_um = (sensor.near_mm - sensor.far_mm) * 1e3;
    if (further_um / asked_um - 1.0).abs() <= UNLIKE {
        return None;
    }
    let near_mm = sensor.far_mm + further_um * 1e-3;
    let focal_mm = optics.focal_length_mm();
    let object_mm = focal_mm * near_mm / (near_mm - focal_mm);
    Some(format!(
        "the second sensor stands {further_um:.2} um further from the lens than the first, the optics ask for {asked_um:.2} um, so depth will \
         be off; with `near_mm = {object_mm:.2}` in [focus], in place of max_blur_px, they agree"
    ))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    const OPTICS: &str = "[lens]\nfocal_length_mm = 50.0\naperture_mm = 12.8\n[sensor]\npixel_um = 7.4\n[focus]\nfar_mm = 933.0\n";

    #[test]
    fn a_wrong_distance_is_reported_with_the_right_one() {
        let read = |focus: &str| {
            let optics =
                GivenOptics::parse(&format!("{OPTICS}{focus}"), Path::new("optics.toml")).expect("good");
            let range = optics.optics.working_range();
            (optics.optics, SensorPair { far_mm: range.sensor_far_mm, near_mm: range.sensor_near_mm })
        };
        let (optics, sensor) = read("max_blur_px = 2.703");
        assert_eq!(doubt(&optics, &sensor, 156.3), None);
        let said = doubt(&optics, &sensor, 140.0).expect("it does not fit");
        let (_, near_mm) = said.split_once("near_mm = ").expect("the one that does");
        let (near_mm, _) = near_mm.split_once('`').expect("a number");
        let (optics, sensor) = read(&format!("near_mm = {near_mm}"));
        assert_eq!(doubt(&optics, &sensor, 140.0), None, "{said}");
    }
}
