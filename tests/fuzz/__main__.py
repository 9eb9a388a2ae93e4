"""Fuzzing, bounded: `python tests/fuzz [--seconds N] [--target NAME ...] [--guided]`; exit code 1 where defects are.

Each target runs in a process of its own, by strategies of hypothesis; with `--guided` its bytes are chosen by atheris
so as to reach new lines of the package. Prints one line a target, and writes all of it with --json.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

TARGETS = ("expression", "model", "csv_file", "parquet_file", "mat_file", "plan", "store", "page")
PACKAGES = ["suite"]


def run(target: str, seconds: float, examples: int | None, seed: int) -> dict[str, Any]:
    """One target by hypothesis, in this process."""
    from hypothesis import HealthCheck, Phase, given, settings
    from hypothesis import seed as seeded
    from oracle import Oracle

    module = importlib.import_module(target)
    oracle = Oracle(target)
    with tempfile.TemporaryDirectory() as folder:
        attempt = module.prepare(oracle, Path(folder))
        # They take longer to make than to refuse.
        for bomb in getattr(module, "bombs", list)() if examples is None else ():
            attempt(bomb)
        end = time.monotonic() + seconds
        left = examples if examples is not None else sys.maxsize
        while time.monotonic() < end and left > 0:
            count = min(left, 200)

            @seeded(seed)
            @settings(
                max_examples=count,
                database=None,
                deadline=None,
                phases=[Phase.generate],
                suppress_health_check=list(HealthCheck),
            )
            @given(module.strategy)
            def batch(drawn: Any) -> None:
                if time.monotonic() < end:
                    attempt(drawn)

            batch()
            left -= count
            seed += 1
        for close in oracle.at_end:
            close()
    return oracle.to_json()


def guided(target: str, seconds: float, report: Path) -> None:
    """One target by atheris, whose process ends with it: the report is written as it goes."""
    # What atheris has put its counters into numba cannot compile; the readers need none of it.
    os.environ["NUMBA_DISABLE_JIT"] = "1"
    import atheris

    with atheris.instrument_imports(include=PACKAGES):
        from hypothesis import HealthCheck, given, settings
        from oracle import Oracle

        module = importlib.import_module(target)
        oracle = Oracle(target)
        attempt = module.prepare(oracle, Path(tempfile.mkdtemp()))

    @settings(database=None, deadline=None, suppress_health_check=list(HealthCheck))
    @given(module.strategy)
    def once(drawn: Any) -> None:
        attempt(drawn)

    written = 0.0

    def one(data: bytes) -> None:
        nonlocal written
        once.hypothesis.fuzz_one_input(data)
        if time.monotonic() - written > 1.0:
            report.write_text(json.dumps(oracle.to_json()))
            written = time.monotonic()

    atheris.Setup(
        [target, f"-max_total_time={seconds:.0f}", "-max_len=8192", "-rss_limit_mb=8000", "-verbosity=0"], one
    )
    atheris.Fuzz()


def _apart(target: str, args: argparse.Namespace) -> dict[str, Any]:
    """A target in a process of its own, whose address space and alarms are its own too."""
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.json"
        command = [sys.executable, __file__, "--here", str(report), "--target", target, "--seconds", str(args.seconds)]
        command += ["--seed", str(args.seed), *(["--guided"] if args.guided else [])]
        command += [] if args.examples is None else ["--examples", str(args.examples)]
        ended = subprocess.run(command, capture_output=True, text=True, env={**os.environ, "TMPDIR": folder})
        if report.exists() and (ended.returncode == 0 or args.guided):
            found: dict[str, Any] = json.loads(report.read_text())
            return found
        said = (ended.stdout + ended.stderr)[-2000:]
        return {"target": target, "tried": 0, "defects": [{"what": "the process died", "given": "", "detail": said}]}


def main() -> int:
    """Parse the command, run, report."""
    parser = argparse.ArgumentParser(prog="fuzz", description=__doc__)
    parser.add_argument("--seconds", type=float, default=30.0, help="for each target")
    parser.add_argument("--target", nargs="*", choices=TARGETS, default=list(TARGETS))
    parser.add_argument("--examples", type=int, help="at most so many of each, and no bombs")
    parser.add_argument("--seed", type=int, default=random.SystemRandom().randrange(10**9))
    parser.add_argument("--guided", action="store_true", help="by coverage, with atheris")
    parser.add_argument("--json", type=Path, help="where the whole report goes")
    parser.add_argument("--here", type=Path, help=argparse.SUPPRESS)
    args = parser.parse_args()
    # The modules beside this one, also where Python is told not to look there (PYTHONSAFEPATH).
    sys.path.insert(0, str(Path(__file__).parent))
    if args.here is not None and args.guided:
        guided(args.target[0], args.seconds, args.here)
    if args.here is not None:
        args.here.write_text(json.dumps(run(args.target[0], args.seconds, args.examples, args.seed)))
        return 0
    print(f"seed {args.seed}", flush=True)
    reports = []
    for target in args.target:
        reports.append(_apart(target, args))
        counts = ", ".join(f"{key} {value}" for key, value in reports[-1].items() if key not in ("target", "defects"))
        print(f"{target}: {counts}, defects {len(reports[-1]['defects'])}", flush=True)
        for defect in reports[-1]["defects"]:
            print(f"  {defect['what']} ({defect.get('count', 1)}): {defect['detail'][:300]}")
            print(f"    {defect['given'][:300]!r}")
    if args.json is not None:
        args.json.write_text(json.dumps(reports, indent=1))
    return int(any(report["defects"] for report in reports))


if __name__ == "__main__":
    sys.exit(main())
