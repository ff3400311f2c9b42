"""Whether a picture file is what it says and whole, before a decoder makes what it can of it."""

from __future__ import annotations

import zlib

PNG_HEAD = b"\x89PNG\r\n\x1a\n"
TIFF_HEADS = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")


def is_whole_picture(data: bytes) -> bool:
    """Return whether the bytes are a PNG whose every chunk is as it was written, or a TIFF.

    Other kinds, JPEG among them, are lossy or not linear and may not pass under another name.
    TIFF has no checksums; what a decoder finds missing in one is for it to say.

    References
    ----------
    PNG specification (third edition), 5.3 "Chunk layout".
    """
    if data.startswith(TIFF_HEADS):
        return True
    if not data.startswith(PNG_HEAD):
        return False
    view, place = memoryview(data), len(PNG_HEAD)
    while place + 12 <= len(data):
        end = place + 8 + int.from_bytes(view[place : place + 4], "big")
        if zlib.crc32(view[place + 4 : end]) != int.from_bytes(view[end : end + 4], "big"):
            return False
        if data[place + 4 : place + 8] == b"IEND":
            return True
        place = end + 4
    return False
