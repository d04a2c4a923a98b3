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


@pytest.fixture(scope="session")
def optics():
    return farnear.Optics.loads(OPTICS)


@pytest.fixture(scope="session")
def slant(optics):
    """Far, near, truth: 320x240, 8 bit."""
    return farnear.render(optics, "slant", width=320, height=240, seed=2)
