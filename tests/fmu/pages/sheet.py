"""Puts the pictures that the tests of pages took on one sheet, sheet.png, a row a page:

python tests/fmu/pages/sheet.py target/pages
"""

from __future__ import annotations

import html
import shutil
import sys
from itertools import groupby
from pathlib import Path

from PIL import Image
from playwright.sync_api import sync_playwright

STYLE = "td { vertical-align: top } img { max-height: 900px; object-fit: cover; object-position: top }"


def cell(picture: Path) -> str:
    """A picture, small but for its width's sake."""
    with Image.open(picture) as image:
        width = 60 + image.width // 6
    return f'<td><img src="{html.escape(picture.name)}" style="width:{width}px"></td>'


def name(picture: Path) -> str:
    """The page's, before scheme and width."""
    return picture.stem.split("-")[0]


if __name__ == "__main__":
    folder = Path(sys.argv[1]).resolve()
    pictures = sorted(folder.glob("*-*"), key=lambda path: (name(path), len(path.name), path.name))
    pictures = [path for path in pictures if path.suffix in {".jpeg", ".png"}]
    rows = [
        f"<tr><th>{html.escape(page)}</th>{''.join(map(cell, of_page))}</tr>"
        for page, of_page in groupby(pictures, key=name)
    ]
    assert rows, f"{folder} has no pictures"
    document = folder / "sheet.html"
    document.write_text(f"<!DOCTYPE html><style>{STYLE}</style><table>{''.join(rows)}</table>")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"))
        page = browser.new_page(viewport={"width": 2400, "height": 1000})
        page.goto(document.as_uri())
        page.screenshot(path=folder / "sheet.png", full_page=True)
