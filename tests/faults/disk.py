"""A full disk, a folder that cannot be written, an output that nobody reads."""

from __future__ import annotations

import os
import random
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import places
import whole
from outcome import Outcome
from process import Command, Ended
from process import run as cold_run
from subjects import SUBJECTS, Subject
from warm import run

REFUSED = (2,)


def full_disk(folder: Path, rng: random.Random) -> Outcome:
    """A discovery and a fleet meet a full disk while they write; with room they end as if nothing had been."""
    found = Outcome("full disk")
    for name in ("discover", "fleet"):
        subject, usual = SUBJECTS[name], folder / f"{name}-usual"
        subject.prepare(usual)
        found.check(name, run(subject.words, usual), (0,), usual)
        taken = sum(path.stat().st_blocks / 2 for path in (usual / "out").rglob("*"))
        for share in (0.1, 0.5, 0.9):
            work = folder / f"{name}-{share}"
            subject.prepare(work)
            with places.small_disk(work / "out", int(share * taken)):
                _full(found, f"{name} with room for {share:.0%}", subject, work, work / "out")
                found.expect(subject.outcome(work) == subject.outcome(usual), f"{name}: another result")
    return found


def full_store(folder: Path, rng: random.Random) -> Outcome:
    """The benchmark's store cannot grow any more: what is in it stays, and the run goes on from there."""
    found, usual = Outcome("full disk under a store"), SUBJECTS["bench"]
    place = f"disk/{usual.store}"
    words = [place if word == usual.store else word for word in usual.words]
    subject = replace(usual, words=words, store=place, made=place)
    subject.prepare(folder)
    with places.small_disk(folder / "disk", 400) as disk:
        kept = _full(found, "bench", subject, folder, disk)
        found.expect(0 < kept < subject.parts, f"{kept} rows when the disk was full")
    return found


def _full(found: Outcome, what: str, subject: Subject, work: Path, disk: Path) -> int:
    """Run on a disk that is too small, look, give it room, run again; the rows that were kept meanwhile."""
    found.check(what, run(subject.words, work), REFUSED)
    found.expect(not whole.left_behind(work), f"{what}: {whole.left_behind(work)} are left")
    places.resize(disk, 100_000)
    found.faults += [f"{what}: half written: {sentence}" for sentence in whole.broken(work)]
    kept = subject.rows(work)
    found.check(f"{what}, then all of it", run(subject.words, work), (0,), work)
    now = subject.rows(work)
    found.expect(
        all(now.get(key) == row for key, row in kept.items()), f"{what}: a finished part was lost or run again"
    )
    found.expect(not subject.store or len(now) == subject.parts, f"{what}: {len(now)} of {subject.parts} parts")
    return len(kept)


def read_only(folder: Path, rng: random.Random) -> Outcome:
    """Every verb that writes, into a folder where nothing may be written."""
    found = Outcome("read-only folder")
    SUBJECTS["discover"].prepare(folder)
    closed = folder / "closed"
    closed.mkdir()
    made = run(("bench", "run", "--plan", "plan.toml", "--store", "ok.sqlite", "--seeds", "1"), folder)
    found.check("bench", made, (0,), folder)
    verbs: tuple[Sequence[str], ...] = (
        ("discover", "model.toml", "mug0.csv", "-o", "closed"),
        ("discover", "model.toml", "mug0.csv", "-o", "closed/new"),
        ("diagnose", "model.toml", "mug*.csv", "--each", "-o", "closed"),
        ("example", "paper", "closed"),
        ("add", "model.toml", "quadratic_term", "-o", "closed/new.toml"),
        ("new", "estimator", "mine", "-o", "closed"),
        ("bench", "run", "--plan", "plan.toml", "--store", "closed/new.sqlite"),
        ("bench", "report", "--store", "ok.sqlite", "-o", "closed"),
        ("bench", "plot", "--store", "ok.sqlite", "-o", "closed"),
        ("bench", "table", "--store", "ok.sqlite", "-o", "closed/new.csv"),
        ("bench", "recovery", "--store", "ok.sqlite", "-o", "closed"),
        ("list", "--effects", "closed"),
    )
    with places.read_only(closed) as front:
        for words in verbs:
            found.check(" ".join(words), Command(words, folder, prefix=front).ended(), REFUSED, folder)
    found.expect(not list(closed.iterdir()), "something was written")
    return found


def unread(folder: Path, rng: random.Random) -> Outcome:
    """Standard streams that are full, closed, or whose reader has gone."""
    found = Outcome("streams that are full, closed or not read")
    SUBJECTS["discover"].prepare(folder)
    gone, mouth = os.pipe()
    os.close(gone)
    full = os.open("/dev/full", os.O_WRONLY)
    short: tuple[Sequence[str], ...] = (("--help",), ("list",), ("compare", "model.toml", "mug0.csv", "--json"))
    for words in short:
        found.check(f"{words[0]} > /dev/full", Command(words, folder, stdout=full).ended(), REFUSED, None, "space")
        found.check(f"{words[0]} | true", Command(words, folder, stdout=mouth).ended(), (0,))
        found.check(f"{words[0]} >&- 2>&-", _closed(words, folder, ">&- 2>&- <&-"), (0,))
    refused = ("compare", "nothing.toml", "mug0.csv")
    found.check("2> /dev/full", Command(refused, folder, stderr=full).ended(), REFUSED, heard=False)
    found.check("2>&-", _closed(refused, folder, "2>&-"), REFUSED, heard=False)
    watched = Command(("watch", "model.toml", "mug0.csv"), folder, stdout=mouth)
    found.check("watch | true", watched.ended(), (0,))
    os.close(mouth)
    os.close(full)
    return found


def _closed(words: Sequence[str], folder: Path, how: str) -> Ended:
    return Command(words, folder, prefix=("sh", "-c", f'exec "$@" {how}', "sh")).ended()


def no_cache(folder: Path, rng: random.Random) -> Outcome:
    """The folder of compiled code cannot be written, or is full, or there is no home: a note, and the same numbers."""
    found = Outcome("no room or right for compiled code")
    SUBJECTS["discover"].prepare(folder)
    words = ("compare", "model.toml", "mug0.csv")
    usual = cold_run(words, folder)
    found.check("usual", usual, (0,), folder)
    closed = folder / "closed"
    closed.mkdir()
    with places.read_only(closed) as front:
        for what, environment in (
            ("a read-only cache", {"UNMODELLED_CACHE": str(closed / "cache")}),
            ("no home", {"HOME": "", "XDG_CACHE_HOME": "", "UNMODELLED_CACHE": ""}),
        ):
            ended = Command(words, folder, environment, front).ended()
            found.check(what, ended, (0,), folder, "compiled code cannot be kept")
            found.expect(ended.out == usual.out, f"{what}: other numbers")
    with places.small_disk(folder / "disk", 64) as disk:
        ended = cold_run(words, folder, {"UNMODELLED_CACHE": str(disk)})
        found.check("a full cache", ended, (0,), folder, "compiled code cannot be kept")
        found.expect(ended.out == usual.out, "a full cache: other numbers")
    return found
