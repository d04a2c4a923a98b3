"""The notebooks run from their first cell to their last, draw, and print what is stored as their output.

`jupyter nbconvert --to notebook --execute --inplace --ExecutePreprocessor.record_timing=False python/notebooks/*.ipynb` renews them.
"""

import contextlib
import io
import json
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[1] / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=[path.stem for path in NOTEBOOKS])
def test_a_notebook_runs(path, tmp_path, monkeypatch):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    monkeypatch.chdir(tmp_path)
    plt.close("all")
    names = {}
    stored = []
    for cell in json.loads(path.read_text())["cells"]:
        if cell["cell_type"] == "code":
            stored += cell["outputs"]
            printed = io.StringIO()
            with contextlib.redirect_stdout(printed):
                exec(compile("".join(cell["source"]), path.name, "exec"), names)  # the notebook is ours
            texts = ["".join(output["text"]) for output in cell["outputs"] if output["output_type"] == "stream"]
            assert printed.getvalue() == "".join(texts), "the stored output is outdated"
    assert any("image/png" in output.get("data", {}) for output in stored), "no stored picture"
    figures = [plt.figure(number) for number in plt.get_fignums()]
    assert len(figures) >= 2
    for number, figure in enumerate(figures):
        figure.savefig(tmp_path / f"{path.stem}-{number}.png")
