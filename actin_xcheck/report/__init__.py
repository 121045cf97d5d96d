"""The HTML reports, each made from its files alone."""

from actin_xcheck.report.audit import write_audit_page
from actin_xcheck.report.convergence import write_convergence_page
from actin_xcheck.report.frontier import write_frontier_page
from actin_xcheck.report.page import write_report
from actin_xcheck.report.theory import write_theory_page
from actin_xcheck.report.work_precision import write_chart_page

__all__ = [
    "write_audit_page",
    "write_chart_page",
    "write_convergence_page",
    "write_frontier_page",
    "write_report",
    "write_theory_page",
]
