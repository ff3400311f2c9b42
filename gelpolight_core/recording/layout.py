"""The blocks of a recording file, packed and unpacked; see :mod:`.recording` for the format."""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

MAGIC = b"GPLREC\r\n"
FRAME_MAGIC = b"GPLFRAME"
TIFF_HEAD = struct.Struct("<2sHHHQ")
TIFF_LINK_AT = 8
HEAD = struct.Struct("<8sIII4x")
HEAD_AT = TIFF_HEAD.size
CLOSING = struct.Struct("<QqII")
CLOSING_AT = HEAD_AT + HEAD.size
DESCRIPTION_AT = CLOSING_AT + CLOSING.size
DESCRIPTION_LIMIT = 1 << 20
_MARK = struct.Struct("<8sqdQIIII")
_CRC = struct.Struct("<I")
STRIPS_LIMIT = 64
MARK_LIMIT = _MARK.size + STRIPS_LIMIT * 20 + _CRC.size
_SHORT, _LONG, _ASCII, _LONG8 = 3, 4, 2, 16


@dataclass(frozen=True, slots=True)
class Strip:
    """Position of a compressed strip of a frame in the file."""

    offset: int
    size: int
    crc: int


@dataclass(frozen=True, slots=True)
class FrameMark:
    """Header of a frame.

    Attributes
    ----------
    number, time_s : int, float
        As in :class:`~gelpolight_core.recording.recording.RecordedFrame`.
    size : int
        Bytes from this frame mark to the next one.
    rows, columns, bits : int
        Size and bit depth of the image.
    strips : tuple of Strip
        From the top.
    """

    number: int
    time_s: float
    size: int
    rows: int
    columns: int
    bits: int
    strips: tuple[Strip, ...]

    @property
    def rows_per_strip(self) -> int:
        """Rows in every strip except the last one, which may have fewer."""
        return -(-self.rows // len(self.strips))

    def pack(self) -> bytes:
        """Return the bytes of the mark."""
        n = len(self.strips)
        head = _MARK.pack(
            FRAME_MAGIC, self.number, self.time_s, self.size, self.rows, self.columns, self.bits, n
        )
        body = head + struct.pack(
            f"<{2 * n}Q{n}I",
            *(strip.offset for strip in self.strips),
            *(strip.size for strip in self.strips),
            *(strip.crc for strip in self.strips),
        )
        return body + _CRC.pack(zlib.crc32(body))


def padded(size: int) -> int:
    """Return the next multiple of 8."""
    return -(-size // 8) * 8


def _mark_size(strips: int) -> int:
    """Return the bytes of a frame mark."""
    return _MARK.size + 20 * strips + _CRC.size


def unpack_mark(data: bytes) -> FrameMark | None:
    """Return the frame mark at the start of some bytes; None if there is no complete one."""
    if len(data) < _MARK.size or not data.startswith(FRAME_MAGIC):
        return None
    _, number, time_s, size, rows, columns, bits, n = _MARK.unpack_from(data)
    end = _mark_size(n) - _CRC.size
    if not 1 <= n <= STRIPS_LIMIT or len(data) < end + _CRC.size:
        return None
    if _CRC.unpack_from(data, end)[0] != zlib.crc32(data[:end]):
        return None
    table = struct.unpack_from(f"<{2 * n}Q{n}I", data, _MARK.size)
    strips = map(Strip, table[:n], table[n : 2 * n], table[2 * n :])
    return FrameMark(number, time_s, size, rows, columns, bits, tuple(strips))


def pack_head(version: int, content: dict[str, Any]) -> bytes:
    """Return everything before the first frame."""
    text = json.dumps(content, ensure_ascii=False, allow_nan=False).encode()
    crc = zlib.crc32(struct.pack("<II", version, len(text)) + text)
    head = TIFF_HEAD.pack(b"II", 43, 8, 0, 0) + HEAD.pack(MAGIC, version, len(text), crc)
    data = head + bytes(CLOSING.size) + text
    return data.ljust(padded(len(data)), b"\0")


def pack_closing(frames: int, last_number: int) -> bytes:
    """Return the closing mark."""
    body = struct.pack("<QqI", frames, last_number, 1)
    return body + _CRC.pack(zlib.crc32(body))


def unpack_closing(data: bytes) -> tuple[int, int] | None:
    """Return the frame count and the last number received; None if the file was not closed."""
    frames, last_number, closed, crc = CLOSING.unpack(data)
    if closed != 1 or crc != zlib.crc32(data[: -_CRC.size]):
        return None
    return frames, last_number


@dataclass(frozen=True, slots=True)
class FrameBlock:
    """A frame as stored in the file.

    Attributes
    ----------
    data : bytes
        All of its bytes.
    directory_at, link_at : int
        Positions in the file of its TIFF directory, and of that directory's link to the next.
    """

    data: bytes
    directory_at: int
    link_at: int


def pack_frame(
    strips: Sequence[bytes],
    *,
    number: int,
    time_s: float,
    shape: tuple[int, int],
    bits: int,
    offset: int,
) -> FrameBlock:
    """Return a frame's bytes.

    Parameters
    ----------
    strips : sequence of bytes
        Compressed strips, from the top.
    number, time_s, shape, bits
        Properties of the frame; `shape` is (rows, columns).
    offset : int
        Start position in the file.
    """
    text = json.dumps({"number": number, "time_s": time_s}).encode() + b"\0"
    directory_at = offset + padded(_mark_size(len(strips)))
    text_at = directory_at + _DIRECTORY_SIZE
    offsets = [text_at + padded(len(text))]
    for strip in strips:
        offsets.append(offsets[-1] + padded(len(strip)))
    mark = FrameMark(
        number,
        time_s,
        offsets[-1] - offset,
        *shape,
        bits,
        tuple(Strip(p, len(s), zlib.crc32(s)) for p, s in zip(offsets, strips, strict=False)),
    )
    directory = _directory(mark, offset, (len(text), text_at))
    blocks = (mark.pack(), directory, text, *strips)
    data = b"".join(block.ljust(padded(len(block)), b"\0") for block in blocks)
    return FrameBlock(data, directory_at, directory_at + 8 + 20 * _ENTRIES)


_ENTRIES = 12
_DIRECTORY_SIZE = padded(8 + 20 * _ENTRIES + 8)


def _directory(mark: FrameMark, offset: int, text: tuple[int, int]) -> bytes:
    """Return the TIFF directory of a frame, not yet linked to the next one."""
    n = len(mark.strips)
    tables_at = offset + _MARK.size
    bits = int.from_bytes(struct.pack("<3H", *(mark.bits,) * 3), "little")
    entries = (
        (256, _LONG, 1, mark.columns),
        (257, _LONG, 1, mark.rows),
        (258, _SHORT, 3, bits),
        (259, _SHORT, 1, 8),  # Deflate
        (262, _SHORT, 1, 2),  # RGB
        (270, _ASCII, *text),
        (273, _LONG8, n, tables_at if n > 1 else mark.strips[0].offset),
        (277, _SHORT, 1, 3),
        (278, _LONG, 1, mark.rows_per_strip),
        (279, _LONG8, n, tables_at + 8 * n if n > 1 else mark.strips[0].size),
        (284, _SHORT, 1, 1),  # red, green and blue interleaved
        (317, _SHORT, 1, 2),  # horizontal differences
    )
    packed = b"".join(struct.pack("<HHQQ", *entry) for entry in entries)
    return struct.pack("<Q", len(entries)) + packed + bytes(8)
