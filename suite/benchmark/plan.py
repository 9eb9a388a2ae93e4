"""Plans: which cells there are. A plan is a small TOML file; those of the package are in plans/."""

from __future__ import annotations

import fnmatch
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from suite import plugins
from suite.benchmark.cells import Cell
from suite.errors import InputError

SHIPPED = Path(__file__).parent / "plans"
VARIANTS = ("default", "tuned")


@dataclass(frozen=True)
class Plan:
    """Patterns of names (shell style) and what they are crossed with; `noises` empty: those that each case states.

    `seeds` counts the judged seeds 0..seeds-1 of simulated cases; `limit` is the time-out of one cell in seconds.
    """

    name: str
    sentence: str
    cases: tuple[str, ...] = ("*",)
    estimators: tuple[str, ...] = ("*",)
    variants: tuple[str, ...] = VARIANTS
    noises: tuple[float, ...] = ()
    seeds: int = 20
    limit: float = 60.0

    def cells(self, runs: dict[str, int] | None = None) -> list[Cell]:
        """Every cell. A measured case (noise 0, as it is) is judged untuned, once a run: `runs` by case, else one."""
        cases, estimators = plugins.cases(), plugins.estimators()
        cells = []
        for case in (cases[name] for name in _chosen(self.cases, cases, "case")):
            measured = case.truth is None
            for noise in (0.0,) if measured else self.noises or case.noises:
                for name in _chosen(self.estimators, estimators, "estimator"):
                    for variant in self.variants:
                        if variant == "tuned" and (measured or not estimators[name].tuning):
                            continue
                        count = (runs or {}).get(case.name, 1) if measured else self.seeds
                        cells += [Cell(case.name, noise, name, variant, seed) for seed in range(count)]
        return cells


def _chosen(patterns: Sequence[str], known: dict[str, Any], kind: str) -> list[str]:
    chosen = {name: None for pattern in patterns for name in known if fnmatch.fnmatchcase(name, pattern)}
    if not chosen and known:
        raise InputError(f"no {kind} is named like {', '.join(patterns)}; there are {', '.join(known)}")
    return list(chosen)


def shipped() -> list[str]:
    """Names of the plans of the package."""
    return sorted(path.stem for path in SHIPPED.glob("*.toml"))


def load(name: str) -> Plan:
    """A plan by its name or from a TOML file; InputError says what is wrong with it."""
    path = SHIPPED / f"{name}.toml" if name in shipped() else Path(name)
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError):
        raise InputError(f"no plan {name!r}: it is neither a readable file nor one of {', '.join(shipped())}") from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path}: not TOML: {error}") from None
    return parse(table, path.stem, str(path))


def parse(table: dict[str, Any], name: str, source: str) -> Plan:
    """A plan from its table; every entry is checked."""
    kinds: dict[str, tuple[Any, str]] = {
        "sentence": (str, "text"),
        "cases": (list, "a list of names"),
        "estimators": (list, "a list of names"),
        "variants": (list, "a list of default, tuned"),
        "noises": (list, "a list of fractions"),
        "seeds": (int, "a whole number"),
        "limit": ((int, float), "seconds"),
    }
    for key, value in table.items():
        if key not in kinds:
            raise InputError(f"{source}: {key!r} is not an entry of a plan; it may have {', '.join(kinds)}")
        if not isinstance(value, kinds[key][0]) or isinstance(value, bool):
            raise InputError(f"{source}: {key} = {value!r}; expected {kinds[key][1]}")
        inner: Any = (int, float) if key == "noises" else str
        if isinstance(value, list) and not all(isinstance(item, inner) for item in value):
            raise InputError(f"{source}: {key} = {value!r}; expected {kinds[key][1]}")
    if not set(table.get("variants", [])) <= set(VARIANTS):
        raise InputError(f"{source}: variants = {table['variants']!r}; expected some of {', '.join(VARIANTS)}")
    if table.get("seeds", 1) < 1 or table.get("limit", 1) <= 0 or min(table.get("noises", [0])) < 0:
        raise InputError(f"{source}: seeds and limit must be positive, noises not negative; mend the plan")
    grown: dict[str, Any] = {key: tuple(value) if isinstance(value, list) else value for key, value in table.items()}
    return Plan(name, **{"sentence": "", **grown})
