"""Pictures, movies, meshes and pages of what is stored. Reads datasets, never solves."""
