"""Small dense systems in numba: LU with row pivoting, its two triangular solves, and copies that compile quickly."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

# Contraction to fused multiply-adds and reassociated sums are allowed, but NaN and infinity keep their meaning.
compiled = njit(cache=True, nogil=True, fastmath={"contract", "reassoc", "nsz"}, error_model="numpy")


def read_only(array: Array) -> Array:
    """A view that cannot be written to. Kernels compile once for all of them, and again for arrays that can be."""
    view = array.view()
    view.flags.writeable = False
    return view


@compiled
def put(target: Array, source: Array) -> None:
    """target[:] = source for vectors of one length; see copy."""
    for i in range(source.shape[0]):
        target[i] = source[i]


@compiled
def copy(target: Array, source: Array) -> None:
    """target[...] = source for matrices of one shape: numba compiles that for many seconds, because it may broadcast."""
    for i in range(target.shape[0]):
        for c in range(target.shape[1]):
            target[i, c] = source[i, c]


@compiled
def lu_rectangular(a: Array, pivot: IntArray, n_pivot_rows: int) -> bool:
    """LU in place of the first len(pivot) columns of a (rows, cols), pivots from the first n_pivot_rows rows.

    Four columns at a time: one pass over the rest of a row then does four updates. False where a pivot vanishes.
    """
    rows, cols = a.shape
    size = pivot.shape[0]
    for start in range(0, size, 4):
        stop = min(start + 4, size)
        for j in range(start, stop):
            best, p = abs(a[j, j]), j
            for i in range(j + 1, n_pivot_rows):
                if abs(a[i, j]) > best:
                    best, p = abs(a[i, j]), i
            pivot[j] = p
            if not best > 1e-300:
                return False
            if p != j:
                for c in range(cols):
                    a[j, c], a[p, c] = a[p, c], a[j, c]
            inverse = 1.0 / a[j, j]
            for i in range(j + 1, rows):
                factor = a[i, j] * inverse
                a[i, j] = factor
                for c in range(j + 1, stop):
                    a[i, c] -= factor * a[j, c]
        for i in range(start + 1, stop):
            for j in range(start, i):
                factor = a[i, j]
                for c in range(stop, cols):
                    a[i, c] -= factor * a[j, c]
        # Whole panels take two rows at once, which share what is loaded of the panel.
        i = stop
        if stop - start == 4:
            while i + 2 <= rows:
                f0, f1, f2, f3 = a[i, start], a[i, start + 1], a[i, start + 2], a[i, start + 3]
                g0, g1, g2, g3 = a[i + 1, start], a[i + 1, start + 1], a[i + 1, start + 2], a[i + 1, start + 3]
                for c in range(stop, cols):
                    u0, u1, u2, u3 = a[start, c], a[start + 1, c], a[start + 2, c], a[start + 3, c]
                    a[i, c] -= f0 * u0 + f1 * u1 + f2 * u2 + f3 * u3
                    a[i + 1, c] -= g0 * u0 + g1 * u1 + g2 * u2 + g3 * u3
                i += 2
        while i < rows:
            for j in range(start, stop):
                factor = a[i, j]
                for c in range(stop, cols):
                    a[i, c] -= factor * a[j, c]
            i += 1
    return True


@compiled
def forward(lu: Array, pivot: IntArray, x: Array) -> None:
    """Apply the row exchanges, then the inverse unit lower trapezoid of a (rows, columns) LU, to one column in place."""
    for j in range(pivot.shape[0]):
        p = pivot[j]
        if p != j:
            x[j], x[p] = x[p], x[j]
    columns = pivot.shape[0]
    for i in range(1, lu.shape[0]):
        row = lu[i]
        total = 0.0
        for j in range(min(i, columns)):
            total += row[j] * x[j]
        x[i] -= total


@compiled
def backward(lu: Array, size: int, x: Array) -> None:
    """Solve U x = b in place for the leading `size` unknowns; any x beyond them is known and stays.

    Eight sums run side by side: a single one waits for each addition, and rows are too short for the compiler to split it.
    """
    known = x.shape[0]
    for i in range(size):
        row, j = lu[i], size
        t0 = t1 = t2 = t3 = t4 = t5 = t6 = t7 = 0.0
        while j + 8 <= known:
            t0, t1 = t0 + row[j] * x[j], t1 + row[j + 1] * x[j + 1]
            t2, t3 = t2 + row[j + 2] * x[j + 2], t3 + row[j + 3] * x[j + 3]
            t4, t5 = t4 + row[j + 4] * x[j + 4], t5 + row[j + 5] * x[j + 5]
            t6, t7 = t6 + row[j + 6] * x[j + 6], t7 + row[j + 7] * x[j + 7]
            j += 8
        while j < known:
            t0 += row[j] * x[j]
            j += 1
        x[i] -= ((t0 + t1) + (t2 + t3)) + ((t4 + t5) + (t6 + t7))
    for i in range(size - 1, -1, -1):
        x[i] /= lu[i, i]
        for c in range(i):
            x[c] -= lu[c, i] * x[i]


@compiled
def forward_transposed(lu: Array, pivot: IntArray, x: Array) -> None:
    """Apply the transpose of `forward` to one column in place."""
    columns = pivot.shape[0]
    for i in range(lu.shape[0] - 1, 0, -1):
        row = lu[i]
        for j in range(min(i, columns)):
            x[j] -= row[j] * x[i]
    for j in range(columns - 1, -1, -1):
        p = pivot[j]
        if p != j:
            x[j], x[p] = x[p], x[j]


@compiled
def backward_transposed(lu: Array, size: int, x: Array) -> None:
    """Apply the transpose of `backward` to one column in place: what lies beyond `size` takes its share."""
    for i in range(size):
        row = lu[i]
        x[i] /= row[i]
        for j in range(i + 1, x.shape[0]):
            x[j] -= row[j] * x[i]
