"""Spoilt copies of files: by chance in their bytes, and by a forger who knows their format."""

import hashlib
import io
import json
import random
import re
import struct
import zipfile
import zlib
from collections.abc import Callable

Mutation = Callable[[random.Random, bytes], bytes]

WHOLE = (0, 1, 2, 3, 7, 64, 127, 128, 255, 256, 32767, 65535, 2**20, 2**31 - 1, 2**31, 2**32 - 1)
LONG = (*WHOLE, 2**40, 2**63 - 1, 2**63, 2**64 - 1)
NUMBERS = (
    "0", "-0.0", "-1", "1", "2", "1e-320", "1e15", "1e308", "-1e308", "1e999", "nan", "inf", "NaN",
    "Infinity", "9" * 400, "9" * 5000, "0x" + "f" * 5000, "true", "null", '""', "[]", "{}", "[[1]]",
    "1979-05-27T07:32:00Z", "100000", "65536", "4294967296", "0.5", "3.7",
)  # fmt: skip
TEXTS = (
    "../../escape", "/etc/passwd", "/dev/zero", "C:\\\\con", "a\\u0000b", "\\u001b[2J", "\\ud800",
    "", " ", "x" * 300, "x" * 70_000, "=1+1", "<img src=x>", "{found}", "%s%n", "\\n", "|O", "<f2",
    "(1,", "linear", "ball", "full", "nan",
)  # fmt: skip
_NUMBER = re.compile(r"(?<![\w\"'])-?\d[\w.+-]*")
_TEXT = re.compile(r'"((?:[^"\\\n]|\\.)*)"')


def flipped(rng: random.Random, data: bytes) -> bytes:
    """Return the bytes with a few of them changed."""
    spoilt = bytearray(data or b"\0")
    for _ in range(rng.choice((1, 1, 2, 4, 16))):
        spoilt[rng.randrange(len(spoilt))] ^= 1 << rng.randrange(8)
    return bytes(spoilt)


def cut(rng: random.Random, data: bytes) -> bytes:
    """Return the beginning, or what is left without a part, or with a part twice."""
    a, b = sorted(rng.randrange(len(data) + 1) for _ in range(2))
    return rng.choice((data[:a], data[:a] + data[b:], data[:b] + data[a:], data[a:]))


def numbered(rng: random.Random, data: bytes) -> bytes:
    """Return the bytes with a whole number written somewhere."""
    code = rng.choice(("<I", ">I", "<H", ">H", "<Q"))
    size = struct.calcsize(code)
    if len(data) <= size:
        return flipped(rng, data)
    spoilt = bytearray(data)
    place = rng.randrange(len(data) - size)
    struct.pack_into(code, spoilt, place, rng.choice(LONG) % 256**size)
    return bytes(spoilt)


def retold(rng: random.Random, data: bytes) -> bytes:
    """Return a text with other numbers, words, lines, or depths."""
    text = data.decode("utf-8", "replace")
    for _ in range(rng.choice((1, 1, 2, 5))):
        text = rng.choice((_other_number, _other_text, _other_lines, _deeper))(rng, text)
    return text.encode("utf-8", "replace")


def _put(rng: random.Random, text: str, pattern: re.Pattern[str], new: str) -> str:
    found = list(pattern.finditer(text))
    if not found:
        return text
    one = rng.choice(found)
    return text[: one.start()] + new + text[one.end() :]


def _other_number(rng: random.Random, text: str) -> str:
    return _put(rng, text, _NUMBER, rng.choice(NUMBERS))


def _other_text(rng: random.Random, text: str) -> str:
    new = rng.choice((*TEXTS, *(m.group(1) for m in _TEXT.finditer(text[:5000]))))
    return _put(rng, text, _TEXT, f'"{new}"')


def _other_lines(rng: random.Random, text: str) -> str:
    lines = text.split("\n")
    a, b = rng.randrange(len(lines)), rng.randrange(len(lines))
    match rng.randrange(3):
        case 0:
            lines[a], lines[b] = lines[b], lines[a]
        case 1:
            lines.insert(a, lines[b])
        case _:
            del lines[a]
    return "\n".join(lines)


def _deeper(rng: random.Random, text: str) -> str:
    depth = rng.choice((3, 200, 5000, 50_000))
    new = rng.choice((
        "[" * depth + "]" * depth, '{"a":' * depth + "1" + "}" * depth, "{a=" * depth, "[" * depth
    ))  # fmt: skip
    if rng.random() < 0.3:
        return f"{'a.' * depth}b{rng.choice((' = 1', '#', ']'))}\n{text}"
    return _put(rng, text, _NUMBER, new)


def forged_archive(rng: random.Random, data: bytes) -> bytes:
    """Return a calibration whose parts were changed, with every checksum computed again."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    arrays = [name for name in parts if name.endswith(".npy")]
    if rng.random() < 0.5 and arrays:
        name, other = rng.choice(arrays), rng.choice(arrays)
        parts[name] = rng.choice((
            flipped(rng, parts[name]), cut(rng, parts[name]), _other_head(rng, parts[name]),
            _other_values(rng, parts[name]), parts[other],
        ))  # fmt: skip
    if "manifest.json" in parts:
        _sign(rng, parts, arrays)
    if rng.random() < 0.05:
        parts.pop(rng.choice(list(parts)))
    packing = rng.choice((zipfile.ZIP_DEFLATED,) * 8 + (zipfile.ZIP_STORED, zipfile.ZIP_LZMA))
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", packing, compresslevel=1) as archive:
        for name, part in parts.items():
            archive.writestr(name, part)
    return out.getvalue() if rng.random() < 0.9 else numbered(rng, out.getvalue())


def _sign(rng: random.Random, parts: dict[str, bytes], arrays: list[str]) -> None:
    manifest = json.loads(parts["manifest.json"])
    for name in arrays:
        entry = manifest["arrays"].get(name[:-4])
        if entry is not None:
            entry["sha256"] = hashlib.sha256(parts[name]).hexdigest()
    text = json.dumps(manifest, indent=1).encode()
    if rng.random() < 0.6:
        text = retold(rng, text)
    parts["manifest.json"] = text
    parts["manifest.json.sha256"] = hashlib.sha256(text).hexdigest().encode()


def _other_head(rng: random.Random, part: bytes) -> bytes:
    head = rng.choice((
        "{'descr': '<f4', 'fortran_order': False, 'shape': (100000000000,), }",
        "{'descr': '|O', 'fortran_order': False, 'shape': (3,), }", "{'descr': '<f4', 'shape': (",
        "{'descr': '<f8', 'fortran_order': True, 'shape': (3, 3), }", "(" * 3000, "\t'",
        "{'descr': [('a', '<f4')], 'fortran_order': False, 'shape': (-3,), }", "9" * 5000,
    ))  # fmt: skip
    body = head.ljust(118)[:9000] + "\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(body)) + body.encode() + part[128:]


def _other_values(rng: random.Random, part: bytes) -> bytes:
    value = rng.choice((float("nan"), float("inf"), -1.0, 0.0, 1e300, 1e-300))
    spoilt = bytearray(part)
    struct.pack_into("<d", spoilt, max(128, len(part) - 8 * rng.randrange(1, 9)), value)
    return bytes(spoilt)


def forged_recording(rng: random.Random, data: bytes) -> bytes:
    """Return a recording with other values in the tags or in the description of a page."""
    if rng.random() < 0.4:
        texts = list(re.finditer(rb'\{"[^\0]*\}', data))
        text = rng.choice(texts)
        retold_text = retold(rng, text[0])[: len(text[0])].ljust(len(text[0]))
        return data[: text.start()] + retold_text + data[text.end() :]
    (at,) = struct.unpack_from("<Q", data, 8)
    pages = []
    while at:
        (count,) = struct.unpack_from("<Q", data, at)
        pages.append((at, at + 8 + 20 * count + 8))
        (at,) = struct.unpack_from("<Q", data, at + 8 + 20 * count)
    begin, end = rng.choice(pages)
    spoilt = data[begin:end]
    for _ in range(rng.choice((1, 1, 3))):
        spoilt = numbered(rng, spoilt)
    return data[:begin] + spoilt + data[end:]


def forged_png(rng: random.Random, data: bytes) -> bytes:
    """Return a PNG with another chunk, or with other sizes, whose checksums are right."""
    chunks, place = [], 8
    while place + 12 <= len(data):
        (length,) = struct.unpack_from(">I", data, place)
        chunks.append((data[place + 4 : place + 8], data[place + 8 : place + 8 + length]))
        place += 12 + length
    at = rng.randrange(len(chunks))
    kind, body = chunks[at]
    if rng.random() < 0.3:
        kind = rng.choice((b"acTL", b"fcTL", b"fdAT", b"PLTE", b"tRNS", b"iCCP", b"eXIf", b"zTXt"))
        chunks.insert(at, (kind, bytes(rng.randrange(256) for _ in range(26))))
    elif kind == b"IDAT" and rng.random() < 0.3:
        chunks[at] = kind, zlib.compress(bytes(rng.choice((0, 100, 10**6))), 9)
    elif body:
        chunks[at] = kind, rng.choice((flipped, numbered, cut))(rng, body)
    parts = (
        struct.pack(">I", len(b)) + k + b + struct.pack(">I", zlib.crc32(k + b)) for k, b in chunks
    )
    return data[:8] + b"".join(parts)
