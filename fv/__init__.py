"""Cell-centred finite volumes for actin transport on moving triangles, on FiPy.

FiPy starts subprocesses, reads `sys.argv` and warns when it is imported, so it is imported by `fv.mesh`
alone, with the arguments hidden, the SciPy solvers chosen and that module's warnings silenced.
"""
