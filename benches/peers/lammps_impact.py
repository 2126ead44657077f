"""Single impacts in LAMMPS beside the closed form of our law, for the settings `usual` and `rigid`.

    python benches/peers/lammps_impact.py

Three tables: realised restitution; the share of the sliding velocity that an oblique impact on a
wall keeps; the share of the rolling velocity that a frictionless impact keeps, on a wall and
between grains.
"""

from lammps import lammps
from lammps_contact import (
    DENSITY,
    RADIUS,
    ROLLING_INERTIA,
    SETTINGS,
    TANGENTIAL_INERTIA,
    Elastic,
    Law,
    contact,
)

SHOWN = {name: SETTINGS[name] for name in ("usual", "rigid")}
RESTITUTIONS = (0.1, 0.14, 0.3, 0.5, 0.8)
SLIDING = (0.1, 0.5, 1.0, 2.0, 3.0, 4.0, 6.0)
"""Sliding over normal velocity before the impact [-]; mu_s is 0.5."""
ROLLING = (0.05, 0.2, 0.5, 1.0, 2.0)
"""Rolling over normal velocity before the impact [-]; mu_r is 0.3."""
SPEED = 1.0
"""Normal velocity before the impact [m/s]."""


def impact(
    law: Law, elastic: Elastic, at: str, sliding: float = 0.0, rolling: float = 0.0
) -> tuple[float, float, float]:
    """Returns normal, sliding and rolling velocity after an impact [m/s].

    Args:
        law: coefficients.
        elastic: LAMMPS' settings.
        at: `pair` (head on, no sliding) or `wall`.
        sliding: u before the impact [m/s]; walls only.
        rolling: rho before the impact [m/s].
    """
    words, pair = contact(law, elastic, at), at == "pair"
    engine = lammps(cmdargs=["-screen", "none", "-log", "none"])
    engine.commands_string("""
        units si
        atom_style sphere
        atom_modify sort 0 0
        boundary f f f
        newton off
        comm_modify vel yes
        region box block -0.2 0.2 -0.02 0.02 -0.04 0.04
        create_box 1 box
    """)
    # Barely apart; a pair is two grains that meet half way.
    above, grains = 1.0001 * RADIUS, 2 if pair else 1
    engine.create_atoms(grains, None, [1] * grains, [0, 0, above, 0, 0, -above][: 3 * grains])
    wall = "" if pair else f"fix ground all wall/gran granular {words} zplane 0 NULL"
    engine.commands_string(f"""
        set group all diameter {2 * RADIUS} density {DENSITY}
        neighbor 0.001 bin
        neigh_modify binsize 0.008
        pair_style granular
        pair_coeff * * {words}
        {wall}
        fix motion all nve/sphere
        timestep {elastic.dt}
    """)
    v, omega = engine.numpy.extract_atom("v"), engine.numpy.extract_atom("omega")
    if pair:
        v[:2, 2] = [-0.5 * SPEED, 0.5 * SPEED]
        omega[:2, 1] = [rolling / RADIUS, -rolling / RADIUS]
    else:
        v[0] = [sliding + rolling, 0.0, -SPEED]
        omega[0, 1] = rolling / RADIUS
    engine.command("run 1 post no")
    for _ in range(2000):
        engine.command("run 4 pre no post no")
        x, v, omega = (engine.numpy.extract_atom(name) for name in ("x", "v", "omega"))
        gap = x[0, 2] - x[1, 2] - 2 * RADIUS if pair else x[0, 2] - RADIUS
        if gap > 0.0:
            break
    else:
        raise RuntimeError(f"still in contact after 8000 steps: {words}")
    if pair:
        after = v[0, 2] - v[1, 2], 0.0, 0.5 * RADIUS * (omega[0, 1] - omega[1, 1])
    else:
        after = v[0, 2], v[0, 0] - RADIUS * omega[0, 1], RADIUS * omega[0, 1]
    engine.close()
    normal, sliding, rolling = (float(speed) for speed in after)
    return normal, sliding, rolling


def law_of(restitution: float, sliding: float = 0.0, rolling: float = 0.0) -> Law:
    """Returns a law with the same rolling friction at pairs and walls."""
    return Law(
        sliding_friction=sliding,
        rolling_friction=rolling,
        restitution=restitution,
        wall_rolling_friction=rolling,
    )


def kept(inertia: float, friction: float, restitution: float, ratio: float) -> float:
    """Returns the share of a sliding or rolling velocity that our law keeps [-].

    The impulse that would stop it is the velocity over A, the friction allows mu (1 + e) w_n / A_n.

    Args:
        inertia: A_t / A_n or A_r / A_n [-].
        friction: mu_s or mu_r [-].
        restitution: e [-].
        ratio: sliding or rolling over normal velocity before the impact [-].
    """
    return max(0.0, 1.0 - inertia * friction * (1.0 + restitution) / ratio)


def table(title: str, head: list[str], lines: list[list[str]]) -> None:
    """Prints a table in Markdown."""
    print(f"\n{title}\n")
    for line in [head, ["---"] * len(head), *lines]:
        print("| " + " | ".join(line) + " |")


def main() -> None:
    """Prints the three tables."""
    lines = [
        [
            f"{e:g}",
            name,
            *(f"{impact(law_of(e), elastic, at)[0] / SPEED:.3f}" for at in ("wall", "pair")),
        ]
        for e in RESTITUTIONS
        for name, elastic in SHOWN.items()
    ]
    table("Realised restitution", ["e", "settings", "wall", "pair"], lines)

    friction, lines = 0.5, []
    for e in RESTITUTIONS:
        law = [kept(TANGENTIAL_INERTIA, friction, e, u) for u in SLIDING]
        lines.append([f"{e:g}", "our law", *(f"{share:.2f}" for share in law)])
        for name, elastic in SHOWN.items():
            shares = [
                impact(law_of(e, sliding=friction), elastic, "wall", sliding=u)[1] / u
                for u in SLIDING
            ]
            lines.append([f"{e:g}", name, *(f"{share:.2f}" for share in shares)])
    head = ["e", "by", *(f"{u:g}" for u in SLIDING)]
    table("Share of u kept at a wall, mu_s 0.5, by u over normal velocity", head, lines)

    friction, lines = 0.3, []
    for at, inertia in (("wall", ROLLING_INERTIA["wall"]), ("pair", ROLLING_INERTIA["pair"] / 2)):
        for e in RESTITUTIONS:
            law = [kept(inertia, friction, e, rho) for rho in ROLLING]
            lines.append([at, f"{e:g}", "our law", *(f"{share:.2f}" for share in law)])
            for name, elastic in SHOWN.items():
                shares = [
                    impact(law_of(e, rolling=friction), elastic, at, rolling=rho)[2] / rho
                    for rho in ROLLING
                ]
                lines.append([at, f"{e:g}", name, *(f"{share:.2f}" for share in shares)])
    head = ["at", "e", "by", *(f"{rho:g}" for rho in ROLLING)]
    table("Share of rho kept, mu_s 0, mu_r 0.3, by rho over normal velocity", head, lines)


if __name__ == "__main__":
    main()
