"""An asymmetric surface: one bump right of and above the middle, a small one left and below."""

from collections.abc import Callable

import numpy as np
import pytest
from PySide6.QtGui import QImage

from app.program.display import DisplayStore
from app.program.jobs import JobQueue
from app.program.settings import AppSettings
from app.views.map.colour_tables import colour_table
from app.views.map.map_view import MapView
from app.views.surface.display_surface import ColourScale, DisplaySurface, surface_of
from app.views.surface.panel import SurfacePanel
from gelpolight_core.reconstruction.height_map import Flag, HeightMap

PITCH_MM = 0.1
BUMP = (3.0, -2.0, 1.0)
SMALL = (-4.0, 3.0, 0.4)
RANGE_MM = (0.0, 1.0)
WAIT_MS = 60_000

Made = Callable[..., DisplaySurface]


@pytest.fixture
def heightmap():
    """Return two flat-topped bumps in a round working area of 8 mm radius."""
    x, y = np.arange(-90, 91) * PITCH_MM, np.arange(-85, 86) * PITCH_MM
    xx, yy = np.meshgrid(x, y)
    depth = np.zeros_like(xx)
    for at_x, at_y, height in (BUMP, SMALL):
        away = np.hypot(xx - at_x, yy - at_y)
        depth = np.maximum(depth, height * np.clip(2.0 - away / 1.0, 0.0, 1.0))
    flags = np.where(np.hypot(xx, yy) > 8.0, Flag.OUTSIDE.value, 0).astype(np.uint8)
    return HeightMap(
        depth.astype(np.float32), x, y, PITCH_MM, None, flags, "test", "full", "two.png"
    )


@pytest.fixture
def made(heightmap):
    """Return a function that makes its surface, coloured by depth."""

    def make(*, factor: float = 1.0, **how: object) -> DisplaySurface:
        depth = np.float32(factor) * heightmap.depth_mm
        table = colour_table("viridis")
        texture = table[np.clip(255.0 * depth, 0.0, 255.0).astype(np.uint8)]
        scale = ColourScale("depth (mm)", table, *RANGE_MM)
        settled = {"range_mm": RANGE_MM, "depth_mm": depth, **how}
        found = surface_of(heightmap, texture, scale, **settled)  # type: ignore[arg-type]
        assert found is not None
        return found

    return make


@pytest.fixture
def settings(tmp_path):
    """Return separate settings."""
    return AppSettings(tmp_path / "desktop.ini")


@pytest.fixture
def display(settings):
    """Return display settings without exaggeration."""
    store = DisplayStore(settings)
    store.change(exaggeration=1.0)
    return store


def flat_map() -> MapView:
    """Return the replacement of the 3D view."""
    return MapView("test.flat", "Shaded map")


@pytest.fixture
def panel(settings, display, made, qtbot):
    """Return a visible panel whose 3D view has drawn the surface."""
    jobs = JobQueue("test")
    shown = SurfacePanel(jobs, settings=settings, display=display, report=print, flat=flat_map)
    shown.resize(640, 560)
    shown.show()
    shown.show_surface(made(largest=128))
    qtbot.waitUntil(lambda: shown.view is not None and shown.view.drawings > 0, timeout=WAIT_MS)
    yield shown
    shown.finish()
    jobs.close()
    shown.close()
    shown.deleteLater()


def pixels(image: QImage) -> np.ndarray:
    """Return an image as (rows, columns, 3) uint8."""
    image = image.convertToFormat(QImage.Format.Format_RGB888)
    data = np.frombuffer(image.constBits(), np.uint8)
    rows = data.reshape(image.height(), image.bytesPerLine())[:, : 3 * image.width()]
    return rows.reshape(image.height(), image.width(), 3).copy()  # the image is freed
