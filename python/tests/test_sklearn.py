import numpy as np
import pytest

sklearn = pytest.importorskip("sklearn", minversion="1.6")

from sklearn.datasets import make_swiss_roll  # noqa: E402
from sklearn.manifold import Isomap as Reference  # noqa: E402
from sklearn.utils.estimator_checks import parametrize_with_checks  # noqa: E402

from farnear.sklearn import Isomap, RbfRegressor  # noqa: E402


@parametrize_with_checks([Isomap(), RbfRegressor()])
def test_estimators_are_scikit_learns(estimator, check):
    check(estimator)


def test_the_layout_is_that_of_scikit_learn():
    samples, _ = make_swiss_roll(300, random_state=1)
    samples = samples.astype(np.float32)
    ours = Isomap(n_neighbors=8).fit(samples)
    theirs = Reference(n_neighbors=8, n_components=2).fit(samples)
    for axis in range(2):
        found, expected = ours.embedding_[:, axis], theirs.embedding_[:, axis]
        # An axis may point either way; single precision and another choice among equally far neighbours remain.
        assert abs(np.corrcoef(found, expected)[0, 1]) > 0.999
    # New samples come to where their neighbours are.
    near = samples[:50] + np.float32(1e-3)
    assert np.abs(ours.transform(near) - ours.embedding_[:50]).max() < 0.1 * np.ptp(ours.embedding_)


def test_the_map_learns_a_function():
    random = np.random.default_rng(1)
    samples = random.uniform(-1, 1, (200, 2)).astype(np.float32)
    targets = np.column_stack([np.sin(2 * samples[:, 0]), samples[:, 0] * samples[:, 1]])
    model = RbfRegressor(gamma=2.0, ridge=1e-4).fit(samples[:150], targets[:150])
    assert model.score(samples[150:], targets[150:]) > 0.99
    assert model.condition_ > 1
