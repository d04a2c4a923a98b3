//! The client on a bad line.

use std::{collections::VecDeque, time::Duration};

use farnear_capture::{Client, ClientError, Timing, Transport};
use farnear_protocol::{
    Response,
    message::{Axis, Status},
    units::Nanometres,
};
use farnear_scripted_board::{Faults, Peer};
use proptest::prelude::*;

use crate::scripted::{SHORT, SHOT, connect, run_shots};

#[test]
fn repeats_lost_requests_and_acts_once() {
    let (client, peer) = connect(Faults::default());
    peer.board().faults.lose_requests = 2;
    client.home(Axis::SensorCoarse).unwrap();
    peer.board().faults.lose_answers = 3;
    client.home(Axis::SensorCoarse).unwrap();
    assert_eq!(peer.board().acts, 2);
}

#[test]
fn a_silent_board_is_an_error_after_three_retries() {
    let (client, peer) = connect(Faults::default());
    peer.board().faults.lose_requests = 100;
    let error = client.status().err().unwrap();
    assert!(matches!(error, ClientError::Silent { attempts: 4, bytes: 0, .. }), "{error:?}");
    assert_eq!(peer.board().faults.lose_requests, 96);
}

#[test]
fn duplicate_answers_do_not_answer_the_next_request() {
    let (client, _) = connect(Faults { duplicate_answers: true, ..Faults::default() });
    client.home(Axis::SensorCoarse).unwrap();
    for target in [1_000, 2_000, 3_000] {
        client.move_to(Axis::SensorFine, Nanometres(target)).unwrap();
        let Status { fine, .. } = client.status().unwrap();
        assert_eq!(fine.measured.0, target - 2);
    }
}

#[test]
fn ignores_stale_frames_of_an_earlier_program() {
    let peer = Peer::new(Faults::default());
    // Hello and status of this session have the ids 1 and 2, as in the last one.
    let mut stale = peer.board().hello.clone();
    stale.boot = 3;
    peer.board().put_stale(1, &Response::Hello(stale));
    peer.board().put_stale(2, &Response::Accepted);
    let client = Client::connect(peer.connect(), "scripted").unwrap();
    assert_eq!(client.hello().boot, 7);
}

#[test]
fn hello_is_not_answered_by_a_late_answer_to_an_ended_program() {
    /// The answer to the first session of the board's boot arrives with the first answer to this program.
    struct Late {
        line: Box<dyn Transport>,
        peer: Peer,
        arrived: bool,
    }
    impl Transport for Late {
        fn receive(&mut self, buffer: &mut [u8], wait: Duration) -> std::io::Result<usize> {
            self.line.receive(buffer, wait)
        }
        fn send(&mut self, bytes: &[u8], wait: Duration) -> std::io::Result<()> {
            if !std::mem::replace(&mut self.arrived, true) {
                self.peer.board().put_stale(1, &Response::Accepted);
            }
            self.line.send(bytes, wait)
        }
        fn discard_input(&mut self) -> std::io::Result<()> {
            self.line.discard_input()
        }
    }
    let peer = Peer::new(Faults::default());
    let mut connect = peer.connect();
    let late = move || {
        Ok(Box::new(Late { line: connect()?, peer: peer.clone(), arrived: false }) as Box<dyn Transport>)
    };
    let client = Client::connect(Box::new(late), "scripted").unwrap();
    assert_eq!(client.hello().boot, 7);
}

#[test]
fn an_answer_received_during_a_delay_is_not_requested_again() {
    /// Delivers one frame per read; each answer comes last, after an event.
    struct Late {
        line: Box<dyn Transport>,
        peer: Peer,
        unread: VecDeque<u8>,
        asked: bool,
    }
    impl Transport for Late {
        fn receive(&mut self, buffer: &mut [u8], wait: Duration) -> std::io::Result<usize> {
            if std::mem::take(&mut self.asked) {
                std::thread::sleep(wait);
            }
            if self.unread.is_empty() {
                let count = self.line.receive(buffer, wait)?;
                self.unread.extend(&buffer[..count]);
            }
            let frame = self.unread.iter().position(|byte| *byte == 0).map_or(self.unread.len(), |at| at + 1);
            self.unread.drain(..frame).zip(buffer).for_each(|(byte, slot)| *slot = byte);
            Ok(frame)
        }
        fn send(&mut self, bytes: &[u8], wait: Duration) -> std::io::Result<()> {
            self.asked = true;
            self.peer.board().log(b"busy");
            self.line.send(bytes, wait)
        }
        fn discard_input(&mut self) -> std::io::Result<()> {
            self.line.discard_input()
        }
    }
    let peer = Peer::new(Faults::default());
    let mut connect = peer.connect();
    let late = move || {
        let (line, unread) = (connect()?, VecDeque::new());
        Ok(Box::new(Late { line, peer: peer.clone(), unread, asked: false }) as Box<dyn Transport>)
    };
    let client = Client::connect(Box::new(late), "scripted").unwrap();
    client.set_timing(Timing { retries: 0, ..SHORT });
    client.status().unwrap();
}

#[test]
fn names_a_line_that_breaks_during_a_program() {
    let (client, _) = connect(Faults { gone_at_program: true, ..Faults::default() });
    let shot = SHOT;
    let error = run_shots(&client, &[shot], |_| Ok::<(), ClientError>(())).err().unwrap();
    assert!(matches!(error, ClientError::Gone { .. }), "{error:?}");
    assert!(error.to_string().starts_with("port scripted went away while running the exposure"), "{error}");
}

#[test]
fn distinguishes_a_noisy_line_from_a_dead_one() {
    struct Noise;
    impl Transport for Noise {
        fn receive(&mut self, buffer: &mut [u8], wait: Duration) -> std::io::Result<usize> {
            std::thread::sleep(wait.min(Duration::from_millis(20)));
            buffer[..5].copy_from_slice(b"ab\0cd");
            Ok(5)
        }
        fn send(&mut self, _: &[u8], _: Duration) -> std::io::Result<()> {
            Ok(())
        }
        fn discard_input(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }
    let error =
        Client::connect(Box::new(|| Ok(Box::new(Noise) as Box<dyn Transport>)), "scripted").err().unwrap();
    assert!(matches!(error, ClientError::Silent { bad_frames: 1.., .. }), "{error:?}");
    assert!(error.to_string().contains("broken frames came: is it the right port"), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    /// Garbage with a final delimiter costs nothing; otherwise the next frame is lost and repeated.
    #[test]
    fn survives_garbage_on_the_line(garbage in proptest::collection::vec(any::<u8>(), 0..600)) {
        let mut delimited = garbage;
        delimited.push(0);
        let (client, peer) = connect(Faults { garbage: delimited, ..Faults::default() });
        client.home(Axis::SensorCoarse).unwrap();
        for step in 0..5 {
            client.move_to(Axis::SensorFine, Nanometres(step)).unwrap();
        }
        prop_assert_eq!(peer.board().acts, 6);
    }
}

#[cfg(target_os = "linux")]
#[test]
fn recovers_when_another_program_changes_the_ports_settings() {
    let (port, board) = farnear_scripted_board::plug_in(Faults::default());
    let client = farnear_capture::Client::open(&port).unwrap();
    client.status().unwrap();
    // Echo and line editing of a login shell: frames have no line ends.
    let set = std::process::Command::new("stty").args(["-F", &port, "sane"]).status().unwrap();
    assert!(set.success());
    client.status().unwrap();
    client.status().unwrap();
    assert_eq!(board.board().acts, 0);
}
