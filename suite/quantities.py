"""Unit texts: read, compared and printed, by pint, which is loaded when the first unit is.

A temperature scale with an offset (degC, degF) counts as its degree (K, degR): rates and differences are all that the
equations are checked for, and there an offset drops out.
"""

from __future__ import annotations

import re
from functools import cache
from typing import Any

Unit = Any  # pint's

DEGREES = {
    "degree_Celsius": "kelvin", "delta_degree_Celsius": "kelvin",
    "degree_Fahrenheit": "degree_Rankine", "delta_degree_Fahrenheit": "degree_Rankine",
}  # fmt: skip
POWER = re.compile(r"\^\(?-?\d{1,2}(\.\d{1,3})?(/\d)?\)?(?!\^)")
WORDS = re.compile(r"[A-Za-z_°µμΩ%Δ()*/ ]+\Z")
COMMON = (
    "m", "mm", "cm", "km", "kg", "g", "s", "min", "h", "day", "N", "kN", "J", "kJ", "W", "kW", "Pa", "kPa", "bar", "V",
    "mV", "A", "mA", "F", "C", "ohm", "Hz", "rad", "deg", "K", "degC", "mol", "l", "ml",
)  # fmt: skip
KINDS = {
    "a mass": "kg", "a length": "m", "a time": "s", "a temperature": "K", "a force": "N", "a speed": "m/s",
    "an acceleration": "m/s^2", "an area": "m^2", "a volume": "m^3", "a stiffness": "N/m", "an energy": "J",
    "a power": "W", "a pressure": "Pa", "a density": "kg/m^3", "a current": "A", "a voltage": "V", "a charge": "C",
}  # fmt: skip


@cache
def _registry() -> Any:
    import pint

    from suite.kernels.cache import folder

    place = folder()
    registry: Any
    try:
        registry = pint.UnitRegistry(cache_folder=place / "pint") if place else pint.UnitRegistry()
    except Exception:  # a cache that another process is writing just now
        registry = pint.UnitRegistry()
    registry.define("@alias ohm = Ohm = Ω")
    return registry


def pure() -> Unit:
    """The unit of a pure number."""
    return _registry().dimensionless


@cache
def unit(text: str) -> Unit | None:
    """The unit that a text names ("N*s/m", "kg m^2", "1/s", "degC"), or None if it names none."""
    plain = text.replace("**", "^").replace("·", "*").replace("²", "^2").replace("³", "^3").strip()
    # A unit is names, powers, products and quotients; any other number in it is a slip, and costly to pint if large.
    rest = re.sub(r"(?<![\w.^])1(?=\s*/)", "", POWER.sub("", plain))
    if plain in ("1", "-"):
        return pure()
    if len(plain) > 80 or not WORDS.match(rest) or "**" in rest:
        return None
    registry = _registry()
    try:
        found = registry.parse_units(plain)
        for name, exponent in list(found._units.items()):
            if name in DEGREES:
                found = found / registry.Unit(registry.UnitsContainer({name: exponent}))
                found = found * registry.Unit(DEGREES[name]) ** exponent
        registry.get_root_units(found)
        # A logarithmic scale (dB) has no rate; pint refuses to divide it only where it stands within others.
        if not all(registry._is_multiplicative(name) for name in found._units):
            return None
    except Exception:  # pint has many ways to say that this is no unit
        return None
    return found


def close(text: str) -> str | None:
    """A common unit that differs in capitals only."""
    return next((name for name in COMMON if name.lower() == text.strip().lower()), None)


def factor(got: Unit, wanted: Unit) -> float | None:
    """How many of the wanted unit are in one of the other; None where they measure different things."""
    ratio = got / wanted
    if any(abs(exponent) > 1e-9 for exponent in ratio.dimensionality.values()):
        return None
    try:
        return float(_registry().get_root_units(ratio)[0])
    except OverflowError:  # a power too high for floating point: the equation's own trouble, not its units'
        return 1.0


def turns(of: Unit) -> bool:
    """Whether an angle is in it."""
    return "radian" in _registry().get_root_units(of)[1]._units


def compact(of: Unit) -> str:
    """The unit as people write it, such as N*s/m or 1/m^2/s^2; empty for a pure number. `unit` reads it back."""
    return f"{of:~C}".replace("**", "^")


def kind(of: Unit) -> str | None:
    """What a unit measures, in words, where there is a short one: "a mass"."""
    return next((name for name, text in KINDS.items() if factor(of, unit(text)) is not None), None)
