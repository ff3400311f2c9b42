"""The main window: pages, shortcuts, saved settings, dropped files."""

import sys
from collections.abc import Callable
from pathlib import Path

import pytest
import scene
from fake_camera import C310, FakeCamera, FakeDriver
from PySide6.QtCore import QMimeData, QPoint, QPointF, QSize, Qt, QUrl
from PySide6.QtGui import (
    QAction,
    QDesktopServices,
    QDragEnterEvent,
    QDropEvent,
    QUndoCommand,
    QUndoStack,
)
from PySide6.QtWidgets import (
    QApplication,
    QLabel,
    QPlainTextEdit,
    QPushButton,
    QTabWidget,
    QToolBar,
    QWidget,
)
from pytestqt.qtbot import QtBot

from app.program.context import AppContext
from app.program.preferences import WarningLimits
from app.program.settings import AppSettings
from app.widgets import theme
from app.widgets.dialog import Dialog
from app.widgets.forms import Form
from app.window.desktop import open_files
from app.window.main_window import MainWindow
from app.window.pages import PageEntry
from app.window.window_dialogs import AboutDialog
from gelpolight_core.calibration.annotations import write_reason
from gelpolight_core.reconstruction.modes import Mode


class Page(QWidget):
    """A page that records the calls it gets."""

    def __init__(self, *, context: AppContext) -> None:
        super().__init__()
        self.events: list[str] = []
        self.opened: list[Path] = []
        self.closable, self.work = True, ""

    def enter(self) -> None:
        self.events.append("enter")

    def leave(self) -> None:
        self.events.append("leave")

    def unfinished(self) -> str:
        return self.work

    def can_close(self) -> bool:
        return self.closable

    def begin(self) -> None:
        self.events.append("begin")

    def begin_demo(self) -> None:
        self.events.append("begin demo")

    def begin_press(self) -> None:
        self.events.append("begin press")

    def open_path(self, path: Path) -> None:
        self.opened.append(path)


class BarePage(QWidget):
    """A page without any of the optional methods."""

    def __init__(self, *, context: AppContext) -> None:
        super().__init__()


PAGES = (
    PageEntry("sensors", "Sensors", "sensors", f"{__name__}:Page"),
    PageEntry("calibrate", "Calibrate", "calibrate", f"{__name__}:Page"),
    PageEntry("bare", "Bare", "measure", f"{__name__}:BarePage"),
    PageEntry("inspect", "Inspect", "inspect", f"{__name__}:Page"),
    PageEntry("measure", "Measure", "measure", f"{__name__}:Page"),
)
MakeWindow = Callable[[], MainWindow]


def _activate(window: MainWindow, qtbot: QtBot) -> None:
    """Give the window the keyboard focus, and wait until it has it."""
    with qtbot.waitActive(window):
        window.activateWindow()


@pytest.fixture
def make_window(context, qtbot):
    def make() -> MainWindow:
        window = MainWindow(context=context, pages=PAGES)
        qtbot.addWidget(window)
        window.show_page("sensors")
        window.show()
        _activate(window, qtbot)
        return window

    return make


@pytest.fixture
def window(make_window):
    return make_window()


@pytest.fixture
def session(tmp_path):
    folder = tmp_path / "session"
    folder.mkdir()
    (folder / "session.toml").write_text("")
    return folder


@pytest.mark.function("Work without a mouse")
def test_the_keyboard_reaches_every_page_which_is_made_when_it_is_first_opened(window, qtbot):
    assert list(window._made) == ["sensors"]
    for key, page in (
        (Qt.Key.Key_2, "calibrate"),
        (Qt.Key.Key_3, "bare"),
        (Qt.Key.Key_1, "sensors"),
    ):
        # A window of another test that closes late takes the focus with it.
        _activate(window, qtbot)
        qtbot.keyClick(window, key, Qt.KeyboardModifier.ControlModifier)
        assert window.page_name == page
    assert list(window._made) == ["sensors", "calibrate", "bare"]
    assert window.page("calibrate").events == ["enter", "leave"]
    window.context.requests.begin.emit("sensor")
    assert window.page_name == "calibrate"
    assert window.page("calibrate").events == ["enter", "leave", "enter", "begin"]


def test_a_slow_page_appears_when_it_is_loaded(window, qtbot, tmp_path, monkeypatch):
    (tmp_path / "slow_page.py").write_text(
        f"import time\ntime.sleep(0.2)\nfrom {__name__} import Page\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    window.entries["calibrate"] = PageEntry("calibrate", "C", "calibrate", "slow_page:Page")
    window.begin("practice")
    assert window.page_name == ""
    assert window.findChild(QWidget, "main.loading").isVisible()
    qtbot.waitUntil(lambda: window.page_name == "calibrate")
    assert window.page("calibrate").events == ["enter", "begin demo"]
    del sys.modules["slow_page"]


@pytest.mark.function("Be asked before closing ends a recording")
def test_closing_asks_once_if_work_of_a_page_would_end(window):
    window.page("sensors").work = "Work is running."
    assert not window.close()
    question = window.findChild(Dialog, "question")
    assert "Work is running." in question.findChild(QLabel, "question.text").text()
    assert question.findChild(QPushButton, "question.cancel").isDefault(), "Enter loses nothing"
    question.reject()
    assert window.isVisible() and not window.close()
    window.findChild(Dialog, "question").findChild(QWidget, "question.answer0").click()
    assert not window.isVisible()


def test_a_page_can_keep_the_window_open_and_its_size_is_remembered(make_window, context):
    first = make_window()
    first.page("sensors").closable = False
    assert not first.close()
    assert first.isVisible()
    first.page("sensors").closable = True
    first.resize(1111, 777)
    first.show_page("calibrate")
    assert first.close()
    assert first.page("calibrate").events[-1] == "leave"
    assert make_window().size().toTuple() == (1111, 777)


def test_the_window_can_shrink_until_it_fits_the_screen_with_its_frame(window):
    window._fit_screen(window.screen().availableSize() - QSize(900, 600))
    assert window.minimumSize().toTuple() == (900, 600)


@pytest.mark.function("Find source and window size of the last run again")
def test_the_source_of_the_last_run_is_selected_again(context, make_window, tmp_path, qtbot):
    window, source = make_window(), context.source
    source.choose_again("recording", str(tmp_path / "gone.gplrec"), context.cameras)
    assert source.info is None
    source.choose_virtual_sensor()
    assert context.settings.source == ("virtual", "")
    source.choose(None)
    window.choose_source_again()
    assert context.settings.source == ("", "") and source.info is None

    source.choose_folder(tmp_path)
    window.close()
    source.info = None  # like a new start of the program
    make_window().choose_source_again()
    qtbot.waitUntil(lambda: source.info is not None)
    assert source.remembered == ("folder", str(tmp_path))


def test_the_camera_of_the_last_run_is_selected_again_if_it_is_connected(
    context, make_window, qtbot
):
    camera = FakeCamera()
    context.cameras.driver = FakeDriver(camera)
    window = make_window()
    context.source.choose(context.cameras.infos()[0])
    window.close()
    context.source.info = None  # like a new start of the program
    camera.plugged = False
    context.source.choose_again(*context.settings.source, context.cameras)
    assert context.source.info is None
    assert context.settings.source == ("camera", C310.identity), "it is kept for the next start"
    camera.plugged = True
    make_window().choose_source_again()
    qtbot.waitUntil(lambda: context.source.info is not None)
    assert context.source.info is not None and context.source.info.detail == C310.identity


def test_an_invalid_settings_file_is_harmless(tmp_path):
    path = tmp_path / "desktop.ini"
    path.write_text(
        "[General]\ntheme=purple\nworkspace=@Variant(x)\nrecent_sessions=\n"
        "[limits]\nage_days=minus one\nheight_percent=-3\nsize_percent=nan\n"
        "[window]\ngeometry=7\n"
    )
    settings = AppSettings(path)
    assert settings.preferences.theme == "system"
    assert settings.limits == WarningLimits()
    assert settings.recent("sessions") == ()
    assert settings.window_state()[0].isEmpty()


def test_settings_survive(tmp_path):
    settings = AppSettings(tmp_path / "desktop.ini")
    settings.prefer(theme="dark")
    settings.limits = WarningLimits(age_days=12.0, height_percent=3.0, size_percent=2.0)
    settings.prefer(workspace=str(tmp_path / "my, sensors; and=more"))
    for number in range(12):
        settings.add_recent("sessions", tmp_path / f"session {number}")
    settings.save()
    again = AppSettings(tmp_path / "desktop.ini")
    assert again.preferences.theme == "dark"
    assert again.limits == WarningLimits(12.0, 3.0, 2.0)
    assert again.workspace_folder == settings.workspace_folder
    assert again.recent("sessions")[0] == tmp_path / "session 11"
    assert len(again.recent("sessions")) == 8


def drop_on(window: MainWindow, *paths: Path) -> bool:
    """Drag files over the window and drop them there. Return whether they were accepted."""
    data = QMimeData()
    data.setUrls([QUrl.fromLocalFile(str(path)) for path in paths])
    left, none = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier
    entering = QDragEnterEvent(QPoint(5, 5), Qt.DropAction.CopyAction, data, left, none)
    entering.setAccepted(False)
    QApplication.sendEvent(window, entering)
    if entering.isAccepted():
        dropping = QDropEvent(QPointF(5, 5), Qt.DropAction.CopyAction, data, left, none)
        QApplication.sendEvent(window, dropping)
    return entering.isAccepted()


@pytest.mark.function("Drop a session, a calibration or a recording on the window")
def test_a_dropped_file_goes_where_it_is_used(window, session, tmp_path):
    context = window.context
    window.open_session(tmp_path)
    assert "session.toml" in context.toasts.shown()[0].text
    assert window.page_name == "sensors"
    assert context.settings.recent("sessions") == ()

    assert drop_on(window, session)
    assert window.page_name == "calibrate"
    assert window.page("calibrate").opened == [session]
    assert context.settings.recent("sessions") == (session,)

    files = [tmp_path / name for name in ("a.gplcal", "b.GPLCAL", "coin.gplrec")]
    for file in files:
        file.touch()
    assert drop_on(window, *files[:2])
    assert window.page_name == "sensors"
    assert window.page("sensors").opened == files[:2]
    assert drop_on(window, files[2])
    info = context.source.info
    assert info is not None and (info.kind, info.name) == ("recording", "coin")
    assert "coin.gplrec" in context.toasts.shown()[-1].text


def test_a_file_from_the_desktop_is_opened_where_it_is_used(context, tmp_path, qtbot):
    pages = (*PAGES, PageEntry("inspect", "Inspect", "inspect", f"{__name__}:BarePage"))
    window = MainWindow(context=context, pages=pages)
    qtbot.addWidget(window)
    calibration, recording = tmp_path / "a.gplcal", tmp_path / "press.gplrec"
    for file, page in ((calibration, "sensors"), (recording, "inspect")):
        file.touch()
        open_files(window, [file])
        qtbot.waitUntil(lambda page=page: window.page_name == page)
    qtbot.waitUntil(lambda: window.page("sensors").opened == [calibration])
    assert context.source.info is not None and context.source.info.file == recording


@pytest.mark.function("Undo and redo changes of the visible page")
def test_the_edit_menu_names_what_it_undoes(window):
    page, edit = window.page("sensors"), window.edit_menu
    edit.refresh()
    assert not edit.undo_action.isEnabled()
    done: list[int] = []
    page.history = QUndoStack(page)
    page.history.push(QUndoCommand("Edit a note"))
    page.history.indexChanged.connect(done.append)
    edit.refresh()
    assert edit.undo_action.text().startswith("&Undo edit a note\t")
    edit.undo_action.trigger()
    assert done == [0]
    edit.refresh()
    assert edit.redo_action.text().startswith("&Redo edit a note\t")
    assert not edit.undo_action.isEnabled()


def dialog_of(window: MainWindow, kind: type) -> QWidget:
    (dialog,) = [w for w in window.findChildren(kind) if w.isVisible()]
    return dialog


def test_every_page_has_names_for_its_controls_and_no_shared_shortcut_and_its_exports(
    context, qtbot
):
    """Qt runs neither of two actions with the same shortcut. Those of hidden views do not count."""
    window = MainWindow(context=context)
    qtbot.addWidget(window)
    window.show()
    for name in window.entries:
        page = window.page(name)
        window.show_page(name)
        qtbot.waitUntil(page.isVisible)
        _refuse_shared_keys(window)
        if name == "sensors":
            _refuse_nameless(window)
        for tabs in page.findChildren(QTabWidget):
            for index in range(tabs.count()):
                tabs.setCurrentIndex(index)
                _refuse_shared_keys(window)
    exports = {
        name: {action.objectName() for action in window.page(name).export_actions()}
        for name in ("sensors", "measure")
    }
    assert exports == {
        "sensors": {"sensors.report"},
        "measure": {"measure.certify", "records.export"},
    }
    window.close()


def _refuse_nameless(window: MainWindow) -> None:
    """Ask for the name of everything that takes the focus."""
    for widget in window.findChildren(QWidget):
        inner = widget.objectName().startswith("qt_") or type(widget) is QWidget
        if widget.focusPolicy() & Qt.FocusPolicy.TabFocus and widget.isVisible() and not inner:
            assert widget.objectName(), widget
            assert widget.accessibleName(), widget


def _refuse_shared_keys(window: MainWindow) -> None:
    keys: dict[str, str] = {}
    for action in window.findChildren(QAction):
        if action.shortcutContext() != Qt.ShortcutContext.WindowShortcut:
            continue
        owners = [owner for owner in action.associatedObjects() if isinstance(owner, QWidget)]
        if not any(owner.isVisible() for owner in owners):
            continue
        for sequence in action.shortcuts():
            other = keys.setdefault(sequence.toString(), action.objectName())
            assert other == action.objectName()


@pytest.mark.function("Change preferences: theme, live mode, workspace, limits")
def test_preferences_take_effect_at_once(window, tmp_path):
    window.show_preferences()
    dialog = dialog_of(window, Dialog)
    asked = []
    window.context.requests.calibrations_changed.connect(lambda: asked.append(1))
    inputs, limits = (form.inputs for form in dialog.findChildren(Form))
    limits["age_days"].setValue(7)
    assert window.context.settings.limits.age_days == 7.0
    folder = inputs["workspace"]
    folder.setText(str(tmp_path / "elsewhere"))
    folder.editingFinished.emit()
    assert window.context.workspace.folder == tmp_path / "elsewhere"
    assert len(asked) == 2
    inputs["recording_limit_gb"].setValue(5.0)
    assert window.context.settings.preferences.recording_limit_gb == 5.0
    settings = window.context.settings
    changed = []
    window.context.requests.preferences_changed.connect(lambda: changed.append(1))
    mode = inputs["reconstruction"]
    mode.setCurrentIndex(mode.findText("best", Qt.MatchFlag.MatchContains))
    assert settings.preferences.mode == Mode("full", "best")
    limits["size_percent"].setValue(3.0)
    assert len(changed) == 2
    folder.setText("not/absolute")
    folder.editingFinished.emit()
    assert folder.text() == str(tmp_path / "elsewhere")
    dialog.close()


def test_another_theme_moves_nothing(window, qtbot):
    bars = window.findChildren(QToolBar)
    before = [bar.sizeHint() for bar in bars]
    for theme_name in ("dark", "light"):
        theme.apply(QApplication.instance(), theme_name)
        qtbot.wait(0)
        assert [bar.sizeHint() for bar in bars] == before


@pytest.mark.function("See licences and versions")
def test_about_shows_the_licences_of_a_packaged_program(window, tmp_path, monkeypatch, qtbot):
    window.show_about()
    assert dialog_of(window, AboutDialog).findChild(QPushButton, "about.licences") is None
    dialog_of(window, AboutDialog).close()
    qtbot.waitUntil(lambda: not window.findChildren(AboutDialog))
    (tmp_path / "LICENCES.txt").write_text("Qt: LGPL-3.0-only\n")
    monkeypatch.setattr("app.window.window_dialogs.LICENCES", tmp_path / "LICENCES.txt")
    window.show_about()
    dialog = dialog_of(window, AboutDialog)
    dialog.findChild(QPushButton, "about.licences").click()
    text = dialog.findChild(QPlainTextEdit, "licences.text")
    assert text.isVisible()
    assert text.toPlainText() == "Qt: LGPL-3.0-only\n"
    text.window().close()
    dialog.close()


@pytest.mark.function(
    "Begin with the virtual sensor: press, measure, calibrate, or connect a sensor"
)
@pytest.mark.parametrize(
    ("what", "page", "event"),
    [
        ("demo", "inspect", "begin demo"),
        ("press", "inspect", "begin press"),
        ("measure", "measure", "begin demo"),
        ("practice", "calibrate", "begin demo"),
    ],
)
def test_each_first_step_begins_on_its_page(window, what, page, event):
    window.context.requests.begin.emit(what)
    assert window.page_name == page
    assert window.page(page).events == ["enter", event]


def test_another_source_is_chosen_where_its_images_are_shown(window, qtbot):
    window.context.requests.begin.emit("source")
    menu = window.state_bar.camera.menu()
    qtbot.waitUntil(menu.isVisible)
    assert window.page_name == "inspect"
    menu.close()


def test_the_virtual_sensor_keeps_its_bench(context):
    bench = context.source.choose_virtual_sensor()
    info = context.source.info
    assert context.source.choose_virtual_sensor() is bench and context.source.info is info
    assert info is not None and info.kind == "virtual" and info.open().bench is bench


def test_the_calibration_in_use_is_named_before_the_first_page_is_loaded(context, qtbot):
    workspace = context.workspace
    workspace.use(workspace.keep_calibration(scene.calibration(), "made"))
    qtbot.addWidget(MainWindow(context=context, pages=PAGES))
    assert context.status.value.calibration


def test_the_calibration_in_use_is_named_and_a_failed_one_is_red_above_every_page(window):
    context, workspace = window.context, window.context.workspace
    line = window.findChild(QLabel, "main.failed")

    def use(path: Path | None) -> None:
        workspace.use(path)
        context.requests.calibrations_changed.emit()

    assert not context.status.value.calibration
    path = workspace.keep_calibration(scene.calibration(), "made")
    for used in (path, None):
        use(used)
        value = context.status.value
        assert value.calibration.endswith(", not validated") is (used is not None)
        assert (value.calibration_role == "warn") is (used is not None)
        assert not line.isVisible()
    failed = workspace.keep_calibration(scene.failed(scene.calibration()), "made")
    write_reason("for teaching", failed)
    use(failed)
    for name in window.entries:
        window.show_page(name)
        assert line.isVisible()
    assert "Half a pixel" in line.text() and "Calibrate again" in line.text()
    assert line.property("ground") == "fail"
    button = window.state_bar.calibration
    assert "failed" in button.text() and button.property("ground") == "fail"
    use(None)
    assert not line.isVisible()


@pytest.mark.function("Print a checkerboard of true size from the Help menu")
def test_a_checkerboard_to_print_is_in_the_help_menu(window, monkeypatch):
    opened, shows = [], []
    monkeypatch.setattr(
        QDesktopServices, "openUrl", lambda url: opened.append(url.toLocalFile()) or shows[-1]
    )
    for square, viewer in ((2, True), (3, False)):
        shows.append(viewer)
        window.findChild(QAction, f"help.board_{square}mm").trigger()
        assert Path(opened[-1]).name == f"checkerboard-9x6-{square}mm.pdf"
        assert Path(opened[-1]).is_file()
        # Without a viewer the page says where the file is.
        named = any(opened[-1] in toast.text for toast in window.context.toasts.shown())
        assert named is not viewer


@pytest.mark.function("Open the folder of the log")
def test_the_log_folder_is_opened_from_the_help_menu_and_from_a_fault(window, monkeypatch):
    opened = []
    monkeypatch.setattr(
        QDesktopServices, "openUrl", lambda url: bool(opened.append(url.toLocalFile())) or True
    )
    window.findChild(QAction, "help.log").trigger()
    window.context.toasts.show("Internal error", "fail", with_log=True)
    window.context.toasts.shown()[0].findChild(QPushButton).click()
    assert opened == [str(window.context.log.folder)] * 2
