"""A page in Chromium, and which there are."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from playwright.sync_api import Page

from fmu import TARGET
from fmu.pages.waiting import wait_for

HEIGHT = 900

FMUS = ["BoostPlant", "BoostController"]

REPORTS = ["reproduction", "identification", "tuning", "simulation", "comparison", "system", "study", "sweep"]

LIVE = "live"

LINEAR = "linearization"

PAGES = [*FMUS, *REPORTS, LINEAR, LIVE]

PICTURES = TARGET / "pages"
"""Which `sheet.py` puts on one sheet."""


@dataclass
class Visit:
    """A page as it was opened, and what was found at each width."""

    page: Page
    messages: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)
    found: dict[int, dict[str, Any]] = field(default_factory=dict)

    def open(self, file: Path) -> None:
        self.page.on("console", lambda message: self.messages.append(message.text))
        self.page.on("pageerror", lambda error: self.messages.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(file.as_uri())
        # The figures' script says when it has drawn them.
        wait_for(self.page, "!document.querySelector('.panel') || document.documentElement.dataset.drawn")

    def at(self, width: int) -> Page:
        """The page in a window of a width."""
        self.page.set_viewport_size({"width": width, "height": HEIGHT})
        # The plots follow the window's size a little later.
        wait_for(
            self.page,
            "[...document.querySelectorAll('.plot')].every("
            "(plot) => Math.abs(plot.clientWidth - plot._fullLayout.width) < 2)",
        )
        return self.page
