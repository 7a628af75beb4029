"""HDF5 files from their bytes, with h5py, which is optional."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from straw.rig.errors import RigError

_SIGNATURE = b"\x89HDF\r\n\x1a\n"


def is_hdf(data: bytes) -> bool:
    """Whether these are an HDF5 file's bytes; MATLAB writes 512 of its own before."""
    return data.startswith(_SIGNATURE) or data[512:520] == _SIGNATURE


@contextmanager
def open_hdf(path: Path, data: bytes) -> Iterator[Any]:
    """The open file; RigError where h5py is not installed, or the file is damaged."""
    try:
        import h5py
    except ImportError:
        raise RigError(f"{path.name}: HDF5 needs h5py, which is not installed: pip install 'straw[tables]'") from None
    try:
        with h5py.File(io.BytesIO(data), "r") as file:
            yield file
    except (OSError, RuntimeError) as error:
        raise RigError(f"{path.name}: is a damaged HDF5 file ({' '.join(str(error).split())[:80]})") from None
