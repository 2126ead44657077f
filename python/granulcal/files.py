"""Files that are whole or absent, and that replace nothing but files of their own kind."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from granulcal import _native

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["DATA_SET", "beside", "replace_file", "save_figure", "write_beside", "write_toml"]

DATA_SET = "manifest.toml"
"""What every folder of `generate` has, and no other."""
_TRIES = 100


def write_beside(path: Path, text: str | bytes) -> None:
    """Writes a whole file or none; the ending of its name says what kind it is.

    Raises:
        ValueError: a file of another kind stands there, or what is there is no plain file.
        OSError: it cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    data = text.encode("utf-8") if isinstance(text, str) else text
    _native.write_file(path, path.suffix.removeprefix("."), data)


def write_toml(path: Path, text: str) -> None:
    """Writes a document that somebody may have changed since: another text is left as it is.

    Raises:
        ValueError: another text stands there.
    """
    if path.exists() and path.read_bytes() != text.encode("utf-8"):
        raise ValueError(
            f"{path} is left as it is: it is not what would be written there; choose another "
            "folder, or move it away"
        )
    replace_file(path, text)


def replace_file(path: Path, text: str | bytes) -> None:
    """Writes a whole file or none in the place of one that is the caller's to change."""
    with beside(path) as new:
        new.write_bytes(text.encode("utf-8") if isinstance(text, str) else text)


def require_figure(path: str | PathLike[str]) -> None:
    """Checks that the ending of a figure's path says what it can be written as.

    Raises:
        ValueError: names what is allowed.
    """
    from matplotlib.backend_bases import FigureCanvasBase

    ending = Path(path).suffix
    known = sorted(FigureCanvasBase.get_supported_filetypes())
    if ending and ending.removeprefix(".").lower() not in known:
        raise ValueError(f"{path} must end in one of .{', .'.join(known)}, got {ending}")


def save_figure(figure: "Figure", path: str | PathLike[str], **options: Any) -> None:
    """Writes a figure as its ending says, PNG if it has none; whole or not at all.

    Raises:
        ValueError: an ending of another kind, or a folder.
    """
    require_figure(path)
    target = Path(path)
    if target.is_dir():
        raise ValueError(f"{path} must be a file to write, found a folder")
    if not target.suffix:
        target = target.with_suffix(".png")
    buffer = BytesIO()
    figure.savefig(buffer, format=target.suffix.removeprefix(".").lower(), **options)
    _native.write_file(target, target.suffix.removeprefix("."), buffer.getvalue())


@contextmanager
def beside(path: Path) -> Iterator[Path]:
    """A new file beside `path`, which takes its place if the block ends well, else is removed.

    Raises:
        OSError: it cannot be written; names `path`.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = _new_file(path)
    try:
        yield temporary
        os.replace(temporary, path)
    except OSError as error:
        # What writes into an open file knows no name, and the temporary one is not the user's.
        if error.filename not in (None, str(temporary)):
            raise
        if error.errno is None:
            raise OSError(f"{path}: cannot write: {error}") from error
        text = f"cannot write: {error.strerror}"
        raise OSError(error.errno, text, str(path)) from error
    finally:
        temporary.unlink(missing_ok=True)


def _new_file(path: Path) -> Path:
    """Makes an empty file of a name that nobody has; no link of that name is followed."""
    for attempt in range(_TRIES):
        # The ending stays last: some writers add it to names that lack it.
        name = f".{path.stem}.{os.getpid()}-{attempt}.tmp{path.suffix}"
        temporary = path.with_name(name)
        try:
            os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
        except FileExistsError:
            continue
        return temporary
    raise FileExistsError(f"every name for a temporary file beside {path} is taken")
