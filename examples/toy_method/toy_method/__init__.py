"""A method from outside the tree: the entry point names METHOD, the solver is imported when it runs."""

from actin_xcheck.runs.method import Method

METHOD = Method(
    name="toy-midpoint",
    solver="toy_method.solver:LumpedMidpoint",
    driven_by=None,
    order_h=2,
    order_dt=2,
    description="P1 elements with a lumped mass, half a step at a time: the midpoint rule",
)
