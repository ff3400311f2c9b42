"""All views of the page: the frame viewer, the section below it, and the inspector beside it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from PySide6.QtWidgets import QWidget

from app.live.frame_processor import FrameRequest, FrameResult
from app.live.frame_viewer import FrameViewer, ViewLayout
from app.live.height_panel import HeightPanel
from app.program.context import AppContext
from app.program.first_steps import FirstSteps
from app.program.jobs import JobQueue
from app.source_ui.bench_panel import BenchArea
from app.views.map.map_view import extent_of
from app.views.map.quantities import ReferenceMap
from app.views.map.sections import SectionResult, SectionSettings
from app.widgets.actions import make_action
from app.widgets.buttons import Slot
from app.widgets.collapsible_section import CollapsibleSection
from app.widgets.layout import hbox, side_panel
from app.widgets.widget_names import set_names
from gelpolight_core.base.form_fields import from_settings_text, to_settings_text

from .processing_panel import DisplayPanel, ProcessingPanel
from .quality_panel import NormalsPanel, QualityPanel
from .section_panel import SectionMarks, SectionPanel


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
                self.marks.spread(extent_of(result.heightmap))
                self._on_marks()
            self.display.show_range(*result.range_mm)
        self.stage.show_frame(result, still=still)
        if result.cut is not None:
            self.section.show_cut(result.cut)

    def forget(self) -> None:
        """Clear the depth: the calibration or source changed, or there is none."""
        self._has_depth = False
        self._on_marks()
        self.stage.show_message("No depth yet.")
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
