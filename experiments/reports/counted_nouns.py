"""Writes a number with its noun: "1 stride", "2 strides"."""


def counted(number: int, noun: str) -> str:
    """Return the number with the noun, whose plural must end in s."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
