"""All views of the page around one stage, the section below it, and the inspector beside it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QToolButton, QWidget

from app.bench.bench_area import BenchArea
from app.context.context import AppContext
from app.inspect.processing_panel import DisplayPanel, ProcessingPanel
from app.inspect.quality_panel import NormalsPanel, QualityPanel
from app.inspect.section_line import REGION_INK, LevelPoints, RegionBox, SectionLines
from app.inspect.section_panel import SectionPanel
from app.live.frame_results import Shown, Wanted
from app.live.height_panel import HeightPanel
from app.live.image_view import ImageView
from app.live.overlay import Marker, Overlay
from app.services.jobs import Jobs
from app.view2d.cuts import Cut, Section
from app.view2d.display import Display
from app.view2d.map_view import MapView, extent_of
from app.view2d.profile_plot import line_colour
from app.view2d.quantities import Reference
from app.view3d.menu import DIRECTIONS
from app.view3d.panel import SurfacePanel
from app.view3d.surface import SurfaceLine
from app.widgets.actions import make_action, switch_button
from app.widgets.fields import as_text, choice, from_text, switch
from app.widgets.fold import Fold
from app.widgets.layout import hbox, side_panel, splitter, vbox
from app.widgets.naming import named
from gelpolight_core.translation import tr

STAGES = {
    "surface": (tr("3D"), ("surface",)),
    "height": (tr("Map"), ("height",)),
    "camera": (tr("Camera"), ("camera",)),
    "normals": (tr("Normals"), ("normals",)),
    "quality": (tr("Quality"), ("quality",)),
    "two": (tr("3D + map"), ("surface", "height")),
    "four": (tr("All"), ("surface", "height", "camera", "quality")),
}
"""What fills the stage: the text of the button, and the views. Alt and the number chooses it."""
SECTION_PX = 230


@dataclass(frozen=True, slots=True)
class Layout:
    """What is visible: one of STAGES, the section, and whether the stage has all of the page."""

    stage: str = choice("surface", "", {key: text for key, (text, _) in STAGES.items()})
    section: bool = switch(True, "", "")
    maximised: bool = False

    @property
    def views(self) -> frozenset[str]:
        """Keys of the visible views."""
        below = {"section"} if self.section and not self.maximised else set()
        return frozenset(STAGES[self.stage][1]) | below


class Views(QWidget):
    """Holds the views and reports what they need.

    Parameters
    ----------
    jobs : Jobs
        Load the 3D view.
    top, below : tuple
        Parts of the inspector: above the display settings, and at its lower end.
    context : AppContext
        Shared by all pages.

    Signals
    -------
    wanted_changed()
        A view was shown or hidden, or needs other content.
    pointed(float, float)
        Position (x, y) under the pointer in one of the views, mm. NaN for none.
    image_pointed(float, float)
        Pixel (u, v) under the pointer in the camera image. NaN for none.
    """

    wanted_changed = Signal()
    pointed = Signal(float, float)
    image_pointed = Signal(float, float)

    def __init__(
        self, jobs: Jobs, top: tuple[Any, ...], below: tuple[Any, ...], *, context: AppContext
    ) -> None:
        super().__init__()
        named(self, "inspect.views", tr("Views"))
        self._context = context
        self.surface = SurfacePanel(
            jobs,
            settings=context.settings,
            flat=lambda: MapView("inspect.surface.flat", tr("Shaded map")),
        )
        self.reference: Reference | None = None
        self.map_panel = HeightPanel(adjustable=True)
        self.normals = NormalsPanel()
        self.quality = QualityPanel()
        self.camera = ImageView()
        self.section = SectionPanel()
        self.lines, self.region = SectionLines(self.map_panel.map), RegionBox(self.map_panel.map)
        self.display = DisplayPanel()
        self.processing = ProcessingPanel()
        self.level_points = LevelPoints(self.map_panel.map)
        self._bench = BenchArea(context.source)
        self.bench = Fold("inspect.bench", tr("Virtual bench"), self._bench)
        self.layout_shown = Layout()
        self._has_depth = False
        self._lay_out(top, below)
        self._connect()

    def _lay_out(self, top: tuple[Any, ...], below: tuple[Any, ...]) -> None:
        upper: Mapping[str, QWidget] = {"surface": self.surface, "height": self.map_panel}
        lower: Mapping[str, QWidget] = {
            "camera": self.camera,
            "normals": self.normals,
            "quality": self.quality,
        }
        self._rows = {
            splitter(
                Qt.Orientation.Horizontal, *((part, 1) for part in row.values()),
                sizes=(600, 400, 400),
            ): row
            for row in (upper, lower)
        }  # fmt: skip
        self._stage = splitter(
            Qt.Orientation.Vertical, *((row, 3) for row in self._rows), (self.section, 2)
        )
        self._stage.setSizes([3 * SECTION_PX, 2 * SECTION_PX, SECTION_PX])
        processing = Fold("inspect.processing.fold", tr("Processing"), self.processing)
        parts = (*top, self.display, self.surface.tools, processing, self.bench)
        self.inspector = named(side_panel(parts, below), "inspect.inspector", tr("Inspector"))
        column = vbox(self._make_switch(), (self._stage, 1), margins=0, spacing=0)
        row = hbox(of=self, margins=0, spacing=0)
        row.addLayout(column, 1)
        row.addWidget(self.inspector)

    def _make_switch(self) -> QWidget:
        """Return the row of buttons that choose what fills the stage."""
        self._switches: dict[str, QAction] = {}
        bar = named(QWidget(), "inspect.switch", tr("Views"))
        row = hbox(of=bar, margins=(12, 6, 12, 6), spacing=4)
        for number, (key, (text, _views)) in enumerate(STAGES.items(), start=1):
            row.addWidget(self._button(key, text, f"Alt+{number}"))
        row.addStretch(1)
        row.addWidget(self._button("section", tr("Section"), "Alt+0"))
        row.addWidget(self._button("maximised", tr("Maximise"), "F", "maximise"))
        self.surface.setFocusPolicy(Qt.FocusPolicy.ClickFocus)
        return bar

    def _button(self, key: str, text: str, keys: str, icon_name: str = "") -> QToolButton:
        name, choose = f"inspect.show_{key}", partial(self._choose, key)
        button = switch_button(self, name, text, choose, keys, icon_name=icon_name)
        self._switches[key] = button.defaultAction()
        return button

    def _choose(self, key: str) -> None:
        now = self.layout_shown
        if key == "section":
            self.arrange(replace(now, section=not now.section))
        elif key == "maximised":
            self.arrange(replace(now, maximised=not now.maximised))
        else:
            self.arrange(replace(now, stage=key))

    def arrange(self, layout: Layout) -> None:
        """Show these views."""
        before, self.layout_shown = self.layout_shown.views, layout
        on = {layout.stage: True, "section": layout.section, "maximised": layout.maximised}
        for key, action in self._switches.items():
            action.setChecked(on.get(key, False))
        for row, keys in self._rows.items():
            row.setVisible(bool(layout.views & set(keys)))
            for key, part in keys.items():
                part.setVisible(key in layout.views)
        self.section.setVisible("section" in layout.views)
        self.surface.tools.setVisible("surface" in layout.views)
        self.inspector.setVisible(not layout.maximised)
        maps = {
            "height": self.map_panel.map, "normals": self.normals.map, "quality": self.quality.map,
        }  # fmt: skip
        for key in layout.views & maps.keys() - before:
            if self._has_depth and not maps[key].has_image:
                maps[key].say(tr("Please wait."))
        self._on_section()

    def _connect(self) -> None:
        for view in (self.map_panel.map, self.normals.map, self.quality.map, self.surface):
            view.pointed.connect(self.pointed)
        self.camera.pointed.connect(self.image_pointed)
        self.camera.clicked.connect(self._on_image_clicked)
        self.display.changed.connect(self._on_display)
        self.map_panel.range_dragged.connect(self.display.lock_range)
        self.map_panel.range_released.connect(self.display.unlock_range)
        self.quality.chosen.connect(self.wanted_changed)
        self.normals.chosen.connect(self.wanted_changed)
        self.processing.changed.connect(self._on_section)
        self.section.choice.add_wanted.connect(self.lines.add)
        self.section.choice.remove_wanted.connect(self.lines.remove)
        self.section.choice.chosen.connect(self.lines.choose)
        self.lines.changed.connect(self._on_section)
        for part in (self.lines, self.region, self.level_points):
            part.moved.connect(self._lay_lines)
            part.moved.connect(self.wanted_changed)
        self.section.changed.connect(self._on_section)
        for name, (text, keys) in DIRECTIONS.items():
            make_action(
                self, f"inspect.view_{name}", tr("3D: {name}").format(name=text),
                partial(self.surface.view_from, name), keys=(keys,),
            )  # fmt: skip
        make_action(
            self, "inspect.lock", tr("Lock the colour range"), self.display.toggle_lock,
            keys=("K",),
        )  # fmt: skip

    def _shows(self, name: str) -> bool:
        return name in self.layout_shown.views

    # Called by the page

    def wanted(self) -> Wanted:
        """Return what to compute from the frames: only what is shown."""
        shown = self._shows
        return Wanted(
            surface=shown("surface"),
            height=shown("height"),
            normals=self.normals.what if shown("normals") else "",
            camera=shown("camera"),
            quality=self.quality.what if shown("quality") else "",
            section=self._section() if shown("section") else None,
            region=self.region.rectangle if self._measures_region() else None,
            display=self.display.display,
            reference=self.reference,
            processing=self.processing.processing(
                self.region.rectangle, self.level_points.points_mm
            ),
        )

    def _section(self) -> Section:
        first, second = self.section.ranges
        lines, form = self.lines, self.section.form
        return replace(
            form.value, lines=tuple(lines), chosen=lines.chosen, first=first, second=second
        )

    def _measures_region(self) -> bool:
        return self._shows("section") and self.section.form.value.region

    def show_frame(self, shown: Shown, *, still: bool) -> None:
        """Show a frame in every visible view."""
        if shown.camera is not None:
            rows, columns = shown.frame.rgb.shape[:2]
            self.camera.show_rgb(shown.camera, size=(columns, rows))
        if shown.heightmap is None:
            return
        self.processing.show_still(still)
        if not self._has_depth:
            self._has_depth = True
            self.level_points.spread(extent_of(shown.heightmap))
            self._on_section()
        if shown.surface is not None:
            self.surface.show_surface(shown.surface, still=still)
        self.map_panel.show_frame(shown, self.display.display.colours, still=still)
        self.display.show_range(*shown.range_mm)
        self.normals.show_frame(shown)
        if self._shows("quality"):
            self.quality.show_frame(shown, still=still)
        if shown.cut is not None:
            self.section.show_cut(shown.cut)

    def prepare(self) -> None:
        """Load what the visible views need, before the first depth arrives."""
        if self._shows("surface"):
            self.surface.load()

    def forget(self) -> None:
        """Clear the depth: the calibration or source changed, or there is none."""
        words = tr("No depth yet.")
        self._has_depth = False
        self._on_section()
        self.surface.show_surface(None)
        for view in (self.map_panel.map, self.normals.map, self.quality):
            view.say(words)
        self.section.show_cut(Cut())

    def show_cursor(self, x_mm: float, y_mm: float) -> None:
        """Mark a position in every view of the depth."""
        for view in (self.map_panel.map, self.normals.map, self.quality.map, self.surface):
            view.show_cursor(x_mm, y_mm)

    def compare_with(self, reference: Reference | None) -> None:
        """Show the difference from this height map in 3D from now on. None: no difference."""
        self.hold(reference)
        self.display.colour_by("depth" if reference is None else "difference")
        self.wanted_changed.emit()

    def hold(self, reference: Reference | None) -> None:
        """Keep a height map to compare with. None: no height map."""
        self.reference = reference
        self.processing.show_reference(reference)

    def show_pixel(self, pixel: tuple[float, float] | None) -> None:
        """Mark a pixel in the camera image."""
        markers = () if pixel is None else (Marker(*pixel, "cross", "info"),)
        width, height = self.camera.image_size
        self.camera.overlay.set_overlay(Overlay(markers=markers), (max(width, 1), max(height, 1)))

    def follow_source(self) -> None:
        """Offer the bench if the virtual sensor is the camera."""
        self.bench.setVisible(self._bench.follow())
        if self._context.source.info is None:
            self.camera.show_rgb(None)
        else:
            self.camera.say(tr("Waiting for the first image of the camera."))

    # Layout

    def restore(self) -> None:
        """Restore the saved layout and display settings."""
        settings = self._context.settings
        self.display.show_display(from_text(Display, settings.display("look")))
        self._on_display()
        self.arrange(from_text(Layout, settings.display("inspect_layout")))
        self.follow_source()

    def keep(self) -> None:
        """Save the layout and display settings."""
        settings = self._context.settings
        settings.keep_display("inspect_layout", as_text(self.layout_shown))
        settings.keep_display("look", as_text(self.display.display))

    def finish(self) -> None:
        """Release the resources of the views."""
        self.surface.finish()

    # Slots

    def _on_section(self) -> None:
        self.lines.show(self._shows("section") and self._has_depth)
        self.lines.set_width(self.section.form.value.width_mm)
        self.section.choice.show_lines(self.lines)
        region = self._measures_region() or self.processing.form.value.uses_rectangle
        self.region.show(region and self._has_depth)
        self.level_points.show(self.processing.form.value.level == "points" and self._has_depth)
        self._lay_lines()
        self.wanted_changed.emit()

    def _lay_lines(self) -> None:
        """Show the section lines on the surface."""
        lines = []
        if self._shows("section"):
            lines += [
                SurfaceLine((line.start_mm, line.end_mm), line_colour(line.number))
                for line in self.lines
            ]
        if self._measures_region():
            corners = self.region.rectangle.outline_mm
            lines.append(SurfaceLine(tuple((float(x), float(y)) for x, y in corners), REGION_INK))
        self.surface.show_lines(tuple(lines))

    def _on_display(self) -> None:
        display: Display = self.display.display
        self.surface.set_exaggeration(display.exaggeration)
        self.wanted_changed.emit()

    def _on_image_clicked(self, u: float, v: float) -> None:
        source = self._context.source
        if source.info is not None and source.info.kind == "virtual" and source.bench is not None:
            source.bench.drag_to(u, v)
