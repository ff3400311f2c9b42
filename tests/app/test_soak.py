"""What a soak concludes from its figures."""

from dataclasses import replace

from soak_figures import Row, conclude

STEADY = Row(0.0, 1500.0, 1100.0, 10, 24, 1000, 3000, 20, 15.0, 5.0, 0, 100.0)


def hour(growth_mb: float = 0.0, rate_to: float = 15.0) -> list[Row]:
    """Return an hour's rows that grow by so much in the hour, and whose rate goes so far down."""
    return [
        replace(
            STEADY,
            minutes=0.5 * k,
            rss_mb=1500.0 + 5.0 * k,  # what the allocator keeps is no leak
            needed_mb=1100.0 + growth_mb * k / 120 + 40.0 * (k % 5),
            shown_hz=15.0 + (rate_to - 15.0) * k / 120,
        )
        for k in range(121)
    ]


def test_memory_that_grows_and_a_rate_that_falls_are_reported():
    assert conclude(hour())[1] == []
    (wrong,) = conclude(hour(growth_mb=100.0))[1]
    assert "memory grows by 100 MB per hour" in wrong
    (wrong,) = conclude(hour(rate_to=11.0))[1]
    assert "rate falls" in wrong
    assert conclude(hour()[:3])[1]
