"""Plans: which cells there are. A plan is a small TOML file; those of the package are in plans/."""

from __future__ import annotations

import fnmatch
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Any

from suite import plugins
from suite.benchmark import grids, references
from suite.benchmark import rules as limits
from suite.benchmark.cells import Cell
from suite.benchmark.conditions import CONDITIONS, inapplicable
from suite.benchmark.recovery import OURS, RIVALS
from suite.benchmark.worker import MEMORY
from suite.case import Case
from suite.errors import InputError

SHIPPED = Path(__file__).parent / "plans"
VARIANTS = ("default", "tuned")
KINDS = ("estimation", "recovery")
MOST = 1_000_000  # cells of a plan


@dataclass(frozen=True)
class Plan:
    """Patterns of names (shell style) and what they are crossed with; `noises` empty: those that each case states.

    `seeds` counts the judged seeds 0..seeds-1 of simulated cases; `limit` is the time-out of one cell in seconds,
    `memory` what it may take in MiB. An entry of `estimators` may be a grid, `ekf[q_scale=0.1,1,10]` (see grids).
    `exclude` are patterns of cases left out; with `tags` a case must have one of them; `most_states` bounds its size.
    `tuned_at` is the noise level at which tuned values are found for all levels, left out: each level has its own;
    `rules` keep expensive methods within the time of the plan.

    Kind "estimation" judges estimates of states and model error. Kind "recovery" judges whether a method names what is
    missing: its `estimators` are the methods, its `variants` the conditions, `seeds_of` the seeds of a condition or
    method that has fewer, `rival_variants` the conditions that rival methods are judged under.
    """

    name: str
    sentence: str
    cases: tuple[str, ...] = ("*",)
    estimators: tuple[str, ...] = ("*",)
    variants: tuple[str, ...] = VARIANTS
    noises: tuple[float, ...] = ()
    seeds: int = 20
    limit: float = 60.0
    memory: float = MEMORY
    kind: str = "estimation"
    exclude: tuple[str, ...] = ()
    tags: tuple[str, ...] = ()
    most_states: int | None = None
    seeds_of: Mapping[str, int] = field(default_factory=dict)
    rival_variants: tuple[str, ...] = CONDITIONS
    tuned_at: float | None = None
    rules: tuple[limits.Rule, ...] = ()

    def cells(self, runs: dict[str, int] | None = None) -> list[Cell]:
        """Every cell. A measured case (noise 0, as it is) is judged untuned, once a run: `runs` by case, else one."""
        if self.kind == "recovery":
            return self._recovery_cells()
        estimators = references.methods()
        picked = grids.chosen(self.estimators, estimators)
        cells: list[Cell] = []
        for case in self.chosen_cases():
            measured = case.truth is None
            for noise in (0.0,) if measured else self.noises or case.noises:
                for name, points in picked.items():
                    if name in references.REFERENCES:
                        count = 0 if measured else self.seeds
                        self._bounded(len(cells) + count)
                        cells += [Cell(case.name, noise, name, references.VARIANT, seed) for seed in range(count)]
                        continue
                    for variant in (*(self.variants if "" in points else ()), *filter(None, points)):
                        if variant == "tuned" and (measured or not estimators[name].tuning):
                            continue
                        count = (runs or {}).get(case.name, 1) if measured else self.seeds
                        count = limits.allowed(self.rules, name, variant, len(case.deficient.states), count)
                        self._bounded(len(cells) + count)
                        cells += [Cell(case.name, noise, name, variant, seed) for seed in range(count)]
        return cells

    @property
    def tuned_as(self) -> dict[str, str]:
        """Whose tuned values serve a method, where the rules say that they are not its own."""
        if self.kind == "recovery":
            return {}
        return limits.tuners(self.rules, {name: e.tuning for name, e in plugins.estimators().items()})

    def chosen_cases(self) -> list[Case]:
        """The cases of the plan."""
        cases = plugins.cases()
        chosen = [cases[name] for name in _chosen(self.cases, cases, "case")]
        return [
            case for case in chosen
            if not any(fnmatch.fnmatchcase(case.name, pattern) for pattern in self.exclude)
            and (not self.tags or set(self.tags) & set(getattr(case, "tags", ())))
            and (self.most_states is None or len(case.deficient.states) <= self.most_states)
        ]  # fmt: skip

    def _recovery_cells(self) -> list[Cell]:
        """Every case under the conditions that it has, for every method; a measured case has none."""
        effects = plugins.effects()
        methods = _chosen(self.estimators, dict.fromkeys((OURS, *RIVALS)), "method")
        cells: list[Cell] = []
        for case, method, condition in product(self.chosen_cases(), methods, self.variants):
            if method != OURS and condition not in self.rival_variants:
                continue
            if inapplicable(case, condition, effects) is not None:
                continue
            count = min(self.seeds, self.seeds_of.get(condition, self.seeds), self.seeds_of.get(method, self.seeds))
            noises = [noise for noise in self.noises or case.noises if noise > 0]
            self._bounded(len(cells) + count * len(noises))
            cells += [Cell(case.name, noise, method, condition, seed) for noise in noises for seed in range(count)]
        return cells

    def _bounded(self, cells: int) -> None:
        if cells > MOST:
            raise InputError(f"{self.name}: more than {MOST} cells; take fewer seeds, noises or points of a grid")


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
    except (RecursionError, ValueError):
        raise InputError(f"{path}: not TOML: nested too deeply or a number too long; simplify it") from None
    return parse(table, path.stem, str(path))


def parse(table: dict[str, Any], name: str, source: str) -> Plan:
    """A plan from its table; every entry is checked."""
    kinds: dict[str, tuple[Any, str]] = {
        "sentence": (str, "text"),
        "cases": (list, "a list of names"),
        "estimators": (list, "a list of names"),
        "variants": (list, "a list of default, tuned; of conditions in a plan of recovery"),
        "noises": (list, "a list of fractions"),
        "seeds": (int, "a whole number"),
        "limit": ((int, float), "seconds"),
        "memory": ((int, float), "MiB"),
        "kind": (str, "estimation or recovery"),
        "exclude": (list, "a list of names"),
        "tags": (list, "a list of tags"),
        "most_states": (int, "a whole number"),
        "seeds_of": (dict, "a table of seeds by condition or method"),
        "rival_variants": (list, "a list of conditions"),
        "tuned_at": ((int, float), "a fraction"),
        "rules": (list, "tables [[rules]]"),
    }
    for key, value in table.items():
        if key not in kinds:
            raise InputError(f"{source}: {key!r} is not an entry of a plan; it may have {', '.join(kinds)}")
        if not isinstance(value, kinds[key][0]) or isinstance(value, bool):
            raise InputError(f"{source}: {key} = {value!r}; expected {kinds[key][1]}")
        inner: Any = {"noises": (int, float), "rules": dict}.get(key, str)
        if isinstance(value, list) and not all(isinstance(item, inner) for item in value):
            raise InputError(f"{source}: {key} = {value!r}; expected {kinds[key][1]}")
    if table.get("kind", "estimation") not in KINDS:
        raise InputError(f"{source}: kind = {table['kind']!r}; expected one of {', '.join(KINDS)}")
    recovery = table.get("kind") == "recovery"
    known = CONDITIONS if recovery else VARIANTS
    for key in ("variants", "rival_variants"):
        if not set(table.get(key, [])) <= set(known):
            raise InputError(f"{source}: {key} = {table[key]!r}; expected some of {', '.join(known)}")
    counts = table.get("seeds_of", {})
    if not all(
        name in (*CONDITIONS, OURS, *RIVALS) and isinstance(count, int) and count > 0 for name, count in counts.items()
    ):
        raise InputError(f"{source}: seeds_of = {counts!r}; expected whole numbers by condition or method")
    positive = table.get("seeds", 1) >= 1 and min(table.get("limit", 1), table.get("memory", 1)) > 0
    if not positive or min(*table.get("noises", [0]), table.get("tuned_at", 0), 0) < 0:
        raise InputError(f"{source}: seeds, limit and memory must be positive, noises not negative; mend the plan")
    if recovery:
        table = {"variants": list(CONDITIONS), **table}
    grown: dict[str, Any] = {key: tuple(value) if isinstance(value, list) else value for key, value in table.items()}
    grown["rules"] = limits.parse(table.get("rules", []), VARIANTS, source)
    return Plan(name, **{"sentence": "", **grown})
