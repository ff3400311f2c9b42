"""The step of the ball presses: balls of known radius pressed into the membrane."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

from app.calibrate.balls.detector import (
    BallSetting,
    ball_in_capture,
    detect_ball,
    next_press_mm,
    placed_ball,
)
from app.calibrate.balls.radius import RadiusRow
from app.calibrate.detection import Detector, sentence_of, too_early
from app.calibrate.image_step import WAITING, ImageStep, Judgement
from app.calibrate.step import Parts
from app.calibrate.step_data import Step
from app.sources.bench import Scene
from gelpolight_core.calibration.inputs import Stage
from gelpolight_core.calibration.project import CalibrationProject
from gelpolight_core.calibration.results import StageResults
from gelpolight_core.lights.crosstalk import unmix
from gelpolight_core.reflectance.press import BallPress
from gelpolight_core.session.decisions import PlacedCircle
from gelpolight_core.translation import tr

USUAL_RADIUS_MM = 3.0


class BallsStep(ImageStep):
    """Finds the contact of each press; the user enters radii and can move a contact."""

    def __init__(self, parts: Parts) -> None:
        super().__init__(parts)
        self._next_mm: float | None = None
        self.radius = RadiusRow()
        self.radius.box.valueChanged.connect(lambda _: self._on_radius(self.radius.radius_mm))
        self.panel.add_extra(self.radius, self.radius.box)

    @staticmethod
    def describe() -> Step:
        """Return the data of the step."""
        return Step(
            "balls",
            tr("Ball presses"),
            (Stage.BALLS,),
            tr(
                "Press a ball of known diameter into the membrane. Vary the position over the "
                "whole field, as the ring in the image suggests, and the depth. Enter the ball "
                "diameter for each press."
            ),
            "ball",
            frames=4,
            wanted=10,
        )

    def detector(self, name: str) -> Detector:
        """Return the detection of a pressed ball, once the earlier stages are known."""
        project = self.model.project
        setting = setting_of(project.results)
        if setting is None:
            return too_early
        radius_mm = self.radius.radius_mm
        if not name:
            done = [press.pose.centre_mm for press in project.results.presses]
            return partial(
                detect_ball,
                setting=setting,
                radius_mm=radius_mm,
                earlier_mm=done,
                next_mm=next_press_mm(setting.table, radius_mm, done),
            )
        placed = project.session.decisions.balls.get(name)
        if placed is not None:
            return lambda _rgb: placed_ball(placed, setting)
        return partial(ball_in_capture, setting=setting, radius_mm=radius_mm)

    def depends_on(self) -> tuple[Any, ...]:
        """Return the radius of the shown or of the next press."""
        return (self.radius.radius_mm,)

    def judge(self, path: Path) -> Judgement:
        """Return how a press was judged."""
        return judge_ball(path.name, self.model.project)

    @property
    def residual_heading(self) -> str:
        """The difference between the shading of a press and that of its ball."""
        return tr("Shading error, %")

    # The radius

    @property
    def radius_mm(self) -> float | None:
        """Radius of the ball of the next press."""
        self.radius.box.interpretText()  # a typed value counts even without Enter
        return self.radius.radius_mm

    @property
    def typing(self) -> bool:
        """Whether a radius is being typed."""
        return self.radius.typing

    def on_bench(self, scene: Scene) -> None:
        """Use the radius of the ball on the virtual bench."""
        self._next_mm = 0.5 * scene.size_mm
        self._show_radius()

    def _on_radius(self, radius_mm: float) -> None:
        if self.model.shown:
            self.set_radius(self.model.shown, radius_mm)
        else:
            self._next_mm = radius_mm
            self.arm()

    def _show_radius(self) -> None:
        session, name = self.model.project.session, self.model.shown
        usual = session.ball_default_radius_mm or USUAL_RADIUS_MM
        value = self._next_mm or usual
        self.radius.show_radius(session.ball_radii_mm.get(name, usual) if name else value)

    # What is shown

    def enter(self) -> None:
        """Show the step with the input of the radius."""
        self.radius.show()
        super().enter()

    def leave(self) -> None:
        """Keep a typed radius, and hide the input."""
        self.radius.box.interpretText()
        self.radius.hide()

    def close(self) -> None:
        """Keep a typed radius while it can still be saved."""
        self.radius.box.interpretText()

    def refresh(self) -> None:
        """Update to changed results, also after undo."""
        if not self.radius.typing:
            self._show_radius()
        super().refresh()

    def live(self) -> None:
        """Show the live image; a typed radius belongs to the image shown before."""
        self.radius.box.interpretText()
        super().live()

    def show_capture(self, name: str) -> None:
        """Show a press with its radius; a typed one belongs to the image shown before."""
        self.radius.box.interpretText()
        super().show_capture(name)

    def arm(self, *, force: bool = False) -> None:
        """Set the detection, with the radius of the shown press."""
        if force:
            self._show_radius()
        super().arm(force=force)

    # Manual corrections

    def moved(self, handle: str, u: float, v: float, radius_px: float) -> None:
        """Move the contact of the shown press."""
        if self.model.shown:
            self.place_ball(self.model.shown, PlacedCircle(u, v, radius_px))

    def place_ball(self, name: str, circle: PlacedCircle | None) -> None:
        """Set the contact circle in a ball image by hand; can be undone."""
        project = self.model.project
        act = partial(project.place_ball, name)
        before = project.session.decisions.balls.get(name)
        text = tr("Move the contact in {name}").format(name=name)
        self.model.correct(text, partial(act, circle), partial(act, before), Stage.BALLS)

    def set_radius(self, name: str, radius_mm: float) -> None:
        """Set the ball radius of one image; can be undone."""
        project = self.model.project
        act = partial(project.set_ball_radius, name)
        before = project.session.ball_radii_mm.get(name)
        if radius_mm != before:
            text = tr("Diameter of {name}: {d:g} mm").format(name=name, d=2.0 * radius_mm)
            self.model.correct(text, partial(act, radius_mm), partial(act, before), Stage.BALLS)


def setting_of(results: StageResults) -> BallSetting | None:
    """Return the results that the detection of a ball needs; None if one is missing."""
    if (
        results.table is None
        or results.lights is None
        or results.crosstalk is None
        or results.background is None
        or results.lens is None
    ):
        return None
    crosstalk, camera = results.crosstalk.matrix, results.lens.camera
    return BallSetting(
        results.table,
        results.lights.led_positions_mm,
        crosstalk,
        unmix(results.background, crosstalk),
        (camera.width, camera.height),
    )


def judge_ball(name: str, project: CalibrationProject) -> Judgement:
    """Return how a ball press was judged."""
    ball = next((ball for ball in project.results.balls if ball.file == name), None)
    if ball is None:
        return WAITING
    if ball.fault is not None:
        return Judgement("fail", sentence_of(ball.fault), tr("not used"))
    if ball.press is None:
        return WAITING
    text = _disagreement(ball.press, project)
    if text:
        return Judgement("fail", text, tr("check it"), 100.0 * ball.press.shading_misfit)
    quality = ball.press.quality
    note = tr("⌀ {d:g} mm").format(d=2.0 * ball.press.pose.radius_mm)
    advice = ". ".join(quality.advice)
    return Judgement(quality.verdict.value, advice, note, 100.0 * ball.press.shading_misfit)


def _disagreement(press: BallPress, project: CalibrationProject) -> str:
    """Return why a press disagrees with the others, if it was compared with its present radius."""
    compared = project.results.reflectance
    for agreement in () if compared is None else compared.agreements:
        same = agreement.stated_radius_mm == press.pose.radius_mm
        if agreement.name == press.name and same and agreement.fault:
            return f"{agreement.fault}."
    return ""
