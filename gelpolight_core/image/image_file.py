"""Image files: formats and completeness, checked before a decoder reads them.

An image is never turned: what a file says about its orientation is about the camera's housing.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.safe_reading import cannot_read, missing_file, read_file, short_repr
from gelpolight_core.image import opencv, tiff

MAX_PIXELS = 64_000_000
# Three channels of 16 bit, and some overhead.
FILE_LIMIT = 6 * MAX_PIXELS + (1 << 20)


@dataclass(frozen=True, slots=True)
class ImageFormat:
    """A format of image files.

    Attributes
    ----------
    name : str
        Usual name.
    suffixes : tuple of str
        Suffixes of its files.
    starts : callable
        Takes the bytes and returns whether they are of this format.
    complete : callable
        Takes the bytes and returns whether none are missing, as far as the format tells. The
        decoder reports the rest.
    sizes : callable
        Takes the bytes and yields every (width, height) for which its decoder allocates memory.
    loss : callable
        Takes the bytes and returns the standard deviation by which compression may have changed a
        value, in grey levels of 8 bit; 0 without loss.
    decoded : callable
        Takes the bytes and the path for a refusal, and returns the values, grey or RGB; ValueError
        where they are damaged, InputError where they are not those of one image of a camera.
    """

    name: str
    suffixes: tuple[str, ...]
    starts: Callable[[bytes], bool]
    complete: Callable[[bytes], bool]
    sizes: Callable[[bytes], Iterator[tuple[int, int]]]
    loss: Callable[[bytes], float] = lambda _data: 0.0
    decoded: Callable[[bytes, Path], NDArray[Any]] = opencv.decoded


def format_of(data: bytes) -> ImageFormat | None:
    """Return the format of an image by its content, or None."""
    return next((form for form in FORMATS if form.starts(data)), None)


class FolderFiles(NamedTuple):
    """The files of a folder in the order of their names, hidden ones left out.

    Attributes
    ----------
    images, others : tuple of Path
        By their suffixes.
    """

    images: tuple[Path, ...]
    others: tuple[Path, ...]


def files_in(folder: Path) -> FolderFiles:
    """Return the images and the other files of a folder, which may be missing.

    Raises
    ------
    InputError
        If it cannot be listed.
    """
    try:
        entries = sorted(folder.iterdir()) if folder.is_dir() else ()
        files = [p for p in entries if not p.name.startswith(".") and not p.is_dir()]
    except OSError as error:
        raise cannot_read(error, folder) from error
    return FolderFiles(
        tuple(path for path in files if path.suffix.lower() in SUFFIXES),
        tuple(path for path in files if path.suffix.lower() not in SUFFIXES),
    )


def names_of(files: Sequence[Path] | Sequence[str]) -> str:
    """Return the names of files for a message: the first three and the number of others."""
    more = f" and {len(files) - 3} more" if len(files) > 3 else ""
    return ", ".join(short_repr(Path(file).name) for file in files[:3]) + more


def _strange(data: bytes) -> str:
    for name, offset, mark in STRANGERS:
        if data[offset : offset + len(mark)] == mark:
            return f"The file is a {name}, not an image that can be measured"
    return "The file is not an image"


def decode_image(path: Path) -> tuple[NDArray[Any], float]:
    """Return the values of an image file, grey or RGB, with the loss of its format.

    Raises
    ------
    InputError
        If the file is missing, is no image of :data:`FORMATS`, is not complete, declares more
        pixels than any camera has, or contains the colours of a palette or printer, or several
        images.
    """
    data = read_image_file(path)
    form = format_of(data)
    if form is None:
        raise InputError(_strange(data), path, Remedy.PNG)
    for width, height in form.sizes(data):
        if width * height > MAX_PIXELS:
            limit = MAX_PIXELS // 10**6
            text = f"The image declares {width} x {height} pixels, more than {limit} megapixels"
            raise InputError(text, path, Remedy.SMALLER_IMAGES)
    if form.complete(data):
        with suppress(ValueError):
            return form.decoded(data, path), form.loss(data)
    raise InputError(f"The {form.name} image is not complete", path, Remedy.CAPTURE_AGAIN)


def read_image_file(path: Path) -> bytes:
    """Return the content of an image file.

    Raises
    ------
    InputError
        If it is missing, cannot be read, or is too large.
    """
    try:
        return read_file(path, FILE_LIMIT)
    except FileNotFoundError as error:
        raise missing_file(path) from error


PNG_HEAD = b"\x89PNG\r\n\x1a\n"


def _png_complete(data: bytes) -> bool:
    """Return whether all chunks are there and intact (PNG specification, 5.3 "Chunk layout")."""
    view, position = memoryview(data), len(PNG_HEAD)
    while position + 12 <= len(data):
        end = position + 8 + int.from_bytes(view[position : position + 4], "big")
        if zlib.crc32(view[position + 4 : end]) != int.from_bytes(view[end : end + 4], "big"):
            return False
        if data[position + 4 : position + 8] == b"IEND":
            return True
        position = end + 4
    return False


def _png_sizes(data: bytes) -> Iterator[tuple[int, int]]:
    position = len(PNG_HEAD)
    while position + 12 <= len(data):
        (length,) = struct.unpack_from(">I", data, position)
        kind, body = data[position + 4 : position + 8], position + 8
        if kind == b"fcTL":
            body += 4
        if kind in (b"IHDR", b"fcTL") and body + 8 <= len(data):
            yield struct.unpack_from(">II", data, body)
        position += 12 + length


def _jpeg_segments(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield marker and content of the segments before the pixels (ITU-T T.81, annex B)."""
    position = 2
    while position + 4 <= len(data) and data[position] == 0xFF:
        marker, length = struct.unpack_from(">BH", data, position + 1)
        yield marker, data[position + 4 : position + 2 + length]
        if marker == 0xDA or length < 2:
            return
        position += 2 + length


def _jpeg_frames(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield height, width and number of components of each frame header."""
    for marker, content in _jpeg_segments(data):
        if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC) and len(content) >= 6:
            yield struct.unpack_from(">HHB", content, 1)


def _jpeg_sizes(data: bytes) -> Iterator[tuple[int, int]]:
    for height, width, _ in _jpeg_frames(data):
        yield width, height


def _jpeg_loss(data: bytes) -> float:
    """Return the root mean square of the rounding of the coefficients: at most the loss.

    Each coefficient is rounded to a multiple q of its table: q / sqrt(12); the transform keeps the
    sum of squares. The first table is the one of brightness.
    """
    for marker, content in _jpeg_segments(data):
        if marker == 0xDB and content:
            kind = ">u2" if content[0] >> 4 else "u1"
            steps = np.frombuffer(
                content[1:], kind, min(64, len(content[1:]) // np.dtype(kind).itemsize)
            )
            return float(np.sqrt(np.mean(steps.astype(np.float64) ** 2) / 12.0))
    return 0.0


def _bmp_sizes(data: bytes) -> Iterator[tuple[int, int]]:
    if len(data) >= 26:
        width, height = struct.unpack_from("<ii", data, 18)
        yield abs(width), abs(height)


def _bmp_complete(data: bytes) -> bool:
    return len(data) >= 30 and int.from_bytes(data[2:6], "little") <= len(data)


def _webp_sizes(data: bytes) -> Iterator[tuple[int, int]]:
    """Yield the size by the first chunk (RFC 9649, 2)."""
    kind, body = data[12:16], data[20:30]
    if len(body) < 10:
        return
    if kind == b"VP8X":
        yield 1 + int.from_bytes(body[4:7], "little"), 1 + int.from_bytes(body[7:10], "little")
    elif kind == b"VP8L":
        packed = int.from_bytes(body[1:5], "little")
        yield 1 + (packed & 0x3FFF), 1 + (packed >> 14 & 0x3FFF)
    else:
        width, height = struct.unpack_from("<HH", body, 6)
        yield width & 0x3FFF, height & 0x3FFF


WEBP_LOSS = 157.0 / math.sqrt(12.0)
"""Largest loss of a WebP image, because its step is inside its pixels (RFC 6386, 14.1)."""
FORMATS = (
    ImageFormat(
        "PNG",
        (".png",),
        lambda d: d.startswith(PNG_HEAD),
        _png_complete,
        _png_sizes,
        decoded=lambda d, path: opencv.decoded(d, path, indexed=d[25:26] == b"\3"),
    ),
    ImageFormat(
        "TIFF",
        (".tif", ".tiff"),
        lambda d: d.startswith(tiff.HEADS),
        lambda _d: True,
        tiff.sizes,
        decoded=lambda data, path: tiff.decoded(data, path, FILE_LIMIT),
    ),
    ImageFormat(
        "JPEG",
        (".jpg", ".jpeg"),
        lambda d: d.startswith(b"\xff\xd8\xff"),
        lambda d: b"\xff\xd9" in d[-1024:],
        _jpeg_sizes,
        _jpeg_loss,
        lambda d, path: opencv.decoded(d, path, cmyk=any(f[2] == 4 for f in _jpeg_frames(d))),
    ),
    ImageFormat(
        "BMP",
        (".bmp",),
        lambda d: d.startswith(b"BM"),
        _bmp_complete,
        _bmp_sizes,
        decoded=lambda d, path: opencv.decoded(d, path, indexed=d[28] <= 8),
    ),
    ImageFormat(
        "WebP",
        (".webp",),
        lambda d: d[:4] == b"RIFF" and d[8:12] == b"WEBP",
        lambda d: int.from_bytes(d[4:8], "little") + 8 <= len(d),
        _webp_sizes,
        lambda d: 0.0 if b"VP8L" in d[12:64] else WEBP_LOSS,
    ),
)
SUFFIXES = tuple(suffix for form in FORMATS for suffix in form.suffixes)
"""Suffixes of image files."""
STRANGERS = (
    ("GIF", 0, b"GIF8"),
    ("video", 8, b"AVI "),
    ("video", 0, b"\x1a\x45\xdf\xa3"),
    ("HEIC", 4, b"ftypheic"),
    ("AVIF", 4, b"ftypavif"),
    ("video", 4, b"ftyp"),
    ("PDF", 0, b"%PDF"),
    ("ZIP", 0, b"PK\3\4"),
)
"""Name, place and mark of other files that are taken for images."""
