"""What is held out of a fit, to judge it on."""

from __future__ import annotations

from dataclasses import dataclass

from suite.record import Record, join

ENOUGH = 60  # samples of a single run from which the last part is held out
HELD = 0.3  # of a single run: the part that is held out


@dataclass(frozen=True)
class Split:
    """What is fitted (`train`) and what is judged: the samples of `judged` from number `first`; its unknown first state
    is fitted to the share `lead` of it.
    """

    train: Record
    judged: Record
    lead: float
    first: int


def split(record: Record) -> Split | None:
    """Hold out the last of several runs, else the last 30 % of a long one; None for short records.

    A held-out run's unknown first state is fitted to it, with all parameters fixed; the held-out part of a single run
    is simulated through from the first sample.
    """
    runs = record.runs
    if len(runs) > 1:
        return Split(join(runs[:-1]), runs[-1], 1.0, 0)
    if len(record) < ENOUGH:
        return None
    first = int((1 - HELD) * len(record))
    return Split(record.part(0, first), record, first / len(record), first)
