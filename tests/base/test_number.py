"""One reader of numbers for fields, tables and options: right, or refused in words."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gelpolight_core.base.errors import InputError
from gelpolight_core.base.number import read_number


@given(
    st.decimals(min_value=-10_000, max_value=10_000, places=4),
    st.integers(0, 4),
    st.sampled_from(".,"),
)
def test_one_point_or_one_comma_is_the_decimal_sign(number, decimals, sign):
    text = f"{number:.{decimals}f}".replace(".", sign)
    assert read_number(f" {text}", "field") == float(text.replace(",", "."))
    if decimals not in (1, 2):  # with three decimals or none, "1,234" is unambiguous
        assert read_number(text, "field", decimals=decimals or None) == float(
            f"{number:.{decimals}f}"
        )


@given(st.text("0123456789.,-+e' _\xa0\u0663", max_size=12), st.none() | st.integers(0, 5))
def test_no_text_becomes_another_number(text, decimals):
    try:
        value = read_number(text, "field", decimals=decimals)
    except InputError as error:
        assert error.where == "field"
        return
    assert value == float(text.strip().replace(",", "."))
    assert text.count(".") + text.count(",") <= 1
    assert "_" not in text
    if decimals is not None:
        assert round(value, decimals) == value


@given(st.integers(1_000, 10**9), st.integers(0, 999), st.sampled_from([",.", ".,", "' ."]))
def test_signs_between_thousands_are_refused_with_the_number_that_they_mean(whole, part, signs):
    text = f"{whole:,}".replace(",", signs[0]) + f"{signs[-1]}{part}"
    with pytest.raises(InputError) as refused:
        read_number(text, "field")
    assert refused.value.found == f"{text} could be {whole}.{part}"


@pytest.mark.parametrize(
    ("text", "decimals", "found"),
    [
        ("1,234", 1, "1,234 could be 1.234 or 1234"),
        ("1.000", 0, "1.000 could be 1.000 or 1000"),
        ("0.500", 0, "0.500 has more than 0 decimals"),
        ("4.8765", 3, "4.8765 has more than 3 decimals"),
        ("1e-4", 3, "1e-4 has more than 3 decimals"),
        ("5,002,1", None, "'5,002,1' is not a number"),
        ("002", None, "'002' is not a number"),
        ("inf", None, "'inf' is not a number"),
        ("1e999", None, "'1e999' is not a number"),
        ("", None, "'' is not a number"),
    ],
)
def test_what_is_refused_is_named_with_its_readings(text, decimals, found):
    with pytest.raises(InputError) as refused:
        read_number(text, "field", decimals=decimals)
    assert refused.value.found == found


@pytest.mark.parametrize(("text", "decimals"), [("0.500", 1), ("12.7000", 3), ("1,000", 3)])
def test_zeros_at_the_end_do_not_count(text, decimals):
    assert read_number(text, "field", decimals=decimals) == float(text.replace(",", "."))
