"""Read a session folder: its description (session.toml) and the pictures of each stage."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from gelpolight_core.errors import InputError
from gelpolight_core.optics.checkerboard import BoardSpec
from gelpolight_core.reading import brief, parse_toml, read_file
from gelpolight_core.response.curve import CameraResponse, declared_response
from gelpolight_core.session.camera_settings import CameraSettings, parse_settings
from gelpolight_core.session.decisions import Decisions, read_decisions
from gelpolight_core.session.picture import Picture, linear_picture
from gelpolight_core.session.table import Table
from gelpolight_core.session.wholeness import decode_picture
from gelpolight_core.translation import tr

FORMAT = "gelpolight-session"
VERSION = 1
SUFFIXES = (".png", ".tif", ".tiff")
# Diamond has 2.42; no clear elastomer or window has more.
DENSEST_INDEX = 2.5
SENSOR_RANGES = {
    "led_height_mm": (0.1, 500.0),
    "elastomer_thickness_mm": (0.0, 500.0),
    "elastomer_refractive_index": (1.0, DENSEST_INDEX),
    "window_thickness_mm": (0.0, 100.0),
    "window_refractive_index": (1.0, DENSEST_INDEX),
    "working_diameter_mm": (0.5, 1000.0),
}
_SENSOR_DEFAULTS = {"window_thickness_mm": 0.0, "window_refractive_index": 1.49}
ONE_IMAGE_STAGES = ("mirror", "whiteboard", "background")
SINGLE_LED_NAMES = ("red", "green", "blue")


@dataclass(frozen=True, slots=True)
class SensorData:
    """The sensor as its maker states it; lengths in mm (session.toml, ``[sensor]``)."""

    serial: str
    led_height_mm: float
    elastomer_thickness_mm: float
    elastomer_refractive_index: float
    window_thickness_mm: float
    window_refractive_index: float
    working_diameter_mm: float


@dataclass(frozen=True, slots=True)
class Session:
    """A session folder whose description was read and checked; pictures are read on demand.

    What a person decided about the pictures (``decisions.toml``) is honoured: excluded ones are not
    among a stage's files.

    Attributes
    ----------
    folder, sensor, checkerboard, top_pose
        Where it is, and what ``session.toml`` says of sensor and boards.
    ball_radii_mm, ball_default_radius_mm
        Of ``[balls]``.
    declared_response : str, float or None
        Of ``[camera]``: ``linear``, ``srgb``, or a gamma; None where nothing is declared.
    exposures_ms : mapping
        Of ``[response]``: exposure time of each of its pictures.
    response : CameraResponse or None
        Undone as the stages' pictures are read; as declared until it is measured.
    decisions : Decisions
        Of ``decisions.toml``.
    camera_settings : CameraSettings or None
        Of ``[camera.device]`` and ``[camera.controls]``: the camera that took the pictures, as it
        was set; None where that is not known.
    """

    folder: Path
    sensor: SensorData
    checkerboard: BoardSpec
    top_pose: BoardSpec
    ball_radii_mm: Mapping[str, float] = field(default_factory=dict)
    ball_default_radius_mm: float | None = None
    declared_response: str | float | None = None
    exposures_ms: Mapping[str, float] = field(default_factory=dict)
    response: CameraResponse | None = None
    decisions: Decisions = field(default_factory=Decisions)
    camera_settings: CameraSettings | None = None

    @property
    def optional_stages(self) -> tuple[str, ...]:
        """The stages that this session has, of those that a session may lack.

        An empty folder is none; exposure times without pictures are: something is missing there.
        """
        has_series = bool(self.exposures_ms or self.captured("response"))
        has_single = bool(self.captured("single_led"))
        return ("response",) * has_series + ("single_led",) * has_single

    def captured(self, stage: str) -> tuple[Path, ...]:
        """Return all picture files of a stage in the order of their names, excluded ones too."""
        folder = self.folder / stage
        return tuple(sorted(p for p in folder.glob("[!.]*") if p.suffix.lower() in SUFFIXES))

    def found(self, stage: str) -> tuple[Path, ...]:
        """Return the picture files of a stage that are to be used; there may be none."""
        excluded = self.decisions.excluded
        return tuple(p for p in self.captured(stage) if f"{stage}/{p.name}" not in excluded)

    def files(self, stage: str) -> tuple[Path, ...]:
        """Return the picture files of a stage in the order of their names.

        Raises
        ------
        InputError
            If the stage's folder is missing or holds no PNG or TIFF picture, or all are excluded.
        """
        found = self.found(stage)
        if not found:
            raise InputError(
                tr("the stage has no pictures")
                if not self.captured(stage)
                else tr("all pictures of the stage are excluded"),
                where=str(self.folder / stage),
                advice=tr("Capture the stage, or copy its PNG or TIFF pictures there"),
            )
        return found

    def pictures(self, stage: str) -> tuple[Picture, ...]:
        """Return the pictures of a stage; all must have one size.

        Parameters
        ----------
        stage : str
            Its folder, such as ``whiteboard``.

        Raises
        ------
        InputError
            If there are none, one cannot be read, or they have different sizes.
        """
        pictures = tuple(self.picture(path) for path in self.files(stage))
        for picture in pictures[1:]:
            if picture.size != pictures[0].size:
                raise InputError(
                    tr("the picture is {a} pixels and {name} is {b}").format(
                        a="x".join(map(str, picture.size)),
                        name=pictures[0].name,
                        b="x".join(map(str, pictures[0].size)),
                    ),
                    where=str(self.folder / stage / picture.name),
                    advice=tr("Capture all pictures of a session at one size"),
                )
        return pictures

    def picture(self, path: Path) -> Picture:
        """Return one of the session's pictures as linear light.

        Raises
        ------
        InputError
            As :func:`read_picture`.
        """
        return read_picture(path, response=self.response)

    def series(self) -> tuple[tuple[Picture, ...], tuple[float, ...]]:
        """Return the pictures of ``response``, as the camera encoded them, and their times (ms).

        Raises
        ------
        InputError
            If a picture has no exposure time in ``[response]``, or a time has no picture.
        """
        pictures = replace(self, response=None).pictures("response")
        names = {picture.name for picture in pictures}
        for name in sorted(names ^ set(self.exposures_ms)):
            found = tr("[response] states no exposure time for {name}")
            if name not in names:
                found = tr("[response] names {name}, which is not there")
            raise InputError(
                found.format(name=name),
                where=str(self.folder / "session.toml"),
                advice=tr('Write one line "{name}" = time in ms for each picture there').format(
                    name=next(iter(sorted(names)))
                ),
            )
        return pictures, tuple(self.exposures_ms[picture.name] for picture in pictures)

    def single_led(self) -> tuple[Picture, ...]:
        """Return the pictures of the whiteboard with the red, the green, the blue LED lit alone.

        Raises
        ------
        InputError
            If one of the three is missing, or there are others.
        """
        by_name = {Path(p.name).stem.casefold(): p for p in self.pictures("single_led")}
        if set(by_name) != set(SINGLE_LED_NAMES) or len(by_name) != len(self.files("single_led")):
            raise InputError(
                tr("there are {found}, not red, green and blue").format(
                    found=", ".join(path.name for path in self.files("single_led"))
                ),
                where=str(self.folder / "single_led"),
                advice=tr("Give one picture for each LED lit alone: red.png, green.png, blue.png"),
            )
        return tuple(by_name[name] for name in SINGLE_LED_NAMES)

    def averaged(self, stage: str) -> Picture:
        """Return the average of a one-image stage's frames."""
        return average(self.pictures(stage), name=f"{stage}")

    def ball_radius_mm(self, name: str) -> float:
        """Return the radius of the ball pressed in the picture `name`.

        Raises
        ------
        InputError
            If ``session.toml`` states none for it and no default.
        """
        radius = self.ball_radii_mm.get(name, self.ball_default_radius_mm)
        if name not in self.ball_radii_mm:
            self._refuse_misspelt_ball(name)
        if radius is None:
            raise InputError(
                tr("[balls] states no radius for {name}").format(name=name),
                where=str(self.folder / "session.toml"),
                advice=tr('Add "{name}" = radius in mm, or a default').format(name=name),
            )
        return radius

    def _refuse_misspelt_ball(self, name: str) -> None:
        """Refuse a default radius while another radius is stated for a picture that is not there.

        It may be meant for the picture `name`, which would be calibrated with a wrong radius.
        """
        folder = self.folder / "balls"
        strays = [key for key in self.ball_radii_mm if not (folder / key).exists()]
        if self.ball_default_radius_mm is None or not folder.is_dir() or not strays:
            return
        raise InputError(
            tr("[balls] names {stray}, which is not there, and not {name}").format(
                stray=strays[0], name=name
            ),
            where=str(self.folder / "session.toml"),
            advice=tr("Correct the file's name in [balls], or remove its row"),
        )


def average(pictures: Sequence[Picture], *, name: str) -> Picture:
    """Average frames of one view; a lone frame is passed on.

    Parameters
    ----------
    pictures : sequence of Picture
        Of one size, at least one.
    name : str
        What the average is called.
    """
    if len(pictures) == 1:
        return pictures[0]
    mean = np.asarray(np.mean([p.rgb for p in pictures], axis=0, dtype=np.float64), np.float32)
    return Picture(
        name,
        mean,
        bit_depth=max(p.bit_depth for p in pictures),
        frame_count=sum(p.frame_count for p in pictures),
        grey=all(p.grey for p in pictures),
    )


def read_picture(path: Path, *, response: CameraResponse | None = None) -> Picture:
    """Read a PNG or TIFF picture, 8 or 16 bit, as linear light 0..1 in RGB order.

    Parameters
    ----------
    path : Path
        The file.
    response : CameraResponse, optional
        Of the camera, to be undone; left out, the camera is linear.

    Raises
    ------
    InputError
        If the file is missing, is not a picture, or is neither 8 nor 16 bit.
    """
    raw = decode_picture(path)
    if raw is None:
        raise InputError(
            tr("the file is not a whole PNG or TIFF picture"),
            where=str(path),
            advice=tr("Capture or copy it again"),
        )
    if raw.dtype not in (np.uint8, np.uint16):
        raise InputError(
            tr("the picture holds {kind} values").format(kind=raw.dtype),
            where=str(path),
            advice=tr("Use pictures of 8 or 16 bit"),
        )
    grey = raw.ndim == 2
    bgr = np.repeat(raw[:, :, None], 3, axis=2) if grey else raw[:, :, :3]
    return linear_picture(bgr[:, :, ::-1], path.name, response=response, grey=grey)


def require_colour(picture: Picture, *, where: str) -> None:
    """Refuse a grey picture where the three LEDs' colours are needed.

    Parameters
    ----------
    picture : Picture
        To be looked at.
    where : str
        What a message names.

    Raises
    ------
    InputError
        If the channels are alike, be it by a grey camera or because all are at the end of scale.
    """
    if float(picture.rgb.min()) >= 1.0:
        raise InputError(
            tr("the picture is saturated everywhere"),
            where=where,
            advice=tr("Shorten the exposure"),
        )
    rgb = picture.rgb
    same = picture.grey or bool(
        np.array_equal(rgb[..., 0], rgb[..., 1]) and np.array_equal(rgb[..., 1], rgb[..., 2])
    )
    if same and float(rgb.max()) > 0.0:
        raise InputError(
            tr("the picture is grey"),
            where=where,
            advice=tr("Capture it in colour: each LED is told by its own channel"),
        )


def read_session(folder: Path) -> Session:
    """Read and check ``session.toml`` of a session folder.

    Beside what every session states it may have ``[camera]`` with either ``response = "linear"``
    (as without it) or ``"srgb"``, or ``gamma = 2.2``, and with the camera's name, format and
    settings in ``[camera.device]`` and ``[camera.controls]``; and ``[response]`` with the exposure
    time in ms of each picture in the folder ``response``, such as ``"exp_01.png" = 2.0``.

    Raises
    ------
    InputError
        If the folder or file is missing, is not TOML, has another format or version, or a key
        that is unknown, missing, of the wrong kind or out of range.
    """
    path = folder / "session.toml"
    try:
        content = parse_toml(read_file(path))
    except FileNotFoundError as error:
        raise InputError(
            tr("there is no session.toml"),
            where=str(folder),
            advice=tr("Name a session folder, or make one with gelpolight simulate"),
        ) from error
    except ValueError as error:
        raise InputError(
            tr("the file is not valid TOML ({error})").format(error=brief(str(error), 200)),
            where=str(path),
            advice=tr("Mend that line"),
        ) from error
    return parse_session(content, path)


def parse_session(content: dict[str, Any], path: Path) -> Session:
    """Return the session that the content of a session.toml describes.

    Raises
    ------
    InputError
        If a key is unknown, missing, of the wrong kind or out of range; `path` is named.
    """
    top = Table(content, "", path)
    if top.text("format") != FORMAT:
        raise top.wrong("format", tr('is not "{name}"').format(name=FORMAT))
    version = top.whole("version")
    if version > VERSION:
        raise InputError(
            tr("the session has version {v} and this program knows version {k}").format(
                v=version, k=VERSION
            ),
            where=str(path),
            advice=tr("Use a newer version of GelPoLight Studio"),
        )
    if version != VERSION:
        raise top.wrong("version", tr("is unknown"))
    sensor = _parse_sensor(top.table("sensor"))
    checkerboard = _parse_board(top.table("checkerboard"))
    pose = _parse_board(top.table("top_pose")) if "top_pose" in content else checkerboard
    balls = top.table("balls")
    camera = top.table("camera") if "camera" in content else Table({}, "camera", path)
    declared = _parse_response(camera) if "camera" in content else None
    radii = {name: balls.number(name, 0.05, 500.0) for name in balls.file_names()}
    series = top.table("response") if "response" in content else Table({}, "response", path)
    times = {name: series.number(name, 1e-4, 1e6) for name in series.file_names()}
    top.no_more(
        "format", "version", "sensor", "checkerboard", "top_pose", "balls", "camera", "response"
    )
    default = radii.pop("default", None)
    return Session(
        path.parent,
        sensor,
        checkerboard,
        pose,
        radii,
        default,
        declared,
        times,
        declared_response(declared),
        read_decisions(path.parent),
        parse_settings(camera) if "device" in camera.content else None,
    )


def _parse_response(table: Table) -> str | float | None:
    """Return the declared response: one of two names, or a gamma in the place of a name."""
    table.no_more("response", "gamma", "device", "controls")
    if "device" in table.content and not {"response", "gamma"} & set(table.content):
        return None
    if "gamma" not in table.content:
        response = table.text("response")
        if response not in ("linear", "srgb"):
            raise table.wrong(
                "response", tr('is neither "linear" nor "srgb"; or write gamma = 2.2')
            )
        return response
    if "response" in table.content:
        raise table.wrong("response", tr("stands beside a gamma, where only one of them can hold"))
    return table.number("gamma", 0.2, 5.0)


def _parse_sensor(table: Table) -> SensorData:
    numbers = {
        name: table.number(name, low, high, default=_SENSOR_DEFAULTS.get(name))
        for name, (low, high) in SENSOR_RANGES.items()
    }
    sensor = SensorData(serial=table.text("serial"), **numbers)
    table.no_more(*SensorData.__dataclass_fields__)
    return sensor


def _parse_board(table: Table) -> BoardSpec:
    corners = table.content.get("inner_corners")
    whole = isinstance(corners, list) and len(corners) == 2
    if not whole or not all(type(n) is int and 3 <= n <= 100 for n in corners or ()):
        raise table.wrong("inner_corners", tr("is not two whole numbers from 3 to 100"))
    assert corners is not None
    square = table.number("square_mm", 0.05, 500.0)
    table.no_more("inner_corners", "square_mm")
    return BoardSpec((corners[0], corners[1]), square)
