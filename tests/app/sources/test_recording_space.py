"""How long a recording can go on."""

import pytest

from app.sources.recorder import RESERVE_BYTES, RecorderFigures, recording_space

# 35 MB a second, as of a camera of 2.3 megapixels.
AFTER_A_MINUTE = RecorderFigures(frames=1800, size_bytes=2_100_000_000, seconds=60.0)


@pytest.mark.function("Know how long one can still record")
def test_the_time_left_is_that_of_the_limit_or_of_the_disk_whichever_comes_first():
    room = recording_space(AFTER_A_MINUTE, free_bytes=1e12, limit_bytes=20e9)
    assert room.by_limit
    assert room.left_s == pytest.approx((20e9 - 2.1e9) / 35e6)
    room = recording_space(AFTER_A_MINUTE, free_bytes=RESERVE_BYTES + 1e9, limit_bytes=20e9)
    assert not room.by_limit
    assert room.left_s == pytest.approx(1e9 / 35e6)
    assert room.soon_full and not room.full
    assert recording_space(AFTER_A_MINUTE, free_bytes=RESERVE_BYTES, limit_bytes=20e9).full
