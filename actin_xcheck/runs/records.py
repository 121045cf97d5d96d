"""Frozen dataclasses in HDF5, one group each, laid out by their type hints so that others can read them too.

Text, numbers, truth values and enumerations are attributes, arrays datasets, other dataclasses groups.  A
tuple of dataclasses is a group of numbered groups, a tuple of names a dataset of strings, a tuple of numbers
one of numbers; names with numbers are two datasets `names` and `numbers`.  A table, many of one class, is a
group with a dataset a column.
"""

from collections.abc import Mapping, Sequence
from dataclasses import MISSING, fields, is_dataclass
from enum import Enum
from functools import reduce
from operator import or_
from pathlib import Path
from types import UnionType
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

import h5py
import numpy as np

from actin_xcheck.runs.vtkhdf import whole

Record = TypeVar("Record")

_PLAIN = (str, bool, int, float, Path)


def gathered(kind: type[Record], *sources: Any, **own: Any) -> Record:
    """Return a dataclass: a field that is not given by name is had from the first source that has it.

    TypeError where none has what has no default.
    """
    for field in fields(kind):  # type: ignore[arg-type]
        having = [source for source in sources if hasattr(source, field.name)]
        if field.name not in own and having:
            own[field.name] = getattr(having[0], field.name)
    return kind(**own)


def write_record(group: h5py.Group, record: Any) -> None:
    """Write a dataclass into an empty group, its class in the attribute `class`."""
    group.attrs["class"] = type(record).__name__
    hints = get_type_hints(type(record))
    for field in fields(record):
        _put(group, field.name, hints[field.name], getattr(record, field.name))


def read_record(group: h5py.Group, kind: Any) -> Any:
    """Return the dataclass in a group, of class `kind` or of one in a union of them.

    A field that is missing takes its default.  KeyError where it has none, ValueError where the group states
    a class that is not in the union.
    """
    if get_origin(kind) is UnionType:
        kinds = {one.__name__: one for one in get_args(kind)}
        name = str(group.attrs.get("class", "nothing"))
        if name not in kinds:
            raise ValueError(f"{group.name}: the class is one of {', '.join(kinds)}, not {name!r}")
        kind = kinds[name]
    hints = get_type_hints(kind)
    stored = [
        field.name
        for field in fields(kind)
        if field.default is MISSING or field.name in group or field.name in group.attrs
    ]
    return kind(**{name: _get(group, name, hints[name]) for name in stored})


def write_table(group: h5py.Group, rows: Sequence[Any] | Mapping[str, Any]) -> None:
    """Write rows of one class, or columns by name, into an empty group.

    A field is a dataset, numbered groups if it is not plain; a column an array (n,) of numbers or text.
    """
    if isinstance(rows, Mapping):
        for name, values in rows.items():
            if values.dtype.kind == "U":
                _put_text(group, name, values.astype(object))
            else:
                group[name] = values
        return
    hints = get_type_hints(type(rows[0])) if rows else {}
    for name, hint in hints.items():
        column = [getattr(row, name) for row in rows]
        if not _is_plain(hint):
            numbered = group.create_group(name, track_order=True)
            for number, value in enumerate(column):
                _put(numbered.create_group(f"{number:06d}"), name, hint, value)
        elif _is_text(hint):
            _put_text(group, name, np.array([str(value) for value in column], dtype=object))
        else:
            group[name] = np.array(column)


def read_table(group: h5py.Group, kind: type[Record]) -> list[Record]:
    """Return the rows of class `kind` in a group; KeyError where a column is missing."""
    columns = {}
    for name, hint in get_type_hints(kind).items():
        if not len(group):
            return []
        if not _is_plain(hint):
            columns[name] = [_get(one, name, hint) for _, one in sorted(group[name].items())]
        else:
            stored = group[name]
            values = stored.asstr()[()] if _is_text(hint) else stored[()].tolist()
            columns[name] = [hint(value) for value in values]
    return [kind(**dict(zip(columns, row, strict=True))) for row in zip(*columns.values(), strict=True)]


def _is_plain(hint: Any) -> bool:
    """Whether a value is one text or number."""
    return isinstance(hint, type) and issubclass(hint, (*_PLAIN, Enum))


def _is_text(hint: type) -> bool:
    return issubclass(hint, str | Path | Enum)


def _put(group: h5py.Group, name: str, hint: Any, value: Any) -> None:
    """Write one field of the type `hint`."""
    if type(None) in get_args(hint):  # X | None
        if value is not None:
            _put(group, name, _without_none(hint), value)
    elif get_origin(hint) is UnionType and all(map(is_dataclass, get_args(hint))):
        write_record(group.create_group(name), value)
    elif _is_plain(hint):
        group.attrs.create(name, *((str(value),) if _is_text(hint) else (value,)), **_text_if(_is_text(hint)))
    elif is_dataclass(hint):
        write_record(group.create_group(name), value)
    elif get_origin(hint) is not tuple:
        group.create_dataset(name, data=value, compression="gzip" if np.size(value) > 1000 else None)
    else:
        _put_tuple(group, name, get_args(hint)[0], value)


def _put_tuple(group: h5py.Group, name: str, item: Any, value: Any) -> None:
    """Write a tuple of `item`."""
    if item is str:
        _put_text(group, name, np.array(value, dtype=object))
    elif item in (int, float, bool):
        group[name] = np.array(value, dtype=item)
    elif get_origin(item) is not tuple:
        numbered = group.create_group(name)
        for number, one in enumerate(value):
            write_record(numbered.create_group(f"{number:03d}"), one)
    elif not _is_named(item):
        if len({len(row) for row in value}) > 1:
            raise ValueError(f"{group.name}: the rows of {name} are not of one length")
        kind = get_args(item)[0]
        rows = np.array(value, dtype=object if kind is str else kind)
        rows = rows.reshape(len(value), -1 if value else 0)
        group.create_dataset(name, data=rows, **_text_if(kind is str))
    else:
        named = group.create_group(name)
        _put_text(named, "names", np.array([label for label, *_ in value], dtype=object))
        numbers = np.array([rest for _, *rest in value], dtype=float)
        named["numbers"] = numbers.reshape(len(value), len(get_args(item)) - 1)


def _get(group: h5py.Group, name: str, hint: Any) -> Any:
    """Read one field of the type `hint`."""
    if type(None) in get_args(hint):
        hint = _without_none(hint)
        if name not in group and name not in group.attrs:
            return None
    if get_origin(hint) is UnionType and all(map(is_dataclass, get_args(hint))):
        return read_record(group[name], hint)
    if _is_plain(hint):
        return hint(group.attrs[name])
    if is_dataclass(hint):
        return read_record(group[name], hint)
    if get_origin(hint) is not tuple:
        return whole(group, name)
    return _get_tuple(group[name], get_args(hint)[0])


def _get_tuple(stored: Any, item: Any) -> tuple[Any, ...]:
    """Read a tuple of `item`."""
    if item is str:
        return tuple(stored.asstr()[()])
    if item in (int, float, bool):
        return tuple(stored[()].tolist())
    if get_origin(item) is not tuple:
        return tuple(read_record(stored[key], item) for key in sorted(stored, key=int))
    if not _is_named(item):
        rows = stored.asstr()[()] if get_args(item)[0] is str else stored[()].tolist()
        return tuple(map(tuple, rows))
    named = zip(stored["names"].asstr()[()], stored["numbers"][()].tolist(), strict=True)
    kinds = get_args(item)[1:]
    return tuple(
        (label, *(kind(number) for kind, number in zip(kinds, numbers, strict=True)))
        for label, numbers in named
    )


def _is_named(item: Any) -> bool:
    """Whether a tuple is a name with so many numbers, not a row of one kind."""
    name, *rest = get_args(item)
    return name is str and Ellipsis not in rest and str not in rest


def _without_none(hint: Any) -> Any:
    """X of X | None."""
    rest = [one for one in get_args(hint) if one is not type(None)]
    return reduce(or_, rest)


def _put_text(group: h5py.Group, name: str, text: Any) -> None:
    group.create_dataset(name, data=text, **_text_if(True))


def _text_if(text: bool) -> dict[str, Any]:
    return {"dtype": h5py.string_dtype()} if text else {}
