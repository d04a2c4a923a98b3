"""Focus stacks with images that do not belong to them."""

import pickle

import numpy as np
import pytest

import farnear


def blurred(times, seed=1):
    image = np.random.default_rng(seed).random((48, 64)).astype(np.float32)
    for _ in range(times):
        image = (image + np.roll(image, 1, 0) + np.roll(image, 1, 1) + np.roll(image, -1, 0) + np.roll(image, -1, 1)) / 5
    return image


@pytest.fixture
def images():
    """Eight images, the fourth in focus."""
    return [blurred(1 + 2 * abs(index - 3)) for index in range(8)]


def test_an_image_of_another_scene_is_left_out(images):
    good = farnear.focus_stack(images)
    assert good.left_out == [] and good.findings == []
    assert good.moved_px is None and farnear.focus_stack(images, align="shift").moved_px < 0.5
    images[1] = blurred(3, seed=2)
    found = farnear.focus_stack(images, focused_at_mm=[300 + 10 * index for index in range(8)])
    assert found.left_out == [1]
    assert any("left out images[1]: it shows another scene" in finding for finding in found.findings), found.findings
    assert np.nanmedian(found.depth) == pytest.approx(330, abs=3)
    # Without distances depth is the number of the image among all that were given.
    assert np.nanmedian(farnear.focus_stack(images).depth) == pytest.approx(4, abs=0.3)
    assert farnear.focus_stack(images, use_all=True).left_out == []


def test_a_wild_or_missing_value_costs_its_pixel(images):
    images[3][20, 30], images[4][40, 50] = 1e30, np.nan
    found = farnear.focus_stack(images)
    assert found.left_out == [] and np.isnan(found.depth[[20, 40], [30, 50]]).all()
    assert np.isfinite(found.depth[20, 31])
    images[2][10:20, 10:20] = np.nan
    with pytest.raises(farnear.FarnearError, match=r"images\[2\].*has no value"):
        farnear.calibrate_stack(images, step_mm=0.1)


def test_a_stack_is_pickled(images):
    images[1] = blurred(3, seed=2)
    found = farnear.focus_stack(images)
    copied = pickle.loads(pickle.dumps(found))
    for name in ("depth", "reliability", "all_in_focus"):
        assert np.array_equal(getattr(copied, name), getattr(found, name), equal_nan=True), name
    for name in ("unit", "moved_px", "left_out", "findings"):
        assert getattr(copied, name) == getattr(found, name), name


def test_rounding_to_codes_is_not_sharpness(images):
    codes = [np.rint(100 + 4 * image).astype(np.uint8) for image in images]
    values = [image / np.float32(255) for image in codes]
    of_codes, of_values = (farnear.focus_stack(stack, use_all=True).reliability for stack in (codes, values))
    assert of_codes.mean() < of_values.mean()


def test_a_map_with_few_depths_is_a_finding():
    """The first image is the sharpest: the focus lies at the end of the stack, or beyond it."""
    found = farnear.focus_stack([blurred(1 + 2 * index) for index in range(8)])
    assert any("only 0 % of the picture has a depth" in finding for finding in found.findings), found.findings
