use std::{
    net::SocketAddr,
    path::PathBuf,
    sync::Arc,
    thread::JoinHandle,
    time::{Duration, Instant},
};

use farnear_workflows::{
    Cancel, Context, WorkflowError,
    rig::{RigAddress, camera::CameraSettings},
};

use crate::{
    app::App,
    connections::{LimitedListener, Limits, Peer},
    guard::{Guard, Listen},
    job_queue, rig_watch, routes, session_lock,
    stopping::StopError,
};

const LOOK: Duration = Duration::from_millis(50);
/// Longest wait for running requests, and then for threads, at the end.
const FAREWELL: Duration = Duration::from_millis(300);
/// Longest wait for the board's answer to the last stop.
const LAST_STOP: Duration = Duration::from_millis(500);

#[derive(Debug)]
pub struct ServeSettings {
    /// Without a rig the page shows captures.
    pub rig: Option<RigAddress>,
    pub camera: CameraSettings,
    pub session: PathBuf,
    /// Optics to begin with; by default those of the session, or of the 50 mm lens.
    pub optics: Option<PathBuf>,
    pub listen: Listen,
    pub limits: Limits,
}

#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    #[error("cannot listen at {address}: {source}")]
    Listen { address: SocketAddr, source: std::io::Error },
    #[error("cannot serve: {source}")]
    System {
        #[from]
        source: std::io::Error,
    },
    #[error(
        "the session {} is in use by another farnear serve: end that one, or name another folder with --session",
        session.display()
    )]
    InUse { session: PathBuf },
    /// At the end.
    #[error(transparent)]
    Stop(#[from] StopError),
    #[error(transparent)]
    Workflow(#[from] WorkflowError),
}

/// Serves until `context` is cancelled, which stops motion. `ready` receives the address; the rig is connected later.
pub fn serve(
    settings: ServeSettings,
    context: &Context<'_>,
    ready: impl FnOnce(&str),
) -> Result<(), ServeError> {
    let address = settings.listen.address();
    let runtime = tokio::runtime::Builder::new_current_thread().enable_io().enable_time().build()?;
    let failed = |source| ServeError::Listen { address, source };
    let listener = runtime.block_on(tokio::net::TcpListener::bind(address)).map_err(failed)?;
    let bound = listener.local_addr()?;
    let guard = Guard::new(&settings.listen, bound.port());
    let _lock = session_lock::lock(&settings.session)?;
    let app = App::new(settings, guard)?;
    let workers = job_queue::start(&app)?;
    let watch = rig_watch::start(&app)?;
    let service = routes::service(&app).into_make_service_with_connect_info::<Peer>();
    ready(&format!("http://{bound}/"));
    let ending = ended(context.cancel.clone(), Arc::clone(&app));
    let served = runtime.block_on(async {
        let listener = LimitedListener::new(listener, Arc::clone(&app));
        let server = axum::serve(listener, service).with_graceful_shutdown(ending).into_future();
        let patience = async {
            app.ended().await;
            tokio::time::sleep(FAREWELL).await;
        };
        tokio::select! {
            served = server => served,
            () = patience => Ok(()), // a browser that does not let go of its connection
        }
    });
    let stopped = app.stop_everything(LAST_STOP);
    if matches!(stopped, Err(StopError::Unanswered)) || !ends_soon(&watch) {
        // What waits for a silent board is left behind, also the line, whose end would wait for its thread.
        app.finish_recording();
        std::mem::forget(app);
        runtime.shutdown_background();
        served?;
        return Ok(stopped?);
    }
    workers.into_iter().for_each(|thread| drop(thread.join())); // a job that panicked has said so on stderr
    runtime.shutdown_timeout(FAREWELL);
    Ok(served?)
}

/// Whether the thread ends before [`FAREWELL`] is over.
fn ends_soon(thread: &JoinHandle<()>) -> bool {
    let until = Instant::now() + FAREWELL;
    while !thread.is_finished() && Instant::now() < until {
        std::thread::sleep(Duration::from_millis(5));
    }
    thread.is_finished()
}

async fn ended(cancel: Cancel, app: Arc<App>) {
    while !cancel.is_cancelled() {
        tokio::time::sleep(LOOK).await;
    }
    app.end();
}
