"""Optics and a rendered pair that many tests look at; nothing here writes to them."""

import pytest

import farnear

OPTICS = """
[lens]
focal_length_mm = 50.0
aperture_mm = 12.8
[sensor]
pixel_um = 7.4
[focus]
far_mm = 933.0
max_blur_px = 2.703
[psf]
model = "gaussian"
k = 0.4578
"""

# A lens of `calibrate_stack` without `object_pixel_um`.
LEARNED = f"""{OPTICS}
[stage]
bin = 1
pair_step = 1
measured = [-1.19, 1.19]
response = {[round(-1.19 + 2.38 * i / 16, 5) for i in range(17)]}
residual = 0.01
usual_unexplained = 1.0
"""


@pytest.fixture(scope="session")
def learned():
    return farnear.Optics.loads(LEARNED)


@pytest.fixture(scope="session")
def without_scale(optics, learned, slant):
    """Map of `slant` by a lens for which the size of a pixel at the target is not known."""
    found = farnear.depth(*slant[:2], optics)
    arrays = (found.depth_mm, found.confidence, found.deviation_mm, found.reasons)
    return farnear.DepthMap._assemble(*arrays, found.findings, found.valid_fraction, learned)


@pytest.fixture(scope="session")
def optics():
    return farnear.Optics.loads(OPTICS)


@pytest.fixture(scope="session")
def slant(optics):
    """Far, near, truth: 320x240, 8 bit."""
    return farnear.render(optics, "slant", width=320, height=240, seed=2)
