//! Reuse of processors and the calls that they receive.

use std::sync::Arc;

use rigless::{
    emulator::{CoreBus, DataModel, Exit},
    soc::{Endian, Width},
};

use super::*;

/// Records its calls. Its state is the number that it was reset or loaded with.
#[derive(Debug)]
struct Noting {
    state: u8,
    notes: Arc<Mutex<Vec<String>>>,
}

impl Noting {
    fn note(&self, what: &str) {
        self.notes.lock().expect("not poisoned").push(what.into());
    }
}

impl Processor for Noting {
    fn run(&mut self, _: u32, _: &mut dyn CoreBus) -> (Exit, u64) {
        (Exit::Budget, 0)
    }

    fn retired(&self) -> u64 {
        u64::from(self.state / 100)
    }

    fn ask(&mut self, queued: Queued) {
        self.note(&format!("{queued:?}"));
    }

    fn boot(&mut self, _: u64, _: &dyn Fn(u64, Width) -> Option<u64>) {}

    fn reset(&mut self) {
        self.note("reset");
        self.state += 1;
    }

    fn waiting(&self) -> bool {
        false
    }

    fn pc(&self) -> u64 {
        u64::from(self.state)
    }

    fn data_model(&self) -> DataModel {
        unreachable!("not used here")
    }

    fn byte_order(&self, _: u64) -> Endian {
        Endian::Little
    }

    fn save(&self) -> Vec<u8> {
        vec![self.state]
    }

    fn load(&mut self, bytes: &[u8]) -> Result<(), Error> {
        self.state = *bytes.first().ok_or(Error::State)?;
        Ok(())
    }
}

/// Also returns the calls of all processors made for the program.
fn rig(program: u64) -> (Translated, Arc<Mutex<Vec<String>>>) {
    let notes: Arc<Mutex<Vec<String>>> = Arc::default();
    let of_each = Arc::clone(&notes);
    let make = move || {
        of_each.lock().expect("not poisoned").push("made".into());
        Ok(Box::new(Noting { state: 7, notes: Arc::clone(&of_each) }) as Box<dyn Processor>)
    };
    (Translated::new(program, make).expect("it is made"), notes)
}

fn taken(notes: &Arc<Mutex<Vec<String>>>) -> Vec<String> {
    std::mem::take(&mut notes.lock().expect("not poisoned"))
}

#[test]
fn reuses_the_processor_for_the_next_rig_with_the_same_program() {
    let (mut first, notes) = rig(1);
    first.load(&[142]).expect("a state");
    first.ask(Queued::Route(0x4000));
    assert_eq!(taken(&notes), ["made", "made", "Route(16384)"]);
    drop(first);
    let calls = taken(&notes);
    assert_eq!(calls[0], "Unroute(16384)");
    assert_eq!(calls.len(), 1 + RAM.len(), "translations of RAM are dropped: {calls:?}");

    let (other, others) = rig(2);
    assert_eq!((other.pc(), taken(&others).len()), (7, 2), "another program has its own");
    let (mut second, more) = rig(1);
    assert_eq!((second.pc(), taken(&more).len()), (7, 1), "only a twin is made");
    second.altered();
    drop(second);
    assert_eq!(taken(&notes), Vec::<String>::new());
    let (_third, more) = rig(1);
    assert_eq!(taken(&more).len(), 2, "what a debugger has changed is not kept");
}

#[test]
fn computes_a_reset_on_the_twin() {
    let (mut rig, notes) = rig(3);
    rig.load(&[50]).expect("a state");
    taken(&notes);
    rig.reset();
    assert_eq!((rig.pc(), taken(&notes)), (51, vec!["reset".to_string()]));
    assert_eq!(rig.twin.as_ref().map(|twin| twin.pc()), Some(51));
    rig.twin = None;
    rig.reset();
    assert_eq!((rig.pc(), taken(&notes).len()), (52, 1), "without one the processor itself");
}

#[test]
fn loading_the_same_program_keeps_translations_and_later_writes_drop_them() {
    let (mut rig, notes) = rig(4);
    taken(&notes);
    rig.ask(Queued::Invalidate(0x0800_0000, 0x0810_0000));
    assert_eq!(taken(&notes), Vec::<String>::new());
    rig.ask(Queued::Invalidate(RAM[0].0, RAM[0].0 + 8));
    rig.load(&[100]).expect("a state in which something has run");
    rig.ask(Queued::Invalidate(0x0800_0000, 0x0810_0000));
    assert_eq!(taken(&notes).len(), 2);
}
