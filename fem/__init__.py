"""Moving-grid finite elements for the coupled model, on scikit-fem (Appendix B)."""

import actin_xcheck as _  # noqa: F401 - pins BLAS to one thread, which must happen before numpy's import
