"""Constitutive ideas, one per file: each a term with one power density, or a balance law of a species."""
