use farnear_protocol::{EventKind, Request, Response};

use super::{Broken, Case};
use farnear_sim::{observer::Seen, wiring::Burst};

/// Microsteps against a hard stop until a stall: 38 (6 um following error), 26 (segment), one rotor period.
const PRESSED_MAX: u64 = 150;
/// The shaper moves by a quarter of a move at a time, at most 50 um; feedback adds to it.
const PIEZO_STEP_MAX_UM: f64 = 60.0;
/// From an alarm to the last STEP: running segment 1 ms, tick 0.2 ms, board clock 0.5 ms.
const LAST_STEP_NS: u64 = 2_000_000;
/// A stop brakes along the ramp after the terminal event.
const BRAKING_NS: u64 = 400_000_000;

pub fn hard_stop(case: &Case<'_>) -> Vec<Broken> {
    let dead = case.has(&["home-switch-dead"]);
    let mut alarms = 0;
    for sight in case.sights {
        let truth = match &sight.seen {
            Seen::Reported { event, truth, .. } => {
                alarms += u64::from(matches!(event.kind, EventKind::Alarm(_)));
                truth
            }
            Seen::Answered { truth, .. } => truth,
            _ => continue,
        };
        let allowed = if dead { PRESSED_MAX * (alarms + 1) } else { 0 };
        for (pressed, stage) in truth.pressed.into_iter().zip(["sensor", "lens"]) {
            if pressed > allowed {
                let what = format!(
                    "{pressed} microsteps of the {stage}'s stage against its hard stop, allowed are {allowed}"
                );
                return vec![Broken { property: "hard-stop", at_ns: sight.at_ns, what }];
            }
        }
    }
    Vec::new()
}

pub fn piezo_step(case: &Case<'_>) -> Vec<Broken> {
    // A DAC that answers again while a move is under way takes over its code at once (docs/silicon.md).
    if case.has(&["dac-dead", "piezo-dead"]) {
        return Vec::new();
    }
    let truths = case.sights.iter().filter_map(|sight| match &sight.seen {
        Seen::Reported { truth, .. } | Seen::Answered { truth, .. } => {
            Some((sight.at_ns, truth.piezo_step_um))
        }
        _ => None,
    });
    let mut larger = truths.filter(|(_, um)| *um > PIEZO_STEP_MAX_UM);
    let broken = larger.next().map(|(at_ns, um)| {
        let what =
            format!("the piezo's command changed by {um:.1} um at once, {PIEZO_STEP_MAX_UM} are allowed");
        Broken { property: "piezo-step", at_ns, what }
    });
    broken.into_iter().collect()
}

pub fn step_after_alarm(case: &Case<'_>) -> Vec<Broken> {
    let clocks = case.clocks();
    let mut life = 0;
    // When an alarm was latched, its number, and when it was cleared or the board reset.
    let mut spans: Vec<(u64, u64, u32)> = Vec::new();
    let mut known = std::collections::BTreeSet::new();
    for sight in case.sights {
        match &sight.seen {
            Seen::Reported { boot, event, .. } => match &event.kind {
                EventKind::Alarm(record) if record.boot == *boot && known.insert(record.number) => {
                    let at_ns = clocks[life] + record.time.0 * 1000;
                    spans.push((at_ns.min(sight.at_ns), u64::MAX, record.number));
                }
                EventKind::AlarmCleared { number } => end(&mut spans, *number, sight.at_ns),
                _ => {}
            },
            Seen::Reset => {
                life += 1;
                known.clear();
                spans.iter_mut().filter(|span| span.1 == u64::MAX).for_each(|span| span.1 = sight.at_ns);
            }
            _ => {}
        }
    }
    bursts(case)
        .filter_map(|burst| {
            let (since, _, number) = *spans
                .iter()
                .find(|(since, until, _)| burst.last_ns > since + LAST_STEP_NS && burst.first_ns < *until)?;
            // An answer separates the bursts before the alarm from those after clearing.
            let late_us = (burst.last_ns - since) / 1000;
            let what =
                format!("the {:?} stage's last STEP came {late_us} us after alarm {number}", burst.stage);
            Some(Broken { property: "step-after-alarm", at_ns: burst.last_ns, what })
        })
        .collect()
}

fn bursts<'a>(case: &Case<'a>) -> impl Iterator<Item = &'a Burst> {
    case.sights.iter().filter_map(|sight| match &sight.seen {
        Seen::Stepped(burst) => Some(burst),
        _ => None,
    })
}

fn end(spans: &mut [(u64, u64, u32)], number: u32, at_ns: u64) {
    for span in spans.iter_mut().filter(|span| span.2 == number) {
        span.1 = span.1.min(at_ns);
    }
}

struct Work {
    id: u32,
    boot: u32,
    since_ns: u64,
    until_ns: u64,
}

pub fn moves_unasked(case: &Case<'_>) -> Vec<Broken> {
    let mut works: Vec<Work> = Vec::new();
    for sight in case.sights {
        let at_ns = sight.at_ns;
        match &sight.seen {
            Seen::Asked { id, boot, call }
                if is_long(&call.request)
                    && !works.iter().any(|work| (work.id, work.boot) == (*id, *boot)) =>
            {
                works.push(Work { id: *id, boot: *boot, since_ns: at_ns, until_ns: u64::MAX });
            }
            Seen::Answered { id, boot, answer, .. } if !matches!(**answer, Ok(Response::Accepted)) => {
                close(&mut works, (*id, *boot), at_ns);
            }
            Seen::Reported { boot, event, .. } => {
                if let Some(request) = event.kind.ended() {
                    close(&mut works, (request, *boot), at_ns + BRAKING_NS);
                }
            }
            Seen::Reset => works.iter_mut().for_each(|work| work.until_ns = work.until_ns.min(at_ns)),
            _ => {}
        }
    }
    bursts(case)
        .filter(|burst| {
            !works.iter().any(|work| work.since_ns <= burst.first_ns && burst.last_ns <= work.until_ns)
        })
        .map(|burst| {
            let what =
                format!("{} pulses for the {:?} stage without requested work", burst.steps, burst.stage);
            Broken { property: "moves-unasked", at_ns: burst.first_ns, what }
        })
        .collect()
}

fn close(works: &mut [Work], of: (u32, u32), at_ns: u64) {
    for work in works.iter_mut().filter(|work| (work.id, work.boot) == of) {
        work.until_ns = work.until_ns.min(at_ns);
    }
}

fn is_long(request: &Request) -> bool {
    matches!(
        request,
        Request::Home { .. }
            | Request::Move { .. }
            | Request::RunProgram { .. }
            | Request::RunContinuously { .. }
            | Request::Calibrate { .. }
    )
}
