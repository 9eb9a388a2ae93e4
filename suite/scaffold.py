"""`unmodelled new`: a commented plug-in file that passes `unmodelled test` as it stands, to be changed from there."""

from __future__ import annotations

import argparse
import importlib.util
import json
import keyword
import re
import shlex
import tomllib
from pathlib import Path

import suite
from suite import plugins
from suite.errors import InputError
from suite.files import writable_folder, write_whole

NAME = re.compile(r"[a-z][a-z0-9]*([-_][a-z0-9]+)*\Z")
KINDS = {"estimator": "estimators", "case": "cases", "effect": "effects"}
TEMPLATES = Path(__file__).parent / "templates"


def run(args: argparse.Namespace) -> int:
    """Write the file (and with --package a distribution around it), then say where it is and what comes next."""
    name = checked(args.kind, args.name)
    module = name.replace("-", "_")
    clone = _clone(args.kind)
    registered = args.output is None and not args.package and clone is not None
    folder = args.output or (clone if registered and clone is not None else Path.cwd())
    folder = folder / name if args.package else folder
    file = folder / f"{module}.py"
    project = folder / "pyproject.toml"
    for path in (file, project) if args.package else (file,):
        if path.exists():
            raise InputError(f"{path}: is there already and stays as it is; choose another name, or another -o")
    if not registered and importlib.util.find_spec(module) is not None:
        raise InputError(
            f"{name!r}: Python has a module {module} already, which this one would hide; choose another name"
        )
    writable_folder(folder)
    write_whole(file, _filled(f"{args.kind}.py.txt", name, args.kind))
    written = [file]
    if args.package:
        write_whole(project, _filled("pyproject.toml.txt", name, args.kind))
        written.append(project)
    here = shlex.quote(str(file))
    if registered:
        steps = [f"its place registers it; test it: unmodelled test {name}"]
    elif args.package:
        steps = [f"install it: pip install -e {shlex.quote(str(folder))}", f"test it: unmodelled test {name}"]
    else:
        steps = [
            f"test it: unmodelled test {here}",
            f"it is registered nowhere yet: move it into {KINDS[args.kind]}/ of a clone of unmodelled, or install it "
            f'with an entry point, [project.entry-points."unmodelled.{KINDS[args.kind]}"] {name} = "{module}", '
            f"as `unmodelled new {args.kind} {name} --package` writes it",
        ]
    if args.kind == "estimator":
        steps.append(f"once it is registered, judge it: unmodelled bench run --plan quick --only {name}")
    elif args.kind == "case":
        steps.append(
            f'once it is registered, judge on it: cases = ["{name}"] in plan.toml, '
            "unmodelled bench run --plan plan.toml"
        )
    if args.json:
        print(json.dumps({"files": [str(path) for path in written], "registered": registered, "next": steps}, indent=1))
    else:
        print("\n".join([f"Wrote {' and '.join(map(str, written))}", *(f"- {step}" for step in steps)]))
    return 0


def checked(kind: str, name: str) -> str:
    """The name as the plug-in will have it; InputError where it is none or is taken."""
    if not NAME.match(name) or len(name) > 64:
        raise InputError(f"{name!r}: a name is small letters and digits with - between words; write my-{kind}")
    # An effect's id stands in formulas and files, where - would be a minus.
    name = name.replace("-", "_") if kind == "effect" else name
    if keyword.iskeyword(name) or name in KINDS or name == "suite":
        raise InputError(f"{name!r}: the name is taken by the language; write my-{name}")
    taken = plugins.estimators() if kind == "estimator" else plugins.find(KINDS[kind]).loaded
    if name in taken:
        raise InputError(
            f"{name!r}: there is {_article(kind)} of this name; `unmodelled list` names all, choose another"
        )
    return name


def _article(kind: str) -> str:
    return f"{'a' if kind == 'case' else 'an'} {kind}"


def _clone(kind: str) -> Path | None:
    """The plug-in folder of the clone that is running, if the current folder is in it."""
    root = Path(suite.__file__).resolve().parent.parent
    project = root / "pyproject.toml"
    if not Path.cwd().resolve().is_relative_to(root) or not project.is_file():
        return None
    ours = tomllib.loads(project.read_text(encoding="utf-8")).get("project", {}).get("name") == "unmodelled"
    return root / KINDS[kind] if ours else None


def _filled(template: str, name: str, kind: str) -> str:
    """A template with the plug-in's names in it."""
    words = re.split("[-_]", name)
    names = {
        "NAME": name,
        "MODULE": name.replace("-", "_"),
        "CLASS": "".join(word.capitalize() for word in words),
        "KINDS": KINDS[kind],
    }
    text = (TEMPLATES / template).read_text(encoding="utf-8")
    return re.sub(r"@(NAME|MODULE|CLASS|KINDS)@", lambda match: names[match[1]], text)
