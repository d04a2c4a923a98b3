#!/usr/bin/env python3
"""The run time of `farnear depth` as a numpy + OpenCV user would write it, timed on one thread.

usage: peer_opencv.py FAR NEAR [--runs N]        (numpy, opencv-python-headless)

Same stages and windows as host/depth/src/run.rs: pre-filter, three operators, 7x7 sums of cross products, the
cubic by Newton steps, a 3x3 median, then depth in mm and a confidence. All buffers are allocated once. The kernels
are those of no lens; their values do not change the time. Prints one JSON object.
"""

import argparse
import json
import statistics
import time

import cv2
import numpy as np

SIZE = 7
NEWTON_STEPS = 3
ALPHA_LIMIT = 1.2
FOCAL_LENGTH_MM = 50.0
# Image distance beyond the focal length: offset + slope * alpha (far focus 933 mm, near focus 886.81 mm).
OFFSET_MM, SLOPE_MM = 2.90943, 0.078135
BORDER = cv2.BORDER_REFLECT_101


def symmetric_kernel(seed):
    """An eight-fold symmetric 7x7 kernel of full rank."""
    values = np.random.default_rng(seed).normal(size=(SIZE, SIZE))
    for image in (values.T, values[::-1], values[:, ::-1]):
        values = values + image
    values = values + values.T + values[::-1] + values[:, ::-1]
    return (values / np.abs(values).sum()).astype(np.float32)


class Chain:
    """Far and near image to depth and confidence, in buffers of its own."""

    def __init__(self, shape):
        self.prefilter, self.gm1, self.gp1, self.gp2 = (symmetric_kernel(s) for s in range(1, 5))
        names = "work difference sum m p1 p2 c1 c3 c0 energy alpha square slope depth confidence"
        for name in names.split():
            setattr(self, name, np.empty(shape, np.float32))

    def window_sum(self, a, b, out):
        cv2.multiply(a, b, dst=self.work)
        cv2.boxFilter(self.work, cv2.CV_32F, (SIZE, SIZE), dst=out, normalize=False, borderType=BORDER)

    def run(self, far, near):
        filtered = lambda image, kernel, out: cv2.filter2D(image, cv2.CV_32F, kernel, dst=out, borderType=BORDER)
        cv2.subtract(near, far, dst=self.work)
        filtered(self.work, self.prefilter, self.difference)
        cv2.add(near, far, dst=self.work)
        filtered(self.work, self.prefilter, self.sum)
        filtered(self.difference, self.gm1, self.m)
        filtered(self.sum, self.gp1, self.p1)
        filtered(self.sum, self.gp2, self.p2)

        self.window_sum(self.p1, self.p1, self.c1)
        self.window_sum(self.p1, self.p2, self.c3)
        self.window_sum(self.p1, self.m, self.c0)
        # Scalars by numpy: OpenCV's own scalar operations are several times slower.
        np.maximum(self.c1, 1e-12, out=self.c1)

        # alpha + r alpha^3 = a, by Newton from a.
        ratio, start = cv2.divide(self.c3, self.c1, dst=self.c3), cv2.divide(self.c0, self.c1, dst=self.c0)
        alpha, square, slope = self.alpha, self.square, self.slope
        np.clip(start, -ALPHA_LIMIT, ALPHA_LIMIT, out=alpha)
        for _ in range(NEWTON_STEPS):
            cv2.multiply(alpha, alpha, dst=square)
            cv2.multiply(square, ratio, dst=square)
            cv2.multiply(square, alpha, dst=slope, scale=2.0)
            cv2.add(slope, start, dst=slope)
            square *= 3.0
            square += 1.0
            np.maximum(square, 0.02, out=square)
            cv2.divide(slope, square, dst=alpha)
            np.clip(alpha, -ALPHA_LIMIT, ALPHA_LIMIT, out=alpha)
        alpha = cv2.medianBlur(alpha, 3)

        # u = F + F^2 / (offset + slope alpha); confidence from the texture energy.
        np.multiply(alpha, SLOPE_MM, out=self.depth)
        np.add(self.depth, OFFSET_MM, out=self.depth)
        np.divide(FOCAL_LENGTH_MM**2, self.depth, out=self.depth)
        np.add(self.depth, FOCAL_LENGTH_MM, out=self.depth)
        usual = float(cv2.mean(self.c1)[0])
        np.add(self.c1, 0.1 * usual, out=self.work)
        cv2.divide(self.c1, self.work, dst=self.confidence)
        return self.depth, self.confidence


def milliseconds(run, count):
    """Minimum and median of `count` runs after three to warm up."""
    times = []
    for _ in range(count + 3):
        start = time.perf_counter()
        run()
        times.append(1e3 * (time.perf_counter() - start))
    return {"min": round(min(times[3:]), 4), "median": round(statistics.median(times[3:]), 4)}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("far")
    parser.add_argument("near")
    parser.add_argument("--runs", type=int, default=30)
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    images = []
    for name in (arguments.far, arguments.near):
        image = cv2.imread(name, cv2.IMREAD_GRAYSCALE)
        if image is None:
            parser.error(f"{name} is no image that OpenCV reads")
        images.append(image.astype(np.float32))
    far, near = images
    if far.shape != near.shape:
        parser.error(f"the images differ in size: {far.shape} and {near.shape}")
    chain = Chain(far.shape)
    out = np.empty_like(far)
    one_filter = lambda: cv2.filter2D(far, cv2.CV_32F, chain.prefilter, dst=out, borderType=BORDER)
    result = {
        "shape": list(far.shape),
        "chain_ms": milliseconds(lambda: chain.run(far, near), arguments.runs),
        "filter2d_7x7_ms": milliseconds(one_filter, arguments.runs),
        "opencv": cv2.__version__,
        "threads": 1,
    }
    print(json.dumps(result))


if __name__ == "__main__":
    main()
