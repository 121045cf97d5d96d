"""What the commands share: where their results go, and the words they were given."""

import shlex
import sys
from datetime import datetime
from pathlib import Path

from actin_xcheck.errors import UserError


def report_folder(out_dir: Path | None, kind: str) -> Path:
    """Return the folder a user named, else one for this kind of report and this moment."""
    return out_dir or Path("reports") / f"{kind}-{datetime.now():%Y%m%d-%H%M%S}"


def make_folder(folder: Path) -> Path:
    """Make a folder where there is none and return it; UserError where that cannot be."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"--out: cannot make the folder {folder}: {error.strerror}") from error
    return folder


def command() -> str:
    """The command this process was started with, to be typed again."""
    return "python -m actin_xcheck " + shlex.join(sys.argv[1:])


def resuming_command() -> str:
    """The one that goes on with what this process has begun."""
    words = [word for word in sys.argv[1:] if word not in ("--force", "--resume")]
    return "python -m actin_xcheck " + shlex.join([*words, "--resume"])
