//! Two job queues of length one, rig and computations. A busy one rejects jobs: nothing moves later than expected.

use std::{
    io,
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{
        Arc, Mutex,
        mpsc::{Receiver, RecvTimeoutError, Sender, channel},
    },
    thread::{Builder, JoinHandle},
    time::Duration,
};

use farnear_workflows::{Cancel, Context, WorkflowError};
use serde::Serialize;
use serde_json::Value;

use crate::{
    app::{App, lock},
    face::Face,
    failure, live,
    routes::rig::figures,
    view::{Job, JobPhase, LiveMode, State},
};

/// Poll interval for the end of the program.
const LOOK: Duration = Duration::from_millis(100);
const PANIC: &str = "the live view ended with a panic, a mistake of farnear's; begin it again, and report the message on stderr";

pub type Work = Box<dyn FnOnce(&App, &Context<'_>) -> Result<Value, WorkflowError> + Send>;

pub struct Task {
    /// `home`, `move`, `pair`, ...
    pub kind: &'static str,
    pub title: String,
    pub work: Work,
}

impl Task {
    /// The job's result are the figures that `work` returns.
    pub fn new<F: Serialize>(
        kind: &'static str,
        title: impl Into<String>,
        work: impl FnOnce(&App, &Context<'_>) -> Result<F, WorkflowError> + Send + 'static,
    ) -> Self {
        let work = move |app: &App, context: &Context<'_>| figures(work(app, context)?);
        Self { kind, title: title.into(), work: Box::new(work) }
    }
}

#[derive(Default)]
pub struct JobQueue {
    inner: Mutex<Inner>,
}

#[derive(Default)]
struct Inner {
    sender: Option<Sender<Begun>>,
    running: Option<Running>,
    last: u64,
}

struct Running {
    title: String,
    cancel: Cancel,
    /// Why it was cancelled, if not by a user.
    reason: Option<String>,
}

pub struct Begun {
    job: Job,
    cancel: Cancel,
    work: Work,
}

impl JobQueue {
    /// Begins a job and returns its number; the error is the title of the running job.
    pub fn begin(&self, task: Task, told: impl FnOnce(Job)) -> Result<u64, String> {
        let mut inner = lock(&self.inner);
        if let Some(Running { title, .. }) = &inner.running {
            return Err(title.clone());
        }
        inner.last += 1;
        let job = Job {
            id: inner.last,
            kind: task.kind.into(),
            title: task.title.clone(),
            phase: JobPhase::Running,
            said: None,
            warnings: Vec::new(),
            progress: None,
            result: None,
            error: None,
            hint: None,
        };
        let cancel = Cancel::default();
        let begun = Begun { job: job.clone(), cancel: cancel.clone(), work: task.work };
        told(job.clone()); // before the thread can say anything about it
        let sent = inner.sender.as_ref().is_some_and(|sender| sender.send(begun).is_ok());
        if !sent {
            return Err("the program ends".into());
        }
        inner.running = Some(Running { title: task.title, cancel, reason: None });
        Ok(job.id)
    }

    /// Cancels the running job, which reports the reason.
    pub fn cancel(&self, reason: Option<&str>) {
        if let Some(running) = &mut lock(&self.inner).running {
            running.reason = reason.map(str::to_owned).or(running.reason.take());
            running.cancel.cancel();
        }
    }

    fn reason(&self) -> Option<String> {
        lock(&self.inner).running.as_ref()?.reason.clone()
    }

    pub fn is_busy(&self) -> bool {
        lock(&self.inner).running.is_some()
    }

    fn open(&self) -> Receiver<Begun> {
        let (sender, receiver) = channel();
        lock(&self.inner).sender = Some(sender);
        receiver
    }

    /// Ends the job. `publish` ends before another job can begin.
    fn free(&self, publish: impl FnOnce()) {
        let mut inner = lock(&self.inner);
        inner.running = None;
        publish();
    }
}

pub fn start(app: &Arc<App>) -> io::Result<[JoinHandle<()>; 2]> {
    let (on_rig, computing) = (app.rig_jobs.open(), app.computing.open());
    let (rig, computer) = (Arc::clone(app), Arc::clone(app));
    Ok([
        Builder::new().name("rig jobs".into()).spawn(move || run_rig(&rig, &on_rig, live::look))?,
        Builder::new().name("computing".into()).spawn(move || run_computing(&computer, &computing))?,
    ])
}

/// Runs jobs on the rig, and live views (`look`) between them.
fn run_rig(app: &App, jobs: &Receiver<Begun>, look: fn(&App)) {
    loop {
        let seen = app.live().mode != LiveMode::Off
            && !app.is_to_connect()
            && (app.rig().is_some() || app.has_camera_alone())
            && app.state().control.clients > 0;
        let begun = if seen && !app.is_ending() {
            match jobs.try_recv() {
                Ok(begun) => Some(begun),
                Err(_) => {
                    // This thread also runs the jobs.
                    if catch_unwind(AssertUnwindSafe(|| look(app))).is_err() {
                        live::fail(app, PANIC);
                    }
                    None
                }
            }
        } else {
            match jobs.recv_timeout(LOOK) {
                Ok(begun) => Some(begun),
                Err(RecvTimeoutError::Timeout) if !app.is_ending() => None,
                Err(_) => return,
            }
        };
        if let Some(begun) = begun {
            app.stops.wait();
            run(app, begun, &app.rig_jobs, |state| &mut state.job);
        }
    }
}

fn run_computing(app: &App, jobs: &Receiver<Begun>) {
    loop {
        match jobs.recv_timeout(LOOK) {
            Ok(begun) => run(app, begun, &app.computing, |state| &mut state.computation),
            Err(RecvTimeoutError::Timeout) if !app.is_ending() => {}
            Err(_) => return,
        }
    }
}

/// Selects the job of a queue in the state.
pub type Place = fn(&mut State) -> &mut Option<Job>;

fn run(app: &App, begun: Begun, queue: &JobQueue, place: Place) {
    let Begun { job, cancel, work } = begun;
    app.note(job.title.clone());
    let face = Face { app, place, counted: Mutex::default() };
    let context = Context::new(&face, &face, cancel);
    let ended = catch_unwind(AssertUnwindSafe(|| work(app, &context))).unwrap_or_else(|_| {
        Err(WorkflowError::Library("it ended with a panic, a mistake of farnear's".into()))
    });
    // The board may report the stop before the work notices the cancellation.
    let stopped = |error: &WorkflowError| error.is_cancelled() || context.cancel.is_cancelled();
    let reason = ended.as_ref().err().filter(|error| stopped(error)).and_then(|_| queue.reason());
    if let Err(error) = &ended {
        app.note(format!("{}: {error}", job.title));
    }
    let publish = |state: &mut State| {
        let Some(job) = place(state) else { return };
        match ended {
            Ok(result) => {
                job.phase = JobPhase::Done;
                job.result = Some(result);
            }
            Err(error) => {
                job.phase = if stopped(&error) { JobPhase::Stopped } else { JobPhase::Failed };
                job.hint = failure::hint(&error).map(Into::into);
                job.error = Some(reason.unwrap_or_else(|| error.to_string()));
            }
        }
    };
    queue.free(|| app.change(publish));
}

#[cfg(test)]
mod tests {
    use std::{
        sync::atomic::{AtomicBool, Ordering},
        time::Instant,
    };

    use super::*;
    use crate::live::tests::app;

    fn wait_for(app: &App, fits: impl Fn(&State) -> bool) {
        let until = Instant::now() + Duration::from_secs(60);
        while !fits(&app.state()) {
            assert!(Instant::now() < until, "{:#?}", app.state());
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    fn panics(_: &App) {
        panic!("of the test's live view");
    }

    #[test]
    fn jobs_run_after_a_live_view_has_panicked() {
        let folder = tempfile::tempdir().expect("a folder");
        let app = app(folder.path());
        let _client = app.with_control(|control| control.join(None));
        let jobs = app.rig_jobs.open();
        let rig = Arc::clone(&app);
        let thread = std::thread::spawn(move || run_rig(&rig, &jobs, panics));
        wait_for(&app, |state| state.live.error.as_ref().is_some_and(|error| error.contains("panic")));
        assert_eq!(app.state().live.mode, LiveMode::Off);
        let begun = app.begin_on_rig(Task::new("home", "Home", |_, _| Ok(())));
        assert_eq!(begun, Ok(1));
        wait_for(&app, |state| state.job.as_ref().is_some_and(|job| job.phase == JobPhase::Done));
        app.end();
        thread.join().expect("the thread ends with the program");
    }

    #[test]
    fn the_reason_of_a_stop_is_not_that_of_a_cancelled_computation() {
        let folder = tempfile::tempdir().expect("a folder");
        let app = app(folder.path());
        drop(app.begin_stop_because("the browser has disconnected"));
        let jobs = app.computing.open();
        let computer = Arc::clone(&app);
        let thread = std::thread::spawn(move || run_computing(&computer, &jobs));
        let task = Task::new("depth", "Depth", |_, context| -> Result<(), WorkflowError> {
            while !context.cancel.is_cancelled() {
                std::thread::sleep(Duration::from_millis(1));
            }
            Err(WorkflowError::Cancelled { during: "depth".into() })
        });
        assert_eq!(app.begin_computing(task), Ok(1));
        app.computing.cancel(None);
        let ended =
            |state: &State| state.computation.as_ref().is_some_and(|job| job.phase == JobPhase::Stopped);
        wait_for(&app, ended);
        let error = app.state().computation.and_then(|job| job.error);
        assert_eq!(error, Some(WorkflowError::Cancelled { during: "depth".into() }.to_string()));
        app.end();
        thread.join().expect("the thread ends with the program");
    }

    #[test]
    fn a_queue_is_busy_until_the_result_of_its_job_is_published() {
        let folder = tempfile::tempdir().expect("a folder");
        let app = app(folder.path());
        let jobs = app.computing.open();
        let computer = Arc::clone(&app);
        let thread = std::thread::spawn(move || run_computing(&computer, &jobs));
        let (begins, begun) = channel();
        let (end, may_end) = channel::<()>();
        let task = Task::new("depth", "Depth", move |_, _| {
            let _ = begins.send(());
            let _ = may_end.recv();
            Ok(())
        });
        assert_eq!(app.begin_computing(task), Ok(1));
        begun.recv().expect("the job runs");
        let (free, mut freed_early) = (AtomicBool::new(false), false);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                while app.computing.is_busy() {
                    std::thread::sleep(Duration::from_millis(1));
                }
                free.store(true, Ordering::Relaxed);
            });
            // The result cannot be published while the state is locked here.
            app.change(|_| {
                end.send(()).expect("the job waits");
                std::thread::sleep(Duration::from_millis(300));
                freed_early = free.load(Ordering::Relaxed);
            });
        });
        assert!(!freed_early, "the next job can begin before the result of this one is published");
        let ended = app.state().computation.map(|job| job.phase);
        assert_eq!(ended, Some(JobPhase::Done));
        app.end();
        thread.join().expect("the thread ends with the program");
    }
}
