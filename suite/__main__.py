"""The command line. Heavy imports wait inside the verbs, so that --help answers at once."""

from __future__ import annotations

import signal
import sys

# Until `ending` sees to it, an interrupt of the command ends it without a word; one that is ignored stays so.
if (__name__ == "__main__" or sys.argv[0].endswith("unmodelled")) and (
    signal.getsignal(signal.SIGINT) is signal.default_int_handler
):
    signal.signal(signal.SIGINT, signal.SIG_DFL)

import argparse
import contextlib
import warnings
from collections.abc import Sequence
from pathlib import Path

from suite import __version__, bench_verbs, ending, fleet_verb
from suite.errors import InputError

DONE, FAILED, BAD_INPUT = 0, 1, 2


def parser() -> argparse.ArgumentParser:
    """The verbs and their arguments."""
    top = argparse.ArgumentParser(
        prog="unmodelled",
        description="Find which physical effect an ODE model lacks, and judge the estimators that claim to.",
        epilog="Exit codes: 0 done, 1 a finding of failure that was asked for, 2 bad input.",
    )
    top.add_argument("--version", action="version", version=f"unmodelled {__version__}")
    verbs = top.add_subparsers(dest="verb", required=True, metavar="VERB")
    as_json = argparse.ArgumentParser(add_help=False)
    as_json.add_argument("--json", action="store_true", help="one JSON object alone on standard output")
    inputs = argparse.ArgumentParser(add_help=False)
    inputs.add_argument("model", type=Path, metavar="MODEL", help="model file (TOML)")
    inputs.add_argument(
        "data", type=Path, nargs="+", metavar="DATA", help="CSV, parquet or MAT; several are several runs"
    )
    search = argparse.ArgumentParser(add_help=False)
    search.add_argument(
        "--absolute", action="store_true", help="allow effects that depend on a state no equation depends on"
    )

    verb = verbs.add_parser("example", parents=[as_json], help="a ready model and data to start from")
    verb.add_argument("name", metavar="NAME", help="paper, mug, whiffle, or a case of `unmodelled list`")
    verb.add_argument("folder", type=Path, metavar="DIR", help="folder to write model.toml and data*.csv to")
    verb.add_argument("--noise", type=float, default=0.05, help="simulated: sensor noise, default 0.05 of each spread")
    verb.add_argument("--seed", type=int, default=1, help="simulated: seed of the noise, default 1")
    # --source is its former name.
    verb.add_argument(
        "--data", "--source", type=Path, metavar="DIR", help="folder of measured data that are not shipped"
    )
    verb = verbs.add_parser("list", parents=[as_json], help="every plug-in by kind; those not loaded, and why")
    verb.add_argument("--effects", type=Path, metavar="DIR", help="write the effects as a page with pictures instead")
    verb = verbs.add_parser(
        "check", parents=[inputs, as_json], help="what is in the data, and what would spoil an analysis"
    )
    verb.add_argument("--strict", action="store_true", help="exit with 1 if there is a finding")
    verb = verbs.add_parser(
        "compare", parents=[inputs, as_json], help="simulate: fit, error against noise, where it fails"
    )
    verb.add_argument("--refit", action="store_true", help="fit the parameters first")
    verb = verbs.add_parser(
        "diagnose", parents=[inputs, search, as_json], help="ranked missing effects and the verdict; --each: of a fleet"
    )
    fleet_verb.add_arguments(verb)
    verb = verbs.add_parser("add", parents=[as_json], help="write the model with an effect added")
    verb.add_argument("model", type=Path, metavar="MODEL", help="model file (TOML)")
    verb.add_argument("effect", metavar="EFFECT", help="an effect of `unmodelled list`")
    verb.add_argument("--equation", metavar="NAME", help="the state in whose rate it acts, where there is a choice")
    verb.add_argument("--term", metavar="TEXT", help="the term, where the effect has several there")
    verb.add_argument("--data", type=Path, nargs="+", default=[], metavar="DATA", help="refit to these data")
    verb.add_argument("-o", "--output", type=Path, required=True, metavar="NEW.toml", help="file to write")
    verb = verbs.add_parser(
        "discover", parents=[inputs, search, as_json], help="compare, diagnose, add, until it is noise"
    )
    verb.add_argument(
        "-o", "--output", type=Path, required=True, metavar="DIR", help="models, ledger, figures, report.html"
    )
    verb = verbs.add_parser("watch", parents=[as_json], help="sample by sample: the model error, and an alarm")
    verb.add_argument("model", type=Path, metavar="MODEL", help="model file (TOML)")
    verb.add_argument("data", metavar="DATA", help="a CSV file, or - for lines on standard input as they come")
    verb.add_argument("--effect", metavar="ID", help="follow the coefficients of this effect of `unmodelled list`")
    verb.add_argument("--equation", metavar="NAME", help="the state in whose rate it acts, where there is a choice")
    verb.add_argument("--term", metavar="TEXT", help="the term, where the effect has several there")
    verb.add_argument("--memory", type=float, metavar="TIME", help="how long the past counts, default 200 samples")
    verb.add_argument("--false-alarms", type=float, metavar="RATE", help="a sample of a right model, default 1e-5")
    verb.add_argument("--first", type=int, metavar="N", help="samples to set up on, default 40, or 200 without sigma")
    verb.add_argument("--exact", action="store_true", help="the parameters are exact, whatever the model file says")
    verb.add_argument("--strict", action="store_true", help="exit with 1 if there was an alarm")
    bench_verbs.add_parser(verbs)
    verb = verbs.add_parser("serve", parents=[as_json], help="the workbench page on 127.0.0.1")
    verb.add_argument("model", type=Path, nargs="?", metavar="MODEL", help="model file (TOML) to open")
    verb.add_argument("data", type=Path, nargs="*", metavar="DATA", help="CSV, parquet or MAT files of its runs")
    verb.add_argument("--port", type=int, metavar="N", help="default the first free one from 8420; 0: any")
    verb.add_argument("--store", type=Path, metavar="FILE", help="results of `bench run`, to look at in the page")
    verb.add_argument("--no-browser", action="store_true", help="print the address only")
    verb = verbs.add_parser("new", parents=[as_json], help="a commented plug-in file that passes `unmodelled test`")
    verb.add_argument("kind", choices=("estimator", "case", "effect"), help="what to write")
    verb.add_argument("name", metavar="NAME", help="its name, such as my-filter")
    verb.add_argument("-o", "--output", type=Path, metavar="DIR", help="folder to write to, default where it is found")
    verb.add_argument("--package", action="store_true", help="a folder NAME to install, with the entry point")
    verb = verbs.add_parser("test", parents=[as_json], help="the contract checks of plug-ins; 1 if one fails")
    verb.add_argument("names", nargs="*", metavar="NAME|FILE.py", help="plug-ins of `unmodelled list`, default all")
    return top


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command, by default that of this process; returns its exit code."""
    if argv is None:
        ending.prepare()
    try:
        args = _parsed(argv)
        warnings.showwarning = _one_line
        # What numerics meet on the way (an overflow in a trial step) is no news; its outcome is.
        warnings.simplefilter("ignore", RuntimeWarning)
        warnings.filterwarnings("default", "compiled code cannot be kept")
        code = _run(args)
        # Here, where a full disk is a sentence.
        sys.stdout.flush()
        return code
    except InputError as error:
        return _refused(str(error))
    except BrokenPipeError:
        ending.unread()
        return DONE
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        return _refused(f"{where}{error.strerror or error}; check the path and the space left")
    except MemoryError:
        return _refused("memory: there is not enough for these data; take fewer samples, or another machine")
    except KeyboardInterrupt:
        _tell("stopped; what was finished is kept")
        return ending.INTERRUPTED
    finally:
        if argv is None:
            ending.finish()


def _parsed(argv: Sequence[str] | None) -> argparse.Namespace:
    try:
        return parser().parse_args(argv)
    except SystemExit:
        # What --help and --version wrote is not lost in silence.
        sys.stdout.flush()
        raise


def _run(args: argparse.Namespace) -> int:
    if args.verb == "bench":
        return bench_verbs.run(args)
    if args.verb == "diagnose" and fleet_verb.asked(args):
        return fleet_verb.run(args)
    if args.verb == "watch":
        from suite import watch_verb

        return watch_verb.run(args)
    if args.verb == "serve":
        from suite.web import verb

        return verb.run(args)
    if args.verb == "list":
        from suite import listing

        return listing.run(args)
    if args.verb == "new":
        from suite import scaffold

        return scaffold.run(args)
    if args.verb == "test":
        from suite import contract

        return contract.run(args)
    from suite import verbs

    return int(getattr(verbs, args.verb)(args))


def _refused(sentence: str) -> int:
    _tell(sentence)
    # What did not reach standard output is dropped: it would fail again at exit.
    ending.unread()
    return BAD_INPUT


def _tell(sentence: str) -> None:
    # Where nobody reads it the exit code says it.
    with contextlib.suppress(OSError):
        print(f"unmodelled: {sentence}", file=sys.stderr)


def _one_line(message: Warning | str, *_: object, **__: object) -> None:
    print(f"unmodelled: note: {message}", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(main())
