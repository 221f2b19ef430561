"""Reads a report of the laboratory as a browser does."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any


class Report(HTMLParser):
    """What a report contains, without its library."""

    def __init__(self, file: Path) -> None:
        super().__init__()
        self.maps = self.cells = 0
        self.names: list[str] = []
        self.plots: list[dict[str, Any]] = []
        self.loads: list[str] = []
        self._script: str | None = None
        text = file.read_text()
        self.feed(text)
        self.size = len(text.encode())
        library = re.compile(r"<script>/\*\*\n\* plotly\.js.*?</script>", re.DOTALL)
        self.text = library.sub("", text)
        assert len(library.findall(text)) == 1

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        named = dict(attributes)
        self.maps += tag == "table" and "map" in named.get("class", "").split()
        self.cells += tag == "td" and "title" in named
        self.names += [value for name, value in attributes if name == "id"]
        # Links within the page load nothing.
        targets = [value for name, value in attributes if name in ("src", "href")]
        self.loads += [target for target in targets if not target.startswith("#")]
        self._script = named.get("type") if tag == "script" else None

    def handle_data(self, data: str) -> None:
        if self._script == "application/json":
            self.plots.append(json.loads(data))

    def handle_endtag(self, tag: str) -> None:
        self._script = None

    def line(self, name: str) -> dict[str, Any]:
        """The first line of a name."""
        lines = [line for plot in self.plots for line in plot["data"]]
        return next(line for line in lines if line["name"] == name)
