"""Takes the README's picture of the page that `boost-lab live` writes, in Chromium:

python tests/fmu/pages/picture.py target/live.html docs/live.png
"""

from __future__ import annotations

import io
import shutil
import sys
from pathlib import Path

from PIL import Image
from playwright.sync_api import Browser, sync_playwright

from fmu.pages.waiting import wait_for

STEPS = {0: 125, 3: 150, 12: 170, 22: 140}
"""Of the reference: time (s), boost pressure (kPa)."""

END = 30
"""When the picture is taken (s)."""

SIZE = {"width": 1366, "height": 768}

COLORS = 256
"""Of the picture: with fewer, thin lines lose theirs."""

PLAY = """([steps, end]) => {
  const slider = document.getElementById("boost_reference");
  while (live.run.now < end) {
    const value = steps.findLast(([time]) => time <= live.run.now)[1];
    if (Number(slider.value) !== value) {
      slider.value = value;
      slider.dispatchEvent(new Event("input"));
    }
    live.run.step();
  }
}"""


def take(browser: Browser, page_file: Path, out: Path) -> None:
    """The same steps, whatever the machine's pace."""
    # The page waits to be run.
    page = browser.new_page(viewport=SIZE, reduced_motion="reduce", color_scheme="light")
    page.goto(page_file.resolve().as_uri())
    wait_for(page, "globalThis.live?.run")
    page.evaluate(PLAY, [list(STEPS.items()), END])
    wait_for(page, "[...document.querySelectorAll('.plot')].every((plot) => plot.data[0].x.at(-1) > 29.9)")
    page.evaluate("document.getElementById('status').textContent = ''")
    picture = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    page.close()
    picture.quantize(COLORS, dither=Image.Dither.NONE).save(out, optimize=True)


if __name__ == "__main__":
    with sync_playwright() as playwright:
        take(playwright.chromium.launch(executable_path=shutil.which("chromium")), *map(Path, sys.argv[1:]))
