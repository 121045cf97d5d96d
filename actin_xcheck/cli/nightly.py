"""`nightly`: the verification suite within a budget, kept, judged, and drawn on the dashboard."""

import math
import sys
import time
from collections import Counter
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import asdict, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Literal, TypeVar

import typer

from actin_xcheck.cli.options import command
from actin_xcheck.cli.output import Answer, Json, say
from actin_xcheck.cli.progress import Progress
from actin_xcheck.core.claim import ClaimKind, excess
from actin_xcheck.core.errors import UserError
from actin_xcheck.core.files import locked, replace_file
from actin_xcheck.nightly.baseline import against
from actin_xcheck.nightly.carry_out import Work, carry_out, work_through
from actin_xcheck.nightly.checks import Checked, Item, night_long
from actin_xcheck.nightly.dashboard import write_dashboard, write_night_page, write_scene_pages
from actin_xcheck.nightly.groups import group_of
from actin_xcheck.nightly.history.database import find_night, read_claims, read_nights, read_numbers
from actin_xcheck.nightly.junit import junit
from actin_xcheck.nightly.nights import (
    HISTORY,
    judged_in,
    machine,
    new_folder,
    numbers_of,
    remember,
    unfinished,
)
from actin_xcheck.nightly.plan import Plan, chosen, past, suite
from actin_xcheck.nightly.record import FILE_NAME, Begun, Done, Journal, Kept, read_night
from actin_xcheck.nightly.remote import carry_out_elsewhere
from actin_xcheck.runs.commands import command as command_of
from actin_xcheck.runs.executor import executor, jobs_asked
from actin_xcheck.runs.machine import reference_kernel
from actin_xcheck.runs.store import provenance
from actin_xcheck.studies.faults.catalogue import FAULTS
from actin_xcheck.studies.faults.hunt import control, missed
from actin_xcheck.studies.folder import make_folder

Kind = TypeVar("Kind", bound=Item)

SUMMARY, JUNIT = "summary.json", "junit.xml"

PAGES = 0.08
"""Share of a budget that is left for pages and the history."""


class FailedClaim(Answer):
    """A claim that fails."""

    check: str
    group: str
    key: str
    """Its name, which is the same every night and whatever its statement says."""
    kind: ClaimKind
    quantity: str
    scene: str
    methods: tuple[str, ...]
    statement: str
    value: float
    bound: float
    note: str
    command: str
    file: str
    path: str


class NightAnswer(Answer):
    """`nightly`."""

    command: Literal["nightly"] = "nightly"
    night: str
    folder: str
    page: str
    green: bool
    fault: str
    """The deliberate fault that was on; empty without."""
    seconds: float
    claims: dict[str, int]
    """How many have which verdict."""
    failed: tuple[FailedClaim, ...]
    troubles: dict[str, str]
    """Checks that came to no verdict, and why."""
    not_run: dict[str, str]
    """Checks that were left out, and why."""
    checks: dict[str, float]
    """Those that were run, with their seconds."""
    commit: str
    machine: str


def nightly_command(
    budget: Annotated[
        float | None, typer.Option(help="Minutes in all; what is not expected to fit is not begun.", min=0.01)
    ] = None,
    baseline: Annotated[
        str | None, typer.Option(metavar="NIGHT", help="Fail where a number is worse than in that night.")
    ] = None,
    only: Annotated[
        list[str] | None, typer.Option(metavar="GLOB", help="Checks by name; may be given more than once.")
    ] = None,
    failed: Annotated[bool, typer.Option("--failed", help="Only what failed when it was run last.")] = False,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with the night that was interrupted.")
    ] = False,
    jobs: Annotated[int | None, typer.Option(help="Processes; default: one a core.", min=1)] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            help="Address of a dask.distributed scheduler, in place of --jobs; its workers share the folder, "
            "and costs are measured here."
        ),
    ] = None,
    fault: Annotated[
        str | None, typer.Option(help="Switch a deliberate fault on, to see the lights turn red.")
    ] = None,
    out_dir: Annotated[Path, typer.Option("--out", help="Folder of all nights.")] = Path("reports"),
    as_json: Json = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress.")] = False,
) -> None:
    """Run the verification suite, keep its numbers, and draw the dashboard: index.html over all nights.

    Conservation, exact solutions, modes, reference values, FEM against FV, orders, negative controls, work
    and times: first what failed last, then what is cheapest.  Exit code 0 when all is green, 1 when not, 2
    for a mistake in what was asked.  A night with a deliberate fault is no part of the history.
    """
    history, count = out_dir / HISTORY, jobs_asked(jobs, scheduler)
    if resume and (only or failed or fault or baseline):
        raise UserError(
            "--resume: goes on with what the night was begun with; "
            "valid: without --only, --failed, --fault and --baseline"
        )
    make_folder(out_dir)
    known = past(history)
    plan = chosen(_without_watching(suite()) if fault else suite(), only or (), failed, known)
    if fault:
        with night_long(fault):
            plan = replace(plan, controls=(), costs=())
    if baseline:
        find_night(read_nights(history), baseline)
    begun_at = time.time()
    with ExitStack() as opened:
        processes = opened.enter_context(executor(count, scheduler))  # before there is a folder
        folder = unfinished(out_dir).folder if resume else new_folder(out_dir, datetime.now(UTC))
        opened.enter_context(locked(folder / FILE_NAME))
        journal = Journal(folder / FILE_NAME)
        if resume:
            kept = read_night(folder)
            plan = _of(kept, suite())
            _same_code(kept)
        else:
            kept = Kept(folder, _begin(folder, plan, budget, fault or "", baseline or ""))
            journal.begin(kept.begun)
        minutes = budget or kept.begun.minutes
        spent = 0.0 if budget else kept.seconds
        deadline = begun_at + 60 * minutes * (1 - PAGES) - spent
        work: Work = carry_out
        if scheduler:
            work, kept = carry_out_elsewhere, replace(kept, folder=folder.resolve())
        with Progress(quiet, deadline - time.time()) as progress:
            over, left_out = work_through(
                plan, kept, journal, known, processes, work, deadline, progress.report
            )
        kept = replace(kept, done=tuple(over), left_out=tuple(left_out))
        for found in (_against(history, kept), _missed(kept)):
            if found:
                journal.keep(found, kept.seconds + time.time() - begun_at)
                kept = replace(kept, done=(*kept.done, found))
        kept = replace(kept, seconds=kept.seconds + time.time() - begun_at)
        if not kept.begun.fault:
            remember(history, kept)
        journal.close(left_out, kept.seconds)
        kept = read_night(folder)
        replace_file(folder / JUNIT, junit(kept))
        write_scene_pages(folder)
        page = write_night_page(folder)
        answer = _answer(kept, page)
        replace_file(folder / SUMMARY, answer.model_dump_json(indent=1).encode("utf-8"))
    index = write_dashboard(out_dir)
    if as_json:
        say(answer)
    else:
        _print(kept, answer, index)
    raise typer.Exit(0 if kept.green else 1)


def _begin(folder: Path, plan: Plan, budget: float | None, fault: str, baseline: str) -> Begun:
    return Begun(
        folder.name,
        datetime.now(UTC).isoformat(timespec="microseconds"),  # by which it is told from others of the day
        provenance(),
        machine(),
        command(),
        budget or math.inf,
        fault,
        baseline,
        tuple(item.name for item in plan.items),
        float(reference_kernel()[0]),
    )


def _without_watching(plan: Plan) -> Plan:
    """The plan for a night with a fault, whose checks need not tell what they call."""
    checks = (replace(item, watches=False) if isinstance(item, Checked) else item for item in plan.checks)
    return replace(plan, checks=tuple(checks))


def _of(kept: Kept, plan: Plan) -> Plan:
    """What a night had planned, in its order; UserError where a check of that name is no more."""
    items = {item.name: item for item in plan.items}
    if gone := [name for name in kept.begun.planned if name not in items]:
        raise UserError(
            f"--resume: {kept.folder} planned {gone[0]!r}, which is no check any more; valid: without"
        )
    place = {name: number for number, name in enumerate(kept.begun.planned)}

    def ours(part: Sequence[Kind]) -> tuple[Kind, ...]:
        planned = [item for item in part if item.name in place]
        return tuple(sorted(planned, key=lambda item: place[item.name]))

    return Plan(ours(plan.checks), ours(plan.controls), ours(plan.costs))


def _same_code(kept: Kept) -> None:
    """UserError where other code began the night: its numbers would be those of two commits."""
    now, then = provenance(), dict(kept.begun.versions)
    if other := [
        f"{name} {then.get(name)} -> {now.get(name)}" for name in now if now[name] != then.get(name)
    ]:
        raise UserError(f"--resume: {kept.folder} was begun by other code ({other[0]}); valid: without")
    if now["commit"].endswith("-dirty") or now["commit"] == "unknown":
        print(f"warning: {kept.folder}: whether the code is the same cannot be told", file=sys.stderr)


def _against(history: Path, kept: Kept) -> Done | None:
    """The comparison with the baseline, as a check of its own; None without one, or where it was made."""
    if not kept.begun.baseline or any(one.name.startswith("baseline ") for one in kept.done):
        return None
    began = time.perf_counter()
    night = find_night(read_nights(history), kept.begun.baseline).night
    old = read_numbers(history, night.name), read_claims(history, night.name)
    new = list(numbers_of(kept)), {one.key: one for one in judged_in(kept.done)}
    again = command_of("diff", night.name, kept.begun.name, file=history)
    claims = tuple(against(night, again, old, new))
    return Done(f"baseline {night.name}", claims, ("",) * len(claims), (), time.perf_counter() - began)


def _missed(kept: Kept) -> Done | None:
    """A deliberate fault with which all stayed green, as a control that fails; None without one."""
    judged = [one for one in kept.done if not one.trouble and not one.name.startswith("baseline ")]
    if not kept.begun.fault or any(one.red for one in judged):
        return None
    passed = tuple(one.name for one in kept.done)
    why = f"missed: none of the night's {len(passed)} checks turned red"
    claim = control(missed(FAULTS[kept.begun.fault], passed, why))
    return Done(f"fault {kept.begun.fault}", (claim,), ("",), (), 0.0)


def _answer(kept: Kept, page: Path) -> NightAnswer:
    verdicts = Counter(claim.verdict for claim in kept.claims)
    failing = [
        FailedClaim(check=done.name, group=group_of(claim), key=claim.key, file=file, **asdict(claim))
        for done in kept.done
        for claim, file in zip(done.claims, done.files, strict=True)
        if claim.verdict == "FAIL" and not done.trouble
    ]
    return NightAnswer(
        night=kept.begun.name,
        folder=str(kept.folder),
        page=str(page),
        green=kept.green,
        fault=kept.begun.fault,
        seconds=kept.seconds,
        claims=dict(verdicts),
        failed=tuple(failing),
        troubles={done.name: done.trouble for done in kept.done if done.trouble},
        not_run={one.name: one.why for one in kept.left_out},
        checks={done.name: done.seconds for done in kept.done},
        commit=kept.begun.versions["commit"],
        machine=kept.begun.machine,
    )


def _print(kept: Kept, answer: NightAnswer, index: Path) -> None:
    if kept.begun.fault:
        print(f"deliberate fault: {kept.begun.fault}")
    for one in answer.failed:
        print(f"FAIL {one.scene} [{', '.join(one.methods)}]: {one.statement}: ", end="")
        print(f"{excess(one.value, one.bound)} ({one.note})")
    for name, trouble in answer.troubles.items():
        print(f"FAIL {name}: {trouble}")
    for left in kept.left_out:
        if left.seconds:  # it was begun
            print(f"NOT RUN {left.name}: {left.why}")
    holding, failing = answer.claims.get("PASS", 0), answer.claims.get("FAIL", 0)
    print(f"{holding} of {holding + failing} claims hold in {len(kept.done)} checks", end="")
    print(f", {len(answer.troubles)} checks broke down" if answer.troubles else "", end="")
    print(f", {len(kept.left_out)} not run" if kept.left_out else "", end="")
    print(f"; {kept.seconds / 60:.1f} min; report: {answer.page}; all nights: {index}")
