"""What a refusal says about an unknown name: a similar one that exists."""

from collections.abc import Iterable


def similar_name(name: str, existing: Iterable[str]) -> str:
    """Return the existing name that is most similar to an unknown one; empty where none is similar."""
    from difflib import get_close_matches  # slow to import, and seldom needed

    return next(iter(get_close_matches(name, [*existing], 1)), "")


def suggestion(name: str, existing: Iterable[str]) -> str:
    """Return the text that follows an unknown name: a similar one, and all that exist."""
    names = [*existing]
    similar, verb = similar_name(name, names), "is" if len(names) < 2 else "are"
    return f"{f'did you mean {similar}? There' if similar else 'there'} {verb} {', '.join(names) or 'none'}"
