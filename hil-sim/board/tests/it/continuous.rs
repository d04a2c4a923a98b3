//! Continuous capture on the emulated board: rate, dropped frames, true sensor positions, repeatability.

use std::hash::{DefaultHasher, Hash, Hasher};

use farnear_protocol::{
    EventKind, Micros, Nanometres, Request, Response,
    message::{DropReason, ShotRecord},
};

use crate::bench::{Bench, SILENCE, amount, fine_shot};

const EXPOSURE_US: u32 = 5_000;
const WINDOW_NM: i32 = 50;
const PLACES_NM: [i32; 2] = [10_000, 166_270];
/// 40 exposures a second: shorter than move, exposure and read-out in sequence.
const PERIOD_US: u64 = 25_000;
const SECONDS: u64 = 2;

struct Ran {
    frames: Vec<(u32, Nanometres, ShotRecord)>,
    dropped: Vec<DropReason>,
    end: EventKind,
    /// Worst distance of the sensor from its target per exposure.
    truths_nm: Vec<f64>,
    digest: u64,
}

fn run(bench: &mut Bench, period_us: u64, exposures: u32) -> Ran {
    bench.arm(&PLACES_NM.map(|nm| fine_shot(nm, EXPOSURE_US, WINDOW_NM, 2_000)));
    bench.events.clear();
    let period = Micros(period_us as u32);
    let request = Request::RunContinuously { period, exposures, silence: SILENCE };
    assert_eq!(bench.ask(&request), Ok(Response::Accepted));
    let mut shots = Vec::new();
    let ends = |kind: &EventKind| matches!(kind, EventKind::ContinuousDone { .. } | EventKind::Failed { .. });
    // The host must poll: a second has far more events than the board remembers.
    while !bench.events.iter().any(|event| ends(&event.kind)) {
        bench.rig.advance_us(200_000).expect("runs");
        bench.status();
        shots.extend(bench.rig.take_shots());
    }
    let (mut frames, mut dropped) = (Vec::new(), Vec::new());
    let mut hasher = DefaultHasher::new();
    for event in &bench.events {
        format!("{event:?}").hash(&mut hasher);
        match event.kind {
            EventKind::FrameTaken { frame, deviation, shot, .. } => frames.push((frame, deviation, shot)),
            EventKind::FrameDropped { reason, .. } => dropped.push(reason),
            _ => {}
        }
    }
    assert_eq!(frames.len(), shots.len(), "an exposure without its event");
    let truths_nm = frames.iter().zip(&shots).map(|((_, _, record), shot)| {
        assert_eq!(record.trigger_number, shot.id);
        assert!(record.strobe_start.0.abs_diff(shot.board_us) <= 1, "{record:?}");
        let off = |um: f64| (1e3 * um - f64::from(record.asked.0)).abs();
        off(shot.truth.piezo_min_um).max(off(shot.truth.piezo_max_um))
    });
    let truths_nm: Vec<f64> = truths_nm.collect();
    truths_nm.iter().for_each(|nm| nm.to_bits().hash(&mut hasher));
    let end = bench.events.iter().map(|event| event.kind.clone()).find(|kind| ends(kind));
    Ran { frames, dropped, end: end.expect("it ended"), truths_nm, digest: hasher.finish() }
}

fn hold(name: &str, ran: &Ran, exposures: u32) {
    let [first, last] = [ran.frames[0], ran.frames[ran.frames.len() - 1]].map(|(_, _, shot)| shot.trigger.0);
    let seconds = (last - first) as f64 / 1e6;
    let outside = ran.frames.iter().filter(|(_, deviation, _)| deviation.0 > WINDOW_NM).count();
    let really = ran.truths_nm.iter().copied().fold(0.0, f64::max);
    let longest = ran.frames.iter().map(|(_, _, shot)| shot.settle.0).max().unwrap_or(0);
    let intervals = ran.frames.windows(2).map(|two| two[1].2.trigger.0 - two[0].2.trigger.0);
    let (shortest, longest_interval) =
        intervals.fold((u64::MAX, 0), |(low, high), us| (us.min(low), us.max(high)));
    println!(
        "{name}: {} exposures in {seconds:.3} s, {:.2} a second, {} dropped, intervals {shortest} to {longest_interval} us, {outside} outside \
         their window, at worst {really:.1} nm off, settled within {longest} us",
        ran.frames.len(),
        (ran.frames.len() - 1) as f64 / seconds,
        ran.dropped.len()
    );
    assert!(
        matches!(ran.end, EventKind::ContinuousDone { exposures: taken, dropped: 0, .. } if taken == exposures),
        "{:?}",
        ran.end
    );
    assert_eq!(ran.frames.len() as u32, exposures, "an event was lost");
    assert_eq!((ran.dropped.len(), outside), (0, 0), "{:?}", ran.dropped);
    assert!(really <= f64::from(WINDOW_NM), "{really} nm");
}

#[test]
fn alternates_far_and_near_within_tolerance_at_an_exact_period() {
    let exposures =
        u32::try_from(amount("FARNEAR_CONTINUOUS_S", SECONDS) * 1_000_000 / PERIOD_US).expect("fits");
    let mut bench = Bench::new(amount("FARNEAR_SEED", 1));
    let ran = run(&mut bench, PERIOD_US, exposures);
    hold("at a pace", &ran, exposures);
    for (number, deviation, shot) in &ran.frames {
        assert_eq!(
            shot.trigger.0,
            ran.frames[0].2.trigger.0 + u64::from(*number) * PERIOD_US,
            "{deviation:?}"
        );
        assert_eq!(u32::from(shot.index), number % 2);
    }
    assert_eq!(bench.report().missed_triggers, 0);
    assert_eq!(bench.alarm(), None);
}

#[test]
fn without_a_period_runs_at_full_speed_and_repeats_to_the_bit() {
    let exposures = u32::try_from(amount("FARNEAR_CONTINUOUS_S", 1) * 50).expect("fits");
    let seed = amount("FARNEAR_SEED", 1);
    let [first, second] = [(); 2].map(|()| run(&mut Bench::new(seed), 0, exposures));
    hold("as fast as it can", &first, exposures);
    let us = first.frames[first.frames.len() - 1].2.trigger.0 - first.frames[0].2.trigger.0;
    // The specification is 25 a second.
    assert!(us / u64::from(exposures - 1) <= 21_000, "{us} us");
    assert_eq!(first.digest, second.digest, "two runs differ");
}
