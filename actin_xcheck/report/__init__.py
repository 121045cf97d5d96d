"""The HTML reports, each made from its files alone."""

from actin_xcheck.report.audit import write_audit_page
from actin_xcheck.report.closures import write_closures_page
from actin_xcheck.report.convergence import write_convergence_page
from actin_xcheck.report.dashboard import write_dashboard, write_night_page
from actin_xcheck.report.distortion import write_distortion_page
from actin_xcheck.report.extremes import write_extremes_page
from actin_xcheck.report.faults import write_faults_page
from actin_xcheck.report.frontier import write_frontier_page
from actin_xcheck.report.page import write_report
from actin_xcheck.report.theory import write_theory_page
from actin_xcheck.report.work_precision import write_chart_page

__all__ = [
    "write_audit_page",
    "write_chart_page",
    "write_closures_page",
    "write_convergence_page",
    "write_dashboard",
    "write_distortion_page",
    "write_extremes_page",
    "write_faults_page",
    "write_frontier_page",
    "write_night_page",
    "write_report",
    "write_theory_page",
]
