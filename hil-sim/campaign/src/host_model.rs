//! A host that executes a scenario with repeats, hellos and keep-alives, reverts all faults and checks the rig.

mod client;
mod recovery;

use farnear_protocol::{
    Micros, Nanometres, Request, Response,
    message::{Axis, Shot, TriggerMode},
};

pub use self::client::Counts;
use self::client::{Client, Ended};
use farnear_sim::{
    EmulatedRig, RigConfig, SimError,
    observer::Sight,
    scenario::{
        Scenario, Step,
        host::{Deed, Program},
    },
};

use crate::invariants::{Broken, Case, check};

/// Permitted silence during motion.
const SILENCE: Micros = Micros(2_000_000);

#[derive(Clone, PartialEq, Debug, Default)]
pub struct Outcome {
    pub broken: Vec<Broken>,
    /// Virtual time of the run.
    pub board_ns: u64,
    pub counts: Counts,
    pub resets: usize,
}

/// Plays a scenario from power-on to its end and checks the invariants.
pub fn play(scenario: &Scenario, config: &RigConfig) -> Result<Outcome, SimError> {
    let config = RigConfig { observe: true, ..config.clone() };
    let mut client = Client::new(EmulatedRig::new(&config)?);
    let mut sights = Vec::new();
    client.join()?;
    for step in &scenario.host {
        carry_out(&mut client, step)?;
        sights.extend(client.rig.take_sights()?);
    }
    let works = recovery::recover(&mut client);
    let report = client.rig.advance_us(100_000)?;
    sights.extend(client.rig.take_sights()?);
    let works = works?;
    sights.sort_by_key(|sight: &Sight| sight.at_ns);
    let case = Case { scenario, parts: &config.parts, sights: &sights };
    let mut broken = check(&case);
    broken.extend(works.map(|what| Broken { property: "works-after", at_ns: report.now_ns, what }));
    let counts = client.counts;
    client.rig.stop()?;
    Ok(Outcome { broken, board_ns: report.now_ns, counts, resets: report.resets })
}

fn go(axis: Axis, to_um: f64) -> Request {
    Request::Move { axis, target: Nanometres((1e3 * to_um).round() as i32), silence: SILENCE }
}

fn carry_out(client: &mut Client, step: &Step) -> Result<(), SimError> {
    let long = match &step.deed {
        Deed::Home(axis) => {
            let axes = axis.map_or(vec![Axis::SensorCoarse, Axis::Lens], |axis| vec![axis]);
            axes.into_iter().map(|axis| Request::Home { axis, silence: SILENCE }).collect()
        }
        Deed::Move { axis, to_um } => vec![go(*axis, *to_um)],
        Deed::Expose(program) => {
            load(client, program)?;
            vec![Request::RunProgram { silence: SILENCE }]
        }
        Deed::Continuous { program, period_us, exposures } => {
            load(client, program)?;
            let (period, exposures) = (Micros(*period_us), *exposures);
            vec![Request::RunContinuously { period, exposures, silence: SILENCE }]
        }
        Deed::Calibrate(axis) => {
            let routine = farnear_protocol::message::Routine::Backlash { axis: *axis };
            vec![Request::Calibrate { routine, silence: SILENCE }]
        }
        short => return carry_out_at_once(client, short),
    };
    let mut ids = Vec::new();
    for request in long {
        if let Some((id, Ok(Response::Accepted))) = client.ask(&request)? {
            ids.push(id);
        }
    }
    match step.goes_on_after_ms {
        Some(ms) => client.wait_us((ms * 1e3) as u64),
        None => client.wait_for_ends(&ids).map(|_: Vec<Ended>| ()),
    }
}

/// Executes a step without long work.
fn carry_out_at_once(client: &mut Client, deed: &Deed) -> Result<(), SimError> {
    let request = match deed {
        Deed::Set { key, value } => {
            client.written.push(*key);
            Request::WriteSetting { key: *key, value: *value }
        }
        Deed::Stop => Request::Stop,
        Deed::Halt => Request::Halt,
        Deed::Reboot => Request::Reboot,
        Deed::Pause => Request::PauseProgram,
        Deed::Resume => Request::ResumeProgram,
        Deed::Clear => return recovery::clear_alarms(client).map(|_| ()),
        Deed::Silent { ms } => return client.rig.advance_us((ms * 1e3) as u64).map(|_| ()),
        Deed::Wait { ms } => return client.wait_us((ms * 1e3) as u64),
        // Long work is handled by the caller.
        Deed::Home(_)
        | Deed::Move { .. }
        | Deed::Expose(_)
        | Deed::Continuous { .. }
        | Deed::Calibrate(_) => {
            return Ok(());
        }
    };
    client.ask(&request).map(|_| ())
}

fn load(client: &mut Client, program: &Program) -> Result<(), SimError> {
    for (index, at_um) in (0..).zip(&program.at_um) {
        let shot = Shot {
            axis: Axis::SensorFine,
            target: Nanometres((1e3 * at_um).round() as i32),
            exposure: Micros(program.exposure_us),
            settle_window: Nanometres(program.window_nm),
            settle_dwell: Micros(2_000),
            repeat: 1,
            mode: TriggerMode::Hardware,
        };
        client.ask(&Request::LoadShot { index, shot })?;
    }
    let shots = u8::try_from(program.at_um.len()).unwrap_or(u8::MAX); // at most 64
    client.ask(&Request::ArmProgram { shots }).map(|_| ())
}
