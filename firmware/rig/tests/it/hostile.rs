//! A hostile link: recorded frames, bursts, noise, dying hosts, resets. Nothing acts twice; an honest host works on.

use std::collections::BTreeMap;

use crate::bench::{self, Bench, SESSION, ends, request_frame};
use farnear_protocol::frame::Encoded;
use farnear_protocol::message::{
    Alarm, Axis, EventKind, Failure, NO_SESSION, ResetCause, SettingKey, Shot, TriggerMode,
};
use farnear_protocol::{Micros, Nanometres, Request, Response};

/// Hostile frames in a test run; `cargo xtask campaign` sends a million.
const FRAMES: u64 = 20_000;
const RECORDED: usize = 512;

struct Enemy {
    random: u64,
    recorded: Vec<Encoded>,
    sent: u64,
}

impl Enemy {
    fn below(&mut self, end: u64) -> u64 {
        self.random ^= self.random >> 12;
        self.random ^= self.random << 25;
        self.random ^= self.random >> 27;
        (self.random.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 16) % end
    }

    /// Records frames of honest hosts and of hosts killed later.
    fn record(&mut self, frame: &Encoded) {
        if self.recorded.len() < RECORDED {
            self.recorded.push(frame.clone());
        } else {
            let place = self.below(RECORDED as u64) as usize;
            self.recorded[place] = frame.clone();
        }
    }

    fn replay(&mut self, bench: &mut Bench, count: u64) {
        for _ in 0..count {
            let place = self.below(self.recorded.len() as u64) as usize;
            bench.send_bytes(&self.recorded[place].clone());
            self.sent += 1;
        }
        bench.tick();
    }

    fn noise(&mut self, bench: &mut Bench) {
        for _ in 0..self.below(700) {
            let byte = self.below(256) as u8;
            bench.send_bytes(&[byte]);
        }
        self.sent += 1;
        bench.tick();
    }
}

struct Ledger {
    session: u32,
    /// Accepted long work: number of reported ends.
    ends: BTreeMap<u32, u32>,
    /// The piezo's last position and the setting's last value.
    fine: i32,
    speed: i32,
    alarms: u32,
}

/// Each kind of request that changes something, and one that only reads.
fn request(ledger: &mut Ledger, enemy: &mut Enemy) -> Request {
    let silence = Micros(500_000);
    match enemy.below(15) {
        0 => Request::Home { axis: Axis::SensorCoarse, silence },
        1 => Request::Home { axis: Axis::Lens, silence },
        2 => Request::Move { axis: Axis::SensorCoarse, target: Nanometres(2_000_000), silence },
        3 => Request::Move { axis: Axis::Lens, target: Nanometres(500_000), silence },
        4..=6 => {
            ledger.fine = 10_000 + enemy.below(150_000) as i32;
            Request::Move { axis: Axis::SensorFine, target: Nanometres(ledger.fine), silence }
        }
        7 => Request::Stop,
        8 => {
            ledger.speed = 2_000_000 + enemy.below(4_000_000) as i32;
            Request::WriteSetting { key: SettingKey::LensSpeedNmPerS, value: ledger.speed }
        }
        9 => Request::LoadShot {
            index: 0,
            shot: Shot {
                axis: Axis::SensorFine,
                target: Nanometres(50_000),
                exposure: Micros(1_000),
                settle_window: Nanometres(500),
                settle_dwell: Micros(1_000),
                repeat: 1,
                mode: TriggerMode::Hardware,
            },
        },
        10 => Request::ArmProgram { shots: 1 },
        11 => Request::RunProgram { silence },
        12 => Request::ReadCounters,
        13 => Request::RunContinuously { period: Micros(20_000), exposures: 3, silence },
        _ => Request::Status,
    }
}

const fn is_long(request: &Request) -> bool {
    matches!(
        request,
        Request::Home { .. }
            | Request::Move { .. }
            | Request::RunProgram { .. }
            | Request::RunContinuously { .. }
    )
}

fn killed_host(bench: &mut Bench, ledger: &mut Ledger, enemy: &mut Enemy) {
    ledger.session = 1 + enemy.below(u64::from(u32::MAX)) as u32;
    say(bench, ledger, enemy, &Request::OpenSession);
    for _ in 0..enemy.below(6) {
        let asked = (ledger.fine, ledger.speed);
        let request = request(ledger, enemy);
        let (id, accepted) = say(bench, ledger, enemy, &request);
        if !accepted {
            (ledger.fine, ledger.speed) = asked;
        } else if is_long(&request) {
            ledger.ends.insert(id, 0);
        }
        for _ in 0..enemy.below(30) {
            bench.tick();
        }
    }
}

/// Requests in the open session until there is an answer; returns the id and whether it was accepted.
fn say(bench: &mut Bench, ledger: &Ledger, enemy: &mut Enemy, request: &Request) -> (u32, bool) {
    let id = last_id(bench) + 1;
    let frame = request_frame(id, bench.rig.boot(), ledger.session, request);
    enemy.record(&frame);
    for _ in 0..4 {
        bench.answers.clear();
        bench.send_bytes(&[0]);
        bench.send_bytes(&frame);
        bench.tick();
        if let Some((_, answer)) = bench.answers.iter().find(|(of, _)| *of == id) {
            return (id, answer.is_ok());
        }
    }
    panic!("no answer to {request:?}: {:?}", bench.answers);
}

/// The board's last id; a leading delimiter ends the attacker's remainder on the line.
fn last_id(bench: &mut Bench) -> u32 {
    for _ in 0..4 {
        bench.answers.clear();
        bench.send_bytes(&[0]);
        bench.send_bytes(&request_frame(7, 0, NO_SESSION, &Request::Hello));
        bench.tick();
        if let Some((_, Ok(Response::Hello(hello)))) = bench.answers.iter().find(|(of, _)| *of == 7) {
            return hello.last_id;
        }
    }
    panic!("no hello: {:?}", bench.answers);
}

fn settle_accounts(bench: &mut Bench, ledger: &mut Ledger) {
    for (_, event) in bench.events.drain(..) {
        match event.kind {
            EventKind::Alarm(record) => {
                ledger.alarms += 1;
                let reported =
                    matches!(record.alarm, Alarm::HostSilence { .. } | Alarm::MotionInterrupted { .. });
                assert!(reported, "{record:?}");
            }
            kind => {
                for (id, count) in &mut ledger.ends {
                    *count += u32::from(ends(&kind, *id));
                }
                let known = |id: u32| ledger.ends.contains_key(&id);
                match kind {
                    EventKind::Homed { request, .. }
                    | EventKind::MoveDone { request, .. }
                    | EventKind::ProgramDone { request, .. }
                    | EventKind::ContinuousDone { request, .. }
                    | EventKind::ShotDone { request, .. }
                    | EventKind::FrameTaken { request, .. }
                    | EventKind::FrameDropped { request, .. }
                    | EventKind::Failed { request, .. } => {
                        assert!(known(request), "{request} was not requested")
                    }
                    _ => {}
                }
            }
        }
    }
    for (id, count) in &ledger.ends {
        assert!(*count <= 1, "request {id} ended {count} times");
    }
}

/// An honest host finds the state of the last accepted host.
fn honest_host(bench: &mut Bench, ledger: &mut Ledger, enemy: &mut Enemy) {
    ledger.session = SESSION;
    assert!(say(bench, ledger, enemy, &Request::OpenSession).1, "a session is opened at once");
    // A reset may have interrupted both stages: an alarm each.
    while let Some(alarm) = status(bench, ledger, enemy).alarm {
        let cleared = say(bench, ledger, enemy, &Request::ClearAlarm { number: alarm.number });
        assert!(cleared.1, "{alarm:?}");
    }
    let (key, value) = (SettingKey::LensSpeedNmPerS, ledger.speed);
    let read = ask(bench, ledger, enemy, &Request::ReadSetting { key });
    assert!(matches!(&read, Response::Setting(setting) if setting.value == value), "{value}: {read:?}");
    // Far from the lens, because the attack may have left both stages close to each other.
    let target = Nanometres(150_000 + enemy.below(40_000) as i32);
    let silence = Micros(60_000_000);
    let (id, accepted) =
        say(bench, ledger, enemy, &Request::Move { axis: Axis::SensorFine, target, silence });
    let answers = bench.answers.clone();
    assert!(accepted, "it works at once: {answers:?}");
    ledger.fine = target.0;
    ledger.ends.insert(id, 0);
    // The attack continues meanwhile.
    for _ in 0..40 {
        enemy.replay(bench, 2);
        for _ in 0..5 {
            bench.tick();
        }
    }
    let end = bench.end_of(id);
    assert!(matches!(end, EventKind::MoveDone { asked, .. } if asked == target), "{end:?}");
    assert_eq!(status(bench, ledger, enemy).fine.asked, target);
}

fn ask(bench: &mut Bench, ledger: &Ledger, enemy: &mut Enemy, request: &Request) -> Response {
    let (id, _) = say(bench, ledger, enemy, request);
    let (_, answer) = bench.answers.iter().find(|(of, _)| *of == id).cloned().expect("an answer");
    answer.unwrap_or_else(|error| panic!("{request:?}: {error:?}"))
}

fn status(bench: &mut Bench, ledger: &Ledger, enemy: &mut Enemy) -> farnear_protocol::message::Status {
    match ask(bench, ledger, enemy, &Request::Status) {
        Response::Status(status) => status,
        other => panic!("no status but {other:?}"),
    }
}

#[test]
fn nothing_acts_twice_however_hostile_the_link() {
    let frames =
        std::env::var("FARNEAR_HOSTILE_FRAMES").ok().and_then(|text| text.parse().ok()).unwrap_or(FRAMES);
    let mut bench = Bench::both_homed();
    let mut enemy = Enemy { random: 0x9e37_79b9_7f4a_7c15, recorded: Vec::new(), sent: 0 };
    let mut ledger = Ledger { session: SESSION, ends: BTreeMap::new(), fine: 0, speed: 6_250_000, alarms: 0 };
    bench.events.clear();
    enemy.record(&request_frame(1, bench.rig.boot(), SESSION, &Request::OpenSession));
    honest_host(&mut bench, &mut ledger, &mut enemy);
    let (mut hosts, mut resets) = (0, 0);
    while enemy.sent < frames {
        match enemy.below(40) {
            0..=19 => {
                let count = 1 + enemy.below(3);
                enemy.replay(&mut bench, count);
            }
            20..=29 => {
                let burst = 20 + enemy.below(80);
                enemy.replay(&mut bench, burst);
            }
            30..=35 => enemy.noise(&mut bench),
            36..=37 => killed_host(&mut bench, &mut ledger, &mut enemy),
            38 => {
                honest_host(&mut bench, &mut ledger, &mut enemy);
                hosts += 1;
            }
            _ if enemy.below(4) > 0 => bench.run_ms(5),
            _ => {
                settle_accounts(&mut bench, &mut ledger);
                let boot = bench.rig.boot() + 1;
                bench.run_ms(50);
                settle_accounts(&mut bench, &mut ledger);
                bench.restart(boot, ResetCause::Pin);
                // The piezo drops, and its gauge leaves its range until the swing ends.
                bench.run_ms(300);
                ledger.ends.clear();
                resets += 1;
            }
        }
        settle_accounts(&mut bench, &mut ledger);
        if ledger.ends.len() > 400 {
            // The requesting host is gone; a running motion would have been reported.
            let last = ledger.ends.keys().next_back().copied().unwrap_or(0);
            ledger.ends.retain(|id, _| id + 200 > last);
        }
    }
    honest_host(&mut bench, &mut ledger, &mut enemy);
    assert!(hosts > 0 && resets > 0, "{hosts} honest hosts, {resets} resets");
    println!(
        "{} hostile frames, {hosts} honest hosts, {resets} resets, {} alarms",
        enemy.sent, ledger.alarms
    );
}

#[test]
fn an_alarm_of_the_past_is_not_raised_again_by_a_replay() {
    let mut bench = Bench::new(0.0);
    let id = bench.next_id;
    let halt = request_frame(id, bench.rig.boot(), SESSION, &Request::Halt);
    bench.send_bytes(&halt);
    bench.tick();
    bench.next_id = id + 1;
    bench.clear();
    for _ in 0..20 {
        bench.status();
        bench.send_bytes(&halt);
        bench.tick();
    }
    assert_eq!(bench.alarm(), None);
    let end = bench.work(&bench::go(Axis::SensorFine, 20_000));
    assert!(!matches!(end, EventKind::Failed { reason: Failure::Alarm { .. }, .. }), "{end:?}");
}
