"""The frozen substeps that the referee looks at: scene, changes, time."""

from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).parent


@dataclass(frozen=True)
class Case:
    """One substep of one pour."""

    name: str
    scene: str
    time: float
    sliding_friction: float
    rolling_friction: float
    restitution: float = 0.3
    changes: tuple[str, ...] = ()
    expected: str = "agrees"  # what referee.py should find; docs/results/referee.md says why

    def arguments(self, out: Path) -> list[str]:
        """Return the words after `granulcal-cli` that export the substep."""
        material = ("sliding_friction", "rolling_friction", "restitution")
        changes = [f"material.{name}={getattr(self, name)}" for name in material]
        changes.append("material.torsional_friction=0")  # siconos knows none
        words = [word for change in [*changes, *self.changes] for word in ("--set", change)]
        place = ["--contact-problem", str(out), "--time", str(self.time)]
        return ["inspect", self.scene, *words, *place]


def _drop(grains: int, height: float, *more: str) -> tuple[str, ...]:
    return (f"grains.count={grains}", f"start.height={height}", *more)


SMALL, LARGE = _drop(60, 0.005), _drop(200, 0.01)
FUNNEL = ("grains.count=200",)
PLANAR = str(HERE / "planar.toml")

CASES = (
    # Coulomb alone: siconos' fc3d_nsgs as it stands.
    Case("drop-smooth", "drop", 0.10, 0.0, 0.0, changes=SMALL),
    Case("drop-impact", "drop", 0.05, 0.3, 0.0, 0.9, changes=LARGE),
    Case("drop-slide", "drop", 0.10, 0.3, 0.0, changes=LARGE),
    Case("drop-rough", "drop", 0.05, 1.0, 0.0, changes=LARGE, expected="two solutions"),
    Case("drop-rough-late", "drop", 0.25, 1.0, 0.0, changes=LARGE),
    Case("drop-bouncing", "drop", 0.06, 0.5, 0.0, 0.9, changes=SMALL),
    Case("funnel-smooth", "funnel", 0.30, 0.0, 0.0, 0.5, changes=FUNNEL),
    Case("funnel-slide", "funnel", 0.22, 0.5, 0.0, 0.5, changes=("grains.count=300",)),
    Case("funnel-rough", "funnel", 0.30, 1.0, 0.0, changes=FUNNEL),
    # Rolling in a plane: siconos' rolling_fc3d_nsgs as it stands.
    Case("planar-landing", PLANAR, 0.05, 0.5, 0.1),
    Case("planar-corner", PLANAR, 0.20, 0.5, 0.1),
    Case("planar-rolling", PLANAR, 0.20, 0.3, 0.01),
    Case("planar-rough", PLANAR, 0.20, 1.0, 0.5),
    # Rolling in space.
    Case("roll-free", "drop", 0.10, 0.5, 0.001, changes=SMALL),
    Case("roll-easy", "drop", 0.10, 0.5, 0.01, changes=SMALL),
    Case("roll-impact", "drop", 0.05, 0.5, 0.1, changes=SMALL),
    Case("roll-slide", "drop", 0.15, 0.3, 0.1, changes=SMALL),
    Case("roll-rough", "drop", 0.15, 1.0, 0.1, changes=SMALL),
    Case("roll-middle", "drop", 0.10, 0.3, 0.3, changes=SMALL),
    Case("roll-bouncing", "drop", 0.06, 0.5, 0.2, 0.9, changes=SMALL),
    Case("roll-locked", "drop", 0.10, 0.2, 1.0, changes=SMALL),
    Case("roll-locked-rough", "drop", 0.05, 1.0, 10.0, changes=SMALL, expected="siconos unsolved"),
    Case("roll-funnel", "funnel", 0.30, 0.5, 0.1, 0.5, changes=FUNNEL),
    Case("roll-funnel-late", "funnel", 0.50, 0.5, 0.1, changes=FUNNEL),
    Case("roll-funnel-rough", "funnel", 0.30, 1.0, 1.0, changes=FUNNEL),
    # Rough and locked: granulcal's sweeps do not come to rest.
    Case("roll-stuck", "drop", 0.10, 1.0, 1.0, changes=SMALL, expected="granulcal unsolved"),
    Case("roll-jammed", "drop", 0.10, 1.0, 10.0, changes=LARGE, expected="granulcal unsolved"),
)
