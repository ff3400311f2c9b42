"""The scenes of a calibration, from the first start to the validated sensor."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtWidgets import QLabel, QScrollArea
from screenshot_operator import Operator

from app.calibrate.page import CalibratePage
from app.calibrate.validation_step import ValidationStep
from app.calibrate.wizard import Wizard
from app.live.live_detection import HeldDetection
from app.sources.latest import Done
from app.sources.source import SourceFrame
from app.sources.virtual_bench import VirtualBench
from gelpolight_core.session.reference_object import ReferenceObject


def first_start(operator: Operator) -> None:
    """Start the program for the first time."""
    operator.window.show_page("sensors")
    operator.until(lambda: operator.window.page_name == "sensors", "the first page")
    operator.shot("first-start")


def set_up(operator: Operator) -> None:
    """State what is known of the sensor."""
    operator.window.begin("practice")
    operator.until(lambda: operator.window.page_name == "calibrate", "the Calibrate page")
    operator.click("question.open")
    operator.until(lambda: operator.see("setup.accept"), "the form")
    operator.shot("calibrate-set-up")
    operator.click("setup.accept")
    operator.until(lambda: page(operator).wizard, "the wizard")


def lens(operator: Operator) -> None:
    """Hold the checkerboard before the bare camera."""
    captures(operator, "lens", 5)
    lay(operator)
    operator.shot("calibrate-lens-views")
    captures(operator, "lens", 7, laid=True)
    computed(operator)
    operator.shot("calibrate-lens")


def top_surface(operator: Operator) -> None:
    """Lay the checkerboard on the top opening."""
    captures(operator, "top_pose", 1)
    computed(operator)
    operator.shot("calibrate-top-surface")


def lights(operator: Operator) -> None:
    """Lay the mirror on; first with what goes wrong most often."""
    wizard(operator).go_to("lights")
    bench(operator).switch("too_bright", True)
    operator.click("calibrate.lay")
    operator.pause(3.0)
    operator.shot("calibrate-lights-refused")
    bench(operator).switch("too_bright", False)
    captures(operator, "lights", 1)
    computed(operator)
    operator.shot("calibrate-lights")


def light_intensity(operator: Operator) -> None:
    """Press the white board on."""
    captures(operator, "radiance", 1)
    computed(operator)
    operator.shot("calibrate-light-intensity")


def background(operator: Operator) -> None:
    """Show the bare membrane."""
    captures(operator, "background", 1)
    computed(operator)
    operator.shot("calibrate-background")


def ball_presses(operator: Operator) -> None:
    """Press balls in all over the field."""
    captures(operator, "balls", 10)
    computed(operator)
    operator.shot("calibrate-balls")


def looking_back(operator: Operator) -> None:
    """Look at a capture again, at the refraction and at the curves."""
    strip = wizard(operator).area.strip
    strip.chosen.emit(sorted(p.name for p in balls(operator).glob("*.png"))[3])
    operator.pause(4.0)
    operator.shot("calibrate-looked-at")
    wizard(operator).go_to("result")
    computed(operator)
    tabs = wizard(operator).at("result").tabs
    tabs.setCurrentIndex(1)
    operator.shot("calibrate-refraction")
    tabs.setCurrentIndex(2)
    computed(operator)
    effect = wizard(operator).findChild(QLabel, "lut.effect")
    assert effect is not None
    operator.until(lambda: "RMS" in effect.text(), "the press through the curve")
    operator.shot("calibrate-reflectance")
    tabs.setCurrentIndex(0)


def calibration(operator: Operator) -> None:
    """Look at all stages together, and save."""
    wizard(operator).go_to("result")
    computed(operator)
    operator.shot("calibrate-result")
    operator.click("result.save")
    operator.until(lambda: wizard(operator).model.saved, "the saved calibration")


def validation(operator: Operator) -> None:
    """Press two objects of known size, each once."""
    wizard(operator).go_to("validation")
    step = wizard(operator).at("validation")
    assert isinstance(step, ValidationStep)
    step.count_asked.setValue(1)
    for known in (
        ReferenceObject(size_mm=5.0, height_mm=1.0),
        ReferenceObject("cuboid", 4.0, height_mm=1.0),
    ):
        step.show_known(known)
        operator.click("validation.add")
    for place in ("1", "2"):
        operator.until(lambda place=place: f" {place} of" in step.next_press.text(), "the press")
        if place == "2":
            area = operator.see("calibrate.panel.scroll")
            assert isinstance(area, QScrollArea)
            area.verticalScrollBar().setValue(0)
            operator.window.context.toasts.clear()
            operator.shot("calibrate-validation")
        operator.click("calibrate.lay")
        operator.pause(2.0)
        operator.click("calibrate.capture")
    operator.until(operator.see("validation.keep").isEnabled, "the measured presses")
    operator.click("validation.keep")


def page(operator: Operator) -> CalibratePage:
    """Return the Calibrate page."""
    found = operator.window.page("calibrate")
    assert isinstance(found, CalibratePage)
    return found


def wizard(operator: Operator) -> Wizard:
    """Return the wizard that is open."""
    found = page(operator).wizard
    assert found is not None
    return found


def bench(operator: Operator) -> VirtualBench:
    """Return what lies on the virtual sensor."""
    found = operator.window.context.source.bench
    assert found is not None
    return found


def balls(operator: Operator) -> Path:
    """Return the folder of the ball presses."""
    return wizard(operator).project.session.folder / "balls"


def lay(operator: Operator) -> None:
    """Put on the bench what the step asks for, and wait until it is found in the image."""
    found: list[bool] = []

    def note(done: Done[SourceFrame, HeldDetection | None]) -> None:
        if done.result is not None and done.request.settled:
            found.append(done.result.detection.ready)

    detected = wizard(operator).live.processed
    detected.connect(note)
    operator.click("calibrate.lay")
    found.clear()
    operator.until(lambda: found and found[-1], wizard(operator).panel.live.text())
    detected.disconnect(note)


def captures(operator: Operator, step: str, count: int, *, laid: bool = False) -> None:
    """Capture so many images for a step; `laid`: the first one lies on the bench already."""
    shown = wizard(operator)
    if shown.open.key != step:
        shown.go_to(step)
    for number in range(count):
        if number or not laid:
            lay(operator)
        before = shown.open.count()
        operator.click("calibrate.capture")
        operator.until(
            lambda before=before: shown.open.count() > before,
            f"a capture of {step}",
        )


def computed(operator: Operator) -> None:
    """Wait until nothing is under way any more."""
    shown = wizard(operator)
    operator.until(
        lambda: not (shown.model.jobs.busy or shown.model.busy_with_images), "the computed stages"
    )
    operator.pause(1.0)


SCENES = (
    first_start,
    set_up,
    lens,
    top_surface,
    lights,
    light_intensity,
    background,
    ball_presses,
    looking_back,
    calibration,
    validation,
)
