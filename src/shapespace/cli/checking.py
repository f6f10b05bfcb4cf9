"""The command `check`: does this installation work?"""

from shapespace.cli.shared import app, examples


@app.command(help_epilogue=examples("shapespace check"))
def check() -> int:
    """Check this installation: what works, what is absent, and what to do about it; exit status 1 where a part fails.

    Versions, double precision, a small solve, writing here, cores, the cache of compiled functions, an accelerator; and what is
    optional: a movie writer, a Dask cluster, meshes. For the numbers themselves see `shapespace verify`.
    """
    from shapespace.study import check as probes

    chosen = {
        "versions": probes.probe_versions,
        "double precision": probes.probe_precision,
        "small solve": probes.probe_solve,
        "writing": probes.probe_writing,
        "cores": probes.probe_cores,
        "cache": probes.probe_cache,
        "accelerator": probes.probe_accelerator,
        "movie writer": _probe_movie,
        "cluster": probes.probe_cluster,
        "meshes": probes.probe_meshes,
    }
    failed = 0
    for name, probe in chosen.items():
        try:
            word, said = "ok", probe()
        except probes.Absent as absent:
            word, said = "absent", str(absent)
        except _TROUBLE as trouble:
            failed += 1
            word, said = "failed", " ".join(str(trouble).split()) or type(trouble).__name__
        print(f"{word:<8}{name}: {said}", flush=True)
    return 1 if failed else 0


def _probe_movie() -> str:
    from shapespace.study.check import Absent
    from shapespace.view.movie import find_ffmpeg

    if found := find_ffmpeg():
        return f"mp4 by {found}"
    raise Absent("gif only; for mp4 install ffmpeg, or pip install 'shapespace[movie]'")


# What a broken installation may raise; anything else is an error in this program and should be seen as one.
_TROUBLE = (ImportError, OSError, ValueError, TypeError, LookupError, AttributeError, ArithmeticError, RuntimeError)
