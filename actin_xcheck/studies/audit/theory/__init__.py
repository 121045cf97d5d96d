"""All rows that need no simulation, in the order of the article's parts."""

from actin_xcheck.studies.audit.row import Row
from actin_xcheck.studies.audit.theory.appendix_sentences import APPENDIX_SENTENCES
from actin_xcheck.studies.audit.theory.equations import EQUATIONS
from actin_xcheck.studies.audit.theory.equations_linear import LINEAR_EQUATIONS
from actin_xcheck.studies.audit.theory.equations_scheme import SCHEME
from actin_xcheck.studies.audit.theory.equations_transport import TRANSPORT_FORMS
from actin_xcheck.studies.audit.theory.equations_weak import WEAK_FORMS
from actin_xcheck.studies.audit.theory.figures import THEORY_FIGURES
from actin_xcheck.studies.audit.theory.model_sentences import THEORY_SENTENCES
from actin_xcheck.studies.audit.theory.other_sentences import OTHER_SENTENCES
from actin_xcheck.studies.audit.theory.stability_sentences import STABILITY_SENTENCES
from actin_xcheck.studies.audit.theory.tables import TABLES
from actin_xcheck.studies.audit.theory.validation_sentences import VALIDATION_SENTENCES

THEORY: tuple[Row, ...] = (
    *EQUATIONS,
    *LINEAR_EQUATIONS,
    *WEAK_FORMS,
    *TRANSPORT_FORMS,
    *SCHEME,
    *TABLES,
    *THEORY_FIGURES,
    *THEORY_SENTENCES,
    *STABILITY_SENTENCES,
    *VALIDATION_SENTENCES,
    *OTHER_SENTENCES,
    *APPENDIX_SENTENCES,
)
"""Equations, tables, figures and sentences that theory alone examines."""
