"""A person reads why coefficients have no valid value."""

from experiments.reports.validity_text import why_not_valid


def test_the_reasons_of_invalid_coefficients_are_counted() -> None:
    known, no_mud = {"valid": True, "reason": "the mud held"}, {"valid": False, "reason": "no evidence of mud"}
    strides = [{"k_p": no_mud, "k_s": known, "k_e": None}] * 2 + [{"k_p": known, "k_s": known, "k_e": no_mud}]
    assert why_not_valid(strides) == [
        "k_p is not valid in 2 of 3: no evidence of mud.",
        "k_e is not valid in 1 of 1: no evidence of mud.",
    ]
