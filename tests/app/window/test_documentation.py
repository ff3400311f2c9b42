"""The guide opens in the browser, at the section of the page or step."""

from pathlib import Path

import pytest
from pages import anchors_of
from PySide6.QtGui import QDesktopServices

from app.calibrate.wizard import FIRST, LAST, PANELS
from app.window import documentation
from app.window.documentation import OF_PAGE
from app.window.main_window import MainWindow

DOCS = Path(__file__).resolve().parents[3] / "docs"
STEPS = (*FIRST, *PANELS.values(), *LAST)


@pytest.mark.parametrize("step", STEPS, ids=lambda step: step.__name__)
def test_every_step_of_the_wizard_has_its_section(step):
    page, heading = step.guide
    assert heading in anchors_of(DOCS / f"{page}.md")


def test_every_page_of_the_program_has_its_own():
    assert all((DOCS / f"{page}.md").is_file() for page in OF_PAGE.values())


@pytest.mark.function("Open the guide at the section of the page or step")
def test_the_help_of_a_page_opens_the_guide_there(context, qtbot, monkeypatch, tmp_path):
    window = MainWindow(context=context)
    qtbot.addWidget(window)
    opened, browser = [], [True, True, False]
    monkeypatch.setattr(
        QDesktopServices, "openUrl", lambda url: opened.append(url.toString()) or browser.pop(0)
    )
    monkeypatch.setattr(documentation, "SITE", tmp_path)
    window.show()
    window.show_guide()
    assert not opened
    assert "docs.sh" in context.toasts.shown()[-1].text

    for page in ("index", "guide/calibrate", "guide/inspect"):
        file = tmp_path / f"{page}.html"
        file.parent.mkdir(exist_ok=True)
        file.write_text("<html>", "utf-8")
    context.requests.guide.emit("guide/calibrate", "4-lights")
    window.show_page("inspect")
    qtbot.waitUntil(lambda: window.page_name == "inspect")
    window.show_guide()
    window.show_guide("index")
    names = ("guide/calibrate.html#4-lights", "guide/inspect.html", "index.html")
    assert opened == [f"file://{tmp_path}/{name}" for name in names]
    # Without a browser the page says where the file is.
    assert str(tmp_path / "index.html") in context.toasts.shown()[-1].text
    window.close()
