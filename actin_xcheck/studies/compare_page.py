"""One self-contained page from a comparison's files: all that is made here are pictures of what is stored."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from actin_xcheck.core.claim import Claim
from actin_xcheck.core.errors import UserError
from actin_xcheck.core.model import Array
from actin_xcheck.core.parameters import CAVEATS
from actin_xcheck.report.draw import Drawing, draw
from actin_xcheck.report.exhibits import Intervals, Line, Plot, Sheet
from actin_xcheck.report.figure import STYLES, Style
from actin_xcheck.report.film import FilmStrip, film_data, film_strip
from actin_xcheck.report.page import PROVENANCE, environment, put_page
from actin_xcheck.runs.store import Run
from actin_xcheck.scene.scene import Scene, parse_scene
from actin_xcheck.studies.compare import Comparison, read_comparison
from actin_xcheck.verdicts.final import Apart, FinalValue, in_a_sentence, known_badly, percent
from actin_xcheck.verdicts.localise import Parting
from actin_xcheck.verdicts.triangulate import Corner, Triangle, in_digits

_INK = -1
"""The style of what no method drew."""


@dataclass(frozen=True)
class _Section:
    """All the page says about one scene: its runs with how each is drawn, and what was made of them.

    `right` is the run that the film shows beside the first one: finite volumes where there are some.
    """

    number: int
    name: str
    scene: Scene
    runs: tuple[tuple[Run, Style], ...]
    strip: FilmStrip
    film: dict[str, Any]
    right: int
    sentence: str
    values: Drawing | None
    at_probes: Drawing | None
    charts: tuple[Drawing, ...]
    triangles: tuple[tuple[Triangle, Drawing | None], ...]
    partings: tuple[tuple[Parting, Drawing | None], ...]

    @property
    def caveat(self) -> str | None:
        """What a reader must know of the scene's closure."""
        return CAVEATS.get(self.scene.physics.closure)

    @property
    def properties(self) -> list[tuple[str, str]]:
        """What defines the scene, symbol by symbol, defaults included (non-dimensional)."""
        p, model, initial = self.scene.parameters, self.scene.model, self.scene.initial
        symbols = {"ψ": p.psi, "p": p.p, "d": p.d, "a_sat": p.a_sat, "μ₁": p.mu1, "μ₂": p.mu2, "ν": p.nu}
        stated = [(symbol, f"{value:.6g}") for symbol, value in symbols.items()]
        stated += [*self.scene.laws.stated.items(), ("ℓ₀", f"{p.l0:g}"), ("rheology", model.rheology)]
        stated += [("closure", model.closure), ("δ", model.delta), ("a(t = 0)", str(initial.a))]
        if initial.u:
            stated.append(("u(t = 0)", ", ".join(map(str, initial.u))))
        if mode := initial.eigenmode:
            stated.append(("eigenmode", f"w_{mode.m}{mode.n}, amplitude {mode.amplitude:g}"))
        if motion := self.scene.motion:
            stated.append(("motion", f"x = {motion.x}, y = {motion.y}"))
        if self.scene.source_term:
            stated.append(("source of a", str(self.scene.source_term)))
        if not model.reaction:
            stated.append(("reaction", "off"))
        stated += [("scales", self.scene.scales)] if self.scene.scales else []
        return [*stated, ("t end", f"{self.scene.time.end:g}")]


def write_comparison_page(path: Path) -> Path:
    """Write `index.html` beside the file of a comparison, from it and the runs it links, and return its path.

    Raises
    ------
    UserError : the comparison or one of its runs is missing or not whole.
    """
    path = Path(path)
    comparison = read_comparison(path)
    sections = _sections(comparison)
    html = environment(path.parent).get_template("page.html")
    text = html.render(
        parts=[("claims", "Claims"), *((f"scene-{one.number}", one.name) for one in sections), PROVENANCE],
        badly=known_badly(comparison.known, comparison.finals),
        matrix=_matrix(comparison),
        attributes=comparison.attributes,
        claims=_grouped(comparison),
        failing=[claim for claim in comparison.claims if claim.judged and not claim.holds],
        total=sum(claim.judged for claim in comparison.claims),
        unjudged=sum(not claim.judged for claim in comparison.claims),
        sections=sections,
        versions=_versions(comparison),
        file=path.name,
    )
    return put_page(path.parent, text)


def _sections(comparison: Comparison) -> list[_Section]:
    """One section a scene, in the order in which they were compared, finite elements first."""
    by_scene: dict[str, list[Run]] = {}
    for run in comparison.runs.values():
        by_scene.setdefault(run.attributes["scene_name"], []).append(run)
    return [
        _section(comparison, i, name, sorted(runs, key=_rank))
        for i, (name, runs) in enumerate(by_scene.items(), 1)
    ]


def _section(comparison: Comparison, number: int, name: str, runs: Sequence[Run]) -> _Section:
    for run in runs:
        _stated(run, "method")
        if not run.series or not len(run.times):
            raise UserError(f"{run.path}: there is nothing to draw")
    scene = parse_scene(runs[0].attributes["scene"], f"{runs[0].path}: /run scene")
    styles = {run.attributes["method_name"]: STYLES[i % len(STYLES)] for i, run in enumerate(runs)}
    strip = film_strip(runs)
    finite_volumes = (i for i, run in enumerate(runs) if i and run.family == "fv")
    numbers = {name: i for i, name in enumerate(styles)}
    finals = [one for one in comparison.finals if one.scene == name]
    return _Section(
        number=number,
        name=name,
        scene=scene,
        runs=tuple(zip(runs, styles.values(), strict=True)),
        strip=strip,
        film=film_data(runs, strip),
        right=next(finite_volumes, len(runs) - 1),
        sentence=in_a_sentence(finals),
        values=_values([one for one in finals if not one.quantity.startswith("probe")]),
        at_probes=_values([one for one in finals if one.quantity.startswith("probe")]),
        charts=(*differences([one for one in comparison.apart if one.scene == name], runs), *charts(runs)),
        triangles=tuple(
            (one, _drawn(_triangle(one, numbers), "triangles"))
            for one in comparison.triangles
            if one.scene == name
        ),
        partings=tuple(
            (one, _drawn(_parting(one, numbers), "partings"))
            for one in comparison.partings
            if one.scene == name
        ),
    )


def _values(finals: Sequence[FinalValue]) -> Drawing | None:
    """Numbers that a scene comes to, as a table; None without any."""
    if not finals:
        return None
    theory = next((one.theory.name for one in finals if one.theory), "")
    head = ("", *finals[0].methods, *filter(None, (theory,)), "codes agree to", "believe")
    rows = [
        (
            one.place,
            *(_in_a_cell(code, one) for code in one.codes),
            *([f"{one.theory.value:.10g}" if one.theory else ""] if theory else []),
            percent(one.apart) if one.methods[1:] else "",
            one.believe,
        )
        for one in finals
    ]
    title = f"What it comes to{finals[0].words.removeprefix(finals[0].place)}"
    return draw(Sheet("values", title, _UNCERTAIN, (head, *rows)), "/tables/finals")


def _in_a_cell(code: Corner, value: FinalValue) -> str:
    """A number, its uncertainty, relative too, and the observed order of what is one number."""
    said = in_digits(code, code.uncertainty)
    if "±" in said:
        said += f" ({percent(code.uncertainty / value.size)})"
    return said if np.isnan(code.order) or not value.is_one else f"{said}, order {code.order:.2f}"


_UNCERTAIN = (
    "Uncertainties are of Richardson's extrapolation from coarser runs of the same method; believed are the "
    "digits in which codes agree with theory or, where there is none, with each other and are sure."
)


@dataclass(frozen=True)
class _Margin:
    """How the claims of a kind about a scene came out, and the value of the worst over its bound."""

    verdict: str
    ratio: float

    @property
    def said(self) -> str:
        """The verdict of several claims."""
        return {"PASS": "all hold", "FAIL": "not all hold"}.get(self.verdict, "not judged")


def _matrix(comparison: Comparison) -> tuple[list[str], dict[str, list[_Margin | None]]]:
    """The kinds of claims, and by scene what came of each kind; None where nothing was claimed."""
    kinds = list(dict.fromkeys(str(claim.kind) for claim in comparison.claims))
    return kinds, {
        scene: [_margin([claim for claim in claims if claim.kind == kind]) for kind in kinds]
        for scene, claims in _grouped(comparison).items()
    }


def _margin(claims: Sequence[Claim]) -> _Margin | None:
    """The worst of claims that are judged, of the others where none is."""
    judged = [claim for claim in claims if claim.judged]
    if not judged:
        return _Margin("NOT JUDGED", np.nan) if claims else None
    ratios = [claim.value / claim.bound if claim.bound else np.inf * claim.value for claim in judged]
    verdict = "PASS" if all(claim.holds for claim in judged) else "FAIL"
    return _Margin(verdict, float(np.fmax.reduce(ratios, initial=0.0)))


def _drawn(exhibit: Intervals | None, table: str) -> Drawing | None:
    """What was compared, where there was something to compare."""
    return draw(exhibit, f"/tables/{table}/{exhibit.key}") if exhibit else None


def _triangle(one: Triangle, styles: dict[str, int]) -> Intervals | None:
    """Return a triangle as distances from theory, or from FEM without one; None where nothing was compared.

    `styles` are the numbers of the methods' colours, by name.
    """
    if not one.corners:
        return None
    origin = one.corners[2 if len(one.corners) > 2 else 0]
    xlabel = f"distance from {origin.value:.6g} ({origin.name})"
    used = [*(styles.get(name, _INK) for name in one.methods), _INK]
    return _intervals(one, origin, 1.0, xlabel, used[: len(one.corners)])


def _parting(one: Parting, styles: dict[str, int]) -> Intervals | None:
    """Return where codes part as distances from FEM, in sums of its uncertainty and that of FV."""
    if not one.corners:
        return None
    elements, _, own = one.corners
    unit = elements.uncertainty + own.uncertainty
    xlabel = "distance from FEM, in uncertainties"
    return _intervals(one, elements, unit, xlabel, [styles.get(name, _INK) for name in one.methods])


def _intervals(
    one: Triangle | Parting, origin: Corner, unit: float, xlabel: str, styles: Sequence[int]
) -> Intervals:
    return Intervals(
        key=one.key,
        title=one.words,
        note=one.sentence,
        xlabel=xlabel,
        names=tuple(corner.name for corner in one.corners),
        values=np.array([corner.value - origin.value for corner in one.corners]) / unit,
        uncertainties=np.array([corner.uncertainty for corner in one.corners]) / unit,
        styles=tuple(styles),
    )


def _stated(run: Run, name: str) -> dict[str, Any]:
    """What a run states in JSON; UserError where it states none."""
    try:
        found = json.loads(run.attributes[name])
    except ValueError:
        found = None
    if not isinstance(found, dict):
        raise UserError(f"{run.path}: /run states no {name} in JSON")
    return found


def _rank(run: Run) -> int:
    return {"fem": 0, "fv": 1}.get(run.family, 2)


def _grouped(comparison: Comparison) -> dict[str, list[Claim]]:
    """Claims by scene, in their order; scenes of which one fails first."""
    by_scene: dict[str, list[Claim]] = {}
    for claim in comparison.claims:
        by_scene.setdefault(claim.scene, []).append(claim)
    fails = {name: any(one.judged and not one.holds for one in claims) for name, claims in by_scene.items()}
    return {name: by_scene[name] for name in sorted(by_scene, key=lambda name: not fails[name])}


def _versions(comparison: Comparison) -> dict[str, str]:
    """What computed: name -> version, all of them where runs and comparison differ."""
    found: dict[str, dict[str, None]] = {}  # dicts keep the order, sets do not
    stated: list[dict[str, Any]] = [_stated(run, "versions") for run in comparison.runs.values()]
    for versions in stated:
        for name, version in versions.items():
            found.setdefault(name, {})[str(version)] = None
    return {name: ", ".join(versions) for name, versions in found.items()}


_ROUND_OFF = 1e-17
"""Residuals below it, exact zeros above all, are drawn here: a logarithm has no place for them."""


@dataclass(frozen=True)
class _Quantity:
    """What a chart shows: series of `/run/series`, or components of one; `names` tell its lines apart."""

    title: str
    note: str
    series: tuple[str, ...]
    component: tuple[int, ...] = ()
    log: bool = False
    names: tuple[str, ...] = ("", "")

    def lines(self, run: Run) -> list[Array]:
        """Return the lines (n,) of one run."""
        if self.component:
            return [run.series[self.series[0]][:, i] for i in self.component]
        return [run.series[name] for name in self.series]


_QUANTITIES = (
    _Quantity("Area |Ω|", "", ("area",)),
    _Quantity("Polarity", "minor over major axis of the smallest ellipse around the rim", ("polarity",)),
    _Quantity("Centroid", "x solid, y dashed", ("centroid",), component=(0, 1), names=(" x", " y")),
    _Quantity(
        "Extrema of a", "largest solid, smallest dashed", ("a_max", "a_min"), names=(" largest", " smallest")
    ),
    _Quantity("Total actin ∫a", "", ("total_actin",)),
    _Quantity("|Balance residual|", "of total actin, relative, per step", ("balance_residual",), log=True),
)
_GROWTH = _Quantity("Mode amplitude", "predicted growth dotted", ("mode_amplitude",), log=True)
_GAUGED = (
    _Quantity(
        "Net force", "that the gauge carries; x solid, y dashed", ("net_force",), (0, 1), names=(" x", " y")
    ),
    _Quantity("Net torque", "that the gauge carries, about the centroid", ("net_torque",)),
)


def charts(runs: Sequence[Run]) -> list[Drawing]:
    """Return the charts of one scene, and where in a run's file their numbers stand."""
    measured = {name for run in runs for name in run.series}
    quantities = [q for q in (_GROWTH, *_QUANTITIES, *_GAUGED) if measured.issuperset(q.series)]
    return [draw(chart(one, runs), f"/run/series/{', '.join(one.series)}") for one in quantities]


def differences(apart: Sequence[Apart], runs: Sequence[Run]) -> list[Drawing]:
    """Return charts of what codes that lie over each other differ by: a chart a quantity.

    Differences of two codes are lines where they have taken the same steps; at output times stand points with
    bars, the sums of both uncertainties, and what is known without either.
    """
    by_name = {run.attributes["method_name"]: (number, run) for number, run in enumerate(runs)}
    found = []
    for quantity in dict.fromkeys(one.quantity for one in apart):
        rows = [one for one in apart if one.quantity == quantity]
        origin, lines = rows[0].origin, []
        for name in dict.fromkeys(one.name for one in rows):
            points = [one for one in rows if one.name == name]
            number, run = by_name.get(name, (_INK, None))
            if run and np.array_equal(run.series["time"], (first := by_name[origin][1]).series["time"]):
                gone = run.series[quantity] - first.series[quantity]
                lines.append(Line("", run.series["time"], gone, style=number))
            time, value, spread = (
                np.array([getattr(one, key) for one in points]) for key in ("time", "value", "uncertainty")
            )
            known = {"guide": True, "shape": "x"} if run is None else {"style": number}
            lines.append(Line(name, time, value, points=True, y_spread=spread, **known))
        title = f"{quantity.replace('_', ' ').capitalize()}, less that of {origin}"
        plot = Plot(f"{quantity}-apart", title, _BARS, "t", tuple(lines), levels=(("", 0.0),))
        found.append(draw(plot, "/tables/apart"))
    return found


_BARS = "bars are sums of both uncertainties"


def chart(quantity: _Quantity, runs: Sequence[Run]) -> Plot:
    """Draw one quantity of all runs."""
    lines = [
        line
        for number, run in enumerate(runs)
        if all(name in run.series for name in quantity.series)
        for line in _lines(quantity, run, number)
    ]
    key = quantity.title.lower()
    return Plot(key, quantity.title, quantity.note, "t", tuple(lines), logy=quantity.log)


def _lines(quantity: _Quantity, run: Run, style: int) -> Iterator[Line]:
    """The lines of a run, a cross where it fails, and the growth that was predicted."""
    time, method = run.series["time"], run.attributes["method_name"]
    outcome = run.attributes["outcome"]
    for number, (values, name) in enumerate(zip(quantity.lines(run), quantity.names, strict=False)):
        shown = np.clip(np.abs(values), _ROUND_OFF, None) if quantity.log else values
        yield Line(method + name, time, shown, dashed=number > 0, style=style)
        if outcome != "completed":
            said = f"{method}{name}: {outcome}"
            yield Line(said, time[-1:], shown[-1:], points=True, style=style, shape="x")
    if quantity is _GROWTH and "growth_rate_predicted" in run.attributes:
        amplitude = np.abs(quantity.lines(run)[0][0])
        growth = np.exp(float(run.attributes["growth_rate_predicted"]) * time)
        yield Line(f"{method}, predicted", time, amplitude * growth, guide=True)
