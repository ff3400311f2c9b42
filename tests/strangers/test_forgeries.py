"""Files that somebody made to do harm: each attack that once got through ends in a sentence."""

import json
import os
import pickle
import struct
import tracemalloc
import zipfile
import zlib
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path

import cv2
import numpy as np
import pytest
import tifffile
from recorded import write_recording

from app.program.indenters import read_indenters
from app.program.workspace import Workspace, folder_name
from gelpolight_core.base.compared_quantity import Quantity
from gelpolight_core.base.errors import InputError
from gelpolight_core.base.npy import array_of
from gelpolight_core.base.safe_reading import parse_json, parse_toml
from gelpolight_core.calibration.calibration_file import read_calibration
from gelpolight_core.calibration.manifest import read_summary
from gelpolight_core.calibration.project import CalibrationProject
from gelpolight_core.lab.depth_score import read_true_depth
from gelpolight_core.lab.measurement_record import MeasurementRecord
from gelpolight_core.lab.measurement_store import NAME, open_records, write_csv
from gelpolight_core.lab.reference_press import read_truth
from gelpolight_core.output.recording.recording_reader import Recording, is_recording
from gelpolight_core.session.decisions import read_decisions
from gelpolight_core.session.session import read_session
from gelpolight_core.session.session_images import read_linear_image
from gelpolight_core.session.validation import validation_in
from gelpolight_core.simulation.sensor_design import read_design

READERS: dict[str, Callable[[Path], object]] = {
    "c.gplcal": read_calibration,
    "s.gplcal": read_summary,
    "r.gplrec": Recording.open,
    "p.png": read_linear_image,
    "t.npz": read_true_depth,
    "session.toml": lambda p: read_session(p.parent),
    "d.toml": read_design,
    "truth.csv": read_truth,
}
ABSENT: dict[str, Callable[[Path], object]] = {
    "decisions.toml": lambda p: read_decisions(p.parent),
    "indenters.json": lambda p: read_indenters(p.parent),
    "c.validation.json": lambda p: validation_in({"identity": "c"}, p.with_name("c.gplcal")),
    "workspace.json": lambda p: Workspace(p.parent).in_use,
    "any": is_recording,
}


@pytest.mark.parametrize("name", [*READERS, *ABSENT])
def test_a_pipe_in_the_place_of_a_file_is_not_waited_for(tmp_path, name):
    """It counts as no file where there need be none."""
    os.mkfifo(tmp_path / name)
    with nullcontext() if name in ABSENT else pytest.raises(InputError):
        (READERS | ABSENT)[name](tmp_path / name)


@pytest.mark.function("Be refused a file that would take all the memory")
@pytest.mark.parametrize(
    "name", [n for n in READERS if n[1:] not in (".gplcal", ".gplrec", ".npz")]
)
def test_a_file_of_a_terabyte_is_not_taken_into_memory(tmp_path, name):
    with (tmp_path / name).open("wb") as stream:
        stream.truncate(2**40)
    with pytest.raises(InputError, match="larger than"):
        READERS[name](tmp_path / name)


ENDLESS = (
    "a." * 400_000 + "b = 1",
    "a." * 400_000 + "#",
    "x = " + "[" * 10**5,
    "x = " + "9" * 5000,
    'x = """a"""',
    "x = " + "{a=" * 1000,
)


@pytest.mark.parametrize(
    ("parse", "text"),
    [
        *((parse_toml, text.encode()) for text in ENDLESS),
        *((parse_json, text) for text in ("NaN", "Infinity", "1e999", "[" * 10**5, "9" * 5000)),
    ],
)
def test_a_text_that_takes_for_ever_or_is_no_number_is_refused_at_once(parse, text):
    # It was hours.
    with pytest.raises(ValueError, match=r"\w"):
        parse(text)


def npy(head: str, body: bytes = b"") -> bytes:
    text = head.ljust(118)[:9000] + "\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text.encode() + body


@pytest.mark.parametrize("head", [
    "{'descr': '<f4', 'fortran_order': False, 'shape': (10000000000,), }",
    "{'descr': '|O', 'fortran_order': False, 'shape': (3,), }",
    "{'descr': '<f4', 'fortran_order': False, 'shape': (-1,), }",
    "(" * 3000, "'", "{'descr': '<f4', 'shape': (", "9" * 5000,
])  # fmt: skip
def test_an_array_takes_no_more_memory_than_its_bytes(head):
    tracemalloc.start()
    try:
        with pytest.raises(ValueError, match=r"\w"):
            array_of(npy(head, bytes(100)))
        assert tracemalloc.get_traced_memory()[1] < 10_000_000
    finally:
        tracemalloc.stop()


def test_a_pickle_in_an_array_is_never_run(tmp_path):
    class Harm:
        def __reduce__(self) -> tuple[object, tuple[str]]:
            return os.mkdir, (str(tmp_path / "harm"),)

    with pytest.raises(ValueError, match="header"):
        array_of(pickle.dumps(Harm()))
    assert not (tmp_path / "harm").exists()


@pytest.mark.parametrize(("order", "big"), [("<", False), (">", False), ("<", True)])
@pytest.mark.parametrize(("tags"), [(256, 257), (322, 323)])
def test_a_tiff_that_declares_a_gigantic_size_is_refused_unread(tmp_path, order, big, tags):
    mark = b"II" if order == "<" else b"MM"
    entries = [(tags[0], 30_000), (tags[1], 30_000)]
    if big:
        data = mark + struct.pack(order + "HHHQQ", 43, 8, 0, 16, len(entries))
        data += b"".join(struct.pack(order + "HHQQ", t, 16, 1, v) for t, v in entries)
    else:
        data = mark + struct.pack(order + "HIH", 42, 8, len(entries))
        data += b"".join(struct.pack(order + "HHII", t, 4, 1, v) for t, v in entries)
    (tmp_path / "p.tif").write_bytes(data + bytes(16))
    with pytest.raises(InputError, match="declares 30000 x 30000 pixels"):
        read_linear_image(tmp_path / "p.tif")


def test_a_png_of_gigantic_size_is_refused_unread(tmp_path):
    good = bytearray(cv2.imencode(".png", np.zeros((2, 2), np.uint8))[1].tobytes())
    struct.pack_into(">II", good, 16, 30_000, 30_000)
    struct.pack_into(">I", good, 29, zlib.crc32(good[12:29]))
    (tmp_path / "g.png").write_bytes(good)
    with pytest.raises(InputError, match="declares 30000 x 30000 pixels"):
        read_linear_image(tmp_path / "g.png")


def sessions_toml(more: str) -> str:
    return (
        'format = "gelpolight-session"\nversion = 1\n[sensor]\nserial = "A"\nled_height_mm = 13.8\n'
        "elastomer_thickness_mm = 14.0\nelastomer_refractive_index = 1.41\n"
        "working_diameter_mm = 26.0\n[checkerboard]\ninner_corners = [9, 6]\nsquare_mm = 3.0\n"
        f"[balls]\ndefault = 3.0\n{more}\n"
    )


@pytest.mark.parametrize("line", [
    '"../../etc/passwd" = 3.0', '"/dev/zero" = 3.0', f'"{"x" * 300}" = 3.0', '"a\\u0000b" = 3.0',
    '"a.png" = 0x' + "f" * 5000, '"a.png" = ' + "9" * 5000, '"a.png" = nan', '"a.png" = -1',
])  # fmt: skip
def test_a_ball_is_named_by_a_file_in_its_folder_and_has_a_length(tmp_path, line):
    (tmp_path / "balls").mkdir()
    (tmp_path / "session.toml").write_text(sessions_toml(line))
    with pytest.raises(InputError) as refusal:
        read_session(tmp_path).ball_radius_mm("ball_01.png")
    assert len(str(refusal.value)) < 1000


@pytest.mark.parametrize("file", ["../secret.png", "/etc/passwd", "..", "a/b.png"])
def test_a_truth_names_only_images_beside_it(tmp_path, file):
    (tmp_path / "truth.csv").write_text(
        f"file,shape,diameter_mm,side_mm,height_mm\n{file},ball,3,,1\n"
    )
    with pytest.raises(InputError, match="not the name of an image in this folder"):
        read_truth(tmp_path)


@pytest.fixture
def recording(tmp_path):
    write_recording(tmp_path / "r.gplrec")
    return tmp_path / "r.gplrec"


def test_a_strip_that_is_larger_than_its_pixels_is_not_taken_into_memory(recording):
    """The file is as large as it says, and has a hole where the strip is."""
    with tifffile.TiffFile(recording, mode="r+") as file:
        file.pages[1].tags["StripByteCounts"].overwrite(9_000_000)
    with recording.open("r+b") as stream:
        stream.truncate(12_000_000)
    with Recording.open(recording) as opened:
        assert opened.numbers.tolist() == [0, 2]


RECORD = MeasurementRecord("A", "c", "ball", (Quantity("diameter_mm", 3.0, 0.1, 3.0),), note="=1+1")


@pytest.mark.parametrize("statement", [
    "CREATE TRIGGER t AFTER INSERT ON entries BEGIN DELETE FROM entries; END",
    "CREATE VIEW v AS WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x FROM c) SELECT x FROM c",
])  # fmt: skip
def test_records_with_more_than_our_tables_are_refused(tmp_path, statement):
    with open_records(tmp_path / NAME) as records:
        records.add(RECORD)
        records._connection.execute(statement)
    before = (tmp_path / NAME).read_bytes()
    with pytest.raises(InputError, match="more than the tables of this program"):
        open_records(tmp_path / NAME)
    assert (tmp_path / NAME).read_bytes() == before


def test_no_spreadsheet_computes_what_a_stranger_wrote(tmp_path):
    write_csv([RECORD], tmp_path / "out.csv")
    assert "'=1+1" in (tmp_path / "out.csv").read_text("utf-8-sig")


def test_a_workspaces_choice_lies_inside_of_it(tmp_path):
    (tmp_path / "other.gplcal").write_bytes(b"x")
    workspace = Workspace(tmp_path / "w")
    workspace.sensors_folder.mkdir(parents=True)
    for chosen in (str(tmp_path / "other.gplcal"), "sensors/../../other.gplcal", "x" * 300, "a\0b"):
        (tmp_path / "w/workspace.json").write_text(json.dumps({"in_use": chosen}))
        assert workspace.in_use is None


@pytest.mark.parametrize("serial", ["CON", "nul.txt", "\U0001d538" * 80, "../..", "\ud800", ""])
def test_every_name_is_one_that_any_disk_takes(tmp_path, serial):
    name = folder_name(serial)
    assert name.split(".")[0].upper() not in ("CON", "NUL")
    (tmp_path / f"{name}-12.validation.json").write_text("")
    assert (tmp_path / f"{name}-12.validation.json").resolve().parent == tmp_path.resolve()


def test_a_calibration_that_declares_more_than_it_can_hold_is_refused(tmp_path):
    """Zeros pack a thousandfold: a file of 75 kB would take 75 MB for each of its arrays."""
    import hashlib

    from fuzz_kinds import _calibrations

    (tmp_path / "c.gplcal").write_bytes(_calibrations(tmp_path)[0])
    with zipfile.ZipFile(tmp_path / "c.gplcal") as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    manifest = json.loads(parts["manifest.json"])
    shape = [2500, 2500, 3]
    head = f"{{'descr': '<f4', 'fortran_order': False, 'shape': {tuple(shape)}, }}"
    parts["radiance.npy"] = npy(head, bytes(18_750_000 * 4))
    digest = hashlib.sha256(parts["radiance.npy"]).hexdigest()
    manifest["arrays"]["radiance"] = {"shape": shape, "kind": "<f4", "sha256": digest}
    parts["manifest.json"] = json.dumps(manifest).encode()
    parts["manifest.json.sha256"] = hashlib.sha256(parts["manifest.json"]).hexdigest().encode()
    with zipfile.ZipFile(
        tmp_path / "bomb.gplcal", "w", zipfile.ZIP_DEFLATED, compresslevel=1
    ) as out:
        for name, part in parts.items():
            out.writestr(name, part)
    for read in (read_calibration, read_summary):
        with pytest.raises(InputError, match="its arrays declare 75"):
            read(tmp_path / "bomb.gplcal")


def test_records_too_damaged_for_words_are_refused(tmp_path):
    """SQLite quotes the damage in its message, which then is no text."""
    with open_records(tmp_path / NAME) as records:
        records.add(RECORD)
    data = (tmp_path / NAME).read_bytes()
    (tmp_path / NAME).write_bytes(
        data.replace(b"CREATE TABLE entries", b"CREATE TABLE \xac\xff tries")
    )
    with pytest.raises(InputError, match="damaged"):
        open_records(tmp_path / NAME)


@pytest.mark.parametrize("name", ["decisions.toml", "balls/ball_01.png", "mirror/m.png"])
def test_a_pipe_in_a_session_is_not_waited_for(tmp_path, name):
    (tmp_path / "session.toml").write_text(sessions_toml(""))
    (tmp_path / name).parent.mkdir(exist_ok=True)
    os.mkfifo(tmp_path / name)
    project = CalibrationProject(tmp_path)
    if name != "decisions.toml":
        with pytest.raises(InputError):
            project.statuses()
