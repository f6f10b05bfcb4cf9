"""Pictures of stored runs: figures and movies. Reads datasets, never solves."""

from shapespace.view.figure import plot_run
from shapespace.view.movie import save_movie

__all__ = ["plot_run", "save_movie"]
