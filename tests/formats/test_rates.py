"""Frame times as printed and the rates they stand for."""

from __future__ import annotations

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mcz.model.schema import build
from mcz.sources.stated_rates import restate_bvh
from mcz.sources.tables.times import MAX_TERM, frame_rate, frame_time
from mcz.sources.text.layout import Template


@pytest.mark.parametrize(
    ("text", "rate", "exact"),
    [
        (".0083333", Fraction(120), False),
        ("0.008333", Fraction(120), False),
        ("0.0333333", Fraction(30), False),
        ("0.04", Fraction(25), True),
        ("4e-2", Fraction(25), True),
        ("1.000000", Fraction(1), True),
        ("0.033367", Fraction(30000, 1001), False),
        ("0.0417083750417", Fraction("23.976"), False),
        ("0.033368", Fraction(125000, 4171), True),
        ("2.5", Fraction(2, 5), True),
        ("0", None, True),
        ("-0.04", None, True),
        ("nan", None, True),
        ("1e-999999999", None, True),
        ("1" * 100, None, True),
        ("fast", None, True),
    ],
)
def test_the_rate_behind_a_printed_time(text: str, rate: Fraction | None, exact: bool) -> None:
    assert frame_rate(text) == (rate, exact)


@given(st.floats(1e-9, 1e9).map(repr))
def test_both_terms_fit_a_binary64(text: str) -> None:
    rate, _ = frame_rate(text)
    assert rate is None or 0 < max(rate.numerator, rate.denominator) <= MAX_TERM


@given(st.integers(1, 1000) | st.sampled_from([24, 30, 48, 60, 120, 240]).map(lambda n: n / 1.001))
def test_usual_rates_come_back(rate: float) -> None:
    wanted = Fraction(rate).limit_denominator(1001)
    assert frame_rate(frame_time(wanted))[0] == wanted
    assert frame_rate(frame_time(None))[0] is None


def test_what_is_no_number_states_no_rate() -> None:
    """A template of such a header is written as it is."""
    headers = [[b"Frames: ", f"\nFrame Time:{text}\n".encode()] for text in ("0.01", "!0.01")]
    templates = [build(Template(header=header, gaps=[], patterns=[]), "") for header in headers]
    stated, unstated = (restate_bvh(template, Fraction(50)) for template in templates)
    assert stated is not None
    assert stated.rate == 100
    assert unstated is None
