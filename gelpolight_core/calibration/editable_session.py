"""A session folder being edited. Each capture, decision and value is written to disk at once.

Everything is on disk before the call returns, so that a crash loses nothing. Two threads may use
it: one that captures and decides, one that reads.
"""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from gelpolight_core.base.arrays import FrameArray, PointXY
from gelpolight_core.base.atomic_write import NameTakenError, make_folder, write_atomically
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.image.image_file import read_image_file
from gelpolight_core.image.linear_image import require_size
from gelpolight_core.session.camera_settings import CameraSettings
from gelpolight_core.session.decisions import FILE_NAME as DECISIONS
from gelpolight_core.session.decisions import (
    Decisions,
    PlacedCircle,
    write_decisions,
)
from gelpolight_core.session.description import write_description
from gelpolight_core.session.file_hashes import FileSnapshots
from gelpolight_core.session.inventory import DESCRIPTION
from gelpolight_core.session.session import Session
from gelpolight_core.session.session_images import average_frames, write_image

from .image_checks import image_size, refuse_unfit
from .recipe import Recipe, Stage
from .recipes import session_to_calibrate

Write = Callable[[Path, Path], None]


@dataclass(frozen=True, slots=True)
class _ReplacedView:
    """Images that a new view has replaced, with the spots set in them."""

    images: frozenset[str] = frozenset()
    spots_px: Mapping[int, PointXY] = field(default_factory=dict)


class EditableSession:
    """One session folder being edited.

    Parameters
    ----------
    folder : Path
        A session folder with ``session.toml``.
    recipe : Recipe
        Its stages, which are named by their keys.

    Raises
    ------
    InputError
        If the folder is not a session, or not one of the recipe.
    """

    def __init__(self, folder: Path, recipe: Recipe) -> None:
        self.recipe = recipe
        self._lock = threading.RLock()
        self._files = FileSnapshots([folder / DESCRIPTION, folder / DECISIONS])
        self._session = self._read(folder)
        self._replaced: dict[str, _ReplacedView] = {}
        self._dropped = 0  # counts removed images that a running computation may have used

    def _read(self, folder: Path) -> Session:
        session = session_to_calibrate(folder)
        if not self.recipe.fits(session):
            raise InputError(
                "The session is now of another kind of sensor", folder, Remedy.OPEN_AGAIN
            )
        return session

    @property
    def session(self) -> Session:
        """The present session."""
        return self._session

    def _refresh(self) -> None:
        """Look for images that were added, changed or removed."""
        inventory = self._session.inventory.refreshed()
        if inventory is not self._session.inventory:
            self._session = replace(self._session, inventory=inventory)

    def add_capture(
        self, key: str, frames: Sequence[FrameArray], *, radius_mm: float | None = None
    ) -> str:
        """Store frames of one view as one image, their average, and return its name.

        In a stage with a single view, a new capture replaces the earlier ones; these are kept but
        excluded.

        Parameters
        ----------
        key : str
            A stage with its own images.
        frames : sequence of (rows, columns, 3) uint8 or uint16
            RGB.
        radius_mm : float, optional
            Radius of the ball, for a press.

        Raises
        ------
        InputError
            If it cannot be written, or its size differs from the session's images.
        """
        with self._lock:
            self._refresh()  # another program may have changed the folder
        size = image_size(self._session, self.recipe.folders(self._session))
        if size is not None:
            require_size((frames[0].shape[1], frames[0].shape[0]), size, where="camera")
        write = partial(_write, average_frames(frames))
        (name,) = self._keep_all(self.recipe[key], [(".png", write)], radius_mm)
        return name

    def import_files(
        self, key: str, files: Sequence[Path], *, radius_mm: float | None = None
    ) -> tuple[str, ...]:
        """Copy image files into a stage and return their new names.

        Parameters
        ----------
        key : str
            A stage with its own images.
        files : sequence of Path
            PNG or TIFF.
        radius_mm : float, optional
            Radius of the ball in them, for presses.

        Raises
        ------
        InputError
            If a file is not an image that fits into the session; then none is added.
        """
        with self._lock:
            self._refresh()  # as for a capture
        stage, folders = self.recipe[key], self.recipe.folders(self._session)
        refuse_unfit(self._session, folders, files, colour=stage.colour)
        images = [(path.suffix.lower(), partial(_copy, path)) for path in files]
        return self._keep_all(stage, images, radius_mm)

    def undo_capture(self, key: str, names: Sequence[str]) -> None:
        """Undo adding images: exclude those that were added together.

        The images that they had replaced are used again. The files themselves stay.

        Parameters
        ----------
        key : str
            Their stage.
        names : sequence of str
            File names.
        """
        with self._lock:
            files, former = self._files_and_replaced(key, names)
            now = self._session.decisions
            excluded = (now.excluded | files) - former.images
            spots = {**now.spots_px, **former.spots_px}
            self.decide(replace(now, excluded=excluded, spots_px=spots))
            self._dropped += 1

    def redo_capture(self, key: str, names: Sequence[str]) -> None:
        """Add images again after :meth:`undo_capture`.

        Parameters
        ----------
        key, names
            As for :meth:`undo_capture`.
        """
        with self._lock:
            files, former = self._files_and_replaced(key, names)
            now = self._session.decisions
            excluded = (now.excluded - files) | former.images
            spots = {led: p for led, p in now.spots_px.items() if led not in former.spots_px}
            self.decide(replace(now, excluded=excluded, spots_px=spots))

    def _files_and_replaced(self, key: str, names: Sequence[str]) -> tuple[set[str], _ReplacedView]:
        files = {f"{self.recipe[key].folder}/{name}" for name in names}
        return files, self._replaced.get(min(files), _ReplacedView())

    def _keep_all(
        self, stage: Stage[Any], images: Sequence[tuple[str, Write]], radius_mm: float | None
    ) -> tuple[str, ...]:
        """Write images that belong together, all or none, and return their names."""
        names: list[str] = []
        with self._lock:
            try:
                for suffix, write in images:
                    names.append(self._keep(stage, suffix, radius_mm, write))
                self._replace_views(stage, set(names))
            except InputError:
                with contextlib.suppress(OSError, InputError):  # the first refusal is reported
                    self._drop(stage.folder, names)
                raise
            finally:
                self._refresh()
        return tuple(names)

    def _drop(self, folder: str, names: Sequence[str]) -> None:
        self._dropped += bool(names)
        for name in names:
            (self._session.folder / folder / name).unlink(missing_ok=True)
        radii = self._session.ball_radii_mm
        if not radii.keys().isdisjoint(names):
            remaining_radii = {name: radii[name] for name in radii if name not in names}
            self._describe(replace(self._session, ball_radii_mm=remaining_radii))

    def _keep(self, stage: Stage[Any], suffix: str, radius_mm: float | None, write: Write) -> str:
        """Write an image under the next free name, and return that name.

        Another program that captures into the same session may use that name at the same moment.
        The radius is written first, so that no press ever has another one's radius.
        """
        while True:
            name, folder = self._next_name(stage, suffix), self._session.folder
            before = self._session.ball_radii_mm.get(name)
            if radius_mm is not None:
                self.set_ball_radius(name, radius_mm)
            try:
                write(folder, folder / stage.folder / name)
                return name
            except InputError as error:
                if radius_mm is not None:
                    self.set_ball_radius(name, before)
                if not isinstance(error, NameTakenError):
                    raise

    def decide(self, decisions: Decisions) -> None:
        """Replace the present decisions by new ones, on disk first."""
        with self._lock:
            path = self._session.folder / DECISIONS
            self._files.refuse_changed(path)
            write_decisions(decisions, self._session.folder)
            self._files.take(path)
            self._session = replace(self._session, decisions=decisions)

    def exclude(self, key: str, name: str, excluded: bool = True) -> None:
        """Exclude an image, or include it again.

        Parameters
        ----------
        key : str
            Stage of the image.
        name : str
            Its file name.
        excluded : bool, optional
            False includes the image again.
        """
        with self._lock:
            image = f"{self.recipe[key].folder}/{name}"
            names = self._session.decisions.excluded
            names = names | {image} if excluded else names - {image}
            self.decide(replace(self._session.decisions, excluded=names))
            self._dropped += excluded

    def place_spot(self, led: int, position: PointXY | None) -> None:
        """Set an LED's mirror spot by hand, or return to the detected one.

        Parameters
        ----------
        led : int
            0, 1, 2: red, green, blue.
        position : (u, v) or None
            In pixels of the mirror image.
        """
        with self._lock:
            spots = _with(self._session.decisions.spots_px, led, position)
            self.decide(replace(self._session.decisions, spots_px=spots))

    def place_ball(self, name: str, circle: PlacedCircle | None) -> None:
        """Set the contact in a ball image by hand, or return to the detected one.

        Parameters
        ----------
        name : str
            File name of the image.
        circle : PlacedCircle or None
            In pixels of the raw image.
        """
        with self._lock:
            balls = _with(self._session.decisions.balls, name, circle)
            self.decide(replace(self._session.decisions, balls=balls))

    def edit_curves(self, curves: Mapping[int, tuple[PointXY, ...]]) -> None:
        """Set the reflectance curves drawn by hand. The others stay as fitted."""
        with self._lock:
            self.decide(replace(self._session.decisions, curves=dict(curves)))

    def describe(self, session: Session) -> None:
        """Store new stated values of the sensor, its boards and the usual ball, on disk first.

        Folder, decisions, the radii of single presses and the camera settings stay.
        """
        with self._lock:
            present = self._session
            self._describe(
                replace(
                    session,
                    ball_radii_mm=present.ball_radii_mm,
                    camera_settings=present.camera_settings,
                )
            )

    def set_camera(self, settings: CameraSettings | None) -> None:
        """Store the settings of the camera that captures the images, on disk first."""
        with self._lock:
            if settings != self._session.camera_settings:
                self._describe(replace(self._session, camera_settings=settings))

    def set_ball_radius(self, name: str, radius_mm: float | None) -> None:
        """Set the radius of the ball in one image, or return to the default.

        Parameters
        ----------
        name : str
            File name of the image.
        radius_mm : float or None
            Radius of the ball, not its diameter.
        """
        with self._lock:
            radii = _with(self._session.ball_radii_mm, name, radius_mm)
            self._describe(replace(self._session, ball_radii_mm=radii))

    def _describe(self, session: Session) -> None:
        before = self._session
        described = replace(
            session,
            folder=before.folder,
            decisions=before.decisions,
            inventory=before.inventory,
        )
        path = described.folder / DESCRIPTION
        self._files.refuse_changed(path)
        write_description(described)
        self._files.take(path)
        self._session = described

    def _next_name(self, stage: Stage[Any], suffix: str) -> str:
        self._refresh()
        files = [p.stem for p in self._session.captured(stage.folder)]
        numbers: list[int] = [int(stem[-3:]) for stem in files if stem[-3:].isdigit()]
        number = max([*numbers, len(files)], default=0) + 1
        return f"{stage.stem or stage.folder}_{number:03d}{suffix}"

    def _replace_views(self, stage: Stage[Any], names: set[str]) -> None:
        folder = stage.folder
        if stage.one_image:
            self._refresh()
            former = {
                f"{folder}/{path.name}"
                for path in self._session.found(folder)
                if path.name not in names
            }
            now = self._session.decisions
            # A spot was set in the image that is replaced.
            spots = {} if stage.key == "lights" else now.spots_px
            if former or spots != now.spots_px:
                self.decide(replace(now, excluded=now.excluded | former, spots_px=spots))
                gone = {k: v for k, v in now.spots_px.items() if k not in spots}
                first = min(f"{folder}/{name}" for name in names)
                self._replaced[first] = _ReplacedView(frozenset(former), gone)


def _copy(source: Path, session: Path, target: Path) -> None:
    data = read_image_file(source)
    make_folder(target.parent)
    write_atomically(target, lambda stream: stream.write(data), new=True, inside=session)


def _write(rgb: FrameArray, session: Path, target: Path) -> None:
    write_image(rgb, target, new=True, inside=session)


def _with(mapping: Mapping[Any, Any], key: Any, value: Any) -> dict[Any, Any]:
    changed = {k: v for k, v in mapping.items() if k != key}
    if value is not None:
        changed[key] = value
    return changed
