"""Imported in the process from which others are forked, and nowhere else: it ends with its parent."""

from actin_xcheck.runs.processes import end_with_parent
from actin_xcheck.runs.provenance import code

end_with_parent()
code()  # of the sources that are imported here, whatever becomes of them
