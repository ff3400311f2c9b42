"""Read and write the images of a session's stages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import FrameArray
from gelpolight_core.base.atomic_write import make_folder, write_atomically
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.parallel import in_parallel
from gelpolight_core.image.image_file import decode_image, names_of
from gelpolight_core.image.linear_image import LinearImage, linear_image, require_size
from gelpolight_core.image.response import CameraResponse

from .decisions import Decisions
from .inventory import SessionInventory, StoredImage


class SessionImages:
    """The images of a session, and the radii of its balls.

    Attributes
    ----------
    folder : Path
        The session folder.
    decisions : Decisions
        Decisions from ``decisions.toml``.
    response : CameraResponse or None
        Camera response that is undone as images are read.
    ball_radii_mm, ball_default_radius_mm
        Radii from ``[balls]``.
    """

    __slots__ = ()
    folder: Path
    decisions: Decisions
    response: CameraResponse | None
    ball_radii_mm: Mapping[str, float]
    ball_default_radius_mm: float | None
    inventory: SessionInventory

    def captured(self, stage: str) -> tuple[Path, ...]:
        """Return all image files of a stage in the order of their names, also excluded ones."""
        return tuple(image.path for image in self.inventory.stage(stage).images)

    def stored(self, stage: str) -> tuple[StoredImage, ...]:
        """Return what is known of the image files of a stage that are used."""
        excluded, images = self.decisions.excluded, self.inventory.stage(stage).images
        return tuple(image for image in images if f"{stage}/{image.path.name}" not in excluded)

    def found(self, stage: str) -> tuple[Path, ...]:
        """Return the image files of a stage that are used. There may be none."""
        return tuple(image.path for image in self.stored(stage))

    def files(self, stage: str) -> tuple[Path, ...]:
        """Return the image files of a stage in the order of their names.

        Raises
        ------
        InputError
            If the stage's folder is missing or has no image, or all are excluded.
        """
        files = self.found(stage)
        if not files:
            captured, others = self.inventory.stage(stage)
            text = "The stage has no images"
            if captured:
                text = "All images of the stage are excluded"
            elif others:
                text += f", but {len(others)} other files ({names_of(others)})"
            raise InputError(text, self.folder / stage, Remedy.CAPTURE_STAGE)
        return files

    def images(self, stage: str) -> tuple[LinearImage, ...]:
        """Return the images of a stage, which must have the same size.

        Parameters
        ----------
        stage : str
            Its folder, such as ``whiteboard``.

        Raises
        ------
        InputError
            If there are none, one cannot be read, or they have different sizes.
        """
        images = tuple(in_parallel(self.image, self.files(stage)))
        for image in images[1:]:
            require_size(image.size, images[0].size, where=str(self.folder / stage / image.name))
        return images

    def usable_images(self, stage: str) -> tuple[tuple[LinearImage, ...], dict[str, InputError]]:
        """Return the usable images of a stage, and the reasons why the others cannot be used.

        Each image is judged separately: an image that cannot be read, or whose size differs from
        most others, is left out with the reason.

        Parameters
        ----------
        stage : str
            Its folder, such as ``checkerboard``.

        Returns
        -------
        images : tuple of LinearImage
            In the order of their names, all of one size.
        refused : dict of str to InputError
            By file name.

        Raises
        ------
        InputError
            If there are none, or none can be used.
        """
        files = self.files(stage)
        read: list[LinearImage] = []
        refused: dict[str, InputError] = {}
        for path, result in zip(files, in_parallel(self._image_or_fault, files), strict=True):
            if isinstance(result, InputError):
                refused[path.name] = result
            else:
                read.append(result)
        if not read:
            raise next(iter(refused.values()))
        sizes = [image.size for image in read]
        usual = max(sizes, key=sizes.count)
        for image in read:
            try:
                require_size(image.size, usual, where=str(self.folder / stage / image.name))
            except InputError as fault:
                refused[image.name] = fault
        return tuple(image for image in read if image.size == usual), refused

    def _image_or_fault(self, path: Path) -> LinearImage | InputError:
        try:
            return self.image(path)
        except InputError as fault:
            return fault

    def image(self, path: Path) -> LinearImage:
        """Return one image of the session as linear light.

        Raises
        ------
        InputError
            As in :func:`read_linear_image`.
        """
        return read_linear_image(path, response=self.response)

    def averaged(self, stage: str) -> LinearImage:
        """Return the average of the frames of a one-image stage.

        Raises
        ------
        InputError
            As :meth:`images`, or if the frames do not show the same.
        """
        images = self.images(stage)
        if len(images) > 1:
            _refuse_odd_image(images, stage)
        return average(images, name=f"{stage}")

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
            text = f'[balls] has neither "{name}" in radius_mm nor default_radius_mm'
            raise InputError(text, self.folder / "session.toml", Remedy.STATE_IN_SESSION)
        return radius

    def _refuse_misspelt_ball(self, name: str) -> None:
        """Refuse the default radius if a radius is stated for an image that does not exist.

        That radius may be meant for the image `name`, which would then be calibrated with a wrong
        radius.
        """
        images, others = self.inventory.stage("balls")
        names = {image.path.name for image in images} | {path.name for path in others}
        strays = [key for key in self.ball_radii_mm if key not in names]
        if self.ball_default_radius_mm is None or not names or not strays:
            return
        text = f"[balls] lists {strays[0]}, which does not exist, but not {name}"
        raise InputError(text, self.folder / "session.toml", Remedy.CORRECT_ENTRY)


def _refuse_odd_image(images: Sequence[LinearImage], stage: str) -> None:
    """Refuse images of one view if one of them is of another calibration."""
    from gelpolight_core.image.change_detection import find_odd_image

    loss = max(image.loss for image in images) / 255.0
    if odd := find_odd_image([image.rgb for image in images], loss=loss):
        one, other = (images[n].name for n in odd)
        text = f"{one} and {other} differ; images of one stage are averaged and must show the same"
        raise InputError(text, stage, Remedy.REMOVE_ODD)


def average(images: Sequence[LinearImage], *, name: str) -> LinearImage:
    """Average frames of one view. A single frame is returned unchanged.

    Parameters
    ----------
    images : sequence of LinearImage
        At least one, all of the same size.
    name : str
        Name of the average.
    """
    if len(images) == 1:
        return images[0]
    mean = np.asarray(np.mean([p.rgb for p in images], axis=0, dtype=np.float64), np.float32)
    return LinearImage(
        name,
        mean,
        bit_depth=max(p.bit_depth for p in images),
        frame_count=sum(p.frame_count for p in images),
        grey=all(p.grey for p in images),
        loss=float(np.max([p.loss for p in images])),
    )


def read_linear_image(path: Path, *, response: CameraResponse | None = None) -> LinearImage:
    """Read an image as linear light 0..1 in RGB order.

    Parameters
    ----------
    path : Path
        PNG, TIFF, BMP, JPEG or WebP, 8 or 16 bit.
    response : CameraResponse, optional
        Response of the camera, which is corrected; without it the camera is linear.

    Raises
    ------
    InputError
        As :func:`read_raw_image`.
    """
    raw = read_raw_image(path)
    image = linear_image(raw.rgb, path.name, response=response, grey=raw.grey)
    return replace(image, loss=raw.loss)


def read_colours(path: Path, response: CameraResponse | None = None) -> LinearImage:
    """Read an image of the lit membrane. Arguments are as for :func:`read_linear_image`.

    Raises
    ------
    InputError
        As :func:`read_linear_image`, or if the image is grey or saturated.
    """
    image = read_linear_image(path, response=response)
    require_colour(image, where=str(path))
    return image


class RawImage(NamedTuple):
    """An image as its file has it.

    Attributes
    ----------
    rgb : (rows, columns, 3) uint8 or uint16
        As the camera encoded it; a single grey channel is repeated.
    grey : bool
        Whether the file contains a single channel.
    loss : float
        As of :class:`LinearImage`.
    """

    rgb: NDArray[Any]
    grey: bool
    loss: float


def read_raw_image(path: Path) -> RawImage:
    """Read an image file, 8 or 16 bit, as the camera encoded it.

    Raises
    ------
    InputError
        If the file is missing, is not an image, or is neither 8 nor 16 bit.
    """
    import cv2

    raw, loss = decode_image(path)
    if raw.dtype not in (np.uint8, np.uint16):
        raise InputError(f"The image contains {raw.dtype} values", path, Remedy.PNG)
    grey = raw.ndim == 2
    return RawImage(cv2.cvtColor(raw, cv2.COLOR_GRAY2RGB) if grey else raw, grey, loss)


def require_colour(image: LinearImage, *, where: str) -> None:
    """Refuse a grey image where the colours of the three LEDs are needed.

    Parameters
    ----------
    image : LinearImage
        The image to check.
    where : str
        File or stage named in the message.

    Raises
    ------
    InputError
        If the channels are equal, because the camera is monochrome, the image is not demosaiced,
        or everything is saturated.
    """
    from gelpolight_core.image.mosaic import is_mosaic

    if float(image.rgb.min()) >= 1.0:
        raise InputError("The image is saturated everywhere", where, Remedy.SHORTER_EXPOSURE)
    rgb = image.rgb
    same = image.grey or bool(
        np.array_equal(rgb[..., 0], rgb[..., 1]) and np.array_equal(rgb[..., 1], rgb[..., 2])
    )
    if same and float(rgb.max()) > 0.0:
        if is_mosaic(np.ascontiguousarray(rgb[..., 0])):
            text = "The image is raw (Bayer) data of the camera, with one colour in each pixel"
            raise InputError(text, where, Remedy.DEMOSAIC)
        raise InputError("The image is grey", where, Remedy.CAPTURE_COLOUR)


def average_frames(frames: Sequence[FrameArray]) -> FrameArray:
    """Return the average of frames, as 16 bit if there are several."""
    if len(frames) == 1:
        return frames[0]
    scale = 65535.0 / float(np.iinfo(frames[0].dtype).max)
    total = np.zeros(frames[0].shape, np.float64)
    for frame in frames:
        total += frame
    return np.asarray(np.round(total * (scale / len(frames))), np.uint16)


def write_image(
    rgb: FrameArray, path: Path, *, new: bool = False, inside: Path | None = None
) -> None:
    """Write a PNG file, completely or not at all.

    Parameters
    ----------
    rgb : (rows, columns, 3) uint8 or uint16
        The image.
    path : Path
        Destination; its folder is created.
    new, inside
        As in :func:`~gelpolight_core.base.atomic_write.write_atomically`.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    import cv2

    make_folder(path.parent)
    done, data = cv2.imencode(".png", np.ascontiguousarray(rgb[..., ::-1]))
    if not done:
        raise InputError("The image cannot be encoded", path, Remedy.CAPTURE_AGAIN)
    write_atomically(path, lambda stream: stream.write(data.tobytes()), new=new, inside=inside)
