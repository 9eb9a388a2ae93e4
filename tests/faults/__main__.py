"""Faults, made on purpose: `python tests/faults [--kills N] [--seconds N] [--only NAME,...] [-o FILE]`; 1: one shows.

Prints a line a scenario. The same seed draws the same moments.
"""

from __future__ import annotations

import argparse
import json
import random
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import beside
import disk
import places
import stops
from kills import Campaign
from outcome import Outcome
from subjects import SUBJECTS

# The kills of each subject, of a hundred: most go where most work is kept.
SHARES = {"bench": 50, "fleet": 30, "discover": 20}
SCENARIOS: dict[str, Callable[[Path, random.Random], Outcome]] = {
    "full-disk": disk.full_disk,
    "full-store": disk.full_store,
    "read-only": disk.read_only,
    "no-cache": disk.no_cache,
    "streams": disk.unread,
    "vanishing": beside.vanishing_input,
    "two-writers": beside.two_writers,
    "new-stores": beside.new_stores,
    "clock": beside.clock_set_back,
    "memory": beside.no_memory,
    "signals": stops.stops,
}


def main() -> int:
    """Parse, make the faults, report."""
    parser = argparse.ArgumentParser(prog="faults", description=__doc__)
    parser.add_argument("--kills", type=int, default=200, help="kills in all, default 200")
    parser.add_argument("--seconds", type=float, default=7200.0, help="no new kill after so many, default 7200")
    parser.add_argument("--only", default=",".join([*SHARES, *SCENARIOS]), metavar="NAME,...", help="default all")
    parser.add_argument("--seed", type=int, default=1, help="of the moments, default 1")
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help="JSON file to write")
    args = parser.parse_args()
    # A run in the background of a script ignores these, and so would the commands that are to hear them.
    for number, handler in ((signal.SIGINT, signal.default_int_handler), (signal.SIGHUP, signal.SIG_DFL)):
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, handler)
    names = args.only.split(",")
    if unknown := set(names) - {*SHARES, *SCENARIOS}:
        parser.error(f"--only: {', '.join(sorted(unknown))}; there are {', '.join([*SHARES, *SCENARIOS])}")
    until, found = time.monotonic() + args.seconds, list[dict[str, Any]]()
    with tempfile.TemporaryDirectory(prefix="faults-", ignore_cleanup_errors=True) as folder:
        for name in names:
            begun = time.monotonic()
            done = list(found)
            for entry in _one(name, names, args, Path(folder) / name, until):
                found = [*done, {"name": name, **entry, "seconds": round(time.monotonic() - begun)}]
                if args.output is not None:
                    args.output.write_text(json.dumps({"seed": args.seed, "scenarios": found}, indent=1) + "\n")
            _say(found[-1])
    kills, faults = sum(entry.get("kills", 0) for entry in found), sum(len(entry["faults"]) for entry in found)
    others = sum(entry.get("tried", 0) for entry in found)
    print(f"{kills} kills, {others} other faults: {faults} with something to mend")
    return int(faults > 0)


def _one(name: str, names: list[str], args: argparse.Namespace, folder: Path, until: float) -> Iterator[dict[str, Any]]:
    """What is found, once or as it grows."""
    # Each has moments of its own, whichever others are asked for.
    rng = random.Random(f"{args.seed} {name}")
    if name in SHARES:
        whole = sum(SHARES[other] for other in names if other in SHARES)
        kills = -(-args.kills * SHARES[name] // whole)
        yield from Campaign(SUBJECTS[name], folder, rng, lambda text: print(f"  {text}", flush=True)).run(kills, until)
        return
    folder.mkdir(parents=True)
    try:
        yield SCENARIOS[name](folder / "work", rng).to_json()
    except places.UnableError as reason:
        yield Outcome(name, skipped=str(reason)).to_json()


def _say(entry: dict[str, Any]) -> None:
    count = f"{entry['kills']} kills" if "kills" in entry else f"{entry['tried']} times"
    state = entry.get("skipped") or ("held" if not entry["faults"] else f"{len(entry['faults'])} FAULTS")
    print(f"{entry['name']}: {count}, {entry['seconds']} s: {state}", flush=True)
    for sentence in entry["faults"]:
        print(f"  {sentence}")


if __name__ == "__main__":
    sys.exit(main())
