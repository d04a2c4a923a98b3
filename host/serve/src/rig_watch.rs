//! State of the rig: connects, and polls ten times a second while a browser watches.

use std::{
    io,
    sync::Arc,
    thread::{Builder, JoinHandle},
    time::Duration,
};

use farnear_workflows::{
    Cancel, Context, Progress, Unattended, WorkflowError,
    optics::GivenOptics,
    rig::{RigAddress, info, open::OpenRig},
};

use crate::{
    app::App,
    view::{LiveMode, Phase},
};

/// Poll interval while a browser watches.
const OFTEN: Duration = Duration::from_millis(100);
const SELDOM: Duration = Duration::from_secs(1);
/// Poll interval for the end of the program.
const LOOK: Duration = Duration::from_millis(50);

pub fn start(app: &Arc<App>) -> io::Result<JoinHandle<()>> {
    let app = Arc::clone(app);
    Builder::new().name("rig watch".into()).spawn(move || run(&app))
}

fn run(app: &App) {
    while !app.is_ending() {
        if app.asked_to_connect() {
            connect(app);
        }
        if let Some(rig) = app.rig() {
            ask(app, &rig);
        }
        let pause = if app.state().control.clients > 0 { OFTEN } else { SELDOM };
        let mut left = pause;
        while !left.is_zero() && !app.is_ending() {
            std::thread::sleep(left.min(LOOK));
            left = left.saturating_sub(LOOK);
        }
    }
}

struct ToLog<'a>(&'a App);

impl Progress for ToLog<'_> {
    fn info(&self, what: &str) {
        self.0.note(what);
    }
}

fn connect(app: &App) {
    let Some(address) = app.chosen_rig() else { return };
    app.change(|state| {
        state.rig.phase = Phase::Connecting;
        state.rig.error = None;
    });
    app.set_rig(None);
    // A view that began meanwhile has the rig of before.
    app.interrupt_live();
    let log = ToLog(app);
    let context = Context::new(&log, &Unattended, Cancel::default());
    let opened =
        GivenOptics::read(&app.optics_file()).and_then(|optics| OpenRig::open(&address, &optics, &context));
    match opened {
        Ok(rig) => {
            app.set_rig(Some(rig));
            resume_live(app);
        }
        Err(error) => lost(app, &error),
    }
}

/// Restarts the live image if an error had ended it.
fn resume_live(app: &App) {
    if app.live().failed {
        app.set_live(|live| live.mode = LiveMode::Image);
    }
}

fn lost(app: &App, error: &WorkflowError) {
    let text = error.to_string();
    if app.state().rig.error.as_ref() != Some(&text) {
        app.note(format!("rig: {text}"));
    }
    app.change(|state| {
        state.rig.phase = Phase::Lost;
        state.rig.error = Some(text);
    });
}

fn ask(app: &App, rig: &OpenRig) {
    match info::info(&RigAddress::Open(rig.clone()), &Context::unattended()) {
        // The rig that answered is about to be replaced.
        Ok(_) if app.is_to_connect() => {}
        Ok(figures) => {
            let mut info = serde_json::to_value(&figures).unwrap_or_default();
            if let Some(fields) = info.as_object_mut() {
                fields.remove("link_frames"); // every question counts itself
            }
            app.change(|state| {
                state.rig.phase = Phase::Ready;
                state.rig.error = None;
                state.rig.emulated = figures.emulated;
                state.rig.info = Some(info);
            });
        }
        Err(error) => {
            lost(app, &error);
            // After a reset or reconnection the position is unknown.
            if rig.reopen().is_ok() {
                app.note("rig: it answers again; home it before it moves");
                resume_live(app);
            }
        }
    }
}
