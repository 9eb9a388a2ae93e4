"""Are the tests worth their time? `python tests/mutation --coverage FILE --durations FILE -o results/mutation.json`.

Small mistakes are put into the code, one at a time, and the tests that run the changed line must notice (Cosmic Ray's
operators). The files come from `tox run -e coverage`. The same seed draws the same mistakes from the same code.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import sys
import tempfile
from collections import Counter
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from datetime import date
from importlib.metadata import version
from pathlib import Path
from typing import Any

from choosing import Choice
from mutants import Mutant, drawn
from trial import tried

ROOT = Path(__file__).resolve().parents[2]
ROOMS = ("suite/kernels", "suite/discovery", "suite/benchmark")
LEFT_OUT = (".git", "__pycache__", "out", "results", "*.sqlite*", ".tox", ".mypy_cache", ".ruff_cache", ".hypothesis")


def main() -> int:
    """Draw, try, count."""
    parser = argparse.ArgumentParser(prog="mutation", description=__doc__)
    parser.add_argument("--coverage", type=Path, required=True, metavar="FILE", help="which test runs which line")
    parser.add_argument("--durations", type=Path, required=True, metavar="FILE", help="junit report: seconds of a test")
    parser.add_argument("--each", type=int, default=30, help="mistakes a room, default 30")
    parser.add_argument("--rooms", default=",".join(ROOMS), metavar="DIR,...", help="default %(default)s")
    parser.add_argument("--seed", type=int, default=1, help="of the sample, default 1")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes, default one a core")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help="JSON file to write; a run goes on from it")
    args = parser.parse_args()
    choice = Choice(args.coverage, args.durations, ROOT)
    mutants = [mutant for room in args.rooms.split(",") for mutant in drawn(ROOT, room, args.each, args.seed)]
    found = _known(args.output, mutants)
    waiting = [(mutant, choice.of(mutant)) for mutant in mutants if mutant.key not in found]
    with tempfile.TemporaryDirectory(prefix="mutation-", ignore_cleanup_errors=True) as folder:
        # A process works in the copy that is its own.
        copies = [_copy(Path(folder) / str(job)) for job in range(args.jobs)]
        with ProcessPoolExecutor(args.jobs) as pool:
            running: dict[Future[dict[str, Any]], tuple[Mutant, Path]] = {}
            while waiting or running:
                while waiting and copies:
                    (mutant, tests), place = waiting.pop(0), copies.pop()
                    running[pool.submit(tried, mutant, tests, place)] = mutant, place
                done = next(as_completed(running))
                mutant, place = running.pop(done)
                copies.append(place)
                found[mutant.key] = done.result()
                print(_line(mutant, found[mutant.key]), flush=True)
                _keep(args, mutants, found)
    for room, count in _rooms(mutants, found).items():
        print(f"{room}: {count['killed']} of {count['killed'] + count['survived']} noticed")
    return 0


def _copy(place: Path) -> Path:
    shutil.copytree(ROOT, place, ignore=shutil.ignore_patterns(*LEFT_OUT))
    return place


def _known(output: Path | None, mutants: list[Mutant]) -> dict[str, dict[str, Any]]:
    """What an earlier run left, of the mistakes that are still drawn."""
    if output is None or not output.exists():
        return {}
    keys = {mutant.key for mutant in mutants}
    mutations = json.loads(output.read_text(encoding="utf-8"))["mutants"]
    return {entry["key"]: entry for entry in mutations if entry["key"] in keys}


def _rooms(mutants: list[Mutant], found: dict[str, dict[str, Any]]) -> dict[str, Counter[str]]:
    counts: dict[str, Counter[str]] = {}
    for mutant in mutants:
        counts.setdefault(mutant.room, Counter())[found.get(mutant.key, {"outcome": "waiting"})["outcome"]] += 1
    return counts


def _keep(args: argparse.Namespace, mutants: list[Mutant], found: dict[str, dict[str, Any]]) -> None:
    if args.output is None:
        return
    names = ("unmodelled", "cosmic-ray", "pytest")
    report = {
        "command": f"python tests/mutation --each {args.each} --seed {args.seed} --rooms {args.rooms}",
        "seed": args.seed,
        "date": date.today().isoformat(),
        "versions": {"python": sys.version.split()[0], **{name: version(name) for name in names}},
        "rooms": {room: dict(count) for room, count in _rooms(mutants, found).items()},
        "mutants": [found[mutant.key] for mutant in mutants if mutant.key in found],
    }
    beside = args.output.with_suffix(".part")
    beside.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    beside.replace(args.output)


def _line(mutant: Mutant, found: dict[str, Any]) -> str:
    return f"{found['outcome']:10} {mutant.path}:{mutant.line} {mutant.operator} ({found['seconds']:.0f} s)"


if __name__ == "__main__":
    sys.exit(main())
