"""Exhibits in HDF5: one group each, in the words of `exhibits.py`, with the class in an attribute."""

from collections.abc import Iterable

import h5py

from actin_xcheck.report.exhibits import Chapter, Exhibit
from actin_xcheck.runs.records import read_record, write_record


def write_exhibits(group: h5py.Group, exhibits: Iterable[Exhibit]) -> None:
    """Write exhibits into one group each, named by their keys, in this order.

    ValueError where two have the same key.
    """
    for exhibit in exhibits:
        if exhibit.key in group:
            raise ValueError(f"{group.name}: two exhibits have the key {exhibit.key!r}")
        write_record(group.create_group(exhibit.key, track_order=True), exhibit)


def read_exhibits(group: h5py.Group) -> tuple[Exhibit, ...]:
    """Return the exhibits of a group (made with `track_order`) in the order in which they were written."""
    return tuple(read_record(one, Exhibit) for one in group.values())


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
