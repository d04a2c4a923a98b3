//! The maximum number of outstanding requests is answered, each once.

use crate::bench::{Bench, amount, request_frame};
use farnear_protocol::{Request, Response};

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
