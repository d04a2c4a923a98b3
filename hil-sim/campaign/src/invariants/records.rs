//! Records: confirmed values survive everything, or their loss is reported.

use std::collections::{BTreeMap, BTreeSet};

use farnear_protocol::{
    EventKind, Request, Response,
    message::{Alarm, AlarmRecord, RecordName, SettingKey},
};

use super::{Broken, Case};
use farnear_sim::observer::Seen;

/// Time from confirmation to storage: some milliseconds per record, five records, every second tick.
const WRITTEN_NS: u64 = 60_000_000;

fn broken(at_ns: u64, what: String) -> Broken {
    Broken { property: "records", at_ns, what }
}

#[derive(Default)]
struct Known {
    kept: Option<i32>,
    /// Values confirmed since, with times.
    since: Vec<(u64, i32)>,
}

pub fn records(case: &Case<'_>) -> Vec<Broken> {
    // A board without memory reports the loss; flipped bits in both copies are reported, too.
    let lossy = case.has(&["memory-dead", "memory-misread"]);
    let mut found = boots(case, lossy);
    if !lossy {
        found.extend(alarms(case));
        found.extend(settings(case));
    }
    found
}

/// Boot numbers increase.
fn boots(case: &Case<'_>, lossy: bool) -> Vec<Broken> {
    let mut last = 0;
    let mut begun = BTreeSet::new();
    let (mut reported, mut resets) = (Vec::new(), 0u64);
    let counters_lost = loses(case, RecordName::Counters);
    for sight in case.sights {
        match &sight.seen {
            Seen::Reset | Seen::Powered(true) => resets += 1,
            Seen::Reported { boot, event, .. } if matches!(event.kind, EventKind::Started { .. }) => {
                // A repeated event has the same number; a new boot with an old number had no reset in
                // between.
                let new = begun.insert((*boot, resets));
                if new && *boot <= last && !lossy && !counters_lost {
                    let what = format!("boot {boot} came after boot {last}");
                    reported.push(broken(sight.at_ns, what));
                }
                last = last.max(*boot);
            }
            _ => {}
        }
    }
    reported
}

fn loses(case: &Case<'_>, record: RecordName) -> bool {
    case.sights.iter().any(|sight| match &sight.seen {
        Seen::Reported { event, .. } => {
            matches!(&event.kind, EventKind::Alarm(reported) if reported.alarm == Alarm::RecordLost { record })
        }
        _ => false,
    })
}

/// A hung board writes nothing.
fn wrote_until_ns(case: &Case<'_>, reset_ns: u64) -> u64 {
    let before = case.sights.iter().take_while(|sight| sight.at_ns < reset_ns);
    before.fold(reset_ns, |until, sight| match &sight.seen {
        Seen::Happened { what: "firmware-hangs", reverts: false } => until.min(sight.at_ns),
        Seen::Reset => reset_ns,
        _ => until,
    })
}

/// Alarms stay latched until cleared.
fn alarms(case: &Case<'_>) -> Vec<Broken> {
    if loses(case, RecordName::Alarms) {
        return Vec::new();
    }
    // By number: when each latched alarm was reported, and the alarm.
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
            Seen::Reported { event, .. } => match &event.kind {
                EventKind::Alarm(record) => {
                    latched.entry(record.number).or_insert((at_ns, *record));
                }
                EventKind::AlarmCleared { number } => drop(latched.remove(number)),
                _ => {}
            },
            // Unwritten alarms may be lost; a clearing may have succeeded without an answer.
            Seen::Reset | Seen::Powered(false) => {
                let wrote_ns = wrote_until_ns(case, at_ns);
                latched.retain(|number, (advance_until_ns, _)| {
                    wrote_ns > *advance_until_ns + WRITTEN_NS && !asked.values().any(|asked| asked == number)
                });
            }
            Seen::Answered { id, boot, answer, .. } => match &**answer {
                Ok(Response::Accepted) => {
                    if let Some(number) = asked.get(&(*boot, *id)) {
                        latched.remove(number);
                    }
                }
                Ok(Response::Status(status)) => {
                    // An answer created before the alarm may leave after it.
                    let mut known = latched
                        .values()
                        .filter(|(_, alarm)| alarm.boot != *boot || alarm.time <= status.time);
                    let oldest = known.next().map(|(_, alarm)| alarm.number);
                    if let (Some(oldest), None) = (oldest, &status.alarm) {
                        let what =
                            format!("alarm {oldest} was reported and not cleared, and none is latched");
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

/// Settings have the last confirmed value.
fn settings(case: &Case<'_>) -> Vec<Broken> {
    if loses(case, RecordName::Settings) {
        return Vec::new();
    }
    let mut known: BTreeMap<SettingKey, Known> = BTreeMap::new();
    let mut asked: BTreeMap<(u32, u32), (SettingKey, Option<i32>)> = BTreeMap::new();
    let repaired = case.sights.iter().any(|sight| match &sight.seen {
        Seen::Reported { event, .. } => {
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
                    // From now on the value is possible.
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
                // A damaged newer copy may be replaced by the older one, which is reported.
                if !may && !repaired {
                    let what = format!("{} is {}, it was {before}", key.name(), setting.value);
                    return vec![broken(at_ns, what)];
                }
                // This value is now certain.
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
