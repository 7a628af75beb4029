"""One thread for the linear algebra of fits: matrices are small, and the processors are busy with simulations."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import scipy.linalg  # noqa: F401  (loads SciPy's BLAS, as only what is loaded can be limited)

from straw.model.shell.threads import one_thread


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """A context, or a function's decorator, in which BLAS uses one thread in this process."""
    with one_thread():
        yield
