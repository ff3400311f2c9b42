"""The lens step: views of a checkerboard in front of the camera."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from app.calibrate.detection import Detector
from app.calibrate.image_step import WAITING, ImageStep, Judgement
from app.calibrate.lens.detector import detect_board
from app.calibrate.step import Parts
from app.calibrate.step_data import Step
from app.services.jobs import Job
from gelpolight_core.calibration.inputs import Stage
from gelpolight_core.errors import InputError
from gelpolight_core.optics.lens_views import (
    MIN_VIEWS,
    LensRefusal,
    LensView,
    find_view,
    refused_view,
)
from gelpolight_core.translation import tr


class LensStep(ImageStep):
    """Analyses each view at once, before there are enough of them to compute the lens."""

    judges_focus = True

    def __init__(self, parts: Parts) -> None:
        super().__init__(parts)
        self._views: dict[str, LensView] = {}
        self.model.captured.connect(self._on_captured)

    @staticmethod
    def describe() -> Step:
        """Return the data of the step."""
        return Step(
            "lens",
            tr("Lens"),
            (Stage.LENS,),
            tr(
                "Use the camera alone. Hold the checkerboard in front of it. Tilt it by 15 to 40 "
                "degrees in a new direction for each image, until its corners have covered the "
                "whole image."
            ),
            "camera",
            wanted=12,
            least=MIN_VIEWS,
        )

    def start(self) -> None:
        """Analyse the views that the session has."""
        self._find_boards()

    def views(self) -> dict[str, LensView]:
        """Return what was found in each analysed view, by image name."""
        project = self.model.project
        fault, lens = project.fault(Stage.LENS), project.results.lens
        views = () if lens is None else lens.views
        if isinstance(fault, LensRefusal):
            views = fault.views  # the reasons survive a refusal
        return {**self._views, **{view.name: view for view in views}}

    def detector(self, name: str) -> Detector:
        """Return the detection of the board, with the earlier views."""
        session = self.model.project.session
        used = {path.name for path in session.found(self.step.folder)} - {name}
        found = [view.board for n, view in self.views().items() if n in used]
        earlier = [board for board in found if board is not None]
        return partial(
            detect_board, board=session.checkerboard, earlier=earlier, patient=bool(name)
        )

    def depends_on(self) -> tuple[Any, ...]:
        """Return the names of the analysed views."""
        return (frozenset(self.views()),)

    def judge(self, path: Path) -> Judgement:
        """Return what was found in a view."""
        return judge_view(self.views().get(path.name))

    @property
    def residual_heading(self) -> str:
        """The reprojection error of a view."""
        return tr("Corner error, px")

    def _on_captured(self, stage: str, _name: str) -> None:
        if stage == Stage.LENS:
            self._find_boards()

    def _find_boards(self) -> None:
        def work(_progress: Callable[[float], None]) -> None:
            session, known = self.model.project.session, self.views()
            for path in session.found(self.step.folder):
                if path.name not in known:
                    try:
                        view = find_view(session.image(path), session.checkerboard)
                    except InputError as fault:
                        view = refused_view(path.name, fault)
                    self._views = {**self._views, path.name: view}

        self.model.short_jobs.submit(
            Job(tr("Analysing the lens views"), work, lambda _: self.model.changed.emit())
        )


def judge_view(view: LensView | None) -> Judgement:
    """Return how a lens view was judged; None: it was not analysed yet."""
    if view is None:
        return WAITING
    if not view.used:
        return Judgement("fail", view.reason, tr("not used"))
    if math.isnan(view.rms_px):
        return Judgement("pass", tr("Board found."), tr("board found"))
    note = tr("{r:.2f} px").format(r=view.rms_px)
    sentence = tr("Corner error {r:.3f} px.").format(r=view.rms_px)
    return Judgement("pass", sentence, note, view.rms_px)
