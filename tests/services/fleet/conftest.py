"""Figures on the pages of a fleet have no layout."""

from tests.services.quick_figures import quick_figures

__all__ = ["quick_figures"]
