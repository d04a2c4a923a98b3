#!/usr/bin/env python3
"""Times whole programs in turn and prints their medians, one JSON object per line.

usage: time_programs.py RUNS RESULTS < programs.json

Reads a list of groups; a group is a list of commands, each a list of words. The commands of a group run in turn,
RUNS times, each with the folder RESULTS empty. Each line of the answer is a list with, per command, the medians of CPU
seconds (user and system), user seconds and wall seconds, and the peak memory in MiB.
"""

import json
import os
import shutil
import statistics
import sys
import time


def run(command, results):
    shutil.rmtree(results, ignore_errors=True)
    os.makedirs(results)
    start = time.perf_counter()
    pid = os.posix_spawnp(
        command[0], command, os.environ, file_actions=[(os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0)]
    )
    _, status, usage = os.wait4(pid, 0)
    if status != 0:
        sys.exit(f"{' '.join(command)} failed")
    return usage.ru_utime + usage.ru_stime, usage.ru_utime, time.perf_counter() - start, usage.ru_maxrss / 1024


for group in json.load(sys.stdin):
    times = [[] for _ in group]
    for _ in range(int(sys.argv[1])):
        for taken, command in zip(times, group):
            taken.append(run(command, sys.argv[2]))
    names = ("cpu_s", "user_s", "wall_s", "memory_mib")
    print(json.dumps([dict(zip(names, map(statistics.median, zip(*taken)))) for taken in times]), flush=True)
