"""How deep a text nests, before anything reads it: a parser's own limit ends in an error of its own."""

from __future__ import annotations

import re

DEEPEST = 100
TOKEN = re.compile(r"\*\*|[-+~*/%@,()\[\]{}]|[^-+~*/%@,()\[\]{}\s]+")
OPENING = frozenset(["(", "[", "{", "+", "-", "~", "*", "/", "%", "@", ",", "**"])  # after these a sign is unary


def nesting(text: str) -> int:
    """A bound of the syntax tree's depth, read off the characters; stops above DEEPEST.

    Brackets nest; without a bracket so do signs (----x) and powers (x**y**z), until a sum, product or comma.
    """
    chains = [0]
    depth = deepest = 0
    operand = False
    for token in TOKEN.findall(text):
        if token in "([{":
            chains.append(0)
            depth += 1
        elif token in ")]}":
            depth -= chains.pop() + 1 if len(chains) > 1 else 0
        elif token == "**" or (token in "+-~" and not operand):
            chains[-1] += 1
            depth += 1
        elif token in "+-~*/%@,":
            depth -= chains[-1]
            chains[-1] = 0
        operand = token not in OPENING
        deepest = max(deepest, depth)
        if deepest > DEEPEST:
            break
    return deepest
