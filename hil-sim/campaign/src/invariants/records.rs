//! Records: what was confirmed outlasts everything, or its loss is told.

use std::collections::{BTreeMap, BTreeSet};

use farnear_protocol::{
    EventKind, Request, Response,
    message::{Alarm, AlarmRecord, RecordName, SettingKey},
};

use super::{Broken, Case};
use farnear_sim::observer::Seen;

/// So long after its confirmation a record is in the memory: some milliseconds a record, five of them, and a tick of each two
/// is the host's.
const WRITTEN_NS: u64 = 60_000_000;

fn broken(at_ns: u64, what: String) -> Broken {
    Broken { property: "records", at_ns, what }
}

/// What is known of a setting: which values it may have.
#[derive(Default)]
struct Known {
    /// The value that is in the memory for sure, once there is one.
    kept: Option<i32>,
    /// Values confirmed since, and when.
    since: Vec<(u64, i32)>,
}

pub fn records(case: &Case<'_>) -> Vec<Broken> {
    // Without a memory nothing is kept, and the board says so; and bits that flip in both copies are told as such.
    let lossy = case.has(&["memory-dead", "memory-misread"]);
    let mut found = boots(case, lossy);
    if !lossy {
        found.extend(alarms(case));
        found.extend(settings(case));
    }
    found
}

/// Each boot has its own number, larger than those before it.
fn boots(case: &Case<'_>, lossy: bool) -> Vec<Broken> {
    let mut last = 0;
    let mut begun = BTreeSet::new();
    let (mut told, mut resets) = (Vec::new(), 0u64);
    let counters_lost = loses(case, RecordName::Counters);
    for sight in case.sights {
        match &sight.seen {
            Seen::Reset | Seen::Powered(true) => resets += 1,
            Seen::Told { boot, event, .. } if matches!(event.kind, EventKind::Started { .. }) => {
                // Told again, the same event has the same number; a new boot with an old number had no reset between.
                let new = begun.insert((*boot, resets));
                if new && *boot <= last && !lossy && !counters_lost {
                    let what = format!("boot {boot} came after boot {last}");
                    told.push(broken(sight.at_ns, what));
                }
                last = last.max(*boot);
            }
            _ => {}
        }
    }
    told
}

/// Whether the board told that a record was lost.
fn loses(case: &Case<'_>, record: RecordName) -> bool {
    case.sights.iter().any(|sight| match &sight.seen {
        Seen::Told { event, .. } => {
            matches!(&event.kind, EventKind::Alarm(told) if told.alarm == Alarm::RecordLost { record })
        }
        _ => false,
    })
}

/// Until when the board wrote that was reset at this moment: one that hangs writes nothing.
fn wrote_until_ns(case: &Case<'_>, reset_ns: u64) -> u64 {
    let before = case.sights.iter().take_while(|sight| sight.at_ns < reset_ns);
    before.fold(reset_ns, |until, sight| match &sight.seen {
        Seen::Happened { what: "firmware-hangs", mends: false } => until.min(sight.at_ns),
        Seen::Reset => reset_ns,
        _ => until,
    })
}

/// Alarms stay latched until they are cleared.
fn alarms(case: &Case<'_>) -> Vec<Broken> {
    if loses(case, RecordName::Alarms) {
        return Vec::new();
    }
    // By number: when each latched alarm was told, and what it is.
    let mut latched: BTreeMap<u32, (u64, AlarmRecord)> = BTreeMap::new();
    let mut asked: BTreeMap<(u32, u32), u32> = BTreeMap::new();
    for sight in case.sights {
        let at_ns = sight.at_ns;
        match &sight.seen {
            Seen::Asked { id, boot, call } => {
                if let Request::ClearAlarm { number } = call.request {
                    asked.insert((*boot, *id), number);
                }
            }
            Seen::Told { event, .. } => match &event.kind {
                EventKind::Alarm(record) => {
                    latched.entry(record.number).or_insert((at_ns, *record));
                }
                EventKind::AlarmCleared { number } => drop(latched.remove(number)),
                _ => {}
            },
            // What was not written yet may be forgotten; and a clearing whose answer never left may have been done.
            Seen::Reset | Seen::Powered(false) => {
                let wrote_ns = wrote_until_ns(case, at_ns);
                latched.retain(|number, (told_ns, _)| {
                    wrote_ns > *told_ns + WRITTEN_NS && !asked.values().any(|asked| asked == number)
                });
            }
            Seen::Answered { id, boot, answer, .. } => match &**answer {
                Ok(Response::Accepted) => {
                    if let Some(number) = asked.get(&(*boot, *id)) {
                        latched.remove(number);
                    }
                }
                Ok(Response::Status(status)) => {
                    // An answer that was made before the alarm may leave after it.
                    let mut known = latched
                        .values()
                        .filter(|(_, alarm)| alarm.boot != *boot || alarm.time <= status.time);
                    let oldest = known.next().map(|(_, alarm)| alarm.number);
                    if let (Some(oldest), None) = (oldest, &status.alarm) {
                        let what = format!("alarm {oldest} was told and not cleared, and none is latched");
                        return vec![broken(at_ns, what)];
                    }
                }
                _ => {}
            },
            _ => {}
        }
    }
    Vec::new()
}

/// Settings have the value that was confirmed last.
fn settings(case: &Case<'_>) -> Vec<Broken> {
    if loses(case, RecordName::Settings) {
        return Vec::new();
    }
    let mut known: BTreeMap<SettingKey, Known> = BTreeMap::new();
    let mut asked: BTreeMap<(u32, u32), (SettingKey, Option<i32>)> = BTreeMap::new();
    let repaired = case.sights.iter().any(|sight| match &sight.seen {
        Seen::Told { event, .. } => {
            matches!(event.kind, EventKind::RecordRepaired { record: RecordName::Settings, .. })
        }
        _ => false,
    });
    for sight in case.sights {
        let at_ns = sight.at_ns;
        match &sight.seen {
            Seen::Asked { id, boot, call } => match call.request {
                Request::WriteSetting { key, value } => {
                    asked.insert((*boot, *id), (key, Some(value)));
                    // From here on it may have it.
                    let known = known.entry(key).or_default();
                    if !known.since.iter().any(|(_, earlier)| *earlier == value) {
                        known.since.push((u64::MAX, value));
                    }
                }
                Request::ReadSetting { key } => drop(asked.insert((*boot, *id), (key, None))),
                _ => {}
            },
            Seen::Answered { id, boot, answer, .. } => {
                let Ok(Response::Setting(setting)) = &**answer else { continue };
                let Some((key, wanted)) = asked.get(&(*boot, *id)) else { continue };
                let known = known.entry(*key).or_default();
                if wanted.is_some() {
                    known.since.retain(|(_, value)| *value != setting.value);
                    known.since.push((at_ns, setting.value));
                    continue;
                }
                let before = known.kept.unwrap_or(setting.default);
                let may = setting.value == before || known.since.iter().any(|(_, may)| *may == setting.value);
                // The older copy may serve where the newer one was damaged, and that is told.
                if !may && !repaired {
                    let what = format!("{} is {}, it was {before}", key.name(), setting.value);
                    return vec![broken(at_ns, what)];
                }
                // It is what it is, in this boot and after.
                *known = Known { kept: Some(setting.value), since: Vec::new() };
            }
            Seen::Reset | Seen::Powered(false) => {
                let wrote_ns = wrote_until_ns(case, at_ns);
                for known in known.values_mut() {
                    let written =
                        |(since, _): &&(u64, i32)| *since != u64::MAX && wrote_ns > *since + WRITTEN_NS;
                    if let Some((at, value)) = known.since.iter().rfind(written).copied() {
                        known.kept = Some(value);
                        known.since.retain(|(since, _)| *since > at);
                    }
                }
            }
            _ => {}
        }
    }
    Vec::new()
}
