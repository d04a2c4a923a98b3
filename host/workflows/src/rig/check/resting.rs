//! Steps without motion.

use std::time::{Duration, Instant};

use farnear_capture::describe::{alarm_text, cause_name};
use farnear_protocol::message::SettingKey;

use super::{Checkup, Found, failed, passed, passed_over};
use crate::error::Result;

const QUESTIONS: usize = 200;
/// Most attempts. One fast attempt shows that the line is good and this computer was late.
const ROUNDS: usize = 3;
/// Limit for 95 % of a real board's answers.
const ANSWER: Duration = Duration::from_millis(50);

pub(super) fn link(checkup: &mut Checkup<'_>) -> Found {
    let client = checkup.client();
    let mut round = 1;
    loop {
        let before = client.status()?.link;
        let mut answers = Vec::with_capacity(QUESTIONS);
        for _ in 0..QUESTIONS {
            let begin = Instant::now();
            client.status()?;
            answers.push(begin.elapsed());
        }
        let after = client.status()?.link;
        let bad = after.bad_frames - before.bad_frames;
        let repeated = after.repeated - before.repeated;
        answers.sort_unstable();
        let [usual, slowest] = [QUESTIONS * 19 / 20, QUESTIONS - 1].map(|rank| answers[rank]);
        let said = format!(
            "{QUESTIONS} questions, {bad} broken frames, {repeated} asked again, 19 of 20 answers within {:.1} ms, the slowest {:.1} ms",
            usual.as_secs_f64() * 1e3,
            slowest.as_secs_f64() * 1e3
        );
        // A slow line delays most answers. A busy computer delays a few.
        let late = repeated > 0 || (usual > ANSWER && !client.hello().emulated);
        if bad == 0 && !late {
            return passed(said);
        }
        if bad > 0 || round == ROUNDS {
            return failed(format!("{said}: is the cable short and whole, is a hub in between?"));
        }
        checkup.info(&format!("{said}; once more, for it may be that this computer was late"));
        round += 1;
    }
}

pub(super) fn identity(checkup: &mut Checkup<'_>) -> Found {
    let (client, hello) = (checkup.client(), checkup.client().hello());
    let id: String = hello.unique_id.iter().map(|byte| format!("{byte:02x}")).collect();
    let said = format!(
        "{} with firmware {}, protocol {}, id {id}, boot {} after {}{}",
        hello.board,
        hello.firmware,
        client.protocol(),
        hello.boot,
        cause_name(hello.reset_cause),
        if hello.emulated { "; an emulated board" } else { "" }
    );
    match client.firmware_note() {
        Some(note) => failed(format!("{said}; {note}")),
        None => passed(said),
    }
}

pub(super) fn alarms(checkup: &mut Checkup<'_>) -> Found {
    let client = checkup.client();
    let status = client.status()?;
    if status.supply_low {
        return failed("the supply is too low");
    }
    match status.alarm {
        None => passed(format!("none is latched, {} are kept", client.alarms()?.len())),
        Some(record) => failed(format!("alarm {} is latched: {}", record.number, alarm_text(record.alarm))),
    }
}

/// Changes a setting, reads it back after a reset, and restores it.
pub(super) fn memory(checkup: &mut Checkup<'_>) -> Found {
    if !checkup.client().hello().capabilities.memory {
        return passed_over("the board has none: settings and alarms are lost without power");
    }
    let key = SettingKey::CameraReadoutUs;
    let (old, boots) = (checkup.client().setting(key)?, checkup.client().counters()?.boots);
    let other = if old.value < old.max { old.value + 1 } else { old.value - 1 };
    let found = outlasts_reset(checkup, key, other);
    // Restore the setting in any case.
    let client = &mut checkup.equipped.rig.client;
    let restored = client.set_setting(key, old.value).or_else(|_| {
        client.reopen()?;
        client.set_setting(key, old.value)
    });
    if let Err(error) = restored {
        let (name, value) = (key.name(), old.value);
        let before = found.err().map(|error| format!("{error}; ")).unwrap_or_default();
        return failed(format!(
            "{before}{name} may still be {other} instead of {value} ({error}); set it back by `farnear rig settings set \
             {name} {value}`"
        ));
    }
    let (kept, boots_now) = found?;
    if kept != other {
        return failed(format!("{} was set to {other} and is {kept} after a reset", key.name()));
    }
    if boots_now != boots + 1 {
        return failed(format!("the counter of boots went from {boots} to {boots_now} at one reset"));
    }
    passed(format!("a setting and the counters outlast a reset (boot {boots_now} of this board's life)"))
}

/// Returns the setting and the number of boots after a change and a reset.
fn outlasts_reset(checkup: &mut Checkup<'_>, key: SettingKey, value: i32) -> Result<(i32, u32)> {
    checkup.client().set_setting(key, value)?;
    checkup.equipped.rig.client.reboot()?;
    Ok((checkup.client().setting(key)?.value, checkup.client().counters()?.boots))
}
