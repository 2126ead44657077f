"""The experiments of Matl et al. (ICRA 2020), each beside the paper's numbers.

One file is one experiment and holds `EXPERIMENT`; `granulcal reproduce paper` runs them. What they
share is in `common`. Equations and what the paper leaves open: docs/results/paper.md.
"""

from granulcal.experiments.paper.common.command import (
    experiments,
    find,
    missing_sets,
    reproduce_paper,
)

__all__ = ["experiments", "find", "missing_sets", "reproduce_paper"]
