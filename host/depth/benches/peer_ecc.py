"""Our registration beside OpenCV's ECC (findTransformECC) on pairs whose images are blurred differently, with known geometry.

Needs numpy, opencv-python-headless. Usage: python3 peer_ecc.py REGISTRATION, where REGISTRATION is the program of the bench
registration.rs, built by `cargo build --package farnear-depth --bench registration` into target/debug/deps/registration-*.

A scene is a texture on a grid four times as fine as the pixels, blurred as the thesis' lens does it (Gaussian, k 0.4578) for
a plane, or half and half for two, and sampled: the far image straight, the near one through the map that is to be found. Shot
and read noise, 8 bit. The error is the root mean square over the image of the distance between the found and the true place.
Times are processor time on one thread, the least of three.
"""

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np

WIDTH, HEIGHT, FINE, MARGIN = 640, 480, 4, 24
BLUR_PX, K = 2.703, 0.4578


def texture(seed):
    """Mean 1, contrast 0.2; detail of about two pixels and more."""
    rng = np.random.default_rng(seed)
    h, w = (HEIGHT + 2 * MARGIN) * FINE, (WIDTH + 2 * MARGIN) * FINE
    noise = rng.standard_normal((h, w)).astype(np.float32)
    fine = cv2.GaussianBlur(noise, (0, 0), 0.8 * FINE)
    coarse = cv2.GaussianBlur(noise[::-1].copy(), (0, 0), 6.0 * FINE)
    mixed = fine / fine.std() + 0.6 * coarse / coarse.std()
    return 1 + 0.2 * mixed / mixed.std()


def blurred(scene, alpha, far):
    radius = 0.5 * BLUR_PX * (1 + alpha if far else 1 - alpha)
    sigma = K * abs(radius) * FINE
    return cv2.GaussianBlur(scene, (0, 0), sigma) if sigma > 0.1 else scene


def sampled(scene, back):
    """The camera's pixels, each showing the scene's place `back(pixel)`, with noise, 8 bit."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH].astype(np.float64)
    u = back[0, 0] * x + back[0, 1] * y + back[0, 2]
    v = back[1, 0] * x + back[1, 1] * y + back[1, 2]
    at = [((w + MARGIN) * FINE).astype(np.float32) for w in (u, v)]
    light = cv2.remap(scene, at[0], at[1], cv2.INTER_LANCZOS4)
    rng = np.random.default_rng(int(1e6 * abs(back).sum()) % 2**32)
    electrons = np.clip(light, 0.05, 2) * 9000
    electrons = electrons + np.sqrt(electrons) * rng.standard_normal(light.shape) + 12 * rng.standard_normal(light.shape)
    return np.round(np.clip(electrons / 20000, 0, 1) * 255).astype(np.float32)


def about_middle(shift, percent, degrees):
    a, m = np.radians(degrees), 1 + percent / 100
    linear = m * np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
    centre = np.array([(WIDTH - 1) / 2, (HEIGHT - 1) / 2])
    return np.c_[linear, centre - linear @ centre + np.array(shift)]


def error_px(found, true):
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    places = np.stack([x.ravel(), y.ravel(), np.ones(x.size)])
    return float(np.sqrt(((found @ places - true @ places) ** 2).sum(0).mean()))


def ecc(far, near, filter_px):
    least, found = np.inf, None
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 100, 1e-6)
    for _ in range(3):
        start = time.process_time()
        try:
            _, found = cv2.findTransformECC(
                far, near, np.eye(2, 3, dtype=np.float32), cv2.MOTION_AFFINE, criteria, None, filter_px
            )
        except cv2.error:
            found = None
        least = min(least, 1e3 * (time.process_time() - start))
    return found, least


def main(program):
    cv2.setNumThreads(1)
    planes = [("far focus", -1), ("middle", 0), ("near focus", 1), ("half far, half near", None)]
    motions = [((0.25, -0.125), 0, 0), ((1, -0.5), 0, 0), ((0, 0), 0.3, 0), ((0, 0), 1, 0.5), ((8, -4), 0, 0)]
    rows, files, pairs = [], [], []
    with tempfile.TemporaryDirectory() as folder:
        for number, (name, alpha) in enumerate(planes):
            scene = texture(number)
            half = np.arange(scene.shape[1]) < scene.shape[1] // 2
            for shift, percent, degrees in motions:
                true = about_middle(shift, percent, degrees)
                back = np.linalg.inv(np.vstack([true, [0, 0, 1]]))[:2]
                image = lambda far: (
                    np.where(half, blurred(scene, -1, far), blurred(scene, 1, far)).astype(np.float32)
                    if alpha is None
                    else blurred(scene, alpha, far)
                )
                pair = [sampled(image(True), np.eye(2, 3)), sampled(image(False), back)]
                for which, pixels in zip("fn", pair):
                    files.append(str(Path(folder) / f"{len(files)}{which}"))
                    pixels.astype("<f4").tofile(files[-1])
                pairs.append((name, f"({shift[0]}, {shift[1]}) px, {percent} %, {degrees} deg", true, *pair))
        text = subprocess.run([program, str(WIDTH), str(HEIGHT), "3", *files], check=True, capture_output=True, text=True)
    ours = [json.loads(line) for line in text.stdout.splitlines()]
    print(f"OpenCV {cv2.__version__}")
    print("| scene | shift, magnification, rotation | ours, px | ms | ECC, px | ms | ECC without filter, px | ms |")
    print("|---|---|--:|--:|--:|--:|--:|--:|")
    for (name, motion, true, far, near), own in zip(pairs, ours):
        row = [name, motion, f"{error_px(np.array(own['warp']), true):.3f}", f"{own['cpu_ms']:.0f}"]
        for filter_px in (5, 1):
            found, ms = ecc(far, near, filter_px)
            row += ["fails" if found is None else f"{error_px(found, true):.3f}", f"{ms:.0f}"]
        rows.append(row)
        print("| " + " | ".join(row) + " |", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
