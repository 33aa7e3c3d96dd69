"""Files: read within limits, written whole, none replaced that holds something."""

from __future__ import annotations

import os
import stat
import tempfile
from pathlib import Path

MOST_BYTES = 1 << 30


def read(path: str | os.PathLike, most: int = MOST_BYTES) -> bytes:
    """The bytes of a regular file of at most `most` bytes; a device that never ends is refused before it is opened."""
    path = Path(path)
    found = path.stat()
    if stat.S_ISDIR(found.st_mode):
        raise IsADirectoryError(f"{path}: expected a file, found a directory")
    if not stat.S_ISREG(found.st_mode):
        raise ValueError(f"{path}: expected a regular file, found a pipe or a device")
    if found.st_size > most:
        raise ValueError(f"{path}: expected at most {most} bytes, found {found.st_size}")
    return path.read_bytes()


def text(given: str | os.PathLike, *ends: str) -> str:
    """A text as it is given, or that of the file that a path names; a line with one of these endings is a path."""
    if isinstance(given, os.PathLike) or ("\n" not in given and given.lower().endswith(ends)):
        return read(given).decode()
    return given


def write(path: str | os.PathLike, data: bytes, overwrite: bool) -> None:
    """Writes a file whole or not at all.

    Raises
    ------
    FileExistsError
        If there is a file that holds something, also one that another program writes meanwhile, unless `overwrite` is set.
    """
    path = Path(path)
    there = f"{path}: there is a file already; overwrite=True replaces it"
    if path.is_dir():
        raise IsADirectoryError(f"{path}: expected a file, found a directory")
    if path.exists() and not path.is_file():
        path.write_bytes(data)
        return
    if not overwrite and path.is_file() and path.stat().st_size > 0:
        raise FileExistsError(there)
    target = path.resolve()
    descriptor, temporary = tempfile.mkstemp(prefix=f".{target.name}.", suffix=".tmp", dir=target.parent)
    try:
        with open(descriptor, "wb") as file:
            file.write(data)
        # As a file of `open` is created; one that is replaced keeps its own.
        os.chmod(temporary, stat.S_IMODE(target.stat().st_mode) if target.exists() else 0o666 & ~_mask())
        if overwrite or target.exists():
            os.replace(temporary, target)
        else:
            try:
                os.link(temporary, target)
            except FileExistsError:
                raise FileExistsError(there) from None
            except OSError:
                # A file system without such links.
                os.replace(temporary, target)
    finally:
        Path(temporary).unlink(missing_ok=True)


def _mask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
