"""What a run is worth, held against the truth: accurate, silently wrong, failed, or ending with the model."""

import math
from dataclasses import dataclass
from enum import StrEnum

from actin_xcheck.core.outcome import Ending
from actin_xcheck.studies.frontier.answers import ERRORS, TIME_BOUND, Answer, Truth, errors_between
from actin_xcheck.studies.frontier.planes import MOST_STEPS, Point


class Kind(StrEnum):
    """The classes of runs; those that fail have their Outcome for a class too."""

    ACCURATE = "accurate"
    SILENT = "silently wrong"
    """It completes, and is further from the truth than the bound, or goes on where the model has ended."""
    ENDS = "ends with the model"
    """It fails with a singular dilation, as the converged run does near the same time: that is right."""
    FAILED = "failed"
    UNKNOWN = "truth unknown"
    """Converged runs do not agree closely enough to judge by."""
    NOT_RUN = "not run"
    """More steps than the budget of a point."""


_WORDS = dict(zip(ERRORS, ("area", "total actin", "concentration", "positions"), strict=True))


@dataclass(frozen=True)
class Judged:
    """A run's class and why.

    Attributes
    ----------
    kind : its class.
    ending : its Outcome where it failed, else empty.
    errors : of `ERRORS`, nan each where they mean nothing.
    sentence : what happened, in words.
    """

    kind: Kind
    ending: str
    errors: tuple[float, ...]
    sentence: str

    @property
    def label(self) -> str:
        """The class with the Outcome of a failure: what borders separate and colours show."""
        return f"{self.kind}: {self.ending}" if self.kind is Kind.FAILED else str(self.kind)

    @property
    def error(self) -> float:
        """The largest of the errors, nan where they mean nothing."""
        return max(self.errors)


_NO_ERRORS = (float("nan"),) * len(ERRORS)

NOT_RUN = Judged(Kind.NOT_RUN, "", _NO_ERRORS, f"not run: more than {MOST_STEPS} steps")
"""Of points beyond the budget."""


def judge(point: Point, answer: Answer, truth: Truth) -> Judged:
    """Hold a run against the truth at its psi and p."""
    ending, reference = "" if answer.completed else answer.ending, truth.answer
    if not truth.known:
        sentence = f"the truth is not known here: {why_unknown(truth)}"
        return Judged(Kind.UNKNOWN, "", _NO_ERRORS, sentence)
    if reference.completed and answer.completed:
        errors = errors_between(answer, reference)
        worst = max(range(len(errors)), key=errors.__getitem__)
        kind = Kind.ACCURATE if errors[worst] <= truth.bound else Kind.SILENT
        sentence = (
            f"completes with area {answer.area:.4g} for {reference.area:.4g}; "
            f"largest error {errors[worst]:.2g}, of the {_WORDS[ERRORS[worst]]}"
        )
        return Judged(kind, "", errors, sentence)
    if answer.completed:
        sentence = f"completes, though the model ends at t = {reference.t:.4g}: {reference.message}"
        return Judged(Kind.SILENT, "", _NO_ERRORS, sentence)
    if not reference.completed and _ends_with(point, answer, reference):
        sentence = f"ends with the model, whose end is t = {reference.t:.4g}: {answer.message}"
        return Judged(Kind.ENDS, "", _NO_ERRORS, sentence)
    at = f" at t = {answer.t:.4g}" if math.isfinite(answer.t) else ""  # of a lost process nobody knows
    beside = "" if reference.completed else f", while the model ends at t = {reference.t:.4g}"
    sentence = f"{ending}{at}{beside}: {answer.message}"
    return Judged(Kind.FAILED, ending, _NO_ERRORS, sentence)


def _ends_with(point: Point, answer: Answer, reference: Answer) -> bool:
    """Whether a failure is the model's own end, as nearly in time as the run's step can tell."""
    too_late, too_early = answer.t - reference.t, reference.t - (answer.t + point.dt)
    near = max(too_late, too_early) <= TIME_BOUND * reference.t
    return near and answer.ending == Ending.SINGULAR_DILATION


def why_unknown(truth: Truth) -> str:
    """In words, of a truth that is not known."""
    if truth.answer.ending not in (Ending.COMPLETED, Ending.SINGULAR_DILATION):
        return f"the converged run ends with {truth.answer.ending}: {truth.answer.message}"
    if truth.uncertainty != truth.uncertainty:
        return "converged runs do not end alike"
    return f"the converged run is uncertain by {truth.uncertainty:.2g}"
