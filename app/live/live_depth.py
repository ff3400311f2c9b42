"""The depth of the live images: calibration, reconstructors, health, and the state for advice."""

from __future__ import annotations

import time
from collections import deque

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QWidget

from app.program.context import AppContext
from app.program.jobs import JobQueue
from app.sources.latest import Done
from app.sources.source import SourceFrame
from app.views.map.colour_range import ColourRange
from gelpolight_core.base.compared_quantity import value_text
from gelpolight_core.base.finding import Finding
from gelpolight_core.health.health_monitor import HealthMonitor
from gelpolight_core.reconstruction.reconstructor import Reconstructor

from .calibration_choice import CalibrationChoice, ZeroControl, use_virtual_calibration
from .frame_processor import FrameProcessor, FrameRequest, FrameResult, camera_image
from .live_session import LiveSession
from .next_step_advice import CalibrationTarget, LiveState, Size


class LiveDepth(QObject):
    """Turns the images of a session into depth, as long as the calibration in use fits them.

    Parameters
    ----------
    live : LiveSession
        The images, and the owner of this object.
    jobs : JobQueue
        Runs slow work.
    owner : QWidget
        The page.
    context : AppContext
        Shared by all pages.

    Attributes
    ----------
    live : LiveSession
        The images.
    calibrations : CalibrationChoice
        The library, and the calibration in use.
    zero : ZeroControl
        Sets zero with the next images.
    last : FrameResult or None
        The newest result.

    Signals
    -------
    shown(object)
        Shown: the result of the newest frame. Without depth if it cannot be reconstructed.
    calibration_loaded(object, object)
        The calibration in use is another, or is read: its reconstructors for live and for frozen
        images, or None. Depth is computed once :meth:`choose` is called.
    calibration_switched()
        Live depth comes from another calibration from now on, or from none.
    changed()
        The state, on which the advice is based, may have changed.
    """

    shown = Signal(object)
    calibration_loaded = Signal(object, object)
    calibration_switched = Signal()
    changed = Signal()

    def __init__(
        self, live: LiveSession, jobs: JobQueue, owner: QWidget, *, context: AppContext
    ) -> None:
        super().__init__(live)
        self.live, self._jobs, self._context = live, jobs, context
        self.calibrations = CalibrationChoice(jobs, owner, self.load, context=context)
        self.zero = ZeroControl(live, jobs, context=context)
        self.last: FrameResult | None = None
        self._maker = FrameProcessor(None)
        self._chosen: tuple[Reconstructor | None, Reconstructor | None] = None, None
        self._size: Size | None = None
        self._lost = self._failure = ""
        self._watch = HealthMonitor()
        self._fault: Finding | None = None
        self._shown_s: deque[float] = deque()
        live.process(self._maker)
        live.processed.connect(self._on_processed)
        live.source_changed.connect(self._on_source)
        live.switched.connect(self._on_switched)
        live.lost.connect(self._on_lost)
        jobs.progressed.connect(self._on_progress)

    # Called by the page

    def enter(self) -> None:
        """Show the source through the calibration in use."""
        self.calibrations.refresh()
        self.calibrations.set_camera_reference(self._chosen[0])
        self.live.enter(True)

    def finish(self) -> None:
        """Release the source and the reconstructors, whose threads end with them."""
        self.live.finish()
        self._chosen = None, None
        self._use(None, None)

    def request_results(self, request: FrameRequest) -> None:
        """Change what is computed from the frames. A frozen image is processed again."""
        if request != self._maker.wanted:
            self._maker.wanted = request
            self._process_again()

    def choose(self, live: Reconstructor | None, best: Reconstructor | None) -> None:
        """Use these reconstructors for live and for frozen images, if they fit the images."""
        self._chosen = live, best
        if self.live.page_shown:
            self.calibrations.set_camera_reference(live)
        self.update()

    def act(self, name: str) -> None:
        """Do what an advice proposes. Names that only the page knows have no effect."""
        match name:
            case "zero":
                self.zero.set_zero()
            case "virtual":
                self._context.source.choose_virtual_sensor()
            case "calibrate":
                use_virtual_calibration(self._jobs, context=self._context)
            case "sensors":
                self._context.requests.page.emit("sensors")
            case "fitting":
                self.calibrations.use_matching_calibration(self.live.serial, self._size)
            case "same_camera" if (info := self._context.source.info) is not None:
                self._context.cameras.accept_same(self._camera_used, info.detail)
                self.update()
            case "image_size" if (used := self.state.used) is not None:
                self._context.cameras.choose_size(self._context.source.info, used.size)
            case "reopen":
                self.live.open()

    # State

    @property
    def reconstructor(self) -> Reconstructor | None:
        """The reconstructor in use for frozen images, at full accuracy."""
        return self._maker.best

    @property
    def live_reconstructor(self) -> Reconstructor | None:
        """The reconstructor in use for live images."""
        return self._maker.live

    @property
    def _colour_range(self) -> ColourRange:
        """The automatic range of the source's colours, which all pages continue."""
        colours: ColourRange = self._context.source.kept.setdefault("colours", ColourRange())
        return colours

    @property
    def _camera_used(self) -> str:
        """Identity of the camera of the calibration in use. Empty if unknown."""
        live = self._chosen[0]
        texts = {} if live is None else live.calibration.provenance.camera_settings
        return texts.get("identity", "")

    @property
    def state(self) -> LiveState:
        """State of the images and the calibrations, on which the advice is based."""
        info, live, used = self._context.source.info, self._chosen[0], None
        if live is not None:
            camera = live.calibration.camera
            used = CalibrationTarget(live.calibration.serial, (camera.width, camera.height))
        other_camera, camera_used = "", self._camera_used
        if info is not None and self._context.cameras.is_other(camera_used, info):
            other_camera = (
                "The calibration in use was made with the camera "
                f"{camera_used}, but the images come from "
                f"{info.detail}. Connect the first camera, or use another calibration."
            )
        return LiveState(
            kind="" if info is None else info.kind,
            serial=self.live.serial,
            size=self._size,
            offered=self._context.cameras.sizes(info),
            used=used,
            other_camera=other_camera,
            calibrations=tuple(target for _entry, target in self.calibrations.candidates()),
            trouble=self._lost or self._failure,
            fault=self._fault,
            reading=self.calibrations.is_reading,
        )

    def update(self) -> None:
        """Use the calibration only if it fits the images, and announce the state."""
        live, best = self._chosen if self.state.usable else (None, None)
        if live is not self._maker.live:
            self._use(live, best)
        self.changed.emit()

    def rate_text(self) -> str:
        """Return the frame rate and times as text."""
        if self.last is None or self.last.heightmap is None:
            return ""
        times, heightmap = self._shown_s, self.last.heightmap
        hz = (len(times) - 1) / (times[-1] - times[0]) if len(times) > 1 else 0.0
        texts = [f"{hz:.0f} shown/s, {self.last.total_ms:.0f} ms"]
        if heightmap.visible_depth_mm is not None:
            texts.append(f"visible depth {value_text(heightmap.visible_depth_mm)}")
        return ", ".join(texts)

    def trace_text(self) -> str:
        """Return the computed steps of the shown frame."""
        heightmap = None if self.last is None else self.last.heightmap
        trace = None if heightmap is None else heightmap.trace
        return "" if trace is None else "\n".join(step.sentence for step in trace.steps)

    # The images

    def _on_source(self) -> None:
        self._size = None

    def _on_switched(self) -> None:
        self.last, self._failure = None, ""
        self._shown_s.clear()
        self._restart_health()
        self._maker.colour_range = self._colour_range
        self.update()

    def _on_lost(self, why: str) -> None:
        self._set_trouble(why, self._failure)

    def _on_progress(self, title: str, _share: float) -> None:
        if not title:  # the end of a job may mean that it failed
            self.update()

    def _on_processed(self, done: Done[SourceFrame, FrameResult]) -> None:
        frame = done.request
        if done.result is None:
            result = FrameResult(frame, camera=camera_image(frame, self._maker.wanted))
        else:
            self.last = result = done.result
            self._shown_s.append(now_s := time.monotonic())
            while now_s - self._shown_s[0] > 2.0:
                self._shown_s.popleft()
        self._set_trouble(self._lost, done.failure)
        size = frame.rgb.shape[1], frame.rgb.shape[0]
        if size != self._size:
            self._size = size
            self.update()
        self._follow_health(result)
        self.shown.emit(result)

    def _process_again(self) -> None:
        if self.last is not None:
            self.live.process_again(self.last.frame)

    def _set_trouble(self, lost: str, failure: str) -> None:
        before, now = self._lost or self._failure, lost or failure
        self._lost, self._failure = lost, failure
        if before == now:
            return
        if not now:
            self._restart_health()  # a camera that was reconnected may have moved
        self.update()

    # The health of the sensor

    def _restart_health(self) -> None:
        """Forget everything: the camera, the calibration or a setting is another."""
        self._watch = HealthMonitor()
        self._set_fault(None)

    def _follow_health(self, result: FrameResult) -> None:
        if result.health is None or not result.frame.settled:
            return
        findings = self._watch.update(result.health, result.frame.time_s).findings
        self._set_fault(findings[0] if findings else None)

    def _set_fault(self, fault: Finding | None) -> None:
        before, self._fault = self._fault, fault
        # The figure of a fault that lasts changes with every frame; the advice need not.
        if (before and before.key) != (fault and fault.key):
            self.update()

    # The calibration

    def load(self, live: Reconstructor | None, best: Reconstructor | None) -> None:
        """Take the reconstructors of another calibration in use. None: there is none yet."""
        self._chosen = None, None
        self._restart_health()
        self._use(None, None)
        self.calibration_loaded.emit(live, best)

    def _use(self, live: Reconstructor | None, best: Reconstructor | None) -> None:
        """Use these reconstructors from now on, and drop results in progress."""
        before, request = self._maker.live, self._maker.wanted
        self._maker = FrameProcessor(live, best)
        self._maker.wanted, self._maker.colour_range = request, self._colour_range
        self.live.process(self._maker)
        if self.last is not None:
            self.last = FrameResult(
                self.last.frame
            )  # its depth comes from the previous calibration
        self._process_again()
        if (before and before.calibration) is not (live and live.calibration):
            self.calibration_switched.emit()
