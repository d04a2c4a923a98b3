#!/usr/bin/env python3
"""Depth from a pair as a numpy + OpenCV user would write it, as a whole program.

usage: program_opencv.py FAR NEAR OUT [--npy-only]        (numpy, opencv-python-headless)

Reads both images, registers the near one by ECC on a reduced image, matches the gain, runs the chain of
`peer_opencv.py` and writes depth.npy and a coloured view.png. One thread.
"""

import argparse
import os

import cv2
import numpy as np
from peer_opencv import BORDER, Chain

# Width of the reduced image that is registered.
REGISTRATION_WIDTH = 640


def registered(far, near):
    """The near image on the far one's pixels, with its mean."""
    scale = max(1, far.shape[1] // REGISTRATION_WIDTH)
    reduced = [cv2.resize(image, None, fx=1 / scale, fy=1 / scale, interpolation=cv2.INTER_AREA) for image in (far, near)]
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-6)
    _, warp = cv2.findTransformECC(*reduced, np.eye(2, 3, dtype=np.float32), cv2.MOTION_AFFINE, criteria, None, 5)
    warp[:, 2] *= scale
    flags = cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP
    near = cv2.warpAffine(near, warp, far.shape[::-1], flags=flags, borderMode=BORDER)
    near *= far.mean() / near.mean()
    return near


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("far")
    parser.add_argument("near")
    parser.add_argument("out")
    parser.add_argument("--npy-only", action="store_true")
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    os.makedirs(arguments.out, exist_ok=True)
    images = []
    for name in (arguments.far, arguments.near):
        image = cv2.imread(name, cv2.IMREAD_UNCHANGED)
        if image is None:
            parser.error(f"OpenCV cannot read {name}")
        images.append(image.astype(np.float32) / np.iinfo(image.dtype).max)
    far, near = images
    depth, _ = Chain(far.shape).run(far, registered(far, near))
    np.save(os.path.join(arguments.out, "depth.npy"), depth)
    if not arguments.npy_only:
        low, high = np.percentile(depth[::16, ::16], [2, 98])
        scaled = np.clip((depth - low) * (255 / max(high - low, 1e-6)), 0, 255).astype(np.uint8)
        cv2.imwrite(os.path.join(arguments.out, "view.png"), cv2.applyColorMap(scaled, cv2.COLORMAP_TURBO))


if __name__ == "__main__":
    main()
