"""The virtual bench in the wizard: it presses where the ring is, and goes on once started."""

import shutil
from dataclasses import replace

import pytest

from app.calibrate.detection_marks import table_of
from app.source_ui.virtual_session import virtual_session
from app.sources.virtual_bench import VirtualBench
from gelpolight_core.calibration.open_ball_stages import BALLS
from gelpolight_core.calibration.project import CalibrationProject
from gelpolight_core.lab.press_folder import add_presses
from gelpolight_core.session.description import create_session
from gelpolight_core.simulation.sensor_design import SensorDesign
from gelpolight_core.stages.balls.ball_press import next_press_mm


@pytest.fixture
def bench(context):
    """Return a bench of the size of the small session."""
    context.source.bench = VirtualBench(SensorDesign().scaled(0.25))
    return context.source.bench


@pytest.mark.function("Calibrate the virtual sensor: the bench goes on by itself once started")
def test_a_bench_that_was_started_goes_on_after_each_capture_until_the_object_is_moved(
    technician, context, bench, tmp_path
):
    context.settings.prefer(captures_automatically=True)
    folder = tmp_path / "virtual"
    create_session(replace(virtual_session(), folder=folder))
    context.source.choose_virtual_sensor()
    technician.begin(CalibrationProject(folder), "lens")
    step = technician.wizard.open
    technician.until(lambda: technician.wizard.panel.live.text())
    assert bench.is_untouched, "it never starts by itself"
    technician.click("calibrate.lay")
    technician.until(lambda: step.count() == 2 and bench.scene.pose == 2)
    moved = bench.set_scene(yaw_deg=5.0)
    technician.until(lambda: step.count() == 3)
    technician.rest()
    assert bench.scene == moved


def test_the_bench_presses_the_ball_where_the_ring_is(technician, bench, computed_project):
    project = computed_project()
    technician.begin(project, "balls")
    step, balls = technician.wizard.open, project.results.get(BALLS)
    step.live()
    step.on_bench(bench.show("balls", 1))
    scene, earlier_mm = bench.scene, [press.pose.centre_mm for press in balls.presses]
    assert step.radius_mm == 0.5 * scene.size_mm
    ring_mm = next_press_mm(table_of(project.results), step.radius_mm, earlier_mm)
    # A pixel of the small camera is 0.1 mm.
    assert (scene.x_mm, scene.y_mm) == pytest.approx(ring_mm, abs=0.2)
    technician.wizard.model.update_page(finished=True)
    assert not step.places_px()[1], "a complete step asks for no press"
    technician.rest()


def test_the_bench_takes_an_object_that_is_not_pressed_yet(
    technician, context, bench, computed_project, small_session, tmp_path
):
    project = computed_project()
    shutil.rmtree(project.session.folder / "presses")
    technician.begin(project, "validation")
    step, section = technician.wizard.open, technician.wizard.bench
    placed = []
    for press in sorted((small_session / "presses").glob("c*.png"))[:3]:
        section.lay(step)
        placed.append(bench.scene)
        section.lay(step)
        assert bench.scene == placed[-1], "it is not pressed yet"
        (file,) = add_presses(project.session.folder / "presses", step.form.value, 1)
        shutil.copy(press, project.session.folder / "presses" / file)
        step._follow()
    assert len(set(placed)) == 3
    technician.wizard.model.jobs.cancel()
    technician.rest()
