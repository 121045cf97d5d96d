"""What theory says a run must do: linear stability on the disk (3.3-3.9, A.1), and growth rates out of runs.

Depends on the model alone; no solver is imported here and no solver imports this.
"""

from actin_xcheck.theory.dispersion import (
    Version,
    WallEigenfield,
    active_slope,
    coefficients,
    growth_rates,
    isolated_modes,
    k2_crit,
    leading_growth_rate,
    printed_3_7,
    sigma_prime,
    stiffness,
    unstable_modes,
    wall_eigenfield,
)
from actin_xcheck.theory.eigenfields import (
    CellEigenfield,
    Eigenfield,
    cell_eigenfield,
    eigenfield,
    growth_rate,
)
from actin_xcheck.theory.errata import ERRATA, TABLE_4_PRINTED, TABLE_6_PRINTED, Erratum, Table4Row
from actin_xcheck.theory.exact import DiskModes
from actin_xcheck.theory.growth import (
    Extrapolation,
    GrowthFit,
    amplitude_at_rest,
    extrapolate,
    fit_growth,
)
from actin_xcheck.theory.modes import Mode, count_below, modes_below, table_6, wavenumber
from actin_xcheck.theory.threshold import Threshold, lowest, threshold

__all__ = [
    "ERRATA",
    "TABLE_4_PRINTED",
    "TABLE_6_PRINTED",
    "CellEigenfield",
    "DiskModes",
    "Eigenfield",
    "Erratum",
    "Extrapolation",
    "GrowthFit",
    "Mode",
    "Table4Row",
    "Threshold",
    "Version",
    "WallEigenfield",
    "active_slope",
    "amplitude_at_rest",
    "cell_eigenfield",
    "coefficients",
    "count_below",
    "eigenfield",
    "extrapolate",
    "fit_growth",
    "growth_rate",
    "growth_rates",
    "isolated_modes",
    "k2_crit",
    "leading_growth_rate",
    "lowest",
    "modes_below",
    "printed_3_7",
    "sigma_prime",
    "stiffness",
    "table_6",
    "threshold",
    "unstable_modes",
    "wall_eigenfield",
    "wavenumber",
]
