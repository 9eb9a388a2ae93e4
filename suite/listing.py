"""`unmodelled list`: every plug-in by kind, and the effects as a page with pictures."""

from __future__ import annotations

import argparse
import json
from typing import Any

from suite import plugins
from suite.files import writable_folder


def run(args: argparse.Namespace) -> int:
    """Print every plug-in by kind and those that could not be loaded, or write the page of the effects."""
    if args.effects is not None:
        return _effects(args)
    found = {kind: plugins.find(kind) for kind in plugins.KINDS}
    if args.json:
        kinds = {
            kind: {"loaded": {n: _says(item) for n, item in f.loaded.items()}, "failed": f.failed}
            for kind, f in found.items()
        }
        print(json.dumps(kinds, indent=1, ensure_ascii=False))
        return 0
    for kind, entry in found.items():
        print(f"{kind} ({len(entry.loaded)})")
        width = max(map(len, entry.loaded), default=0)
        for name, item in entry.loaded.items():
            print(f"  {name:<{width}}  {_says(item)}")
        for label, reason in entry.failed.items():
            print(f"  not loaded: {label}: {reason}")
    return 0


def _effects(args: argparse.Namespace) -> int:
    """Write effects.md and a picture of each effect."""
    from suite.report import effect_page

    writable_folder(args.effects)
    paths = [str(path) for path in effect_page.write(plugins.effects(), args.effects)]
    if args.json:
        print(json.dumps({"files": paths}, indent=1, ensure_ascii=False))
    else:
        print(f"Wrote {paths[-1]} and {len(paths) - 1} pictures beside it")
    return 0


def _says(item: Any) -> str:
    """A plug-in's own sentence."""
    text = getattr(item, "sentence", None) or (type(item).__doc__ or "").strip()
    return str(text).split("\n")[0]
