"""What the files of a check hold: where a claim's numbers stand, and the numbers that go to the history."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from actin_xcheck.core.claim import Claim
from actin_xcheck.nightly.history.record import Kind, Number
from actin_xcheck.runs.records import read_table
from actin_xcheck.runs.store import reading
from actin_xcheck.studies.converge.orders import Error, Order
from actin_xcheck.verdicts.triangulate import read_triangles

COMPARISON, ORDERS = "comparison.h5", "converge.h5"


def located(claim: Claim, folder: Path) -> tuple[str, Claim]:
    """The file in a check's folder that holds a claim's numbers, and the claim with its path in that file."""
    for name in (COMPARISON, ORDERS):
        if (folder / name).exists():
            return name, claim
    runs = sorted(_finished(folder), key=lambda run: run.stat().st_mtime_ns)
    if not runs:
        return "", claim
    inside = claim.path.split("/", 4)[-1]  # behind /runs/<scene>/<method>/, which a comparison links
    return runs[0].name, replace(claim, path=f"/{inside}")


def _finished(folder: Path) -> list[Path]:
    """The runs of a folder, without what is left of one that was killed."""
    return [run for run in folder.glob("*.vtkhdf") if not run.stem.endswith(".partial")]


def numbers_in(folder: Path, check: str) -> Iterator[Number]:
    """Observed orders, errors, rates, steps and times that the files in a check's folder hold."""
    if (folder / ORDERS).exists():
        yield from _of_orders(folder)
    if (folder / COMPARISON).exists():
        for triangle in read_triangles(folder / COMPARISON):
            if triangle.quantity == "growth_rate":
                for method, corner in zip(triangle.methods, triangle.corners, strict=False):
                    key = f"rate/{triangle.scene}/{method} · {check}"
                    yield Number(key, Kind.RATE, corner.value, "", f"{COMPARISON}/triangles/{triangle.key}")
    for run in sorted(_finished(folder)):
        if "--coarser-" in run.name:
            continue
        with reading(run, "run") as file:
            steps = len(file["run/series/time"]) - 1
            seconds = float(file["run"].attrs["wall_seconds"])
        yield Number(f"steps/{run.stem} · {check}", Kind.COUNT, float(steps), "", run.name)
        yield Number(f"step/{run.stem} · {check}", Kind.TIME, seconds / max(steps, 1), "s", run.name)


def _of_orders(folder: Path) -> Iterator[Number]:
    with reading(folder / ORDERS, "report of a study") as file:
        orders = read_table(file["tables/orders"], Order)
        errors = read_table(file["tables/errors"], Error)
    known = {one.key: one.error for one in errors if np.isfinite(one.error)}  # the last of each
    for key, error in known.items():
        yield Number(f"error/{key}", Kind.ERROR, error, "", f"{ORDERS}/tables/errors")
    for one in orders:
        yield Number(f"order/{one.key}", Kind.ORDER, one.last, "", f"{ORDERS}/tables/orders")
