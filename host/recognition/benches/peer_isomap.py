#!/usr/bin/env python3
"""Isomap, the RBF map and its use as a scikit-learn user would write them, timed on one thread.

usage: peer_isomap.py FEATURES.npy [--runs N]        (numpy, scipy, scikit-learn)

FEATURES.npy holds one descriptor per row (N x 360, float32). The same work as host/recognition/benches/embedding.rs: Isomap with 12
neighbours in 3 dimensions, a Gaussian ridge regression from descriptors to coordinates, and embedding single
descriptors with it. Everything that may be done beforehand is. Prints one JSON object.
"""

import os

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import argparse
import json
import statistics
import time

import numpy as np
import scipy.linalg
import sklearn
from scipy.spatial.distance import cdist
from sklearn.manifold import Isomap

NEIGHBOURS = 12
DIMENSIONS = 3
GAMMA = 0.1
RIDGE = 1e-3


def milliseconds(run, count):
    """Minimum and median of `count` runs after one to warm up."""
    run()
    times = []
    for _ in range(count):
        start = time.perf_counter()
        run()
        times.append(1e3 * (time.perf_counter() - start))
    return {"min": round(min(times), 4), "median": round(statistics.median(times), 4)}


class Map:
    """Gaussian radial basis functions on all samples."""

    def __init__(self, samples, coordinates):
        kernel = np.exp(-GAMMA * cdist(samples, samples, "sqeuclidean"))
        kernel[np.diag_indices_from(kernel)] += RIDGE
        factor = scipy.linalg.cho_factor(kernel, overwrite_a=True)
        self.weights = scipy.linalg.cho_solve(factor, coordinates).astype(np.float32)
        self.centres = samples.astype(np.float32)
        self.norms = (self.centres**2).sum(1)
        self.basis = np.empty(len(samples), np.float32)

    def embed(self, sample):
        np.dot(self.centres, sample, out=self.basis)
        self.basis *= -2
        self.basis += self.norms
        self.basis += sample @ sample
        np.maximum(self.basis, 0, out=self.basis)
        self.basis *= -GAMMA
        np.exp(self.basis, out=self.basis)
        return self.basis @ self.weights


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("features")
    parser.add_argument("--runs", type=int, default=3)
    arguments = parser.parse_args()
    features = np.load(arguments.features)
    samples = features.astype(np.float64)

    def isomap():
        return Isomap(n_neighbors=NEIGHBOURS, n_components=DIMENSIONS, eigen_solver="arpack").fit_transform(samples)

    coordinates = isomap()
    trained = Map(samples, coordinates)
    embed = milliseconds(lambda: [trained.embed(row) for row in features[:300]], 5 * arguments.runs)
    result = {
        "isomap_ms": milliseconds(isomap, arguments.runs),
        "rbf_training_ms": milliseconds(lambda: Map(samples, coordinates), arguments.runs),
        "embedding_ms": {key: value / 300 for key, value in embed.items()},
        "samples": len(features),
        "version": f"scikit-learn {sklearn.__version__}",
        "threads": 1,
    }
    print(json.dumps(result))


if __name__ == "__main__":
    main()
