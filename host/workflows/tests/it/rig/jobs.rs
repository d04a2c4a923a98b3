//! Tasks on a connected rig, and errors before them.

use std::{thread, time::Duration};

use farnear_protocol::message::{Axis, Routine, SettingKey};
use farnear_scripted_board::{Faults, plug_in};
use farnear_workflows::{
    Context, WorkflowError,
    request::Request,
    rig::{
        AxisName, RigAddress, alarms, board,
        log::{self, LogSettings},
        mechanics::{self, MechanicsFigures},
        motion::{self, MoveFigures, MoveRequest},
        pair::{self, CaptureRequest},
        settings,
    },
};

use super::{Face, camera, optics};

#[test]
fn moves_home_first_where_asked_to_and_say_so() {
    let (port, _board) = plug_in(Faults::default());
    let face = Face::default();
    let (axis, to_um) = (vec![AxisName::Coarse, AxisName::Lens], vec![5_000.0, 2_000.0]);
    let request = MoveRequest { rig: RigAddress::Port(port), axis, to_um, home: true };
    let moved = request.run(&face.context()).unwrap();
    let MoveFigures::All { moved } = moved else { panic!("{moved:?}") };
    assert_eq!((moved[0].axis, moved[0].measured_um), ("coarse", 5_000.375));
    assert_eq!((moved[1].axis, moved[1].measured_um), ("lens", 2_000.125));
    assert!(face.heard("homing the lens stage (its position is unknown)"));
    assert!(face.heard("they speak the same protocol"), "the scripted board's firmware is another one");
}

#[test]
fn impossible_requests_are_rejected_before_the_port_is_opened() {
    let rig = RigAddress::Port("/dev/farnear-no-such-port".into());
    let context = Context::unattended();
    let lens = vec![AxisName::Lens];
    for (axis, to_um, phrase) in [
        (lens.clone(), vec![f64::NAN], "to-um NaN"),
        (lens.clone(), vec![1.0, 2.5], "to-um 1, 2.5: expected 1 positions"),
        (lens.repeat(2), vec![1.0, 2.0], "axis lens: expected each axis once"),
        (vec![], vec![], "to-um"),
    ] {
        let request = MoveRequest { rig: rig.clone(), axis, to_um, home: false };
        let error = request.run(&context).unwrap_err();
        assert!(error.is_usage() && error.to_string().starts_with(phrase), "{error}");
    }
    let error = settings::key("speed").unwrap_err();
    assert!(error.is_usage() && error.to_string().contains("datum_nm"), "{error}");
    let error = settings::get(&rig, SettingKey::DatumNm, &context).unwrap_err();
    assert!(matches!(error, WorkflowError::Client(_)), "{error}");
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let camera = camera(&folder.path().join("absent"));
    let error =
        pair::capture(&CaptureRequest { rig, camera, optics: optics(), out, ..Default::default() }, &context)
            .unwrap_err();
    assert!(matches!(error, WorkflowError::Camera(_)), "{error}");
    assert_eq!(folder.path().read_dir().unwrap().count(), 0);
}

#[test]
fn the_board_is_asked_and_told() {
    let (port, _board) = plug_in(Faults::default());
    let (rig, face) = (RigAddress::Port(port), Face::default());
    let context = face.context();
    assert_eq!(settings::list(&rig, &context).unwrap().settings.len(), SettingKey::ALL.len());
    let set = settings::set(&rig, SettingKey::CoarseBacklashNm, 4_000, &context).unwrap();
    assert_eq!((set.key, set.value, set.default), ("coarse_backlash_nm", 4_000, 1_000));
    let measured = mechanics::measure(&rig, Routine::Backlash { axis: Axis::Lens }, &context).unwrap();
    let expected = MechanicsFigures::Backlash { axis: "lens", backlash_um: 4.0, spread_um: 0.25 };
    assert_eq!(measured, expected);
    motion::halt(&rig, &context).unwrap();
    assert_eq!(alarms::alarms(&rig, None, &context).unwrap().latched, 1);
    assert_eq!(alarms::alarms(&rig, Some(1), &context).unwrap().latched, 0);
    assert!(face.heard("alarm 1 is cleared"));
    let reset = board::reset(&rig, &context).unwrap();
    assert_eq!((reset.boot_before, reset.boot), (7, 8));
    assert_eq!(board::counters(&rig, &context).unwrap().homings, 2);
}

#[test]
fn a_log_without_its_texts_is_given_as_bytes_until_it_is_cancelled() {
    let (port, board) = plug_in(Faults::default());
    // The scripted board's line answers on request, like an emulated board's time.
    board.board().hello.emulated = true;
    let face = Face::default();
    let context = face.context();
    let settings = LogSettings { rig: RigAddress::Port(port), elf: None, seconds: None, reset: false };
    let cancel = context.cancel.clone();
    let teller = thread::spawn(move || {
        while !cancel.is_cancelled() {
            board.board().log(&[0xab, 1]);
            thread::sleep(Duration::from_millis(20));
        }
    });
    let mut lines = Vec::new();
    let mut sink = |line: &str| -> std::io::Result<()> {
        lines.push(line.to_owned());
        context.cancel.cancel();
        Ok(())
    };
    let count = log::follow(&settings, &mut sink, &context).unwrap();
    teller.join().unwrap();
    assert_eq!((count, lines), (1, vec!["ab01".to_owned()]));
    assert!(face.heard("1 lines"));
}

#[test]
fn a_stop_and_a_halt_leave_the_link_rate_alone() {
    let (port, board) = plug_in(Faults { busy: true, ..Faults::default() });
    let (rig, context) = (RigAddress::Port(format!("{port}@921600")), Context::unattended());
    motion::stop(&rig, &context).unwrap();
    motion::halt(&rig, &context).unwrap();
    let board = board.board();
    assert_eq!((board.stops, board.halts, board.rate_requests), (1, 1, 0));
}
