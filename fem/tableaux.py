"""Additive Runge-Kutta pairs: explicit for the motion, L-stable and stiffly accurate for diffusion.

Both halves share abscissae and weights, so that an order-p pair couples them to order p.  Order 2: Giraldo,
Kelly and Constantinescu, SIAM J. Sci. Comput. 35 (2013); orders 3 and 4: Kennedy and Carpenter, Appl. Numer.
Math. 44 (2003), ARK3(2)4L[2]SA and ARK4(3)6L[2]SA.
"""

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from actin_xcheck.core.model import Array


@dataclass(frozen=True, eq=False)
class Tableau:
    """An additive pair of s stages with an embedded solution.

    Attributes
    ----------
    order, embedded_order : of the solution and of the one it is compared with.
    c : abscissae, (s,).
    explicit, implicit : coefficients, (s, s); the implicit diagonal is 0, gamma, gamma, ...
    b, b_embedded : weights, (s,).
    """

    order: int
    embedded_order: int
    c: Array
    explicit: Array
    implicit: Array
    b: Array
    b_embedded: Array

    @property
    def gamma(self) -> float:
        """The implicit diagonal."""
        return float(self.implicit[-1, -1])


def _matrix(*rows: str) -> Array:
    """A lower triangle of fractions, padded to a square with zeros."""
    numbers = [[float(Fraction(entry)) for entry in row.split()] for row in rows]
    size = max(len(numbers), max(map(len, numbers)))
    return np.array([row + [0.0] * (size - len(row)) for row in numbers])


def _order_2() -> Tableau:
    root = np.sqrt(2.0)
    g, b = 1 - 1 / root, np.array([1 / (2 * root), 1 / (2 * root), 1 - 1 / root])
    a32 = (3 + 2 * root) / 6
    return Tableau(
        2,
        1,
        np.array([0, 2 * g, 1]),
        np.array([[0, 0, 0], [2 * g, 0, 0], [1 - a32, a32, 0]]),
        np.array([[0, 0, 0], [g, g, 0], b]),
        b,
        np.array([(4 - root) / 8, (4 - root) / 8, 1 / (2 * root)]),
    )


def _order_3() -> Tableau:
    b = "1471266399579/7840856788654 -4482444167858/7529755066697 11266239266428/11593286722821"
    g = "1767732205903/4055673282236"
    explicit = _matrix(
        "0",
        "1767732205903/2027836641118",
        "5535828885825/10492691773637 788022342437/10882634858940",
        "6485989280629/16251701735622 -4246266847089/9704473918619 10755448449292/10357097424841",
    )
    implicit = _matrix(
        "0", f"{g} {g}", f"2746238789719/10658868560708 -640167445237/6845629431997 {g}", f"{b} {g}"
    )
    embedded = _matrix(
        "2756255671327/12835298489170 -10771552573575/22201958757719 "
        "9247589265047/10645013368117 2193209047091/5459859503100"
    )[0]
    return Tableau(3, 2, implicit.sum(axis=1), explicit, implicit, implicit[-1], embedded)


def _order_4() -> Tableau:
    explicit = _matrix(
        "0",
        "1/2",
        "13861/62500 6889/62500",
        "-116923316275/2393684061468 -2731218467317/15368042101831 9408046702089/11113171139209",
        "-451086348788/2902428689909 -2682348792572/7519795681897 12662868775082/11960479115383 "
        "3355817975965/11060851509271",
        "647845179188/3216320057751 73281519250/8382639484533 552539513391/3454668386233 "
        "3354512671639/8306763924573 4040/17871",
    )
    implicit = _matrix(
        "0",
        "1/4 1/4",
        "8611/62500 -1743/31250 1/4",
        "5012029/34652500 -654441/2922500 174375/388108 1/4",
        "15267082809/155376265600 -71443401/120774400 730878875/902184768 2285395/8070912 1/4",
        "82889/524892 0 15625/83664 69875/102672 -2260/8211 1/4",
    )
    embedded = _matrix(
        "4586570599/29645900160 0 178811875/945068544 814220225/1159782912 -3700637/11593932 61727/225920"
    )[0]
    return Tableau(4, 3, implicit.sum(axis=1), explicit, implicit, implicit[-1], embedded)


TABLEAUX = {2: _order_2(), 3: _order_3(), 4: _order_4()}
"""By order."""
