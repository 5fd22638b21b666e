"""Finds the configuration file of this computer's service, below a root that a test may replace."""

import re
from contextlib import suppress
from pathlib import Path

UNIT = "etc/systemd/system/mudskipper.service"
CONFIGURATION = "etc/mudskipper/mudskipper.toml"


def unit_text(root: Path) -> str:
    """Return the text of the installed service's unit with its drop-ins; files that cannot be read are left out."""
    texts = []
    for path in [root / UNIT, *sorted((root / f"{UNIT}.d").glob("*.conf"))]:
        with suppress(OSError):
            texts.append(path.read_text(encoding="utf-8", errors="replace"))
    return "\n".join(texts)


def service_configuration(root: Path = Path("/")) -> Path:
    """Return the file that the installed service reads, which a drop-in may change."""
    named = re.findall(r"^ExecStart=.*--config[ =]/?(\S+)", unit_text(root), re.MULTILINE)
    return root / (named[-1] if named else CONFIGURATION)
