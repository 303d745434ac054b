"""Pages for people: one HTML file each, which needs neither a network nor a server."""

from slopewise.services.report.plan_page import render_report, write_report

__all__ = ["render_report", "write_report"]
