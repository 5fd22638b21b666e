"""How reports tell a value with its errors: no digit that the errors do not bear.

Each error has two significant digits, and the value ends where the finest error ends. Without an error a value has
four significant digits; with errors it never has more than six.
"""

from __future__ import annotations

from math import isfinite

N_CM3 = 1e6  # N/m³
OF_ERROR, OF_VALUE, MOST = 2, 4, 6  # significant digits


def value_text(value: float | None, *errors: float | None, per: float = 1.0) -> str:
    """In units of `per`; a dash where there is no value. Errors that nobody knows are left out."""
    if value is None or not isfinite(value):
        return "-"
    doubts = [error / per for error in errors if error is not None and isfinite(error)]
    most = _places(value / per, MOST)
    places = [min(most, _places(doubt, OF_ERROR)) for doubt in doubts]
    ends = max(
        (place for place, doubt in zip(places, doubts, strict=True) if doubt), default=_places(value / per, OF_VALUE)
    )
    told = [f" ± {doubt:.{place if doubt else ends}f}" for doubt, place in zip(doubts, places, strict=True)]
    return f"{value / per:.{ends}f}" + "".join(told)


def share_text(share: float | None) -> str:
    """In percent; a dash where there is none."""
    return f"{100.0 * share:.1f} %" if share is not None and isfinite(share) else "-"


def _places(number: float, digits: int) -> int:
    """Behind the point, of which so many digits count."""
    return max(0, digits - 1 - int(f"{number:.{digits - 1}e}".partition("e")[2]))
