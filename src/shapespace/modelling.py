"""The front door for models of your own: laws as functions of named quantities, parameters, models, scenarios.

See docs/how-to/add-a-term.md; a file that uses this module is given to any command with `--import FILE.py`.
"""

from shapespace.physics.coupled import linear_laws
from shapespace.physics.laws import Law, dissipation, energy, power
from shapespace.physics.quantities import LOCAL_QUANTITIES
from shapespace.physics.species import ReactingSpecies, Ring, Species
from shapespace.study.modelling import Parameter, define_model, define_scenario
from shapespace.variational.ends import Free, Pinned, Traction

__all__ = [
    "LOCAL_QUANTITIES",
    "Free",
    "Law",
    "Parameter",
    "Pinned",
    "ReactingSpecies",
    "Ring",
    "Species",
    "Traction",
    "define_model",
    "define_scenario",
    "dissipation",
    "energy",
    "linear_laws",
    "power",
]
