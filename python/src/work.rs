//! Computation without the interpreter's lock.

use std::{
    any::Any,
    process,
    sync::{
        Arc, LazyLock, Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::Duration,
};

use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::errors::FarnearError;

/// Polling interval for interruptions.
const LOOK: Duration = Duration::from_millis(2);
/// The first interval, which doubles up to [`LOOK`]: short work ends without a wait.
const FIRST_LOOK: Duration = Duration::from_micros(20);

/// The process that imported this module. Its children by `os.fork`, as those of `multiprocessing`, have none of its threads.
static IMPORTED_BY: LazyLock<u32> = LazyLock::new(process::id);

/// The threads of a child process, with its number.
static OF_CHILD: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);

pub fn remember_process() {
    LazyLock::force(&IMPORTED_BY);
}

/// Runs `work` without the interpreter's lock, on threads that this process has.
pub fn run<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    let pool = of_child()?;
    Ok(py.detach(|| in_pool(pool.as_deref(), work)))
}

fn in_pool<T: Send>(pool: Option<&ThreadPool>, work: impl FnOnce() -> T + Send) -> T {
    match pool {
        Some(pool) => pool.install(work),
        None => work(),
    }
}

/// As [`run`], in a thread, while this one polls for Ctrl-C; `work` is to end soon after it has set the flag.
pub fn interruptibly<T: Send>(
    py: Python<'_>,
    work: impl FnOnce(&Arc<AtomicBool>) -> T + Send,
) -> PyResult<T> {
    let pool = of_child()?;
    let stop = Arc::new(AtomicBool::new(false));
    thread::scope(|scope| {
        let worker = scope.spawn(|| in_pool(pool.as_deref(), || work(&stop)));
        let mut interrupted = None;
        while !worker.is_finished() {
            py.detach(|| thread::sleep(LOOK));
            if interrupted.is_none()
                && let Err(error) = py.check_signals()
            {
                stop.store(true, Ordering::Relaxed);
                interrupted = Some(error);
            }
        }
        let done = worker.join().map_err(panicked)?;
        interrupted.map_or(Ok(done), Err)
    })
}

/// As [`run`], for work that cannot be stopped: in a thread that Ctrl-C leaves behind.
pub fn watched<T: Send + 'static>(py: Python<'_>, work: impl FnOnce() -> T + Send + 'static) -> PyResult<T> {
    let pool = of_child()?;
    let worker = thread::spawn(move || in_pool(pool.as_deref(), work));
    let mut pause = FIRST_LOOK;
    while !worker.is_finished() {
        py.detach(|| thread::sleep(pause));
        pause = (pause * 2).min(LOOK);
        py.check_signals()?;
    }
    worker.join().map_err(panicked)
}

fn panicked(_: Box<dyn Any + Send>) -> PyErr {
    FarnearError::new_err("the work ended with a panic, a mistake of farnear's")
}

fn of_child() -> PyResult<Option<Arc<ThreadPool>>> {
    let process = process::id();
    if process == *IMPORTED_BY {
        return Ok(None);
    }
    let mut pool = OF_CHILD.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((of, pool)) = &*pool
        && *of == process
    {
        return Ok(Some(Arc::clone(pool)));
    }
    let built = ThreadPoolBuilder::new().build();
    let built = Arc::new(built.map_err(|error| FarnearError::new_err(error.to_string()))?);
    // A grandchild has the pool of its parent, whose threads it cannot join.
    std::mem::forget(pool.replace((process, Arc::clone(&built))));
    Ok(Some(built))
}
