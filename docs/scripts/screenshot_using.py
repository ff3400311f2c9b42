"""The scenes of a calibrated sensor: library, Inspect, Measure."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QComboBox
from screenshot_operator import Operator

from app.inspect.page import InspectPage
from app.live.frame_viewer import ViewLayout
from app.measure.page import MeasurePage
from app.sources.virtual_bench import VirtualBench

if TYPE_CHECKING:
    from app.measure.press_view import PressView

DRIFTED_MS = 10.3
"""In place of 10: what LEDs that were not warm yet do to the light."""
TRUE_MM = 5.0


def library(operator: Operator) -> None:
    """Show the library with its first sensor."""
    show(operator, "sensors")
    operator.window.context.toasts.clear()
    operator.shot("sensors")


def inspect(operator: Operator) -> None:
    """Look at a coin, live; then standing, with its uncertainty."""
    bench(operator).place_object("coin")
    show(operator, "inspect")
    page = inspect_page(operator)
    operator.until(lambda: page._shown is not None and page._shown.surface is not None, "depth")
    operator.until(lambda: page.views.surface.view is not None, "the 3D view")
    operator.pause(6.0)
    operator.shot("inspect")
    page.views.stage.arrange(ViewLayout("quality"))
    choice = page.views.quality.findChild(QComboBox, "inspect.quality.what")
    assert choice is not None
    choice.setCurrentIndex(choice.findData("uncertainty"))
    operator.pause(2.0)
    page.pause(True)
    operator.until(
        lambda: page._shown is not None and page._shown.quality is not None, "the uncertainty"
    )
    operator.pause(2.0)
    operator.shot("inspect-standing")
    page.pause(False)
    page.views.stage.arrange(ViewLayout())


def recording(operator: Operator) -> None:
    """Record a press, and replay it."""
    page = inspect_page(operator)
    bench(operator).place_object("nut")
    operator.pause(3.0)
    page.recorder.start()
    for step in range(12):
        bench(operator).set_scene(x_mm=0.4 * step - 2.0)
        operator.pause(0.3)
    page.recorder.stop()
    operator.until(lambda: not page.recorder.busy, "the recording")
    file = max(operator.window.context.workspace.folder.rglob("*.gplrec"))
    operator.window.context.toasts.clear()
    operator.window.context.source.choose_recording(file)
    operator.pause(6.0)
    operator.shot("inspect-replay")
    operator.window.context.source.choose_virtual_sensor()


def drift(operator: Operator) -> None:
    """Look at the sensor in another light than on the day of the calibration."""
    page = inspect_page(operator)
    bench(operator).place_object("bare")
    bench(operator).set_conditions(exposure_ms=DRIFTED_MS)
    operator.pause(3.0)
    operator.until(lambda: page.live_depth.state.fault is not None, "the fault")
    operator.shot("inspect-drift")
    bench(operator).set_conditions(exposure_ms=10.0)
    operator.pause(6.0)


def measure(operator: Operator) -> None:
    """Hold, measure, compare and keep a cylinder of known size, some times."""
    bench(operator).place_object("bare")
    show(operator, "measure")
    press_view = measure_page(operator).press_view
    places = ((1.0, -1.5), (-3.0, 2.0), (3.5, 3.0), (-2.5, -4.0), (0.5, 4.5))
    for number, (x_mm, y_mm) in enumerate(places):
        press_cylinder(operator, press_view, x_mm, y_mm)
        known = press_view.inspector.reference.known
        if not number:
            known.setCurrentIndex(known.findText("Cylinder 5", Qt.MatchFlag.MatchContains))
            known.activated.emit(known.currentIndex())
            operator.pause(1.0)
            operator.shot("measure")
        operator.click("measure.keep.button")
        operator.until(press_view.inspector.message.text, "the kept measurement")
        press_view.release()
    measure_page(operator).tabs.setCurrentWidget(measure_page(operator).results)
    operator.pause(2.0)
    operator.window.context.toasts.clear()
    operator.shot("measure-records")


def press_cylinder(operator: Operator, press_view: PressView, x_mm: float, y_mm: float) -> None:
    """Press the cylinder in somewhere, and wait until it is held and measured."""
    bench(operator).place_object("bare")
    operator.pause(2.0)
    bench(operator).place_object("cylinder")
    bench(operator).set_scene(x_mm=x_mm, y_mm=y_mm, size_mm=TRUE_MM)
    operator.until(lambda: press_view.work.image is not None, "the held press")
    operator.until(
        lambda: press_view.work.result is not None and not press_view.work.busy, "what was measured"
    )


def show(operator: Operator, name: str) -> None:
    """Show a page."""
    operator.window.show_page(name)
    operator.until(lambda: operator.window.page_name == name, f"the page {name}")
    operator.pause(1.0)


def bench(operator: Operator) -> VirtualBench:
    """Return what lies on the virtual sensor."""
    found = operator.window.context.source.bench
    assert found is not None
    return found


def inspect_page(operator: Operator) -> InspectPage:
    """Return the Inspect page."""
    found = operator.window.page("inspect")
    assert isinstance(found, InspectPage)
    return found


def measure_page(operator: Operator) -> MeasurePage:
    """Return the Measure page."""
    found = operator.window.page("measure")
    assert isinstance(found, MeasurePage)
    return found


SCENES = (library, inspect, recording, drift, measure)
