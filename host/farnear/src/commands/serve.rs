use std::{net::SocketAddr, path::PathBuf, time::Duration};

use anyhow::{Result, bail};
use clap::Args;
use farnear_serve::{Limits, Listen, ServeSettings, Token, serve};
use farnear_workflows::{
    operator_cache::data_folder,
    rig::{RigAddress, camera::CameraSettings},
    simulator::Scenery,
};

use super::rig::target::checked;
use crate::{
    report::{self, Usage},
    scene::{SceneArgument, packed},
    terminal,
};

const PORT: u16 = 8080;

/// Serve the page: the rig in a browser. Listens on localhost only, unless --listen names an address.
#[derive(Args)]
#[command(after_help = "Example: farnear serve --rig sim --open\n\
                        \x20        farnear serve --rig /dev/ttyACM0 --camera folder:shots/ --session captures/")]
pub struct Arguments {
    /// Serial port of the board; or sim, to start the emulated rig. Without it the page shows captures.
    #[arg(long, value_name = "PORT|sim")]
    rig: Option<String>,
    /// Camera: sim (with --rig sim), HOST:PORT of a farnear-sim, folder:DIR where images appear, or another kind of docs/cameras.md.
    #[arg(long, value_name = "CAMERA", default_value = "sim")]
    camera: String,
    /// Set this on the camera first, as far as its kind has it: gain, black_level, pixel_format, region, trigger_source.
    #[arg(long, value_name = "NAME=VALUE")]
    set: Vec<farnear_capture::camera::Setting>,
    /// Scene before the emulated camera: plane:MM, staircase, slant, cone, sphere or a scene file [default: staircase].
    #[arg(long, value_parser = checked::<SceneArgument>)]
    scene: Option<String>,
    /// Folder of captures, created if missing [default: farnear/session in the user's data folder].
    #[arg(long, value_name = "DIR")]
    session: Option<PathBuf>,
    /// The optics file to begin with [default: that of the session, else the 50 mm lens].
    #[arg(long, value_name = "FILE")]
    optics: Option<PathBuf>,
    /// Port of the page; 0 = any that is free.
    #[arg(long, default_value_t = PORT)]
    port: u16,
    /// Listen at this address of the network; requires --token-file.
    #[arg(long, value_name = "ADDRESS:PORT", requires = "token_file", conflicts_with = "port")]
    listen: Option<SocketAddr>,
    /// File with the token that a browser must know.
    #[arg(long, value_name = "FILE", alias = "token", requires = "listen")]
    token_file: Option<PathBuf>,
    /// A name of this computer in the network's DNS; may be repeated.
    #[arg(long, value_name = "NAME", requires = "listen")]
    name: Vec<String>,
    /// Longest time in which a client may send the headers of a request.
    #[arg(long, value_name = "S", default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..=3600))]
    header_timeout_s: u64,
    /// Longest time for the body of a request, and longest pause within an upload.
    #[arg(long, value_name = "S", default_value_t = 20, value_parser = clap::value_parser!(u64).range(1..=3600))]
    body_timeout_s: u64,
    /// Close connections that are idle for this time.
    #[arg(long, value_name = "S", default_value_t = 30, value_parser = clap::value_parser!(u64).range(1..=3600))]
    idle_timeout_s: u64,
    /// Most connections at a time; above it idle ones are closed.
    #[arg(long, value_name = "N", default_value_t = 512, value_parser = clap::value_parser!(u32).range(16..=100_000))]
    max_connections: u32,
    /// Most connections of one address; a browser needs about 7.
    #[arg(long, value_name = "N", default_value_t = 128, value_parser = clap::value_parser!(u32).range(8..=100_000))]
    max_connections_per_address: u32,
    /// Most megabytes of uploaded videos in the session.
    #[arg(long, value_name = "MB", default_value_t = 2048)]
    upload_quota_mb: u32,
    /// Open the page in the browser.
    #[arg(long)]
    open: bool,
}

pub fn run(arguments: Arguments) -> Result<()> {
    let rig = match arguments.rig.as_deref() {
        // Runs in real time, because people watch it.
        Some("sim") => {
            let packed_scene = packed(arguments.scene.as_deref())?;
            let scene = arguments.scene;
            Some(RigAddress::Emulated(Scenery { scene, packed_scene, paced: true, ..Scenery::default() }))
        }
        _ if arguments.scene.is_some() => bail!(Usage("--scene goes with --rig sim only".into())),
        Some(port) => Some(RigAddress::Port(port.into())),
        None => None,
    };
    let listen = match (arguments.listen, arguments.token_file) {
        (Some(address), Some(file)) => {
            Listen::Network { address, token: Token::read(&file)?, names: arguments.name }
        }
        _ => Listen::Loopback { port: arguments.port },
    };
    let session = match arguments.session {
        Some(folder) => folder,
        // Not the current folder: the user did not ask for files there.
        None => data_folder()
            .ok_or_else(|| {
                Usage("this user has no data folder; name a folder for captures with --session".into())
            })?
            .join("farnear/session"),
    };
    let settings = ServeSettings {
        rig,
        camera: CameraSettings {
            address: arguments.camera.parse()?,
            settings: arguments.set,
            ..CameraSettings::default()
        },
        session,
        optics: arguments.optics,
        listen,
        limits: Limits {
            header_timeout: Duration::from_secs(arguments.header_timeout_s),
            body_timeout: Duration::from_secs(arguments.body_timeout_s),
            idle_timeout: Duration::from_secs(arguments.idle_timeout_s),
            connections: arguments.max_connections as usize,
            connections_per_address: arguments.max_connections_per_address as usize,
            upload_quota_bytes: u64::from(arguments.upload_quota_mb) << 20,
        },
    };
    let context = terminal::context()?;
    serve(settings, &context, |address| {
        // A reader that closes stdout has the address on stderr, too.
        let _ = report::to_stdout(&format!("{address}\n"));
        terminal::say(&format!("the page is at {address}; Ctrl-C ends it and stops all motion\n"));
        if arguments.open
            && let Err(error) = open::that_detached(address)
        {
            let warning = format!("warning: no browser can be started ({error}); open {address} yourself\n");
            terminal::say(&warning);
        }
    })?;
    Ok(())
}
