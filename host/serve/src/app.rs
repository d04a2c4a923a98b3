//! State shared by all requests.

use std::{
    collections::VecDeque,
    path::PathBuf,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    time::Duration,
};

use axum::body::Bytes;
use farnear_capture::camera::Setting;
use farnear_depth::focus_measure::FocusMeasure;
use farnear_files::staging::write_file;
use farnear_protocol::{Micros, message::LightLevels};
use farnear_workflows::{
    Cancel, WorkflowError,
    measure::Rectangle,
    optics::GivenOptics,
    rig::{
        RigAddress,
        camera::{CameraAddress, CameraSettings},
        open::OpenRig,
        recording::Recorder,
    },
};
use tokio::sync::watch;

use crate::{
    connections::Limits,
    control::ControlLock,
    depth_message::unix_ms,
    guard::{Guard, Throttle},
    job_queue::{JobQueue, Task},
    server::ServeSettings,
    stopping::{PATIENCE, Stop, StopError, Stops},
    upload_quota::UploadQuota,
    view::{ControlState, LiveMode, LiveState, LogLine, Phase, RigState, State},
};

const LOG_MAX: usize = 1000;
/// The 50 mm lens of Li 2014, for a session that has no optics yet.
const USUAL_OPTICS: &str = include_str!("optics.toml");

pub struct App {
    /// Identifies this run of the server.
    pub run: String,
    pub guard: Guard,
    pub limits: Limits,
    /// Delays answers to wrong tokens.
    pub throttle: Throttle,
    pub session: PathBuf,
    pub address: Option<RigAddress>,
    /// As `address`, with the scene chosen on the page.
    chosen: Mutex<Option<RigAddress>>,
    rig: Mutex<Option<OpenRig>>,
    camera: Mutex<CameraSettings>,
    pub rig_jobs: JobQueue,
    pub computing: JobQueue,
    control: Mutex<ControlLock>,
    state: Mutex<State>,
    told: watch::Sender<Arc<str>>,
    /// The newest live picture, encoded.
    pub pictures: watch::Sender<Bytes>,
    live: Mutex<Live>,
    log: Mutex<VecDeque<LogLine>>,
    /// The running recording of live depth; `state.live.recording` changes while it is locked.
    pub recorder: Mutex<Option<Running>>,
    pub uploads: Arc<UploadQuota>,
    /// The answer to a prompt, until the job takes it.
    pub answer: Mutex<Option<String>>,
    ending: watch::Sender<bool>,
    reconnect: AtomicBool,
    pub stops: Arc<Stops>,
}

/// A recording, and the end of the view whose pairs it gets.
pub struct Running {
    pub recorder: Recorder,
    pub view: Cancel,
}

#[derive(Clone, Debug)]
pub struct Live {
    pub mode: LiveMode,
    /// An error ended it, so it begins again with the rig.
    pub failed: bool,
    pub exposure: Micros,
    /// Of exposures that the board triggers.
    pub light: Option<LightLevels>,
    pub measure: FocusMeasure,
    /// Part of the image that the figures describe; `None`: all.
    pub region: Option<Rectangle>,
    pub cancel: Cancel,
}

/// Ignores poisoning: every change leaves the value consistent.
pub fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl App {
    /// Creates the session's optics if they are missing.
    pub fn new(settings: ServeSettings, guard: Guard) -> Result<Arc<Self>, WorkflowError> {
        let ServeSettings { rig, camera, session, optics, limits, .. } = settings;
        let own = session.join("optics.toml");
        if let Some(given) = optics {
            let given = GivenOptics::read(&given)?;
            write_file(&own, toml::to_string(&given.table)?.as_bytes())?;
        } else if !own.exists() {
            write_file(&own, USUAL_OPTICS.as_bytes())?;
        }
        let of_optics = GivenOptics::read(&own)?.light;
        let live = Live {
            mode: LiveMode::Image,
            failed: false,
            exposure: camera.exposure,
            light: camera.light.or(of_optics),
            measure: FocusMeasure::ModifiedLaplacian,
            region: None,
            cancel: Cancel::default(),
        };
        let state = beginning(rig.as_ref(), &camera, &live);
        Ok(Arc::new(Self {
            run: format!("{} {}", env!("CARGO_PKG_VERSION"), unix_ms()),
            guard,
            limits,
            throttle: Throttle::default(),
            session,
            reconnect: AtomicBool::new(rig.is_some()),
            chosen: Mutex::new(rig.clone()),
            address: rig,
            rig: Mutex::default(),
            camera: Mutex::new(camera),
            rig_jobs: JobQueue::default(),
            computing: JobQueue::default(),
            control: Mutex::default(),
            told: watch::Sender::new(Arc::from("")),
            pictures: watch::Sender::new(Bytes::new()),
            state: Mutex::new(state),
            live: Mutex::new(live),
            log: Mutex::default(),
            answer: Mutex::default(),
            recorder: Mutex::default(),
            uploads: Arc::default(),
            ending: watch::Sender::new(false),
            stops: Arc::default(),
        }))
    }

    pub fn optics_file(&self) -> PathBuf {
        self.session.join("optics.toml")
    }

    pub fn camera(&self) -> CameraSettings {
        let Live { exposure, light, .. } = self.live();
        CameraSettings { exposure, light, ..lock(&self.camera).clone() }
    }

    /// Changes camera settings and restarts the live view.
    pub fn set_camera(&self, settings: Vec<Setting>) {
        lock(&self.camera).settings = settings;
        self.interrupt_live();
    }

    pub fn has_camera_alone(&self) -> bool {
        self.address.is_none() && lock(&self.camera).address != CameraAddress::Emulated
    }

    pub fn rig(&self) -> Option<OpenRig> {
        lock(&self.rig).clone()
    }

    pub fn set_rig(&self, rig: Option<OpenRig>) {
        // Dropped after the lock: the end of a rig may take seconds.
        let before = std::mem::replace(&mut *lock(&self.rig), rig);
        drop(before);
    }

    /// Sets the rig of the next connection.
    pub fn choose_rig(&self, address: RigAddress) {
        *lock(&self.chosen) = Some(address);
    }

    pub fn chosen_rig(&self) -> Option<RigAddress> {
        lock(&self.chosen).clone()
    }

    /// Requests a (new) connection to the rig.
    pub fn ask_to_connect(&self) {
        self.reconnect.store(true, Ordering::Relaxed);
        let scene = self.chosen_rig().as_ref().and_then(RigAddress::scene);
        self.change(|state| {
            state.rig = RigState { phase: Phase::Connecting, error: None, scene, ..state.rig.clone() };
        });
    }

    /// Whether a connection was requested and has not begun.
    pub fn is_to_connect(&self) -> bool {
        self.reconnect.load(Ordering::Relaxed)
    }

    /// Returns whether a connection was requested since the last call.
    pub fn asked_to_connect(&self) -> bool {
        self.reconnect.swap(false, Ordering::Relaxed)
    }

    pub fn live(&self) -> Live {
        lock(&self.live).clone()
    }

    /// Changes the live settings and ends the present live view.
    pub fn set_live(&self, change: impl FnOnce(&mut Live)) {
        let mut live = lock(&self.live);
        live.failed = false;
        change(&mut live);
        live.cancel.cancel();
        live.cancel = Cancel::default();
        let Live { mode, exposure, light, measure, region, .. } = live.clone();
        drop(live);
        self.change(|state| {
            state.live = LiveState {
                mode,
                exposure_us: exposure.0,
                light_percent: light.unwrap_or_default().percent(),
                measure,
                region: region.map(Into::into),
                error: None,
                ..state.live.clone()
            };
        });
    }

    /// Ends the live view for a job; it continues after the job.
    pub fn interrupt_live(&self) {
        let mut live = lock(&self.live);
        live.cancel.cancel();
        live.cancel = Cancel::default();
    }

    /// Changes the state and publishes it to every browser.
    pub fn change(&self, change: impl FnOnce(&mut State)) {
        let mut state = lock(&self.state);
        let before = state.clone();
        change(&mut state);
        if *state != before {
            self.tell(&state);
        }
    }

    fn tell(&self, state: &State) {
        // Plain values always have a JSON form.
        if let Ok(text) = serde_json::to_string(state) {
            self.told.send_replace(text.into());
        }
    }

    pub fn state(&self) -> State {
        lock(&self.state).clone()
    }

    /// The state as JSON; the first value is available immediately.
    pub fn follow(&self) -> watch::Receiver<Arc<str>> {
        let state = lock(&self.state);
        if self.told.borrow().is_empty() {
            self.tell(&state);
        }
        let mut receiver = self.told.subscribe();
        receiver.mark_changed();
        receiver
    }

    /// Changes the control lock and publishes the result.
    pub fn with_control<T>(&self, work: impl FnOnce(&mut ControlLock) -> T) -> T {
        let mut control = lock(&self.control);
        let given = work(&mut control);
        let (holder, requested_by, clients) = (control.holder(), control.requested_by(), control.clients());
        // Published while the lock is held, so that the last change is published last.
        self.change(|state| state.control = ControlState { holder, requested_by, clients });
        given
    }

    pub fn note(&self, line: impl Into<String>) {
        let mut log = lock(&self.log);
        if log.len() == LOG_MAX {
            log.pop_front();
        }
        log.push_back(LogLine { unix_ms: unix_ms(), text: line.into() });
        drop(log);
        self.change(|state| state.log += 1);
    }

    pub fn log(&self) -> Vec<LogLine> {
        lock(&self.log).iter().cloned().collect()
    }

    /// Finishes the recording of a view that was ended; that of a later view continues.
    pub fn finish_ended_recording(&self) {
        self.finish_recording_if(|running| self.is_ending() || running.view.is_cancelled());
    }

    pub fn finish_recording(&self) {
        self.finish_recording_if(|_| true);
    }

    fn finish_recording_if(&self, ends: impl FnOnce(&mut Running) -> bool) {
        // Held until the state agrees: the next recording may begin meanwhile.
        let mut running = lock(&self.recorder);
        let Some(Running { recorder, .. }) = running.take_if(ends) else { return };
        let name = self.state().live.recording.unwrap_or_default();
        match recorder.finish() {
            Ok(found) => self.note(format!("recorded {name}: {} pairs, {} s", found.pairs, found.seconds)),
            Err(error) => self.note(format!("recording {name}: {error}")),
        }
        self.change(|state| state.live.recording = None);
    }

    /// Ends the recording because of an error; recorded pairs are kept.
    pub fn break_recording(&self, why: &str) {
        let name = self.state().live.recording.unwrap_or_default();
        let ended = format!("The recording {name} has ended: {why}; what was recorded before is kept");
        self.note(ended.clone());
        self.finish_recording();
        self.change(|state| state.live.recording_ended = Some(ended));
    }

    /// As [`Self::begin_stop`], for a reason that the stopped job or live depth reports.
    pub fn begin_stop_because(&self, reason: &str) -> Stop {
        let was_depth = self.live().mode == LiveMode::Depth;
        let stop = self.begin_stop_for(Some(reason));
        if was_depth {
            self.change(|state| state.live.error = Some(reason.into()));
        }
        stop
    }

    /// Ends jobs and live depth. Nothing begins until the returned [`Stop`] has reached the board.
    pub fn begin_stop(&self) -> Stop {
        self.begin_stop_for(None)
    }

    fn begin_stop_for(&self, reason: Option<&str>) -> Stop {
        let stop = self.stops.begin(self.rig());
        self.rig_jobs.cancel(reason);
        // Live depth moves the piezo; the live image does not.
        self.set_live(|live| {
            if live.mode == LiveMode::Depth {
                live.mode = LiveMode::Off;
            }
        });
        stop
    }

    /// Ends jobs and live depth and stops the rig, without waiting for the jobs.
    pub fn stop(&self) -> Result<(), StopError> {
        self.tell_stop(self.begin_stop())
    }

    /// Sends a stop. Every browser sees if the board does not answer.
    pub fn tell_stop(&self, stop: Stop) -> Result<(), StopError> {
        stop.tell(PATIENCE).inspect_err(|error| {
            self.note(format!("stop: {error}"));
            if matches!(error, StopError::Unanswered) {
                self.change(|state| {
                    state.rig.phase = Phase::Lost;
                    state.rig.error = Some(error.to_string());
                });
            }
        })
    }

    /// Stops the rig and all computations when the program ends. Waits at most `patience` for the board.
    pub fn stop_everything(&self, patience: Duration) -> Result<(), StopError> {
        self.end();
        self.computing.cancel(None);
        self.set_live(|live| live.mode = LiveMode::Off);
        self.begin_stop().tell(patience)
    }

    pub fn end(&self) {
        self.ending.send_replace(true);
    }

    pub fn is_ending(&self) -> bool {
        *self.ending.borrow()
    }

    pub async fn ended(&self) {
        let mut ending = self.ending.subscribe();
        let _ = ending.wait_for(|ending| *ending).await; // a dropped sender has ended, too
    }

    /// Begins a job on the rig; the error is the title of the running job.
    pub fn begin_on_rig(&self, task: Task) -> Result<u64, String> {
        let begun = self.rig_jobs.begin(task, |job| self.change(|state| state.job = Some(job)));
        if begun.is_ok() {
            self.interrupt_live();
        }
        begun
    }

    /// Begins a computation; the error is the title of the running one.
    pub fn begin_computing(&self, task: Task) -> Result<u64, String> {
        self.computing.begin(task, |job| self.change(|state| state.computation = Some(job)))
    }
}

fn beginning(address: Option<&RigAddress>, camera: &CameraSettings, live: &Live) -> State {
    State {
        rig: RigState {
            phase: if address.is_some() { Phase::Connecting } else { Phase::Absent },
            name: match address {
                Some(RigAddress::Port(port)) => Some(port.clone()),
                Some(RigAddress::Attached) => Some("the board".into()),
                Some(RigAddress::Emulated(_)) => Some("the emulated rig".into()),
                Some(RigAddress::Open(open)) => Some(open.name().into()),
                None => None,
            },
            emulated: address.is_some_and(RigAddress::is_emulated),
            scene: address.and_then(RigAddress::scene),
            error: None,
            info: None,
        },
        job: None,
        computation: None,
        live: LiveState {
            mode: live.mode,
            exposure_us: live.exposure.0,
            light_percent: live.light.unwrap_or_default().percent(),
            measure: live.measure,
            region: None,
            error: None,
            recording: None,
            recording_ended: None,
            camera_alone: address.is_none() && camera.address != CameraAddress::Emulated,
        },
        control: ControlState { holder: None, requested_by: None, clients: 0 },
        question: None,
        questions: 0,
        captures: 0,
        optics: 0,
        log: 0,
    }
}
