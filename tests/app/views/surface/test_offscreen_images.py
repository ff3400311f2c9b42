"""Images and turntables of the 3D view: correct size and content, complete or not created."""

import numpy as np
import pytest
from PIL import Image, ImageSequence
from PySide6.QtCore import QTimer
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QProgressDialog, QPushButton

from app.views.surface import scene_export as module
from app.views.surface.overlays import SceneColours
from app.views.surface.scene import image_of
from app.views.surface.scene_export import ImageChoice, SceneExport
from tests.app.views.surface.conftest import pixels


@pytest.fixture
def reported():
    """Return the kinds of what is reported."""
    return []


@pytest.fixture
def saving(panel, settings, reported):
    def report(_text: str, kind: str) -> None:
        reported.append(kind)

    return SceneExport(panel, lambda: panel.view, settings=settings, report=report)


@pytest.mark.function("Save an image of any size, with a scale bar or transparent")
def test_an_image_has_any_size_and_the_screen_s_content(panel):
    assert panel.view is not None
    assert not panel.display.value.scale_bar
    shown = pixels(panel.view.grabFramebuffer())
    for size in ((320, 240), (1501, 1003)):
        image = image_of(panel.view.scene, size)
        assert image.shape == (size[1], size[0], 3)
        # The same scene: the bump's yellow and the membrane's violet are in both.
        for colour in ((253, 231, 37), (68, 1, 84)):
            for part in (image, shown):
                assert np.abs(part.astype(int) - colour).max(axis=2).min() < 15
    assert "scale-bar" not in panel.view.actors, "it goes with the image alone"


def test_a_transparent_image_has_no_background(saving, reported, tmp_path):
    path = tmp_path / "surface.png"
    saving.save_image(path, ImageChoice("surface", 400, 300, transparent=True))
    alpha = np.asarray(Image.open(path))[..., 3]
    assert alpha.shape == (300, 400)
    assert alpha[2, 2] == 0 and (alpha == 255).sum() > 4_000
    assert reported == ["pass"]


@pytest.mark.function("Save an image for print, white with large letters")
def test_a_printed_image_has_a_white_background_and_large_letters(panel):
    assert panel.view is not None
    panel.view.scene.set_ink(SceneColours("#101010", "#202020", "#ffffff"))
    plain, printed = (image_of(panel.view.scene, (800, 640), paper=on) for on in (False, True))
    assert (printed[2, 2] == 255).all() and plain[2, 2].max() < 64
    title = slice(0, 40), slice(0, 120)  # of the colour bar
    assert (printed[title].max(axis=2) < 128).sum() > (plain[title].min(axis=2) > 128).sum()


@pytest.mark.function("Copy the image")
def test_the_image_is_copied(panel, saving):
    saving.copy()
    copied = QGuiApplication.clipboard().image()
    assert copied.size() == panel.view.grabFramebuffer().size() and not copied.isNull()


@pytest.mark.function("Save a turntable")
def test_a_turntable_turns_once(saving, reported, tmp_path, monkeypatch):
    monkeypatch.setattr(module, "TURN_FRAMES", 6)
    saving.save_turntable(tmp_path / "turn.gif")
    with Image.open(tmp_path / "turn.gif") as image:
        frames = [np.asarray(f.convert("RGB"), int) for f in ImageSequence.Iterator(image)]
    assert len(frames) == 6 and reported == ["pass"]
    first, *_, last = frames
    steps = [np.abs(frame - first).mean() for frame in frames]
    assert steps[3] > 2.0 and last.shape == first.shape  # half way round
    assert [p.name for p in tmp_path.glob("*turn*")] == ["turn.gif"]


def test_a_cancelled_turntable_leaves_no_file(panel, saving, reported, tmp_path):
    def cancel() -> None:
        progress = panel.findChild(QProgressDialog, "view3d.turntable.progress")
        if progress is not None and progress.value() > 1:
            progress.findChild(QPushButton).click()
            timer.stop()

    timer = QTimer(panel)
    timer.timeout.connect(cancel)
    timer.start(10)
    saving.save_turntable(tmp_path / "turn.gif")
    assert reported == ["warn"]
    assert [p.name for p in tmp_path.iterdir() if "turn" in p.name] == []
