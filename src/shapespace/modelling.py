"""The front door for models of your own: laws as functions of named quantities, parameters, models, scenarios.

See docs/how-to/add-a-term.md; a file that uses this module is given to any command with `--import FILE.py`.
"""

from shapespace.physics.coupled import linear_laws
from shapespace.physics.laws import Law, dissipation, energy, power
from shapespace.physics.quantities import LOCAL_QUANTITIES
from shapespace.study.modelling import Parameter, define_model, define_scenario

__all__ = [
    "LOCAL_QUANTITIES",
    "Law",
    "Parameter",
    "define_model",
    "define_scenario",
    "dissipation",
    "energy",
    "linear_laws",
    "power",
]
