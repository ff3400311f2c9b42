"""The Start page: what can go on, and what can begin."""

from pathlib import Path

import numpy as np
import pytest
import scene
from PySide6.QtGui import QImage

from app.program.context import AppContext
from app.program.session_entries import read_session_entry
from app.window.start_page import ActionCard, StartPage
from gelpolight_core.calibration.calibration_file import write_calibration


@pytest.fixture
def page(context, qtbot):
    made = StartPage(context=context)
    qtbot.addWidget(made)
    made.resize(900, 640)
    made.show()
    return made


def words(card: ActionCard) -> str:
    return f"{card.text()}\n{card.description()}"


def session_of(context: AppContext, serial: str, name: str, *folders: str) -> Path:
    folder = context.workspace.sessions_folder(serial) / name
    folder.mkdir(parents=True)
    (folder / "session.toml").write_text(f'[sensor]\nserial = "{serial}"\n')
    for stage in folders:
        (folder / stage).mkdir()
        grey = np.full((12, 16), 90, np.uint8)
        image = QImage(grey.data, 16, 12, QImage.Format.Format_Grayscale8)
        assert image.save(str(folder / stage / "a.png"))
    return folder


@pytest.mark.function(
    "Begin from the start page with what is possible now",
    "Continue an unfinished session at its step",
)
def test_the_session_that_is_not_finished_is_continued_at_its_step(page, context, qtbot):
    folder = session_of(context, "S-1", "today", "checkerboard", "top_pose")
    page.enter()
    assert page.go_on.isVisible()
    assert "S-1" in words(page.go_on) and "next: Lights" in words(page.go_on)
    assert page.go_on.iconSize().width() > 40  # the newest image, not the sign
    with qtbot.waitSignal(context.requests.session) as asked:
        page.go_on.click()
    assert asked.args == [str(folder)]


def test_a_session_with_a_saved_calibration_is_finished(page, context):
    calibration = scene.calibration()
    session_of(context, calibration.serial, calibration.provenance.session, "balls")
    page.enter()
    assert page.go_on.isVisible()
    context.workspace.keep_calibration(calibration, "made")
    page.enter()
    assert not page.go_on.isVisible()


def test_the_last_calibration_leads_straight_to_inspect(page, context, qtbot, tmp_path):
    write_calibration(scene.calibration(), tmp_path / "made.gplcal")
    path = context.workspace.import_calibration(tmp_path / "made.gplcal")
    page.enter()
    assert "not validated" in words(page.use) and "made" in words(page.use)
    with qtbot.waitSignal(context.requests.page) as asked:
        page.use.click()
    assert asked.args == ["inspect"]
    assert context.workspace.in_use == path


def test_the_first_steps_are_shown_until_there_is_a_sensor(page, context):
    assert page.first_steps.isVisible() and not page.demo.isVisible()
    session_of(context, "S-1", "today")
    page.enter()
    assert page.demo.isVisible() and not page.first_steps.isVisible()


def test_a_closed_sensor_goes_on_with_its_own_stages(context):
    folder = session_of(context, "S-1", "today", "background")
    known = "[in_place]\nmm_per_px = 0.06"
    for stated, stage in ((known, "balls"), ("[in_place]", "scale"), ("", "lens")):
        (folder / "session.toml").write_text(f'[sensor]\nserial = "S-1"\n{stated}')
        assert read_session_entry(folder).next_stage == stage


def test_a_damaged_image_leaves_the_sign(page, context):
    folder = session_of(context, "S-1", "today", "checkerboard")
    (folder / "checkerboard" / "a.png").write_bytes(b"no image")
    assert read_session_entry(folder).newest is not None
    page.enter()
    assert page.go_on.isVisible()
    assert page.go_on.iconSize().width() < 40
