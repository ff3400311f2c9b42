"""What a soak concludes from its figures."""

from __future__ import annotations

from dataclasses import replace

from soak_figures import Row, conclude

STEADY = Row(0.0, True, 1500.0, 1100.0, 10, 24, 1000, 3000, 20, 60, 15.0, 5.0,
             500.0, 0, 0, 100.0)  # fmt: skip


def hour(growth_mb: float = 0.0, rate_to: float = 15.0) -> list[Row]:
    """Return an hour's rows that grow by so much in the hour, and whose rate goes so far down."""
    return [
        replace(
            STEADY,
            minutes=0.5 * k,
            # What the allocator keeps, and what is put away at every fourth rest, is no leak.
            rss_mb=1500.0 + 5.0 * k,
            emptied=k % 4 == 3,
            needed_mb=1100.0 + growth_mb * k / 120 + 10.0 * (k % 5) + (k % 4 != 3) * 2.5 * k,
            shown_hz=15.0 + (rate_to - 15.0) * k / 120,
        )
        for k in range(121)
    ]


def test_memory_that_grows_and_a_rate_that_falls_are_reported() -> None:
    assert conclude(hour())[1] == []
    (wrong,) = conclude(hour(growth_mb=100.0))[1]
    assert "memory grows by 100 MB per hour" in wrong
    (wrong,) = conclude(hour(rate_to=11.0))[1]
    assert "shown_hz" in wrong
    assert conclude(hour()[:3])[1]
