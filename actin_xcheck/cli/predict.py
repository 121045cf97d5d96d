"""`predict`: what theory says of a parameter set, as a table or as JSON, and all of it as a report."""

import inspect
import json
import math
import re
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

from actin_xcheck.cli.conduct import as_command, scene_word, study_command
from actin_xcheck.core.errors import UserError
from actin_xcheck.core.parameters import Closure, Delta, Parameters, Rheology

if TYPE_CHECKING:
    from actin_xcheck.core.model import Model
    from actin_xcheck.studies.study import Study
    from actin_xcheck.theory.exact import Threshold

app = typer.Typer(
    no_args_is_help=True,
    help="Exact growth rates and thresholds of the disk, delta constant; a report of all linear theory.",
)


def _scene_word(given: str | None) -> str | None:
    return given and scene_word(given)


SceneOption = Annotated[
    str | None,
    typer.Option("--scene", help="What is not given is this scene's; else Table 2's.", callback=_scene_word),
]
Psi = Annotated[float | None, typer.Option(help="Contractile tonicity, non-dimensional.")]
P = Annotated[float | None, typer.Option(help="Pressure coefficient, non-dimensional.")]
D = Annotated[float | None, typer.Option(help="Diffusion coefficient.", min=0.0)]
ASat = Annotated[float | None, typer.Option(help="Saturation concentration.")]
Mu1 = Annotated[float | None, typer.Option(help="Shear viscosity.")]
Mu2 = Annotated[float | None, typer.Option(help="Bulk viscosity.")]
Nu = Annotated[float | None, typer.Option(help="Poisson's ratio.")]
ClosureOption = Annotated[
    Closure | None, typer.Option(help="Conditions on the rim; default: reference-normal.")
]
RheologyOption = Annotated[
    Rheology | None, typer.Option(help="Which displacement the elastic stress sees; default: viscoelastic.")
]
DeltaOption = Annotated[Delta | None, typer.Option(help="Constant delta, none or full; default: none.")]
Modes = Annotated[str, typer.Option("--m", help="Angular numbers: 3, or 0:8 (inclusive).")]
Certify = Annotated[
    bool,
    typer.Option(
        "--certify", help="Prove it in ball arithmetic; needs python-flint, as actin-xcheck[certify] has it."
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON.")]


def _model(
    psi: Psi = None,
    p: P = None,
    d: D = None,
    a_sat: ASat = None,
    mu1: Mu1 = None,
    mu2: Mu2 = None,
    nu: Nu = None,
    closure: ClosureOption = None,
    rheology: RheologyOption = None,
    delta: DeltaOption = None,
    scene: SceneOption = None,
) -> "Model":
    """What is given, else what the scene says, else the defaults; checked where types do not."""
    from dataclasses import asdict

    from actin_xcheck.core.model import Laws, Model
    from actin_xcheck.scene.scene import load_scene

    given = {"psi": psi, "p": p, "d": d, "a_sat": a_sat, "mu1": mu1, "mu2": mu2, "nu": nu}
    values: dict[str, float] = {name: value for name, value in given.items() if value is not None}
    laws = Laws()
    if scene:
        physics = load_scene(scene).physics
        values, laws = asdict(physics.parameters) | values, physics.laws
        closure, rheology = closure or physics.closure, rheology or physics.rheology
        delta = delta or physics.delta
    elif missing := [name for name in ("psi", "p") if name not in values]:
        raise UserError(f"--{missing[0]}: is missing; valid: a number, or --scene")
    parameters, delta = Parameters(**values), delta or Delta.NONE
    ranges = dict.fromkeys(("psi", "p"), "-1e6 and 1e6") | dict.fromkeys(
        ("d", "a_sat", "mu1"), "1e-6 and 1e6"
    )
    for name, span in {**ranges, "mu2": "0 and 1e6"}.items():
        least, most = map(float, span.split(" and "))
        if not least <= (value := getattr(parameters, name)) <= most:
            option = name.replace("_", "-")
            raise UserError(f"--{option}: {value:g} is out of range; valid: a number between {span}")
    if not -1 < parameters.nu < 0.5:
        raise UserError(f"--nu: {parameters.nu:g} is out of range; valid: -1 < nu < 0.5")
    if delta not in {Delta.NONE, Delta.FULL}:
        raise UserError(f"--delta: {delta} varies in space; theory takes it constant; valid: none, full")
    rheology, closure = rheology or Rheology.VISCOELASTIC, closure or Closure.REFERENCE_NORMAL
    return Model(parameters, rheology, closure, delta, laws=laws)


def of_a_model(sought: str = "") -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Give a function the model that options and a scene say, and which of its readings they leave open.

    Its own parameters come after those of the model; the parameter that is sought is no option.
    """

    def decorate(function: Callable[..., Any]) -> Callable[..., Any]:
        own = [*inspect.signature(function).parameters.values()][2:]
        options = [one for one in inspect.signature(_model).parameters.values() if one.name != sought]

        def commanded(**asked: Any) -> Any:
            given: dict[str, Any] = {one.name: asked.pop(one.name) for one in options}
            free = [name for name in ("closure", "rheology") if not (given[name] or given["scene"])]
            return function(_model(**given | ({sought: 0.0} if sought else {})), free, **asked)

        return as_command(commanded, function, [*options, *own])

    return decorate


@app.command("modes")
@of_a_model()
def modes_command(
    model: "Model",
    free: Sequence[str],
    m: Modes = "0:8",
    above: Annotated[float, typer.Option(help="Give all rates with a real part above this.")] = 0.0,
    certify: Certify = False,
    as_json: Json = False,
) -> None:
    """Every growth rate above a bound, per angular number; counted by the argument principle.

    With --certify the list is a theorem, and so is the number from which on no angular number has a mode.
    """
    from rich.table import Table

    from actin_xcheck.cli.conduct import print_table

    if not math.isfinite(above):
        raise UserError(f"--above: {above:g} is no number; valid: a finite number")
    try:
        found, said = (_certified if certify else _counted)(model, _numbers(m), above)
    except (ValueError, ArithmeticError) as error:
        raise UserError(f"--above: {error}") from None
    if as_json:
        print(json.dumps({"modes": found, "complete": True, "conditions": _conditions(model), **said}))
        return
    print(_in_words(_conditions(model)))
    if certify:
        print(f"proved: this list is complete; no m from {said['none_from']} on has a rate above {above:g}")
    if not found:
        print(f"no rate above {above:g} for m = {m}")
        return
    table = Table("m", "Re lambda", "Im lambda", box=None)
    for mode in found:
        digits = ".12g" if certify else ".10g"
        table.add_row(str(mode["m"]), f"{mode['re']:{digits}}", f"{mode['im']:{digits}}")
    print_table(table)


@app.command("threshold")
@of_a_model("psi")
def threshold_command(
    model: "Model",
    free: Sequence[str],
    m: Modes = "0:4",
    certify: Certify = False,
    as_json: Json = False,
) -> None:
    """The smallest psi at which a rate of each angular number reaches Re lambda = 0, and its frequency."""
    from rich.table import Table

    from actin_xcheck.cli.conduct import print_table
    from actin_xcheck.theory.exact import lowest, threshold

    found = [threshold(model, number) for number in _numbers(m)]
    first, conditions = lowest(found), _conditions(model)
    within = _certified_crossings(model, found) if certify else {}
    del conditions["psi"]  # it is what is sought
    if as_json:
        least = None if first is None else {"m": first.m, "psi": first.psi, "crossing": first.crossing}
        said = {
            "thresholds": [vars(one) | within.get(one.m, {}) for one in found],
            "lowest": least,
            "conditions": conditions,
        }
        print(json.dumps(said))
        return
    print(_in_words(conditions))
    if certify:
        print("proved: no mode grows 1e-9 below each psi (relative), and at least one 1e-9 above it")
    table = Table("m", "psi", "omega", "", box=None)
    for one in found:
        numbers = ("none", "") if one.psi is None else (f"{one.psi:.10g}", f"{one.omega:.10g}")
        mark = "lowest" if first is not None and one.m == first.m else ""
        table.add_row(str(one.m), *numbers, ", ".join(filter(None, (mark, one.reason))))
    print_table(table)


@app.command("transient")
@study_command("transient", "predict transient")
@of_a_model()
def transient(model: "Model", free: Sequence[str], m: Modes = "0:4") -> "Study":
    """Growth of perturbations before they decay, in an energy, and what schemes make of it.

    Of a rheology and a closure that are not given, both, the moving cell's and the wall's.  Starts that
    grow most are left as scenes, for `compare`.
    """
    from actin_xcheck.studies.transient import transient as study

    closures = [model.closure, *([Closure.IRROTATIONAL_WALL] if "closure" in free else [])]
    rheologies = [model.rheology, *([Rheology.VISCOUS] if "rheology" in free else [])]
    models = [model.varied(closure=one, rheology=other) for one in closures for other in rheologies]
    return study(models, _numbers(m))


@app.command("report")
@study_command("predict", "predict report")
def report() -> "Study":
    """Curves, modes, maps, thresholds and errata, as predict.h5 and a page; takes a few minutes."""
    from actin_xcheck.studies.theory import atlas

    return atlas()


def _counted(model: "Model", numbers: range, above: float) -> tuple[list[dict[str, float]], dict[str, int]]:
    """The modes, and nothing else of them all."""
    from actin_xcheck.theory.exact import DiskModes

    rates = [(m, rate) for m in numbers for rate in DiskModes(model, m).rates(above)]
    return [{"m": m, "re": rate.real, "im": rate.imag} for m, rate in rates], {}


def _certified(model: "Model", numbers: range, above: float) -> tuple[list[dict[str, float]], dict[str, int]]:
    """The modes with the radii of the balls that hold them, and from which m on there is none."""
    from actin_xcheck.theory.certified import proved

    _need_flint()
    found, none_from = proved(model, numbers, above)
    modes = [{"m": one.m, "re": one.rate.real, "im": one.rate.imag, "radius": one.radius} for one in found]
    return modes, {"none_from": none_from}


def _certified_crossings(model: "Model", found: "list[Threshold]") -> dict[int, dict[str, list[float]]]:
    """Between which psi's a mode of each m crosses, by m; UserError where that is not proved."""
    from actin_xcheck.theory.certified import crossing

    _need_flint()
    try:
        pairs = {one.m: crossing(model, one.m, one.psi) for one in found if one.psi is not None}
    except (ValueError, ArithmeticError) as error:
        raise UserError(f"--certify: {error}") from None
    return {m: {"between": list(pair)} for m, pair in pairs.items()}


def _need_flint() -> None:
    """UserError where there is no ball arithmetic."""
    from importlib.util import find_spec

    if find_spec("flint") is None:
        raise UserError(
            "--certify: python-flint is not installed; valid: pip install 'actin-xcheck[certify]'"
        )


def _conditions(model: "Model") -> dict[str, float | str]:
    """All that a prediction depends on."""
    from dataclasses import asdict

    from actin_xcheck.core.model import ARTICLE

    numbers = {name: value for name, value in asdict(model.parameters).items() if name != "l0"}
    readings = {"rheology": model.rheology, "closure": model.closure, "delta": model.delta}
    laws = {law: str(own) for law in ARTICLE if (own := getattr(model.laws, law)) is not None}
    return {**numbers, **dict(model.laws.own), **readings, **laws}


def _in_words(conditions: dict[str, float | str]) -> str:
    words = (
        f"{name} {value}"
        if name in ("delta", "contractility", "pressure")
        else str(value)
        if isinstance(value, str)
        else f"{name} = {value:g}"
        for name, value in conditions.items()
    )
    return ", ".join(words)


def _numbers(given: str) -> range:
    """Angular numbers from "3" or "0:8"."""
    if not (match := re.fullmatch(r"(\d{1,3})(?::(\d{1,3}))?", given)):
        raise UserError(f"--m: {given!r} is no range; valid: a number as in 3, or 0:8 (inclusive)")
    first, last = int(match[1]), int(match[2] or match[1])
    if first > last:
        raise UserError(f"--m: {given!r} is empty; valid: the smaller number first")
    if last > 100:
        raise UserError(f"--m: {last} is out of range; valid: up to 100")
    return range(first, last + 1)
