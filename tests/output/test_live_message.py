"""Height maps as messages for other programs."""

import json
from dataclasses import replace

import numpy as np
import pytest

from gelpolight_core.base.finding import Finding, HeightReliability, Verdict
from gelpolight_core.health.faults import health_of
from gelpolight_core.output.live_message import TOPIC, encode_message
from gelpolight_core.reconstruction.height_map import HeightMap


@pytest.fixture
def heightmap():
    depth = np.linspace(0.0, 0.5, 12, dtype=np.float32).reshape(3, 4)
    normals = np.dstack([0.0 * depth, 0.0 * depth, 0.0 * depth - 1.0]).astype(np.float32)
    flags = np.arange(12, dtype=np.uint8).reshape(3, 4)
    x, y = np.arange(4) * 0.1 - 2.0, np.arange(3) * 0.1 - 1.0
    return HeightMap(
        depth, x, y, 0.1, normals, flags, "c-1", "full", "f", findings=(Finding("a", "a note"),)
    )


def received(parts):
    """Return header and arrays of a message, as docs/reference/streaming.md reads them."""
    header = json.loads(parts[1])
    pairs = zip(header["parts"], parts[2:], strict=True)
    arrays = {p["name"]: np.frombuffer(b, p["dtype"]).reshape(p["shape"]) for p, b in pairs}
    return header, arrays


def test_a_message_brings_back_the_arrays_and_where_they_lie(heightmap):
    parts = encode_message(heightmap, frame=7, time_s=12.5, serial="A-001")
    assert parts[0] == TOPIC
    header, arrays = received(parts)
    for name in ("depth_mm", "normals", "flags"):
        np.testing.assert_array_equal(arrays[name], getattr(heightmap, name))
        assert arrays[name].dtype == getattr(heightmap, name).dtype
    assert (header["frame"], header["time_s"], header["serial"]) == (7, 12.5, "A-001")
    assert (header["x0_mm"], header["y0_mm"], header["pitch_mm"]) == (-2.0, -1.0, 0.1)
    assert header["notes"] == ["A note."] and header["health"]["checked"] is False


def test_normals_are_left_out_if_there_are_none_and_faults_are_named(heightmap):
    fault = Finding(
        "dirt",
        "dust",
        3.0,
        "%",
        verdict=Verdict.WARN,
        remedy="Clean it",
        heights=HeightReliability.DOUBTFUL,
    )
    health = health_of([fault], unknown=("blurred",), untouched=0.8)
    header, arrays = received(
        encode_message(
            replace(heightmap, normals=None, health=health), frame=0, time_s=0.0, serial=""
        )
    )
    assert set(arrays) == {"depth_mm", "flags"}
    assert header["health"]["findings"][0]["key"] == "dirt"
    assert header["health"]["unknown"] == ["blurred"] and header["health"]["untouched"] == 0.8
