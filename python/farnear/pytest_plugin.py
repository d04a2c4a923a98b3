"""The emulated rig as a fixture of pytest, for tests of one's own measuring programs without hardware."""

from __future__ import annotations

from typing import Any, Iterator

import pytest


@pytest.fixture
def emulated_rig(request: pytest.FixtureRequest) -> Iterator[Any]:
    """A connected `farnear.rig.Rig`, emulated, new for each test. Skips where `farnear-sim` is not installed.

    `@pytest.mark.emulated_rig(scene="plane:910", seed=2)` sets its parts, as `farnear.rig.EmulatedRig` takes it. A
    marker of a test adds to those of its class and module.
    """
    from farnear.rig import EmulatedRig, find_simulator

    settings: dict[str, Any] = {}
    for marker in request.node.iter_markers("emulated_rig"):  # the closest first
        if marker.args:
            pytest.fail(f"emulated_rig got {marker.args}: name each setting, as in emulated_rig(scene='plane:910')", pytrace=False)
        settings = {**marker.kwargs, **settings}
    if "simulator" not in settings and find_simulator() is None:
        pytest.skip("farnear-sim is not on the PATH (cargo xtask install installs it)")
    with EmulatedRig(**settings) as emulated, emulated.rig() as rig:
        yield rig


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "emulated_rig(**settings): what the fixture of that name is made of")
