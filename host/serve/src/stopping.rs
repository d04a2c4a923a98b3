//! Pending stops: nothing begins until they have reached the board, because a stop must not end later work.

use std::{
    sync::{Arc, Condvar, Mutex, PoisonError, mpsc::channel},
    thread::Builder,
    time::Duration,
};

use farnear_capture::ClientError;
use farnear_workflows::{WorkflowError, rig::open::OpenRig};

use crate::app::lock;

/// Longest wait for the board's answer to a stop.
pub const PATIENCE: Duration = Duration::from_secs(1);

#[derive(Debug, thiserror::Error)]
pub enum StopError {
    #[error(
        "the board has not answered the stop; its keep-alive ends the motion within seconds: check the rig, and use its \
         emergency stop if something moves"
    )]
    Unanswered,
    #[error(transparent)]
    Workflow(#[from] WorkflowError),
}

#[derive(Default)]
pub struct Stops {
    on_the_way: Mutex<usize>,
    arrived: Condvar,
}

/// A requested stop; it has reached the board when this is dropped.
pub struct Stop {
    stops: Arc<Stops>,
    rig: Option<OpenRig>,
}

impl Stops {
    pub fn begin(self: &Arc<Self>, rig: Option<OpenRig>) -> Stop {
        *lock(&self.on_the_way) += 1;
        Stop { stops: Arc::clone(self), rig }
    }

    pub fn wait(&self) {
        let on_the_way = lock(&self.on_the_way);
        drop(self.arrived.wait_while(on_the_way, |count| *count > 0).unwrap_or_else(PoisonError::into_inner));
    }
}

impl Stop {
    /// Sends the stop and waits at most `patience` for the answer. It stays pending until the board answers or all repeats have failed.
    pub fn tell(self, patience: Duration) -> Result<(), StopError> {
        let Some(rig) = self.rig.clone() else { return Ok(()) };
        answered_within(patience, move || {
            let told = rig.stop();
            drop(self);
            told
        })
    }
}

/// Tells the board something in a thread, which is left behind if the answer takes longer than `patience`.
pub fn answered_within(
    patience: Duration,
    tell: impl FnOnce() -> Result<(), WorkflowError> + Send + 'static,
) -> Result<(), StopError> {
    let (sender, answer) = channel();
    let failed = |error: std::io::Error| WorkflowError::Thread { reason: error.to_string() };
    // The receiver may have ended.
    let tell = move || drop(sender.send(tell()));
    Builder::new().name("stop".into()).spawn(tell).map_err(failed)?;
    match answer.recv_timeout(patience) {
        Ok(Err(WorkflowError::Client(ClientError::Silent { .. }))) | Err(_) => Err(StopError::Unanswered),
        Ok(told) => Ok(told?),
    }
}

impl Drop for Stop {
    fn drop(&mut self) {
        *lock(&self.stops.on_the_way) -= 1;
        self.stops.arrived.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use std::{sync::mpsc::channel, thread, time::Duration};

    use super::*;

    #[test]
    fn jobs_wait_for_all_pending_stops() {
        let stops = Arc::new(Stops::default());
        stops.wait();
        let (first, second) = (stops.begin(None), stops.begin(None));
        second.tell(PATIENCE).unwrap();
        let (begun, begins) = channel();
        let waiting = Arc::clone(&stops);
        let thread = thread::spawn(move || {
            waiting.wait();
            begun.send(()).unwrap();
        });
        assert!(begins.recv_timeout(Duration::from_millis(50)).is_err(), "the first has not arrived");
        first.tell(PATIENCE).unwrap();
        begins.recv_timeout(Duration::from_secs(20)).unwrap();
        thread.join().unwrap();
    }
}
