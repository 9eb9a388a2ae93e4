"""What `unmodelled diagnose --each` costs a file, measured on a simulated fleet: throughput, overhead, memory.

python bench/fleet.py --files 10000 -o out/fleet --results results/fleet
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import platform
import shlex
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from datetime import date
from importlib.metadata import version
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pandas as pd
from machines import KINDS, SAMPLES, mixed, write

from suite.benchmark import cluster, pool
from suite.benchmark.store import Store
from suite.benchmark.worker import Task
from suite.files import write_whole

FEW = "logs/machine-0000?.csv"

# Runs the command line and leaves in the file at argv[1] what it took: of this process and of those it started. Where
# argv[2] is a row, it stands for the verdict of every file, and only the parent works.
PROBE = """
import json, resource, sys, time
from suite.__main__ import main
from suite.benchmark import pool

def at_once(tasks, *_):
    for task in tasks:
        yield task, {**row, "digest": "that of the row"}

if sys.argv[2]:
    row = json.loads(sys.argv[2])
    pool.run = at_once
began = time.monotonic()
code = main(sys.argv[3:])
own, workers = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
taken = {
    "wall_s": time.monotonic() - began, "parent_cpu_s": own.ru_utime + own.ru_stime, "parent_mib": own.ru_maxrss / 1024,
    "workers_cpu_s": workers.ru_utime + workers.ru_stime, "worker_mib": workers.ru_maxrss / 1024,
}
with open(sys.argv[1], "w") as handle:
    json.dump(taken, handle)
sys.exit(code)
"""


def judged(folder: Path, out: str, pattern: str, jobs: int, row: str = "") -> dict[str, float]:
    """What `unmodelled diagnose --each` takes for the files of the folder that are like a pattern."""
    place = folder / out
    place.mkdir(parents=True, exist_ok=True)
    words = ["diagnose", folder / "model.toml", folder / pattern, "--each", "-o", place, "--jobs", jobs, "--json"]
    command = [sys.executable, "-c", PROBE, str(place / "taken.json"), row, *map(str, words)]
    # --json is silent on the way, as a run in the background is.
    with (place / "said.json").open("w", encoding="utf-8") as said:
        subprocess.run(command, check=True, stdout=said)
    found: dict[str, float] = json.loads((place / "taken.json").read_text(encoding="utf-8"))
    return found


def a_row(store: Path) -> str:
    """The longest row of a store."""
    with Store(store) as held:
        return max((str(text) for (text,) in held.all("SELECT row FROM cells")), key=len)


def in_processes(count: int) -> dict[str, float]:
    """Seconds a task that does nothing costs through a worker process: on the clock, and of the parent's processor."""
    tasks = (Task("os:getpid", ()) for _ in range(count + 1))
    results = pool.run(tasks, 1, 60.0)
    next(results)  # the process has started
    return _paced(results, count)


def on_dask(count: int, threads: int) -> dict[str, float]:
    """Seconds of processor a task costs the client and the scheduler of a Dask cluster of so many threads.

    The tasks sleep for the time of a verdict, so that as many are under way as on a cluster of as many cores.
    """
    from distributed import Client

    cluster.answer = asleep
    process = subprocess.Popen(
        [sys.executable, "-c", CLUSTER, str(threads)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stdin is not None
    assert process.stdout is not None
    address = process.stdout.readline().strip()
    with Client(address, set_as_default=False) as client:
        before = client.run_on_scheduler(time.process_time)
        tasks = (Task("", ("x" * 600, "model.toml", f"/logs/{k}.csv", False), k) for k in range(count))
        taken = _paced(cluster.run(tasks, address, 60.0, 1024.0), count)
        scheduler = client.run_on_scheduler(time.process_time) - before
    process.communicate()
    return {"threads": threads, "client_cpu_s": taken["parent_cpu_s"], "scheduler_cpu_s": scheduler / count}


CLUSTER = """
import sys

if __name__ == "__main__":
    from distributed import LocalCluster

    shape = {"n_workers": 1, "threads_per_worker": int(sys.argv[1])}
    with LocalCluster(**shape, processes=True, dashboard_address=None) as cluster:
        print(cluster.scheduler_address, flush=True)
        sys.stdin.read()
"""


def asleep(task: Task, limit: float, memory: float, expected: dict[str, str]) -> dict[str, str]:
    """What stands in for a verdict on a cluster: as long as one, and as large."""
    time.sleep(0.4)
    return {"status": "ok", "sentence": "x" * 1500}


def _paced(results: Iterator[object], count: int) -> dict[str, float]:
    wall, own = time.monotonic(), time.process_time()
    for _ in results:
        pass
    return {"wall_s": (time.monotonic() - wall) / count, "parent_cpu_s": (time.process_time() - own) / count}


def right(out: Path, kinds: npt.NDArray[np.int64]) -> dict[str, dict[str, int]]:
    """Verdicts of each kind of machine: the truth named, named among several, something else, nothing missing."""
    table = pd.read_parquet(out / "fleet.parquet", columns=["file", "verdict", "effects"])
    found: dict[str, Counter[str]] = {}
    for file, verdict, effects in table.itertuples(index=False):
        truth = KINDS[kinds[int(Path(file).stem.split("-")[1])]][0]
        same = effects.partition("@")[0] == truth and "+" not in effects
        said = "nothing missing" if verdict == "adequate" else "another effect" if not same else "the effect"
        found.setdefault(truth or "nothing", Counter())[f"{said}, not alone" if verdict == "ambiguous" else said] += 1
    return {truth: dict(counted.most_common()) for truth, counted in sorted(found.items())}


def a_file(few: Mapping[str, float], all_: Mapping[str, float], more: int) -> dict[str, float]:
    """What each of `more` files more took: the difference of two runs leaves out what a run costs anyway."""
    return {name: (all_[name] - few[name]) / more for name in all_}


def million(each: Mapping[str, float], files: int = 1_000_000, cores: int = 1_000) -> dict[str, float]:
    """Seconds of many files on a Dask cluster by what bounds them: its cores, the one parent, the one scheduler."""
    parent = each["store_cpu_s"] + each["dask_client_cpu_s"]
    bounds = {
        "cores_s": files * each["verdict_cpu_s"] / cores,
        "parent_s": files * parent,
        "scheduler_s": files * each["dask_scheduler_cpu_s"],
    }
    busy = each["verdict_cpu_s"] / max(parent, each["dask_scheduler_cpu_s"])
    sizes = {"parent_gib": files * each["parent_kib"] / 2**20, "store_gib": files * each["store_kib"] / 2**20}
    return {"files": files, "cores": cores, **bounds, "cores_kept_busy": busy, **sizes}


def machine() -> dict[str, object]:
    """The processor, how many cores of it may be used, and what computed."""
    model = platform.processor() or platform.machine()
    with contextlib.suppress(OSError):
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        model = next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), model)
    names = ("unmodelled", "numpy", "numba", "distributed")
    versions = {"python": platform.python_version(), **{name: version(name) for name in names}}
    return {"processor": model, "cores": os.cpu_count(), "system": platform.system(), "versions": versions}


def main() -> None:
    """Make the fleet, measure, write throughput.json."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--files", type=int, default=200, help="machines, default 200")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes, default one a core")
    parser.add_argument("--rows", type=int, default=10000, help="files of the parent's measure, default 10000")
    parser.add_argument("--tasks", type=int, default=6000, help="empty tasks that tell the overhead, default 6000")
    parser.add_argument("--threads", type=int, default=1000, help="threads of the Dask cluster of these, default 1000")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR", help="the fleet and what comes out")
    parser.add_argument("--results", type=Path, metavar="DIR", help="folder of throughput.json, default that of -o")
    args = parser.parse_args()
    folder, jobs = args.output, args.jobs
    kinds = mixed(args.files, seed=1)
    write(folder, kinds, seed=1)

    judged(folder, "first", FEW, jobs)  # compiles the model, for this machine and once
    few = judged(folder, "few", FEW, jobs)
    all_ = judged(folder, "out", "logs/*.csv", jobs)
    again = judged(folder, "out", "logs/*.csv", jobs)
    more = args.files - len(list(folder.glob(FEW)))
    taken, unchanged = a_file(few, all_, more), a_file(few, again, more)

    (folder / "names").mkdir(exist_ok=True)
    for k in range(args.rows):
        (folder / "names" / f"machine-{k:07d}.csv").touch()
    row = a_row(folder / "few" / "fleet.sqlite")
    alone = judged(folder, "one", "names/machine-0000000.csv", jobs, row)
    parent = a_file(alone, judged(folder, "rows", "names/*.csv", jobs, row), args.rows - 1)
    processes, dask = in_processes(args.tasks), on_dask(args.tasks, args.threads)

    out = folder / "rows"
    each = {
        "verdict_cpu_s": taken["workers_cpu_s"],
        "store_cpu_s": parent["parent_cpu_s"],
        "parent_kib": 1024 * parent["parent_mib"],
        "store_kib": (out / "fleet.sqlite").stat().st_size / args.rows / 1024,
        "task_wall_s": processes["wall_s"],
        "task_cpu_s": processes["parent_cpu_s"],
        "dask_client_cpu_s": dask["client_cpu_s"],
        "dask_scheduler_cpu_s": dask["scheduler_cpu_s"],
        "unchanged_cpu_s": unchanged["parent_cpu_s"],
    }
    sizes = {
        name: (out / name).stat().st_size for name in ("fleet.sqlite", "fleet.parquet", "fleet.csv", "report.html")
    }
    found = {
        "date": date.today().isoformat(),
        "command": shlex.join(["python", "bench/fleet.py", *sys.argv[1:]]),
        "machine": machine(),
        "files": args.files,
        "samples": SAMPLES,
        "jobs": jobs,
        "files_per_s": args.files / all_["wall_s"],
        # Below `jobs`: other work shared the machine, and files_per_s is that much too low.
        "cores_got": (all_["workers_cpu_s"] + all_["parent_cpu_s"]) / all_["wall_s"],
        "run": all_,
        "run_of_few": few,
        "run_unchanged": again,
        "each": each,
        "dask_threads": args.threads,
        "rows": args.rows,
        "bytes_of_rows": sizes,
        "million": million(each),
        "verdicts": right(folder / "out", kinds),
    }
    write_whole((args.results or folder) / "throughput.json", json.dumps(found, indent=1) + "\n")
    print(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
