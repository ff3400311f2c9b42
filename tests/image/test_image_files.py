"""Image files of every format are read as they are, or refused by what they are."""

import base64
import io
import struct
import zlib
from typing import Any

import cv2
import numpy as np
import pytest
import tifffile
from hypothesis import given
from hypothesis import strategies as st

from gelpolight_core.base.errors import InputError
from gelpolight_core.calibration.image_checks import judge_image_files
from gelpolight_core.image.image_file import FORMATS, SUFFIXES, files_in, format_of, names_of
from gelpolight_core.image.tiff import decoded as tiff_decoded
from gelpolight_core.session.session import SensorData, Session
from gelpolight_core.session.session_images import read_linear_image, read_raw_image


def encoded(ending: str, *options: int) -> bytes:
    """Return a smooth image of 24 x 40 pixels in a format: red grows to the right, green down."""
    y, x = np.mgrid[:24, :40]
    rgb = np.stack([40 + 4 * x, 30 + 6 * y, 90 + 0 * x], axis=-1).astype(np.uint8)
    return bytes(cv2.imencode(ending, rgb[..., ::-1], list(options))[1])


@pytest.mark.function("Read PNG, TIFF, BMP, JPEG and WebP images, and be told what was not read")
@pytest.mark.parametrize(
    ("ending", "options", "name", "lossy"),
    [
        (".png", (), "PNG", False),
        (".tiff", (), "TIFF", False),
        (".bmp", (), "BMP", False),
        (".jpg", (cv2.IMWRITE_JPEG_QUALITY, 95), "JPEG", True),
        (".webp", (cv2.IMWRITE_WEBP_QUALITY, 101), "WebP", False),
        (".webp", (cv2.IMWRITE_WEBP_QUALITY, 90), "WebP", True),
    ],
)
def test_an_image_is_read_by_its_content_whatever_its_name(tmp_path, ending, options, name, lossy):
    data = encoded(ending, *options)
    form = format_of(data)
    assert form.name == name
    assert (40, 24) in set(form.sizes(data))
    assert (form.loss(data) > 0.0) is lossy
    path = tmp_path / "image.png"
    path.write_bytes(data)
    raw = read_raw_image(path)
    assert raw.rgb.shape == (24, 40, 3)
    error = np.abs(raw.rgb[12, 5:35, 0] - (40.0 + 4.0 * np.arange(5, 35))).max()
    assert error <= (6 if lossy else 0)
    assert read_linear_image(path).loss == form.loss(data)
    path.write_bytes(data[: len(data) // 2])
    with pytest.raises(InputError, match=rf"{name} image is not complete"):
        read_raw_image(path)


def test_the_loss_of_a_jpeg_grows_with_its_rounding():
    (jpeg,) = (form for form in FORMATS if form.name == "JPEG")
    losses = [jpeg.loss(encoded(".jpg", cv2.IMWRITE_JPEG_QUALITY, q)) for q in (100, 95, 90, 50)]
    assert losses[0] == pytest.approx(1.0 / np.sqrt(12.0))
    assert losses == sorted(losses)


@pytest.mark.parametrize("orientation", [3, 6, 8])
def test_no_image_is_turned(tmp_path, orientation):
    """Neither by the tag of a TIFF nor by the Exif data of a JPEG."""
    turned = bytearray(encoded(".tiff"))
    (place,) = struct.unpack_from("<I", turned, 4)
    entries = [
        turned[at : at + 12]
        for at in range(place + 2, place + 2 + 12 * turned[place], 12)
        if struct.unpack_from("<H", turned, at)[0] != 274
    ]
    entries.append(bytearray(struct.pack("<HHIHH", 274, 3, 1, orientation, 0)))
    entries.sort(key=lambda entry: struct.unpack_from("<H", entry)[0])
    turned[4:8] = struct.pack("<I", len(turned))
    turned += struct.pack("<H", len(entries)) + b"".join(entries) + bytes(4)
    body = b"Exif\0\0II*\0" + struct.pack("<IHHHIHHI", 8, 1, 274, 3, 1, orientation, 0, 0)
    jpeg = encoded(".jpg")
    jpeg = jpeg[:2] + b"\xff\xe1" + struct.pack(">H", len(body) + 2) + body + jpeg[2:]
    for name, data in (("a.tif", bytes(turned)), ("a.jpg", jpeg)):
        (tmp_path / name).write_bytes(data)
        rgb = read_raw_image(tmp_path / name).rgb
        assert rgb.shape == (24, 40, 3)
        assert int(rgb[3, 35, 0]) > int(rgb[3, 5, 0]) + 60
        assert int(rgb[20, 3, 1]) > int(rgb[3, 3, 1]) + 60


def tiff(
    values: np.ndarray,
    *,
    together: bool = True,
    order: str = "<",
    types: tuple[int, ...] = (0,),
    **options: Any,
) -> bytes:
    """Return a TIFF of values (rows, columns, channels); further pages are upside down.

    `types` has the NewSubfileType of each page: 1 is a reduced copy, 2 one page of several.
    """
    planes = values if together else np.moveaxis(values, 2, 0)
    planes = planes if values.shape[2] > 1 else values[..., 0]
    colour = "rgb" if values.shape[2] >= 3 else "minisblack"
    form = {"planarconfig": "contig" if together else "separate"} if values.shape[2] > 1 else {}
    file = io.BytesIO()
    with tifffile.TiffWriter(file, byteorder=order) as out:
        for page, kind in enumerate(types):
            image = planes[:: -1 if page else 1]
            out.write(image, photometric=colour, metadata=None, subfiletype=kind, **form, **options)
    return file.getvalue()


@given(
    kind=st.sampled_from([np.uint8, np.uint16]),
    shape=st.tuples(st.integers(2, 40), st.integers(2, 40), st.integers(1, 4)),
    together=st.booleans(),
    order=st.sampled_from("<>"),
    packed=st.sampled_from([{}, {"compression": "zlib"}, {"compression": "zlib", "predictor": 2}]),
    parts=st.sampled_from([{}, {"rowsperstrip": 3}, {"tile": (16, 32)}]),
    orientation=st.integers(1, 8),
)
def test_a_tiff_of_every_form_has_the_values_of_its_first_page(
    tmp_path_factory, kind, shape, together, order, packed, parts, orientation
):
    values = np.random.default_rng(0).integers(0, np.iinfo(kind).max, shape, kind, endpoint=True)
    turned = [(274, 3, 1, orientation, True)]
    path = tmp_path_factory.getbasetemp() / "form.tif"
    data = tiff(
        values, together=together, types=(0, 1), order=order, extratags=turned, **packed, **parts
    )
    path.write_bytes(data)
    raw = read_raw_image(path)
    assert raw.grey is (values.shape[2] < 3)
    assert raw.rgb.dtype == values.dtype
    assert np.array_equal(
        raw.rgb, np.repeat(values[..., :1], 3, 2) if raw.grey else values[..., :3]
    )
    path.write_bytes(data[: len(data) // 3])
    with pytest.raises(InputError, match="TIFF image is not complete"):
        read_raw_image(path)


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
@pytest.mark.parametrize("way", [1, 5, 8, 32773])
def test_a_tiff_of_every_common_compression_is_read(tmp_path, kind, way):
    """Without packages that tifffile would need for LZW."""
    values = np.random.default_rng(0).integers(0, 256, (9, 13, 3)).astype(kind)
    path = tmp_path / "image.tif"
    cv2.imwrite(str(path), values[..., ::-1], [cv2.IMWRITE_TIFF_COMPRESSION, way])
    assert np.array_equal(read_raw_image(path).rgb, values)


def with_tag(data: bytes, tag: int, value: int) -> bytes:
    """Return a TIFF with another value of a tag."""
    with tifffile.TiffFile(io.BytesIO(data)) as file:
        place = file.pages.first.tags[tag].valueoffset
    return data[:place] + struct.pack("<H", value) + data[place + 2 :]


VALUES = np.random.default_rng(0).integers(0, 256, (9, 13, 5))
WHITE_IS_ZERO = with_tag(tiff(VALUES[..., :1].astype(np.uint16)), 262, 0)


def test_a_tiff_that_counts_from_white_is_inverted(tmp_path):
    (tmp_path / "i.tif").write_bytes(WHITE_IS_ZERO)
    assert np.array_equal(read_raw_image(tmp_path / "i.tif").rgb[..., 0], 65535 - VALUES[..., 0])


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (tiff(VALUES[..., :3].astype(np.float32)), "float32 values"),
        (tiff(VALUES[..., :1].astype(np.int16)), "int16 values"),
        (tiff(VALUES.astype(np.uint8)), "5 x NONE CONTIG uint8 values"),
        (
            with_tag(tiff(VALUES[..., :3].astype(np.uint16), together=False), 259, 5),
            "LZW SEPARATE uint16 values",
        ),
    ],
)
def test_a_tiff_of_another_form_is_refused_by_its_form(tmp_path, data, reason):
    (tmp_path / "i.tif").write_bytes(data)
    with pytest.raises(InputError, match=reason):
        read_raw_image(tmp_path / "i.tif")


def indexed_png(palette: np.ndarray, index: np.ndarray, colour_type: int = 3) -> bytes:
    """Return a PNG with a palette (colours, 3); of colour type 2 it is only a suggestion."""
    rows = np.pad(index.reshape(len(index), -1), ((0, 0), (1, 0)))  # before each: no filter
    head = struct.pack(">IIBBBBB", index.shape[1], index.shape[0], 8, colour_type, 0, 0, 0)
    packed = zlib.compress(rows.astype(np.uint8).tobytes())
    data = b"\x89PNG\r\n\x1a\n"
    for kind, body in (
        (b"IHDR", head),
        (b"PLTE", palette.astype(np.uint8).tobytes()),
        (b"IDAT", packed),
        (b"IEND", b""),
    ):
        data += struct.pack(">I", len(body)) + kind + body
        data += struct.pack(">I", zlib.crc32(kind + body))
    return data


def indexed_bmp(palette: np.ndarray, index: np.ndarray) -> bytes:
    """Return a BMP with a palette (colours, 3), of a width that is a multiple of 4."""
    colours = np.pad(palette[:, ::-1], ((0, 0), (0, 1))).astype(np.uint8).tobytes()
    start = 54 + len(colours)
    head = struct.pack("<2sIII", b"BM", start + index.size, 0, start)
    rows, columns = index.shape
    info = struct.pack("<IiiHHIIiiII", 40, columns, rows, 1, 8, 0, 0, 0, 0, len(palette), 0)
    return head + info + colours + index[::-1].astype(np.uint8).tobytes()


def indexed_tiff(palette: np.ndarray, index: np.ndarray) -> bytes:
    """Return a TIFF with a palette (256, 3)."""
    file = io.BytesIO()
    colours = 257 * palette.T.astype(np.uint16)
    tifffile.imwrite(file, index.astype(np.uint8), photometric="palette", colormap=colours)
    return file.getvalue()


INDEX = np.random.default_rng(0).integers(0, 256, (9, 12))
RAMP = np.stack([np.arange(256), np.arange(256) // 2, 255 - np.arange(256)], axis=-1)
CMYK_JPEG = base64.b85decode(  # 8 x 16 pixels, written by Pillow 13.0 with optimize=True
    "|JeWT01iQ9Z(?NtWB>pF0095n07C!}3k(hn3J?wr4iXU%6BsBO7#0>7F(V}%C^|DeJUKHsH$X^SPC!IgMK?H5ZBbWWVr"
    "OV)K233XaAbH~WoKjmzyK5o00;mO1Va%3O%VWD5dcdO0RO}Q82|tR0|5X40000000000000050|W*K|HJ?p5CH%J0{{R3"
    "0000000000000666+vSE+5ip&LjX+xSpZ7_06zdnLrORv3*#3+X((u5cu5$C|Je"
)


@pytest.mark.function("Be told that another program changed the colours of an image")
@pytest.mark.parametrize("indexed", [indexed_png, indexed_bmp, indexed_tiff])
def test_an_image_with_a_palette_is_refused_unless_it_is_grey(tmp_path, indexed):
    path = tmp_path / "image"
    path.write_bytes(indexed(RAMP, INDEX))
    with pytest.raises(
        InputError,
        match=r"has a palette of at most 256 colours, .* rounded\. Save the original .* in RGB",
    ):
        read_raw_image(path)
    path.write_bytes(indexed(np.repeat(RAMP[:, 2:], 3, 1), INDEX))
    assert np.array_equal(read_raw_image(path).rgb, np.repeat(255 - INDEX[..., None], 3, 2))


def test_a_palette_of_a_few_colours_is_refused_and_one_that_is_only_suggested_is_not(tmp_path):
    for name, data in (
        ("i.png", indexed_png(RAMP[:200], INDEX % 200)),
        ("i.bmp", indexed_bmp(RAMP[:200], INDEX % 200)),
    ):
        (tmp_path / name).write_bytes(data)
        with pytest.raises(InputError, match="has a palette"):
            read_raw_image(tmp_path / name)
    (tmp_path / "i.png").write_bytes(indexed_png(RAMP, RAMP[INDEX], colour_type=2))
    assert np.array_equal(read_raw_image(tmp_path / "i.png").rgb, RAMP[INDEX])


def test_a_png_without_a_header_is_not_complete(tmp_path):
    (tmp_path / "i.png").write_bytes(encoded(".png")[:8] + encoded(".png")[-12:])
    with pytest.raises(InputError, match="PNG image is not complete"):
        read_raw_image(tmp_path / "i.png")


def test_an_image_in_the_colours_of_a_printer_is_refused(tmp_path):
    file = io.BytesIO()
    inks = VALUES[..., :4].astype(np.uint8)
    tifffile.imwrite(file, inks, photometric="separated", planarconfig="contig")
    for name, data in (("i.jpg", CMYK_JPEG), ("i.tif", file.getvalue())):
        (tmp_path / name).write_bytes(data)
        with pytest.raises(InputError, match=r"printer \(CMYK\).*Save the original .* in RGB"):
            read_raw_image(tmp_path / name)


@pytest.mark.parametrize("ending", [".png", ".tiff"])
@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
@pytest.mark.parametrize("channels", [1, 3])
def test_grey_and_colour_images_of_8_and_16_bit_keep_their_values(tmp_path, ending, kind, channels):
    values = (VALUES[..., :channels] * (1 + np.iinfo(kind).max // 256)).astype(kind)
    path = tmp_path / f"image{ending}"
    cv2.imwrite(str(path), values[..., ::-1])
    raw = read_raw_image(path)
    assert (raw.grey, raw.loss) == (channels == 1, 0.0)
    assert np.array_equal(raw.rgb, np.broadcast_to(values, (9, 13, 3)))


@pytest.mark.function("Be told that a TIFF contains several images")
def test_a_tiff_of_several_images_is_refused_but_not_one_with_small_copies_and_masks(tmp_path):
    values, path = VALUES[..., :3].astype(np.uint8), tmp_path / "i.tif"
    for types, count in (((0, 0), 2), ((2, 2, 1, 2), 3), ((1, 0), 2)):
        path.write_bytes(tiff(values, types=types))
        with pytest.raises(InputError, match=rf"contains {count} images\. Save each image as a"):
            read_raw_image(path)
    with_mask = io.BytesIO()
    with tifffile.TiffWriter(with_mask) as out:
        out.write(values, photometric="rgb", metadata=None)
        out.write(values[::2, ::2], photometric="rgb", subfiletype=1, metadata=None)
        out.write(values[..., 0] > 99, photometric="mask", subfiletype=4, metadata=None)
    path.write_bytes(with_mask.getvalue())
    assert np.array_equal(read_raw_image(path).rgb, values)


def test_a_tiff_takes_no_more_memory_than_an_image(tmp_path):
    data = tiff(np.zeros((2000, 2000, 1), np.uint8), compression="zlib", rowsperstrip=2000)
    assert tiff_decoded(data, tmp_path, 4_000_000).shape == (2000, 2000)
    with pytest.raises(ValueError, match="too large"):
        tiff_decoded(data, tmp_path, 3_999_999)


@pytest.mark.parametrize(
    ("data", "kind"),
    [
        (b"RIFF\0\0\0\0AVI LIST", "video"),
        (b"\0\0\0\x20ftypisom", "video"),
        (b"\x1a\x45\xdf\xa3\x01", "video"),
        (b"GIF89a", "GIF"),
        (b"\0\0\0\x20ftypheic", "HEIC"),
        (b"", "not an image"),
        (b"hello", "not an image"),
    ],
)
def test_what_is_no_image_is_refused_by_what_it_is(tmp_path, data, kind):
    (tmp_path / "p.png").write_bytes(data)
    with pytest.raises(InputError, match=kind):
        read_raw_image(tmp_path / "p.png")


@pytest.mark.parametrize(
    "head",
    [
        b"BM" + bytes(16) + struct.pack("<ii", 1 << 20, -(1 << 20)) + bytes(8),
        b"\xff\xd8\xff\xc0\0\x0b\x08\xff\xff\xff\xff\x03\0\0\0",
        b"RIFF\x1e\0\0\0WEBPVP8X\x0a\0\0\0\0\0\0\0" + b"\xff" * 6,
    ],
)
def test_a_gigantic_size_is_refused_before_it_is_decoded(tmp_path, head):
    (tmp_path / "p.png").write_bytes(head)
    with pytest.raises(InputError, match="declares"):
        read_raw_image(tmp_path / "p.png")


def test_what_a_session_cannot_read_is_counted_and_named(tmp_path):
    folder = tmp_path / "balls"
    folder.mkdir()
    session = Session(tmp_path, SensorData("s"))
    for name in ("a.heic", "b.raw", "c.txt", "d.gif"):
        (folder / name).write_bytes(b"x")
    with pytest.raises(InputError, match=r"4 other files \(a\.heic, b\.raw, c\.txt and 1 more\)"):
        session.files("balls")
    for ending in SUFFIXES:
        (folder / f"image{ending}").write_bytes(encoded(ending))
    (folder / ".hidden").write_bytes(b"x")
    assert [path.suffix for path in files_in(folder).images] == sorted(SUFFIXES)
    assert names_of(files_in(folder).others) == "a.heic, b.raw, c.txt and 1 more"
    session = Session(tmp_path, SensorData("s"))
    found = {figure.key: figure for figure in judge_image_files(session, ["balls"]).figures}
    assert found["files_not_read"].value == 4.0
    assert found["compression_grey_levels"].value > 0.0
