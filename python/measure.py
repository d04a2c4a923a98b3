"""What a call from Python costs beside the same call in Rust, in one process, by turns: docs/python.md has what it printed.

`pip install ./python --config-settings=build-args="--features measure"`, then `python python/measure.py`.
"""

import time

import numpy as np

import farnear
from farnear import _farnear

optics = farnear.Optics(
    focal_length_mm=50, aperture_mm=12.8, pixel_um=7.4, far_mm=933, max_blur_px=2.703, psf="gaussian:k=0.4578"
)
far, near, _ = farnear.render(optics, "staircase", width=640, height=480)
far, near = (image.astype(np.float32) for image in (far, near))
operators = farnear.Operators(optics)
processor = farnear.Processor(optics)


def seconds(call, repeats):
    taken = []
    for _ in range(repeats):
        begin = time.perf_counter()
        call()
        taken.append(time.perf_counter() - begin)
    return taken


for name, call, rust, blocks, repeats in [
    ("depth", lambda: farnear.depth(far, near, optics, operators=operators), _farnear.seconds_of_depth, 10, 5),
    ("Processor.run", lambda: processor.run(far, near), _farnear.seconds_of_processor, 20, 50),
]:
    python_s, rust_s = [], []
    for _ in range(blocks):
        rust_s += rust(far, near, optics, repeats)
        python_s += seconds(call, repeats)
    least, middle = (min(python_s) / min(rust_s), np.median(python_s) / np.median(rust_s))
    print(
        f"{name}, 640x480: Rust {1e3 * min(rust_s):.2f} ms, Python {1e3 * min(python_s):.2f} ms (least of {len(rust_s)}); "
        f"ratio of the least {least:.3f}, of the medians {middle:.3f}"
    )
