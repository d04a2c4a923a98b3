"""The rig: a board with its stages and a camera, real or emulated."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import time
import warnings
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Iterable, Iterator, Mapping, Optional, Sequence, Union

import numpy as np
from numpy.typing import NDArray

from ._farnear import FarnearError, Optics, RigClient, RigError

if TYPE_CHECKING:
    import useq

__all__ = ["EmulatedRig", "Exposure", "Rig", "find_simulator"]

Pixels = Union[NDArray[np.uint8], NDArray[np.uint16]]


@dataclass(frozen=True)
class Exposure:
    """An image and how it was taken."""

    image: Pixels
    """(height, width); `uint8`, or `uint16` over its whole range where the camera has more than 8 bits."""
    bits: int
    """Bits that carry the picture."""
    record: Mapping[str, Any]
    """What the board measured: `axis`, `asked_um` and `measured_um` of it, `sensor_mm` (lens to sensor), `settle_ms`,
    `strobe_start_us` and `strobe_end_us` (board time of the exposure), `exposure_us`."""
    index: Mapping[str, int] = field(default_factory=dict)
    """The place in a `useq` sequence."""


class Rig:
    """A board behind a serial port, and a camera; a context manager that stops what moves when it is left.

    `port` is for example `/dev/ttyACM0`; `camera` one of `folder:DIR`, `command:PROGRAM ...`, `HOST:PORT` (an emulated one),
    needed for images only. Positions are micrometres, absolute, of the axes `coarse` and `fine` (the sensor's) and `lens`. Every method
    that waits can be interrupted by Ctrl-C, which stops the rig. Errors: `FarnearError` for what cannot be, `RigError` from the
    rig.
    """

    def __init__(self, port: str, camera: Optional[str] = None) -> None:
        self._client: Optional[RigClient] = RigClient(port)
        self._camera = camera

    def __enter__(self) -> Rig:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Stops what moves and gives the port free."""
        client, self._client = self._client, None
        if client is not None:
            try:
                client.stop()
            except RigError:
                pass  # a rig that is gone does not move by this program's wish

    @property
    def _open(self) -> RigClient:
        if self._client is None:
            raise RigError("the rig is closed; open it anew")
        return self._client

    @property
    def _camera_address(self) -> str:
        if self._camera is None:
            raise FarnearError("the rig was opened without a camera; name one, as in Rig(port, camera='folder:DIR')")
        return self._camera

    def info(self) -> dict[str, Any]:
        """Who the board is, and how far its axes go."""
        return self._open.info()

    def status(self) -> dict[str, Any]:
        """Where each axis stands, and the alarm if there is one."""
        return self._open.status()

    def home(self, *axes: str) -> dict[str, float]:
        """Homes axes at the same time, all that have a home switch where none are named; gives how far each encoder's old zero
        was off, um."""
        return self._open.home(list(axes) or None)

    def move(self, *, home: bool = False, **to_um: float) -> dict[str, float]:
        """Moves axes at the same time, `rig.move(coarse=5800, fine=50)`, and gives where they have come to by encoder or gauge, um. With
        `home` axes that are not homed are homed first."""
        if home:
            self._open.ensure_homed()
        return self._open.move_to(dict(to_um))

    def stop(self) -> None:
        """Stops all motion along the ramps; positions stay known."""
        self._open.stop()

    def halt(self) -> None:
        """Emergency stop: what moved has lost its position, and the alarm has to be cleared."""
        self._open.halt()

    def clear_alarm(self, number: int) -> None:
        """Clears the alarm of this number, which `status()` gives."""
        self._open.clear_alarm(number)

    def expose(
        self, positions: Iterable[tuple[str, float]], *, exposure_ms: float = 5.0, wait_s: float = 30.0
    ) -> list[Exposure]:
        """An exposure at each position (axis, um), by one program that the board runs by itself: it moves, waits until the
        position has settled, triggers, and stamps the exposure. A program of more than `info()["shots_max"]` is run in parts."""
        shots = list(positions)
        most = int(self.info()["shots_max"])
        taken: list[Exposure] = []
        for begin in range(0, len(shots), most):
            part = shots[begin : begin + most]
            exposure_us = round(1000 * exposure_ms)
            images = self._open.expose(self._camera_address, part, exposure_us=exposure_us, wait_s=wait_s)
            taken.extend(_exposure(*image) for image in images)
        return taken

    def capture_pair(
        self, optics: Optics, *, exposure_ms: float = 5.0, wait_s: float = 30.0
    ) -> tuple[Exposure, Exposure]:
        """The far- and the near-focused image for some optics, as `farnear.depth` takes them: homes where needed, brings the stage
        near, exposes both by piezo."""
        pair = self._open.capture_pair(self._camera_address, optics, exposure_us=round(1000 * exposure_ms), wait_s=wait_s)
        far, near = (_exposure(*image) for image in pair)
        return far, near

    def run_sequence(self, sequence: useq.MDASequence, *, axis: str = "fine", wait_s: float = 30.0) -> Iterator[Exposure]:
        """Runs a `useq` sequence whose `z` positions (um) are those of an axis.

        Done are `z_plan`, `exposure` (ms, default 5) and `time_plan`: an event with `min_start_time` (s since the start, or since the
        last event with `reset_event_timer`) waits for it. Events of one exposure and one start time run as one program on the board.
        Everything else that an event can ask for (channels, stage positions, autofocus, custom actions, properties, SLM images) is
        refused with `FarnearError` before anything moves, as are positions and exposures outside the limits."""
        events = list(sequence)
        info = self.info()
        for event in events:
            _check(event, axis, info)
        return self._run_events(events, axis, wait_s)

    def _run_events(self, events: list[Any], axis: str, wait_s: float) -> Iterator[Exposure]:
        begin = time.monotonic()
        while events:
            first, same = events[0], 1
            while same < len(events) and _program(events[same]) == _program(first) and not events[same].reset_event_timer:
                same += 1
            part, events = events[:same], events[same:]
            if first.reset_event_timer:
                begin = time.monotonic()
            if first.min_start_time is not None:
                late_s = time.monotonic() - begin - first.min_start_time
                if late_s < 0:
                    time.sleep(-late_s)
                elif late_s > LATE_S:
                    warnings.warn(f"event {dict(first.index)} starts {late_s:.1f} s late", stacklevel=2)
            positions = [(axis, float(event.z_pos)) for event in part]
            exposure_ms = 5.0 if first.exposure is None else float(first.exposure)
            taken = self.expose(positions, exposure_ms=exposure_ms, wait_s=wait_s)
            for event, exposure in zip(part, taken):
                yield Exposure(exposure.image, exposure.bits, exposure.record, dict(event.index))


LATE_S = 0.5
"""A time lapse that is later than this warns."""


def _program(event: Any) -> tuple[Any, Any]:
    return event.exposure, event.min_start_time


def _check(event: Any, axis: str, info: Mapping[str, Any]) -> None:
    name = f"event {dict(event.index)}"
    action = getattr(event.action, "type", "acquire_image") if event.action is not None else "acquire_image"
    if action != "acquire_image":
        raise FarnearError(f"{name} asks for the action {action!r}; expected images only. Find the focus with `farnear rig focus` before")
    asked = {"x_pos": event.x_pos, "y_pos": event.y_pos, "channel": event.channel, "slm_image": event.slm_image}
    others = [what for what, value in asked.items() if value is not None]
    others += [what for what in ("properties", "keep_shutter_open") if getattr(event, what)]
    if others:
        raise FarnearError(f"{name} asks for {', '.join(others)}; the rig has z and time only")
    if event.z_pos is None:
        raise FarnearError(f"{name} has no z position; give the sequence a z_plan")
    exposure_ms = 5.0 if event.exposure is None else float(event.exposure)
    for what, value, limits in [
        (f"the {axis} position", float(event.z_pos), info.get(f"{axis}_um")),
        ("the exposure", exposure_ms, info.get("exposure_ms")),
    ]:
        if limits is not None and not limits[0] <= value <= limits[1]:
            unit = "ms" if what == "the exposure" else "um"
            raise FarnearError(f"{name}: {what} {value:g} {unit} is outside {limits[0]:g} to {limits[1]:g} {unit}")


def _exposure(image: NDArray[np.uint16], bits: int, record: dict[str, Any]) -> Exposure:
    pixels: Pixels
    if bits <= 8:
        pixels = image.astype(np.uint8)
    else:
        pixels = np.rint(image * (65535.0 / (2**bits - 1))).astype(np.uint16)
    return Exposure(pixels, bits, record)


def find_simulator() -> Optional[Path]:
    """The program `farnear-sim`: the environment's FARNEAR_SIM, on the PATH, or built in the sources that this package lies in."""
    named = os.environ.get("FARNEAR_SIM")
    if named:
        return Path(named)
    on_path = shutil.which("farnear-sim")
    if on_path:
        return Path(on_path)
    for folder in Path.cwd().resolve().parents, (Path.cwd(),):
        for place in folder:
            built = place / "target" / "debug" / "farnear-sim"
            if (place / "hil-sim").is_dir() and built.is_file():
                return built
    return None


class EmulatedRig:
    """`farnear-sim` as a context manager: the real firmware on an emulated board, with simulated stages and camera.

    `scene` is `plane:MM`, `staircase`, `slant`, `cone` or `sphere`; `optics` are those of its lens. Runs repeat to the byte.
    """

    def __init__(
        self,
        *,
        scene: str = "staircase",
        optics: Union[str, os.PathLike[str], None] = None,
        noise: str = "8bit",
        seed: int = 1,
        more: Sequence[str] = (),
        simulator: Union[str, os.PathLike[str], None] = None,
    ) -> None:
        program = Path(simulator) if simulator is not None else find_simulator()
        if program is None:
            raise RigError(
                "farnear-sim is not on the PATH: `cargo xtask install` installs it, or FARNEAR_SIM in the environment names it"
            )
        command = [str(program), "run", "--scene", scene, "--noise", noise, "--seed", str(seed)]
        if optics is not None:
            command += ["--optics", os.fspath(optics)]
        self._process = subprocess.Popen(
            [*command, *more], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True
        )
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise RigError(f"{program} ended at once ({self._process.wait()}); its message stands above")
        address = json.loads(line)
        self.port: str = address["port"]
        """The board's serial port."""
        self.camera: str = address["camera"]
        """The camera's address, as `Rig` takes it."""

    def rig(self) -> Rig:
        """The rig, connected."""
        return Rig(self.port, self.camera)

    def close(self) -> None:
        """Ends it."""
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                stream.close()
        try:
            self._process.wait(timeout=10)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def __enter__(self) -> EmulatedRig:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
