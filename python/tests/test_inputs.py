"""What scientists have in memory: masked arrays, any numeric type, results that travel and are stored."""

import copy
import multiprocessing
import os
import pickle
import signal
import threading
import time

import numpy as np
import pytest

import farnear
from farnear import _farnear
from farnear.recording import camera_matrix


@pytest.fixture(scope="module")
def found(optics, slant):
    return farnear.depth(slant[0], slant[1], optics)


def test_masked_pixels_have_no_depth(optics, slant):
    far, near, _ = slant
    hole = (slice(100, 140), slice(50, 90))
    for masked_image in ("far", "near"):
        images = {"far": far, "near": near}
        images[masked_image] = np.ma.masked_array(images[masked_image])
        images[masked_image][hole] = np.ma.masked
        found = farnear.depth(images["far"], images["near"], optics)
        assert np.isnan(found.depth_mm[hole]).all() and (found.confidence[hole] == 0).all()
        assert set(np.unique(found.reasons[hole])) == {9}
        depth_mm, _ = farnear.Processor(optics).run(images["far"], images["near"])
        assert np.isnan(depth_mm[hole]).all()
    # A mask of other functions counts too.
    depth = np.ma.masked_less(np.full((4, 6), 900.0), 0)
    depth[1, 2] = np.ma.masked
    points = farnear.points_mm(depth, optics)
    assert np.isnan(points[1, 2]).all() and np.isfinite(points[0, 0]).all()


@pytest.mark.parametrize("dtype", ["u1", "<u2", ">u2", "i2", ">i4", "u4", "i8", "u8", "f2", ">f4", "f8", ">f8", "longdouble"])
def test_every_numeric_type_and_byte_order_is_accepted(optics, slant, dtype):
    far, near, truth = slant
    found = farnear.depth(far.astype(dtype), near.astype(dtype), optics)
    error = (found.depth_mm - truth)[12:-12, 12:-12]
    assert np.sqrt(np.nanmean(error**2)) < 1.5
    depth_mm, _ = farnear.Processor(optics).run(far.astype(dtype), near.astype(dtype))
    assert np.isfinite(depth_mm).mean() > 0.9


def test_fields_of_packed_structures_are_read_as_their_copies(optics, found):
    packed = np.zeros(found.depth_mm.shape, dtype=[("depth", "<f4"), ("valid", "u1")])
    packed["depth"] = found.depth_mm
    field = packed["depth"]
    assert not field.flags.aligned
    np.testing.assert_array_equal(farnear.points_mm(field, optics), farnear.points_mm(field.copy(), optics))
    packed["depth"] = np.random.default_rng(1).random(field.shape)
    samples, targets = field[:30, :6], field[:30, 6:8]
    laid = [_farnear.isomap(given, neighbours=10)[0] for given in (samples, samples.copy())]
    np.testing.assert_array_equal(*laid)
    maps = [_farnear.Rbf(*given, gamma=1.0) for given in ((samples, targets), (samples.copy(), targets.copy()))]
    np.testing.assert_array_equal(maps[0].embed(samples), maps[1].embed(samples.copy()))


def test_types_without_an_order_are_refused_by_the_name_of_the_argument(optics, slant):
    far, near, _ = slant
    with pytest.raises(TypeError, match="near.*complex"):
        farnear.depth(far, near.astype(complex), optics)
    with pytest.raises(TypeError, match="far.*bool"):
        farnear.depth(far > 0, near, optics)
    with pytest.raises(TypeError, match="optics.*farnear.Optics"):
        farnear.depth(far, near, "optics.toml")
    with pytest.raises(TypeError, match="depth_mm.*list"):
        farnear.points_mm([[900.0]], optics)
    with pytest.raises(TypeError, match=r"pairs\[1\]\[0\]"):
        farnear.calibrate_psf([(far, near, 900.0), (None, near, 900.0)], optics)
    with pytest.raises(TypeError, match=r"images\[2\]"):
        farnear.focus_stack([far, near, "third"])


@pytest.mark.parametrize("value", [2, -0.1, float("nan")])
def test_a_confidence_outside_0_to_1_is_refused(optics, slant, value):
    with pytest.raises(farnear.FarnearError, match="min_confidence.*0 to 1"):
        farnear.depth(slant[0], slant[1], optics, min_confidence=value)


def same(first, second):
    for name in ("depth_mm", "confidence", "deviation_mm", "reasons"):
        assert np.array_equal(getattr(first, name), getattr(second, name), equal_nan=True), name
    assert first.findings == second.findings and first.optics == second.optics
    assert first.valid_fraction == pytest.approx(second.valid_fraction, abs=1e-6)


def test_a_depth_map_is_pickled_copied_saved_and_loaded(found, tmp_path):
    same(pickle.loads(pickle.dumps(found)), found)
    deep = copy.deepcopy(found)
    same(deep, found)
    deep.depth_mm[0, 0] = 1.0
    assert found.depth_mm[0, 0] != 1.0, "a deep copy owns its arrays"
    found.save(tmp_path / "result")
    same(farnear.DepthMap.load(tmp_path / "result"), found)


def test_a_map_of_a_region_keeps_its_place(optics, slant, tmp_path):
    place = (slice(10, 110), slice(200, 300))
    farnear.depth(slant[0][place], slant[1][place], optics).save(tmp_path / "region")
    with open(tmp_path / "region" / "depth.toml", "a") as record:  # as `farnear depth --region` writes it
        record.write("\n[part]\nx = 200\ny = 10\nimage_width = 320\nimage_height = 240\n")
    region = farnear.DepthMap.load(tmp_path / "region")
    assert region.part == (200, 10, 320, 240)
    region.save(tmp_path / "again")
    for copied in (farnear.DepthMap.load(tmp_path / "again"), pickle.loads(pickle.dumps(region))):
        assert copied.part == region.part
    depth_mm = np.full((240, 320), np.nan, np.float32)
    depth_mm[place] = region.depth_mm
    points = farnear.points_mm(region.depth_mm, optics, part=region.part)
    np.testing.assert_array_equal(points, farnear.points_mm(depth_mm, optics)[place])
    for part in ((221, 10, 320, 240), (200, 10, 320, 109), (2**63, 10, 320, 240)):
        with pytest.raises(farnear.FarnearError, match="map of 100x100 px"):
            farnear.points_mm(region.depth_mm, optics, part=part)
    whole = farnear.DepthMap._assemble(depth_mm, depth_mm, depth_mm, np.zeros((240, 320), np.uint8), [], 1.0, optics)
    assert whole.part is None
    for name in ("slope_x", "slope_y", "tilt_deg"):
        expected = getattr(whole.plane((200, 10, 100, 100)), name)
        assert getattr(region.plane(), name) == pytest.approx(expected, rel=1e-6), name
    assert camera_matrix(region)[2] == camera_matrix(whole)[2] - 200 and camera_matrix(region)[5] == camera_matrix(whole)[5] - 10


def test_a_map_of_averaged_pixels_keeps_its_axis(optics, tmp_path):
    far, near, _ = farnear.render(optics, "slant", width=323, height=242, seed=2)
    found = farnear.depth(far, near, optics, bin=4)
    assert found.depth_mm.shape == (60, 80) and found.part == (0, 0, 323, 242, 4)
    found.save(tmp_path / "result")
    for same_map in (found, farnear.DepthMap.load(tmp_path / "result"), pickle.loads(pickle.dumps(found))):
        assert same_map.part == found.part
        # Column 161 is the middle of 323; a column of four has its middle 1.5 columns further.
        assert camera_matrix(same_map)[2] == (161 - 1.5) / 4 and camera_matrix(same_map)[5] == (120.5 - 1.5) / 4
    points = farnear.points_mm(np.full((60, 80), 900.0), found.optics, part=found.part)
    step_mm = 4 * 7.4e-3 * 850 / 50
    assert points[10, 40, 0] == pytest.approx((40 - 39.875) * step_mm, rel=1e-4)
    assert farnear.depth(far[:240, :320], near[:240, :320], optics, bin=4).part is None
    with pytest.raises(farnear.FarnearError, match="at least 1"):
        farnear.points_mm(found.depth_mm, optics, part=(0, 0, 323, 242, 0))


def test_the_axis_is_the_centre_of_the_distortion(optics):
    distortion = "[distortion]\ncamera_matrix = [[6700.0, 0, 30.5], [0, 6700.0, 20.0], [0, 0, 1]]\ncoefficients = [0.0, 0.0, 0.0, 0.0]\n"
    off_centre = farnear.Optics.loads(f"{optics.dumps()}\n{distortion}")
    points = farnear.points_mm(np.full((40, 64), 900.0), off_centre)
    assert points[20, 30, 0] < 0 < points[20, 31, 0] and points[20, 30, 1] == 0


def test_a_folder_that_is_no_result_is_named(tmp_path, found):
    with pytest.raises(FileNotFoundError):
        farnear.DepthMap.load(tmp_path)
    (tmp_path / "depth.toml").write_text("[nothing]")
    with pytest.raises(farnear.FarnearError, match="depth.toml"):
        farnear.DepthMap.load(tmp_path)
    found.save(tmp_path)
    (tmp_path / "depth.npy").unlink()
    with pytest.raises(farnear.FarnearError, match="neither depth.npy nor depth.tiff"):
        farnear.DepthMap.load(tmp_path)
    found.save(tmp_path)
    np.save(tmp_path / "confidence.npy", np.zeros((3, 4), np.float32))
    with pytest.raises(farnear.FarnearError, match="confidence.npy"):
        farnear.DepthMap.load(tmp_path)


def test_two_threads_share_a_processor(optics, slant):
    far, near, _ = slant
    processor = farnear.Processor(optics)
    alone = [processor.run(far, near)[0], processor.run(near, far)[0]]
    results, errors = {0: [], 1: []}, []

    def work(which):
        try:
            for _ in range(20):
                results[which].append(processor.run(*((far, near) if which == 0 else (near, far)))[0])
        except BaseException as error:
            errors.append(error)

    threads = [threading.Thread(target=work, args=(which,)) for which in (0, 1)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not errors
    for which in (0, 1):
        assert all(np.array_equal(map_mm, alone[which], equal_nan=True) for map_mm in results[which])


@pytest.mark.parametrize("model", ["gaussian", "generalised", "free"])
def test_optics_accept_a_calibrated_point_spread_function(optics, model):
    pairs = [(*farnear.render(optics, f"plane:{mm}", width=320, height=240, seed=mm)[:2], float(mm)) for mm in (932, 888)]
    fit = farnear.calibrate_psf(pairs, optics, model=model)
    again = farnear.Optics(
        focal_length_mm=50, aperture_mm=12.8, pixel_um=7.4, far_mm=933, max_blur_px=2.703, psf=fit.psf
    )
    assert again.psf == fit.psf == fit.optics.psf
    assert fit.verdict in ("good", "loose") and abs(fit.k - 0.4578) < 0.01
    assert bool(fit.findings) == (fit.verdict != "good"), fit.findings
    assert 0 < fit.standard_error_k < 0.02 and 0 <= fit.residual < 0.1
    assert (fit.standard_error_p is not None) == (model == "generalised")
    assert bool(fit.otf) == (model == "free")
    copied = pickle.loads(pickle.dumps(fit))
    assert copied.optics == fit.optics and (copied.psf, copied.verdict, copied.k) == (fit.psf, fit.verdict, fit.k)
    assert copied.findings == fit.findings
    for name in ("standard_error_k", "standard_error_p", "residual", "noise_residual", "alphas", "otf"):
        assert getattr(copied, name) == getattr(fit, name), name
    assert np.isfinite(farnear.depth(*pairs[0][:2], fit.optics).depth_mm).mean() > 0.8


def test_a_plane_is_measured(optics):
    far, near, _ = farnear.render(optics, "plane:910", width=160, height=120)
    plane = farnear.depth(far, near, optics).plane()
    assert plane.z_mm == pytest.approx(910, abs=0.5) and plane.tilt_deg < 3 and 0 < plane.rms_mm < 2
    copied = copy.deepcopy(plane)
    for name in ("z_mm", "slope_x", "slope_y", "tilt_deg", "rms_mm", "peak_to_valley_mm"):
        assert getattr(copied, name) == getattr(plane, name), name
    with pytest.raises(farnear.FarnearError, match="160x120"):
        farnear.depth(far, near, optics).plane((150, 0, 20, 20))
    with pytest.raises(farnear.FarnearError, match=r"region \(18446744073709551615, 0, 20, 20\) is too large"):
        farnear.depth(far, near, optics).plane((2**64 - 1, 0, 20, 20))


def test_a_focus_stack_has_its_distances(optics):
    rng = np.random.default_rng(1)
    texture = rng.random((48, 64)).astype(np.float32)

    def blurred(times):
        image = texture
        for _ in range(times):
            image = (image + np.roll(image, 1, 0) + np.roll(image, 1, 1) + np.roll(image, -1, 0) + np.roll(image, -1, 1)) / 5
        return image

    stack = farnear.focus_stack(
        [blurred(abs(i - 3) * 2) for i in range(7)], focused_at_mm=[300, 310, 320, 330, 340, 350, 360], guided_px=0
    )
    assert stack.unit == "mm" and stack.depth.shape == (48, 64)
    assert np.nanmedian(stack.depth) == pytest.approx(330, abs=3)
    assert farnear.focus_stack([blurred(2), blurred(0), blurred(2)], align="shift").unit == "image"
    for settings, match in [
        ({"focused_at_mm": [1, 2]}, "2 distances for 3"),
        ({"focused_at_mm": [3, 2, 4]}, "ascend"),
        ({"focused_at_mm": [1, -2, 3]}, "-2"),
        ({"min_reliability": 1.5}, "0 to 1"),
        ({"align": "sideways"}, "similarity"),
    ]:
        with pytest.raises(farnear.FarnearError, match=match):
            farnear.focus_stack([texture] * 3, **settings)


def test_notebooks_show_maps(found):
    pyplot = pytest.importorskip("matplotlib.pyplot")
    pyplot.switch_backend("Agg")
    assert found._repr_html_().startswith("<figure><img")
    axes = found.plot()
    assert axes.images[0].get_array().shape == found.depth_mm.shape
    pyplot.close("all")


def test_maps_go_to_xarray_and_come_from_it(found, optics, slant):
    xarray = pytest.importorskip("xarray")
    data = found.to_xarray()
    assert data["depth"].attrs["units"] == "mm" and data["depth"].dims == ("row", "column")
    maps = (found.depth_mm, found.confidence, found.deviation_mm, found.reasons)
    height, width = found.depth_mm.shape
    part = (200, 10, width + 300, height + 20)
    region = farnear.DepthMap._assemble(*maps, found.findings, found.valid_fraction, optics, part)
    assert region.to_xarray().attrs["part"] == part and "part" not in data.attrs
    again = farnear.depth(xarray.DataArray(slant[0]), xarray.DataArray(slant[1]), optics)
    assert np.array_equal(again.depth_mm, found.depth_mm, equal_nan=True)


def test_pixels_from_the_white_level_on_are_saturated(optics, slant):
    far, near, _ = slant
    codes = [np.clip(np.rint(image * 3000), 0, 4095).astype(np.uint16) for image in (far / far.max(), near / near.max())]
    clipped = (slice(100, 140), slice(50, 90))
    for image in codes:
        image[clipped] = 4095
    found = farnear.depth(*codes, optics, white_level=4095)
    saturated = [code for code, words in farnear.DepthMap.reason_words.items() if "saturated" in words]
    assert np.isin(found.reasons[105:135, 55:85], saturated).all()
    for white_level in (0, 70_000):
        with pytest.raises(farnear.FarnearError, match="expected 1 to 65535"):
            farnear.depth(*codes, optics, white_level=white_level)
    with pytest.raises(farnear.FarnearError, match="uint8 or uint16"):
        farnear.depth(*(image.astype(np.float32) for image in codes), optics, white_level=4095)


def test_a_lens_is_calibrated_from_a_stack_and_measures_its_pairs():
    # A flat target; the radius of a Gaussian blur grows by 0.25 px per slice of 0.05 mm.
    random = np.random.default_rng(1)
    rows, columns = np.fft.fftfreq(240)[:, None], np.fft.rfftfreq(320)
    squared = rows**2 + columns**2
    texture = np.fft.rfft2(random.standard_normal((240, 320))) / (squared + 0.002) ** 0.5
    texture *= 30 / np.std(np.fft.irfft2(texture, (240, 320)))
    slices = []
    for index in range(41):
        sigma_px = 0.4 + 0.25 * abs(index - 20)
        image = np.fft.irfft2(texture * np.exp(-2 * (np.pi * sigma_px) ** 2 * squared), (240, 320))
        slices.append(np.clip(image + 128 + random.standard_normal((240, 320)), 0, 255).round().astype(np.uint8))
    fit = farnear.calibrate_stack(slices, step_mm=0.05, far_mm=100)
    assert fit.fill > 0.9 and abs(fit.slope - 1) < 0.1, fit
    depth, bias, rms, predicted = fit.by_depth.T
    assert np.all(np.diff(depth) > 0) and np.all(np.abs(bias) <= rms) and np.all(predicted > 0), fit.by_depth
    measured, true = fit.response.T
    assert np.all(np.diff(measured) > 0) and np.all(np.diff(true) >= 0) and true[0] < -0.5 and true[-1] > 0.5, fit.response
    copied = pickle.loads(pickle.dumps(fit))
    assert copied.optics == fit.optics and (copied.verdict, copied.findings) == (fit.verdict, fit.findings)
    for name in ("pair_step", "bin", "robust_mm", "rms_mm", "bias_mm", "slope", "fill", "within_three", "by_depth", "response"):
        assert np.array_equal(getattr(copied, name), getattr(fit, name), equal_nan=True), name
    assert fit.findings == []
    curved = [np.round(255 * (image / 255) ** (1 / 2.2)).astype(np.uint8) for image in slices[12:29]]
    findings = farnear.calibrate_stack(curved, step_mm=0.05, pair_step=4, bin=1).findings
    assert any("not linear in light" in finding for finding in findings), findings
    first = 20 - fit.pair_step // 2
    found = farnear.depth(slices[first], slices[first + fit.pair_step], fit.optics, method="whitened")
    # The target is in focus at slice 20: so many steps nearer than the far plane. Within a third of a step.
    assert np.nanmedian(found.depth_mm) == pytest.approx(100 - 0.05 * (20 - first), abs=0.017)
    assert not any("320x240" in finding for finding in found.findings)
    upper = farnear.depth(slices[first][:120], slices[first + fit.pair_step][:120], fit.optics, method="whitened")
    assert any("320x240 px, these have 320x120" in finding for finding in upper.findings), upper.findings
    # Without the size of a pixel at the target only depth is in mm.
    plane = found.plane()
    assert np.isnan(plane.tilt_deg) and abs(plane.slope_x) < 0.01
    # As of a microscope.
    flat = farnear.Plane._assemble(4.586184, 0.0, 0.0, 0.0, 2.936e-6, 1.4e-5)
    assert repr(flat) == "Plane(4.586184 mm, tilt 0.000 deg, rms 0.00000294 mm)", flat
    with pytest.raises(farnear.FarnearError, match="object-pixel-um"):
        farnear.points_mm(found.depth_mm, fit.optics)
    with pytest.raises(farnear.FarnearError, match="2 slices"):
        farnear.calibrate_stack(slices[:2], step_mm=0.1)


def _flat_pairs(optics):
    far, near, _ = farnear.render(optics, "plane:931", width=320, height=240)
    return [(far, near, 931.0)] * 80


def _flat_maps(_):
    random = np.random.default_rng(1)
    return [(random.normal(mm, 0.1, (480, 640)).astype(np.float32), mm) for mm in np.linspace(890, 930, 30)]


def _samples(_):
    return np.random.default_rng(1).random((5000, 360), np.float32)


LONG = {
    "calibrate_psf": (_flat_pairs, lambda pairs, optics: farnear.calibrate_psf(pairs, optics, model="free")),
    "Correction.fit": (_flat_maps, lambda maps, _: farnear.Correction.fit(maps, method="cdc")),
    "isomap": (_samples, lambda samples, _: _farnear.isomap(samples, neighbours=10)),
}


@pytest.mark.parametrize("name", LONG)
def test_ctrl_c_ends_a_long_calculation(optics, name):
    prepare, calculate = LONG[name]
    given = prepare(optics)
    # A process in the background of a script ignores it.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        interrupt = threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT))
        begin = time.monotonic()
        interrupt.start()
        with pytest.raises(KeyboardInterrupt):
            calculate(given, optics)
        # The whole calculation takes far longer.
        assert time.monotonic() - begin < 3.0
    finally:
        interrupt.cancel()
        signal.signal(signal.SIGINT, before)


def _median_mm(far, near, optics):
    return float(np.nanmedian(farnear.depth(far, near, optics).depth_mm))


def _saved_median_mm(far, near, optics, folder):
    found = farnear.depth(far, near, optics)
    found.save(folder)
    assert found._repr_html_()
    return float(np.nanmedian(farnear.DepthMap.load(folder).depth_mm))


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="this system has no fork")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_child_by_fork_has_threads_of_its_own(optics, slant, tmp_path):
    pair = (*slant[:2], optics)
    expected = _median_mm(*pair)
    with multiprocessing.get_context("fork").Pool(2) as pool:
        arguments = [(*pair, tmp_path / name) for name in ("first", "second")]
        assert pool.starmap_async(_saved_median_mm, arguments).get(timeout=60) == [expected] * 2


def test_images_of_different_scales_are_refused(optics, slant):
    far, near, _ = slant
    for other, kind in [(near.astype("f4"), "other numbers"), (near.astype("u2"), "uint16")]:
        with pytest.raises(farnear.FarnearError, match=f"far holds uint8 and near {kind}.*scales differ"):
            farnear.depth(far, other, optics)
        with pytest.raises(farnear.FarnearError, match="scales differ"):
            farnear.Processor(optics).run(far, other)
        with pytest.raises(farnear.FarnearError, match=rf"images\[2\] {kind}.*scales differ"):
            farnear.focus_stack([far, near, other])
        with pytest.raises(farnear.FarnearError, match=rf"images\[2\] {kind}.*scales differ"):
            farnear.calibrate_stack([far, near, other], step_mm=0.1)
        with pytest.raises(farnear.FarnearError, match=rf"pairs\[0\]\[1\] {kind}.*scales differ"):
            farnear.calibrate_psf([(far, other, 900.0)], optics)


@pytest.mark.parametrize("distance_mm", [0.0, 50.0, -900.0, float("nan")])
def test_a_target_inside_the_focal_length_is_refused(optics, slant, distance_mm):
    with pytest.raises(farnear.FarnearError, match=r"pairs\[0\]\[2\].*focal length of 50 mm"):
        farnear.calibrate_psf([(*slant[:2], distance_mm)], optics)


def test_a_processor_refuses_optics_that_were_learned_for_another_method(learned, slant):
    for use in (lambda: farnear.Processor(learned), lambda: farnear.depth(*slant[:2], learned, method="ro")):
        with pytest.raises(farnear.FarnearError, match="learned by calibrate stack for method whitened") as refused:
            use()
        assert "--" not in str(refused.value), "an option of the command line"


def test_a_processor_refuses_optics_with_a_distortion(optics):
    distortion = "[distortion]\ncamera_matrix = [[400, 0, 159.5], [0, 400, 119.5], [0, 0, 1]]\ncoefficients = [-0.3, 0.1, 0.0, 0.0]\n"
    with pytest.raises(farnear.FarnearError, match="distortion.*use farnear.depth"):
        farnear.Processor(farnear.Optics.loads(f"{optics.dumps()}\n{distortion}"))


def test_optics_in_another_unit_are_a_finding(optics, slant):
    settings = {"focal_length_mm": 50, "aperture_mm": 12.8, "far_mm": 933, "max_blur_px": 2.703, "psf": optics.psf}
    findings = farnear.depth(*slant[:2], farnear.Optics(pixel_um=0.0074, **settings)).findings
    assert any("pixel_um is 0.0074 um" in finding and "another unit" in finding for finding in findings), findings


def test_optics_whose_file_names_no_psf_are_a_finding(optics, slant):
    unnamed = farnear.Optics.loads(optics.dumps().partition("[psf]")[0])
    for found in (unnamed, farnear.Optics.loads(unnamed.dumps()), pickle.loads(pickle.dumps(unnamed))):
        findings = farnear.depth(*slant[:2], found).findings
        assert any("no [psf]: a pill-box is assumed" in finding for finding in findings), findings
    assert unnamed == farnear.Optics.loads(unnamed.dumps() + '[psf]\nmodel = "pillbox"\n')


def test_a_blur_that_is_too_large_is_a_finding(optics):
    wide = farnear.Optics(focal_length_mm=50, aperture_mm=12.8, pixel_um=7.4, far_mm=933, max_blur_px=5, psf=optics.psf)
    far, near, _ = farnear.render(wide, "slant", width=160, height=120)
    findings = farnear.depth(far, near, wide).findings
    assert any("average 2 x 2 pixels" in finding for finding in findings), findings


def test_pixels_are_averaged_on_request(optics, learned):
    wide = farnear.Optics(focal_length_mm=50, aperture_mm=12.8, pixel_um=7.4, far_mm=933, max_blur_px=5, psf=optics.psf)
    far, near, _ = farnear.render(wide, "slant", width=160, height=120)
    found = farnear.depth(far, near, wide, bin="auto")
    assert found.depth_mm.shape == (60, 80) and found.optics.max_blur_px == pytest.approx(2.5)
    assert np.array_equal(found.depth_mm, farnear.depth(far, near, wide, bin=2).depth_mm, equal_nan=True)
    for side in (0, 17, "2"):
        with pytest.raises(farnear.FarnearError, match="expected 1 to 16"):
            farnear.depth(far, near, wide, bin=side)
    with pytest.raises(farnear.FarnearError, match="give no bin"):
        farnear.depth(far, near, learned, bin=2)


def test_a_white_level_saturates_brighter_pixels(optics, slant):
    far, near, _ = slant
    white = int(np.percentile(far, 99))
    found = farnear.depth(far, near, optics, white_level=white)
    clipped = farnear.depth(np.minimum(far, white), np.minimum(near, white), optics, white_level=white)
    np.testing.assert_array_equal(found.depth_mm, clipped.depth_mm)
    masked = np.ma.masked_array(far)
    masked[100:140, 50:90] = np.ma.masked
    reasons = farnear.depth(masked, near, optics, white_level=white).reasons
    assert set(np.unique(reasons[105:135, 55:85])) == {9}


def test_missing_files_are_named(tmp_path):
    for load in (farnear.DepthMap.load, farnear.Correction.load, farnear.Optics.load):
        with pytest.raises(FileNotFoundError, match="missing"):
            load(tmp_path / "missing")


def test_arguments_without_a_meaning_are_refused():
    with pytest.raises(farnear.FarnearError, match="azimuth_deg"):
        farnear.synthetic_masks("walk", azimuth_deg=float("nan"))
    with pytest.raises(farnear.FarnearError, match="among"):
        farnear.Recogniser().recognise(farnear.synthetic_masks("walk"), among=[])
