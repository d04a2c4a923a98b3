#!/usr/bin/env python3
"""The workflow on a real Slurm of two nodes on this machine, with three crashes: the controller's, a node's, and the workflow's own.

    cluster/trial.py FOLDER [--jobs 500] [--shares 50]

Pairs are rendered, their depths computed once by `farnear batch` without any trouble, and once in shares by Slurm while things
are killed. Then every file must be there with the same bytes, and nothing that was done before a crash may have been done again. Needs farnear,
snakemake with snakemake-executor-plugin-slurm, and what cluster/one-machine-slurm needs; writes FOLDER/trial.md.
"""

import argparse
import hashlib
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import time

# Longer than any share takes to be submitted, started and begun.
STANDSTILL_S = 180
HERE = pathlib.Path(__file__).resolve().parent


def run(*arguments, **options):
    """Runs a program; an exit code other than 0 is an error."""
    return subprocess.run([str(a) for a in arguments], check=True, **options)


def manifest(folder, out, jobs):
    """A manifest of `jobs` pairs, of which four are different."""
    lines = ["do,far,near,optics,write,out"]
    for job in range(jobs):
        pair = f"pair{job % 4}"
        lines.append(f"depth,{pair}/far.png,{pair}/near.png,optics.toml,npy,{out}/{job:05}")
    path = folder / f"{out}.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def results(folder):
    """Every file of the results with its sum."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != "batch.toml"
    }


def done(folder):
    """Finished jobs and their times."""
    return {path.parent.name: path.stat().st_mtime_ns for path in folder.glob("*/batch.toml")}


class Trial:
    def __init__(self, folder, arguments):
        self.folder, self.arguments = folder, arguments
        self.out = folder / "shared"
        self.slurm = folder / "slurm"
        self.told = []

    def daemon(self, *words):
        run(HERE / "one-machine-slurm", words[0], self.slurm, *words[1:], stdout=subprocess.DEVNULL)

    def workflow(self, *more):
        command = ["snakemake", "--snakefile", HERE / "Snakefile", "--profile", HERE / "profiles/slurm"]
        command += ["--directory", self.folder / "work", "--config", f"manifest={self.folder / 'shared.csv'}"]
        command += [f"shares={self.arguments.shares}", f"farnear={self.arguments.farnear}", *more]
        # This Slurm keeps no accounts, and a share of seconds should not wait like one of hours.
        command += ["--slurm-status-command", "squeue", "--slurm-init-seconds-before-status-checks", 3]
        log = (self.folder / "snakemake.log").open("ab")
        return subprocess.Popen(
            [str(c) for c in command], stdout=log, stderr=log, start_new_session=True
        )

    def wait_for(self, share, workflow):
        """Waits until that share of the jobs is finished; returns the finished ones."""
        last, since = 0, time.monotonic()
        while (count := len(done(self.out))) < share * self.arguments.jobs:
            if workflow.poll() is not None:
                sys.exit(f"the workflow ended before its time: {self.folder / 'snakemake.log'}")
            if count > last:
                last, since = count, time.monotonic()
            if time.monotonic() - since > STANDSTILL_S:
                os.killpg(workflow.pid, signal.SIGKILL)
                sys.exit(f"nothing was done for {STANDSTILL_S} s: {self.folder / 'snakemake.log'}")
            time.sleep(0.2)
        return done(self.out)

    def tell(self, what):
        self.told.append((time.monotonic() - self.begin, len(done(self.out)), what))
        print(f"{self.told[-1][0]:6.1f} s, {self.told[-1][1]:4} done: {what}", flush=True)

    def crash(self):
        """The run with its crashes; returns the finished jobs at each."""
        seen = []
        workflow = self.workflow()
        for share, daemon, pause in [(0.2, "controller", 5), (0.4, "two", 15)]:
            seen.append(self.wait_for(share, workflow))
            self.daemon("kill", daemon)
            self.tell(f"{daemon} killed")
            time.sleep(pause)
            self.daemon("start")
            self.tell(f"{daemon} started again")
        seen.append(self.wait_for(0.7, workflow))
        os.killpg(workflow.pid, signal.SIGKILL)
        workflow.wait()
        self.tell("workflow killed")
        time.sleep(3)
        if self.workflow("--unlock").wait() != 0:
            sys.exit("the workflow cannot be unlocked")
        again = self.workflow()
        self.tell("workflow started again")
        if again.wait() != 0:
            sys.exit(f"the workflow failed: {self.folder / 'snakemake.log'}")
        self.tell("all done")
        return seen

    def judge(self, seen):
        """Every complaint."""
        expected, found, end = results(self.folder / "alone"), results(self.out), done(self.out)
        faults = []
        if expected.keys() != found.keys():
            faults.append(f"{len(expected.keys() ^ found.keys())} files are missing or too many")
        other = [name for name in expected.keys() & found.keys() if expected[name] != found[name]]
        if other:
            faults.append(f"{len(other)} files have other bytes, such as {other[0]}")
        for number, before in enumerate(seen, 1):
            again = [name for name, when in before.items() if end.get(name) != when]
            if again:
                faults.append(f"{len(again)} jobs were done again after crash {number}")
        left = [path for path in self.out.rglob("*partial*")]
        if left:
            faults.append(f"{len(left)} half results are left")
        return faults, len(found)

    def accounting(self):
        """What Slurm wrote of its jobs: by node and state."""
        rows = {}
        for line in (self.slurm / "jobs.txt").read_text().splitlines():
            fields = dict(part.split("=", 1) for part in line.split() if "=" in part)
            key = (fields.get("NodeList", ""), fields.get("JobState", ""))
            rows[key] = rows.get(key, 0) + 1
        return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--jobs", type=int, default=500)
    parser.add_argument("--shares", type=int, default=50)
    parser.add_argument("--farnear", default=shutil.which("farnear"), help="the program, if it is not on the PATH")
    arguments = parser.parse_args()
    if not arguments.farnear:
        parser.error("farnear is not on the PATH: name it with --farnear")
    folder = arguments.folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "work").mkdir(exist_ok=True)
    shutil.copy(HERE.parent / "examples/rig.toml", folder / "optics.toml")
    for pair, scene in enumerate(["staircase", "slant", "cone", "sphere"]):
        run(arguments.farnear, "render", "--optics", folder / "optics.toml", "--scene", scene, "--width", 320, "--height", 240,
            "--seed", pair + 1, "--out", folder / f"pair{pair}", stdout=subprocess.DEVNULL)
    begin = time.monotonic()
    run(arguments.farnear, "batch", manifest(folder, "alone", arguments.jobs), cwd=folder, stdout=subprocess.DEVNULL)
    alone_s = time.monotonic() - begin
    manifest(folder, "shared", arguments.jobs)
    trial = Trial(folder, arguments)
    trial.daemon("start")
    trial.begin = time.monotonic()
    try:
        faults, files = trial.judge(trial.crash())
    finally:
        trial.daemon("stop")
    lines = [f"{arguments.jobs} jobs in {arguments.shares} shares; without Slurm {alone_s:.0f} s.", ""]
    lines += ["| s | done | |", "|--:|--:|---|"]
    lines += [f"| {seconds:.0f} | {count} | {what} |" for seconds, count, what in trial.told]
    lines += ["", "| node | state | Slurm's jobs |", "|---|---|--:|"]
    lines += [f"| {node} | {state} | {count} |" for (node, state), count in sorted(trial.accounting().items())]
    lines += ["", f"{files} files, " + ("; ".join(faults) or "all with the bytes of the unbroken run; nothing was done twice") + "."]
    (folder / "trial.md").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))
    sys.exit(bool(faults))


if __name__ == "__main__":
    main()
