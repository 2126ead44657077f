"""Where a model may be written: asked before a training, whose result is lost otherwise."""

from os import PathLike
from pathlib import Path

__all__ = ["MODEL_JSON", "require_place"]

MODEL_JSON = "model.json"


def require_place(path: str | PathLike[str]) -> None:
    """Checks that a model may be written to the folder `path`: new, empty, or a model.

    Raises:
        FileExistsError: it exists and is neither; the message says what helps.
    """
    target = Path(path)
    if not target.exists() or (target / MODEL_JSON).is_file():
        return
    if not target.is_dir():
        raise FileExistsError(f"{target} is a file; a model is a folder")
    if any(target.iterdir()):
        raise FileExistsError(
            f"{target} exists and is not a saved model; it is left as it is: choose another "
            "folder, one that is new, empty or a model"
        )
