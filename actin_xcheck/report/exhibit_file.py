"""Exhibits in HDF5: one group each, in the words of `exhibits.py`, so that others can read the files too.

The group of an exhibit has its class name in the attribute `class`.  Its text stands in attributes, its
arrays in datasets; a tuple of curves or cells is a group of numbered groups, a tuple of names a dataset of
strings, names with numbers are two datasets `names` and `numbers`.
"""

from collections.abc import Iterable
from dataclasses import fields
from typing import Any, cast, get_args, get_origin, get_type_hints

import h5py
import numpy as np

from actin_xcheck.report.exhibits import Chapter, Exhibit
from actin_xcheck.runs.vtkhdf import whole

_KINDS = {kind.__name__: kind for kind in get_args(Exhibit)}


def write_exhibit(group: h5py.Group, exhibit: Exhibit) -> None:
    """Write an exhibit into an empty group."""
    group.attrs["class"] = type(exhibit).__name__
    _write(group, exhibit)


def read_exhibit(group: h5py.Group) -> Exhibit:
    """Return the exhibit in a group.

    Raises
    ------
    ValueError : the group states no class of `exhibits.py`.
    KeyError : a field is missing.
    """
    name = str(group.attrs.get("class", "nothing"))
    if name not in _KINDS:
        raise ValueError(f"{group.name}: an exhibit is one of {', '.join(_KINDS)}, not {name!r}")
    return cast(Exhibit, _read(group, _KINDS[name]))


def write_exhibits(group: h5py.Group, exhibits: Iterable[Exhibit]) -> None:
    """Write exhibits into one group each, named by their keys, in this order.

    ValueError where two have the same key.
    """
    for exhibit in exhibits:
        if exhibit.key in group:
            raise ValueError(f"{group.name}: two exhibits have the key {exhibit.key!r}")
        write_exhibit(group.create_group(exhibit.key, track_order=True), exhibit)


def read_exhibits(group: h5py.Group) -> tuple[Exhibit, ...]:
    """Return the exhibits of a group (made with `track_order`) in the order in which they were written."""
    return tuple(read_exhibit(one) for one in group.values())


def write_chapters(group: h5py.Group, chapters: Iterable[Chapter]) -> None:
    """Write chapters into one group each, named by their keys, their exhibits inside."""
    for chapter in chapters:
        within = group.create_group(chapter.key, track_order=True)
        for name in ("title", "note"):
            within.attrs.create(name, getattr(chapter, name), dtype=h5py.string_dtype())
        write_exhibits(within, chapter.exhibits)


def read_chapters(group: h5py.Group) -> tuple[Chapter, ...]:
    """Return the chapters of a group (made with `track_order`) in the order in which they were written."""
    return tuple(
        Chapter(key, str(within.attrs["title"]), str(within.attrs["note"]), read_exhibits(within))
        for key, within in group.items()
    )


def _write(group: h5py.Group, record: Any) -> None:
    hints = get_type_hints(type(record))
    for field in fields(record):
        _put(group, field.name, hints[field.name], getattr(record, field.name))


def _read(group: h5py.Group, kind: Any) -> Any:
    hints = get_type_hints(kind)
    return kind(**{field.name: _get(group, field.name, hints[field.name]) for field in fields(kind)})


def _put(group: h5py.Group, name: str, hint: Any, value: Any) -> None:
    """Write one field of the type `hint`."""
    if hint is str:
        group.attrs.create(name, value, dtype=h5py.string_dtype())
    elif hint is bool:
        group.attrs[name] = value
    elif get_origin(hint) is not tuple:
        group.create_dataset(name, data=value, compression="gzip" if np.size(value) > 1000 else None)
    elif (item := get_args(hint)[0]) is str:
        _put_text(group, name, np.array(value, dtype=object))
    elif get_origin(item) is not tuple:
        numbered = group.create_group(name)
        for number, one in enumerate(value):
            _write(numbered.create_group(f"{number:03d}"), one)
    elif Ellipsis in get_args(item):
        if len({len(row) for row in value}) > 1:
            raise ValueError(f"{group.name}: the rows of {name} are not of one length")
        _put_text(group, name, np.array(value, dtype=object).reshape(len(value), -1 if value else 0))
    else:
        named = group.create_group(name)
        _put_text(named, "names", np.array([label for label, *_ in value], dtype=object))
        numbers = np.array([rest for _, *rest in value], dtype=float)
        named["numbers"] = numbers.reshape(len(value), len(get_args(item)) - 1)


def _get(group: h5py.Group, name: str, hint: Any) -> Any:
    """Read one field of the type `hint`."""
    if hint is str or hint is bool:
        return hint(group.attrs[name])
    stored = group[name]
    if get_origin(hint) is not tuple:
        return whole(group, name)
    if (item := get_args(hint)[0]) is str:
        return tuple(stored.asstr()[()])
    if get_origin(item) is not tuple:
        return tuple(_read(stored[key], item) for key in sorted(stored))
    if Ellipsis in get_args(item):
        return tuple(map(tuple, stored.asstr()[()]))
    named = zip(stored["names"].asstr()[()], stored["numbers"][()].tolist(), strict=True)
    return tuple((label, *numbers) for label, numbers in named)


def _put_text(group: h5py.Group, name: str, text: Any) -> None:
    group.create_dataset(name, data=text, dtype=h5py.string_dtype())
