"""Where scenes lie, and what a list says of the shipped ones: read as TOML, which they are checked to be."""

import stat
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import fields
from difflib import get_close_matches
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

from actin_xcheck.core.errors import UserError, brief
from actin_xcheck.core.parameters import Closure, Delta, DimensionalParameters, Parameters, Rheology

_SHIPPED = files("actin_xcheck.scene") / "shipped"
_KNOWN = {one.name for one in fields(Parameters)}

MAX_SIZE = 200_000
"""Bytes of a scene: a hundred times what the shipped ones have; parsing takes up to 2 us each."""


class Listed(NamedTuple):
    """What a list says of a scene."""

    name: str
    citation: str
    model: str


def shipped_scenes() -> tuple[str, ...]:
    """Return the names of the scenes in the package, sorted."""
    names = (Path(entry.name) for entry in _SHIPPED.iterdir())
    return tuple(sorted(name.stem for name in names if name.suffix == ".toml"))


def listed(name: str) -> Listed:
    """Return what a list says of a shipped scene.

    Scenes are checked when they are loaded; that takes ten times as long, which nobody waits for who wants to
    know how one is called.
    """
    scene = tomllib.loads(scene_text(name))
    switches, source = scene.get("model", {}), scene.get("source", "")
    parameters = (
        DimensionalParameters(**scene["dimensional"]).non_dimensional()
        if "dimensional" in scene
        else Parameters(**{"psi": 0, "p": 0} | {k: v for k, v in scene["parameters"].items() if k in _KNOWN})
    )
    rheology, closure, delta = (  # the first of each is the usual one
        switches.get(key, next(iter(kind)))
        for key, kind in (("rheology", Rheology), ("closure", Closure), ("delta", Delta))
    )
    return Listed(
        name,
        source if isinstance(source, str) else source.get("citation", ""),
        f"psi {parameters.psi:g}, p {parameters.p:g}, {rheology}, {closure}, delta {delta}"
        + "".join(f", {law} {scene['laws'][law]}" for law in scene.get("laws", {}) if law != "parameters"),
    )


def scene_text(name_or_path: str | Path) -> str:
    """Return the TOML of a shipped scene or of a file, unchecked; raises UserError if there is none."""
    return read_scene(name_or_path)[0]


def read_scene(name_or_path: str | Path) -> tuple[str, str]:
    """Return the text of a scene, unchecked, and where it comes from; UserError if there is none."""
    origin = str(name_or_path)
    if origin in shipped_scenes():
        return _SHIPPED.joinpath(f"{origin}.toml").read_text(encoding="utf-8"), origin
    if not origin.endswith(".toml"):
        hint = did_you_mean(origin, shipped_scenes())
        valid = f"shipped scenes are {', '.join(shipped_scenes())}; a file's path ends in .toml"
        raise UserError(f"unknown scene {brief(origin)!r}{hint}; {valid}")
    try:
        if not stat.S_ISREG((found := Path(origin).stat()).st_mode):  # a pipe would never end
            what = "Is a directory" if stat.S_ISDIR(found.st_mode) else "not a regular file"
            raise OSError(what)
        with Path(origin).open("rb") as file:
            content = file.read(MAX_SIZE + 1)
        if len(content) > MAX_SIZE:
            raise OSError(f"larger than {MAX_SIZE} bytes")
        return content.decode("utf-8-sig").replace("\r\n", "\n"), origin
    except UnicodeDecodeError as error:
        raise UserError(f"{origin}: not UTF-8 text ({error.reason} at byte {error.start})") from None
    except (OSError, ValueError) as error:  # ValueError: a null byte in the path
        reason = getattr(error, "strerror", None) or error
        raise UserError(f"{origin}: cannot be read ({reason}); valid is the path of a TOML file") from None


def varied(table: Mapping[str, Any], changes: Mapping[str, Any], origin: str) -> dict[str, Any]:
    """Return a scene's table with other values, unchecked.

    Parameters
    ----------
    table : as TOML gives it; it stays as it is.
    changes : by dotted key, as {"parameters.psi": 3.0}; None leaves a value or a whole table out.
    origin : where the scene comes from, for the UserError that a key within what is no table raises.
    """
    changed = dict(table)
    for key, value in changes.items():
        *above, last = key.split(".")
        at = changed
        for name in above:
            if value is None and name not in at:
                break
            if not isinstance(within := at.get(name, {}), dict):
                raise UserError(f"{origin}: {brief(key)}: {brief(name)} is no table; valid: a key of a table")
            at[name] = dict(within)
            at = at[name]
        else:
            if value is None:
                at.pop(last, None)
            else:
                at[last] = value
    return changed


def did_you_mean(given: str, valid: Iterable[str]) -> str:
    """Return a question for what is most like what was given; empty where nothing is."""
    close = get_close_matches(given, list(valid), 1)
    return f" (did you mean {close[0]}?)" if close else ""
