"""What the cases of a drug in the blood share: one compartment, several subjects as runs, the last one judged."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from suite.case import Case, Held
from suite.measured import numbers, packaged, run
from suite.model import Initial, Model, Output, Parameter
from suite.record import Record, join


def drug(name: str, sentence: str, package: str, table: str, time: str, k: Parameter, first: float) -> Case:
    """A case from a table with the columns Subject, `time` and conc; `k` and `first` are rough starts."""

    def subjects() -> tuple[Record, ...]:
        frame = packaged(name, package, table)
        subject, t, conc = numbers(frame, "Subject"), numbers(frame, time), numbers(frame, "conc")
        rows = [subject == number for number in np.unique(subject)]
        return tuple(run(f"subject {i + 1}", t[row], [], [conc[row]]) for i, row in enumerate(rows))

    def measured(folder: Path | None) -> Record:
        return join(subjects()[:-1])

    def held_out(folder: Path | None) -> Mapping[str, Held]:
        last = subjects()[-1]
        return {last.source: Held(last)}

    model = Model(
        name="one compartment",
        states={"C": "-k*C"},
        parameters={"k": k},
        outputs={"conc": Output("C", column="conc")},
        initial={"C": Initial(first, estimate=True)},
    )
    tags = ("measured", "compartment")
    return Case(name, sentence, model, measured=measured, noises=(0.0,), held_out=held_out, tags=tags)
