"""The Snakemake workflow of cluster/ is killed twice; it ends with all good pairs, one table of figures and one list of failures."""

import csv
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from farnear.rig import find_simulator

SNAKEFILE = Path(__file__).resolve().parents[2] / "cluster" / "Snakefile"
# docs/cluster.md has the result for 500 pairs.
PAIRS = int(os.environ.get("FARNEAR_TRIAL_PAIRS", "60"))
BAD = 5
SHARES = 4


def finished(folder):
    """Times of the finished jobs."""
    return {path.parent.name: path.stat().st_mtime_ns for path in folder.glob("results/*/batch.toml")}


@pytest.mark.skipif(not SNAKEFILE.is_file(), reason="the sources are not here")
def test_bad_pairs_and_two_kills_leave_one_table_and_one_list(optics, tmp_path):
    pytest.importorskip("snakemake")
    simulator = find_simulator()
    if simulator is None:
        pytest.skip("farnear is not built")
    farnear = simulator.with_name("farnear")
    (tmp_path / "optics.toml").write_text(optics.dumps())
    render = [farnear, "render", "--optics", "optics.toml", "--scene", "cone", "--width", "320", "--height", "240", "--out", "pair"]
    subprocess.run(render, cwd=tmp_path, check=True, capture_output=True)
    (tmp_path / "pair" / "cut.png").write_bytes((tmp_path / "pair" / "far.png").read_bytes()[:999])
    rows = ["do,far,near,optics,write,out"]
    bad = set(range(3, PAIRS, PAIRS // BAD)[:BAD])
    for pair in range(PAIRS):
        far = "cut" if pair in bad else "far"
        rows.append(f"depth,pair/{far}.png,pair/near.png,optics.toml,npy,results/{pair:04}")
    (tmp_path / "pairs.csv").write_text("\n".join(rows) + "\n")

    def workflow(*more):
        command = [sys.executable, "-m", "snakemake", "--snakefile", SNAKEFILE, "--cores", "2", "--rerun-incomplete", *more]
        command += ["--config", f"manifest={tmp_path / 'pairs.csv'}", f"shares={SHARES}", f"farnear={farnear}"]
        log = (tmp_path / "snakemake.log").open("ab")
        return subprocess.Popen([str(word) for word in command], cwd=tmp_path, stdout=log, stderr=log, start_new_session=True)

    before = {}
    for part in (0.2, 0.6):
        running = workflow()
        while len(finished(tmp_path)) < part * PAIRS:
            assert running.poll() is None, (tmp_path / "snakemake.log").read_text()
            time.sleep(0.05)
        os.killpg(running.pid, signal.SIGKILL)
        running.wait()
        before |= finished(tmp_path)
        assert len(before) < PAIRS - BAD, "killed after the end"
        assert workflow("--unlock").wait() == 0
    assert workflow().wait() == 0, (tmp_path / "snakemake.log").read_text()

    after = finished(tmp_path)
    assert set(after) == {f"{pair:04}" for pair in range(PAIRS) if pair not in bad}
    assert {name: after[name] for name in before} == before, "a finished job ran again"
    folder = tmp_path / f"pairs.shares-{SHARES}"
    with (folder / "figures.csv").open() as file:
        table = list(csv.DictReader(file))
    assert [row["state"] == "failed" for row in table] == [pair in bad for pair in range(PAIRS)]
    figures = {row["median_mm"] for row in table if row["state"] != "failed"}
    assert len(figures) == 1 and 887 < float(*figures) < 933, "the same pair has the same figures, also after a resume"
    failures = [json.loads(line) for line in (folder / "failures.jsonl").read_text().splitlines()]
    assert {failure["out"] for failure in failures} == {f"results/{pair:04}" for pair in bad}
    assert all("cut.png" in failure["error"] for failure in failures)
