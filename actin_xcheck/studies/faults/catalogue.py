"""All faults by name."""

from collections.abc import Sequence

from actin_xcheck.core.errors import UserError
from actin_xcheck.studies.faults import harness, mechanics, reductions, time_and_space, transport, volumes
from actin_xcheck.studies.faults.fault import Fault

FAULTS = {
    fault.name: fault
    for group in (mechanics, volumes, transport, time_and_space, reductions, harness)
    for fault in group.FAULTS
}


def find_faults(names: Sequence[str] | None) -> list[Fault]:
    """Return the faults with these names, all without any; UserError lists the valid ones."""
    if unknown := [name for name in names or () if name not in FAULTS]:
        raise UserError(f"--only: {unknown[0]!r} is not a fault; valid: {', '.join(FAULTS)}")
    return [FAULTS[name] for name in dict.fromkeys(names or FAULTS)]
