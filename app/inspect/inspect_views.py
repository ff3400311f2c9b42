"""All views of the page: the frame viewer, the section below it, and the inspector beside it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from PySide6.QtWidgets import QWidget

from app.live.frame_processor import FrameRequest, FrameResult
from app.live.frame_viewer import FrameViewer, HeightPanel, ViewLayout
from app.program.context import AppContext
from app.program.first_steps import FirstSteps
from app.program.jobs import JobQueue
from app.source_ui.bench_panel import BenchArea
from app.views.map.map_point import FLAG_WORDS
from app.views.map.map_view import MapView, extent_of
from app.views.map.quantities import FLAG_COLOURS, STEEPEST_DEG, ReferenceMap
from app.views.map.sections import SectionResult, SectionSettings
from app.widgets.actions import Slot, make_action
from app.widgets.collapsible_section import CollapsibleSection
from app.widgets.inputs import ComboBox
from app.widgets.label import MarkupLabel, escaped
from app.widgets.layout import hbox, side_panel, vbox
from app.widgets.widget_names import set_names
from gelpolight_core.base.form_fields import from_settings_text, to_settings_text
from gelpolight_core.reconstruction.height_map import Flag

from .processing_panel import DisplayPanel, ProcessingPanel
from .section_panel import SectionMarks, SectionPanel

TELL_EVERY = 10
"""Frames between two updates of the legend, so that it can be read."""


class SelectableMap(QWidget):
    """A map of one of several quantities, with a legend below it.

    Parameters
    ----------
    name, title : str
        The widget's name, and its text for screen readers.
    quantities : mapping of str to str
        Texts of the quantities that can be chosen, by their keys.
    on_chosen : callable
        Called when another quantity was chosen.
    """

    def __init__(
        self, name: str, title: str, quantities: Mapping[str, str], on_chosen: Slot
    ) -> None:
        super().__init__()
        set_names(self, name, title)
        self.map = MapView(f"{name}.map", title)
        self._on_chosen = on_chosen
        self._what = set_names(ComboBox(), f"{name}.what", "Quantity shown")
        self._what.offer((text, key) for key, text in quantities.items())
        self._what.currentIndexChanged.connect(self._choose)
        self._legend = set_names(MarkupLabel(wrap=True), f"{name}.legend", "Legend")
        self._legend.setContentsMargins(6, 2, 6, 2)
        vbox(self._what, (self.map, 1), self._legend, of=self, margins=0, spacing=2)
        self.map.show_message("No depth yet.")

    @property
    def what(self) -> str:
        """The shown quantity."""
        return str(self._what.currentData())

    def show_message(self, text: str) -> None:
        """Show a text instead of the image and the legend."""
        self.map.show_message(text)
        self._legend.clear()

    def _choose(self) -> None:
        # The image, colours and legend of another quantity would be misread.
        if self.map.has_image:
            self.show_message("Please wait.")
        self._on_chosen()


class QualityPanel(SelectableMap):
    """Shows flags, how well the depth explains the image, or the uncertainty of a frozen image."""

    def __init__(self, on_chosen: Slot) -> None:
        quantities = {
            "flags": "Flags",
            "misfit": "Misfit of the image",
            "uncertainty": "Uncertainty (when frozen)",
        }
        super().__init__("inspect.quality", "Quality", quantities, on_chosen)
        self._count = 0

    def show_frame(self, result: FrameResult, *, still: bool) -> None:
        """Show the quality of a frame."""
        if result.heightmap is None:
            return
        if self.what == "misfit" and result.misfit is None:
            return  # the frame is older than the selection
        if result.quality is None:
            sentence = "Freeze the image to see the uncertainty."
            if still and result.without_uncertainty:
                sentence = "This model gives no uncertainty. Calibrate with the full model."
            elif still:
                sentence = "Computing the uncertainty of this image…"
            self.show_message(sentence)
            return
        self.map.set_image(result.quality, extent_of(result.heightmap))
        if self.what == "uncertainty":
            self.map.show_colours("inferno", 0.0, 1e3 * result.quality_top, "um")
            self._legend.setText(
                "Standard deviation over repeated images; 1 % of the area is above the range."
            )
            return
        if result.misfit is not None:
            self.map.show_colours("inferno", 0.0, 100.0 * result.quality_top, "%")
        self._count += 1
        if still or self._count % TELL_EVERY == 1 or not self._legend.text():
            misfit = result.misfit
            text = legend(result.heightmap.flags) if misfit is None else misfit_text(misfit)
            self._legend.setText(text)


def misfit_text(misfit: np.ndarray) -> str:
    """Return the definition of the misfit with the median over all nodes, as markup."""
    values = misfit[np.isfinite(misfit)]
    percent = 100.0 * float(np.median(values)) if values.size else 0.0
    return escaped(
        "Measured brightness minus the brightness computed from the depth, relative "
        f"to the flat membrane. Median {percent:.1f} %."
    )


def legend(flags: np.ndarray) -> str:
    """Return the flags that are set, in their colours, with their share of the area, as markup."""
    subset = flags[::3, ::3]
    inside = subset[subset & Flag.OUTSIDE.value == 0]
    parts = []
    for flag, colour in FLAG_COLOURS.items():
        fraction = float(np.mean(inside & flag.value != 0)) if inside.size else 0.0
        if fraction > 0.0:
            block = f'<span style="color: rgb{colour}">■</span>'
            share = "&lt;0.1" if fraction < 0.0005 else f"{100.0 * fraction:.1f}"
            words = f" {FLAG_WORDS[flag]} {share} %".replace(" ", "&nbsp;")
            parts.append(block + words)
    return "&nbsp;&nbsp; ".join(parts) or "No pixel is flagged."


class NormalsPanel(SelectableMap):
    """Shows the normals as colours, or the slope."""

    def __init__(self, on_chosen: Slot) -> None:
        quantities = {"normals": "Normals: x in red, y in green", "slope": "Slope"}
        super().__init__("inspect.normals", "Normals", quantities, on_chosen)
        self._legend.hide()

    def show_frame(self, result: FrameResult, *, still: bool) -> None:
        """Show a frame."""
        if result.normals is not None and result.heightmap is not None:
            self.map.set_image(result.normals, extent_of(result.heightmap))
            if self.what == "slope":
                self.map.show_colours("magma", 0.0, STEEPEST_DEG, "°")


class InspectViews(QWidget):
    """Holds the views and reports what they need.

    Parameters
    ----------
    jobs : JobQueue
        Load the 3D view.
    top, below : tuple
        Parts of the inspector: above the display settings, and at its lower end.
    on_wanted, on_pointed : callable
        Called when a view was shown or hidden or needs other content, and when the pointer moved.
    on_hold, on_save : callable
        Called to hold the height map as the reference, and to save the profile.
    context : AppContext
        Shared by all pages.
    """

    def __init__(
        self,
        jobs: JobQueue,
        top: tuple[Any, ...],
        below: tuple[Any, ...],
        *,
        on_wanted: Slot,
        on_pointed: Slot,
        on_hold: Slot,
        on_save: Slot,
        context: AppContext,
    ) -> None:
        super().__init__()
        set_names(self, "inspect.views", "Views")
        self._context, self._on_wanted = context, on_wanted
        self._has_depth = False
        self.marks = SectionMarks(self._on_marks)
        self.map_panel = HeightPanel(self.marks, adjustable=True)
        self.normals, self.quality = NormalsPanel(on_wanted), QualityPanel(on_wanted)
        self.section = SectionPanel(on_changed=self._on_marks, on_save=on_save)
        self.display = DisplayPanel(context.display)
        self.processing = ProcessingPanel(on_changed=self._on_marks, on_hold=on_hold)
        self.bench_area = BenchArea(context.source)
        self.bench = CollapsibleSection("inspect.bench", "Virtual bench", self.bench_area)
        self._inspector = QWidget()
        self.stage = FrameViewer(
            "inspect",
            jobs,
            self.map_panel,
            self.section,
            on_arranged=self._on_marks,
            on_pointed=on_pointed,
            context=context,
            more={"normals": self.normals, "quality": self.quality},
            beside=self._inspector,
        )
        self.surface = self.stage.surface
        processing = CollapsibleSection("inspect.processing.fold", "Processing", self.processing)
        self._first_steps = FirstSteps(context=context)
        parts = self._first_steps, *top, self.bench, self.display, self.surface.tools, processing
        panel = set_names(side_panel(parts, below), "inspect.inspector", "Inspector")
        hbox(panel, of=self._inspector, margins=0)
        hbox((self.stage, 1), self._inspector, of=self, margins=0, spacing=0)
        self.stage.camera.clicked.connect(self._on_image_clicked)
        self.map_panel.map.bar.range_dragged.connect(self.display.lock_range)
        self.map_panel.map.bar_double_clicked.connect(self.display.unlock_range)
        text, lock = "Lock the colour range", self.display.toggle_lock
        make_action(self, "inspect.lock", text, lock, keys=("K",))
        context.display.changed.connect(on_wanted)

    # Called by the page

    def frame_request(self) -> FrameRequest:
        """Return what to compute from the frames: only what is shown."""
        is_shown = self.stage.shows
        return FrameRequest(
            surface=is_shown("surface"),
            height=is_shown("height"),
            normals=self.normals.what if is_shown("normals") else "",
            camera=is_shown("camera"),
            quality=self.quality.what if is_shown("quality") else "",
            section=self._section() if is_shown("section") else None,
            region=self.marks.rectangle if self._measures_region() else None,
            display=self._context.display.value,
            reference=self.processing.reference,
            processing=self.processing.processing(self.marks.rectangle, self.marks.points_mm),
        )

    def _section(self) -> SectionSettings:
        section: SectionSettings = self.section.form.value
        return replace(section, start_mm=self.marks.start_mm, end_mm=self.marks.end_mm)

    def _measures_region(self) -> bool:
        return self.stage.shows("section") and bool(self.section.form.value.region)

    def show_frame(self, result: FrameResult, *, still: bool) -> None:
        """Show a frame in every visible view."""
        if result.heightmap is not None:
            self.processing.show_still(still)
            if not self._has_depth:
                self._has_depth = True
                self.marks.spread(result.heightmap)
                self._on_marks()
            self.display.show_range(*result.range_mm)
        self.stage.show_frame(result, still=still)
        if result.cut is not None:
            self.section.show_cut(result.cut)
        if result.fault is not None and self._has_depth:
            self.forget(result.fault.line)

    def forget(self, text: str = "No depth yet.") -> None:
        """Show a text instead of the depth: the calibration or source changed, or there is none."""
        self._has_depth = False
        self._on_marks()
        self.stage.show_message(text)
        self.section.show_cut(SectionResult())

    def compare_with(self, reference: ReferenceMap | None) -> None:
        """Show the difference from this height map in 3D from now on. None: no difference."""
        self.processing.show_reference(reference)
        self._context.display.change(colour_by="depth" if reference is None else "difference")
        self._on_wanted()

    def follow_source(self) -> None:
        """Offer the bench if the virtual sensor is the camera."""
        is_virtual = self.bench_area.follow()
        self.bench.setVisible(is_virtual)
        self._first_steps.offer(is_virtual)
        if self._context.source.info is None:
            self.stage.camera.show_rgb(None)
        else:
            self.stage.camera.show_message("Waiting for the first image of the camera.")

    # Layout

    def restore(self) -> None:
        """Restore the saved layout."""
        settings = self._context.settings
        self.stage.arrange(from_settings_text(ViewLayout, settings.display("inspect_layout")))
        self.follow_source()

    def keep(self) -> None:
        """Save the layout."""
        settings = self._context.settings
        settings.keep_display("inspect_layout", to_settings_text(self.stage.arranged))

    # Slots

    def _on_marks(self) -> None:
        """Draw the line, the rectangle and the points, and measure there."""
        level = self.processing.form.value.level
        tools, grips = self.marks.drawn(
            line=self._has_depth and self.stage.shows("section"),
            rectangle=self._has_depth and (self._measures_region() or level == "rectangle"),
            points=self._has_depth and level == "points",
            width_mm=self.section.form.value.width_mm,
        )
        self.stage.show_tools(tools, grips)
        self._on_wanted()

    def _on_image_clicked(self, u: float, v: float) -> None:
        if (bench := self._context.source.virtual) is not None:
            bench.drag_to(u, v)
