"""The reflectance step: the curves that were fitted to the ball presses."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

from PySide6.QtWidgets import QWidget

from app.calibrate.step import StepPresenter
from app.calibrate.step_data import step_of
from gelpolight_core.calibration.ball_stage import REFLECTANCE
from gelpolight_core.translation import tr

if TYPE_CHECKING:
    from app.calibrate.reflectance.curves import Curves


class ReflectanceStep(StepPresenter):
    """Shows the editor of the curves."""

    opens_slowly = True
    only_shows = True

    step = step_of(
        REFLECTANCE,
        tr(
            "Check the curves that were fitted to the ball presses. Correct them by hand "
            "where dirt or shadows have distorted them."
        ),
        "ball",
    )

    @cached_property
    def curves(self) -> Curves:
        """The editor; created when the step is first opened."""
        from app.calibrate.reflectance.curves import Curves  # slow to import

        return Curves(self.model)

    @property
    def centre(self) -> QWidget:
        """The editor."""
        return self.curves

    def refresh(self) -> None:
        """Show the present curves."""
        super().refresh()
        self.curves.show_results()

    def close(self) -> None:
        """Stop the thread of the editor."""
        if "curves" in self.__dict__:
            self.curves.close_editor()
