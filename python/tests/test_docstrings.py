"""Every public object has documentation at run time, with shapes and units where it takes or returns arrays and lengths."""

import doctest
import importlib
import importlib.util
import inspect
from pathlib import Path

import numpy as np
import pytest

import farnear

PUBLIC = [name for name in farnear.__all__ if name != "__version__"]
# Arrays and physical quantities are documented by shape and unit; these objects have neither.
WITHOUT_SHAPES = {"FarnearError", "RigError", "Operators", "Recogniser", "Optics", "Plane", "PsfFit", "sun_position"}
SHAPES = ("(height, width", "(frames, height", "(n, features)", "(n, 4)", "(360,)")
UNITS = ("mm", "px", "degree", "0 to 1", "um")


@pytest.mark.parametrize("name", PUBLIC)
def test_public_objects_state_shapes_and_units(name):
    doc = inspect.getdoc(getattr(farnear, name))
    assert doc and len(doc) > 20, name
    if name not in {"FarnearError", "RigError", "Recogniser"}:
        assert any(unit in doc for unit in UNITS), f"{name} states no unit"
    if name not in WITHOUT_SHAPES:
        text = doc + str(getattr(getattr(farnear, name), "run", None) and inspect.getdoc(getattr(farnear, name).run))
        text += str(getattr(getattr(farnear, name), "fit", None) and inspect.getdoc(getattr(farnear, name).fit))
        assert any(shape in text for shape in SHAPES), f"{name} states no shape"


@pytest.mark.parametrize("name", [name for name in PUBLIC if inspect.isclass(getattr(farnear, name))])
def test_members_are_documented(name):
    found = getattr(farnear, name)
    listed = "Attributes\n" in (inspect.getdoc(found) or "")
    for member in vars(found):
        if member.startswith("_") or member in {"add_note", "with_traceback", "args", "reason_words"}:
            continue
        documented = bool(inspect.getdoc(getattr(found, member)))
        assert documented or (listed and member in inspect.getdoc(found)), f"{name}.{member}"


# Modules in Python, and what `help()` must state.
IMAGE, SAMPLES = "(height, width)", "(n_samples, n_features)"
STATED = {
    "recording": {"McapRecording": ("32FC1, m",), "McapRecording.add": (IMAGE, "ns")},
    "results": {"plot": ("mm",), "to_xarray": ("mm", "px")},
    "rig": {
        "EmulatedRig": ("mm",),
        "Exposure": (IMAGE, "_um", "_us"),
        "Rig": ("um",),
        "Rig.capture_pair": (IMAGE, "ms", "wait_s"),
        "Rig.expose": (IMAGE, "um", "ms"),
        "Rig.home": ("um",),
        "Rig.info": ("um", "ms"),
        "Rig.move": ("um",),
        "Rig.run_sequence": (IMAGE, "um", "ms"),
        "Rig.status": ("um",),
    },
    "sklearn": {
        "Isomap": ("(n_samples, n_components)",),
        "Isomap.fit": (SAMPLES,),
        "Isomap.transform": (SAMPLES, "(n_samples, n_components)"),
        "RbfRegressor.fit": (SAMPLES, "(n_samples, n_outputs)"),
        "RbfRegressor.predict": (SAMPLES, "(n_samples, n_outputs)"),
    },
    "viewers": {"RerunView.show": (IMAGE, "us", "mm"), "to_open3d": (IMAGE, "mm"), "watch": (IMAGE, "mm")},
}


@pytest.mark.parametrize("name", STATED)
def test_modules_in_python_state_shapes_and_units(name):
    if name == "sklearn":
        pytest.importorskip("sklearn")
    module = importlib.import_module(f"farnear.{name}")
    for public in module.__all__:
        found = getattr(module, public)
        assert inspect.getdoc(found), public
        members = vars(found) if inspect.isclass(found) else {}
        for member in (member for member in members if not member.startswith("_") and callable(members[member])):
            assert inspect.getdoc(getattr(found, member)), f"{public}.{member}"
    for path, expected in STATED[name].items():
        found = module
        for part in path.split("."):
            found = getattr(found, part)
        for words in expected:
            assert words in inspect.getdoc(found), f"{path} does not state {words}"


def test_examples_in_docstrings_run():
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
    parser = doctest.DocTestParser()
    ran = 0
    for name in PUBLIC:
        doc = inspect.getdoc(getattr(farnear, name)) or ""
        test = parser.get_doctest(doc, {"farnear": farnear, "np": np}, name, None, 0)
        runner.run(test, clear_globs=False)
        ran += len(test.examples)
    assert ran > 30 and runner.failures == 0


def test_the_stub_has_the_docstrings_of_the_module():
    script = Path(__file__).resolve().parents[1] / "docstrings.py"
    if not script.is_file():
        pytest.skip("the sources are not here")
    spec = importlib.util.spec_from_file_location("docstrings", script)
    docstrings = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(docstrings)
    stub = (Path(farnear.__file__).parent / "_farnear.pyi").read_text()
    assert docstrings.rewritten(stub, farnear._farnear) == stub, "run python/docstrings.py"


def test_the_version_is_that_of_the_package():
    assert farnear.__version__.count(".") == 2
