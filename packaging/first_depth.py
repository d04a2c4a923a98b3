"""A rendered pair and its depth, by the installed package alone: what a first user of the wheel does."""

import farnear
import numpy as np

MOST_OFF_MM = 0.5  # a cone without noise is known to 0.4

optics = farnear.Optics(
    focal_length_mm=50, aperture_mm=12.8, pixel_um=7.4, far_mm=933, max_blur_px=2.703, psf="gaussian:k=0.4578"
)
far, near, truth = farnear.render(optics, "cone")
found = farnear.depth(far, near, optics)
off_mm = float(np.nanmedian(np.abs(found.depth_mm - truth)))
print(f"depth of a rendered pair is off by {off_mm:.2f} mm at the median")
assert off_mm <= MOST_OFF_MM
