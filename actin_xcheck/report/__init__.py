"""The HTML report of a comparison, made from its files alone."""

from actin_xcheck.report.page import write_report

__all__ = ["write_report"]
