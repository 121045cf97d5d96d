"""What becomes of a ripple on a moving rim: why `current-normal` is ill-posed where the rim advances.

Half-plane, the limit of large k.  A rim moves along its normal with speed V; put the cell at y < 0 and
displace the rim to y = h exp(i k x), k > 0.  By `current-normal` v.tau = 0 with tau ~ (1, dh/dx), so that the
perturbation v' of the velocity obeys, on y = 0 and to leading order in k,

    v'_x = -V dh/dx,    n.sigma_v n = (mu1 + mu2) dv'_y/dy + mu2 dv'_x/dx = 0;

the elastic stress and what the pressure adds are one order in k lower.  Inside,
(mu1/2) Lap v' + (mu1/2 + mu2) grad div v' = 0 has the decaying solutions

    v'_x = i (A + B y) e^(ky),  v'_y = (C + B y) e^(ky),  B = -k (C - A) (mu1/2 + mu2)/(3 mu1/2 + mu2)

times exp(i k x).  The second condition then reads C (mu1 + mu2) = -A mu1/2, the first A = -V k h, so that

    dh/dt = v'_y = C = kappa V k h,    kappa = (mu1/2)/(mu1 + mu2).

Ripples grow without bound as k grows where V > 0: no solution depends continuously on its data (Hadamard).
Where V < 0 they are damped by as much.  While the rim advances by one wavelength 2 pi/k a ripple grows by
exp(2 pi kappa), whatever k and V are.  `reference-normal` ties each point to a ray that does not turn with
the rim, so that dh/dx does not enter: v'_x = 0, v'_y = 0, and h is bounded.

Disk, every m.  A disk of radius R that swells uniformly, v = (V/R) r e_r under an isotropic stress, with rim
R + h cos m theta.  With P cos m theta r^m = div v' and the displacement of `exact.DiskModes`, the conditions
v'_theta = m (V/R) h sin m theta and n.sigma_v n = 0 give P = 2 kappa m (V/R) h (m^2 - 1)/(m - kappa) and

    dh/dt = gamma (V/R) h,    gamma = kappa (m^2 - 1)/(m - kappa):    h grows like R^gamma.

gamma is 0 for m = 1, for a translated disk is a disk, and tends to kappa m, the half-plane's.  The other
closures of a moving rim let any such cell swell uniformly, ripples and all: gamma = 1, but 0 for the
translation that the gauge of `traction-free` undoes.  That the ripple disturbs the concentration, and that
the rim's stress, is left out: relative to the rate it is of order V/(d m^2) once diffusion has settled.
"""

import math

from actin_xcheck.core.model import Closure
from actin_xcheck.core.parameters import Parameters


def contrast(parameters: Parameters) -> float:
    """Return kappa = (mu1/2)/(mu1 + mu2), 0.139 for Table 2."""
    return parameters.mu1 / 2 / parameters.mu


def half_plane_rate(closure: Closure, parameters: Parameters, speed: float, wavenumber: float) -> float:
    """Growth rate of a ripple on a rim that advances with `speed`, to leading order in |k|.

    ValueError for `irrotational-wall`, whose rim does not move.
    """
    return contrast(parameters) * speed * abs(wavenumber) if _follows_the_rim(closure) else 0.0


def ripple_exponent(closure: Closure, parameters: Parameters, m: int) -> float:
    """Return gamma: the amplitude of cos m theta, m >= 1, on a uniformly swelling disk goes like R^gamma.

    ValueError for m < 1 and for `irrotational-wall`, whose rim does not move.
    """
    if m < 1:
        raise ValueError(f"m = {m} is no ripple; valid: 1, 2, ...")
    if not _follows_the_rim(closure):
        return 0.0 if closure is Closure.TRACTION_FREE and m == 1 else 1.0
    kappa = contrast(parameters)
    return kappa * (m**2 - 1) / (m - kappa)


def advance_per_fold(parameters: Parameters) -> float:
    """How far, in wavelengths, a rim advances under `current-normal` while its ripples grow by e."""
    return 1 / (2 * math.pi * contrast(parameters))


def _follows_the_rim(closure: Closure) -> bool:
    if closure is Closure.IRROTATIONAL_WALL:
        raise ValueError(f"'{closure}' holds the rim still: there is no ripple to follow")
    return closure is Closure.CURRENT_NORMAL
