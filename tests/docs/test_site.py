"""The site is built without a warning, every link leads somewhere, every key is documented."""

from __future__ import annotations

import dataclasses
import json
import re
import shutil
import subprocess
import sys
import threading
from functools import partial
from html.parser import HTMLParser
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

from slopewise.models.effects.registry import LAWS
from slopewise.models.parameters import Braking, Limits
from slopewise.models.vehicle import Vehicle
from slopewise.services.ros.settings import Timing
from slopewise.services.settings.service_settings import Planning
from slopewise.services.wire.plan_messages import PlanRequest
from tests.services.browser import text_of

pytest.importorskip("material", reason="the docs extra is not installed")

ROOT = Path(__file__).parents[2]


class Quiet(SimpleHTTPRequestHandler):
    """Serves a folder without a word."""

    def log_message(self, *_: object) -> None:
        pass


class Page(HTMLParser):
    """Links, anchors and text of a page."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.names: set[str] = {""}
        self.loads: list[str] = []
        self.text = path.read_text()
        self.feed(self.text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        if given.get("id"):
            self.names.add(given["id"] or "")
        if tag == "a" and given.get("href"):
            self.links.append(given["href"] or "")
        attribute = "href" if tag == "link" else "src"
        if tag in ("link", "script", "img") and given.get(attribute):
            self.loads.append(given[attribute] or "")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> dict[Path, Page]:
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", folder]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
    assert not re.search(r"^(WARNING|ERROR)", done.stderr, re.MULTILINE), done.stderr
    return {path: Page(path) for path in folder.rglob("*.html") if path.name != "404.html"}


def page_of(site: dict[Path, Page], name: str) -> Page:
    return next(page for path, page in site.items() if path.as_posix().endswith(name))


def test_links_lead_somewhere_and_nothing_is_loaded_from_elsewhere(site: dict[Path, Page]) -> None:
    assert len(site) > 20
    count = 0
    for path, page in site.items():
        for link in [*page.links, *page.loads]:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                assert link not in page.loads, f"{path.name} loads {link}"
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path.resolve()
            target = target / "index.html" if target.is_dir() else target
            assert target.is_file(), f"{path.name}: {link}"
            if parts.fragment and target in site:
                assert unquote(parts.fragment) in site[target].names, f"{path.name}: {link}"
            count += 1
    assert count > 500


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("reference/model.html", Vehicle),
        ("reference/model.html", Braking),
        ("reference/model.html", Limits),
        ("reference/service.html", Planning),
        ("reference/edge.html", Timing),
    ],
)
def test_every_quantity_is_there_with_its_unit(
    site: dict[Path, Page], name: str, kind: type
) -> None:
    text = page_of(site, name).text
    for field in dataclasses.fields(kind):
        row = re.search(rf"<tr>\s*<td><code>{field.name}</code></td>(.*?)</tr>", text, re.DOTALL)
        assert row is not None, field.name
        if "unit" in field.metadata:
            assert f"[{field.metadata['unit']}]" in row[1], row[1]


def test_effects_messages_and_commands_are_there(site: dict[Path, Page]) -> None:
    effects = page_of(site, "reference/effects.html").text
    assert all(effects.count(f"<code>{name}</code>") >= 2 for name in LAWS)
    wire = page_of(site, "reference/messages.html").text
    assert "slopewise.plan_request.v1" in wire
    assert all(f"<code>{name}</code>" in wire for name in PlanRequest.__struct_fields__)
    text = page_of(site, "reference/commands.html").text
    assert all(f"slopewise {name}" in text for name in ("plan", "calibrate", "ros", "serve"))
    assert not re.search(r"\[(bold|/)\]", text)


def test_equations_are_mathml(site: dict[Path, Page]) -> None:
    text = page_of(site, "concepts.html").text
    assert text.count("<math") >= 15
    assert "arithmatex" not in text
    assert "\\frac" not in re.sub(r"<annotation.*?</annotation>", "", text, flags=re.DOTALL)


PHONE = """<!doctype html><body><iframe style="width:390px;height:800px;border:0"></iframe><script>
const pages = PAGES, frame = document.querySelector("iframe"), wide = [];
const next = () => {
  if (!pages.length) {
    document.body.textContent = JSON.stringify(wide);
    document.body.dataset.ready = "true";
    return;
  }
  const page = pages.shift();
  frame.onload = () => {
    const width = frame.contentDocument.documentElement.scrollWidth;
    if (width > 390) wide.push(page + ": " + width);
    next();
  };
  frame.src = page;
};
next();
</script>"""


def test_no_page_moves_sideways_on_a_phone(site: dict[Path, Page], tmp_path: Path) -> None:
    """390 px wide in a browser: what is wider, such as a table, scrolls in a separate box."""
    built = next(path.parent for path in site if path.name == "quickstart.html")
    pages = sorted(path.relative_to(built).as_posix() for path in site)
    folder = tmp_path / "site"
    shutil.copytree(built, folder)
    for name in pages:  # scripts lay nothing out, and would load for minutes
        text = re.sub(r"<script.*?</script>", "", (folder / name).read_text(), flags=re.DOTALL)
        (folder / name).write_text(text)
    (folder / "phone.html").write_text(PHONE.replace("PAGES", json.dumps(pages)))
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(folder))) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        shown = text_of(f"http://127.0.0.1:{server.server_port}/phone.html")
        server.shutdown()
    assert re.search(r"<body[^>]*>\[\]<", shown), re.search(r"<body[^>]*>(.*?)</body>", shown)


def test_nothing_says_where_packages_come_from() -> None:
    for path in (ROOT / "constraints.txt", ROOT / "Containerfile", ROOT / "pyproject.toml"):
        text = path.read_text()
        assert "://" not in text
        assert "index-url" not in text
