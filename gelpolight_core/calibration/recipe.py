"""A calibration is a recipe: stages in order, each a function of images and earlier results.

Nothing slow is imported here or by the modules of the recipes: windows and commands list stages
before anything is computed. A stage imports what it computes with when it runs.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.finding import QualityTable, Verdict
from gelpolight_core.base.identity import identity_text
from gelpolight_core.image.image_file import names_of

if TYPE_CHECKING:
    from gelpolight_core.geometry.membrane_shape import MembraneShape
    from gelpolight_core.sensor.sensor_calibration import Provenance
    from gelpolight_core.session.inventory import StoredImage
    from gelpolight_core.session.session import Session

ProgressCallback = Callable[[float], None]
Facts = tuple[tuple[str, str], ...]
"""Labels and values."""


def shape_facts(surface: MembraneShape) -> Facts:
    """Return the facts about a curved membrane."""
    if surface.flat:
        return ()
    (x, y), height_mm = surface.axis_mm, surface.apex_height_mm + surface.rise_mm
    shape = surface.shape.replace("_", " ")
    return (("Membrane", f"{shape}, {height_mm:.3f} mm high, axis at ({x:.3f}, {y:.3f}) mm"),)


class StageResult(Protocol):
    """What a stage returns: its figures, and whatever later stages use of it."""

    @property
    def quality(self) -> QualityTable:
        """The figures by which the stage is judged."""
        ...


R = TypeVar("R", bound=StageResult)


@dataclass(frozen=True, slots=True)
class StageInputs:
    """All inputs of a stage's result.

    Attributes
    ----------
    images : tuple of (name, SHA-256)
        Its own images, without excluded ones.
    stated : str
        Stated values and decisions that it uses.
    earlier : tuple of str
        Fingerprints of the stages that it needs.
    """

    images: tuple[tuple[str, str], ...]
    stated: str
    earlier: tuple[str, ...]

    @property
    def fingerprint(self) -> str:
        """A text that changes with any of the inputs."""
        return hashlib.sha256(repr((self.images, self.stated, self.earlier)).encode()).hexdigest()

    def changes_since(self, before: StageInputs) -> str:
        """Describe what has changed since a result was computed."""
        old, new = dict(before.images), dict(self.images)
        changes = []
        for names, change in (
            ([name for name in new if name not in old], "added"),
            ([name for name in old if name not in new], "excluded"),
            ([n for n in new if n in old and new[n] != old[n]], "changed"),
        ):
            if names:
                changes.append(f"{names_of(names)} {change}")
        if before.stated != self.stated:
            changes.append("a stated value or a manual correction changed")
        if before.earlier != self.earlier:
            changes.append("an earlier stage changed")
        return "; ".join(changes)


@dataclass(frozen=True, slots=True)
class QualityTableSpec:
    """A table of figures in the finished calibration, with its section of the report.

    Attributes
    ----------
    key, title : str
        For files, and for people.
    of : callable
        Takes the stage's result and returns the table; an empty one is left out.
    about : str
        What the stage does, as a sentence without a full stop.
    facts : callable
        Takes the data of the calibration and returns results as labels and values.
    """

    key: str
    title: str
    of: Callable[[Any], QualityTable] = lambda result: result.quality
    about: str = ""
    facts: Callable[[Any], Facts] = lambda _data: ()


FILES = QualityTableSpec("files", "Image files", about="Reads the images of all stages")
"""Of every recipe; it has figures only where something is unusual."""


@dataclass(frozen=True, eq=False)
class Stage(Generic[R]):
    """One stage of a calibration: everything that the program knows about it.

    Attributes
    ----------
    key, title : str
        For files and programs, and for people.
    run : callable
        Takes the :class:`StageContext` and returns the result. It raises InputError if the images
        cannot be used. Of several captures (checkerboard, top_pose, balls) one that cannot be used
        is left out with its reason; the stage is refused only if too few are left.
    needs : tuple of Stage
        The stages whose results it uses directly.
    folder : str
        Folder of its images in a session; empty if it has none.
    stem : str
        Beginning of the names of new images; by default `folder`.
    optional : callable
        Takes the session and returns folders of additional images that it uses.
    stated : callable
        Takes the session and returns the stated values and decisions that the stage uses.
    used : callable
        Takes the session and returns whether it has this stage; by default every session has.
    share : float
        Its share of the whole work, in parts of any size.
    one_image : bool
        Whether a new image replaces the former one.
    colour : bool
        Whether grey images are refused.
    lit : bool
        Whether the brightness is compared with that of other stages: the camera must not change.
    task : str
        What a person does to capture its images.
    tables : tuple of QualityTableSpec or None
        Its tables in the finished calibration; by default one, with the figures of the result.
    about, facts
        Text and facts of that one table, as in :class:`QualityTableSpec`.
    entries : callable
        Takes all results and returns its results as plain values, lengths in mm, sensor frame.
    lines : callable
        Takes its result and returns what the command ``calibrate`` prints of it.
    require : callable
        Takes all results and raises InputError if the one of this stage is of no use.
    settles : tuple of (str, str)
        Findings of earlier stages that its own replace, as keys of table and figure.
    """

    key: str
    title: str
    run: Callable[[StageContext], R]
    needs: tuple[Stage[Any], ...] = ()
    folder: str = ""
    stem: str = ""
    optional: Callable[[Session], tuple[str, ...]] = lambda _session: ()
    stated: Callable[[Session], object] = lambda _session: None
    used: Callable[[Session], bool] = lambda _session: True
    share: float = 1.0
    one_image: bool = False
    colour: bool = False
    lit: bool = False
    task: str = ""
    tables: tuple[QualityTableSpec, ...] | None = None
    about: str = ""
    facts: Callable[[Any], Facts] = lambda _data: ()
    entries: Callable[[StageResults], dict[str, Any]] = lambda _results: {}
    lines: Callable[[R], tuple[str, ...]] = lambda _result: ()
    require: Callable[[StageResults], None] = lambda _results: None
    settles: tuple[tuple[str, str], ...] = ()

    @property
    def all_tables(self) -> tuple[QualityTableSpec, ...]:
        """Its tables in the finished calibration."""
        if self.tables is not None:
            return self.tables
        return (QualityTableSpec(self.key, self.title, about=self.about, facts=self.facts),)

    def folders(self, session: Session) -> tuple[str, ...]:
        """Return the folders of its images."""
        folders = (self.folder,) if self.folder else ()
        return folders + self.optional(session)


def settled(
    quality: Mapping[str, QualityTable], stages: Iterable[Stage[Any]]
) -> dict[str, QualityTable]:
    """Return tables of figures without the findings that the results of later stages replace.

    Parameters
    ----------
    quality : mapping of str to QualityTable
        The tables by their keys.
    stages : iterable of Stage
        Those that have a result.
    """
    replaced = {pair for stage in stages for pair in stage.settles}

    def open_figures(key: str, table: QualityTable) -> QualityTable:
        kept = (
            f for f in table.figures if f.verdict is Verdict.PASS or (key, f.key) not in replaced
        )
        return QualityTable(tuple(kept))

    return {key: open_figures(key, table) for key, table in quality.items()}


class StageResults:
    """The newest result of every stage.

    Parameters
    ----------
    found : mapping, optional
        Results by the keys of their stages.
    """

    def __init__(self, found: Mapping[str, Any] | None = None) -> None:
        self._found = dict(found or {})

    def __getitem__(self, stage: Stage[R]) -> R:
        """Return the result of a stage. Raises InputError if there is none."""
        result = self.get(stage)
        if result is None:
            raise InputError(
                "An earlier stage has no result yet", stage.title, Remedy.COMPLETE_STAGES
            )
        return result

    def get(self, stage: Stage[R]) -> R | None:
        """Return the result of a stage, or None."""
        return self._found.get(stage.key)

    def having(self, stage: Stage[R], result: R) -> StageResults:
        """Return the results with a new one."""
        return StageResults({**self._found, stage.key: result})


@dataclass(frozen=True, slots=True)
class StageContext:
    """Input of a stage's run function.

    Attributes
    ----------
    session : Session
        Images, stated values and decisions.
    results : StageResults
        Results of the stages that it needs. ``work[STAGE]`` is one of them.
    inputs : mapping of str to StageInputs
        Inputs of every stage, by its key.
    progress : callable
        Called with the share of the stage that is done, 0..1.
    """

    session: Session
    results: StageResults
    inputs: Mapping[str, StageInputs]
    progress: ProgressCallback = lambda _share: None

    def __getitem__(self, stage: Stage[R]) -> R:
        """Return the result of an earlier stage."""
        return self.results[stage]


@dataclass(frozen=True, eq=False)
class Recipe:
    """The stages of a kind of sensor, which make its calibration.

    Attributes
    ----------
    key, title : str
        Name of the model that the calibration is for, in files, and for people.
    stages : tuple of Stage
        In their order.
    finish : callable
        Takes session, results, tables of figures and provenance, and returns the calibration.
    facts : callable
        Takes the data of the calibration and returns what is known of the sensor.
    closed : bool
        Whether it is for sensors that cannot be opened.
    flat : bool
        Whether it is for flat membranes only.
    depends_on : callable
        Takes the session and the fingerprints of the stages by their keys, and returns everything
        that the calibration depends on.
    """

    key: str
    title: str
    stages: tuple[Stage[Any], ...]
    finish: Callable[[Session, StageResults, dict[str, QualityTable], Provenance], Any]
    facts: Callable[[Any], Facts]
    closed: bool = False
    flat: bool = False
    depends_on: Callable[[Session, dict[str, str]], object] = field(
        default=lambda session, inputs: (list(inputs.values()), session.serial)
    )

    def __getitem__(self, key: str) -> Stage[Any]:
        """Return a stage by its key."""
        return next(stage for stage in self.stages if stage.key == key)

    @property
    def tables(self) -> dict[str, QualityTableSpec]:
        """The tables of all stages, by their keys."""
        tables = (table for stage in self.stages for table in stage.all_tables)
        return {table.key: table for table in (*tables, FILES)}

    @property
    def own_folders(self) -> tuple[str, ...]:
        """The folders of images of all stages, without additional ones."""
        return tuple(stage.folder for stage in self.stages if stage.folder)

    def fits(self, session: Session) -> bool:
        """Return whether the recipe is for the kind of sensor of a session."""
        return not self.misfit(session)

    def misfit(self, session: Session) -> str:
        """Return why the recipe is not for the sensor of a session, or an empty text."""
        if self.closed and session.in_place is None:
            return "The session has no table [in_place]"
        if not self.closed and session.in_place is not None:
            return "The session is of a closed sensor"
        if self.flat and not session.surface.flat:
            return "The membrane of the session is curved"
        return ""

    def of(self, session: Session) -> tuple[Stage[Any], ...]:
        """Return the stages that a session has."""
        return tuple(stage for stage in self.stages if stage.used(session))

    def needed(self, key: str) -> set[str]:
        """Return the keys of a stage and of all stages that it builds on."""
        return {key}.union(*(self.needed(need.key) for need in self[key].needs))

    def folders(self, session: Session) -> tuple[str, ...]:
        """Return the folders of all images that a calibration uses."""
        return tuple(folder for stage in self.of(session) for folder in stage.folders(session))

    def files(self, session: Session) -> tuple[StoredImage, ...]:
        """Return the images that a calibration is made from, stage by stage."""
        return tuple(image for folder in self.folders(session) for image in session.stored(folder))

    def missing(self, session: Session) -> tuple[str, ...]:
        """Return the folders that must have images and have none."""
        folders = (stage.folder for stage in self.of(session) if stage.folder)
        return tuple(folder for folder in folders if not session.found(folder))

    def inputs(self, session: Session) -> dict[str, StageInputs]:
        """Return the inputs of every stage, by its key."""
        inputs: dict[str, StageInputs] = {}
        for stage in self.of(session):
            images = [image for name in stage.folders(session) for image in session.stored(name)]
            inputs[stage.key] = StageInputs(
                tuple((image.path.name, image.sha256) for image in images),
                identity_text(stage.stated(session)),
                tuple(inputs[n.key].fingerprint for n in stage.needs if n.key in inputs),
            )
        return inputs

    def all_inputs(self, session: Session, inputs: Mapping[str, StageInputs]) -> str:
        """Return a text that changes with any input of the calibration."""
        fingerprints = {key: stage_inputs.fingerprint for key, stage_inputs in inputs.items()}
        return hashlib.sha256(repr(self.depends_on(session, fingerprints)).encode()).hexdigest()
