"""The command `check`: does this installation work?"""

from shapespace.cli.shared import app, examples


@app.command(help_epilogue=examples("shapespace check"))
def check() -> int:
    """Check this installation: versions, double precision, a small solve, writing here, a movie writer."""
    from shapespace.study.check import probe_precision, probe_solve, probe_versions, probe_writing

    probes = {
        "versions": probe_versions,
        "double precision": probe_precision,
        "small solve": probe_solve,
        "writing": probe_writing,
        "movie writer": _probe_movie,
    }
    failed = 0
    for name, probe in probes.items():
        try:
            print(f"ok      {name}: {probe()}", flush=True)
        except _TROUBLE as trouble:
            failed += 1
            print(f"failed  {name}: {' '.join(str(trouble).split()) or type(trouble).__name__}", flush=True)
    return 1 if failed else 0


def _probe_movie() -> str:
    from shapespace.view.movie import find_ffmpeg

    if found := find_ffmpeg():
        return f"mp4 by {found}"
    import PIL

    return f"gif by Pillow {PIL.__version__}; for mp4 install ffmpeg or the extra shapespace[movie]"


# What a broken installation may raise; anything else is an error in this program and should be seen as one.
_TROUBLE = (ImportError, OSError, ValueError, TypeError, LookupError, AttributeError, ArithmeticError, RuntimeError)
