"""The tests; importing the package first pins BLAS to one thread, which must happen before numpy's import."""

import actin_xcheck as _  # noqa: F401
