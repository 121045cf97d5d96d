"""Imported in the process from which others are forked, and nowhere else: it ends with its parent."""

from actin_xcheck.runs.processes import end_with_parent

end_with_parent()  # before anything is imported that takes its time

from actin_xcheck.runs.provenance import code  # noqa: E402

code()  # of the sources that are imported here, whatever becomes of them
