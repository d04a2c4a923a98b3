"""The notebooks run from their first cell to their last, and draw something."""

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
    for cell in json.loads(path.read_text())["cells"]:
        if cell["cell_type"] == "code":
            assert not cell["outputs"], f"{path.name} is kept without outputs"
            exec(compile("".join(cell["source"]), path.name, "exec"), names)  # the notebook is ours
    figures = [plt.figure(number) for number in plt.get_fignums()]
    assert len(figures) >= 2
    for number, figure in enumerate(figures):
        figure.savefig(tmp_path / f"{path.stem}-{number}.png")
