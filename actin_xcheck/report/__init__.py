"""The HTML reports, each made from its files alone."""

from actin_xcheck.nightly.dashboard import write_dashboard, write_night_page
from actin_xcheck.studies.audit.page import write_audit_page
from actin_xcheck.studies.chart.page import write_chart_page
from actin_xcheck.studies.closures.page import write_closures_page
from actin_xcheck.studies.compare_page import write_report
from actin_xcheck.studies.converge.page import write_convergence_page
from actin_xcheck.studies.distort.page import write_distortion_page
from actin_xcheck.studies.extremes.page import write_extremes_page
from actin_xcheck.studies.faults.page import write_faults_page
from actin_xcheck.studies.frontier.page import write_frontier_page
from actin_xcheck.studies.theory.page import write_theory_page

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
