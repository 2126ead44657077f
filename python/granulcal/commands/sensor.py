"""The option `--sensor`: what `fit-sensor` wrote in place of the sensor of a scene's camera."""

from pathlib import Path

from granulcal.documents import LARGEST_DOCUMENT, Table, check, parse_toml, read_bytes
from granulcal.pours.scene import Scene

__all__ = ["with_sensor"]

_SENSOR = Table({"camera": Table({"sensor": Table({}, open=True)})})


def with_sensor(scene: Scene, path: Path) -> Scene:
    """Returns the scene with the sensor of a file.

    Args:
        scene: whose camera it is.
        path: TOML that `granulcal fit-sensor` wrote.

    Raises:
        OSError: it cannot be read.
        ValueError: it is no sensor; names the file.
    """
    data = read_bytes(path, most=LARGEST_DOCUMENT)
    check(parse_toml(data, path), _SENSOR, path)
    # The text of a sensor is what a scene's wants to read at its end.
    try:
        return Scene.from_toml(f"{_without_sensor(scene)}\n{data.decode('utf-8')}")
    except ValueError as error:
        # What is before counts lines of a text that nobody has.
        reason = str(error).splitlines()[-1]
        raise ValueError(f"{path}: not a sensor: {reason}") from None


def _without_sensor(scene: Scene) -> str:
    """The TOML of a scene without the tables of its camera's sensor."""
    kept, is_sensor = [], False
    for line in scene.to_toml().splitlines():
        if line.startswith("["):
            is_sensor = line.startswith(("[camera.sensor]", "[camera.sensor."))
        if not is_sensor:
            kept.append(line)
    return "\n".join(kept)
