"""Waits for a page, whose policy forbids the `eval` of Playwright's `wait_for_function`."""

from __future__ import annotations

import json

from playwright.sync_api import Page

LONGEST = 30_000
"""Milliseconds."""


def wait_for(page: Page, condition: str) -> None:
    """Waits until an expression in JavaScript is true."""
    page.evaluate(
        f"""async () => {{
          const end = performance.now() + {LONGEST};
          while (!({condition})) {{
            if (performance.now() > end) throw new Error("not in time: " + {json.dumps(condition)});
            // By a timer: a browser without a screen may stop to draw, and then has no next frame.
            await new Promise((next) => setTimeout(next, 10));
          }}
        }}"""
    )
