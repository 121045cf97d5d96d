"""Rows of the audit: sentences of Section 5 that theory or arithmetic decides, without a simulation."""

import numpy as np

from actin_xcheck.core.model import Delta, Model
from actin_xcheck.core.parameters import Parameters
from actin_xcheck.report.exhibits import Sheet
from actin_xcheck.studies.audit.row import Finding, Judgement, Row
from actin_xcheck.studies.audit.theory.figures import W02, W11, W21, borders, kind, linear_model
from actin_xcheck.studies.audit.theory.measures import found, rounds_to
from actin_xcheck.studies.audit.theory.tables import INITIAL, components
from actin_xcheck.theory.dispersion import Version, growth_rates, isolated_modes, k2_crit, stiffness
from actin_xcheck.theory.modes import Mode, modes_below

_CONSTANT = (Delta.NONE, Delta.FULL)
_COARSE, _FINE, _PLANE = 1.0228e-2, 1.0228e-3, 6.0228e-4
"""Time steps: of 2113 nodes, of 8321 nodes (Table 5), and of Section 5.4."""

_TIMES = (
    ("Fig. 7", "3.61e-3", _PLANE, None),
    ("Fig. 7d", "0.024", _PLANE, None),
    ("Fig. 10a", "0.5114", _COARSE, None),
    ("Fig. 10b", "1.7183", _COARSE, None),
    ("Fig. 10c", "3.365", _COARSE, None),
    ("Fig. 12", "0.1329", _FINE, 130),
    ("Fig. 13", "0.0511", _FINE, 50),
    ("Fig. 13", "1.493", _FINE, 146),
    ("Fig. 15", "0.1636", _FINE, None),
    ("Figs. 16-18a", "1.2046e-3", _PLANE, None),
    ("Figs. 16-18b", "3.6137e-3", _PLANE, None),
    ("Figs. 16, 17c", "0.0361", _PLANE, None),
    ("Figs. 16, 17d", "0.5180", _PLANE, None),
    ("Fig. 18c", "0.0722", _PLANE, None),
)
"""Printed times with the step of their runs and, where printed, the number of steps."""


def _panels() -> Finding:
    return Finding(
        Judgement.MISPRINT,
        "Fig. 6 has three panels: a the prediction w1,1, b the concentration, c the displacement.",
        "The text calls concentration and displacement Fig. 6a and b, and says that those were obtained after"
        " two and four steps; by the caption they are b and c.",
    )


def _isolates_again() -> Finding:
    sets = {
        (delta, version): isolated_modes(linear_model(38.24, 1.646, delta), version)
        for delta in _CONSTANT
        for version in Version
    }
    alone = all(modes == (Mode(0, 1), W11) for modes in sets.values())
    e = {version: stiffness(linear_model(38.24, 1.646, Delta.FULL), version) for version in Version}
    fast = growth_rates(linear_model(38.24, 1.646, Delta.FULL), np.array([1e2, 1e4, 1e6]))[0].real
    return found(
        Judgement.MISPRINT,
        f"b < 0 for w1,1 alone in all versions: {alone}. But 1 + ν' - p_e = {e[Version.AS_PRINTED]:.3f}"
        f" printed and {e[Version.CORRECTED]:.3f} corrected (δ = 1), where Re λ at k² = 1e2, 1e4, 1e6 is"
        f" {', '.join(f'{x:.4f}' for x in fast)}.",
        "Where δ = 1 the corrected c is negative and every wave number grows: near the rim nothing is"
        " isolated. For δ = 0 the sentence holds.",
        holds=alone and min(e.values()) > 0,
        corrected=alone and e[Version.AS_PRINTED] > 0 > e[Version.CORRECTED] and bool((fast > 0).all()),
        numbers={"printed": e[Version.AS_PRINTED], "corrected": e[Version.CORRECTED]},
    )


def _encouraged() -> Finding:
    w02, w21 = (components(INITIAL["Fig. 7 (Section 5.1.2)"], mode)[0] / 1e-3 for mode in (W02, W21))
    lowest = next(mode for mode in modes_below(6.0) if mode.k > 0)
    return found(
        Judgement.NOT_REPRODUCED,
        f"cos x contains {w02:+.4f} w0,2 and {w21:+.4f} w2,1 on the disk, none of w1,1. The lowest non-zero"
        f" mode is {lowest}; w0,2 is number"
        f" {1 + [mode for mode in modes_below(6.0) if mode.k > 0].index(W02)}.",
        "With rnd > 0 the perturbation has w0,2 with the opposite sign, and w2,1 more than twice as strongly;"
        " -w0,2 is not what it starts. Nor is w0,2 the lowest mode; A.1 calls w1,1 that.",
        holds=w02 < 0 and abs(w02) > abs(w21) and lowest == W02,
        numbers={"w0,2": w02, "w2,1": w21},
    )


def _where_delta_jumps() -> Finding:
    model = Model(Parameters(38.24, 1.646))
    radius = np.sqrt(np.array([0.64 - 1e-9, 0.64 + 1e-9, 0.8 - 1e-9, 0.8 + 1e-9]))
    delta = model.delta_on_cells(np.array([radius, 0 * radius]))
    return found(
        Judgement.MISPRINT,
        f"δ on either side of x² + y² = 0.64 is {delta[0]:g} and {delta[1]:g}, of x² + y² = 0.8 {delta[2]:g}"
        f" and {delta[3]:g}.",
        "(2.6) puts the jump where the distance √(x² + y²) is 0.8: x² + y² = 0.64.",
        holds=delta[2] != delta[3],
        corrected=delta[0] != delta[1],
        numbers={"jump at 0.64": delta[1] - delta[0], "jump at 0.8": delta[3] - delta[2]},
    )


def _discontinuous() -> Finding:
    rates = {
        version: [
            growth_rates(linear_model(38.24, 1.646, delta), W11.k**2, version)[0] for delta in _CONSTANT
        ]
        for version in Version
    }
    (inner, ring), (_, ours) = rates[Version.AS_PRINTED], rates[Version.CORRECTED]
    return found(
        Judgement.REPRODUCED,
        f"λ of w1,1 at ψ = 38.24, p = 1.646: {inner:.4f} for δ = 0, {ring:.4f} for δ = 1 ({ours:.4f}"
        " corrected).",
        "b jumps by (2/π)p with δ, and λ with it; where δ varies in space (3.6), which takes it constant, is"
        " a relation of either side only.",
        holds=abs(ring - inner) > 1e-3,
        numbers={"jump of Re": ring.real - inner.real},
    )


def _mixed() -> Finding:
    parts = {"w2,1": 1, "w4,1": 1, "w3,1 - w0,2 - 3w2,1": 3, "w0,2 - 2w2,1": 2}
    called = [name for name, count in parts.items() if count == 1]
    return Finding(
        Judgement.MISPRINT,
        f"Of the four 'mixed modes' {len(called)} have one part: {' and '.join(called)}.",
        "w2,1 and w4,1 are single modes, as the captions of Fig. 9 and the title of Fig. 14's paragraph have"
        " them.",
    )


def _near_the_rim() -> Finding:
    """Half-way between the onsets for delta = 1 and 0 at p = 0.26."""
    psi = {v: sum(borders(0.26, delta, W11, v).neutral for delta in _CONSTANT) / 2 for v in Version}
    width = {v: abs(borders(0.26, Delta.NONE, W11, v).neutral - psi[v]) * 2 for v in Version}
    kinds = {v: [kind(linear_model(psi[v], 0.26, delta), W11, v) for delta in _CONSTANT] for v in Version}
    text = "; ".join(
        f"ψ = {psi[v]:.3f} ({v}): {kinds[v][0]} inside, {kinds[v][1]} near the rim" for v in Version
    )
    return found(
        Judgement.REPRODUCED,
        f"w1,1 at p = 0.26: {text}. The strip of such ψ is {width[Version.AS_PRINTED]:.3f} wide as printed, "
        f"{width[Version.CORRECTED]:.3f} corrected.",
        "δ in b makes it possible. 'Hopf instability' means damped oscillation.",
        holds=all(pair == ["damped", "oscillatory"] for pair in kinds.values()),
        numbers={f"width, {v}": width[v] for v in Version},
    )


def _uniform_condition() -> Finding:
    crit = {
        (p, delta, version): k2_crit(linear_model(70.366, p, delta), version)
        for p in (0.026, 0.433) for delta in _CONSTANT for version in Version
    }  # fmt: skip
    k2 = W21.k**2
    high = {key[1:]: value for key, value in crit.items() if key[0] == 0.433}
    low = {key[1:]: value for key, value in crit.items() if key[0] == 0.026}
    return Finding(
        Judgement.UNDECIDABLE,
        f"(ψ, p) = (70.366, 0.433): k²_crit = {min(high.values()):.4f} to {max(high.values()):.4f} over δ and"
        f" versions, above k²2,1 = {k2:.4f}. (70.366, 0.026): {min(low.values()):.4f} to"
        f" {max(low.values()):.4f}.",
        "The condition is called sufficient, and the article names no (ψ, p) at which it was tried. Fig. 16's"
        " uniform expansion is no example of it: at its parameters b isolates w2,1 too, by the printed (3.8)"
        " as well.",
        numbers={"k²_crit at 0.433": min(high.values()), "k²_crit at 0.026": max(low.values()), "k²2,1": k2},
    )


def _times() -> Finding:
    rows, wrong = [("where", "printed t", "Δt", "steps", "n Δt")], []
    for where, text, dt, printed in _TIMES:
        steps = printed or round(float(text) / dt)
        if not (rounds_to(steps * dt, text) or _cut(steps * dt, text)):
            wrong.append((text, steps, steps * dt))
        rows.append(
            (where, text, f"{dt:g}", f"{steps}{'' if printed else ' (nearest)'}", f"{steps * dt:.6f}")
        )
    listed = ", ".join(f"{text} for n = {steps}, which is t = {t:.4f}" for text, steps, t in wrong)
    return found(
        Judgement.MISPRINT,
        f"{len(_TIMES) - len(wrong)} of {len(_TIMES)} printed times are whole numbers of their steps, rounded"
        f" or cut off; not {listed}.",
        "A power of ten: t = 0.1493. Fig. 7's step, which is not printed, would be Section 5.4's 6.0228e-4.",
        holds=not wrong,
        corrected=len(wrong) == 1 and rounds_to(wrong[0][2], "0.1493"),
        exhibits=(Sheet("times", "Printed times and steps", "", tuple(rows)),),
        numbers={"wrong": len(wrong)},
    )


def _cut(value: float, printed: str) -> bool:
    """Whether a value, cut off after the digits of a printed number, is that number."""
    digits = len(printed.split("e")[0].split(".")[1])
    scale = 10.0 ** (int(printed.split("e")[1]) if "e" in printed else 0)
    return 0 <= value / scale - float(printed) / scale < 10.0**-digits


def _named_w01() -> Finding:
    uniform = Mode(0, 1)
    return Finding(
        Judgement.UNDECIDABLE,
        f"A.1 counts j'_0,1 = {uniform.k:g} and j'_0,2 = {W02.k:.5f}: w0,1 is the constant, w0,2 the first"
        " radial mode.",
        "As the constant, c1 w0,1 means that a stays uniform; but Section 5.1.2 finds -w0,2 in a run with the"
        " same ψ, the same initial condition and p = 1.646, which lies in the range of p given here. Which of"
        " the two is meant is not stated.",
        numbers={"k0,1": uniform.k, "k0,2": W02.k},
    )


VALIDATION_SENTENCES: tuple[Row, ...] = (
    Row(
        "s5.1.1-panels",
        _panels,
    ),
    Row(
        "s5.1.2-isolates",
        _isolates_again,
    ),
    Row(
        "s5.1.2-encouraged",
        _encouraged,
    ),
    Row("s5.1.2-ring", _where_delta_jumps),
    Row(
        "s5.1.2-discontinuous",
        _discontinuous,
    ),
    Row("s5.3.2-mixed", _mixed),
    Row(
        "s5-times",
        _times,
    ),
    Row(
        "s5.4-w01",
        _named_w01,
    ),
    Row(
        "s5.4-near-rim",
        _near_the_rim,
    ),
    Row(
        "s5.4-condition",
        _uniform_condition,
    ),
)
