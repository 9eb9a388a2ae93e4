"""Links of a page to a file of the repository that is no page: the file is copied beside the site's pages."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

LINK = re.compile(r"\]\(\.\./(results/[\w./-]+)\)")


def on_files(files: Files, /, config: Any, **_: Any) -> Files:
    """Add every file of results/ that a page links to."""
    root = Path(config["docs_dir"]).parent
    linked = {path for file in files.documentation_pages() for path in LINK.findall(file.content_string)}
    for path in sorted(linked):
        files.append(File.generated(config, path.replace(".md", ".txt"), abs_src_path=str(root / path)))
    return files


def on_page_markdown(markdown: str, /, **_: Any) -> str:
    """Point those links at the copies; a page of results/ is shown as it is."""
    return LINK.sub(lambda found: f"]({found[1].replace('.md', '.txt')})", markdown)
