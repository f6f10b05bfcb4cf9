"""Models: which terms, species, ends and constraints. Choices only, no algebra."""
