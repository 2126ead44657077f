"""One run at a time pours into a document: two would each write what they know over the other's."""

import sys
from io import BufferedWriter
from pathlib import Path
from typing import ClassVar
from weakref import WeakValueDictionary

if sys.platform != "win32":
    import fcntl

__all__ = ["OneRun"]


class OneRun:
    """Holds a document for this process until it is gone; the system lets go of a killed one's.

    Attributes:
        file: the lock, beside the document.
    """

    _held: ClassVar[WeakValueDictionary[Path, "OneRun"]] = WeakValueDictionary()

    def __init__(self, file: BufferedWriter) -> None:
        """Keeps an open and locked file."""
        self.file = file

    @classmethod
    def of(cls, document: Path) -> "OneRun | None":
        """Returns what holds `document`; None on Windows, where nothing does.

        Raises:
            BlockingIOError: another process pours into it.
        """
        if sys.platform == "win32":
            return None
        place = document.resolve()
        held = cls._held.get(place)
        if held is not None:
            return held
        place.parent.mkdir(parents=True, exist_ok=True)
        file = place.with_name(f".{place.name}.lock").open("ab")
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            file.close()
            raise BlockingIOError(
                f"{document}: another run is pouring into this file; wait for it, or choose "
                "another folder"
            ) from None
        held = cls._held[place] = cls(file)
        return held

    def __del__(self) -> None:
        """Lets go."""
        self.file.close()
