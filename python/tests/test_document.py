"""The Python of docs/python.md runs as it stands there, one block after the other."""

import re
from pathlib import Path

import pytest

PAGE = Path(__file__).resolve().parents[2] / "docs" / "python.md"


@pytest.mark.skipif(not PAGE.is_file(), reason="the sources' docs are not beside this test")
def test_the_pages_lines_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"^```python\n(.*?)^```$", PAGE.read_text(), re.MULTILINE | re.DOTALL)
    assert len(blocks) >= 4
    names = {}
    for block in blocks:
        if "emulated" in block.lower():
            from farnear.rig import find_simulator

            if find_simulator() is None:
                continue
        if "sklearn" in block:
            pytest.importorskip("sklearn")
        exec(compile(block, str(PAGE), "exec"), names)  # the page is ours
    assert names["found"].valid_fraction > 0.9
