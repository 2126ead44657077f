"""One run at a time pours into a document: two would each write what they know over the other's."""

import os
import sys
from pathlib import Path
from typing import ClassVar
from weakref import WeakValueDictionary, finalize

if sys.platform != "win32":
    import fcntl

__all__ = ["OneRun"]


class OneRun:
    """Holds a document for this process until it is gone; the system lets go of a killed one's."""

    _held: ClassVar[WeakValueDictionary[Path, "OneRun"]] = WeakValueDictionary()

    def __init__(self, lock: int) -> None:
        """Keeps the descriptor of an open and locked file, and closes it when this is let go.

        A descriptor, for a file object in a circle of references may be collected, with a warning,
        before what would have closed it.
        """
        finalize(self, os.close, lock)

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
        lock = os.open(place.with_name(f".{place.name}.lock"), os.O_WRONLY | os.O_CREAT, 0o666)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(lock)
            raise BlockingIOError(
                f"{document}: another run is pouring into this file; wait for it, or choose "
                "another folder"
            ) from None
        held = cls._held[place] = cls(lock)
        return held
