use std::collections::{BTreeMap, BTreeSet};

use farnear_protocol::{
    EventKind, Request, RequestError, Response, camera::FREE_RUNNING, message::DropReason,
};

use super::{Broken, Case};
use farnear_sim::observer::{Seen, Sight};

type Answer = Result<Response, RequestError>;

pub fn acts_twice(case: &Case<'_>) -> Vec<Broken> {
    let mut broken = ends(case);
    broken.extend(answers(case));
    broken.extend(exposures(case));
    broken
}

fn twice(at_ns: u64, what: String) -> Broken {
    Broken { property: "acts-twice", at_ns, what }
}

fn ends(case: &Case<'_>) -> Vec<Broken> {
    let mut ends: BTreeMap<(u32, u32), u32> = BTreeMap::new();
    let mut broken = Vec::new();
    for sight in case.sights {
        let Seen::Reported { boot, event, number, .. } = &sight.seen else { continue };
        let Some(request) = event.kind.ended() else { continue };
        // An event may be repeated with the same number only.
        let first = *ends.entry((*boot, request)).or_insert(*number);
        if first != *number {
            let what =
                format!("request {request} of boot {boot} ended twice, by events {first} and {number}");
            broken.push(twice(sight.at_ns, what));
        }
    }
    broken
}

/// Repeats get the same answer, or a refusal with its reason.
fn answers(case: &Case<'_>) -> Vec<Broken> {
    let mut given: BTreeMap<(u32, u32), &Answer> = BTreeMap::new();
    let mut broken = Vec::new();
    for sight in case.sights {
        let Seen::Answered { id, boot, answer, .. } = &sight.seen else { continue };
        let excused = matches!(
            **answer,
            Ok(Response::Hello(_))
                | Err(RequestError::QueueFull { .. }
                    | RequestError::IdNotNew { .. }
                    | RequestError::IdReused
                    | RequestError::NotInSession
                    | RequestError::Boot { .. }
                    | RequestError::Malformed
                    | RequestError::Version { .. })
        );
        if excused {
            continue;
        }
        let first = *given.entry((*boot, *id)).or_insert(answer);
        if *first != **answer {
            let what = format!("request {id} of boot {boot} was answered {first:?} and then {answer:?}");
            broken.push(twice(sight.at_ns, what));
        }
    }
    broken
}

/// No more exposures than by accepted requests plus those repeated by a continuous run.
fn exposures(case: &Case<'_>) -> Vec<Broken> {
    // An exposure may end before the answer has left.
    let accepted: BTreeSet<(u32, u32)> = case.sights.iter().filter_map(accepted_request).collect();
    let mut unseen = BTreeSet::new();
    let mut runs: BTreeMap<(u32, u32), u64> = BTreeMap::new();
    let (mut armed, mut taken) = (0, 0);
    for sight in case.sights {
        match &sight.seen {
            Seen::Reset => armed = 0,
            Seen::Asked { id, boot, call } if accepted.contains(&(*boot, *id)) => {
                let exposures = match call.request {
                    Request::ArmProgram { shots } => {
                        armed = u64::from(shots);
                        continue;
                    }
                    Request::RunProgram { .. } => armed,
                    Request::RunContinuously { exposures, .. } => u64::from(exposures),
                    _ => continue,
                };
                runs.entry((*boot, *id)).or_insert(exposures);
            }
            Seen::Exposed(shot) if shot.id != FREE_RUNNING => taken += 1,
            Seen::Reported { boot, number, event, .. } => {
                if matches!(event.kind, EventKind::FrameDropped { reason: DropReason::NoStrobe, .. }) {
                    unseen.insert((*boot, *number));
                }
            }
            _ => {}
        }
        let asked = runs.values().sum::<u64>() + unseen.len() as u64;
        if taken > asked {
            let what = format!("{taken} exposures were taken, {asked} requested and accepted");
            return vec![twice(sight.at_ns, what)];
        }
    }
    Vec::new()
}

fn accepted_request(sight: &Sight) -> Option<(u32, u32)> {
    match &sight.seen {
        Seen::Answered { id, boot, answer, .. } if **answer == Ok(Response::Accepted) => Some((*boot, *id)),
        _ => None,
    }
}
