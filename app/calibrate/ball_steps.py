"""The step of the ball presses: balls of known radius pressed into the membrane."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import cv2
import numpy as np
from PySide6.QtCore import QSignalBlocker

from app.live.overlay import ImageOverlay, OverlayCircle, OverlayMarker
from app.sources.virtual_bench import BenchScene
from app.widgets.inputs import NumberField
from app.widgets.widget_names import set_names
from gelpolight_core.base.arrays import Float32Array, Float64Array, PixelArray, PointXY
from gelpolight_core.base.finding import Finding, Verdict, finding_from_error, worst_of
from gelpolight_core.calibration.open_ball_stages import BALLS, REFLECTANCE
from gelpolight_core.calibration.open_sensor_recipe import BACKGROUND, LENS, LIGHTS
from gelpolight_core.calibration.project import CalibrationProject
from gelpolight_core.calibration.recipe import Stage, StageResults
from gelpolight_core.geometry.drape import ball_depth_from_contact
from gelpolight_core.geometry.resampling import MembraneGrid, ResamplingTable, node_pixels
from gelpolight_core.session.decisions import PlacedCircle
from gelpolight_core.stages.balls.ball_detection import find_indentation
from gelpolight_core.stages.balls.ball_press import (
    BallPress,
    contact_too_large,
    find_ball,
    next_press_mm,
)
from gelpolight_core.stages.balls.press_agreement import PressAgreement
from gelpolight_core.stages.leds.crosstalk import unmix

from .detection_marks import (
    Detection,
    Detector,
    as_image,
    ball_contour,
    ball_handle,
    detect_nothing,
    detect_or_refusal,
    judged_detection,
    refuse_size,
    table_of,
    working_circle,
)
from .image_step import ImageStep
from .page_state import RemedyButton
from .setup_values import USUAL_RADIUS_MM

# Radius of the contact circle drawn when no contact was found; the user moves it into position.
FIRST_RADIUS = 0.1
LIVE_NODES = 200
"""A contact of 1 mm radius still has more nodes than its detection needs."""


@dataclass(frozen=True, slots=True)
class BallDetectionInputs:
    """Results of the earlier stages that the ball detection needs.

    Attributes
    ----------
    table : ResamplingTable
        Computed from lens, top pose and layers.
    led_positions_mm : (3, 3)
        Positions of the LEDs in the sensor frame.
    crosstalk : (3, 3)
        Result of the mirror stage.
    background : (rows, columns, 3) float32
        The bare membrane, resampled onto the table's grid, crosstalk removed.
    image_size : (width, height)
        Size of the frames in pixels.
    step : int
        Pixels over which a frame is averaged before it is resampled.
    """

    table: ResamplingTable
    led_positions_mm: Float64Array
    crosstalk: Float64Array
    background: Float32Array
    image_size: tuple[int, int]
    step: int = 1

    def coarser(self) -> BallDetectionInputs:
        """Return the setting for live images, on at least LIVE_NODES nodes along each axis."""
        table, grid = self.table, self.table.grid
        step = max(1, min(grid.shape) // LIVE_NODES)
        stride = slice(step // 2, None, step)
        valid_mask = cv2.erode(table.valid.astype(np.uint8), np.ones((step, step))) > 0
        smooth = cv2.blur(self.background, (step, step))
        maps = table.u_px, table.v_px, valid_mask, table.ray_slope, smooth
        coarse_maps: list[Any] = [np.ascontiguousarray(values[stride, stride]) for values in maps]
        background = coarse_maps.pop()
        coarse = MembraneGrid(grid.x_mm[stride], grid.y_mm[stride], step * grid.pitch_mm)
        table = ResamplingTable(coarse, *coarse_maps)
        return replace(self, table=table, background=background, step=step)


def detect_open_ball(
    rgb: PixelArray,
    setting: BallDetectionInputs,
    *,
    radius_mm: float,
    marks: tuple[OverlayMarker, ...] = (),
    editable: bool = False,
    live: bool = False,
) -> Detection:
    """Find a pressed ball.

    Parameters
    ----------
    rgb : (rows, columns, 3)
        The frame.
    setting : BallDetectionInputs
        Results of the earlier stages.
    radius_mm : float
        Radius of the ball.
    marks : tuple of OverlayMarker, optional
        Marks at earlier presses, and where the next one helps most.
    editable : bool, optional
        Whether the contact circle can be dragged; its handle is ball.
    live : bool, optional
        Only find the contact, without its comparison with the shading: ten times a second.
    """
    table = setting.table
    border = ImageOverlay(lines=(working_circle(table),))

    def detect() -> Detection:
        refuse_size(rgb, setting.image_size)
        image, step = as_image(rgb).rgb, setting.step
        image = image if step == 1 else np.asarray(cv2.blur(image, (step, step)), np.float32)
        light, name = unmix(table.apply(image), setting.crosstalk), "Image"
        if live:
            indentation = find_indentation(light, setting.background, valid=table.valid, name=name)
            figures = indentation.quality.figures
            contact_mm = table.grid.pitch_mm * indentation.contact_radius_px
            if contact_mm >= radius_mm:
                raise contact_too_large(contact_mm, radius_mm, name)
            depth_mm = ball_depth_from_contact(contact_mm, radius_mm)
        else:
            inputs = setting.background, table, setting.led_positions_mm
            press = find_ball(light, *inputs, radius_mm=radius_mm, name=name)
            indentation, figures = press.indentation, press.quality.figures
            contact_mm, depth_mm = press.contact_radius_mm, press.pose.depth_mm
        circle = ball_handle(indentation, table) if editable else None
        circles = () if circle is None else (circle,)
        contour = ball_contour(indentation, table)
        overlay = border + ImageOverlay(marks, circles, contour)
        text = f"Ball found: contact radius {contact_mm:.2f} mm, depth {depth_mm:.2f} mm."
        return judged_detection(overlay, figures, text)

    return detect_or_refusal(detect, marks=border + ImageOverlay(marks))


def _pixels(points_mm: Sequence[PointXY], table: ResamplingTable) -> list[PointXY]:
    """Return the pixels of those points of the top surface that the camera sees."""
    nodes = table.grid.to_index(np.array(points_mm, np.float64).reshape(-1, 2))
    return [(float(u), float(v)) for u, v in node_pixels(table, nodes)]


def press_marks(
    earlier_px: Iterable[PointXY], next_px: Iterable[PointXY] = ()
) -> tuple[OverlayMarker, ...]:
    """Return dots at earlier presses (u, v), and a ring where the next press helps most."""
    dots = (OverlayMarker(u, v, "dot", "info") for u, v in earlier_px)
    rings = (OverlayMarker(u, v, "ring", "expected", text="next press") for u, v in next_px)
    return (*dots, *rings)


def placed_ball(_rgb: PixelArray, *, circle: PlacedCircle, marks: ImageOverlay) -> Detection:
    """Show a contact that was placed by hand."""
    circle_mark = OverlayCircle(circle.u_px, circle.v_px, circle.radius_px, "good", handle="ball")
    marks = replace(marks, circles=(circle_mark,))
    return Detection(marks, Finding("placed", "The contact was placed by hand."))


def ball_in_capture(rgb: PixelArray, *, detect: Detector) -> Detection:
    """Find the ball in a capture, or offer a circle that the user can place."""
    detection = detect(rgb)
    if detection.overlay.circles:
        return detection
    rows, columns = rgb.shape[:2]
    circle = OverlayCircle(columns / 2.0, rows / 2.0, FIRST_RADIUS * rows, "bad", handle="ball")
    marks = replace(detection.overlay, circles=(circle,))
    by_hand = "Exclude the image, or drag the circle onto the edge of the contact."
    remedy = f"{detection.finding.remedy}. {by_hand}"
    return Detection(marks, replace(detection.finding, remedy=remedy))


class BallsStep(ImageStep):
    """Finds the contact of each press. The user enters radii and can move a contact."""

    of: ClassVar[Stage[Any]] = BALLS
    guide = "guide/calibrate", "7-ball-presses"
    task = "Press the ball where the ring is, and hold it still."
    assembly = "ball"
    frames, wanted = 4, 10
    advice = "Vary depth and position over the whole field. Enter the diameter of each ball."
    figure = "shading_misfit_percent"
    _next_radius_mm: float | None = None

    def build(self) -> None:
        """Create what only this step shows."""
        self.radius = NumberField(minimum=0.1, maximum=1000.0, decimals=3, suffix=" mm")
        set_names(
            self.radius,
            "calibrate.radius",
            "Diameter of the ball in mm",
            "Diameter for the next press, or for the shown one",
        )
        self.radius.valueChanged.connect(self._on_diameter)
        self.own = (self.panel.add_extra("Ball diameter", self.radius),)

    def detector(self, name: str) -> Detector:
        """Return the detection of a pressed ball, once the earlier stages are known."""
        setting = setting_of(self.results)
        if setting is None:
            return detect_nothing
        detect = partial(detect_open_ball, radius_mm=self.radius_mm)
        if name:
            detect = partial(detect, setting=setting, editable=True)
            border = ImageOverlay(lines=(working_circle(setting.table),))
            return self.of_capture(name, detect, border)
        marks = press_marks(*self.places_px())
        return partial(detect, setting=setting.coarser(), marks=marks, live=True)

    def places_px(self) -> tuple[Iterable[PointXY], Iterable[PointXY]]:
        """Return where balls were pressed (u, v), and where the next press helps most, if known."""
        table, balls = table_of(self.results), self.results.get(BALLS)
        if table is None:
            return (), ()
        earlier_mm = [] if balls is None else [press.pose.centre_mm for press in balls.presses]
        finished = self.model.page.finished
        next_mm = None if finished else next_press_mm(table, self.radius_mm, earlier_mm)
        return _pixels(earlier_mm, table), () if next_mm is None else _pixels([next_mm], table)

    def of_capture(self, name: str, detect: Detector, marks: ImageOverlay) -> Detector:
        """Return the detection for a capture: as placed by hand, or found and ready to be moved."""
        placed = self.session.decisions.balls.get(name)
        if placed is not None:
            return partial(placed_ball, circle=placed, marks=marks)
        return partial(ball_in_capture, detect=detect)

    def depends_on(self) -> tuple[Any, ...]:
        """Return the radius of the shown or of the next press, and whether one is wanted."""
        return self.radius_mm, self.model.page.finished

    def judge(self, path: Path) -> Finding | None:
        """Return how a press was judged."""
        return judge_ball(path.name, self.project)

    def remedies(self, state: str) -> tuple[RemedyButton, ...]:
        """Offer the diameter that fits a press which disagrees with the others."""
        for name, diameter_mm in self.fitting_diameters():
            text = f"Set {Path(name).stem} to {diameter_mm:.3g} mm"
            fit = partial(self.model.set_ball_diameter, name, diameter_mm)
            return (text, fit), ("Repeat it", partial(self.repeat, name))
        return super().remedies(state)

    def fitting_diameters(self) -> Iterable[tuple[str, float]]:
        """Yield name and fitting diameter (mm) of each press that disagrees with the others."""
        balls = self.results.get(BALLS) if REFLECTANCE.key in self.model.statuses else None
        for press in () if balls is None else balls.presses:
            agreement = _agreement(press, self.project)
            if agreement is not None and agreement.fault is not None:
                yield Path(press.name).name, float(f"{2.0 * agreement.radius_mm:.2g}")

    def note(self, name: str) -> str:
        """Return the diameter of the ball of a press."""
        default_radius_mm = self.session.ball_default_radius_mm
        radius_mm = self.session.ball_radii_mm.get(name, default_radius_mm)
        return "" if radius_mm is None else f"⌀ {2.0 * radius_mm:g} mm"

    # The radius

    @property
    def radius_mm(self) -> float:
        """Radius of the ball of the shown or of the next press, from the field of the diameter."""
        return 0.5 * self.radius.value()

    @property
    def typing(self) -> bool:
        """Whether a diameter is being typed, so that the field still has the old value."""
        return self.radius.waiting

    def commit(self) -> None:
        """Use a typed diameter even without Enter: it belongs to the image shown now."""
        self.radius.take()

    def on_bench(self, scene: BenchScene) -> None:
        """Use the radius of the ball on the virtual bench, and press it where the ring is."""
        self._next_radius_mm = 0.5 * scene.size_mm
        self._show_radius()
        if (bench := self.context.source.bench) is not None:
            for u, v in self.places_px()[1]:
                bench.drag_to(u, v)
        self.arm()

    def _on_diameter(self, diameter_mm: float) -> None:
        if self.model.page.shown:
            self.model.set_ball_diameter(self.model.page.shown, diameter_mm)
        else:
            self._next_radius_mm = 0.5 * diameter_mm
            self.arm()

    def _show_radius(self) -> None:
        session, name = self.session, self.model.page.shown
        default_radius_mm = session.ball_default_radius_mm or USUAL_RADIUS_MM
        next_radius_mm = self._next_radius_mm or default_radius_mm
        radius_mm = session.ball_radii_mm.get(name, default_radius_mm) if name else next_radius_mm
        with QSignalBlocker(self.radius):
            self.radius.setValue(2.0 * radius_mm)

    # What is shown

    def refresh(self) -> None:
        """Update to changed results, also after undo."""
        self._show_radius()
        super().refresh()

    def arm(self, *, force: bool = False) -> None:
        """Set the detection, with the radius of the shown press."""
        if force:
            self._show_radius()
        super().arm(force=force)

    # Manual corrections

    def moved(self, handle: str, u: float, v: float, radius_px: float) -> None:
        """Move the contact of the shown press."""
        if self.model.page.shown:
            self.place_ball(self.model.page.shown, PlacedCircle(u, v, radius_px))

    def place_ball(self, name: str, circle: PlacedCircle | None) -> None:
        """Set the contact circle in a ball image by hand, with undo."""
        put, before = partial(self.project.place_ball, name), self.session.decisions.balls.get(name)
        self.model.correct(f"Move the contact in {name}", put, circle, before, "balls")


def setting_of(results: StageResults) -> BallDetectionInputs | None:
    """Return the results that the detection of a ball needs, or None if one is missing."""
    lens, lights, bare = results.get(LENS), results.get(LIGHTS), results.get(BACKGROUND)
    if lens is None or lights is None or bare is None:
        return None
    crosstalk, camera = lights.crosstalk.matrix, lens.camera
    return BallDetectionInputs(
        bare.table,
        lights.leds.led_positions_mm,
        crosstalk,
        unmix(bare.light, crosstalk),
        (camera.width, camera.height),
    )


def judge_ball(name: str, project: CalibrationProject) -> Finding | None:
    """Return how a ball press was judged: the error of its shading. None: not yet."""
    balls = project.results.get(BALLS)
    detections = () if balls is None else balls.seen
    ball = next((detection for detection in detections if detection.file == name), None)
    if ball is not None and ball.fault is not None:
        return finding_from_error(ball.fault)
    if ball is None or ball.press is None:
        return None
    press = ball.press
    error_percent = 100.0 * press.shading_misfit
    finding = Finding("shading_error_percent", "Shading error", error_percent, "%")
    agreement = _agreement(press, project)
    if agreement is not None and agreement.fault is not None:
        return replace(finding, verdict=Verdict.FAIL, remedy=agreement.fault.line)
    worst = worst_of(press.quality.figures)
    if worst is None:
        return finding
    return replace(finding, verdict=worst.verdict, remedy=worst.remedy)


def _agreement(press: BallPress, project: CalibrationProject) -> PressAgreement | None:
    """Return how a press agrees with the others, if it was compared with its present radius."""
    reflectance = project.results.get(REFLECTANCE)
    for agreement in () if reflectance is None else reflectance.table.agreements:
        same_radius = agreement.stated_radius_mm == press.pose.radius_mm
        if agreement.name == press.name and same_radius:
            return agreement
    return None
