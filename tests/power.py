"""A disk in a folder: it notes what is done to it, fails when told to, and loses power at any moment."""

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path
from typing import Any

FAILING = ("open", "write", "fsync", "close", "replace", "unlink")
"""Calls that may be made to fail."""

MOST_NAMES = 5
"""Pending changes of names whose subsets are all tried; of more, prefixes only."""


@dataclass(frozen=True)
class Operation:
    """One call, or what a user was told: "create", "write", "sync", "names", "replace", "unlink", "done"."""

    kind: str
    file: int = 0
    name: str = ""
    other: str = ""
    content: bytes = b""


@dataclass
class Disk:
    """Calls of `os` on files of one folder, while it stands in their places.

    Attributes
    ----------
    folder : the one.
    portion : most bytes that one write takes.
    fails : number of the call, from 1, that raises `error`; 0 for none.
    operations : what was done.
    """

    folder: Path
    portion: int = 2**30
    fails: int = 0
    error: int = 0
    operations: list[Operation] = field(default_factory=list)
    calls: int = 0
    _files: dict[int, int] = field(default_factory=dict)
    _next: int = 1

    def stand_in(self, monkeypatch: Any) -> None:
        """Take the places of functions of `os`."""
        for name in FAILING:
            monkeypatch.setattr(os, name, self._instead(name, getattr(os, name)))

    def told(self, name: str, content: bytes) -> None:
        """Note that a user was told that a file holds something."""
        self.operations.append(Operation("done", name=name, content=content))

    def _instead(self, name: str, real: Callable[..., Any]) -> Callable[..., Any]:
        def call(first: Any, *more: Any, **named: Any) -> Any:
            if not self._ours(first):
                return real(first, *more, **named)
            self.calls += 1
            if self.calls == self.fails:
                if name == "close":
                    self._files.pop(first)
                    real(first)  # an error of close leaves it closed
                raise OSError(self.error, os.strerror(self.error))
            return getattr(self, f"_{name}")(real, first, *more, **named)

        return call

    def _ours(self, given: Any) -> bool:
        if isinstance(given, int):
            return given in self._files
        path = Path(os.fsdecode(given))
        return path == self.folder or (path.parent == self.folder and not path.name.endswith(".lock"))

    def _open(self, real: Any, path: Any, flags: int, *more: Any, **named: Any) -> int:
        number: int = real(path, flags, *more, **named)
        if Path(path) == self.folder:
            self._files[number] = 0
        elif flags & os.O_CREAT:
            self._files[number] = self._next
            self.operations.append(Operation("create", self._next, Path(path).name))
            self._next += 1
        return number

    def _write(self, real: Any, number: int, content: Any) -> int:
        count: int = real(number, content[: self.portion])
        self.operations.append(Operation("write", self._files[number], content=bytes(content[:count])))
        return count

    def _fsync(self, real: Any, number: int) -> None:
        real(number)
        file = self._files[number]
        self.operations.append(Operation("sync" if file else "names", file))

    def _close(self, real: Any, number: int) -> None:
        del self._files[number]
        real(number)

    def _replace(self, real: Any, source: Any, target: Any) -> None:
        real(source, target)
        self.operations.append(Operation("replace", name=Path(source).name, other=Path(target).name))

    def _unlink(self, real: Any, path: Any, **named: Any) -> None:
        real(path, **named)
        self.operations.append(Operation("unlink", name=Path(path).name))


@dataclass(frozen=True)
class Left:
    """What a loss of power leaves: files by name, and what users had been told that they hold."""

    files: dict[str, bytes]
    told: dict[str, bytes]
    after: int


def losses(operations: list[Operation]) -> Iterator[Left]:
    """Every state that a loss of power can leave, after each operation.

    What was not synchronised of a file is there, half there, not there, or zeros of its size; of the changes
    of names since the folder was synchronised each subset (or prefix) is there.
    """
    for after in range(len(operations) + 1):
        seen: set[tuple[tuple[str, bytes], ...]] = set()
        for files, told in _states(operations[:after]):
            key = tuple(sorted(files.items()))
            if key not in seen:
                seen.add(key)
                yield Left(files, told, after)


def _states(operations: list[Operation]) -> Iterator[tuple[dict[str, bytes], dict[str, bytes]]]:
    whole: dict[int, bytes] = {}
    safe: dict[int, int] = {}
    told: dict[str, bytes] = {}
    named: dict[str, int] = {}
    pending: list[Operation] = []
    for one in operations:
        match one.kind:
            case "create" | "replace" | "unlink":
                pending.append(one)
                if one.kind == "create":
                    whole[one.file], safe[one.file] = b"", 0
            case "write":
                whole[one.file] += one.content
            case "sync":
                safe[one.file] = len(whole[one.file])
            case "names":
                for change in pending:
                    _rename(named, change)
                pending = []
            case "done":
                told[one.name] = one.content
    for kept in _kept(pending):
        names = dict(named)
        for change in kept:
            _rename(names, change)
        for lost in _contents(whole, safe):
            yield {name: lost[file] for name, file in names.items()}, told


def _rename(names: dict[str, int], change: Operation) -> None:
    if change.kind == "create":
        names[change.name] = change.file
    elif change.kind == "unlink":
        names.pop(change.name, None)
    elif change.name in names:
        names[change.other] = names.pop(change.name)


def _kept(pending: list[Operation]) -> Iterator[tuple[Operation, ...]]:
    if len(pending) > MOST_NAMES:
        yield from (tuple(pending[:count]) for count in range(len(pending) + 1))
        return
    for count in range(len(pending) + 1):
        yield from combinations(pending, count)


def _contents(whole: dict[int, bytes], safe: dict[int, int]) -> Iterator[dict[int, bytes]]:
    """What files may hold: all of it, or of those not synchronised half, what was, or zeros."""
    yield whole
    if all(safe[file] == len(content) for file, content in whole.items()):
        return
    for share in (0.0, 0.5):
        yield {
            file: content[: safe[file] + int(share * (len(content) - safe[file]))]
            for file, content in whole.items()
        }
    yield {file: content[: safe[file]] + bytes(len(content) - safe[file]) for file, content in whole.items()}
