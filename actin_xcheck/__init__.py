"""actin_xcheck: a verification laboratory for a moving-cell model.

Importing this package pins BLAS and OpenMP to one thread unless the user has chosen otherwise: the
matrices here are sparse, and threaded BLAS on a shared machine only makes timings meaningless.  It must
happen before numpy's first import, hence here.
"""

import os

for _variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")

__version__ = "0.1.0"
