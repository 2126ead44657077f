r"""A stand-in for pours: a cone, a ring and scattered grains, whose missing effects are known.

Each pour has `GRAINS` points. A share stays in a cone whose slope grows with both frictions, the
others spread to a ring and beyond, farther with the height of the fall and with restitution. Noise
of a pour moves slope, spread and share of all its grains together. All statistics are computed from
the points by the same code as for real formations.

Eight effects are offered to the tracer, three are never: `fewer_grains`, `slump`, `slot`. No number
of it says anything about grains; it shows how the method behaves.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.effects.design import Design, Effect
from granulcal.pours.statistics import DIAGNOSTIC_NAMES, NAMES, diagnostic_statistics, statistics

__all__ = ["HIDDEN", "LIBRARY", "PileLoopToy"]

Array = NDArray[np.float64]

GRAINS = 240
_DIAMETER = 0.004
# Volume-conserving size of the pile [m].
_SIZE = 0.045
_LOW_HEIGHT, _HIGH_HEIGHT = 0.02, 0.12

LIBRARY: tuple[Effect, ...] = (
    Effect("cohesion"),
    Effect("soft_ground"),
    Effect("restitution_of_speed"),
    Effect("shape"),
    Effect("tilt", is_two_sided=True),
    Effect("blur"),
    Effect("polydispersity"),
    Effect("outflow_speed"),
)
# The 20 rings of the radial profile are 20 noisy numbers of one curve; its slope is kept. Points
# that stand for grains have no surface: what is read off one came later, and is left out.
_OF_A_SURFACE = ("height_ring", "patches", "roughness", "shoulder")
DIAGNOSTICS = tuple(name for name in DIAGNOSTIC_NAMES if not name.startswith(_OF_A_SURFACE))
_KEPT = np.array([name in DIAGNOSTICS for name in DIAGNOSTIC_NAMES])
HIDDEN: tuple[str, ...] = ("fewer_grains", "slump", "slot")


@dataclass(frozen=True)
class PileLoopToy:
    """Three parameters, one condition (the height), eight effects and three hidden ones.

    Attributes:
        design: of the archive.
    """

    design: Design = field(
        default_factory=lambda: Design(
            ("sliding_friction", "rolling_friction", "restitution"), ("height",), LIBRARY
        )
    )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the statistics."""
        return (*NAMES, *DIAGNOSTICS)

    def archive(self, base: int, per_effect: int, seed: int) -> tuple[Array, Array, Array, Array]:
        """Returns theta, condition, psi and statistics of base and effect pours."""
        generator = np.random.default_rng(seed)
        effects = self.design.effects
        count = base + per_effect * len(effects)
        theta, condition = generator.random((count, 3)), generator.random((count, 1))
        psi = np.zeros((count, len(effects)))
        for k, effect in enumerate(effects):
            rows = slice(base + k * per_effect, base + (k + 1) * per_effect)
            psi[rows, k] = generator.uniform(effect.low, 1.0, per_effect)
            # One in four has a second effect.
            for i in range(rows.start, rows.stop, 4):
                other = int(generator.integers(len(effects) - 1))
                other += other >= k
                psi[i, other] = generator.uniform(effects[other].low, 1.0)
        return theta, condition, psi, self.simulate(theta, condition, psi, generator)

    def simulate(
        self,
        theta: Array,
        condition: Array,
        psi: Array,
        generator: np.random.Generator,
        hidden: dict[str, float] | None = None,
    ) -> Array:
        """Returns statistics of one pour at each row, shape (n, s)."""
        rows = [
            self._pour(t, float(c[0]), dict(zip(_names(), p, strict=True)), hidden or {}, generator)
            for t, c, p in zip(theta, condition, psi, strict=True)
        ]
        return np.array(rows)

    def _pour(
        self,
        theta: Array,
        condition: float,
        psi: dict[str, float],
        hidden: dict[str, float],
        generator: np.random.Generator,
    ) -> Array:
        mu_s, mu_r, e = theta
        height = _LOW_HEIGHT + condition * (_HIGH_HEIGHT - _LOW_HEIGHT)
        fall = 2 * 9.81 * height
        middle = 2 * 9.81 * 0.07
        speed = np.sqrt(fall + (0.9 * psi["outflow_speed"]) ** 2)
        relative = speed / np.sqrt(middle)
        bounce = (0.1 + 0.8 * e) * relative ** (-0.9 * psi["restitution_of_speed"])
        bond = psi["cohesion"] / (0.6 + relative)
        # Latent slope, energy of spreading, share that leaves the cone.
        noise = generator.standard_normal(4)
        slope = 0.25 + 0.30 * mu_s + 0.22 * mu_r * (0.4 + mu_s)
        slope *= 1 + 0.5 * bond + 0.22 * psi["shape"] - 0.35 * hidden.get("slump", 0.0)
        slope *= np.exp((0.03 + 0.04 * bond) * noise[0])
        ground = bounce * (1 - 0.75 * psi["soft_ground"] * relative**0.8 / (0.5 + relative))
        energy = (relative * (0.25 + ground)) ** 1.3 * np.exp(-0.6 * mu_s - 0.25 * mu_r)
        energy *= 1 - 0.15 * psi["shape"]
        energy *= np.exp(0.07 * noise[1])
        share = 1 / (1 + np.exp(1.2 - 1.5 * np.log(energy) + 1.0 * mu_r + 1.6 * bond))
        share = float(np.clip(share * np.exp(0.06 * noise[2]), 0.02, 0.9))
        count = round(GRAINS * (1 - 0.35 * hidden.get("fewer_grains", 0.0)))
        size = _SIZE * (count / GRAINS) ** (1 / 3) / slope ** (1 / 3)
        leave = generator.random(count) < share
        # Cone: uniform in its volume's projection; height of its surface.
        radius = size * np.sqrt(generator.random(count)) * (1 + 0.15 * hidden.get("slump", 0.0))
        z = slope * np.maximum(size - radius, 0.0) * (1 - 0.35 * share)
        # Ring and tail: a Gaussian ring and a long tail.
        ring = size * (1 + 0.5 * energy) + 0.25 * size * generator.standard_normal(count)
        reach = 1 + 0.9 * psi["polydispersity"] * generator.random(count) ** 4
        tail = size * (1 + energy * generator.gamma(1.4, 0.9, count)) * reach
        is_tail = generator.random(count) < 0.35 * (1 - 0.6 * bond)
        radius = np.where(leave, np.abs(np.where(is_tail, tail, ring)), radius)
        grain = _DIAMETER * np.exp(0.3 * psi["polydispersity"] * generator.standard_normal(count))
        z = np.where(leave, 0.0, z) + grain * (0.5 + 0.5 * generator.random(count))
        angle = 2 * np.pi * generator.random(count)
        x, y = radius * np.cos(angle), radius * np.sin(angle)
        # Downhill drift of what rolls; a lasting offset of the whole pour besides.
        x = x + 0.30 * psi["tilt"] * (energy + 0.3) * np.where(leave, radius, 0.15 * radius)
        slot = 1 + 0.35 * hidden.get("slot", 0.0)
        x, y = x * slot, y / slot
        z = z * (1 - 0.18 * psi["blur"] * np.exp(-radius / size)) + 0.0006 * psi["blur"]
        z = np.maximum(z * np.exp(0.01 * noise[3]), 1e-4)
        points = np.column_stack([x, y, z])
        head = statistics(points)
        tail_ = diagnostic_statistics(
            points, grain_diameter=_DIAMETER, spacing=_DIAMETER, pour_axis=(0.0, 0.0)
        )
        return np.concatenate([np.asarray(head), np.asarray(tail_)[_KEPT]])


def _names() -> list[str]:
    return [effect.name for effect in LIBRARY]
