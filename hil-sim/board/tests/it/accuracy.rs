//! Positions compared with the plant's true state: random moves, repeated homing, the longest tick.

use crate::bench::{Bench, amount, go};
use farnear_protocol::{EventKind, message::Axis};
use farnear_sim::{Report, plant::Noise};

/// Moves per axis; the campaign makes 1,000.
const MOVES: u32 = 40;
const TICK_CYCLES: u32 = 33_600;
/// Limit of the longest tick in motion: an answer, an event and a piece of memory in one.
const TICK_BUDGET: u32 = TICK_CYCLES * 9 / 10;

fn rms(errors: &[f64]) -> f64 {
    (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt()
}

fn truth_um(report: &Report, axis: Axis) -> f64 {
    match axis {
        Axis::SensorCoarse => report.coarse.position_um,
        Axis::SensorFine => report.piezo_um,
        Axis::Lens => report.lens.position_um,
    }
}

fn errors_um(bench: &mut Bench, axis: Axis, (low_um, high_um): (f64, f64), moves: u32) -> Vec<f64> {
    let mut noise = Noise::new(amount("FARNEAR_SEED", 1), "test of accuracy");
    let once = |_| {
        let target_um = noise.between(low_um, high_um);
        let target_nm = (target_um * 1e3).round() as i32;
        let end = bench.carry_out(&go(axis, target_nm));
        assert!(matches!(end, EventKind::MoveDone { .. }), "{end:?}");
        // Lets oscillations decay.
        let report = bench.rig.advance_us(50_000).expect("runs");
        truth_um(&report, axis) - 1e-3 * f64::from(target_nm)
    };
    (0..moves).map(once).collect()
}

#[test]
fn random_moves_reach_their_targets() {
    let mut bench = Bench::new(amount("FARNEAR_SEED", 1));
    bench.forget_longest_tick();
    bench.home();
    let moves = amount("FARNEAR_MOVES", MOVES);
    // Few short moves; the campaign covers the whole travel.
    let far_um = if moves > MOVES { 12_900.0 } else { 1_500.0 };
    for axis in [Axis::SensorCoarse, Axis::Lens] {
        let errors = errors_um(&mut bench, axis, (10.0, far_um), moves);
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        let spread: Vec<f64> = errors.iter().map(|error| error - mean).collect();
        println!(
            "{axis:?}: {moves} moves, RMS {:.3} um, mean {mean:.3}, about it {:.3}",
            rms(&errors),
            rms(&spread)
        );
        assert!(
            rms(&errors) <= 2.0 && rms(&spread) <= 1.0,
            "{axis:?}: {} um RMS about the mean",
            rms(&spread)
        );
    }
    let errors = errors_um(&mut bench, Axis::SensorFine, (6.0, 194.0), moves);
    println!("SensorFine: {moves} moves, RMS {:.4} um", rms(&errors));
    assert!(rms(&errors) <= 0.1, "{} um RMS", rms(&errors));

    let (longest, depth) = (bench.longest_tick(), bench.peek(|rig| rig.stack_depth()));
    println!(
        "the longest tick took {longest} of {TICK_CYCLES} instructions; the stack was {depth} bytes deep"
    );
    assert!(longest <= TICK_BUDGET, "a tick took {longest} instructions");
    assert!(depth < farnear_sim::access::STACK.1 / 2, "the stack was {depth} bytes deep");
}

#[test]
fn homing_repeats_within_a_micrometre() {
    let mut bench = Bench::new(amount("FARNEAR_SEED", 1));
    for axis in [Axis::SensorCoarse, Axis::Lens] {
        bench.home_axis(axis);
        let mut places = Vec::new();
        for turn in 0..8 {
            bench.carry_out(&go(axis, 200_000 + 37_000 * turn));
            bench.home_axis(axis);
            bench.carry_out(&go(axis, 100_000));
            let report = bench.rig.advance_us(50_000).expect("runs");
            places.push(truth_um(&report, axis));
        }
        let mean = places.iter().sum::<f64>() / places.len() as f64;
        let spread: Vec<f64> = places.iter().map(|place| place - mean).collect();
        println!("{axis:?}: homed {} times, {:.3} um RMS about the mean", places.len(), rms(&spread));
        // The switch alone has 0.3 um of standard deviation.
        assert!(spread.iter().all(|off| off.abs() <= 1.0), "{axis:?}: {places:.3?}");
    }
}
