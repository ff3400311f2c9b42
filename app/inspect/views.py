"""All views of the page as docks that can be moved, tabbed and hidden. The layout is saved."""

from __future__ import annotations

from dataclasses import replace

from PySide6.QtCore import QByteArray, Qt, Signal
from PySide6.QtWidgets import (
    QDockWidget,
    QMainWindow,
    QMenu,
    QToolBar,
    QToolButton,
    QWidget,
)

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
from app.view2d.display import QUANTITIES, Display, display_as_text, display_from_text
from app.view2d.map_view import MapView, extent_of
from app.view2d.profile_plot import line_colour
from app.view2d.quantities import Reference
from app.view3d.panel import SurfacePanel, view_names
from app.view3d.surface import SurfaceLine
from app.widgets.actions import make_action
from app.widgets.naming import named
from gelpolight_core.translation import tr

# Raised when views are added, so that an old layout is not applied to them.
LAYOUT_VERSION = 3
AREAS = Qt.DockWidgetArea


class Views(QMainWindow):
    """Holds the views and reports what they need.

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

    def __init__(self, jobs: Jobs, *, context: AppContext) -> None:
        super().__init__()
        named(self, "inspect.views", tr("Views"))
        self.setWindowFlags(Qt.WindowType.Widget)
        self.setDockNestingEnabled(True)
        self._context = context
        self.surface = SurfacePanel(
            jobs,
            settings=context.settings,
            flat=lambda: MapView("inspect.surface.flat", tr("Shaded map")),
        )
        self.reference: Reference | None = None
        self.height = HeightPanel(adjustable=True)
        self.normals = NormalsPanel()
        self.quality = QualityPanel()
        self.camera = ImageView()
        self.section = SectionPanel()
        self.lines, self.region = SectionLines(self.height.map), RegionBox(self.height.map)
        self.display = DisplayPanel()
        self.processing = ProcessingPanel()
        self.level_points = LevelPoints(self.height.map)
        self._bench = BenchArea(context.source)
        self.docks: dict[str, QDockWidget] = {}
        self._visible: dict[str, bool] = {}
        self._has_depth = False
        self.bar = self._make_bar()
        self._make_docks()
        self._connect()

    def _make_bar(self) -> QToolBar:
        bar = named(QToolBar(tr("Inspect"), movable=False), "inspect.bar", tr("Inspect"))
        bar.setContextMenuPolicy(Qt.ContextMenuPolicy.PreventContextMenu)
        self._menu = QMenu(self)
        button = named(QToolButton(), "inspect.views.menu", tr("Views"), tr("Show or hide a view"))
        button.setText(tr("Views"))
        button.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        button.setMenu(self._menu)
        bar.addSeparator()
        bar.addWidget(button)
        self.addToolBar(bar)
        return bar

    def add_to_bar(self, widget: QWidget) -> None:
        """Add a control next to the camera button."""
        self.bar.insertWidget(self.bar.actions()[-1], widget)

    def _make_docks(self) -> None:
        table = (
            ("surface", tr("3D"), self.surface, "Alt+1"),
            ("height", tr("Height map"), self.height, "Alt+2"),
            ("camera", tr("Camera"), self.camera, "Alt+3"),
            ("normals", tr("Normals"), self.normals, "Alt+4"),
            ("quality", tr("Quality"), self.quality, "Alt+5"),
            ("section", tr("Cross-section"), self.section, "Alt+6"),
            ("look", tr("Display"), self.display, "Alt+7"),
            ("bench", tr("Virtual bench"), self._bench, "Alt+8"),
            ("processing", tr("Processing"), self.processing, "Alt+9"),
        )
        for name, title, widget, keys in table:
            dock = named(QDockWidget(title, self), f"inspect.dock.{name}", title)
            dock.setWidget(widget)
            self.docks[name] = dock
            self._visible[name] = False
            dock.visibilityChanged.connect(lambda on, name=name: self._on_visible(name, on))
            action = dock.toggleViewAction()
            action.setObjectName(f"inspect.show_{name}")
            action.setShortcut(keys)
            self.addAction(action)
            self._menu.addAction(action)
        self._menu.addSeparator()
        self._menu.addAction(
            make_action(self, "inspect.layout", tr("Reset the layout"), self.arrange)
        )

    def arrange(self) -> None:
        """Restore the default layout."""
        docks = self.docks
        for dock in docks.values():
            self.removeDockWidget(dock)
        left = AREAS.LeftDockWidgetArea
        self.addDockWidget(left, docks["surface"])
        self.splitDockWidget(docks["surface"], docks["height"], Qt.Orientation.Horizontal)
        self.splitDockWidget(docks["height"], docks["look"], Qt.Orientation.Horizontal)
        self.splitDockWidget(docks["height"], docks["camera"], Qt.Orientation.Vertical)
        self.tabifyDockWidget(docks["camera"], docks["normals"])
        self.tabifyDockWidget(docks["normals"], docks["quality"])
        self.splitDockWidget(docks["surface"], docks["section"], Qt.Orientation.Vertical)
        self.splitDockWidget(docks["look"], docks["bench"], Qt.Orientation.Vertical)
        self.tabifyDockWidget(docks["look"], docks["processing"])
        for dock in docks.values():
            dock.show()
        docks["camera"].raise_()
        docks["look"].raise_()
        self.resizeDocks(
            [docks["surface"], docks["height"], docks["look"]],
            [660, 340, 240],
            Qt.Orientation.Horizontal,
        )
        self.resizeDocks([docks["surface"], docks["section"]], [460, 200], Qt.Orientation.Vertical)
        self.resizeDocks([docks["look"], docks["bench"]], [240, 600], Qt.Orientation.Vertical)
        self.follow_source()

    def _connect(self) -> None:
        for view in (self.height.map, self.normals.map, self.quality.map, self.surface):
            view.pointed.connect(self.pointed)
        self.camera.pointed.connect(self.image_pointed)
        self.camera.clicked.connect(self._on_image_clicked)
        self.display.changed.connect(self._on_display)
        self.surface.menu.colour_chosen.connect(self.display.colour_by)
        self.height.range_dragged.connect(self.display.lock_range)
        self.height.range_released.connect(self.display.unlock_range)
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
        for name, (text, keys) in view_names().items():
            make_action(
                self, f"inspect.view_{name}", tr("3D: {name}").format(name=text),
                lambda name=name: self.surface.view_from(name), keys=(keys,),
            )  # fmt: skip
        make_action(
            self, "inspect.lock", tr("Lock the colour range"), self.display.toggle_lock,
            keys=("K",),
        )  # fmt: skip

    # Called by the page

    def wanted(self) -> Wanted:
        """Return what to compute from the frames: only what is shown."""
        shown = self._visible
        return Wanted(
            surface=shown["surface"],
            height=shown["height"],
            normals=self.normals.what if shown["normals"] else "",
            camera=shown["camera"],
            quality=self.quality.what if shown["quality"] else "",
            section=self._section() if shown["section"] else None,
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
        return self._visible["section"] and self.section.form.value.region

    def show_frame(self, shown: Shown, *, still: bool) -> None:
        """Show a frame in every visible view."""
        if shown.camera is not None:
            rows, columns = shown.frame.rgb.shape[:2]
            self.camera.show_rgb(shown.camera, size=(columns, rows))
        if shown.heightmap is None:
            return
        self._name_processed(bool(shown.processed))
        self.processing.show_still(still)
        if not self._has_depth:
            self._has_depth = True
            self.level_points.spread(extent_of(shown.heightmap))
            self._on_section()
        if shown.surface is not None:
            self.surface.show_surface(shown.surface)
        self.height.show_frame(shown, self.display.display.colours, still=still)
        self.display.show_range(*shown.range_mm)
        self.normals.show_frame(shown)
        if self._visible["quality"]:
            self.quality.show_frame(shown, still=still)
        if shown.cut is not None:
            self.section.show_cut(shown.cut)

    def _name_processed(self, processed: bool) -> None:
        """Say in the titles of the views that the height map is processed."""
        titles = {"surface": tr("3D"), "height": tr("Height map"), "section": tr("Cross-section")}
        for name, title in titles.items():
            text = tr("{view} (processed)").format(view=title) if processed else title
            if self.docks[name].windowTitle() != text:
                self.docks[name].setWindowTitle(text)

    def prepare(self) -> None:
        """Load what the visible views need, before the first depth arrives."""
        if self._visible["surface"]:
            self.surface.load()

    def forget(self) -> None:
        """Clear the depth: the calibration or source changed, or there is none."""
        words = tr("No depth yet.")
        self._name_processed(False)
        self._has_depth = False
        self._on_section()
        self.surface.show_surface(None)
        for view in (self.height.map, self.normals.map, self.quality):
            view.say(words)
        self.section.show_cut(Cut())

    def show_cursor(self, x_mm: float, y_mm: float) -> None:
        """Mark a position in every view of the depth."""
        for view in (self.height.map, self.normals.map, self.quality.map, self.surface):
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
        """Show the bench next to the views if the virtual sensor is the camera."""
        virtual, dock = self._bench.follow(), self.docks["bench"]
        dock.toggleViewAction().setVisible(virtual)
        dock.setVisible(virtual)
        if self._context.source.info is None:
            self.camera.show_rgb(None)
            self.camera.say(tr("No camera. Select a source."))
        else:
            self.camera.say(tr("Waiting for the first image of the camera."))

    # Layout

    def restore(self) -> None:
        """Restore the saved layout and display settings."""
        self.display.show_display(display_from_text(self._context.settings.display("look")))
        self._on_display()
        if not self.restoreState(self._context.settings.layout("inspect"), LAYOUT_VERSION):
            self.arrange()
        self.follow_source()

    def keep(self) -> None:
        """Save the layout and display settings."""
        state: QByteArray = self.saveState(LAYOUT_VERSION)
        self._context.settings.keep_layout("inspect", state)
        self._context.settings.keep_display("look", display_as_text(self.display.display))

    def finish(self) -> None:
        """Release the resources of the views."""
        self.surface.finish()

    # Slots

    def _on_visible(self, name: str, on: bool) -> None:
        self._visible[name] = on
        maps = {"height": self.height, "normals": self.normals, "quality": self.quality}
        if on and self._has_depth and name in maps and not maps[name].map.has_image:
            maps[name].map.say(tr("Please wait."))
        if name == "section":
            self._on_section()
        else:
            self.wanted_changed.emit()

    def _on_section(self) -> None:
        self.lines.show(self._visible["section"] and self._has_depth)
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
        if self._visible["section"]:
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
        self.surface.menu.set_colours(QUANTITIES, display.colour_by)
        self.wanted_changed.emit()

    def _on_image_clicked(self, u: float, v: float) -> None:
        source = self._context.source
        if source.info is not None and source.info.kind == "virtual" and source.bench is not None:
            source.bench.drag_to(u, v)
