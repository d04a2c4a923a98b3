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
    """An image and its record.

    Attributes
    ----------
    image : array uint8 or uint16 (height, width)
        With more than 8 bits `uint16` over its full range.
    bits : int
        Bits of the camera.
    record : mapping
        Measurements of the board: `axis`, its `asked_um` and `measured_um`, `sensor_mm` (lens to sensor), `settle_ms`,
        `strobe_start_us` and `strobe_end_us` (board time of the exposure), `exposure_us`.
    index : mapping
        Position in a `useq` sequence.
    """

    image: Pixels
    bits: int
    record: Mapping[str, Any]
    index: Mapping[str, int] = field(default_factory=dict)


class Rig:
    """A board and its camera; a context manager that stops all motion at its end.

    Positions are absolute, um, of the axes `coarse` and `fine` (sensor) and `lens`. Ctrl-C interrupts every method and stops the rig.
    A child process by `fork` cannot use the rig of its parent: every method raises `RigError`. Open the rig after the fork.

    Parameters
    ----------
    port : str
        Serial port, such as `/dev/ttyACM0`.
    camera : str, optional
        `folder:DIR`, `command:PROGRAM ...` or `HOST:PORT` (emulated); needed for images only.

    Raises
    ------
    FarnearError
        Values out of range.
    RigError
        Failures of the rig, its camera or the link.
    """

    def __init__(self, port: str, camera: Optional[str] = None) -> None:
        self._client: Optional[RigClient] = RigClient(port)
        self._camera = camera

    def __enter__(self) -> Rig:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Stop all motion and release the port."""
        client, self._client = self._client, None
        if client is not None:
            try:
                client.stop()
            except RigError:
                pass  # a lost link stops the rig

    @property
    def _open(self) -> RigClient:
        if self._client is None:
            raise RigError("the rig is closed; open it again")
        return self._client

    @property
    def _camera_address(self) -> str:
        if self._camera is None:
            raise FarnearError("the rig was opened without a camera; name one, as in Rig(port, camera='folder:DIR')")
        return self._camera

    def info(self) -> dict[str, Any]:
        """Identity of the board, and limits of its axes (um) and exposures (ms)."""
        return self._open.info()

    def status(self) -> dict[str, Any]:
        """State and position (um) of each axis, and the alarm, if any."""
        return self._open.status()

    def home(self, *axes: str) -> dict[str, float]:
        """Home axes simultaneously, by default all with a home switch.

        Returns
        -------
        dict
            Shift of each encoder's zero, um.
        """
        return self._open.home(list(axes) or None)

    def move(self, *, home: bool = False, **to_um: float) -> dict[str, float]:
        """Move axes simultaneously, as in `rig.move(coarse=5800, fine=50)`.

        Parameters
        ----------
        home : bool
            Home axes first that are not homed.
        **to_um : float
            Position of each axis, um.

        Returns
        -------
        dict
            Position of each axis by encoder or gauge, um.
        """
        if home:
            self._open.ensure_homed()
        return self._open.move_to(dict(to_um))

    def stop(self) -> None:
        """Stop all motion along the ramps; positions stay known."""
        self._open.stop()

    def halt(self) -> None:
        """Emergency stop: moving axes lose their position and the alarm must be cleared."""
        self._open.halt()

    def clear_alarm(self, number: int) -> None:
        """Clear the alarm with this number from `status()`."""
        self._open.clear_alarm(number)

    def expose(
        self,
        positions: Iterable[tuple[str, float]],
        *,
        exposure_ms: float = 5.0,
        wait_s: float = 30.0,
        light: Optional[tuple[float, float]] = None,
    ) -> list[Exposure]:
        """Expose at each position by a program on the board: move, settle, trigger, time stamp.

        Parameters
        ----------
        positions : iterable of (axis, um)
            Axis and position, um. More than `info()["shots_max"]` are run in parts.
        exposure_ms : float
            Exposure time, ms.
        wait_s : float
            Longest wait for an image, s.
        light : (float, float), optional
            Brightness of the board's two light outputs during the exposures, percent.

        Returns
        -------
        list of Exposure
            Image (height, width) and record of each.
        """
        exposure_us = round(1000 * exposure_ms)
        images = self._open.expose(self._camera_address, list(positions), exposure_us=exposure_us, wait_s=wait_s, light=light)
        return [_exposure(*image) for image in images]

    def capture_pair(
        self,
        optics: Optics,
        *,
        exposure_ms: float = 5.0,
        wait_s: float = 30.0,
        light: Optional[tuple[float, float]] = None,
        subtract_ambient: bool = False,
        average: int = 1,
        auto_exposure: bool = False,
    ) -> tuple[Exposure, Exposure]:
        """Capture a pair for `farnear.depth`: home if necessary, move the stage, expose both positions of the piezo.

        Parameters
        ----------
        optics : Optics
            Optics with the two foci.
        exposure_ms : float
            Exposure time, ms.
        wait_s : float
            Longest wait for an image, s.
        light : (float, float), optional
            Brightness of the board's two light outputs during the exposures, percent.
        subtract_ambient : bool
            Subtract images without that light. The scene must not move and the room's light must be steady.
        average : int
            Exposures averaged for each image, 1 to 256.
        auto_exposure : bool
            Find the exposure time at which the brightest pixels have 80 % of white, from `exposure_ms`.

        Returns
        -------
        far, near : Exposure
            Images (height, width) with their records.
        """
        pair = self._open.capture_pair(
            self._camera_address,
            optics,
            exposure_us=round(1000 * exposure_ms),
            wait_s=wait_s,
            light=light,
            subtract_ambient=subtract_ambient,
            average=average,
            auto_exposure=auto_exposure,
        )
        far, near = (_exposure(*image) for image in pair)
        return far, near

    def run_sequence(
        self,
        sequence: useq.MDASequence,
        *,
        axis: str = "fine",
        wait_s: float = 30.0,
        channels: Optional[Mapping[str, tuple[float, float]]] = None,
    ) -> Iterator[Exposure]:
        """Run a `useq` sequence whose `z` positions (um) are those of an axis.

        `z_plan`, `exposure` (ms, default 5) and `time_plan` are supported: an event waits for its `min_start_time` (s since the start,
        or since the last event with `reset_event_timer`). `channels` has the light of each channel: the brightness of the board's two
        outputs, percent, as in `channels={"blue": (100, 0)}`. Events of one exposure, light and start time run as one program on the
        board. Other channels, stage positions, autofocus, custom actions, properties, regions and SLM images raise `FarnearError` before any
        motion, as do a relative `z_plan` without a `z` in `stage_positions`, and positions and exposures outside the limits.

        Yields
        ------
        Exposure
            Image (height, width) and record of each event.
        """
        _check_start(sequence)
        events = list(sequence)
        info = self.info()
        groups: dict[str, str] = {}
        for event in events:
            _check(event, axis, info, channels or {})
            channel = event.channel
            if channel is not None and groups.setdefault(channel.config, channel.group) != channel.group:
                both = f"{groups[channel.config]!r} and {channel.group!r}"
                raise FarnearError(f"the channel {channel.config!r} is in the groups {both}; expected names that differ")
        return self._run_events(events, axis, wait_s, channels or {})

    def _run_events(
        self, events: list[Any], axis: str, wait_s: float, channels: Mapping[str, tuple[float, float]]
    ) -> Iterator[Exposure]:
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
                    warnings.warn(f"{_name(first)} starts {late_s:.1f} s late", stacklevel=2)
            positions = [(axis, float(event.z_pos)) for event in part]
            exposure_ms = 5.0 if first.exposure is None else float(first.exposure)
            light = None if first.channel is None else channels[first.channel.config]
            taken = self.expose(positions, exposure_ms=exposure_ms, wait_s=wait_s, light=light)
            for event, exposure in zip(part, taken):
                yield Exposure(exposure.image, exposure.bits, exposure.record, dict(event.index))


LATE_S = 0.5
"""Delay of a time lapse from which a warning is issued."""


def _name(event: Any) -> str:
    # The keys are members of an enum, whose `repr` a reader would not expect.
    indices = ", ".join(f"{key} = {number}" for key, number in event.index.items())
    return f"event {indices}".strip()


def _program(event: Any) -> tuple[Any, Any, Any]:
    return event.exposure, event.channel, event.min_start_time


def _check_start(sequence: Any, start: Optional[float] = None) -> None:
    """Refuse a relative plan without the position that it is relative to: `useq` takes 0."""
    plan = getattr(sequence, "z_plan", None)
    # Without `p` in the order `useq` ignores the positions.
    positions = tuple(getattr(sequence, "stage_positions", ())) if "p" in getattr(sequence, "axis_order", "p") else ()
    starts = [start if position.z is None else position.z for position in positions]
    # A position's own plan replaces that of the sequence.
    own = [getattr(position.sequence, "z_plan", None) is not None for position in positions]
    to_start = [at for at, is_own in zip(starts, own) if not is_own] if positions else [start]
    if plan is not None and plan.is_relative and None in to_start:
        raise FarnearError(f"z_plan: {plan!r} is relative to no position; give one, as in stage_positions=[{{'z': 50}}]")
    for position, at in zip(positions, starts):
        _check_start(position.sequence, at)


SUPPORTED = {
    "index", "channel", "exposure", "min_start_time", "pos_name", "z_pos", "sequence", "metadata", "action", "reset_event_timer",
}  # fmt: skip
"""Fields of a `useq` event that are done, or that need nothing to be done."""


def _is_asked(event: Any, field: str) -> bool:
    value = getattr(event, field)
    is_empty = value is None or value is False or (isinstance(value, (list, tuple)) and not value)
    return not is_empty and value != type(event).model_fields[field].get_default(call_default_factory=True)


def _check(event: Any, axis: str, info: Mapping[str, Any], channels: Mapping[str, tuple[float, float]]) -> None:
    if not hasattr(event, "min_start_time"):
        raise TypeError(f"{event!r} is not an event; expected a useq.MDASequence or a list of useq.MDAEvent")
    name = _name(event)
    action = getattr(event.action, "type", "acquire_image") if event.action is not None else "acquire_image"
    if action != "acquire_image":
        raise FarnearError(f"{name} asks for the action {action!r}; expected images only. Find the focus with `farnear rig focus` before")
    if event.channel is not None and event.channel.config not in channels:
        light = f"channels={{{event.channel.config!r}: (100, 0)}}"
        raise FarnearError(f"{name} asks for the channel {event.channel.config!r}; give its light in percent, as in {light}")
    others = [what for what in type(event).model_fields if what not in SUPPORTED and _is_asked(event, what)]
    if others:
        raise FarnearError(f"{name} asks for {', '.join(others)}; the rig has z, channels and time only")
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
    """Path of `farnear-sim`: from FARNEAR_SIM in the environment, from the PATH, or built in a clone around the current folder."""
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

    Runs repeat to the byte. `port` and `camera` are the arguments of `Rig`.

    Parameters
    ----------
    scene : str
        `plane:MM` (distance in mm), `staircase`, `slant`, `cone` or `sphere`.
    optics : path, optional
        An `optics.toml`; by default a 50 mm lens with its far focus at 933 mm.
    noise : str
        "none", "8bit" or "12bit".
    seed : int
        Seed of texture and noise.
    more : sequence of str
        More arguments of `farnear-sim run`.
    simulator : path, optional
        The program; by default that of `find_simulator`.
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
            [*command, *more],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            start_new_session=True,  # Ctrl-C first stops all motion; on Windows by the flag
            creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
        )
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise RigError(f"{program} ended immediately ({self._process.wait()}); see its message above")
        address = json.loads(line)
        self.port: str = address["port"]
        self.camera: str = address["camera"]

    def rig(self) -> Rig:
        """A connected `Rig`."""
        return Rig(self.port, self.camera)

    def close(self) -> None:
        """Stop the program."""
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
