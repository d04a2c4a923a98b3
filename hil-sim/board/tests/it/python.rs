//! `examples/client.py`, written from the protocol document alone, against the simulator.

use std::process::Command;

use crate::pty::Program;

#[test]
#[cfg_attr(not(pyserial), ignore = "needs python3 with pyserial")]
fn a_client_in_python_moves_the_piezo() {
    let program = Program::start(&[]);
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/client.py");
    let mut errors_nm = Vec::new();
    // Twice: the second host continues in the state left by the first.
    for target_nm in ["20000", "176270"] {
        let run = Command::new("python3").args([script, &program.port, target_nm]).output().expect("python3");
        let (out, err) = (String::from_utf8_lossy(&run.stdout), String::from_utf8_lossy(&run.stderr));
        assert!(run.status.success(), "{out}{err}");
        assert!(out.contains("nucleo-f429zi, boot 1, emulated"), "{out}");
        let measured = out.split_whitespace().rev().nth(1).and_then(|text| text.parse::<i32>().ok());
        errors_nm.push(measured.expect("a position") - target_nm.parse::<i32>().expect("a number"));
    }
    // The tolerance of a move plus gauge noise.
    assert!(errors_nm.iter().all(|off_nm| off_nm.abs() <= 60), "{errors_nm:?}");
}
