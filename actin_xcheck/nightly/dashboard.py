"""The pages of the nights: one for each, from its own file, and one over all, from the history."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from jinja2 import Environment

from actin_xcheck.core.claim import Claim
from actin_xcheck.core.errors import UserError
from actin_xcheck.nightly.groups import Group, group_of
from actin_xcheck.nightly.history.database import Counted, read_claims, read_nights, read_series
from actin_xcheck.nightly.history.record import Judged, Kind, Series
from actin_xcheck.nightly.history.steps import events
from actin_xcheck.nightly.nights import HISTORY, nights_in
from actin_xcheck.nightly.record import FILE_NAME, Done, Kept, read_night
from actin_xcheck.nightly.sparkline import SHOWN, lights, sparkline
from actin_xcheck.report.cells import SEQUENTIAL, Brush, Colours, Panel, closed_rim, scale_ends, span, window
from actin_xcheck.report.environment import environment, put_page
from actin_xcheck.report.film import on_triangles
from actin_xcheck.runs.store import read_comparison
from actin_xcheck.runs.workers import Report, work_off
from actin_xcheck.studies.chart import record as charting
from actin_xcheck.studies.compare_page import write_report
from actin_xcheck.studies.faults.catalogue import FAULTS

EVENTS = 60
"""Changes on the page at most; `history --steps` has them all."""


THUMBNAIL = 60
"""Dots per inch of a scene's picture on the page of a night, twice fewer than in its film strip."""

_SURVEYS = {"Error against work": charting.FILE_NAME, "Where methods fail": "frontier.h5"}
"""Reports that stand beside the nights, by the file each is made from."""


@dataclass(frozen=True)
class _Row:
    """A claim of a night with where it comes from."""

    number: int
    claim: Claim
    group: Group
    check: Done
    file: str

    @property
    def state(self) -> str:
        """As in the style sheet."""
        return self.claim.verdict.lower().replace(" ", "-")


@dataclass(frozen=True)
class _Light:
    """A group of claims as it stands: its verdicts, and how it was in each night."""

    group: Group
    verdicts: Counter[str]
    before: Sequence[tuple[str, str]] = ()

    @property
    def state(self) -> str:
        """ "fail" where one fails, "none" where nothing was judged."""
        if self.verdicts["FAIL"]:
            return "fail"
        return "pass" if self.verdicts["PASS"] else "none"


def write_scene_pages(folder: Path) -> None:
    """Write the report of every comparison in a night's folder, with the film of its cell, beside it."""
    places = sorted(path.parent for path in (folder / "checks").glob("*/comparison.h5"))
    work_off(_scene_page, places, lambda label, done, total: None, str)


def _scene_page(folder: Path, report: Report) -> None:
    write_report(folder)


def write_night_page(folder: Path) -> Path:
    """Write `folder/index.html` from `folder/night.jsonl` and return its path.

    UserError where the file is missing or not whole.
    """
    folder = Path(folder)
    night = read_night(folder)
    found = [
        (claim, group_of(claim), done, file)
        for done in night.done
        for claim, file in zip(done.claims, done.files, strict=True)
    ]
    rank = {"FAIL": 0, "PASS": 1, "NOT JUDGED": 2}
    found.sort(key=lambda row: (list(Group).index(row[1]), rank[row[0].verdict]))
    rows = [_Row(number, *row) for number, row in enumerate(found, 1)]
    text = _environment(folder).get_template("night.html").render(
        night=night,
        begun=night.begun,
        rows=rows,
        groups=[(group, [row for row in rows if row.group is group]) for group in Group],
        lights=[
            _Light(group, Counter(row.claim.verdict for row in rows if row.group is group))
            for group in Group
            if any(row.group is group for row in rows)
        ],
        failing=[row for row in rows if row.claim.verdict == "FAIL"],
        verdicts=Counter(claim.verdict for claim in night.claims),
        fault=FAULTS.get(night.begun.fault),
        called=sum(night.begun.fault in done.reached for done in night.done),
        pages=_pages(night),
        scenes=[(done, page, _thumbnail(folder / done.folder)) for done, page in _scenes(night)],
        surveys=_surveys(folder.parent, "../"),
        numbers={done.name: _by_use(done) for done in night.done},
        file=folder / FILE_NAME,
    )  # fmt: skip
    return put_page(folder, text)


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
    compared = [done for done in night.done if (night.folder / done.folder / "comparison.h5").exists()]
    return [(done, pages[done.name]) for done in compared if done.name in pages]


def _thumbnail(folder: Path) -> Panel | None:
    """The cell of a comparison's first run in the end; None where its files are gone."""
    try:
        run = next(iter(read_comparison(folder / "comparison.h5").runs.values()))
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
    last = counted[-1] if counted else None
    shown = {one.night.name: read_claims(history, one.night.name) for one in counted[-SHOWN:]}
    claims = shown[last.night.name] if last else {}
    text = _environment(reports).get_template("dashboard.html").render(
        last=last,
        lights=_lights(shown),
        claims=_by_check(claims, series, when),
        numbers=_by_kind(series, last, when),
        events=changed[:EVENTS],
        more=max(len(changed) - EVENTS, 0),
        nights=_nights(counted, folders),
        folders=folders,
        anchors=_anchors(folders[last.night.name]) if last and last.night.name in folders else {},
        films=_films(folders[last.night.name]) if last and last.night.name in folders else {},
        surveys=_surveys(reports, ""),
    )  # fmt: skip
    return put_page(reports, text)


def _environment(folder: Path) -> Environment:
    made = environment(folder)
    made.filters["lights"] = lights
    made.filters["commit"] = _commit
    return made


def _commit(commit: str) -> str:
    """As it is read; one with changes that were not committed stays told from the others."""
    revision, dash, state = commit.partition("-")
    return revision[:12] + dash + state


def _lights(shown: dict[str, dict[str, Judged]]) -> list[_Light]:
    """The groups with their lights in the nights that are shown."""
    counts = {
        name: {group: Counter[str]() for group in Group} | _verdicts(claims) for name, claims in shown.items()
    }
    found = []
    for group in Group:
        nights = [(name, _Light(group, counts[name][group])) for name in shown]
        if any(light.state != "none" for _, light in nights):
            before = tuple((name, light.state) for name, light in nights)
            found.append(_Light(group, nights[-1][1].verdicts, before))
    return found


def _verdicts(claims: dict[str, Judged]) -> dict[Group, Counter[str]]:
    found: dict[Group, Counter[str]] = {}
    for one in claims.values():
        found.setdefault(group_of(one.claim), Counter())[one.claim.verdict] += 1
    return found


@dataclass(frozen=True)
class _Trend:
    """A claim of the last night with its line through all nights."""

    judged: Judged
    group: Group
    line: str

    @property
    def state(self) -> str:
        """As in the style sheet."""
        return self.judged.claim.verdict.lower().replace(" ", "-")


def _by_check(
    claims: dict[str, Judged], series: dict[str, Series], when: dict[str, set[str]]
) -> dict[str, list[_Trend]]:
    """The claims of the last night by their checks, checks with red ones first."""
    found: dict[str, list[_Trend]] = {}
    for key, one in claims.items():
        known = f"claim/{key}"
        line = sparkline(series[known], when.get(known, ())) if known in series else ""
        found.setdefault(one.check, []).append(_Trend(one, group_of(one.claim), line))
    return dict(
        sorted(found.items(), key=lambda item: (not any(t.state == "fail" for t in item[1]), item[0]))
    )


def _by_kind(
    series: dict[str, Series], last: Counted | None, when: dict[str, set[str]]
) -> dict[Kind, list[tuple[Series, str]]]:
    """The numbers that the last night has, claims apart, with their lines."""
    found: dict[Kind, list[tuple[Series, str]]] = {}
    for key, one in series.items():
        if one.kind is not Kind.CLAIM and last and one.nights[-1].name == last.night.name:
            found.setdefault(one.kind, []).append((one, sparkline(one, when.get(key, ()))))
    return {kind: found[kind] for kind in Kind if kind in found}


@dataclass(frozen=True)
class _NightRow:
    """A line of the table of nights."""

    name: str
    date: str
    commit: str
    machine: str
    minutes: float
    verdicts: Counter[str]
    not_run: int
    fault: str
    page: str
    state: str


def _nights(counted: Iterable[Counted], folders: dict[str, Kept]) -> list[_NightRow]:
    """All nights, the last one first; those with a fault or without an end have a folder alone."""
    rows = []
    for one in counted:
        night, kept = one.night, folders.get(one.night.name)
        rows.append(
            _NightRow(
                night.name, night.date, night.commit, night.machine, night.seconds / 60, one.verdicts,
                len(kept.left_out) if kept else 0, "", _page(kept),
                "fail" if one.verdicts["FAIL"] else "pass" if one.verdicts["PASS"] else "none",
            )
        )  # fmt: skip
    known = {row.name for row in rows}
    for name, kept in folders.items():
        if name in known:
            continue
        begun = kept.begun
        rows.append(
            _NightRow(
                name, begun.date, begun.versions["commit"], begun.machine, kept.seconds / 60,
                Counter(claim.verdict for claim in kept.claims),
                len(kept.left_out), begun.fault, _page(kept),
                "fail" if kept.red else "pass" if kept.closed else "none",
            )
        )  # fmt: skip
    return sorted(rows, key=lambda row: row.date, reverse=True)


def _page(kept: Kept | None) -> str:
    if kept is None or not (kept.folder / "index.html").exists():
        return ""
    return f"{kept.folder.name}/index.html"


def _anchors(kept: Kept) -> dict[str, str]:
    """Where checks stand on their night's page."""
    return {
        done.name: f"{kept.folder.name}/index.html#check-{number}" for number, done in enumerate(kept.done, 1)
    }


def _films(kept: Kept) -> dict[str, str]:
    """Where the films of a night's comparisons are."""
    return {done.name: f"{kept.folder.name}/{page}" for done, page in _scenes(kept)}
