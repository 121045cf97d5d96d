"""Additive Runge-Kutta pairs: explicit for the motion, L-stable and stiffly accurate for diffusion.

Both halves share abscissae and weights, so that an order-p pair couples them to order p.  Order 2: Giraldo,
Kelly and Constantinescu, SIAM J. Sci. Comput. 35 (2013); orders 3 and 4: Kennedy and Carpenter, Appl. Numer.
Math. 44 (2003), ARK3(2)4L[2]SA and ARK4(3)6L[2]SA; order 5: the same, Appl. Numer. Math. 136 (2019),
ARK5(4)8L[2]SA with gamma = 2/9.
"""

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

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

    @cached_property
    def ahead(self) -> Array:
        """What a stage's values are about, by those of the ones before: exact for parabolas, (s, s)."""
        weights = np.zeros((self.c.size, self.c.size))
        for i in range(1, self.c.size):
            powers = np.arange(min(i, 3))[:, None]
            weights[i, :i] = np.linalg.lstsq(self.c[:i] ** powers, self.c[i] ** powers[:, 0], rcond=None)[0]
        return weights


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


def _order_5() -> Tableau:
    explicit = _matrix(
        "0",
        "4/9",
        "1/9 1183333538310/1827251437969",
        "895379019517/9750411845327 477606656805/13473228687314 -112564739183/9373365219272",
        "-4458043123994/13015289567637 -2500665203865/9342069639922 983347055801/8893519644487 "
        "2185051477207/2551468980502",
        "-167316361917/17121522574472 1605541814917/7619724128744 991021770328/13052792161721 "
        "2342280609577/11279663441611 3012424348531/12792462456678",
        "6680998715867/14310383562358 5029118570809/3897454228471 2415062538259/6382199904604 "
        "-3924368632305/6964820224454 -4331110370267/15021686902756 "
        "-3944303808049/11994238218192",
        "2193717860234/3570523412979 2193717860234/3570523412979 5952760925747/18750164281544 "
        "-4412967128996/6196664114337 4151782504231/36106512998704 572599549169/6265429158920 "
        "-457874356192/11306498036315",
    )
    implicit = _matrix(
        "0",
        "2/9 2/9",
        "2366667076620/8822750406821 2366667076620/8822750406821 2/9",
        "-257962897183/4451812247028 -257962897183/4451812247028 128530224461/14379561246022 2/9",
        "-486229321650/11227943450093 -486229321650/11227943450093 -225633144460/6633558740617 "
        "1741320951451/6824444397158 2/9",
        "621307788657/4714163060173 621307788657/4714163060173 -125196015625/3866852212004 "
        "940440206406/7593089888465 961109811699/6734810228204 2/9",
        "2036305566805/6583108094622 2036305566805/6583108094622 -3039402635899/4450598839912 "
        "-1829510709469/31102090912115 -286320471013/6931253422520 8651533662697/9642993110008 "
        "2/9",
        "0 0 3517720773327/20256071687669 4569610470461/17934693873752 "
        "2819471173109/11655438449929 3296210113763/10722700128969 -1142099968913/5710983926999 "
        "2/9",
    )
    embedded = _matrix(
        "0 0 520639020421/8300446712847 4550235134915/17827758688493 1482366381361/6201654941325 "
        "5551607622171/13911031047899 -5266607656330/36788968843917 1074053359553/5740751784926"
    )[0]
    return Tableau(5, 4, implicit.sum(axis=1), explicit, implicit, implicit[-1], embedded)


TABLEAUX = {2: _order_2(), 3: _order_3(), 4: _order_4(), 5: _order_5()}
"""By order."""
