"""Values with their errors as text, with no more digits than the errors justify.

Each error has two significant digits, and the value ends where the finest error ends. Without an error a value has
four significant digits; with errors it never has more than six.
"""

from math import isfinite

N_CM3 = 1e6  # N/m³
OF_ERROR, OF_VALUE, MOST = 2, 4, 6  # significant digits
FINEST = 3  # decimals of a percentage


def value_text(value: float | None, *errors: float | None, per: float = 1.0, digits: int = OF_VALUE) -> str:
    """Format in units of `per`; a dash for no value. Unknown errors are left out; `digits` are those without any."""
    if value is None or not isfinite(value):
        return "-"
    value, most = value / per, _decimals(value / per, MOST)
    uncertainties = [error / per for error in errors if error is not None and isfinite(error)]
    decimals = [min(most, _decimals(uncertainty, OF_ERROR)) for uncertainty in uncertainties if uncertainty]
    ends = max(decimals, default=_decimals(value, digits))
    errors_text = [
        f"{uncertainty:.{min(most, _decimals(uncertainty, OF_ERROR)) if uncertainty else ends}f}"
        for uncertainty in uncertainties
    ]
    return " ± ".join([f"{value:.{ends}f}", *errors_text])


def coefficient_text(value: float | None, *errors: float | None, at_least: bool = False) -> str:
    """Format in N/cm³; ≥ marks a lower bound, which is known to two digits."""
    return f"{'≥ ' * at_least}{value_text(value, *errors, per=N_CM3, digits=OF_ERROR if at_least else OF_VALUE)}"


def fraction_text(fraction: float | None) -> str:
    """Format in percent, to two significant digits or a thousandth; a dash for none."""
    if fraction is None or not isfinite(fraction):
        return "-"
    return f"{100.0 * fraction:.{min(FINEST, _decimals(100.0 * fraction, OF_ERROR))}f} %"


def miss_text(value: float, true: float) -> str:
    """Format the relative error of a value; a dash for none."""
    return f"{100.0 * (value / true - 1.0):+z.2f} %" if isfinite(value) else "-"


def repeatability_text(fraction: float | None, trials: int) -> str:
    return f"{fraction_text(fraction)} of {trials}"


def _decimals(number: float, digits: int) -> int:
    """Return the decimals of a number with so many significant digits."""
    return max(0, digits - 1 - int(f"{number:.{digits - 1}e}".partition("e")[2]))
