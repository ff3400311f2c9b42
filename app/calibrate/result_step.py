"""The result of a calibration: its verdict, the one cause, saving, and the report."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PySide6.QtWidgets import QHBoxLayout, QPushButton, QTabWidget, QVBoxLayout, QWidget

from app.program.file_dialogs import ask_save
from app.program.jobs import BackgroundJob
from app.program.workspace import Workspace
from app.views.map.colour_tables import colour_table
from app.widgets.actions import push_button
from app.widgets.label import MarkupLabel, escaped, plain_tip
from app.widgets.layout import hbox, scroll_area, vbox
from app.widgets.quality_table import QualityTableWidget
from app.widgets.text_roles import named_label, set_property, set_text_role
from app.widgets.widget_names import set_names
from gelpolight_core.base.errors import InputError
from gelpolight_core.base.finding import (
    Finding,
    QualityTable,
    Verdict,
    join_quality_tables,
    worst_of,
)
from gelpolight_core.base.root_causes import best_cause, cause_and_rest
from gelpolight_core.calibration.calibration_file import read_calibration
from gelpolight_core.calibration.closed_sensor_recipe import BALLS as CLOSED_BALLS
from gelpolight_core.calibration.joint_stage import JOINT, WORTH, TermFact, term_facts
from gelpolight_core.calibration.open_ball_stages import BALLS, REFLECTANCE
from gelpolight_core.calibration.open_sensor_recipe import TOP_POSE
from gelpolight_core.calibration.recipe import StageResults
from gelpolight_core.calibration.recipes import OPEN_FOLDERS
from gelpolight_core.calibration.stage_status import StageState, StageStatus
from gelpolight_core.sensor.sensor_calibration import Calibration

from .image_panels import MapsView, most_oblique_press
from .image_step import ImageStep
from .page_state import RUNNING, RemedyButton, StepState, is_done
from .result_plot import ResultPlot
from .step import Step

SET_UP = "setup"
MENDED_IN = {
    "ball_radius": BALLS.key,
    "press_radius_percent": BALLS.key,
    "membrane": "radiance",
    "focus": "lens",
    "background_light_percent": "background",
    "background_place_percent": "background",
}
"""The step where a cause is corrected. A stated number is corrected in the set-up."""


@dataclass(frozen=True, slots=True)
class CorrectiveAction:
    """The likely cause of poor figures, with the step or the number to correct.

    Attributes
    ----------
    text : str
        The cause with its remedy, without a full stop.
    step : str
        Key of the step or stage where it is corrected.
    ball : str
        File name of the ball press whose diameter is wrong; empty for any other cause.
    diameter_mm : float
        The diameter that fits it, to two digits.
    """

    text: str
    step: str
    ball: str = ""
    diameter_mm: float = 0.0


def corrective_action(
    quality: Mapping[str, QualityTable], results: StageResults
) -> CorrectiveAction | None:
    """Return the action that corrects most, or None if all figures pass.

    Parameters
    ----------
    quality : mapping of str to QualityTable
        Quality tables of the stages by their keys.
    results : StageResults
        Results of the stages.
    """
    worst = worst_of(join_quality_tables(quality.values()).figures)
    if worst is None:
        return None
    cause = best_cause(quality)
    if cause is None:
        stage = next(key for key, table in quality.items() if worst in table.figures)
        return CorrectiveAction(worst.sentence.rstrip("."), stage)
    odd = _odd_ball(results) if cause.key == "press_radius_percent" else ()
    return CorrectiveAction(cause.remedy, MENDED_IN.get(cause.key, SET_UP), *odd)


def _odd_ball(results: StageResults) -> tuple[str, float] | tuple[()]:
    """Return the press whose ball contradicts the others most, and the diameter that fits."""
    if (reflectance := results.get(REFLECTANCE)) is not None:
        fit = max(reflectance.table.agreements, key=lambda fit: fit.radius_off_percent)
        return Path(fit.name).name, float(f"{2.0 * fit.radius_mm:.2g}")
    if (closed := results.get(CLOSED_BALLS)) is not None:
        used = (size for size in closed.sizes if size.name not in closed.result.refused)
        worst = max(used, key=lambda size: size.excess)
        return worst.name, worst.proposed_mm
    return ()


if TYPE_CHECKING:
    from app.calibrate.reflectance.lut_editor import CurveEditorPanel
    from gelpolight_core.calibration.project import CalibrationProject
    from gelpolight_core.output.report.result_pictures import ResultPicture

FAIL, OUTDATED = StageState.FAIL, StageState.STALE
MAIN = ("ball_height_error_percent", "held_out_normal_deg")
"""Figures that say how good the whole calibration is; a recipe has one of them."""


Drawn = tuple[tuple["ResultPicture", ...], tuple[TermFact, ...], str]
"""Pictures as in the report, terms, and the sensor's last calibration beside this one, if any."""
NOTHING: Drawn = (), (), ""
FOLLOW = "follow when all stages have results."


def drawn_result(project: CalibrationProject, workspace: Workspace) -> Drawn:
    """Return the pictures of a finished calibration, its terms, and the one before it."""
    from gelpolight_core.output.report.result_pictures import result_pictures  # slow to import

    run = project.finish()
    c, joint = run.calibration, run.results.get(JOINT)
    terms = () if joint is None else term_facts(joint.full)
    return result_pictures(c, run), terms, last_calibration(c, workspace)


def last_calibration(c: Calibration, workspace: Workspace) -> str:
    """Return date and error of the sensor's last usable calibration, and what has changed since."""
    entries = (e for e in workspace.entries() if e.serial == c.serial and not e.failed)
    for summary, made, path in ((e.summary, e.created, e.path) for e in entries):
        if summary is not None and made is not None and summary.inputs != c.provenance.inputs:
            changes = ", ".join(changes_since(read_calibration(path), c))
            return f"Last calibration, {made.astimezone():%d %b}: {changes}."
    return ""


def changes_since(last: Calibration, c: Calibration) -> Iterator[str]:
    """Yield the error of the last calibration, and how far LEDs and light of the membrane are."""
    if (figure := main_figure(last.quality.values())) is not None:
        yield figure.value_text
    before_mm, now_mm = last.data.leds_mm, c.data.leds_mm
    if now_mm.size and before_mm.shape == now_mm.shape:
        yield f"LEDs within {np.linalg.norm(now_mm - before_mm, axis=1).max():.3f} mm"
    before, now = (float(np.nanmedian(x.data.background)) for x in (last, c))
    yield f"light {100.0 * (now / before - 1.0):+.1f} %"


def terms_markup(facts: Iterable[TermFact]) -> str:
    """Return the terms that the sensor's light needs, and those left out, with their worth."""
    rows = {True: "", False: ""}
    for fact in facts:
        values = f"<tr><td colspan='2' style='color: @muted'>{escaped(fact.values)}</td></tr>"
        rows[bool(fact.values)] += (
            f"<tr><td width='97%'>{escaped(fact.name)}</td><td width='1%' align='right' style="
            f"'white-space: nowrap'>{escaped(fact.worth)}</td></tr>{values if fact.values else ''}"
        )
    markup = "".join(
        f"<h4>{title}</h4><table width='100%' cellspacing='2'>{rows[is_needed]}</table>"
        for title, is_needed in (("What this sensor needs", True), ("Left out", False))
        if rows[is_needed]
    )
    return f"{markup}<p style='color: @muted'>{WORTH}.</p>"


def main_figure(tables: Iterable[QualityTable]) -> Finding | None:
    """Return the figure that says how good a whole calibration is, if there is one."""
    return next((f for table in tables for f in table.figures if f.key in MAIN), None)


class VerdictOverview(QWidget):
    """The verdict in one line, the poor figures first, and the others folded.

    Parameters
    ----------
    on_press : callable
        Called with the name of the press whose bar was clicked.
    """

    def __init__(self, on_press: Callable[[str], object]) -> None:
        super().__init__()
        set_names(self, "result", "Result")
        self._on_press = on_press
        self.headline = named_label("result.headline", "Verdict", bold=1.5)
        self.poor = QualityTableWidget("result.poor", "Figures beyond their limits")
        self.every = set_names(MarkupLabel(wrap=True), "result.every", "All figures")
        self.more = set_names(QPushButton(), "result.more", "Show all figures")
        self.more.setCheckable(True)
        self.more.toggled.connect(self.every.setVisible)
        self.every.hide()
        self.plots: tuple[ResultPlot, ...] = ()
        self.about = named_label("result.about", "About the pictures", role="muted")
        self._charts, self._maps, inside = QVBoxLayout(), QHBoxLayout(), QWidget()
        parts = self.about, self.poor, self.every, (self._charts, 4), (self._maps, 3)
        vbox(*parts, of=inside, margins=0, spacing=12)
        scroll = set_names(scroll_area(inside), "result.scroll", "Figures")
        head = hbox((self.headline, 1), self.more)
        vbox(head, (scroll, 1), of=self, margins=16, spacing=12)

    def show_pictures(self, pictures: Iterable[ResultPicture], about: str) -> None:
        """Show these pictures in place of the last ones: charts, and below them plans in a row."""
        self.about.setText(about)
        self.about.setVisible(bool(about))
        for plot in self.plots:
            plot.deleteLater()
        self.plots = tuple(map(ResultPlot, pictures))
        for plot in self.plots:
            plot.chosen.connect(self._on_press)
            (self._maps if plot.from_above else self._charts).addWidget(plot)

    def show_figures(self, tables: Sequence[tuple[str, QualityTable]], cause: str) -> None:
        """Show the figures of stages by their titles, the poor ones first, `cause` only once."""
        figures = join_quality_tables(table for _, table in tables).figures
        poor = [f for f in figures if f.verdict is not Verdict.PASS]
        poor.sort(key=lambda f: -list(Verdict).index(f.verdict))
        poor_figures = (replace(f, remedy="") if f.remedy == cause else f for f in poor)
        self.poor.set_table(QualityTable(tuple(poor_figures)))
        self.poor.setVisible(bool(poor))
        full = ((f"<h4>{escaped(title)}</h4>", table) for title, table in tables if table.figures)
        self.every.setText("".join(head + QualityTableWidget.markup(t) for head, t in full))
        self.more.setText(f"All {len(figures)} figures")
        self.more.setVisible(bool(figures))


class ResultStep(Step):
    """Shows the result of all stages, and saves calibration and report."""

    key, title, stages = "result", "Result", ("reflectance", "joint")
    guide = "guide/calibrate", "8-result"
    task = "Check the verdict, then save the calibration."

    def build(self) -> None:
        """Create what only this step shows."""
        self._drawn: object = self  # not the results of a stage
        self.overview = VerdictOverview(self._open_press)
        self.terms = set_names(MarkupLabel(wrap=True), "result.terms", "Terms of the light")
        self.save = push_button("result.save", "&Save the calibration", self.store)
        self.report = push_button("result.report", "Write the &report…", partial(ask_report, self))
        self.saved = named_label("result.saved", "Where it was saved", role="pass")
        self.own = tuple(map(self.panel.add_foot, (self.saved, self.report, self.save)))
        if JOINT.key in self.model.statuses:
            self.own += (self.panel.add_extra("Terms of the light model", self.terms, below=True),)
        self.tabs = set_names(QTabWidget(documentMode=True), "result.tabs", "Result")
        self.tabs.addTab(self.overview, "Verdict")
        if REFLECTANCE.key in self.model.statuses:
            self._maps = MapsView()
            self.tabs.addTab(self._maps, "Refraction")
            self.tabs.addTab(QWidget(), "Reflectance curves")
        self.tabs.tabBar().setVisible(self.tabs.count() > 1)
        self.tabs.currentChanged.connect(lambda _: self._show_tab())

    @cached_property
    def curves(self) -> CurveEditorPanel:
        """The editor of the reflectance curves, created when its tab is first shown."""
        from app.calibrate.reflectance.lut_editor import CurveEditorPanel  # slow to import

        curves = CurveEditorPanel(self.model)
        vbox(curves, of=self.tabs.widget(2), margins=0)
        return curves

    @property
    def centre(self) -> QWidget:
        """The tabs: verdict, refraction, reflectance curves."""
        return self.tabs

    def focus(self) -> QWidget:
        """Return the main button."""
        return self.panel.next if self.model.saved else self.save

    def state(self) -> StepState:
        """Return the state of the last stages, or the worst of all once these are done."""
        statuses = self.model.statuses
        stages: tuple[str, ...] = self.stages or tuple(statuses)[-1:]
        if all(_is_made(statuses[stage]) for stage in stages):
            stages = tuple(statuses)
        return self.state_of(stages)

    def is_finished(self, state: str) -> bool:
        """Return whether the present captures are saved as a calibration."""
        return is_done(state) and bool(self.model.saved)

    def number(self) -> Finding | None:
        """Return the figure of the whole calibration."""
        return main_figure(status.quality for status in self.model.statuses.values())

    def remedies(self, state: str) -> tuple[RemedyButton, ...]:
        """Return buttons that correct the one cause: enter the number, or go to the step."""
        mend = self._mend()
        if mend is None or state not in ("warn", "fail"):
            return super().remedies(state)
        step = next((step for step in self.model.page.steps if mend.step in step.stages), None)
        key = mend.step if step is None else step.key
        title = "Set-up" if step is None else step.title
        go = (f"Go to {title}", partial(self.model.step_requested.emit, key))
        if not mend.ball:
            return () if step is self else (go,)
        text = f"Set {Path(mend.ball).stem} to {mend.diameter_mm:g} mm"
        return ((text, partial(self.model.set_ball_diameter, mend.ball, mend.diameter_mm)),)

    def explain(self, state: str, sentence: str) -> str:
        """Return the one cause."""
        mend = self._mend()
        return f"{mend.text}." if mend is not None and state in ("warn", "fail") else sentence

    def _mend(self) -> CorrectiveAction | None:
        """Return the action that corrects the one cause, or None if all figures pass."""
        quality = {key: status.quality for key, status in self.model.statuses.items()}
        return corrective_action(quality, self.results)

    def tables(self) -> Sequence[QualityTable]:
        """Return nothing: the figures have their own place."""
        return ()

    def close(self) -> None:
        """Stop the thread of the curves."""
        if "curves" in self.__dict__:
            self.curves.close_editor()

    def refresh(self) -> None:
        """Show the present state of every stage."""
        model, statuses = self.model, self.model.statuses
        self.saved.setText(model.saved_line)
        _, tables = cause_and_rest({key: status.quality for key, status in statuses.items()})
        mend = self._mend()
        cause = "" if mend is None else mend.text
        self.overview.show_figures([(self._title(k), t) for k, t in tables.items()], cause)
        verdict, role = self._verdict(statuses)
        self.overview.headline.setText(verdict)
        set_text_role(self.overview.headline, role)
        is_idle = all(state != RUNNING for state, _ in model.page.states.values())
        is_ready = is_idle and all(map(_is_made, statuses.values()))
        self._draw_result(self.results.get(self.project.recipe.stages[-1]) if is_ready else None)
        self.save.setText("&Save as a draft" if role == "fail" else "&Save the calibration")
        self.save.setEnabled(is_ready and not model.saved and not model.jobs.busy)
        tip = "It is saved, and nothing has changed since." if model.saved else ""
        self.save.setToolTip(plain_tip(tip))
        set_property(self.save, "primary", self.save.isEnabled())
        # The report waits for the stages by itself.
        self.report.setEnabled(is_ready or bool(model.jobs.busy and model.saved))
        self._show_tab()

    def _draw_result(self, last: object) -> None:
        """Draw the pictures of new results of the last stage in the background, None: of none."""
        if last is self._drawn:
            return
        self._drawn = last
        self._show_result(last, NOTHING)
        if last is not None:
            work = partial(drawn_result, self.project, self.context.workspace)
            done = partial(self._show_result, last)
            self.model.short_jobs.submit(BackgroundJob("Drawing", lambda _progress: work(), done))

    def _show_result(self, last: object, drawn: Drawn) -> None:
        """Show what was drawn of these results, unless they have changed since."""
        if last is self._drawn:
            pictures, terms, earlier = drawn
            self.overview.show_pictures(pictures, earlier if pictures else f"Pictures {FOLLOW}")
            self.terms.setText(terms_markup(terms) if terms else f"They {FOLLOW}")

    def _open_press(self, stem: str) -> None:
        """Show the ball press of this name in its step."""
        step = next(s for s in self.model.page.steps if BALLS.key in s.stages)
        self.model.step_requested.emit(step.key)
        if isinstance(step, ImageStep):
            files = self.project.session.captured(step.folder)
            step.show_capture(next(file.name for file in files if file.stem == stem))

    def _show_tab(self) -> None:
        """Update the tab that is shown. The others are updated when they are opened."""
        index = self.tabs.currentIndex()
        if index == 1:
            reason = "The comparison needs the ball presses. Complete the earlier steps first."
            try:
                panels = most_oblique_press(self.project)
            except InputError as error:
                panels, reason = (), str(error)
            self._maps.show_panels(panels, none=reason)
        elif index == 2:
            self.curves.show_results()

    def _title(self, stage: str) -> str:
        return self.project.recipe[stage].title

    def _verdict(self, statuses: dict[str, StageStatus]) -> tuple[str, str]:
        """Return the verdict in one line, with its colour."""
        if all(map(_is_made, statuses.values())):
            failed = ", ".join(self._title(k) for k, s in statuses.items() if s.state is FAIL)
            if failed:
                return f"Failed: {failed}", "fail"
            figures = join_quality_tables(status.quality for status in statuses.values()).figures
            if warnings := sum(figure.verdict is Verdict.WARN for figure in figures):
                return f"Usable. Figures with a warning: {warnings}", "warn"
            count = sum(bool(figure.limit_text) for figure in figures)
            return f"Passed: all {count} limits are kept.", "pass"
        if self.model.jobs.busy and self.model.saved:
            return "Saved. You can validate it now; the stages are computed again.", ""
        if self.model.jobs.busy:
            return "Computing. Please wait.", ""
        count = sum(not is_done(status.state.value) for status in statuses.values())
        if any(status.state is OUTDATED for status in statuses.values()):
            text = f"Outdated stages: {count}. The captures have changed. Click Recompute."
            return text, "stale"
        return f"Incomplete stages: {count}. {self._missing(statuses)}", ""

    def _missing(self, statuses: dict[str, StageStatus]) -> str:
        """Return what to do, with the titles of missing stages that need the open sensor."""
        text = "Complete them from top to bottom."
        open_titles = [
            self._title(key)
            for key, status in statuses.items()
            if self.project.recipe[key].folder in OPEN_FOLDERS and status.state is StageState.EMPTY
        ]
        if open_titles and TOP_POSE.key in statuses:
            text += (
                f" {', '.join(open_titles)} need the open sensor. If it cannot be opened, start a "
                "new calibration and answer that the membrane is bonded."
            )
        return text

    # Saving

    def store(self) -> None:
        """Write the calibration into the library."""
        project, workspace = self.project, self.context.workspace

        def work(_progress: object) -> Path:
            calibration = project.finish().calibration
            name = f"{calibration.serial}-{datetime.now().astimezone():%Y-%m-%d-%H%M%S}"
            return workspace.keep_calibration(calibration, name)

        self.model.jobs.submit(BackgroundJob("Saving the calibration", work, self.model.keep))
        self.refresh()


def ask_report(step: Step) -> None:
    """Ask for a file name and write the report of the session there."""
    name = f"{step.model.project.session.serial}-report.pdf"
    title, patterns = "Write the report", "PDF (*.pdf)"
    path = ask_save(step.area, step.context.settings, "report", title, name, patterns)
    if path is not None:
        write_session_report(path, step)


def write_session_report(path: Path, step: Step) -> None:
    """Write the report of the session in its present state. The panel shows the outcome."""
    project, workspace = step.model.project, step.context.workspace
    colours = colour_table(step.context.display.value.colours)

    def work(_progress: object) -> None:
        # Slow to import.
        from gelpolight_core.output.report import calibration_report, report_pdf_file

        run = project.finish()
        calibration, saved = run.calibration, workspace.entry_of(run.calibration.identity)
        if saved is not None:
            calibration = replace(calibration, validation=saved.validation)
        report = calibration_report.calibration_report(calibration, run, colours=colours)
        report_pdf_file.write_report(report, path)

    def done(_nothing: None) -> None:
        step.model.show_notice(f"Report saved as {path}", "pass")

    step.model.jobs.submit(BackgroundJob("Writing the report", work, done))


def _is_made(status: StageStatus) -> bool:
    """Return whether a stage has a result of the present captures, good or bad."""
    return is_done(status.state.value) or (status.state is FAIL and bool(status.quality.figures))
