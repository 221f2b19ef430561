"""The pages' content security policies: what they stop in an FMU's documentation, and what they allow."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest
from playwright.sync_api import Browser, Page, Route

from fmu.pages.visit import FMUS, LIVE, PAGES

pytestmark = pytest.mark.browser

pytest_plugins = ["fmu.pages.opening"]

POLICY = re.compile(r'<meta http-equiv="Content-Security-Policy" content="([^"]*)"/>')

ELSEWHERE = "http://elsewhere.test/"

REQUEST = f"new Image().src = '{ELSEWHERE}'"


class Attack(NamedTuple):
    """Markup that requests something from elsewhere, perhaps on a click, and the directive that stops it."""

    directive: str
    markup: str
    is_clicked: bool = False


ATTACKS = {
    "script": Attack("script-src-elem", f"<script>{REQUEST}</script>"),
    "onerror": Attack("script-src-attr", f'<img src="data:," alt="" onerror="{REQUEST}"/>'),
    "onload": Attack("script-src-attr", f'<svg onload="{REQUEST}"></svg>'),
    "javascript": Attack("script-src-elem", f'<a href="javascript:{REQUEST}">go</a>', is_clicked=True),
    "iframe": Attack("frame-src", f'<iframe src="{ELSEWHERE}"></iframe>'),
    "form": Attack("form-action", f'<form action="{ELSEWHERE}"><button>go</button></form>', is_clicked=True),
    "base": Attack("base-uri", f'<base href="{ELSEWHERE}"/><img src="picture.png" alt=""/>'),
    "picture": Attack("img-src", f'<img src="{ELSEWHERE}" alt=""/>'),
    "style": Attack("style-src-elem", f'<link rel="stylesheet" href="{ELSEWHERE}"/>'),
}


REPORT = """addEventListener("securitypolicyviolation", ({ effectiveDirective }) =>
  console.info(`stopped by ${effectiveDirective}`))"""


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    """A window that reports what a policy stops."""
    context = browser.new_context()
    context.add_init_script(REPORT)
    yield context.new_page()
    context.close()


@pytest.mark.parametrize("attack", ATTACKS.values(), ids=ATTACKS)
@pytest.mark.parametrize("scheme", ["file", "http"])
def test_documentation_runs_and_loads_nothing(
    page: Page, files: dict[str, Path], tmp_path: Path, scheme: str, attack: Attack
) -> None:
    """An attack in the author's part of an FMU's page, which succeeds without the policy."""
    file = tmp_path / "index.html"
    address = {"file": file.as_uri(), "http": "http://fmu.test/"}[scheme]
    requested = []

    def abort(route: Route) -> None:
        requested.append(route.request.url)
        route.abort()

    page.route("http://fmu.test/", lambda route: route.fulfill(path=file))
    page.route(f"{ELSEWHERE}**", abort)

    def attempt(html: str) -> None:
        file.write_text(html)
        page.goto(address)
        if attack.is_clicked:
            page.locator("#attack >> text=go").click(no_wait_after=True)

    html = files[FMUS[0]].read_text().replace("</main>", f'<div id="attack">{attack.markup}</div></main>')
    with page.expect_console_message(lambda message: message.text == f"stopped by {attack.directive}"):
        attempt(html)
    assert requested == []
    with page.expect_request(f"{ELSEWHERE}**"):
        attempt(POLICY.sub("", html))


@pytest.mark.parametrize("name", PAGES)
def test_each_page_allows_only_what_it_needs(files: dict[str, Path], name: str) -> None:
    """plotly.js saves figures by way of blobs; the live page compiles WebAssembly."""
    [policy] = POLICY.findall(files[name].read_text())
    scripts = r"( 'sha256-[\w+/]{43}=')+" + (" 'wasm-unsafe-eval'" if name == LIVE else "")
    pictures = "data:" if name in FMUS else "data: blob:"
    assert re.fullmatch(
        f"default-src 'none'; script-src{scripts}; style-src 'unsafe-inline'; img-src {pictures}; "
        "base-uri 'none'; form-action 'none'",
        policy,
    )
