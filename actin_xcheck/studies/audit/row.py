"""What the audit is made of: one row per statement of the article, and what was found about it."""

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cache, cached_property
from importlib.resources import files

from actin_xcheck.report.exhibits import Exhibit
from actin_xcheck.studies.audit.simulations.studies import Study


class Judgement(StrEnum):
    """How a statement of the article stands."""

    REPRODUCED = "reproduced"
    """Computed to the digits printed, or as stated, with an uncertainty smaller than what is judged."""
    IN_KIND = "reproduced in kind"
    """The picture or the words agree; there is no number to hold against."""
    NOT_REPRODUCED = "not reproduced"
    """Something else comes out, by more than the numerical uncertainty."""
    MISPRINT = "misprint"
    """Contradicts the article's own equations or data; the corrected statement is given."""
    UNDECIDABLE = "cannot be decided"
    """Photographs, results not shown, or conditions not stated."""


@dataclass(frozen=True)
class Finding:
    """What this project has to say to one row.

    Attributes
    ----------
    judgement : the verdict.
    computed : what was computed, numbers included, in a sentence or two.
    reason : why that gives the verdict.
    exhibits : curves, fields, maps and tables to be shown below.
    numbers : computed values by name, stored beside the words.
    """

    judgement: Judgement
    computed: str
    reason: str
    exhibits: tuple[Exhibit, ...] = ()
    numbers: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Row:
    """One statement of the article.

    Attributes
    ----------
    key : what `--only` takes: "eq3.6", "table4", "fig21"; sentences by their section, "s5.4-failure".
    examine : computes the finding in a few seconds, from the `Evidence` of each study, in their order.
    needs : gives the simulations it needs, none where theory alone decides; to state them scenes are read.
    """

    key: str
    examine: Callable[..., Finding]
    needs: Callable[[], tuple[Study, ...]] = tuple

    @cached_property
    def studies(self) -> tuple[Study, ...]:
        """The simulations it needs."""
        return self.needs()

    @property
    def place(self) -> str:
        """Where it stands, for the reader: "(3.6)", "Table 4", "Section 5.4"."""
        return _article()[self.key]["place"]

    @property
    def statement(self) -> str:
        """What the article says."""
        return _article()[self.key]["statement"]


@cache
def _article() -> dict[str, dict[str, str]]:
    """What the article says, by key."""
    return tomllib.loads((files(__package__) / "article.toml").read_text(encoding="utf-8"))
