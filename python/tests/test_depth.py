import pickle
import threading
import time

import numpy as np
import pytest

import farnear


def inside(array, margin=12):
    return array[margin:-margin, margin:-margin]


def test_depth_of_a_slant_is_its_depth(optics, slant):
    far, near, truth = slant
    found = farnear.depth(far, near, optics)
    assert found.depth_mm.shape == far.shape and found.depth_mm.dtype == np.float32
    error = inside(found.depth_mm - truth)
    # What docs/accuracy.md has for planes at 8 bit is 0.7 mm; a quarter of the pixels and the slant's edges here.
    assert np.sqrt(np.nanmean(error**2)) < 1.2
    assert found.valid_fraction > 0.95
    valid = np.isfinite(found.depth_mm)
    assert np.array_equal(found.reasons == 0, valid)
    assert np.all(found.confidence[~valid] == 0) and np.all(found.confidence[valid] > 0)
    # The deviation says how large errors are: nearly all lie within three of it.
    z = inside(np.abs(found.depth_mm - truth) / found.deviation_mm)
    assert np.nanmean(z < 3) > 0.9


def test_a_tone_curve_is_found(optics, slant):
    curved = [(image / 255) ** (1 / 2.2) for image in slant[:2]]
    findings = farnear.depth(*curved, optics).findings
    assert any("not linear in light" in finding for finding in findings), findings


def test_methods_agree(optics, slant):
    far, near, truth = slant
    for method in ["whitened", "subbarao"]:
        error = inside(farnear.depth(far, near, optics, method=method).depth_mm - truth)
        assert np.nanmedian(np.abs(error)) < 3, method
    windows = [farnear.depth(far, near, optics, window=window).depth_mm for window in (7, 21, "adaptive")]
    spread = [np.nanstd(inside(window - truth)) for window in windows]
    assert spread[1] < spread[0]


def test_what_has_no_texture_is_filled_as_is_asked(optics, slant):
    far, near, _ = (image.copy() for image in slant)
    for image in (far, near):
        image[90:150, 130:190] = 128
    hole = (slice(105, 135), slice(145, 175))
    maps = {}
    for fill, low_texture in [(False, "energy"), (True, "energy"), ("surface", "energy"), ("thesis", "variance:0.00001")]:
        maps[fill] = farnear.depth(far, near, optics, fill=fill, low_texture=low_texture).depth_mm
    assert np.isnan(maps[False][hole]).all() and np.isfinite(maps[True][hole]).all()
    assert np.array_equal(maps[True], maps["surface"], equal_nan=True)
    assert np.isfinite(maps["thesis"][hole]).all()
    assert not np.array_equal(maps["thesis"], maps["surface"], equal_nan=True)
    # The bare run time takes the same words.
    far, near = (image.astype(np.float32) for image in (far, near))
    ways = [farnear.Processor(optics, fill=fill).run(far, near)[0] for fill in ("surface", "thesis")]
    assert not np.array_equal(*ways, equal_nan=True)
    for settings, error, match in [
        ({"fill": "magic"}, farnear.FarnearError, "magic"),
        ({"fill": 0.5}, TypeError, "surface"),
        ({"fill": True, "low_texture": "dull"}, farnear.FarnearError, "dull.*variance:T"),
        ({"low_texture": "variance"}, farnear.FarnearError, "fill=True"),
    ]:
        with pytest.raises(error, match=match):
            farnear.depth(far, near, optics, **settings)
        with pytest.raises(error, match=match):
            farnear.Processor(optics, **settings)


def test_kinds_of_images_give_one_map(optics, slant):
    far, near, _ = slant
    bytes_ = farnear.depth(far, near, optics).depth_mm
    words = farnear.depth(far.astype(np.uint16) * 257, near.astype(np.uint16) * 257, optics).depth_mm
    assert np.array_equal(bytes_, words, equal_nan=True)
    floats = farnear.depth(*((image / np.float32(255)).astype(np.float32) for image in (far, near)), optics).depth_mm
    doubles = farnear.depth(far / 255.0, near / 255.0, optics).depth_mm
    assert np.nanmax(np.abs(floats - doubles)) < 1e-3
    # Views are taken as they are.
    turned = farnear.depth(np.asfortranarray(far), near[:, ::-1][:, ::-1], optics).depth_mm
    assert np.array_equal(bytes_, turned, equal_nan=True)


def test_what_is_no_pair_is_refused(optics, slant):
    far, near, _ = slant
    for images, error, match in [
        ((far, near[1:]), farnear.FarnearError, "one size"),
        ((far, far), farnear.FarnearError, "the same image"),
        ((far, near / 255.0), farnear.FarnearError, "scales differ"),
        ((far, np.zeros_like(near)), farnear.FarnearError, "constant"),
        ((far, near.astype(str)), TypeError, "near.*floating point"),
        ((far, [[1, 2], [3, 4]]), TypeError, "list"),
        ((far[None], near[None]), TypeError, "3 dimensions"),
        ((far[:8], near[:8]), farnear.FarnearError, "too small"),
    ]:
        with pytest.raises(error, match=match):
            farnear.depth(*images, optics)
    wider = farnear.Optics(focal_length_mm=50, f_number=4, pixel_um=7.4, far_mm=933, max_blur_px=5, psf=optics.psf)
    other = farnear.Operators(wider)
    for settings, match in [
        ({"method": "magic"}, "magic.*whitened"),
        ({"window": 8}, "window is 8; expected adaptive or an odd number"),
        ({"window": "big"}, "window is big; expected adaptive"),
        ({"operators": other}, "largest blur"),
        ({"operators": other, "method": "whitened"}, "no operators"),
        ({"align": "sideways"}, "align is sideways; expected one of.*similarity"),
        ({"balance": "y"}, "balance is y; expected one of.*local"),
    ]:
        with pytest.raises(farnear.FarnearError, match=match):
            farnear.depth(far, near, optics, **settings)


def test_a_processor_gives_what_one_pair_gives(optics, slant):
    far, near, truth = slant
    far, near = (image.astype(np.float32) for image in (far, near))
    processor = farnear.Processor(optics)
    depth_mm, confidence = processor.run(far, near)
    kept = depth_mm.copy()
    swapped, _ = processor.run(near, far)
    assert np.array_equal(depth_mm, kept), "the map of the pair before is its owner's"
    assert not np.array_equal(swapped, kept, equal_nan=True)
    assert np.nanmedian(np.abs(inside(depth_mm - truth))) < 1
    assert confidence.min() >= 0 and confidence.max() <= 1


def test_other_threads_run_meanwhile(optics):
    far, near, _ = farnear.render(optics, "slant", width=640, height=480)
    counts = []

    def count():
        while not done.is_set():
            counts.append(time.perf_counter())
            time.sleep(1e-3)

    done = threading.Event()
    thread = threading.Thread(target=count)
    thread.start()
    begin = time.perf_counter()
    farnear.depth(far, near, optics)
    end = time.perf_counter()
    done.set()
    thread.join()
    # With the interpreter held, none would have come between.
    assert sum(begin < when < end for when in counts) >= 3


def test_corrections_take_a_bowl_away(tmp_path):
    rows, columns = np.mgrid[-1:1:60j, -1:1:80j].astype(np.float32)
    bowl = 2 * (rows**2 + columns**2)
    trues = [932.0, 923.0, 914.0, 905.0, 896.0, 888.0]
    targets = [(true + bowl, true) for true in trues]
    for method in ["clsf", "spline"]:
        correction = farnear.Correction.fit(targets, method=method)
        assert correction.method == method and correction.shape == (60, 80)
        assert correction.range_mm == (932.0, 888.0)
        corrected = correction.apply(910 + bowl)
        assert corrected.std() < 0.2 < bowl.std(), method
        file = tmp_path / "correction.toml"
        file.write_text(correction.dumps())
        assert np.array_equal(farnear.Correction.load(file).apply(910 + bowl), corrected)
    with pytest.raises(farnear.FarnearError, match=r"0.932 of patterns\[0\].*in mm"):
        farnear.Correction.fit([(depth, true / 1000) for depth, true in targets], method="clsf")
    with pytest.raises(farnear.FarnearError, match="4"):
        farnear.Correction.fit(targets[:2], method="clsf")
    with pytest.raises(farnear.FarnearError, match="60"):
        correction.apply(np.zeros((4, 4), np.float32))


def test_a_target_unlike_the_others_is_a_finding():
    random = np.random.default_rng(1)
    targets = [(true + random.normal(0, 0.1, (60, 80)), true) for true in np.linspace(932, 888, 24)]
    assert farnear.Correction.fit(targets, method="clsf").findings == []
    targets[7] = (targets[7][0], targets[7][1] - 9)
    found = farnear.Correction.fit(targets, method="clsf")
    assert len(found.findings) == 1 and found.findings[0].startswith("patterns[7]: an error of"), found.findings
    assert pickle.loads(pickle.dumps(found)).findings == found.findings


def test_rendering_repeats(optics):
    first = farnear.render(optics, "cone,texture=fractal", width=64, height=48, noise="12bit", seed=3)
    again = farnear.render(optics, "cone,texture=fractal", width=64, height=48, noise="12bit", seed=3)
    assert all(np.array_equal(a, b) for a, b in zip(first, again))
    assert first[0].dtype == np.uint16 and first[2].dtype == np.float32
    assert not np.array_equal(first[0], farnear.render(optics, "cone", width=64, height=48, noise="12bit", seed=4)[0])
    with pytest.raises(farnear.FarnearError, match="staircase"):
        farnear.render(optics, "castle")


@pytest.mark.parametrize("scene", ["slant", "cone", "staircase", "sphere"])
def test_a_good_pair_has_no_warning(optics, scene):
    far, near, _ = farnear.render(optics, scene, width=320, height=240, seed=2)
    assert farnear.depth(far, near, optics).findings == []


def test_a_lens_with_little_blur_is_doubted():
    little = farnear.Optics(focal_length_mm=50, aperture_mm=12.8, pixel_um=7.4, far_mm=933, max_blur_px=1.0, psf="gaussian:k=0.4578")
    far, near, _ = farnear.render(little, "slant", width=160, height=120)
    assert any("a largest blur of 1.00 px" in finding for finding in farnear.depth(far, near, little).findings)
    operators = farnear.Operators(little)
    findings = farnear.depth(far, near, little, operators=operators, bin="auto").findings
    assert any("a largest blur of 1.00 px" in finding for finding in findings), findings
