"""The stub has what the module has, and type checkers accept it."""

import ast
import importlib.util
import inspect
import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import farnear
from farnear import _farnear

TYPES = {"TypedDict", "Protocol"}


def test_the_stub_and_the_module_agree():
    stub = ast.parse((Path(farnear.__file__).parent / "_farnear.pyi").read_text())
    told = {node.name: node for node in stub.body if isinstance(node, (ast.ClassDef, ast.FunctionDef))}
    # Types of dictionaries and of arguments exist for type checkers alone.
    told = {name: node for name, node in told.items() if not {base.id for base in getattr(node, "bases", [])} & TYPES}
    # What only measure.py uses is there only where it was asked for.
    there = {name for name in dir(_farnear) if not name.startswith("_") and not name.startswith("seconds_of")}
    assert there == set(told)
    for name, node in told.items():
        assert ast.get_docstring(node), name
        if not isinstance(node, ast.ClassDef):
            arguments = node.args
            names = [argument.arg for argument in arguments.args + arguments.kwonlyargs]
            assert list(inspect.signature(getattr(_farnear, name)).parameters) == names, name
            continue
        members = {part.name for part in node.body if isinstance(part, ast.FunctionDef)}
        for member in members - {"__init__"}:
            assert hasattr(getattr(_farnear, name), member), f"{name}.{member}"


def test_the_package_is_typed():
    assert (Path(farnear.__file__).parent / "py.typed").is_file()
    assert set(farnear.__all__) <= set(dir(farnear))


USE = """
import numpy as np
import farnear

optics = farnear.Optics(focal_length_mm=50, aperture_mm=12.8, pixel_um=7.4, far_mm=933, max_blur_px=2.703)
far, near, truth = farnear.render(optics, "cone")
found: farnear.DepthMap = farnear.depth(far, near, optics, window="adaptive", fill="surface")
error: float = float(np.nanmax(found.depth_mm - truth))
fit = farnear.calibrate_psf([(far, near, 933.0)], optics, model="free")
again = farnear.Optics(focal_length_mm=50, f_number=4, pixel_um=7.4, far_mm=933, near_mm=886, psf=fit.psf)
better: farnear.Optics = fit.optics
ratio: float = fit.residual / fit.noise_residual
name: str = farnear.__version__ + fit.verdict
depth: farnear.DepthMap = farnear.DepthMap.load("folder")
tilt: float = depth.plane((0, 0, 10, 10)).tilt_deg
stack: farnear.FocusStack = farnear.focus_stack([far, near, far.astype(np.float16)], focused_at_mm=[1, 2, 3])
cube: farnear.FocusStack = farnear.focus_stack(np.stack([far, near, far]), focused_at_mm=np.linspace(1, 2, 3))
left_out: list[int] = farnear.focus_stack([far, near, far], use_all=True).left_out
points = farnear.points_mm(depth.depth_mm, optics, part=depth.part)
mask, report = farnear.remove_shadow(found.depth_mm > 0, "camera", elevation_deg=40, azimuth_deg=100)
metres: float = report["distance_m"] / 1000
answer = farnear.Recogniser().recognise(farnear.synthetic_masks("walk"))
probability: float = answer["probabilities"]["walk"]
swapped = farnear.depth(far.astype(np.int32), np.ma.masked_array(near), optics)
"""


NOTEBOOKS = Path(__file__).resolve().parents[1] / "notebooks"
# Notebooks have functions without annotations, and import packages without types.
CHECKS = {
    "mypy": ["mypy", "--strict", "use.py"],
    "mypy-notebooks": ["mypy", "--check-untyped-defs", "--ignore-missing-imports", "notebooks"],
    # Without --pythonpath pyright takes the packages of the `python` on PATH.
    "pyright": ["pyright", "--pythonpath", sys.executable, "use.py"],
}


@pytest.mark.parametrize("checker", CHECKS.values(), ids=CHECKS)
def test_type_checkers_accept_ordinary_use(checker, tmp_path):
    if importlib.util.find_spec(checker[0]) is None:
        pytest.skip(f"{checker[0]} is not installed")
    (tmp_path / "use.py").write_text(USE)
    (tmp_path / "notebooks").mkdir()
    for notebook in NOTEBOOKS.glob("*.ipynb"):
        cells = [cell for cell in json.loads(notebook.read_text())["cells"] if cell["cell_type"] == "code"]
        code = "\n".join("".join(cell["source"]) for cell in cells)
        (tmp_path / "notebooks" / f"{notebook.stem}.py").write_text(code)
    # Only the types: a checker needs no compiled module.
    shutil.copytree(Path(farnear.__file__).parent, tmp_path / "farnear", ignore=shutil.ignore_patterns("*.so", "__pycache__"))
    try:
        done = subprocess.run([sys.executable, "-m", *checker], cwd=tmp_path, capture_output=True, text=True, timeout=120)
    except subprocess.TimeoutExpired:
        pytest.skip(f"{checker[0]} does not start here")  # without its own Node.js pyright fetches one
    assert done.returncode == 0, done.stdout + done.stderr
