"""The guide is found in all installations, and opens where it is asked for."""

from importlib.metadata import PackagePath

from app.calibrate.steps import route_of
from app.shell import documentation
from app.shell import main_window as main_window_module
from app.shell.documentation import find_documentation
from app.shell.guide_window import OF_PAGE, PAGES, GuideWindow
from app.shell.main_window import MainWindow
from gelpolight_core.calibration.recipes import FULL


def test_a_checkout_and_a_wheel_have_their_documentation(tmp_path, monkeypatch):
    folder = find_documentation()
    assert folder is not None
    assert all((folder / f"{name}.md").is_file() for name, _ in PAGES)
    file = tmp_path / "share" / "doc" / "gelpolight-studio" / "index.md"
    file.parent.mkdir(parents=True)
    file.write_text("# Guide", "utf-8")
    installed = PackagePath("share/doc/gelpolight-studio/index.md")
    monkeypatch.setattr(PackagePath, "locate", lambda _self: file)
    monkeypatch.setattr(documentation, "files", lambda _name: [installed])
    assert find_documentation(tmp_path / "elsewhere") == file.parent


def test_every_step_and_page_has_its_section(qtbot):
    folder = find_documentation()
    window = GuideWindow(folder)
    qtbot.addWidget(window)
    known = {name for name, _ in PAGES}
    assert set(OF_PAGE.values()) <= known
    window.show_page("guide/calibrate")
    for step in route_of(FULL.stages):
        page = "guide/validate" if step.key == "validation" else "guide/calibrate"
        window.show_page(page)
        title = "Validate" if step.key == "validation" else step.title
        assert window.text.show_heading(title), step.title


def test_the_help_of_a_page_opens_the_guide_there(context, qtbot, monkeypatch):
    window = MainWindow(context=context)
    qtbot.addWidget(window)
    window.resize(1024, 700)
    window.show()
    context.requests.guide.emit("guide/calibrate", "Lights")
    guide = window.findChild(GuideWindow)
    assert guide is not None and guide.isVisible()
    assert guide.text.textCursor().block().text().endswith("Lights")
    assert guide.text.verticalScrollBar().value() > 0
    assert guide.list.currentItem().text() == "Calibrate"

    monkeypatch.setattr(main_window_module, "find_documentation", lambda: None)
    window.show_guide()
    assert "not installed" in context.toasts.shown()[0].text
    window.close()
