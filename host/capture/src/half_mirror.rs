//! A pair of one exposure by two cameras behind a half mirror, one sensor further from the lens (Li 2014, 5.5, 10.2).

use farnear_protocol::message::{Shot, ShotRecord};

use crate::{
    average::Average,
    camera::Camera,
    client::Client,
    describe::um,
    expose::{CaptureError, expose_together, strobe_note},
    pair::{Exposures, Pair, pair_of, reach},
    plan::SensorPair,
};

/// A pair of one exposure (or several, averaged) at the far position; the second sensor is `further_mm` further away.
pub fn capture_behind_mirror(
    client: &Client,
    cameras: [&mut dyn Camera; 2],
    sensor: &SensorPair,
    further_mm: f64,
    exposures: &Exposures,
    say: &mut dyn FnMut(&str),
) -> Result<Pair, CaptureError> {
    // The piezo only has to reach the far position, in the middle of its range.
    let only_far = SensorPair { far_mm: sensor.far_mm, near_mm: sensor.far_mm };
    let reach = reach(client, &only_far, exposures, say)?;
    let [far, _] = reach.shots;
    say(&format!("exposing both cameras (piezo at {:.3} um)", um(far.target)));
    let repeat = exposures.averaged.max(1);
    let shots = [Shot { repeat, ..far }];
    let mut cameras = cameras;
    let mut taken: [Option<(ShotRecord, Average)>; 2] = [None, None];
    let mut reported = 0;
    let asked = 2 * usize::from(repeat);
    let images = expose_together(client, &mut cameras, &shots, exposures.image_wait, |at, record, image| {
        reported += 1;
        match taken.get_mut(at) {
            Some(Some((_, average))) => average.add(&image),
            Some(none) => *none = Some((record, Average::of(image))),
            None => return Err(CaptureError::Count { reported, asked }),
        }
        Ok(())
    });
    images?;
    let [Some(far), Some(near)] = taken else { return Err(CaptureError::Count { reported, asked }) };
    if let Some(note) = strobe_note(&far.0) {
        say(&note);
    }
    let both = [far, near].map(|(record, average)| (record, average.finish()));
    let mut pair = pair_of(both, sensor, reach.coarse, &client.hello().limits)?;
    pair.near.sensor_measured_mm += further_mm;
    pair.further_mm = Some(further_mm);
    Ok(pair)
}
