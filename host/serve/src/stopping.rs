//! Pending stops: nothing begins until they have reached the board, because a stop must not end later work.

use std::sync::{Arc, Condvar, Mutex, PoisonError};

use farnear_workflows::{WorkflowError, rig::open::OpenRig};

use crate::app::lock;

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
    pub fn tell(self) -> Result<(), WorkflowError> {
        self.rig.as_ref().map_or(Ok(()), OpenRig::stop)
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
        second.tell().unwrap();
        let (begun, begins) = channel();
        let waiting = Arc::clone(&stops);
        let thread = thread::spawn(move || {
            waiting.wait();
            begun.send(()).unwrap();
        });
        assert!(begins.recv_timeout(Duration::from_millis(50)).is_err(), "the first has not arrived");
        first.tell().unwrap();
        begins.recv_timeout(Duration::from_secs(20)).unwrap();
        thread.join().unwrap();
    }
}
