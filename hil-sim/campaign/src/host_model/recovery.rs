use farnear_protocol::{
    Request, RequestError, Response,
    message::{Axis, PositionState},
};

use super::{
    SILENCE,
    client::{Client, Ended},
    go, load,
};
use farnear_sim::{SimError, scenario::host::Program};

/// Timeout of a repaired board: the watchdog takes 0.2 s, a start 0.1 s.
const ANSWERS_US: u64 = 3_000_000;
const AWAY_UM: [(Axis, f64); 2] = [(Axis::SensorCoarse, 350.0), (Axis::Lens, 250.0)];

/// A stage below this was driven there: beyond homing error (3.2 um) and braking behind the switch.
const BELOW_NM: i32 = -10_000;

/// Reverts all faults and checks that the rig works; returns what fails.
pub fn recover(client: &mut Client) -> Result<Option<String>, SimError> {
    client.rig.heal()?;
    client.wait_us(300_000)?;
    // Ends a frame that noise has left open.
    client.rig.send(&[0])?;
    let mut waited_us = 0;
    while !client.join()? {
        client.wait_us(50_000)?;
        waited_us += 50_000;
        if waited_us > ANSWERS_US {
            return Ok(Some("the board does not answer without faults".into()));
        }
    }
    client.ask(&Request::Stop)?;
    client.wait_us(400_000)?;
    if let Some(what) = clear_alarms(client)? {
        return Ok(Some(what));
    }
    let mut keys = client.written.clone();
    keys.dedup();
    for key in keys {
        client.ask(&Request::ReadSetting { key })?;
    }
    works(client)
}

pub fn clear_alarms(client: &mut Client) -> Result<Option<String>, SimError> {
    for _ in 0..24 {
        let Some(status) = client.status()? else { return Ok(Some("no status comes".into())) };
        let Some(latched) = status.alarm else { return Ok(None) };
        let cleared = client.ask(&Request::ClearAlarm { number: latched.number })?;
        if let Some((_, Err(RequestError::AlarmRemains { .. }))) = cleared {
            client.wait_us(20_000)?;
        }
    }
    let latched = client.status()?.and_then(|status| status.alarm);
    Ok(latched.map(|latched| format!("alarm {} cannot be cleared: {:?}", latched.number, latched.alarm)))
}

fn works(client: &mut Client) -> Result<Option<String>, SimError> {
    let home = |axis| Request::Home { axis, silence: SILENCE };
    let Some(status) = client.status()? else { return Ok(Some("no status comes before homing".into())) };
    // A stage below zero moves up first: the other may not approach it.
    let axes = [Axis::SensorCoarse, Axis::Lens];
    for axis in axes.into_iter().filter(|axis| status.axis(*axis).measured.0 < BELOW_NM) {
        if let Some(what) = all(client, "homing", &[home(axis)])? {
            return Ok(Some(what));
        }
    }
    if let Some(what) = all(client, "homing", &axes.map(home))? {
        return Ok(Some(what));
    }
    let Some(status) = client.status()? else { return Ok(Some("no status comes after homing".into())) };
    let states = [status.coarse.state, status.lens.state];
    if states != [PositionState::Homed; 2] {
        return Ok(Some(format!("both axes were homed, and are {states:?}")));
    }
    if let Some(what) = all(client, "a move", &AWAY_UM.map(|(axis, um)| go(axis, um)))? {
        return Ok(Some(what));
    }
    load(client, &Program { at_um: vec![20.0, 60.0], exposure_us: 1_000, window_nm: 200 })?;
    all(client, "a program", &[Request::RunProgram { silence: SILENCE }])
}

fn all(client: &mut Client, what: &str, requests: &[Request]) -> Result<Option<String>, SimError> {
    let mut ids = Vec::new();
    for request in requests {
        match client.ask(request)? {
            Some((id, Ok(Response::Accepted))) => ids.push(id),
            other => {
                let answer = other.map(|(_, answer)| answer);
                return Ok(Some(format!("{what} is not accepted without faults: {answer:?}")));
            }
        }
    }
    let ends = client.wait_for_ends(&ids)?;
    let bad = ends.iter().find(|end| **end != Ended::Done);
    Ok(bad.map(|end| format!("{what} fails without faults: {end:?}")))
}
