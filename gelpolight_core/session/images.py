"""The images of a session's stages: which there are, and how they are read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.errors import InputError
from gelpolight_core.image.file import decode_picture
from gelpolight_core.image.picture import Picture, linear_image
from gelpolight_core.image.response import CameraResponse
from gelpolight_core.parallel import in_parallel
from gelpolight_core.session.decisions import Decisions
from gelpolight_core.translation import tr

SUFFIXES = (".png", ".tif", ".tiff")


class SessionImages:
    """What sessions of open and of closed sensors have in common: their images and ball radii.

    Attributes
    ----------
    folder : Path
        Where the session is.
    decisions : Decisions
        Of ``decisions.toml``.
    response : CameraResponse or None
        Undone as images are read.
    ball_radii_mm, ball_default_radius_mm
        Of ``[balls]``.
    """

    __slots__ = ()
    folder: Path
    decisions: Decisions
    response: CameraResponse | None
    ball_radii_mm: Mapping[str, float]
    ball_default_radius_mm: float | None

    def captured(self, stage: str) -> tuple[Path, ...]:
        """Return all image files of a stage in the order of their names, also excluded ones."""
        folder = self.folder / stage
        return tuple(sorted(p for p in folder.glob("[!.]*") if p.suffix.lower() in SUFFIXES))

    def found(self, stage: str) -> tuple[Path, ...]:
        """Return the image files of a stage that are used; there may be none."""
        excluded = self.decisions.excluded
        return tuple(p for p in self.captured(stage) if f"{stage}/{p.name}" not in excluded)

    def files(self, stage: str) -> tuple[Path, ...]:
        """Return the image files of a stage in the order of their names.

        Raises
        ------
        InputError
            If the stage's folder is missing or has no PNG or TIFF image, or all are excluded.
        """
        found = self.found(stage)
        if not found:
            raise InputError(
                tr("The stage has no images")
                if not self.captured(stage)
                else tr("All images of the stage are excluded"),
                where=str(self.folder / stage),
                advice=tr("Capture this stage, or copy its PNG or TIFF images into the folder"),
            )
        return found

    def pictures(self, stage: str) -> tuple[Picture, ...]:
        """Return the images of a stage; all must have the same size.

        Parameters
        ----------
        stage : str
            Its folder, such as ``whiteboard``.

        Raises
        ------
        InputError
            If there are none, one cannot be read, or they have different sizes.
        """
        pictures = tuple(in_parallel(self.picture, self.files(stage)))
        for picture in pictures[1:]:
            if picture.size != pictures[0].size:
                raise InputError(
                    tr("The image has {a} pixels, but {name} has {b}").format(
                        a="x".join(map(str, picture.size)),
                        name=pictures[0].name,
                        b="x".join(map(str, pictures[0].size)),
                    ),
                    where=str(self.folder / stage / picture.name),
                    advice=tr("Capture all images of a session at the same size"),
                )
        return pictures

    def usable_pictures(self, stage: str) -> tuple[tuple[Picture, ...], dict[str, InputError]]:
        """Return the usable images of a stage, and the reasons why the others cannot be used.

        Each image is judged separately: an image that cannot be read, or whose size differs from
        most others, is left out with the reason.

        Parameters
        ----------
        stage : str
            Its folder, such as ``checkerboard``.

        Returns
        -------
        pictures : tuple of Picture
            In the order of their names, all of one size.
        refused : dict of str to InputError
            By file name.

        Raises
        ------
        InputError
            If there are none, or none can be used.
        """
        files = self.files(stage)
        read: list[Picture] = []
        refused: dict[str, InputError] = {}
        for path, found in zip(files, in_parallel(self._image_or_fault, files), strict=True):
            if isinstance(found, InputError):
                refused[path.name] = found
            else:
                read.append(found)
        if not read:
            raise next(iter(refused.values()))
        sizes = [picture.size for picture in read]
        usual = max(sizes, key=sizes.count)
        for picture in read:
            if picture.size != usual:
                refused[picture.name] = InputError(
                    tr("The image has {a} pixels, but the others have {b}").format(
                        a="x".join(map(str, picture.size)), b="x".join(map(str, usual))
                    ),
                    where=str(self.folder / stage / picture.name),
                    advice=tr("Capture all images of a session at the same size"),
                )
        return tuple(picture for picture in read if picture.size == usual), refused

    def _image_or_fault(self, path: Path) -> Picture | InputError:
        try:
            return self.picture(path)
        except InputError as fault:
            return fault

    def picture(self, path: Path) -> Picture:
        """Return one image of the session as linear light.

        Raises
        ------
        InputError
            As in :func:`read_picture`.
        """
        return read_picture(path, response=self.response)

    def averaged(self, stage: str) -> Picture:
        """Return the average of the frames of a one-image stage."""
        return average(self.pictures(stage), name=f"{stage}")

    def ball_radius_mm(self, name: str) -> float:
        """Return the radius of the ball in the image `name`.

        Raises
        ------
        InputError
            If ``session.toml`` states no radius for it and no default.
        """
        radius = self.ball_radii_mm.get(name, self.ball_default_radius_mm)
        if name not in self.ball_radii_mm:
            self._refuse_misspelt_ball(name)
        if radius is None:
            raise InputError(
                tr("[balls] has no radius for {name}").format(name=name),
                where=str(self.folder / "session.toml"),
                advice=tr('Add "{name}" = radius in mm, or a default').format(name=name),
            )
        return radius

    def _refuse_misspelt_ball(self, name: str) -> None:
        """Refuse the default radius if a radius is stated for an image that does not exist.

        That radius may be meant for the image `name`, which would then be calibrated with a wrong
        radius.
        """
        folder = self.folder / "balls"
        strays = [key for key in self.ball_radii_mm if not (folder / key).exists()]
        if self.ball_default_radius_mm is None or not folder.is_dir() or not strays:
            return
        raise InputError(
            tr("[balls] lists {stray}, which does not exist, but not {name}").format(
                stray=strays[0], name=name
            ),
            where=str(self.folder / "session.toml"),
            advice=tr("Correct the file name in [balls], or remove the line"),
        )


def average(pictures: Sequence[Picture], *, name: str) -> Picture:
    """Average frames of one view; a single frame is returned unchanged.

    Parameters
    ----------
    pictures : sequence of Picture
        Of the same size, at least one.
    name : str
        Name of the average.
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
    """Read an image as linear light 0..1 in RGB order.

    Parameters
    ----------
    path : Path
        PNG or TIFF, 8 or 16 bit.
    response : CameraResponse, optional
        Response of the camera, which is undone; without it the camera is linear.

    Raises
    ------
    InputError
        As :func:`read_raw_image`.
    """
    rgb, grey = read_raw_image(path)
    return linear_image(rgb, path.name, response=response, grey=grey)


def read_raw_image(path: Path) -> tuple[NDArray[Any], bool]:
    """Read a PNG or TIFF image, 8 or 16 bit, as the camera encoded it.

    Returns
    -------
    (rows, columns, 3) uint8 or uint16, bool
        RGB, and whether the file held a single grey channel, which is then repeated.

    Raises
    ------
    InputError
        If the file is missing, is not an image, or is neither 8 nor 16 bit.
    """
    raw = decode_picture(path)
    if raw is None:
        raise InputError(
            tr("The file is not a complete PNG or TIFF image"),
            where=str(path),
            advice=tr("Capture or copy it again"),
        )
    if raw.dtype not in (np.uint8, np.uint16):
        raise InputError(
            tr("The image contains {kind} values").format(kind=raw.dtype),
            where=str(path),
            advice=tr("Use images of 8 or 16 bit"),
        )
    grey = raw.ndim == 2
    bgr = np.repeat(raw[:, :, None], 3, axis=2) if grey else raw[:, :, :3]
    return bgr[:, :, ::-1], grey


def require_colour(picture: Picture, *, where: str) -> None:
    """Refuse a grey image where the colours of the three LEDs are needed.

    Parameters
    ----------
    picture : Picture
        The image to check.
    where : str
        File or stage named in the message.

    Raises
    ------
    InputError
        If the channels are equal, because the camera is monochrome or everything is saturated.
    """
    if float(picture.rgb.min()) >= 1.0:
        raise InputError(
            tr("The image is saturated everywhere"),
            where=where,
            advice=tr("Use a shorter exposure"),
        )
    rgb = picture.rgb
    same = picture.grey or bool(
        np.array_equal(rgb[..., 0], rgb[..., 1]) and np.array_equal(rgb[..., 1], rgb[..., 2])
    )
    if same and float(rgb.max()) > 0.0:
        raise InputError(
            tr("The image is grey"),
            where=where,
            advice=tr("Capture a colour image: each LED is identified by its colour channel"),
        )
