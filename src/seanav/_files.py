"""Files that nobody meets half-written: made aside, put in place by one rename."""

import errno
import fcntl
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


def write(path: Path, text: str, times: tuple[int, int] | None = None) -> None:
    """Write a text file as a whole, with `times` in ns: `path` is the old one or the new one."""
    aside = _beside(path, "new")
    aside.write_text(text, encoding="utf-8")
    if times:
        os.utime(aside, ns=times)
    os.replace(aside, path)


def place(source: Path, target: Path) -> None:
    """Move a file or folder to `target`, in place of what is there, which stays if that fails."""
    target.parent.mkdir(parents=True, exist_ok=True)
    aside = _beside(target, "new")
    remove(aside)
    try:
        os.rename(source, aside)
    except OSError as error:
        if error.errno != errno.EXDEV:
            raise
        # Another file system.
        (shutil.copytree if source.is_dir() else shutil.copyfile)(source, aside)
    if target.is_dir():
        remove(target)
    os.replace(aside, target)
    remove(source)


def remove(path: Path) -> None:
    """Remove a file or a folder, if it is there; a folder goes out of sight as a whole."""
    old = _beside(path, "old")
    shutil.rmtree(old, ignore_errors=True)
    if path.is_dir() and not path.is_symlink():
        os.rename(path, old)
        shutil.rmtree(old, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def _beside(path, suffix):
    return path.with_name(f".{path.name}.{suffix}")


class Busy(Exception):
    """Another process holds the lock; the message says which."""


@contextmanager
def lock(path: Path, wait: bool = True) -> Iterator[None]:
    """Hold the lock `path`; a process that dies lets go of it, the file stays.

    Raises
    ------
    Busy
        If another process holds it and this one is not to `wait`.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a+", encoding="utf-8") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        except BlockingIOError:
            file.seek(0)
            raise Busy(f"process {file.read() or '?'} is at it") from None
        file.truncate(0)
        file.write(str(os.getpid()))
        file.flush()
        yield
