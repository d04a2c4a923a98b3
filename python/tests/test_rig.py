"""The emulated rig as a fixture: what a test of one's own measuring program looks like. Also the rig's client itself."""

import os
import signal
import socket
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import farnear


def test_a_stage_goes_where_it_is_sent(emulated_rig):
    with pytest.raises(farnear.RigError, match="not homed|home"):
        emulated_rig.move(coarse=5800)
    reached = emulated_rig.move(home=True, coarse=5800, fine=50)
    # Half a step of the screw; the window of the piezo.
    assert reached["coarse"] == pytest.approx(5800, abs=0.6)
    assert reached["fine"] == pytest.approx(50, abs=0.1)
    assert emulated_rig.status()["coarse"]["state"] == "homed"
    with pytest.raises(farnear.RigError, match="limit|range|outside"):
        emulated_rig.move(fine=1000)
    with pytest.raises(farnear.FarnearError, match="coarse, fine or lens"):
        emulated_rig.move(focus=1)


@pytest.mark.emulated_rig(scene="plane:910", seed=2)
def test_a_pair_gives_the_scenes_depth(emulated_rig, optics):
    far, near = emulated_rig.capture_pair(optics)
    assert far.record["sensor_mm"] == pytest.approx(optics.sensor_far_mm, abs=2e-3)
    found = farnear.depth(far.image, near.image, optics)
    # docs/accuracy.md: 0.7 mm for planes at 8 bit, over many pixels.
    assert np.nanmedian(found.depth_mm) == pytest.approx(910, abs=1)


@pytest.mark.emulated_rig(noise="12bit", seed=2)
class TestMarkers:
    @pytest.mark.emulated_rig(scene="plane:910")
    def test_a_tests_marker_adds_to_that_of_its_class(self, emulated_rig):
        emulated_rig.home()
        assert [exposure.bits for exposure in emulated_rig.expose([("fine", 50)])] == [12]


def test_a_marker_without_names_is_refused(tmp_path):
    file = tmp_path / "test_it.py"
    file.write_text(
        "import pytest\nfrom farnear.pytest_plugin import emulated_rig\n"
        "@pytest.mark.emulated_rig('plane:910')\ndef test_it(emulated_rig): pass\n"
    )
    run = subprocess.run([sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(file)], capture_output=True, text=True)
    assert run.returncode == 1 and "scene='plane:910'" in run.stdout, run.stdout


def test_a_sequence_of_micro_manager_goes_through_the_focus(emulated_rig):
    useq = pytest.importorskip("useq")
    emulated_rig.home()
    sequence = useq.MDASequence(z_plan={"bottom": 20, "top": 60, "step": 20}, time_plan={"interval": 0, "loops": 2})
    taken = list(emulated_rig.run_sequence(sequence))
    assert [exposure.record["asked_um"] for exposure in taken] == [20, 40, 60] * 2
    assert all(abs(exposure.record["measured_um"] - exposure.record["asked_um"]) < 0.1 for exposure in taken)
    assert [exposure.index["z"] for exposure in taken] == [0, 1, 2] * 2
    begins = [exposure.record["strobe_start_us"] for exposure in taken]
    assert begins == sorted(begins) and len(set(begins)) == 6


def test_a_time_lapse_keeps_its_interval(emulated_rig):
    useq = pytest.importorskip("useq")
    begin = time.monotonic()
    lapse = useq.MDASequence(z_plan={"bottom": 20, "top": 40, "step": 20}, time_plan={"interval": 1, "loops": 2})
    assert len(list(emulated_rig.run_sequence(lapse))) == 4
    assert time.monotonic() - begin >= 1


def test_channels_are_the_light_of_the_board(emulated_rig):
    useq = pytest.importorskip("useq")
    emulated_rig.home()
    events = [useq.MDAEvent(z_pos=50, channel=name) for name in ("dark", "lit", "dark")]
    taken = list(emulated_rig.run_sequence(events, channels={"dark": (0, 0), "lit": (50, 0)}))
    first, lit, last = (exposure.image.mean() for exposure in taken)
    # The emulated lamp is as bright as the room: 1.5, less saturation.
    assert 1.3 < lit / first < 1.55 and last == pytest.approx(first, rel=0.01)


def test_an_ambient_image_needs_light(emulated_rig, optics):
    with pytest.raises(farnear.FarnearError, match="light"):
        emulated_rig.capture_pair(optics, subtract_ambient=True)
    with pytest.raises(farnear.FarnearError, match="130"):
        emulated_rig.capture_pair(optics, light=(130, 0))


def test_a_pair_is_exposed_for_80_percent_of_white_and_averaged(emulated_rig, optics):
    far, near = emulated_rig.capture_pair(optics, exposure_ms=0.5, auto_exposure=True, average=2)
    assert far.image.dtype == near.image.dtype
    assert np.percentile(far.image, 99.9) == pytest.approx(0.8 * np.iinfo(far.image.dtype).max, rel=0.1)
    with pytest.raises(farnear.FarnearError, match="average = 0: expected 1 to 256"):
        emulated_rig.capture_pair(optics, average=0)


def test_refuses_events_that_the_rig_cannot_do(emulated_rig):
    useq = pytest.importorskip("useq")
    for event, what in [
        (useq.MDAEvent(z_pos=50, channel="DAPI"), "channel"),
        (useq.MDAEvent(z_pos=50, x_pos=1), "x_pos"),
        (useq.MDAEvent(z_pos=50, properties=[("device", "name", "1")]), "properties"),
        (useq.MDAEvent(z_pos=50, keep_shutter_open=True), "keep_shutter_open"),
        (useq.MDAEvent(z_pos=50, action=useq.HardwareAutofocus(autofocus_motor_offset=1)), "autofocus"),
        (useq.MDAEvent(z_pos=50, action=useq.CustomAction(name="shake")), "custom"),
        (useq.MDAEvent(z_pos=50, exposure=1e6), "exposure"),
        (useq.MDAEvent(z_pos=1e5), "outside"),
        (useq.MDAEvent(), "z position"),
    ]:
        with pytest.raises(farnear.FarnearError, match=what):
            emulated_rig.run_sequence([useq.MDAEvent(z_pos=50), event])


def test_refuses_a_field_that_it_does_not_know(emulated_rig):
    useq = pytest.importorskip("useq")

    class Event(useq.MDAEvent):
        region: tuple = ()

    emulated_rig.home()
    assert len(list(emulated_rig.run_sequence([Event(z_pos=50)]))) == 1
    with pytest.raises(farnear.FarnearError, match="asks for region"):
        emulated_rig.run_sequence([Event(z_pos=50, region=(0, 0, 10, 10))])


def test_refuses_what_is_not_an_event_and_channels_of_one_name(emulated_rig):
    useq = pytest.importorskip("useq")
    for other in [[{"z_pos": 50}], useq.MDAEvent(z_pos=50)]:
        with pytest.raises(TypeError, match="expected a useq.MDASequence"):
            emulated_rig.run_sequence(other)
    events = [useq.MDAEvent(z_pos=50, channel={"config": "lit", "group": group}) for group in ("Camera", "Lamp")]
    with pytest.raises(farnear.FarnearError, match="'Camera' and 'Lamp'"):
        emulated_rig.run_sequence(events, channels={"lit": (50, 0)})


def test_a_relative_plan_needs_a_position(emulated_rig):
    useq = pytest.importorskip("useq")
    emulated_rig.home()
    plan = {"relative": [-10, 0, 10]}
    with_own = [{"z": 50}, {"sequence": {"z_plan": plan}}]
    for positions in [[], [{"z": 50}, {"name": "b"}], with_own]:
        with pytest.raises(farnear.FarnearError, match="relative to no position"):
            emulated_rig.run_sequence(useq.MDASequence(z_plan=plan, stage_positions=positions))
    with pytest.raises(farnear.FarnearError, match="relative to no position"):
        emulated_rig.run_sequence(useq.MDASequence(z_plan=plan, stage_positions=[{"z": 50}], axis_order="tcz"))
    taken = list(emulated_rig.run_sequence(useq.MDASequence(z_plan=plan, stage_positions=[{"z": 50}])))
    assert [exposure.record["asked_um"] for exposure in taken] == [40, 50, 60]


def test_events_are_named_by_their_indices(emulated_rig):
    useq = pytest.importorskip("useq")
    emulated_rig.home()
    events = useq.MDASequence(channels=["lit"], z_plan={"absolute": [50, 1e5]})
    with pytest.raises(farnear.FarnearError, match="event c = 0, z = 1: the fine position 100000 um is outside"):
        list(emulated_rig.run_sequence(events, channels={"lit": (50, 0)}))


def test_a_rig_that_was_left_is_closed(emulated_rig):
    with emulated_rig as rig:
        assert rig.info()["emulated"]
    with pytest.raises(farnear.RigError, match="closed"):
        rig.status()


def _outcomes_in_child(rig):
    """What each method does in a child process that is killed if one of them hangs."""
    calls = {
        "move": lambda: rig.move(fine=30),
        "home": rig.home,
        "status": rig.status,
        "info": rig.info,
        "expose": lambda: rig.expose([("fine", 50)]),
        "stop": rig.stop,
        "halt": rig.halt,
        "clear_alarm": lambda: rig.clear_alarm(1),
        "close": rig.close,
    }
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.alarm(30)
        try:
            for name, call in calls.items():
                try:
                    call()
                    os.write(writing, f"{name}: done\n".encode())
                except farnear.RigError as error:
                    os.write(writing, f"{name}: {error}\n".encode())
        finally:
            os._exit(0)
    os.close(writing)
    with os.fdopen(reading) as pipe:
        text = pipe.read()
    assert os.waitpid(child, 0)[1] == 0, f"the child was killed after {text!r}"
    return dict(line.split(": ", 1) for line in text.splitlines())


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_rig_is_refused_in_a_child_by_fork(emulated_rig):
    outcomes = _outcomes_in_child(emulated_rig)
    assert outcomes.pop("close") == "done"
    assert len(outcomes) == 8
    for name, error in outcomes.items():
        assert f"opened by another process ({os.getpid()}," in error and "after the fork" in error, name
    assert emulated_rig.status()["fine"]["state"]
    assert not emulated_rig.status()["emergency_stop"]


def test_a_port_that_is_none_is_said():
    from farnear.rig import Rig

    with pytest.raises(farnear.RigError, match="/dev/does-not-exist"):
        Rig("/dev/does-not-exist")


def test_ctrl_c_interrupts_the_opening_of_a_rig():
    from farnear.rig import Rig

    # A process in the background of a script ignores it.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with socket.create_server(("127.0.0.1", 0)) as silent:
            interrupt = threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT))
            begin = time.monotonic()
            interrupt.start()
            with pytest.raises(KeyboardInterrupt):
                Rig(f"tcp:127.0.0.1:{silent.getsockname()[1]}")
            assert time.monotonic() - begin < 1.5
    finally:
        signal.signal(signal.SIGINT, before)
