"""Isomap with a map for new samples, and that map by itself, as estimators of scikit-learn."""

from __future__ import annotations

import warnings
from typing import Any, Optional

import numpy as np
from numpy.typing import ArrayLike, NDArray

try:
    from sklearn.base import BaseEstimator, ClassNamePrefixFeaturesOutMixin, RegressorMixin, TransformerMixin
    from sklearn.utils.validation import check_is_fitted, validate_data
except ImportError as error:  # pragma: no cover
    raise ImportError("farnear.sklearn needs scikit-learn 1.6 or newer: pip install 'farnear[sklearn]'") from error

from ._farnear import DisconnectedError, Rbf, isomap

__all__ = ["Isomap", "RbfRegressor"]


def _usual_gamma(samples: NDArray[np.float32]) -> float:
    """One over the features' summed variance: samples at a usual distance then have e^-2 of each other."""
    spread = float(samples.var(axis=0, dtype=np.float64).sum())
    return 1.0 / spread if spread > 0.0 else 1.0


class Isomap(ClassNamePrefixFeaturesOutMixin, TransformerMixin, BaseEstimator):
    """Geodesic distances laid out by classical scaling; new samples by radial basis functions (Li 2014, section 9.3).

    Parameters
    ----------
    n_components : int
        Dimensions of the embedding.
    n_neighbors : int
        Neighbours of each sample in the graph; doubled, with a warning, while the graph is disconnected.
    gamma : float, optional
        Coefficient of the squared distance in the map for new samples; by default one over the features' summed variance.
    ridge : float
        Ridge of the map.

    Attributes
    ----------
    embedding_ : array float32 (n_samples, n_components)
        Coordinates of the samples.
    eigenvalues_ : array float64 (n_components,)
        In descending order.
    n_neighbors_ : int
        Neighbours in the graph.
    dist_matrix_ : array float32 (n_samples, n_samples)
        Path lengths in the unit of the features.
    """

    def __init__(
        self, n_components: int = 2, *, n_neighbors: int = 5, gamma: Optional[float] = None, ridge: float = 1e-3
    ) -> None:
        self.n_components = n_components
        self.n_neighbors = n_neighbors
        self.gamma = gamma
        self.ridge = ridge

    def fit(self, X: ArrayLike, y: Any = None) -> Isomap:
        """Embed samples (n_samples, n_features)."""
        samples = validate_data(self, X, dtype=np.float64, ensure_min_samples=self.n_components + 2)
        self._centre = samples.mean(axis=0)
        samples = self._centred(samples)
        self.n_neighbors_ = min(self.n_neighbors, len(samples) - 1)
        while True:
            try:
                found = isomap(samples, neighbours=self.n_neighbors_, dimensions=self.n_components)
                break
            except DisconnectedError:
                if self.n_neighbors_ >= len(samples) - 1:
                    raise
            self.n_neighbors_ = min(2 * self.n_neighbors_, len(samples) - 1)
        if self.n_neighbors_ > self.n_neighbors < len(samples) - 1:
            warnings.warn(
                f"the graph of {self.n_neighbors} neighbours falls apart; {self.n_neighbors_} were taken", stacklevel=2
            )
        self.embedding_, self.eigenvalues_, self.dist_matrix_ = found
        gamma = _usual_gamma(samples) if self.gamma is None else self.gamma
        self._map = Rbf(samples, self.embedding_, gamma=gamma, ridge=self.ridge)
        return self

    def fit_transform(self, X: ArrayLike, y: Any = None) -> NDArray[np.float32]:
        """Fit, then map the same samples: (n_samples, n_features) to (n_samples, n_components); `embedding_` is the embedding itself."""
        return self.fit(X).transform(X)

    def transform(self, X: ArrayLike) -> NDArray[np.float32]:
        """Map samples (n_samples, n_features) to coordinates float32 (n_samples, n_components)."""
        check_is_fitted(self)
        return self._map.embed(self._centred(validate_data(self, X, dtype=np.float64, reset=False)))

    def _centred(self, samples: NDArray[np.float64]) -> NDArray[np.float32]:
        # Single precision has no digits to waste on where the samples lie.
        return np.ascontiguousarray(samples - self._centre, dtype=np.float32)

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.transformer_tags.preserves_dtype = []  # float32, whatever comes in
        return tags

    @property
    def _n_features_out(self) -> int:
        return int(self.embedding_.shape[1])


class RbfRegressor(RegressorMixin, BaseEstimator):
    """Gaussian radial basis functions on all samples, solved with a ridge.

    Parameters
    ----------
    gamma : float, optional
        Coefficient of the squared distance; by default one over the features' summed variance.
    ridge : float
        Ridge of the system.

    Attributes
    ----------
    condition_ : float
        Condition number of the system.
    """

    def __init__(self, *, gamma: Optional[float] = None, ridge: float = 1e-3) -> None:
        self.gamma = gamma
        self.ridge = ridge

    def fit(self, X: ArrayLike, y: ArrayLike) -> RbfRegressor:
        """Fit targets (n_samples,) or (n_samples, n_outputs) of samples (n_samples, n_features)."""
        samples, targets = validate_data(
            self, X, y, dtype=np.float64, multi_output=True, y_numeric=True, ensure_min_samples=2
        )
        self._centre = samples.mean(axis=0)
        samples = np.ascontiguousarray(samples - self._centre, dtype=np.float32)
        targets = np.asarray(targets, dtype=np.float64)
        self._flat = targets.ndim == 1
        columns = targets.reshape(len(samples), -1)
        # About their mean, so that far from all samples the answer is that and not 0.
        self._mean = columns.mean(axis=0)
        gamma = _usual_gamma(samples) if self.gamma is None else self.gamma
        centred = np.ascontiguousarray(columns - self._mean, dtype=np.float32)
        self._map = Rbf(samples, centred, gamma=gamma, ridge=self.ridge)
        self.condition_ = self._map.condition
        return self

    def predict(self, X: ArrayLike) -> NDArray[np.float64]:
        """Targets, (n_samples,) or (n_samples, n_outputs), of samples (n_samples, n_features)."""
        check_is_fitted(self)
        samples = validate_data(self, X, dtype=np.float64, reset=False) - self._centre
        found = self._map.embed(np.ascontiguousarray(samples, dtype=np.float32)) + self._mean
        return found[:, 0] if self._flat else found

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.target_tags.multi_output = True
        return tags
