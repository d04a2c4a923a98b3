pub mod alarms;
mod axis;
pub mod board;
pub mod camera;
pub mod check;
pub mod continuous;
pub mod correct;
pub mod correction_fit;
pub mod focus;
pub mod goto;
pub mod half_mirror;
pub mod info;
pub mod lens_stack;
pub mod live;
pub mod live_depth;
pub mod log;
pub mod mechanics;
pub mod motion;
pub mod open;
pub mod pair;
pub mod quality;
pub mod recording;
pub mod sequence;
pub mod series;
pub mod settings;
pub mod sun;
pub mod targets;

use std::{path::Path, sync::Arc};

use farnear_capture::{Client, ClientError, find};
use farnear_depth::psf::Psf;

use crate::{
    context::Context,
    error::{Result, WorkflowError},
    simulator::{Scenery, Simulator},
};
pub use axis::AxisName;
use open::OpenRig;

#[derive(Clone, PartialEq, Debug, Default)]
pub enum RigAddress {
    /// The only connected board.
    #[default]
    Attached,
    /// Behind a serial port, e.g. `/dev/ttyACM0`.
    Port(String),
    /// Emulated: `farnear-sim` is started for it and ends with it.
    Emulated(Scenery),
    Open(OpenRig),
}

impl RigAddress {
    pub fn is_emulated(&self) -> bool {
        matches!(self, Self::Emulated(_))
    }

    /// Scene of an emulated rig that has not been started.
    pub fn scene(&self) -> Option<String> {
        match self {
            Self::Emulated(scenery) => Some(scenery.scene()),
            Self::Attached | Self::Port(_) | Self::Open(_) => None,
        }
    }

    pub fn with_scene(&self, scene: String) -> Result<Self> {
        match self {
            Self::Emulated(scenery) => Ok(Self::Emulated(scenery.with_scene(scene))),
            Self::Attached => Err(WorkflowError::parameter("scene", scene, "a board has a world of its own")),
            Self::Port(port) => {
                Err(WorkflowError::parameter("scene", scene, format!("the scene of {port} cannot be set")))
            }
            Self::Open(open) => {
                let reason = format!("{} is already running with another scene", open.name());
                Err(WorkflowError::parameter("scene", scene, reason))
            }
        }
    }
}

pub struct Rig {
    pub client: Client,
    /// The emulated rig started for this task, with its options. Ends after `client`.
    pub emulation: Option<(Arc<Simulator>, Scenery)>,
}

impl Rig {
    /// Connects. Cancelling stops all motion. An emulated rig uses the lens of `optics`, if given.
    pub fn connect(
        address: &RigAddress,
        optics: Option<(&Path, Psf)>,
        context: &Context<'_>,
    ) -> Result<Self> {
        // A silent port takes seconds.
        let open = |port: String, emulated: bool| {
            let flag = context.cancel.flag();
            let connect = move || Client::open_interruptible(&port, emulated, flag);
            context.cancel.watch("connecting to the board", connect)
        };
        let (mut client, emulation) = match address {
            RigAddress::Attached => {
                let port = find::board_port().map_err(ClientError::Port)?;
                (open(port, false)??, None)
            }
            RigAddress::Port(port) => (open(port.clone(), false)??, None),
            RigAddress::Open(rig) => return Ok(rig.connect(context)),
            RigAddress::Emulated(scenery) => {
                let simulator = Simulator::start(scenery, optics, context)?;
                let client = open(simulator.port().into(), true)??;
                (client, Some((Arc::new(simulator), scenery.clone())))
            }
        };
        client.interrupt_by(context.cancel.flag());
        for note in [client.firmware_note(), client.link_note()].into_iter().flatten() {
            context.info(&note);
        }
        Ok(Self { client, emulation })
    }
}

#[cfg(test)]
mod tests {
    use std::{
        io::Read,
        net::TcpListener,
        thread,
        time::{Duration, Instant},
    };

    use super::*;

    #[test]
    fn cancelling_ends_the_wait_for_a_silent_port_and_closes_it() {
        let silent = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = format!("tcp:{}", silent.local_addr().unwrap());
        let context = Context::unattended();
        let cancel = context.cancel.clone();
        let cancelling = thread::spawn(move || {
            thread::sleep(Duration::from_millis(100));
            cancel.cancel();
        });
        let begin = Instant::now();
        let error = Rig::connect(&RigAddress::Port(port), None, &context).err().unwrap();
        assert!(error.is_cancelled() && begin.elapsed() < Duration::from_secs(2), "{error}");
        let (mut line, _) = silent.accept().unwrap();
        let _ = line.read_to_end(&mut Vec::new()); // until the other end is closed
        assert!(begin.elapsed() < Duration::from_secs(2), "held for {:?}", begin.elapsed());
        cancelling.join().unwrap();
    }
}
