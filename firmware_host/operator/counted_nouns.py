"""A number and what it counts, in a sentence for people: "1 stride", "2 strides"."""

from __future__ import annotations


def counted(number: int, noun: str) -> str:
    """Of a noun whose plural ends in s."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
