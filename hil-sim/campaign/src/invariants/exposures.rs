use std::collections::{BTreeMap, BTreeSet};

use farnear_protocol::{
    EventKind, Request,
    camera::FREE_RUNNING,
    message::{Axis, ShotRecord},
};

use super::{Broken, Case, positions};
use farnear_sim::{
    observer::{Seen, Sight},
    wiring::Shot,
};

/// Stamps are whole microseconds; each end is rounded separately.
const STAMP_US: u64 = 2;
/// Deadline for the event that ends a run after an unreported exposure.
const TOLD_NS: u64 = 50_000_000;

fn broken(at_ns: u64, what: String) -> Broken {
    Broken { property: "exposure", at_ns, what }
}

pub fn exposure(case: &Case<'_>) -> Vec<Broken> {
    let mut found = Vec::new();
    // Exposures since the last reset, and whether they were reported.
    let mut taken: Vec<(Shot, bool)> = Vec::new();
    let mut shots: BTreeMap<u32, u32> = BTreeMap::new();
    let mut windows: Vec<i32> = Vec::new();
    // Index and exposure of the loaded shots. The board keeps them over a reset.
    let mut loaded: BTreeSet<(u8, u32)> = BTreeSet::new();
    let mut reset_ns = 0;
    for sight in case.sights {
        match &sight.seen {
            Seen::Asked { call, .. } => {
                if let Request::LoadShot { index, shot } = &call.request {
                    windows.push(shot.settle_window.0);
                    loaded.insert((*index, shot.exposure.0));
                }
            }
            // The camera completes an exposure even if the board was reset meanwhile.
            Seen::Exposed(shot) if shot.begin_ns >= reset_ns => taken.push((*shot, false)),
            Seen::Reset | Seen::Powered(_) => {
                // The reset is reported by the first event of the next boot.
                reset_ns = sight.at_ns;
                taken.clear();
                shots.clear();
            }
            Seen::Reported { number, event, .. } => {
                let (record, deviation) = match &event.kind {
                    EventKind::ShotDone { shot, .. } => (shot, None),
                    EventKind::FrameTaken { shot, deviation, .. } => (shot, Some(deviation.0)),
                    _ => continue,
                };
                if *shots.entry(record.trigger_number).or_insert(*number) != *number {
                    let what = format!("trigger {} was reported by two events", record.trigger_number);
                    found.push(broken(sight.at_ns, what));
                    continue;
                }
                let Some((shot, reported)) =
                    taken.iter_mut().find(|(shot, _)| shot.id == record.trigger_number)
                else {
                    let what = format!("trigger {} was reported but never taken", record.trigger_number);
                    found.push(broken(sight.at_ns, what));
                    continue;
                };
                *reported = true;
                if !loaded.contains(&(record.index, record.exposure.0)) {
                    let (number, index, us) = (record.trigger_number, record.index, record.exposure.0);
                    let what =
                        format!("trigger {number} has {us} us, which shot {index} was never loaded with");
                    found.push(broken(sight.at_ns, what));
                }
                // The record has no tolerance; the widest requested one applies.
                let window_nm = windows.iter().copied().max().unwrap_or(0);
                let reported_off = deviation.is_some_and(|nm| nm > window_nm);
                found.extend(check_exposure(case, sight, (shot, record), (window_nm, reported_off)));
            }
            _ => {}
        }
        let unreported = taken.iter_mut().find(|(shot, reported)| {
            !reported && shot.id != FREE_RUNNING && sight.at_ns > shot.end_ns + TOLD_NS
        });
        if let Some((shot, reported)) = unreported {
            *reported = true;
            if !is_excused(case.sights, shot) {
                found.push(broken(
                    shot.end_ns,
                    format!("the exposure of trigger {} was never reported", shot.id),
                ));
            }
        }
    }
    found
}

fn is_excused(sights: &[Sight], shot: &Shot) -> bool {
    let near = |sight: &&Sight| {
        sight.at_ns + TOLD_NS > shot.begin_ns && sight.at_ns < shot.end_ns + TOLD_NS + 500_000_000
    };
    sights.iter().filter(near).any(|sight| match &sight.seen {
        Seen::Reset | Seen::Powered(_) => true,
        Seen::Reported { event, .. } => matches!(
            event.kind,
            EventKind::Failed { .. } | EventKind::FrameDropped { .. } | EventKind::Alarm(_)
        ),
        _ => false,
    })
}

fn check_exposure(
    case: &Case<'_>,
    sight: &Sight,
    (shot, record): (&Shot, &ShotRecord),
    (window_nm, reported_off): (i32, bool),
) -> Option<Broken> {
    // A cut strobe wire and a lost clock change the end as the board measures it.
    let has_end = !case.has(&["clock-dead", "strobe-dead"]);
    let length_us = (shot.end_ns - shot.begin_ns + 500) / 1000;
    let stamps = [
        ("taken", record.strobe_start.0, shot.board_us, true),
        ("ended", record.strobe_end.0, shot.board_us + length_us, has_end),
    ];
    for (what, stamped, truly, checked) in stamps {
        if checked && stamped.abs_diff(truly) > STAMP_US {
            let number = record.trigger_number;
            let what = format!("trigger {number} is stamped {stamped} us and was {what} at {truly} us");
            return Some(broken(sight.at_ns, what));
        }
    }
    let asked_um = 1e-3 * f64::from(record.asked.0);
    let truth = &shot.truth;
    let off_um = match record.axis {
        Axis::SensorFine => (truth.piezo_min_um - asked_um).abs().max((truth.piezo_max_um - asked_um).abs()),
        Axis::SensorCoarse => (truth.coarse_um - asked_um).abs(),
        Axis::Lens => (truth.lens_um - asked_um).abs(),
    };
    let allowed_um = 1e-3 * f64::from(window_nm) + positions::stated_um(case, record.axis, asked_um);
    (off_um > allowed_um && !reported_off).then(|| {
        let what = format!(
            "trigger {} was taken {off_um:.3} um off, its tolerance and stated error are {allowed_um:.3} um, and no event \
             reports it",
            record.trigger_number
        );
        broken(sight.at_ns, what)
    })
}
