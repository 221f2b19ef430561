"""The documentation in the exported FMUs: a page with curves of the FMUs, and an icon."""

from __future__ import annotations

import math
import re
import shlex
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from fmpy.util import read_csv
from justhtml import JustHTML
from lxml import etree
from matplotlib.image import imread

from fmu import ROOT
from fmu.master import Fmu

ICONS = {"BoostPlant": "plant.png", "BoostController": "controller.png"}

LARGEST = 300_000
"""Bytes of a page."""

DRAWN = ROOT / "modelDescription" / "documentation"

ROUNDING = 0.1 + 1e-9
"""The tolerance of a curve against the stored one in drawn units. Positions are rounded to a tenth, so that
the last bit of a result can change them by as much. 0.01 % of full scale is similar: 20 Pa of boost pressure
are 0.12 units in the panel with the largest scale, 25 kPa on 150 units."""


@pytest.fixture(params=ICONS)
def name(request: pytest.FixtureRequest) -> str:
    """Each FMU's name."""
    return request.param


@pytest.fixture
def page(exported: Path, name: str) -> str:
    """The page inside an FMU."""
    with zipfile.ZipFile(exported / f"{name}.fmu") as archive:
        return archive.read("documentation/index.html").decode()


@pytest.fixture
def tree(page: str) -> etree._Element:
    """The page, read as XML."""
    return etree.fromstring(page.encode())


def text_of(element: etree._Element) -> str:
    """The text of an element and its descendants."""
    return "".join(element.itertext())


def html_outline(node: object, depth: int = 0) -> Iterator[tuple[int, str]]:
    """The depth and name of each element, for the HTML parser."""
    if node.name[0] not in "#!":
        yield depth, node.name
    for child in node.children or []:
        yield from html_outline(child, depth + 1)


def xml_outline(node: etree._Element, depth: int = 1) -> Iterator[tuple[int, str]]:
    """The same for the XML parser."""
    if isinstance(node.tag, str):
        yield depth, etree.QName(node).localname
    for child in node:
        yield from xml_outline(child, depth + 1)


def test_page_is_html(page: str, tree: etree._Element) -> None:
    """The HTML parser, which corrects errors, gives the same elements as the XML parser."""
    html = JustHTML(page, sanitize=False, strict=True)
    assert page.startswith("<!DOCTYPE html>")
    assert list(html_outline(html.root)) == list(xml_outline(tree))


def test_page_needs_no_other_file(page: str, tree: etree._Element) -> None:
    """Nothing is loaded, and targets of internal links exist."""
    ids = tree.xpath("//@id")
    assert len(set(ids)) == len(ids)
    targets = [link[1:] for link in tree.xpath("//@href") if link.startswith("#")]
    assert set(targets) <= set(ids)
    assert len(targets) > 50
    others = tree.xpath("//*[@href and not(starts-with(@href, '#'))]")
    assert {element.tag for element in others} == {"a"}
    assert not tree.xpath("//@src | //@srcset | //link | //iframe | //object")
    assert set(re.findall(r"url\(.", page)) <= {"url(#"}
    assert "@import" not in page
    assert len(page.encode()) < LARGEST


def test_page_describes_every_variable(fmus: dict[str, Fmu], name: str, tree: etree._Element) -> None:
    """In the row of its name, or of its array or state, with the texts of the XML."""
    rows = {row.get("id"): row for row in tree.xpath("//table[@class='variables']//tr[@id]")}
    described = set()
    for variable in fmus[name].description.modelVariables:
        declared = re.sub(r"\[.*\]", "", variable.name)
        (place,) = tree.xpath("//*[@id=$declared]", declared=declared)
        assert declared in text_of(place)
        if variable.causality == "independent":
            continue
        is_derivative = variable.derivative is not None
        row = rows[declared.removeprefix("der(").removesuffix(")") if is_derivative else declared]
        described.add(row.get("id"))

        def said(cell: etree._Element, is_derivative: bool = is_derivative) -> str:
            """The text in a cell for the variable, or for its derivative."""
            if is_derivative:
                return text_of(cell.find("span"))
            of_numbers = "ancestor::span[not(@class='number')]"
            return "".join(cell.xpath(f".//text()[not(ancestor::small or {of_numbers})]"))

        cells = {cell.get("class"): cell for cell in row.findall("td")}
        first, *last = map(int, said(cells["reference"]).split("…"))
        assert first <= variable.valueReference <= (last or [first])[0], variable.name
        assert variable.description.endswith(said(cells[None])), variable.name
        assert len(said(cells[None])) > 3
        if variable.type == "Real":
            assert variable.unit in said(cells["unit"]).split(", "), variable.name
        else:
            kind = variable.declaredType.name if variable.declaredType else variable.type
            assert said(cells["unit"]) == kind, variable.name
        if variable.type == "Real" and variable.start is not None and not last:
            assert float(said(cells["start"])) == float(variable.start), variable.name
    assert described == set(rows)


def test_page_shows_matrices(fmus: dict[str, Fmu], tree: etree._Element, name: str) -> None:
    """Each start value of a two-dimensional array is in its row and column."""
    wanted: dict[str, dict[tuple[int, int], float]] = {}
    for variable in fmus[name].description.modelVariables:
        if match := re.fullmatch(r"(.*)\[(\d+),(\d+)\]", variable.name):
            place = int(match[2]), int(match[3])
            wanted.setdefault(match[1], {})[place] = float(variable.start)
    shown = {}
    for matrix in tree.xpath("//table[@class='matrix']"):
        declared = matrix.xpath("string(ancestor::tr/preceding-sibling::tr[1]/@id)")
        rows = matrix.xpath("tbody/tr")
        shown[declared] = {
            (i, j): float(cell.text)
            for i, row in enumerate(rows, start=1)
            for j, cell in enumerate(row.xpath("td"), start=1)
        }
    assert shown == wanted
    assert len(shown) == {"BoostPlant": 0, "BoostController": 9}[name]


def test_page_has_equations_and_figures(tree: etree._Element) -> None:
    assert len(tree.xpath("//div[@class='equation']/math")) > 10
    for figure in tree.xpath("//figure"):
        (picture,) = figure.xpath("*[local-name()='svg']")
        assert picture.get("aria-label")
    assert len(tree.xpath("//figure")) >= 2


def test_page_names_the_platforms_and_the_guid(
    exported: Path, fmus: dict[str, Fmu], tree: etree._Element, name: str
) -> None:
    facts = {fact[0].text: list(fact[1].itertext()) for fact in tree.xpath("//dl[@class='facts']/div")}
    with zipfile.ZipFile(exported / f"{name}.fmu") as archive:
        folders = [entry.split("/")[1] for entry in archive.namelist() if entry.startswith("binaries/")]
        platforms = archive.read("documentation/platforms.txt").decode()
    assert facts["Platforms"] == ["see ", "platforms.txt"]
    assert [line.split(":")[0] for line in platforms.splitlines()[2:]] == folders
    assert facts["GUID"] == [fmus[name].description.guid]


def test_commands_of_the_page(exported: Path, tree: etree._Element, name: str, tmp_path: Path) -> None:
    """The page's commands, with its file of inputs and one more line."""
    (tmp_path / f"{name}.fmu").symlink_to(exported / f"{name}.fmu")
    commands, inputs = (text_of(block) for block in tree.xpath("//section[@id='page-use']/pre"))
    header, first = inputs.splitlines()
    assert first.startswith("0,")
    (tmp_path / "inputs.csv").write_text(f"{header}\n{first}\n0.5{first[1:]}\n")
    lines = commands.splitlines()
    assert len(lines) == 5
    for line in lines:
        program, *arguments = shlex.split(line)
        assert program == "fmpy"
        result = tmp_path / "result.csv"
        result.unlink(missing_ok=True)
        done = subprocess.run(
            [Path(sys.executable).parent / program, *arguments],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        assert "warning" not in (done.stdout + done.stderr).lower()
        if "simulate" in line:
            values = read_csv(result)
            assert len(values) > 10
            assert all(math.isfinite(value) for value in values[-1])


def test_icon(exported: Path, name: str) -> None:
    """A PNG of a suitable size, with a picture on a transparent background."""
    with zipfile.ZipFile(exported / f"{name}.fmu") as archive, archive.open("model.png") as file:
        content = file.read()
        file.seek(0)
        pixels = imread(file, format="png")
    assert content == (ROOT / "modelDescription" / "icons" / ICONS[name]).read_bytes()
    assert pixels.shape == (512, 512, 4)
    assert pixels[0, 0, 3] == 0
    opaque = pixels[pixels[..., 3] == 1]
    assert len(opaque) > 0.9 * 512 * 512
    # Not blank: several colors, light and dark.
    brightness = opaque[:, :3].mean(axis=1)
    assert 0.05 < (brightness > 0.5).mean() < 0.5


def test_curves_are_those_of_the_fmus(exported: Path, tmp_path: Path) -> None:
    """The stored pictures, drawn again."""
    (tmp_path / "target").mkdir()
    (tmp_path / "target" / "fmu").symlink_to(exported)
    script = ROOT / "examples" / "documentation_curves.py"
    subprocess.run([sys.executable, script, "--out", tmp_path], cwd=tmp_path, check=True, capture_output=True)
    drawn = sorted(tmp_path.glob("*.svg"))
    kept = [file.name for file in sorted(DRAWN.glob("*.svg")) if not file.stem.endswith("_structure")]
    assert [file.name for file in drawn] == kept
    number = re.compile(r"-?\d+(?:\.\d+)?")
    for file in drawn:
        fresh, old = (" ".join(source.read_text().split()) for source in (file, DRAWN / file.name))
        assert number.sub("", fresh) == number.sub("", old), file.name
        pairs = zip(number.findall(fresh), number.findall(old), strict=True)
        worst = max(abs(float(one) - float(other)) for one, other in pairs)
        assert worst <= ROUNDING, f"{file.name} differs by {worst} drawn units"
