"""The article's simulations as cases: which shipped scene, which output times, how fine."""

from actin_xcheck.core.model import Closure
from actin_xcheck.studies.audit.simulations.checks import Case

PAPER_DT, FINE_DT = 1.0228e-2, 1.0228e-3
"""The steps of the runs on 2113 and on 8321 nodes (Table 5)."""

FIFTEEN_FINE, FIFTEEN = 15 * FINE_DT, 15 * PAPER_DT
"""When Figs. 8b, e, 9b and 9e were saved: after no more than 15 steps (Section 5.2.1)."""

FIG06 = Case("fig06-mode-11", 120)
FIG06_UNPERTURBED = Case("fig06-mode-11", 120, (("initial.a", "1.0009"),), "unperturbed")
FIG07 = Case("fig07-mode-02", 40)
FIG07_SMALL_RND = Case("fig07-mode-02", 40, (("initial.a", "1 + 1e-5*cos(x)"),), "small-rnd")
FIG07_MEMBRANE = Case(
    "fig07-mode-02-membrane", 40, (("parameters.psi", 62.4), ("parameters.p", 0.26)), "table-2"
)
FIG11 = Case("fig11-two-fronts", 60, (("time.outputs", (FIFTEEN, 0.2557, 0.5114)),))
FIG11_ONE_TERM = Case("fig11-two-fronts-single", 60, (("time.outputs", (FIFTEEN, 0.2557, 0.5114)),))
FIG11_NO_BARS = Case(
    "fig11-two-fronts",
    60,
    (("time.outputs", (FIFTEEN, 0.2557, 0.5114)), ("initial.a", "1 + 0.1*sin(x)*sin(y)")),
    "without-bars",
)
FIG12 = Case("fig12-mixed-31-02-21", 60, (("time.outputs", (FIFTEEN_FINE, 0.05, 0.1329)),))
FIG13 = Case("fig13-mixed-02-21", 60, (("time.outputs", (FIFTEEN_FINE, 0.0511, 0.1493)),))
FIG14 = Case("fig14-four-fronts", 60, (("time.outputs", (FIFTEEN_FINE, 0.05, 0.1, 0.1636)),))
FIG16 = Case("fig16-uniform-expansion", 60)
FIG17 = Case("fig17-uniform-contraction", 60)
LOCALISED = 0.0221
"""When actin is most concentrated in Fig. 18's cell: the article's figure is later."""

FIG18 = Case("fig18-nonuniform-contraction", 120, (("time.outputs", (3.6137e-3, LOCALISED, 0.0722)),))
FIG19 = Case("fig19-protrusions", 120)
_SHORT = (("time.end", 0.0361), ("time.outputs", (3.6137e-3, 0.0361)))
"""The article prints no times for its variations of Fig. 16: those of its b and c."""


def _circular(scene: str, label: str, **parameters: float) -> Case:
    """A variation in which the cell stays a circle but for rnd, so that readings of the rim agree."""
    changes = tuple((f"parameters.{name}", value) for name, value in parameters.items())
    return Case(scene, 40, (*_SHORT, *changes), label, (Closure.REFERENCE_NORMAL,))


WEAK_PRESSURE = _circular("fig16-uniform-expansion", "p-0.026", p=0.026)
STRONG_PRESSURE = _circular("fig16-uniform-expansion", "p-3", p=3.0, psi=62.4)
NO_PRESSURE = _circular("fig16-uniform-expansion", "p-0", p=0.0)
LONG_END = 2.0
"""Several e-foldings of the slowest modes at psi = 38.24: what grows there is seen by then."""


def _long(label: str, **parameters: float) -> Case:
    """Section 5.1.2's cell with other parameters, run until its modes have shown themselves."""
    changes = tuple((f"parameters.{name}", value) for name, value in parameters.items())
    times = (("time.end", LONG_END), ("time.outputs", (0.5, LONG_END)))
    return Case("fig07-mode-02", 60, (*times, *changes), label, (Closure.REFERENCE_NORMAL,))


DOWN_IN_P = tuple(_long(f"p-{p:g}", p=p) for p in (1.75, 1.0, 0.5, 0.0))
NO_RING = Case(
    "fig16-uniform-expansion", 40, (*_SHORT, ("model.delta", "none")), "no-ring", (Closure.REFERENCE_NORMAL,)
)
HOPF = _long("hopf", psi=34.0, p=0.26)
HOPF_INSIDE = _long("hopf-inside", psi=34.8, p=0.8)
RAISED = Case(
    "fig18-nonuniform-contraction",
    120,
    (("parameters.p", 0.26), ("time.outputs", (LOCALISED, 0.0722))),
    "p-0.26",
)
NOT_SHOWN_END = 0.0144
NOT_SHOWN = Case(
    "sec54-not-shown", 120, (("time.end", NOT_SHOWN_END), ("time.outputs", (0.0036137, NOT_SHOWN_END)))
)
REALISTIC = Case("sec6-realistic", 60, (("time.end", 2.0), ("time.outputs", (1.0, 2.0))))
