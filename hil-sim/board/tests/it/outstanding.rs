//! The maximum number of outstanding requests is answered, each once.

use crate::bench::{Bench, amount, request_frame};
use crate::silicon::rig_with;
use farnear_protocol::{
    Request, Response,
    message::{CorrectionForm, CorrectionInfo},
};

const ROUNDS: u32 = 400;

#[test]
fn six_outstanding_requests_are_all_answered() {
    let mut bench = Bench::new(1);
    let begin = bench.status().link;
    let rounds = amount("FARNEAR_ROUNDS", ROUNDS);
    let mut id = 1_000;
    for _ in 0..rounds {
        let ids: Vec<u32> = (id + 1..=id + 6).collect();
        id += 6;
        for id in &ids {
            bench.rig.send(&request_frame(*id, bench.boot, &Request::Status)).expect("runs");
        }
        let mut answered = Vec::new();
        for _ in 0..40 {
            bench.rig.advance_us(200).expect("runs");
            answered.extend(bench.answers().into_iter().map(|(id, answer)| {
                assert!(matches!(answer, Ok(Response::Status(_))), "{answer:?}");
                id
            }));
            if answered.len() == 6 {
                break;
            }
        }
        assert_eq!(answered, ids, "each once, in order");
    }
    bench.skip_to(id);
    let link = bench.status().link;
    assert_eq!((link.bad_frames, link.repeated), (begin.bad_frames, begin.repeated), "{link:?}");
    assert_eq!(link.frames - begin.frames, 6 * rounds + 1);
}

/// The solution takes up to 8 ms, during which the other requests arrive.
#[test]
fn the_longest_requests_behind_a_solution_are_all_received_on_the_slowest_processor() {
    let mut bench = rig_with(|parts| parts.processor.cycles_per_instruction = 1.9);
    let info = CorrectionInfo {
        form: CorrectionForm::Regions,
        width: 640,
        height: 480,
        centre_um: 909_905,
        half_span_um: 30_024,
    };
    assert!(bench.ask(&Request::OpenCorrection(info)).is_ok());
    // Codes of three bytes each.
    let samples = |row: u16, truth: i16| {
        let codes = (0..72).map(|at| truth + 64 * (at % 5)).collect();
        Request::FitSamples { row, first: 0, step: 8, truth, codes }
    };
    for truth in [-20_000, -10_000, 0, 10_000, 20_000] {
        for row in (8..480).step_by(24) {
            assert!(bench.ask(&samples(row, truth)).is_ok());
        }
    }
    let first = 10_000;
    let requests: Vec<Request> =
        [Request::SolveFit].into_iter().chain((0..7).map(|_| samples(8, 20_000))).collect();
    let frames: Vec<u8> = (first..)
        .zip(&requests)
        .flat_map(|(id, request)| [vec![0], request_frame(id, bench.boot, request)].concat())
        .collect();
    bench.rig.send(&frames).expect("runs");
    bench.rig.advance_us(60_000).expect("runs");
    let answered: Vec<u32> = bench.answers().into_iter().map(|(id, _)| id).collect();
    assert_eq!(answered, (first..first + 8).collect::<Vec<_>>());
    bench.skip_to(first + 8);
    assert_eq!(bench.status().alarm, None);
}
