"""Read a recording: random access to frames, with checks (format: :mod:`.recording_format`)."""

from __future__ import annotations

import math
import os
import struct
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from isal import isal_zlib
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float64Array, PixelArray
from gelpolight_core.base.closable import Closable
from gelpolight_core.base.compiling import whole
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.safe_reading import (
    cannot_read,
    check_version,
    missing_file,
    open_file,
    parse_json,
    refuse_newer,
)
from gelpolight_core.image.image_file import MAX_PIXELS

from .recording_format import FORMAT, LAST, VERSION, RecordedFrame, RecordingHeader


@whole()
def undo_differences(differences, rgb):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Undo the differences to the left neighbour, modulo the range of the values."""
    for row in range(rgb.shape[0]):
        red, green, blue = differences[row, 0]
        for column in range(rgb.shape[1]):
            if column > 0:
                red += differences[row, column, 0]
                green += differences[row, column, 1]
                blue += differences[row, column, 2]
            rgb[row, column, 0], rgb[row, column, 1], rgb[row, column, 2] = red, green, blue


HEAD = struct.Struct("<4s4xQ")
BIG_TIFF = b"II+\0"
# Version 1: a head of its own behind that of TIFF, and the description of the recording.
HEAD_1 = struct.Struct("<8sIII4xQqII")
MAGIC_1 = b"GPLREC\r\n"
ENTRY = struct.Struct("<HHQ8s")
KINDS = {2: "s", 3: "H", 4: "I", 16: "Q"}
"""Types of TIFF values, as of :mod:`struct`."""
COLUMNS, ROWS, BITS, PACKED, DESCRIPTION = 256, 257, 258, 259, 270
OFFSETS, STRIP_ROWS, SIZES, PREDICTOR = 273, 278, 279, 317
MOST_ENTRIES = 64
VALUE_LIMIT = 1 << 20


@dataclass(frozen=True, slots=True)
class Page:
    """Place of a frame in the file, with its description.

    Attributes
    ----------
    kind : tuple of int
        Rows, columns and bits of its image.
    strip_rows : int
        Rows in every strip except the last one, which may have fewer.
    strips : tuple of (int, int)
        Position and bytes of each strip, from the top.
    content : dict
        Its description: number, time_s, and those of the recording on the first page.
    """

    kind: tuple[int, int, int]
    strip_rows: int
    strips: tuple[tuple[int, int], ...]
    content: dict[str, Any]

    @property
    def number(self) -> int:
        """Frame number counted by the source."""
        return int(self.content["number"])


class Recording(Closable):
    """A recording file, open for reading by any thread.

    Attributes
    ----------
    path : Path
        The file.
    header : RecordingHeader
        Description of the recording.
    numbers : (N,) int64
        Frame number counted by the source.
    times_s : (N,) float64
        Time of each frame, on the source's clock.
    size : (int, int)
        Width and height in pixels; (0, 0) without frames.
    bits : int
        8 or 16; 0 without frames.
    lost : int
        Number of missing frames between the first and the last.
    truncated : bool
        Whether the end is missing or a part cannot be read, because the file is truncated or
        damaged or the recording program was stopped.
    """

    def __init__(self, path: Path, file: int) -> None:
        self.path = path
        self._file: int | None = file
        self._pages, damaged = _readable_pages(file)
        self.header, last = _read_header(path, file, self._pages)
        self.numbers: NDArray[np.int64] = np.array([p.number for p in self._pages], np.int64)
        self.times_s: Float64Array = np.array([p.content["time_s"] for p in self._pages])
        rows, columns, self.bits = self._pages[0].kind if self._pages else (0, 0, 0)
        self.size = (columns, rows)
        self.truncated = damaged or last is None
        frames = 0
        if self._pages:
            frames = max(last or 0, self._pages[-1].number) - self._pages[0].number + 1
        self.lost = frames - len(self._pages)

    @classmethod
    def open(cls, path: Path) -> Recording:
        """Open a recording.

        Raises
        ------
        InputError
            If the file does not exist, is not a recording, has a newer version, or its first frame
            is damaged.
        """
        try:
            with open_file(path) as stream:
                file = os.dup(stream.fileno())
        except FileNotFoundError as error:
            raise missing_file(path) from error
        try:
            return cls(path, file)
        except OSError as error:
            os.close(file)
            raise cannot_read(error, path) from error
        except BaseException:
            os.close(file)
            raise

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self._pages)

    @property
    def duration_s(self) -> float:
        """Time from the first frame to the last."""
        return float(self.times_s[-1] - self.times_s[0]) if len(self) else 0.0

    def frame(self, index: int) -> RecordedFrame:
        """Return a frame exactly as written.

        Raises
        ------
        InputError
            If it is damaged or cannot be read.
        IndexError
            If the index is out of range.
        """
        if self._file is None:
            raise ValueError("the recording is closed")
        if not 0 <= index < len(self):
            raise IndexError(f"frame {index} of {len(self)}")
        page = self._pages[index]
        rows, columns, bits = page.kind
        shape = (rows, columns, 3)
        rgb: PixelArray = np.empty(shape, np.uint8) if bits == 8 else np.empty(shape, np.uint16)
        for k, (offset, size) in enumerate(page.strips):
            try:
                data = os.pread(self._file, size, offset)
            except OSError as error:
                raise cannot_read(error, self.path) from error
            if not _unpack(data, rgb[k * page.strip_rows : (k + 1) * page.strip_rows]):
                raise InputError(f"Frame {index} is damaged", self.path, Remedy.COPY_AGAIN)
        return RecordedFrame(rgb, page.number, float(page.content["time_s"]))

    def close(self) -> None:
        """Close the file, also repeatedly."""
        if self._file is not None:
            os.close(self._file)
            self._file = None


def is_recording(path: Path) -> bool:
    """Return whether a file starts like a recording, whatever its name and state."""
    try:
        with open_file(path) as stream:
            head = stream.read(4096)
    except (OSError, InputError):
        return False
    return head.startswith(BIG_TIFF) and f'"{FORMAT}"'.encode() in head


def _unpack(data: bytes, rgb: PixelArray) -> bool:
    """Fill the rows of a strip and return whether the data contained exactly these rows.

    Parameters
    ----------
    data : bytes
        Compressed, with a checksum.
    rgb : (rows, columns, 3) uint8 or uint16
        Output array; contiguous.
    """
    unpacker = isal_zlib.decompressobj()
    try:
        content = unpacker.decompress(data, rgb.nbytes + 1)
    except isal_zlib.error:  # type: ignore[misc]  # an instance in its stub, but really a class
        return False
    if len(content) != rgb.nbytes or not unpacker.eof or unpacker.unused_data:
        return False
    undo_differences(np.frombuffer(content, rgb.dtype).reshape(rgb.shape), rgb)
    return True


def _read_header(path: Path, file: int, pages: list[Page]) -> tuple[RecordingHeader, int | None]:
    """Return the description of the recording with its last frame number, if it was closed."""
    head = os.pread(file, HEAD.size + HEAD_1.size, 0)
    with suppress(ValueError, struct.error):
        mark, link = HEAD.unpack_from(head)
        if head[HEAD.size :].startswith(MAGIC_1):
            _, version, length, _, frames, last, closed, _ = HEAD_1.unpack_from(head, HEAD.size)
            refuse_newer(version, 1, path)
            text = os.pread(file, min(length, VALUE_LIMIT), len(head))
            header = RecordingHeader.from_json(parse_json(text))
            return header, last if closed and frames == len(pages) else None
        if pages:
            check_version(pages[0].content, FORMAT, VERSION, path)
            end = pages[-1].content.get(LAST)
            return RecordingHeader.from_json(pages[0].content), end if type(end) is int else None
        if (mark, link) == (BIG_TIFF, 0):  # closed before its first frame
            return RecordingHeader(started="", program=""), 0
    fault = "The file is not a recording, or its beginning is damaged"
    raise InputError(fault, path, Remedy.CHOOSE_FILE)


def _readable_pages(file: int) -> tuple[list[Page], bool]:
    """Return the pages of all complete frames in order, with True if others are damaged."""
    size = os.fstat(file).st_size
    pages: list[Page] = []
    damaged = False
    for values in _directories(file):
        page = None
        with suppress(ValueError, LookupError, TypeError, ArithmeticError, AttributeError):
            page = _page(values or {}, size)
        if page is None or (
            pages and (page.kind != pages[0].kind or page.number <= pages[-1].number)
        ):
            damaged = True
        else:
            pages.append(page)
    return pages, damaged


def _directories(file: int) -> Iterator[dict[int, tuple[Any, ...]] | None]:
    """Yield the values of each page of a TIFF file by their tags, None where the chain breaks.

    Pages follow each other in the file, as every writer of recordings appended them.
    """
    position, link = 0, os.pread(file, 8, 8)
    while len(link) == 8 and (place := int.from_bytes(link, "little")):
        head = _part(file, place, 8 + MOST_ENTRIES * ENTRY.size + 8) if place > position else b""
        count = int.from_bytes(head[:8], "little")
        end = 8 + ENTRY.size * count
        if not 0 < count <= MOST_ENTRIES or len(head) < end + 8:
            yield None
            return
        yield dict(_values(file, head[8:end]))
        position, link = place, head[end : end + 8]


def _values(file: int, entries: bytes) -> Iterator[tuple[int, tuple[Any, ...]]]:
    """Yield the tags of a page with their values, where those have one of our types."""
    for tag, kind, count, value in ENTRY.iter_unpack(entries):
        form = f"<{count}{KINDS[kind]}" if kind in KINDS and count < VALUE_LIMIT else ""
        size = struct.calcsize(form) if form else VALUE_LIMIT
        if size > 8:
            value = _part(file, int.from_bytes(value, "little"), size) if form else b""
        if form and len(value) >= size:
            yield tag, struct.unpack(form, value[:size])


def _part(file: int, at: int, size: int) -> bytes:
    """Return bytes of the file, fewer at its end."""
    # Not memory-mapped: if the file shrank meanwhile, the program would crash.
    return os.pread(file, size, at) if at < 1 << 63 else b""


def _page(values: dict[int, tuple[Any, ...]], size: int) -> Page | None:
    """Return a page, or None or an error of wrong values if it is not plausible."""
    (rows,), (columns,), bits = values[ROWS], values[COLUMNS], set(values[BITS])
    numbers = rows, columns, *bits, *values[STRIP_ROWS], *values[OFFSETS], *values[SIZES]
    if {type(number) for number in numbers} != {int}:
        return None
    (strip_rows,), strips = values[STRIP_ROWS], zip(values[OFFSETS], values[SIZES], strict=True)
    content = parse_json(values[DESCRIPTION][0].rstrip(b"\0"))
    page = Page((rows, columns, *bits), strip_rows, tuple(strips), content)
    # The last strip may be shorter; an incompressible strip is slightly larger than its data.
    plain = strip_rows * columns * 3 * max(bits) // 8
    plausible = (
        (values[PACKED], values[PREDICTOR]) == ((8,), (2,))
        and bits in ({8}, {16})
        and 0 < rows * columns <= MAX_PIXELS
        and 0 < strip_rows <= rows
        and len(page.strips) == -(-rows // strip_rows)
        and all(at + n <= size and n <= plain + plain // 8 + 4096 for at, n in page.strips)
        and type(content["number"]) is int
        and 0 <= page.number < 1 << 63
        and math.isfinite(content["time_s"])
    )
    return page if plausible else None
