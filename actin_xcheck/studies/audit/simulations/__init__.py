"""Rows that need simulations: Figs. 6 to 20 and the sentences of Sections 5 to 7 about runs."""
