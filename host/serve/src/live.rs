//! Live images and depth between jobs.

use std::{cell::RefCell, path::Path, time::Instant};

use farnear_capture::camera::Image;
use farnear_protocol::message::ShotRecord;
use farnear_workflows::{
    Context, Progress, Result, Unattended, WorkflowError, camera, optics, picture,
    rig::{
        RigAddress,
        camera::CameraSettings,
        live::{self, LiveSettings},
        live_depth::{self, LiveDepth, LiveDepthSettings},
        recording::{self, PlayFigures},
    },
};
use serde_json::json;

use crate::{
    app::{App, Live, lock},
    depth_message::{self, ends, unix_ms},
    picture_message::message,
    view::LiveMode,
};

/// Weight of the newest frame in the shown rate.
const NEWEST: f64 = 0.15;

/// Runs the live view until another one is selected. After an error it waits for a new selection.
pub fn look(app: &App) {
    let live = app.live();
    // After `live` was read: a later stop ends this view.
    app.stops.wait();
    // A job that begins later ends this view.
    if app.rig_jobs.is_busy() {
        return;
    }
    let rig = app.rig();
    if rig.is_none() && !app.has_camera_alone() {
        return;
    }
    let notices = Notices(app);
    let context = Context::new(&notices, &Unattended, live.cancel.clone());
    let rate = Rate::default();
    let ended = match (live.mode, rig) {
        (LiveMode::Off, _) => return,
        (_, None) => look_through_camera(app, &live, &context, &rate),
        (LiveMode::Image, Some(rig)) => {
            let settings = LiveSettings { rig: RigAddress::Open(rig), camera: app.camera() };
            live::watch(&settings, &context, |record, image| {
                app.pictures.send_replace(image_message(Some(&record), &image, &live, rate.next()));
                enough(app)
            })
        }
        (LiveMode::Depth, Some(rig)) => look_at_depth(app, RigAddress::Open(rig), &context, &rate),
    };
    // The rig's report of this stop must not end the next view.
    let cancelled = context.cancel.is_cancelled() || app.is_ending();
    match ended {
        Err(error) if !error.is_cancelled() && !cancelled => fail(app, &error.to_string()),
        _ if live.mode == LiveMode::Depth && context.cancel.is_cancelled() => app.finish_ended_recording(),
        _ if live.mode == LiveMode::Depth => app.finish_recording(),
        _ => {}
    }
}

/// Switches the live view off because of an error.
pub fn fail(app: &App, error: &str) {
    app.note(format!("live: {error}"));
    app.set_live(|live| (live.mode, live.failed) = (LiveMode::Off, true));
    app.change(|state| state.live.error = Some(error.into()));
    // After the mode has changed: no recording begins any more.
    app.finish_recording();
}

/// Shows why pairs have no depth. The next depth removes it.
struct Notices<'a>(&'a App);

impl Progress for Notices<'_> {
    fn info(&self, _: &str) {}

    fn warn(&self, what: &str) {
        let Self(app) = self;
        let state = app.state();
        if enough(app).is_err() {
            return app.interrupt_live();
        }
        if state.live.mode == LiveMode::Depth && state.live.error.as_deref() != Some(what) {
            app.note(format!("live: {what}"));
            app.change(|state| state.live.error = Some(what.into()));
        }
    }
}

fn enough(app: &App) -> Result<()> {
    if app.is_ending() || app.state().control.clients == 0 {
        return Err(WorkflowError::Cancelled { during: "watching".into() });
    }
    Ok(())
}

/// Without a rig a camera runs freely.
fn look_through_camera(app: &App, live: &Live, context: &Context<'_>, rate: &Rate) -> Result<()> {
    let CameraSettings { address, settings, .. } = app.camera();
    let camera = camera::open(&address, &settings)?;
    camera::live::watch(camera, live.exposure, context, |frame| {
        app.pictures.send_replace(image_message(None, &frame.image, live, rate.next()));
        enough(app)
    })
}

fn image_message(record: Option<&ShotRecord>, image: &Image, live: &Live, rate_hz: f64) -> axum::body::Bytes {
    let arrived_ms = unix_ms();
    let figures = picture::figures_of(image, live.region, live.measure);
    let (height, width) = image.pixels.dim();
    let header = json!({
        "type": "image",
        "width": width,
        "height": height,
        "figures": figures,
        "measure": live.measure.name(),
        "exposure_us": live.exposure.0,
        "rate_hz": rate_hz,
        "arrived_ms": arrived_ms,
        "trigger": record.map(|record| record.trigger_number),
        "fine_um": record.map(|record| f64::from(record.fine.0) / 1e3),
        "coarse_um": record.map(|record| f64::from(record.coarse.0) / 1e3),
    });
    message(&header, &[&image.eight_bits()])
}

fn look_at_depth(app: &App, rig: RigAddress, context: &Context<'_>, rate: &Rate) -> Result<()> {
    let ends = ends(&optics::read(&app.optics_file())?);
    let settings = LiveDepthSettings { rig, camera: app.camera(), optics: app.optics_file() };
    live_depth::watch(&settings, context, |depth: LiveDepth<'_>| {
        let shown = app.state().live;
        // The error of a view that was stopped is the reason of the stop.
        if shown.mode == LiveMode::Depth && shown.error.is_some() {
            app.change(|state| state.live.error = None);
        }
        // A cancelled view may still give a pair of the earlier settings.
        if !context.cancel.is_cancelled() {
            record(app, &depth);
        }
        app.pictures.send_replace(depth_message::live(&depth, ends, rate.next()));
        enough(app)
    })
}

fn record(app: &App, depth: &LiveDepth<'_>) {
    let added = lock(&app.recorder).as_mut().map(|running| running.recorder.add(depth.far, depth.near));
    match added {
        None | Some(Ok(true)) => {}
        Some(Ok(false)) => app.break_recording(&format!("it has {} pairs", recording::PAIRS_MAX)),
        Some(Err(error)) => app.break_recording(&error.to_string()),
    }
}

/// Plays a recording at its own rate, or as fast as depth is computed.
pub fn play(app: &App, path: &Path, fast: bool, context: &Context<'_>) -> Result<PlayFigures> {
    let rate = Rate::default();
    recording::play(path, fast, context, |depth, optics| {
        app.pictures.send_replace(depth_message::live(&depth, ends(optics), rate.next()));
        Ok(())
    })
}

/// Smoothed frames per second.
#[derive(Default)]
struct Rate(RefCell<Option<(Instant, f64)>>);

impl Rate {
    fn next(&self) -> f64 {
        let now = Instant::now();
        let mut last = self.0.borrow_mut();
        let rate = match *last {
            Some((before, rate)) => {
                let newest = 1.0 / now.duration_since(before).as_secs_f64().max(1e-4);
                if rate == 0.0 { newest } else { rate + NEWEST * (newest - rate) }
            }
            None => 0.0,
        };
        *last = Some((now, rate));
        (rate * 10.0).round() / 10.0
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use std::{fs, path::Path, sync::Arc, time::Duration};

    use farnear_protocol::message::LightLevels;
    use farnear_workflows::{optics::GivenOptics, rig::camera::CameraAddress};

    use super::*;
    use crate::{Limits, Listen, ServeSettings, guard::Guard};

    pub(crate) fn app(folder: &Path) -> Arc<App> {
        let camera = CameraSettings {
            address: CameraAddress::Folder(folder.into()),
            image_wait: Duration::from_secs(1),
            ..CameraSettings::default()
        };
        let listen = Listen::Loopback { port: 0 };
        let guard = Guard::new(&listen, 0);
        let limits = Limits::default();
        let settings =
            ServeSettings { rig: None, camera, session: folder.into(), optics: None, listen, limits };
        App::new(settings, guard).expect("a session")
    }

    #[test]
    fn the_light_of_the_optics_is_on_until_it_is_switched_off() {
        let folder = tempfile::tempdir().expect("a folder");
        let optics = folder.path().join("optics.toml");
        let text = format!("{}\n[light]\nfirst = 30\nsecond = 0\n", include_str!("optics.toml"));
        fs::write(&optics, text).expect("a writable folder");
        let (app, optics) = (app(folder.path()), GivenOptics::read(&optics).expect("optics"));
        let light = || app.camera().light_with(Some(&optics)).map(LightLevels::percent);
        assert_eq!((app.state().live.light_percent, light()), ([30.0, 0.0], Some([30.0, 0.0])));
        app.set_live(|live| live.light = Some(LightLevels::OFF));
        assert_eq!((app.state().live.light_percent, light()), ([0.0; 2], None));
    }

    #[test]
    fn live_depth_that_was_stopped_for_a_reason_shows_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let app = app(folder.path());
        for (mode, left, error) in [
            (LiveMode::Depth, LiveMode::Off, Some("the browser has disconnected")),
            (LiveMode::Image, LiveMode::Image, None),
        ] {
            app.set_live(|live| live.mode = mode);
            drop(app.begin_stop_because("the browser has disconnected"));
            let live = app.state().live;
            assert_eq!((live.mode, live.error.as_deref()), (left, error));
            assert!(!app.live().failed, "the rig's next answer does not start it again");
        }
    }

    #[test]
    fn a_pair_without_depth_is_reported_and_live_depth_goes_on_while_somebody_watches() {
        let folder = tempfile::tempdir().expect("a folder");
        let app = app(folder.path());
        app.set_live(|live| live.mode = LiveMode::Depth);
        let cancel = app.live().cancel;
        let _client = app.with_control(|control| control.join(None));
        for _ in 0..2 {
            Notices(&app).warn("the far image is constant (1): depth needs texture");
        }
        let live = app.state().live;
        assert_eq!(live.mode, LiveMode::Depth);
        assert_eq!(live.error.as_deref(), Some("the far image is constant (1): depth needs texture"));
        assert_eq!((app.log().len(), cancel.is_cancelled()), (1, false));
        app.end();
        Notices(&app).warn("the near image is constant (0): depth needs texture");
        assert!(cancel.is_cancelled(), "otherwise it would go on without a single depth");
    }
}
