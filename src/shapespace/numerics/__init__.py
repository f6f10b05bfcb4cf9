"""Collocation, meshes, structured linear algebra and Newton's method. Knows no surface."""
