"""The files of the page, which lie beside this module."""

from __future__ import annotations

import mimetypes
from pathlib import Path

from starlette.routing import Mount
from starlette.staticfiles import StaticFiles

STATIC = Path(__file__).parent / "static"

# What the system's own table says of these varies; a browser runs a module only as JavaScript.
for kind, suffix in (("text/javascript", ".js"), ("text/css", ".css"), ("image/svg+xml", ".svg")):
    mimetypes.add_type(kind, suffix)

MOUNT = Mount("/static", StaticFiles(directory=STATIC))
