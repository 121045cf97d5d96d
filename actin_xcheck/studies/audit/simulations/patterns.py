"""What is called visible, uniform or alike, and the patterns that pictures are held against."""

import numpy as np

from actin_xcheck.studies.audit.simulations.readouts import Field
from actin_xcheck.theory.modes import Mode

VISIBLE = 0.05
"""A twentieth of the radius: what one sees on a printed picture of a cell."""

ALIKE = 0.9
"""Least correlation of two patterns that are called alike."""

WAYWARD = 0.1
"""A uniform motion deviates from its mean by less than a tenth."""

UNIFORM = 0.01
"""A rim within 1 % of a circle looks like one."""

W11, W02, W21 = Mode(1, 1).value, Mode(0, 2).value, Mode(2, 1).value
W31, W41 = Mode(3, 1).value, Mode(4, 1).value


def signed(field: Field, sign: float) -> Field:
    """A field times a number."""
    return lambda x: sign * field(x)


def turned(field: Field, angle: float) -> Field:
    """w_m,n with theta_1 = angle."""
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    return lambda x: field(turn @ x)
