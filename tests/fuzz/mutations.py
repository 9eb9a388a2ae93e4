"""Damage that a file suffers on its way, and what hostile people write: of bytes, of text, of a parsed document."""

from __future__ import annotations

from typing import Any

from hypothesis import strategies as st

NASTY_NUMBERS = (
    "0", "-0.0", "1e308", "1e309", "-1e400", "5e-324", "nan", "inf", "-inf", "1_000", "0x10", "1e", "--1", "1,5",
    "1.2.3", "9" * 400, "1e-400", "٣", "1 000", "+1", ".5", "5.", "1e+5", "1d3", "½", "∞",
)  # fmt: skip
NASTY_WORDS = (
    "", " ", "\t", "x" * 70, "\x00", "\x1b[31m", "\u202e", "\ufeff", "é", "💥", "\ud7ff", "'", '"', '"""', "\\",
    "{}", "%s", "{0.__class__}", "../../etc/passwd", "/etc/passwd", "fuzz_canary", "__import__('fuzz_canary')",
    "fuzz_canary.x", "lambda", "None", "a\nb", "a\r\nb", "=1+1", "$(true)", "a" * 100_000, "\x85", "\u2028",
)  # fmt: skip

numbers = st.one_of(
    st.integers(-(10**6), 10**6), st.floats(), st.sampled_from([0, -1, 10**18, 10**400, 1e308, 5e-324, -0.0])
)
words = st.one_of(st.sampled_from(NASTY_WORDS), st.text(max_size=12), st.sampled_from(NASTY_NUMBERS))


@st.composite
def bytewise(draw: st.DrawFn, seed: bytes) -> bytes:
    """The bytes with some of them changed, cut out, doubled, or the end missing."""
    data = bytearray(seed)
    for _ in range(draw(st.integers(1, 6))):
        at = draw(st.integers(0, max(len(data) - 1, 0)))
        length = draw(st.integers(1, 40))
        match draw(st.sampled_from(["flip", "cut", "double", "put", "end", "zero", "ones"])):
            case "flip" if data:
                data[at] ^= 1 << draw(st.integers(0, 7))
            case "cut":
                del data[at : at + length]
            case "double":
                data[at:at] = data[at : at + length]
            case "put":
                data[at:at] = draw(st.binary(min_size=1, max_size=12))
            case "end":
                del data[at:]
            case "zero":
                data[at : at + 4] = b"\0" * 4
            case "ones":
                data[at : at + 4] = b"\xff" * 4
    return bytes(data)


@st.composite
def textwise(draw: st.DrawFn, seed: str, pieces: tuple[str, ...] = ()) -> str:
    """The text with pieces put in, lines doubled, swapped or left out."""
    text = seed
    piece = st.one_of(words, st.sampled_from(pieces)) if pieces else words
    for _ in range(draw(st.integers(1, 4))):
        lines = text.split("\n")
        at = draw(st.integers(0, len(lines) - 1))
        match draw(st.sampled_from(["put", "double", "drop", "swap", "value"])):
            case "put":
                column = draw(st.integers(0, len(lines[at])))
                lines[at] = lines[at][:column] + draw(piece) + lines[at][column:]
            case "double":
                lines.insert(at, lines[at])
            case "drop":
                del lines[at]
            case "swap":
                other = draw(st.integers(0, len(lines) - 1))
                lines[at], lines[other] = lines[other], lines[at]
            case "value":
                key, sign, _ = lines[at].partition("=")
                lines[at] = f"{key}{sign}{draw(piece)}"
        text = "\n".join(lines)
    return text


values = st.recursive(
    st.one_of(st.booleans(), numbers, words, st.datetimes()),
    lambda inner: st.one_of(st.lists(inner, max_size=3), st.dictionaries(words, inner, max_size=3)),
    max_leaves=6,
)


@st.composite
def structural(draw: st.DrawFn, seed: dict[str, Any], keys: tuple[str, ...], texts: st.SearchStrategy[Any]) -> Any:
    """The document with some entries replaced, renamed, removed or added."""
    document = _copied(seed)
    for _ in range(draw(st.integers(1, 4))):
        places = list(_places(document))
        owner, key = draw(st.sampled_from(places)) if places else (document, "x")
        value = draw(st.one_of(values, texts))
        match draw(st.sampled_from(["replace", "rename", "remove", "add"])):
            case "replace":
                owner[key] = value
            case "rename" if isinstance(owner, dict):
                owner[draw(st.one_of(st.sampled_from(keys), words))] = owner.pop(key)
            case "remove":
                del owner[key]
            case "add" if isinstance(owner, dict):
                owner[draw(st.one_of(st.sampled_from(keys), words))] = value
    return document


def _copied(thing: Any) -> Any:
    if isinstance(thing, dict):
        return {key: _copied(value) for key, value in thing.items()}
    return [_copied(value) for value in thing] if isinstance(thing, list) else thing


def _places(thing: Any) -> Any:
    for key, value in list(thing.items() if isinstance(thing, dict) else enumerate(thing)):
        yield thing, key
        if isinstance(value, dict | list):
            yield from _places(value)
