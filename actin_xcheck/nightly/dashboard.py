"""The pages of the nights: one for each, from its own file, and one over all, from the history."""

from collections import Counter
from collections.abc import Collection, Container, Iterable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jinja2 import Environment
from markupsafe import Markup

from actin_xcheck.core.claim import Claim
from actin_xcheck.core.errors import UserError
from actin_xcheck.nightly.changes import events
from actin_xcheck.nightly.history import FILE_NAME as HISTORY
from actin_xcheck.nightly.history import (
    Counted,
    JudgedNumber,
    Series,
    judged_in,
    read_claims,
    read_nights,
    read_series,
)
from actin_xcheck.nightly.items import COMPARISON, Group, group_of
from actin_xcheck.nightly.record import (
    FILE_NAME,
    Done,
    Kept,
    NumberKind,
    nights_in,
    read_night,
    short,
)
from actin_xcheck.nightly.standing import flaky, standing, state_of
from actin_xcheck.report.draw import SEQUENTIAL, Brush, Colours, Panel, closed_rim, scale_ends, span, window
from actin_xcheck.report.film import on_triangles
from actin_xcheck.report.page import environment, put_page
from actin_xcheck.runs.executor import cores, executor
from actin_xcheck.runs.processes import Lost
from actin_xcheck.studies.compare import read_comparison
from actin_xcheck.studies.compare_page import write_comparison_page
from actin_xcheck.studies.faults import FAULTS

EVENTS = 60
"""Changes on the page at most; `history --steps` has them all."""

SHOWN = 60
"""Nights in a line or a row of lights at most, the last ones."""

THUMBNAIL = 60
"""Dots per inch of a scene's picture on the page of a night, twice fewer than in its film strip."""

WIDTH, HEIGHT = 120, 22
"""Units of a line's drawing: about pixels."""

_SURVEYS = {"Error against work": "chart.h5", "Where methods fail": "frontier.h5"}
"""Reports that stand beside the nights, by the file each is made from."""

_RANK = {"FAIL": 0, "PASS": 1, "NOT JUDGED": 2}


class _Row(NamedTuple):
    """A claim of a night with where it comes from."""

    claim: Claim
    group: Group
    check: Done
    file: str

    @property
    def judged(self) -> JudgedNumber:
        """As the history has it."""
        return JudgedNumber(self.claim, self.check.name)


class _Light(NamedTuple):
    """A group of claims as it stands: its verdicts, their worst, and how it was in each night."""

    group: Group
    verdicts: Counter[str]
    state: str
    before: Sequence[tuple[str, str]] = ()


def _state(verdicts: Counter[str]) -> str:
    return "fail" if verdicts["FAIL"] else "pass" if verdicts["PASS"] else "none"


def write_scene_pages(folder: Path) -> None:
    """Write the report of every comparison in a night's folder, with the film of its cell, beside it."""
    places = sorted((folder / "checks").glob(f"*/{COMPARISON}"))
    with executor(min(len(places), cores())) as processes:
        found = list(processes.results(_scene_page, places))
    if said := [one.message if isinstance(one, Lost) else one for _, one in found if one]:
        raise UserError(f"{'; '.join(said)}; valid: the same command again")


def _scene_page(file: Path) -> str:
    """Write a report; what is wrong, so that the others are written."""
    try:
        write_comparison_page(file)
    except UserError as error:
        return str(error)
    return ""


def write_night_page(folder: Path) -> Path:
    """Write `folder/index.html` from `folder/night.jsonl` and return its path.

    UserError where the file is missing or not whole.
    """
    folder = Path(folder)
    night = read_night(folder)
    unsteady = frozenset() if night.begun.fault else flaky(folder.parent / HISTORY, night.begun.name)
    rows = [
        _Row(claim, group_of(claim), done, file)
        for done in night.done
        for claim, file in zip(done.claims, done.files, strict=True)
    ]
    rows.sort(key=lambda row: (list(Group).index(row.group), _RANK[row.claim.verdict]))
    groups = {group: [row for row in rows if row.group is group] for group in Group}
    text = _environment(folder).get_template("night.html").render(
        night=night,
        begun=night.begun,
        groups=groups,
        lights=[
            _Light(
                group,
                Counter(row.claim.verdict for row in ours),
                standing([row.judged for row in ours], unsteady).state,
            )
            for group, ours in groups.items()
            if ours
        ],
        failing=[row for row in rows if row.claim.verdict == "FAIL"],
        standing=standing(judged_in(night.done), unsteady, night.left_out),
        states={row.judged.key: state_of(row.judged, unsteady) for row in rows},
        came={done.name: _came(done, unsteady) for done in night.done},
        fault=FAULTS.get(night.begun.fault),
        called=sum(night.begun.fault in done.reached for done in night.done),
        pages=_pages(night),
        scenes=[(done, page, _thumbnail(folder / done.folder)) for done, page in _scenes(night)],
        surveys=_surveys(folder.parent, "../"),
        numbers={done.name: _by_use(done) for done in night.done},
        file=folder / FILE_NAME,
    )  # fmt: skip
    return put_page(folder, text)


def _came(done: Done, unsteady: Container[str]) -> str:
    """The light of a check."""
    if done.trouble or not done.red:
        return "broken" if done.trouble else "pass"
    return standing(judged_in([done]), unsteady).state


def _pages(night: Kept) -> dict[str, str]:
    """Pages of their own that checks have, from the night's folder."""
    return {
        done.name: f"{done.folder}/index.html"
        for done in night.done
        if done.folder and (night.folder / done.folder / "index.html").exists()
    }


def _scenes(night: Kept) -> list[tuple[Done, str]]:
    """The comparisons of a night that have a page, with its place."""
    pages = _pages(night)
    compared = [done for done in night.done if (night.folder / done.folder / COMPARISON).exists()]
    return [(done, pages[done.name]) for done in compared if done.name in pages]


def _thumbnail(folder: Path) -> Panel | None:
    """The cell of a comparison's first run in the end; None where its files are gone."""
    try:
        run = next(iter(read_comparison(folder / COMPARISON).runs.values()))
    except UserError:
        return None
    x, values = run.points[-1], on_triangles(run, len(run.times) - 1)
    outline = run.xi[:, closed_rim(run.triangles)]
    brush = Brush(run.triangles, outline, window([x, outline]), THUMBNAIL)
    what = f"a of {run.attributes['method_name']} at t = {run.times[-1]:.4g}"
    return brush.panel(what, x, values, Colours(SEQUENTIAL, *scale_ends(*span([values]))))


def _surveys(reports: Path, to: str) -> list[tuple[str, str, str]]:
    """The newest report of each kind that stands beside the nights: what it says, its folder, its page."""
    found = []
    for words, name in _SURVEYS.items():
        made = [file for file in reports.glob(f"*/{name}") if (file.parent / "index.html").exists()]
        if made:
            newest = max(made, key=lambda file: file.stat().st_mtime).parent.name
            found.append((words, newest, f"{to}{newest}/index.html"))
    return found


def _by_use(done: Done) -> dict[str, float]:
    """Time, memory and work of a check, by the word before the first stroke of the key."""
    return {one.key.split("/", 1)[0]: one.value for one in done.numbers if one.key.endswith(f"/{done.name}")}


def write_dashboard(reports: Path) -> Path:
    """Write `reports/index.html` from the history there and the folders of the nights, and return its path.

    UserError where the history is none.
    """
    reports = Path(reports)
    folders = {night.begun.name: night for night in nights_in(reports)}
    history = reports / HISTORY
    counted = read_nights(history) if history.exists() else []
    series = {one.key: one for one in read_series(history)} if counted else {}
    changed = events(series.values())
    when: dict[str, set[str]] = {}
    for event in changed:
        nights = series[event.key].nights  # of which the night that a step shares with others need not be one
        own = next((night for night in nights if night.date >= event.night.date), event.night)
        when.setdefault(event.key, set()).add(own.name)
    lines = {key: sparkline(one, when.get(key, ())) for key, one in series.items()}
    last = counted[-1] if counted else None
    name = last.night.name if last else ""
    shown = {one.night.name: read_claims(history, one.night.name) for one in counted[-SHOWN:]}
    kept, unsteady = folders.get(name), flaky(history, name)
    every = _nights(counted, folders)
    now = standing(shown.get(name, {}).values(), unsteady, kept.left_out if kept else ())
    for row in every:
        row["state"] = now.state if row["name"] == name else row["state"]
    text = _environment(reports).get_template("dashboard.html").render(
        last=last,
        lights=_lights(shown, unsteady),
        claims=_by_check(shown.get(name, {}), lines),
        numbers=_by_kind(series, name, lines),
        events=changed[:EVENTS],
        more=max(len(changed) - EVENTS, 0),
        nights=every,
        standing=now,
        states={key: state_of(one, unsteady) for key, one in shown.get(name, {}).items()},
        folders=folders,
        anchors={
            done.name: f"{name}/index.html#check-{number}"
            for number, done in enumerate(kept.done if kept else (), 1)
        },
        films={done.name: f"{name}/{page}" for done, page in (_scenes(kept) if kept else ())},
        surveys=_surveys(reports, ""),
    )  # fmt: skip
    return put_page(reports, text)


def _environment(folder: Path) -> Environment:
    made = environment(folder)
    made.filters |= {"lights": lights, "commit": short}
    return made


def _lights(shown: Mapping[str, Mapping[str, JudgedNumber]], unsteady: Container[str]) -> list[_Light]:
    """The groups with their lights in the nights that are shown; what is flaky is known of the last one."""
    found, last = [], list(shown)[-1:]
    for group in Group:
        ours = {
            name: [one for one in claims.values() if group_of(one.claim) is group]
            for name, claims in shown.items()
        }
        counts = {name: Counter(one.claim.verdict for one in claims) for name, claims in ours.items()}
        before = tuple((name, _state(verdicts)) for name, verdicts in counts.items())
        if any(state != "none" for _, state in before):
            found.append(_Light(group, counts[last[0]], standing(ours[last[0]], unsteady).state, before))
    return found


def _by_check(
    claims: Mapping[str, JudgedNumber], lines: Mapping[str, str]
) -> dict[str, list[tuple[JudgedNumber, Group, str]]]:
    """The claims of the last night with their lines by their checks, checks with red ones first."""
    found: dict[str, list[tuple[JudgedNumber, Group, str]]] = {}
    for key, one in claims.items():
        found.setdefault(one.check, []).append((one, group_of(one.claim), lines.get(f"claim/{key}", "")))
    red = {one.check for one in claims.values() if one.claim.verdict == "FAIL"}
    return dict(sorted(found.items(), key=lambda item: (item[0] not in red, item[0])))


def _by_kind(
    series: Mapping[str, Series], last: str, lines: Mapping[str, str]
) -> dict[NumberKind, list[tuple[Series, str]]]:
    """The numbers that the last night has, claims apart, with their lines."""
    found: dict[NumberKind, list[tuple[Series, str]]] = {
        kind: [] for kind in NumberKind if kind is not NumberKind.CLAIM
    }
    for key, one in series.items():
        if one.kind in found and one.nights[-1].name == last:
            found[one.kind].append((one, lines[key]))
    return {kind: ours for kind, ours in found.items() if ours}


def _nights(counted: Iterable[Counted], folders: Mapping[str, Kept]) -> list[dict[str, Any]]:
    """Lines of the table of nights, the last one first; some have a folder alone (a fault, no end)."""
    rows = {
        name: {
            "name": name,
            "date": kept.begun.date,
            "commit": kept.begun.versions["commit"],
            "minutes": kept.seconds / 60,
            "verdicts": Counter(claim.verdict for claim in kept.claims),
            "not_run": len(kept.left_out),
            "fault": kept.begun.fault,
            "page": f"{kept.folder.name}/index.html" if (kept.folder / "index.html").exists() else "",
            "state": standing(judged_in(kept.done)).state if kept.red or kept.closed else "none",
        }
        for name, kept in folders.items()
    }
    for one in counted:
        night = one.night
        known = {"not_run": 0, "page": "", "state": _state(one.verdicts), **rows.get(night.name, {})}
        rows[night.name] = known | {
            "name": night.name,
            "date": night.date,
            "commit": night.commit,
            "minutes": night.seconds / 60,
            "verdicts": one.verdicts,
            "fault": "",
        }
    return sorted(rows.values(), key=lambda row: str(row["date"]), reverse=True)


def sparkline(series: Series, changed: Collection[str] = ()) -> Markup:
    """Return a series as a line of text height, its last value as a dot, nights of changes as strokes.

    Parameters
    ----------
    series : the number; on the logarithm where it is compared so.
    changed : names of the nights.
    """
    nights = series.nights[-SHOWN:]
    scaled, values = series.scaled[-SHOWN:], series.values[-SHOWN:]
    finite = np.isfinite(scaled)
    if not finite.any():
        return Markup('<span class="none">no number</span>')
    x = np.linspace(3, WIDTH - 3, len(nights)) if len(nights) > 1 else np.array([WIDTH - 3.0])
    low, high = scaled[finite].min(), scaled[finite].max()
    least = 0.02 if series.kind is not NumberKind.RATE else 1e-6  # round-off is drawn as none
    y = HEIGHT - 3 - (HEIGHT - 6) * (scaled - low) / max(high - low, least)
    new = [i for i, night in enumerate(nights) if night.name in changed]
    drawn = [f'<path class="change" d="M{x[i]:.1f} 0v{HEIGHT}"/>' for i in new]
    for piece in np.split(np.arange(len(nights)), np.flatnonzero(np.diff(finite)) + 1):
        if finite[piece[0]]:
            points = " ".join(f"{x[i]:.1f},{y[i]:.1f}" for i in piece)
            drawn.append(f'<polyline points="{points}"/>')
    last = np.flatnonzero(finite)[-1]
    drawn.append(f'<circle cx="{x[last]:.1f}" cy="{y[last]:.1f}" r="2.2"/>')
    known = values[finite]
    said = f"{len(nights)} {'night' if len(nights) == 1 else 'nights'}: {known[0]:.3g} to {known[-1]:.3g}"
    if len(known) > 2:
        said += f", between {known.min():.3g} and {known.max():.3g}"
    if new:
        said += f"; changed in {', '.join(nights[i].name for i in new)}"
    return _drawing("spark", WIDTH, said, drawn)


def lights(states: Sequence[tuple[str, str]]) -> Markup:
    """Return a row of lights, a night each: its name, and "pass", "fail" or "none".

    Red lights are taller, so that they are told from green ones without colours.
    """
    shown, words = states[-SHOWN:], {"pass": "green", "fail": "red", "none": "not run"}
    drawn = [
        f'<rect class="{state}" x="{7 * i}" y="{0 if state == "fail" else 5}" width="5" '
        f'height="{HEIGHT if state == "fail" else HEIGHT - 10}">'
        f"<title>{escape(name)}: {words[state]}</title></rect>"
        for i, (name, state) in enumerate(shown)
    ]
    red = [name for name, state in shown if state == "fail"]
    return _drawing("lights", 7 * len(shown), f"{len(shown)} nights, red: {', '.join(red) or 'none'}", drawn)


def _drawing(kind: str, width: int, said: str, drawn: Sequence[str]) -> Markup:
    return Markup(
        f'<svg class="{kind}" role="img" viewBox="0 0 {width} {HEIGHT}" width="{width}" height="{HEIGHT}" '
        f'aria-label="{escape(said)}">{"".join(drawn)}</svg>'
    )
