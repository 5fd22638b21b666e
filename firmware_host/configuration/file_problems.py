"""Messages for people about files that the operating system refuses, and about wrong configurations."""

from pathlib import Path

LONGEST_MESSAGE = 400  # characters


def why_not(problem: OSError, place: Path | None = None) -> str:
    """Name the target of a copy or a move, or `place` where the problem names no file."""
    where, why = problem.filename2 or problem.filename or place, problem.strerror or str(problem)
    return f"{where}: {why}" if where else why


class ConfigurationError(Exception):
    """Everything that is wrong with a file, one message each, naming key, value and bound.

    Keys and values may have any length and any characters: control characters are escaped, and a long message loses
    its middle, since its key is at the beginning and its bound at the end.
    """

    def __init__(self, problems: list[str]) -> None:
        self.problems = [_readable(problem) for problem in problems]
        super().__init__("\n".join(self.problems))

    def of(self, file: object) -> "ConfigurationError":
        """Return the same problems, each with the name of the file."""
        return ConfigurationError([f"{file}: {problem}" for problem in self.problems])


class UnreadableFileError(ConfigurationError):
    """The operating system does not give the file: it is missing, a folder, or another user's."""


def _readable(message: str) -> str:
    if len(message) > LONGEST_MESSAGE:
        message = f"{message[: LONGEST_MESSAGE // 2]} [...] {message[-LONGEST_MESSAGE // 2 :]}"
    return "".join(each if each.isprintable() else repr(each)[1:-1] for each in message)
