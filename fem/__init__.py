"""Moving-grid finite elements for the coupled model, on scikit-fem (Appendix B)."""
