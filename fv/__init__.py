"""Cell-centred finite volumes for actin transport on moving triangles, on FiPy.

FiPy starts subprocesses, reads `sys.argv` and warns when it is imported, so it is imported by `fv.mesh`
alone, with the arguments hidden, the SciPy solvers chosen and that module's warnings silenced.
"""

import actin_xcheck as _  # noqa: F401 - pins BLAS to one thread, which must happen before numpy's import
