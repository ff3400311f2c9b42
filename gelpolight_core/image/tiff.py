"""TIFF images, decoded by tifffile: the first page, beside which there are only small copies.

OpenCV decodes what tifffile needs other packages for. OpenCV 5.0.0.93 mixes up separate planes of
16 bit without an error.
"""

from __future__ import annotations

import io
import logging
import math
import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.image import opencv

if TYPE_CHECKING:
    from tifffile import TiffPage

HEADS = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
# What it finds wrong in a file is reported once, by the refusal.
logging.getLogger("tifffile").setLevel(logging.CRITICAL)
_UNCOMPRESSED, _DEFLATE = 1, (8, 32946)
_WHITE_IS_ZERO, _BLACK_IS_ZERO, _RGB, _PALETTE, _CMYK, _MOSAIC = 0, 1, 2, 3, 5, 32803
_DEFLATE_RATIO = 1032
"""Most bytes that one byte of Deflate stands for (zlib, "Maximum Compression Factor")."""
_ORIENTATION, _TOGETHER = 274, 1
_SURPRISES = LookupError, TypeError, AttributeError, ArithmeticError, RuntimeError, OSError
_DAMAGE = (*_SURPRISES, struct.error, zlib.error)
"""What tifffile raises for damaged files, beside ValueError and its own error."""


@contextmanager
def _first_page(data: bytes) -> Iterator[TiffPage]:
    """Open the first page, with ValueError for any damage of the file."""
    import tifffile

    try:
        with tifffile.TiffFile(io.BytesIO(data)) as file:
            page = file.pages.first
            if not isinstance(page, tifffile.TiffPage):
                raise ValueError("no page")
            yield page
    except (*_DAMAGE, tifffile.TiffFileError) as error:
        raise ValueError(str(error)) from error


def sizes(data: bytes) -> Iterator[tuple[int, int]]:
    """Yield the sizes of the page and of its tiles, wider for more than four samples."""
    try:
        with _first_page(data) as page:
            wider = -(-int(page.samplesperpixel) // 4)
            page_size = wider * int(page.imagewidth), int(page.imagelength) * int(page.imagedepth)
            tile_size = wider * int(page.tilewidth), int(page.tilelength) * int(page.tiledepth)
    except ValueError:
        return  # reported when it is decoded
    yield page_size
    yield tile_size


def decoded(data: bytes, path: Path, most_bytes: int) -> NDArray[Any]:
    """Return the first page as (rows, columns) grey or (rows, columns, 3) RGB values, not turned.

    Parameters
    ----------
    data : bytes
        Content of the file, whose :func:`sizes` have been judged.
    path : Path
        Named in a refusal.
    most_bytes : int
        What a part of an image may need when it is unpacked.

    Raises
    ------
    ValueError
        If the file is damaged.
    InputError
        If nothing here reads its form or colours, or it contains several images.
    """
    with _first_page(data) as page:
        _refuse_several(page, path)
        _refuse_missing(page, data, most_bytes)
        kind, samples = page.dtype, page.samplesperpixel
        separate = samples > 1 and page.planarconfig != _TOGETHER
        if kind in (bool, np.uint8, np.uint16) and samples <= 4:
            if _is_plain(page):
                whole = page.asarray(squeeze=False, maxworkers=1)
                values = np.moveaxis(whole[:, 0, :, :, 0], 0, -1) if separate else whole[0, 0]
                if page.photometric == _WHITE_IS_ZERO:
                    values = ~values
                return np.ascontiguousarray(values[..., :3] if samples > 2 else values[..., 0])
            if kind != np.uint16 or not separate:
                indexed, cmyk = (page.photometric == form for form in (_PALETTE, _CMYK))
                return opencv.decoded(_upright(data, page), path, indexed=indexed, cmyk=cmyk)
        form = " ".join(getattr(t, "name", str(t)) for t in (page.compression, page.planarconfig))
        text = f"The image contains {samples} x {form} {kind} values"
        raise InputError(text, path, Remedy.PNG)


def _is_plain(page: TiffPage) -> bool:
    """Return whether tifffile decodes a page of whole bytes without further packages."""
    return (
        page.bitspersample in (8, 16)
        and page.compression in (_UNCOMPRESSED, *_DEFLATE)
        and page.photometric in (_WHITE_IS_ZERO, _BLACK_IS_ZERO, _RGB, _MOSAIC)
        and page.fillorder == 1
    )


def _refuse_several(first: TiffPage, path: Path) -> None:
    """Refuse further images in a file. Reduced copies of the first one and masks are none."""
    others = (page.aspage() for page in first.parent.pages if page.index != first.index)
    count = int(first.imagedepth) + sum(not (page.is_reduced or page.is_mask) for page in others)
    if count > 1:
        raise InputError(f"The file contains {count} images", path, Remedy.SEPARATE_IMAGES)


def _refuse_missing(page: TiffPage, data: bytes, most_bytes: int) -> None:
    """Refuse a page that lacks strips or tiles, which tifffile leaves black, or one too large."""
    strips = list(zip(page.dataoffsets, page.databytecounts, strict=False))
    if len(strips) < math.prod(page.chunked):
        raise ValueError("strips are missing")
    for offset, count in strips:
        if not (0 < offset and 0 < count and offset + count <= len(data)):
            raise ValueError("a strip is missing")
        if page.compression in _DEFLATE and _DEFLATE_RATIO * count > most_bytes:
            unpacking = zlib.decompressobj()
            unpacking.decompress(data[offset : offset + count], most_bytes)
            if unpacking.unconsumed_tail:
                raise ValueError("a strip is too large")


def _upright(data: bytes, page: TiffPage) -> bytes:
    """Return a file that OpenCV does not turn."""
    if (tag := page.tags.get(_ORIENTATION)) is None:
        return data
    size = tag.valuebytecount
    one = (1).to_bytes(size, "little" if data[:2] == b"II" else "big")
    return data[: tag.valueoffset] + one + data[tag.valueoffset + size :]
