"""What the documentation names exists, and the texts that it quotes are those of the program."""

import ast
import re
from functools import cache
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest
from pages import anchors_of, text_of

from gelpolight_core.measurement.tools.tool_registry import PALETTE
from gelpolight_core.output.formats import HEIGHT_MAP_FORMATS

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = tuple(sorted(DOCS.rglob("*.md")))
GUIDE = tuple(sorted((DOCS / "guide").glob("*.md")))
PICTURES = DOCS / "pictures"
SCENES = tuple(sorted((DOCS / "scripts").glob("screenshot_*.py")))
LARGEST_KB, ALL_KB = 100, 2000

named = pytest.mark.parametrize("page", PAGES, ids=lambda path: str(path.relative_to(DOCS)))
guided = pytest.mark.parametrize("page", GUIDE, ids=lambda path: path.name)


def links_of(page: Path) -> list[str]:
    """Return what a page links to, pictures too."""
    return re.findall(r"\]\(([^)\s]+)\)", text_of(page))


def nav_entries() -> list[str]:
    """Return the pages that the site's navigation names."""
    config = (ROOT / "properdocs.yml").read_text("utf-8")
    return re.findall(r"^ +- [^:\n]+: (\S+\.md)$", config.partition("\nnav:")[2], re.MULTILINE)


@cache
def output() -> tuple[str, ...]:
    """Return every text that the program can say, with ``…`` where it puts something in."""
    texts = set()
    for package in ("app", "gelpolight_core"):
        for module in (ROOT / package).rglob("*.py"):
            for node in ast.walk(ast.parse(module.read_text("utf-8"))):
                if isinstance(node, ast.JoinedStr):
                    parts = (getattr(part, "value", "") for part in node.values)
                    texts.add("".join(part if isinstance(part, str) else "…" for part in parts))
                elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                    texts.add(re.sub(r"\{[^}]*\}", "…", node.value))
    assert len(texts) > 1000
    return tuple(texts)


@cache
def labels() -> frozenset[str]:
    """Return every text as a button shows it, without the underlining and the dots at its end."""
    return frozenset(re.sub(r"&(?!&)", "", text).rstrip("….: ") for text in output())


def is_reported(message: str) -> bool:
    """Whether the program says this; ``…`` stands for anything."""
    pattern = re.compile(".*?".join(map(re.escape, message.split("…"))), re.DOTALL)
    return any(pattern.fullmatch(text) for text in output())


@named
def test_every_link_leads_to_a_page_a_picture_or_a_heading(page):
    for link in links_of(page):
        if re.match(r"https?:|mailto:", link):
            continue
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        assert target.is_file(), link
        assert target.is_relative_to(DOCS), link
        if anchor:
            assert anchor in anchors_of(target), link


def test_every_page_is_in_the_navigation_and_there():
    entries = nav_entries()
    assert sorted(entries) == sorted({str(page.relative_to(DOCS)) for page in PAGES})


def test_the_pictures_are_those_that_the_pages_show_and_the_scenes_make():
    shown = {Path(link).stem for page in PAGES for link in links_of(page) if "pictures/" in link}
    scenes = "".join(script.read_text("utf-8") for script in SCENES)
    made = set(re.findall(r'\.shot\("([\w-]+)"', scenes))
    assert shown == made
    assert {path.stem for path in PICTURES.glob("*.webp")} == made


def test_the_pictures_are_small_enough_to_be_kept_with_the_sources():
    sizes = {path.name: path.stat().st_size / 1e3 for path in PICTURES.iterdir()}
    assert {name: size for name, size in sizes.items() if size > LARGEST_KB} == {}
    assert sum(sizes.values()) < ALL_KB


def messages_of(page: Path) -> list[str]:
    """Return the messages that a page quotes, one on each line that begins with >."""
    return re.findall(r"^> (.+)$", page.read_text("utf-8"), flags=re.MULTILINE)


@guided
def test_every_quoted_message_is_one_that_the_program_says(page):
    assert [message for message in messages_of(page) if not is_reported(message)] == []


def test_troubleshooting_quotes_messages():
    """The test above has something to look at."""
    assert len(messages_of(DOCS / "guide/troubleshooting.md")) > 40


@guided
def test_what_is_set_in_bold_is_on_the_screen(page):
    """Bold words are labels; only a sentence or the head of a paragraph may be bold besides."""
    text = re.sub(r"\s+", " ", text_of(page))
    bold = re.findall(r"\*\*([^*]+)\*\*", text)
    assert [w for w in bold if w[-1] not in ".:" and w.rstrip("…") not in labels()] == []


def _with_tables(chapter: str) -> str:
    """Return a page of the guide as it is built."""
    spec = spec_from_file_location("guide_tables", DOCS / "scripts/guide_tables.py")
    hook = module_from_spec(spec)
    spec.loader.exec_module(hook)
    return hook.on_page_markdown((DOCS / chapter).read_text("utf-8"))


def test_the_guide_has_a_row_for_each_measuring_tool():
    page = _with_tables("guide/measure.md")
    rows = re.findall(r"^\| \*\*(.+?)\*\* \| (\w) \|", page, re.MULTILINE)
    assert rows == [(entry.label, entry.key) for entry in PALETTE.values()]


def test_the_guide_has_a_row_for_each_export_format():
    page = _with_tables("guide/inspect.md")
    for key, row in HEIGHT_MAP_FORMATS.items():
        assert f"\n| {key} | {row.title} |\n" in page
