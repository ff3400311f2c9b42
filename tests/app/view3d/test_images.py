"""Images and movies of the 3D view: correct size and content, complete or not created."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image, ImageSequence
from PySide6.QtCore import QTimer
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QProgressDialog, QPushButton

from app.view3d.images import image_of, write_movie
from app.view3d.saving import ImageChoice, MovieChoice, ViewSaving
from app.view3d.style import Ink
from gelpolight_core.errors import InputError
from tests.app.view3d.conftest import pixels


@pytest.fixture
def reported():
    """Return the kinds of what is reported."""
    return []


@pytest.fixture
def saving(panel, settings, reported):
    def report(_text: str, kind: str) -> None:
        reported.append(kind)

    return ViewSaving(panel, settings=settings, report=report, player=lambda: None)


def test_an_image_has_any_size_and_the_screen_s_content(panel):
    assert panel.view is not None
    assert not panel.view_style.scale_bar
    shown = pixels(panel.image())
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


def test_a_printed_image_has_a_white_background_and_large_letters(panel):
    assert panel.view is not None
    panel.view.scene.set_ink(Ink("#101010", "#202020", "#ffffff"))
    plain, printed = (image_of(panel.view.scene, (800, 640), paper=on) for on in (False, True))
    assert (printed[2, 2] == 255).all() and plain[2, 2].max() < 64
    title = slice(0, 40), slice(0, 120)  # of the colour bar
    assert (printed[title].max(axis=2) < 128).sum() > (plain[title].min(axis=2) > 128).sum()


def test_the_image_is_copied(panel, saving):
    saving.copy()
    copied = QGuiApplication.clipboard().image()
    assert copied.size() == panel.image().size() and not copied.isNull()


def test_a_turntable_turns_once(panel, saving, tmp_path):
    for name in ("turn.mp4", "turn.gif"):
        saving.save_movie(tmp_path / name, MovieChoice("turntable", 240, 180, 5.0, 1.2))
        frames = _frames(tmp_path / name)
        assert len(frames) == 6 and frames[0].shape == (180, 240, 3)
        assert np.abs(frames[0].astype(int) - frames[3]).mean() > 2.0  # half way round
    assert sorted(p.name for p in tmp_path.glob("*turn*")) == ["turn.gif", "turn.mp4"]


def _frames(path: Path) -> list[np.ndarray]:
    if path.suffix == ".gif":
        with Image.open(path) as image:
            return [np.asarray(frame.convert("RGB")) for frame in ImageSequence.Iterator(image)]
    video, frames = cv2.VideoCapture(str(path)), []
    while True:
        there, bgr = video.read()
        if not there:
            return frames
        frames.append(bgr[..., ::-1])


@pytest.mark.parametrize("ending", ["mp4", "gif"])
def test_a_cancelled_movie_leaves_no_file(panel, saving, reported, tmp_path, ending):
    def cancel() -> None:
        progress = panel.findChild(QProgressDialog, "view3d.movie.progress")
        assert progress is not None
        if progress.value() > 1:
            progress.findChild(QPushButton).click()
            timer.stop()

    timer = QTimer(panel)
    timer.timeout.connect(cancel)
    timer.start(10)
    choice = MovieChoice("turntable", 240, 180, 30.0, 10.0)
    saving.save_movie(tmp_path / f"turn.{ending}", choice)
    assert reported == ["warn"]
    assert [p.name for p in tmp_path.iterdir() if "turn" in p.name] == []


def test_a_recording_is_saved_surface_by_surface(panel, settings, made, tmp_path):
    surfaces = [made(factor=factor, largest=128) for factor in (0.1, 0.5, 1.0)]
    played = len(surfaces), iter(surfaces)
    saving = ViewSaving(panel, settings=settings, report=lambda *_: None, player=lambda: played)
    saving.save_movie(tmp_path / "film.mp4", MovieChoice("recording", 240, 180, 5.0, 1.0))
    frames = _frames(tmp_path / "film.mp4")
    assert len(frames) == 3
    yellow = [int((np.abs(f.astype(int) - (253, 231, 37)).max(axis=2) < 60).sum()) for f in frames]
    assert yellow[2] > yellow[0]


@pytest.mark.parametrize("ending", ["mp4", "gif"])
def test_a_movie_without_frames_is_refused(tmp_path, ending):
    with pytest.raises(InputError):
        write_movie(tmp_path / f"none.{ending}", 5.0, [])
    assert not list(tmp_path.glob("*none*"))
