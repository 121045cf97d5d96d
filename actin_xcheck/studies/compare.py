"""Scenes x methods: runs, what is claimed of them, which corner is off, to what their integrals are known."""

from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace
from html import escape
from itertools import groupby
from math import nan
from pathlib import Path
from typing import Any

from actin_xcheck.core.claim import Claim
from actin_xcheck.core.errors import UserError
from actin_xcheck.report.page import read_claims
from actin_xcheck.runs.method import Method, find_methods, with_lent_balance
from actin_xcheck.runs.numerics import Numerics, suited
from actin_xcheck.runs.records import read_table
from actin_xcheck.runs.store import Run, read_run, reading
from actin_xcheck.scene.scene import Scene
from actin_xcheck.studies.accurate import accurate
from actin_xcheck.studies.stored import Ran, Stored, companions_of
from actin_xcheck.studies.study import Report, Study, Table, Task, counted
from actin_xcheck.verdicts.final import Apart, FinalValue, apart, final_values, in_a_sentence, known_badly
from actin_xcheck.verdicts.judge import KnownTo, again, judge, known_to
from actin_xcheck.verdicts.localise import Parting, localise, parted
from actin_xcheck.verdicts.triangulate import Levels, Triangle, triangulate

FILE_NAME = "compare.h5"

DEFAULT_SCENES = (
    *("mode-11-wall", "static-decay", "growing-disk", "fig14-four-fronts", "tense-cell", "lopsided-cell"),
)
"""The last two have no parameter at its value in Table 2: a default in the place of a scene's value shows."""

DEFAULT_METHODS = ("fem-p1-imex2", "fv")
"""Two codes that share nothing but the equations, of the same orders in h and dt."""

ARTICLES_METHODS = ("fem-p1-paper", "fv-paper")
"""The same in the article's scheme, for scenes that state the article's step."""

TO_AN_ACCURACY = ("fem", "fv")
"""Methods where an accuracy is asked for: whichever elements reach it, and the volumes."""

DEFAULT_REFINE = 5
"""2113 nodes for every scene: a comparison is over in about a minute."""

PICTURES = 20
"""Of a film, about."""

JUDGED = 0.5
"""Seconds in which the runs of a scene are judged, about."""


def compare(jobs: Sequence[Stored]) -> Study:
    """Run every job and its companions, and judge the stored runs, scene by scene: its jobs stand together.

    Where elements part from volumes with a force balance of their own, it asks for these with the elements'
    and says whether transport or mechanics is what differs.  The report has the claims, the tables `runs`,
    `triangles` (see `Triangle`), `partings` (see `Parting`) and `known_to` (see `KnownTo`), and links the
    files: `/runs/<scene>/<method>`, `/companions/<scene>/<method>/<times coarser>`, `/lent/...`.
    """
    beside = companions(jobs)
    levels = [_levels(job, beside) for job in jobs]
    runs = yield from _ran(levels)
    return (yield from _reported(levels, runs))


def compare_to(accuracy: float, scenes: Sequence[Scene], methods: Sequence[str]) -> Study:
    """The same of runs that are each as fine as an accuracy needs, see `accurate.accurate`."""
    found = yield from accurate(scenes, methods, accuracy, PICTURES)
    rows = [_row(job, times, ran, "runs") for levels in found for times, (job, ran) in enumerate(levels)]
    return (yield from _reported([tuple(job for job, _ in levels) for levels in found], rows))


def _reported(levels: Sequence[tuple[Stored, ...]], runs: list["RunRow"]) -> Study:
    """Judge runs that are there, each method's finest first."""
    by_scene = [tuple(of_one) for _, of_one in groupby(levels, lambda one: one[0].scene.name)]
    found: list[JudgedScene] = yield [Task(judged, of_one, JUDGED) for of_one in by_scene]
    partings, lent = yield from _localised(by_scene, found)
    runs += lent
    claims = tuple(claim for one in found for claim in one.claims)
    finals = [one for each in found for one in each.finals]
    badly = known_badly([one.known for one in found], finals)
    return Report(
        counted(claims, f"claims hold at this resolution; {badly}" if badly else "claims hold"),
        _LEAD,
        {
            "finals": Table(
                "What the scenes come to", finals, "At the last output time that all runs reach."
            ),
            "apart": Table("How far apart", [one for each in found for one in each.apart], _APART),
            "runs": Table("Runs", runs, _RUNS),
            "triangles": Table("Which corner is off?", [one for each in found for one in each.triangles]),
            "partings": Table("Where do they part?", [one for each in partings for one in each.partings]),
            "known_to": Table("Known to", [one.known for one in found], "Relative errors; nan: not known."),
        },
        claims,
        (*(one.sentence for one in partings), *filter(None, (in_a_sentence(one.finals) for one in found))),
        links={one.place: one.file for one in runs},
        values=finals,
        known={
            one.known.scene: {name: 100 * error for name, error in one.known.errors.items()} for one in found
        },
    )


def _ran(
    levels: Sequence[Sequence[Stored]], what: str = "runs"
) -> Generator[list[Task], list[Ran], list["RunRow"]]:
    """Ask for the runs of levels, finest first, and return their rows."""
    every = [(job, times) for finest_first in levels for times, job in enumerate(finest_first)]
    answers = yield [job.task for job, _ in every]
    return [_row(job, times, answer, what) for (job, times), answer in zip(every, answers, strict=True)]


def _localised(
    by_scene: Sequence[Sequence[tuple[Stored, ...]]], found: Sequence["JudgedScene"]
) -> Generator[list[Task], list[Any], tuple[list["Localised"], list["RunRow"]]]:
    """Where codes part, ask for the volumes with the force balance of the elements, and what that tells.

    What is among the jobs already is not asked for again.  Returns what was told, and the rows of the runs.
    """
    asked, others = [], {}
    for levels, one in zip(by_scene, found, strict=True):
        known = {finest_first[0].numerics.method.name: finest_first for finest_first in levels}
        for first, last in one.parted:
            if method := with_lent_balance(known[last][0].numerics.method):
                lent = known.get(method.name) or tuple(_lent(job, method) for job in known[last])
                if method.name not in known:
                    others[lent[0].file] = lent
                asked.append((known[first], lent, known[last]))
    rows = (yield from _ran([*others.values()], "lent")) if others else []
    told = (yield [Task(localised, three, JUDGED) for three in asked]) if asked else []
    return told, rows


def _lent(job: Stored, method: Method) -> Stored:
    """A run of volumes with another force balance."""
    file = job.file.removeprefix(f"{job.scene.name}--{job.numerics.method.name}")
    numerics = replace(job.numerics, method=method)
    return replace(job, numerics=numerics, file=f"{job.scene.name}--{method.name}{file}")


def jobs_of(
    scenes: Sequence[Scene],
    methods: Sequence[Method] | None,
    refine: int | None,
    dt: float | None,
    rtol: float | None = None,
) -> list[Stored]:
    """Return the runs of a comparison, each with a file of its own; without methods those that suit a scene.

    `rtol` is for the adaptive methods among them; the others take equal steps of at most `dt`.
    """
    jobs = []
    for scene in scenes:
        _, step = suited(scene, refine, dt)
        for method in methods or _suited(scene):
            file = f"{scene.name}--{method.name}.vtkhdf"
            tolerance = rtol if method.adaptive else None
            numerics = Numerics(method, refine or DEFAULT_REFINE, step, tolerance)
            jobs.append(Stored(scene, numerics, file, pictures=PICTURES))
    return jobs


def _suited(scene: Scene) -> list[Method]:
    return find_methods(ARTICLES_METHODS if scene.as_published.dt else DEFAULT_METHODS)


def companions(jobs: Sequence[Stored]) -> list[Stored]:
    """The coarser runs that give the jobs' uncertainties: errors in space and in time grow alike.

    That is h doubled, dt ~ h^(order_h/order_dt), rtol ~ h^order_h.
    None where a scene is run by one code only, for there is nothing to hold against the other, and none for
    a method that declares no order in space.
    """
    families: dict[str, set[str]] = {}
    for job in jobs:
        families.setdefault(job.scene.name, set()).add(job.numerics.method.family)
    return [
        one
        for job in jobs
        if len(families[job.scene.name]) > 1 and job.numerics.method.order_h
        for one in companions_of(job)
    ]


def _levels(job: Stored, beside: Sequence[Stored]) -> tuple[Stored, ...]:
    """A job and its companions, finest first."""
    asked = job.scene.name, job.numerics.method
    return job, *(one for one in beside if (one.scene.name, one.numerics.method) == asked)


@dataclass(frozen=True)
class JudgedScene:
    """What the runs of a scene come to: claims of single runs and pairs, then those of the triangles; and
    which pairs of methods part.
    """

    claims: tuple[Claim, ...]
    triangles: tuple[Triangle, ...]
    known: KnownTo
    parted: tuple[tuple[str, str], ...] = ()
    finals: tuple[FinalValue, ...] = ()
    apart: tuple[Apart, ...] = ()


def judged(asked: Sequence[Sequence[Stored]], folder: Path) -> JudgedScene:
    """Judge the runs of a scene, of each method the one asked for and its companions, from their files."""
    scene = asked[0][0].scene
    levels = [_read(jobs, folder) for jobs in asked]
    runs = {one.method.name: one.runs[0] for one in levels}
    triangles = triangulate(scene, levels)
    of_triangles = (one.claim(again(scene, *(runs[name] for name in one.methods))) for one in triangles)
    claims = (*judge(scene, runs), *of_triangles)
    return JudgedScene(
        claims=claims,
        triangles=tuple(triangles),
        known=known_to(scene, levels),
        finals=tuple(final_values(scene, levels)),
        apart=tuple(apart(scene, levels)),
        parted=tuple(parted(triangles)),
    )


def _read(jobs: Sequence[Stored], folder: Path) -> Levels:
    """A run and its companions, from their files."""
    return Levels(jobs[0].numerics.method, tuple(read_run(folder / job.file) for job in jobs))


@dataclass(frozen=True)
class Localised:
    """Where two codes part, by every quantity of which they do."""

    partings: tuple[Parting, ...]

    @property
    def sentence(self) -> str:
        """Of the quantity of which they part most."""
        most = self.partings[0]
        return f"{most.scene}: {most.sentence}"


def localised(asked: tuple[Sequence[Stored], Sequence[Stored], Sequence[Stored]], folder: Path) -> Localised:
    """Say where elements and volumes part: of both, and of the volumes with a lent force balance between."""
    elements, lent, own = (_read(jobs, folder) for jobs in asked)
    return Localised(tuple(localise(asked[0][0].scene, elements, lent, own)))


@dataclass(frozen=True)
class RunRow:
    """A run of a comparison: how it was made, how it ended, its place in the report and its file."""

    scene: str
    method: str
    times_coarser: int
    refine: int
    dt: float
    rtol: float
    outcome: str
    message: str
    seconds: float
    place: str
    file: str


def _row(job: Stored, times: int, ran: Ran, what: str) -> RunRow:
    numerics, name = job.numerics, f"{job.scene.name}/{job.numerics.method.name}"
    place = f"companions/{name}/{times}" if times else f"{what}/{name}"
    return RunRow(
        job.scene.name,
        numerics.method.name,
        times,
        numerics.refine,
        numerics.dt,
        nan if numerics.rtol is None else numerics.rtol,
        ran.outcome,
        ran.message,
        ran.seconds,
        place,
        job.file,
    )


@dataclass(frozen=True, repr=False)
class Comparison:
    """A stored comparison.

    Attributes
    ----------
    path, attributes : its file, and what that states about the whole.
    claims : what was judged.
    runs : those that were asked for, by "scene/method".
    triangles, partings, known, finals, apart : see `JudgedScene` and `Localised`, of all scenes.
    """

    path: Path
    attributes: dict[str, Any]
    claims: tuple[Claim, ...]
    runs: dict[str, Run]
    triangles: tuple[Triangle, ...]
    partings: tuple[Parting, ...]
    known: tuple[KnownTo, ...]
    finals: tuple[FinalValue, ...]
    apart: tuple[Apart, ...]

    def __repr__(self) -> str:
        return f"<Comparison of {len(self.runs)} runs: {counted(self.claims, 'claims hold')}, in {self.path}>"

    def _repr_html_(self) -> str:
        """For notebooks: what scenes come to and the claims that fail."""
        from actin_xcheck.report.notebook import table

        said = [in_a_sentence(list(of)) for _, of in groupby(self.finals, lambda one: one.scene)]
        numbers = [
            (
                one.scene,
                one.words,
                *(f"{each.name}: {each.value:.6g} ± {each.uncertainty:.1g}" for each in one.corners),
            )
            for one in self.finals
        ]
        failing = [(one.sentence,) for one in self.claims if one.judged and not one.holds]
        parts = [f"<p>{escape(one)}</p>" for one in (repr(self)[1:-1], *said)]
        parts += [table(("fails",), failing)] if failing else []
        return "".join([*parts, table(("scene", "at the end", "", "", ""), numbers)])

    def to_pandas(self) -> Any:
        """The claims as a `pandas.DataFrame`, for which pandas must be installed."""
        import pandas

        return pandas.DataFrame([vars(one) | {"verdict": one.verdict} for one in self.claims])


def read_comparison(path: Path) -> Comparison:
    """Return the comparison stored in `path` and, through its links, the runs.

    UserError as `read_run`, for the comparison or for one of its runs.
    """
    with reading(path, "comparison") as file:
        attributes, claims = dict(file.attrs), tuple(read_claims(file))
        rows = read_table(file["tables/runs"], RunRow)
        triangles = read_table(file["tables/triangles"], Triangle)
        # comparisons that were made before they had these tables have none
        partings = read_table(file["tables/partings"], Parting) if "tables/partings" in file else []
        finals = read_table(file["tables/finals"], FinalValue) if "tables/finals" in file else []
        far = read_table(file["tables/apart"], Apart) if "tables/apart" in file else []
        known = read_table(file["tables/known_to"], KnownTo)
        links = {
            f"{row.scene}/{row.method}": file.get(row.place, getlink=True).filename
            for row in rows
            if row.place.startswith("runs/")
        }
    folder = Path(path).parent
    for name, link in links.items():
        if not (folder / link).resolve().is_relative_to(folder.resolve()):
            raise UserError(f"{path}: the run {name} is linked outside of the comparison's folder, {link}")
    runs = {name: read_run(folder / link) for name, link in links.items()}
    return Comparison(
        path=Path(path),
        attributes=attributes,
        claims=claims,
        runs=runs,
        triangles=tuple(triangles),
        partings=tuple(partings),
        known=tuple(known),
        finals=tuple(finals),
        apart=tuple(far),
    )


_APART = (
    "Integrals by each code and by theory, less those by the first code, and the sum of both uncertainties."
)

_LEAD = (
    "The moving-cell model of George, Stéphanou and Madzvamuse, “Mathematical modelling and numerical "
    "simulations of actin dynamics in the eukaryotic cell”, computed with finite elements (FEM) and finite "
    "volumes (FV) and held against theory, exact solutions and each other. The methods fv and fv-paper share "
    "nothing with FEM but the equations; to the other finite volumes the force balance of the elements is "
    "lent, by which it is found whether codes that part do so in transport or in mechanics. All quantities "
    "are non-dimensional, equation numbers those of the article."
)

_RUNS = "Those asked for, then the coarser ones beside them, which give their uncertainties."
