"""Dialogs for saving an image or a movie."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from PySide6.QtCore import QSize, Signal
from PySide6.QtWidgets import QDialogButtonBox, QWidget

from app.widgets.dialog import Dialog
from app.widgets.fields import choice, number, switch
from app.widgets.forms import Form
from gelpolight_core.translation import tr

LARGEST_PX = 8000
LARGEST_MOVIE_PX = 3840


@dataclass(frozen=True, slots=True)
class ImageChoice:
    """Which image to save: the surface in any size, or all views, as shown on the screen."""

    what: str = choice(
        "surface", tr("Save"),
        {"surface": tr("The surface in 3D"), "views": tr("All views, as on the screen")},
    )  # fmt: skip
    width_px: int = number(
        800, tr("Width"), 64, LARGEST_PX, tr(" px"), when=lambda c: c.what == "surface"
    )
    height_px: int = number(
        600, tr("Height"), 64, LARGEST_PX, tr(" px"), when=lambda c: c.what == "surface"
    )
    transparent: bool = switch(
        False, "", tr("Transparent background"), when=lambda c: c.what == "surface"
    )


@dataclass(frozen=True, slots=True)
class MovieChoice:
    """Which movie to save: one turn of the surface, or the open recording."""

    what: str = choice(
        "turntable", tr("Save"),
        {
            "turntable": tr("Turntable: one full turn of the surface"),
            "recording": tr("The recording, frame by frame"),
        },
    )  # fmt: skip
    width_px: int = number(800, tr("Width"), 64, LARGEST_MOVIE_PX, tr(" px"))
    height_px: int = number(600, tr("Height"), 64, LARGEST_MOVIE_PX, tr(" px"))
    rate_hz: float = number(15.0, tr("Frames per second"), 1.0, 60.0)
    seconds: float = number(
        8.0, tr("Duration of one turn"), 1.0, 120.0, tr(" s"),
        when=lambda c: c.what == "turntable",
    )  # fmt: skip


class ChoiceDialog(Dialog):
    """Lets the user choose what to save.

    Parameters
    ----------
    value : ImageChoice or MovieChoice
        Proposed.
    only : bool
        Whether there is nothing else to save than what is proposed.

    Signals
    -------
    chosen(object)
        The choice.
    """

    chosen = Signal(object)

    def __init__(self, name: str, title: str, value: Any, *, only: bool, parent: QWidget) -> None:
        kinds = QDialogButtonBox.StandardButton
        super().__init__(
            parent, f"view3d.{name}.dialog", title, kinds.Save | kinds.Cancel, once=True
        )
        form = Form(value, f"view3d.{name}")
        form.rows.setRowVisible(form.inputs["what"], not only)
        self.fill(form)
        self.accepted.connect(lambda: self.chosen.emit(form.value))


def image_dialog(size: QSize, kinds: tuple[str, ...], parent: QWidget) -> ChoiceDialog:
    """Return a dialog that lets the user save one of some kinds of image, of twice a size."""
    value = ImageChoice(kinds[0], 2 * size.width(), 2 * size.height())
    return ChoiceDialog("image", tr("Save an image"), value, only=len(kinds) == 1, parent=parent)


def movie_dialog(size: QSize, *, recording: bool, parent: QWidget) -> ChoiceDialog:
    """Return a dialog that lets the user save a movie of a size."""
    value = MovieChoice("turntable", size.width(), size.height())
    return ChoiceDialog("movie", tr("Save a movie"), value, only=not recording, parent=parent)
