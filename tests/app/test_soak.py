"""What a soak concludes from its figures."""

from __future__ import annotations

import gc
from dataclasses import replace

from soak_figures import Row, conclude, let_rings_go
from soak_person import may_be_used

STEADY = Row(0.0, True, 1500.0, 1100.0, 600.0, 0.0, 900.0, 10, 24, 1000, 3000, 20, 60, 15.0, 15.0,
             15.0, 10.0, 5.0, 500.0, 0, 0, 100.0)  # fmt: skip


def hour(growth_mb: float = 0.0, rate_to: float = 15.0) -> list[Row]:
    """Return an hour's rows that grow by so much in the hour, and whose rate goes so far down."""
    return [
        replace(
            STEADY,
            minutes=0.5 * k,
            # Pages that come and go, as a person opens them.
            needed_mb=1100.0 + growth_mb * k / 120 + 40.0 * (k % 5),
            made_hz=15.0 + (rate_to - 15.0) * k / 120,
        )
        for k in range(121)
    ]


def test_an_hour_in_which_nothing_changes_is_well() -> None:
    output, wrong = conclude(hour())
    assert wrong == []
    assert any(line.startswith("needed_mb") for line in output)


def test_what_the_allocator_keeps_is_no_leak() -> None:
    kept = [replace(row, rss_mb=row.rss_mb + 10.0 * row.minutes) for row in hour()]
    assert conclude(kept)[1] == []


def test_what_a_person_has_open_is_no_leak() -> None:
    """More and more is opened, and put away at every fourth rest."""
    rows = [
        replace(row, emptied=k % 4 == 3, needed_mb=row.needed_mb + (k % 4 != 3) * 5.0 * row.minutes)
        for k, row in enumerate(hour())
    ]
    assert conclude(rows)[1] == []


def test_memory_that_grows_and_a_rate_that_falls_are_reported() -> None:
    (wrong,) = conclude(hour(growth_mb=100.0))[1]
    assert "memory grows by 100 MB per hour" in wrong
    (wrong,) = conclude(hour(rate_to=11.0))[1]
    assert "made_hz" in wrong


def test_what_only_refers_to_itself_is_let_go_and_reported() -> None:
    class Ring:
        def __init__(self) -> None:
            self.image, self.itself = bytearray(40_000_000), self

    gc.disable()
    try:
        Ring()
        assert let_rings_go() > 39.0
    finally:
        gc.enable()
    assert abs(let_rings_go()) < 5.0


def test_too_few_rests_are_no_verdict() -> None:
    assert conclude(hour()[:3])[1]


def test_the_person_neither_ends_the_program_nor_takes_its_calibration_away() -> None:
    assert not may_be_used("file.quit")
    assert not may_be_used("sensors.remove.button")
    assert may_be_used("calibrate.capture")
