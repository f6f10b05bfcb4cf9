"""From the Rayleigh functional to a first-order system: variation by differentiation, end conditions, assembly."""
