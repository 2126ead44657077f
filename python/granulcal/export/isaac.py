"""Isaac Sim and PhysX: a USD stage with UsdPhysics materials; usd-core writes it.

PhysX has no rolling and no torsional friction of materials. Coefficients of two materials are combined as
the PhysX material schema says; here as the mean, and grains that meet carry the same.
"""

from typing import Any

from granulcal.export.mark import signed
from granulcal.export.mesh import triangles
from granulcal.export.setup import Contact, Setup

__all__ = ["ENGINE", "NOTES", "UNEQUAL", "material", "scene"]

ENGINE = "isaac"
NOTES = (
    "rolling_friction has no counterpart: PhysX materials have none, heaps come out flatter and wider",
    "torsional_friction has no counterpart",
    "tangential_restitution has no counterpart",
    "at walls friction and restitution are the mean of the grains' and the wall's, unless they are equal",
    "a scene by itself lets nothing slower than 0.2 m/s bounce and takes 60 steps a second, in each of which a grain "
    "falls through others: physxScene:bounceThreshold = 0.01, physxScene:timeStepsPerSecond = 2000",
)
UNEQUAL = "the material is the same for all sizes"
"""What of a material is not each grain's own where they differ in size."""
# What is slower does not bounce [m/s], and steps a second; by themselves 0.2 and 60 (PhysxSceneAPI).
_SLOWEST_BOUNCE, _RATE = 0.01, 2000


def material(setup: Setup, young: float | None = None) -> str:
    """Returns a UsdPhysics material as text of a .usda file."""
    del young
    return (
        '#usda 1.0\n(\n    defaultPrim = "grain"\n    kilogramsPerUnit = 1\n    metersPerUnit = 1\n'
        '    upAxis = "Z"\n)\n\n'
        'def Material "grain" (\n    prepend apiSchemas = ["PhysicsMaterialAPI"]\n)\n{\n'
        f"    float physics:staticFriction = {setup.grains.sliding_friction:.9g}\n"
        f"    float physics:dynamicFriction = {setup.grains.sliding_friction:.9g}\n"
        f"    float physics:restitution = {setup.grains.restitution:.9g}\n"
        f"    float physics:density = {setup.density:g}\n"
        "}\n"
    )


def scene(setup: Setup, young: float | None = None) -> dict[str, str]:
    """Returns the file of a pour, a USD stage as text.

    Raises:
        ModuleNotFoundError: usd-core is not installed.
    """
    del young
    from pxr import (  # pyright: ignore[reportMissingImports]
        Gf,
        Sdf,
        Usd,
        UsdGeom,
        UsdPhysics,
        UsdShade,
        Vt,
    )

    # In memory: whoever writes it checks what stands in its place.
    stage: Any = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)
    physics = UsdPhysics.Scene.Define(stage, "/physics")
    magnitude = sum(g * g for g in setup.gravity) ** 0.5
    # Without gravity the direction stays as it is by itself.
    if magnitude > 0.0:
        physics.CreateGravityDirectionAttr(Gf.Vec3f(*(g / magnitude for g in setup.gravity)))
    physics.CreateGravityMagnitudeAttr(magnitude)
    # By name: usd-core does not know PhysX' schema.
    whole = physics.GetPrim()
    whole.AddAppliedSchema("PhysxSceneAPI")
    for name, kind, value in (
        ("bounceThreshold", Sdf.ValueTypeNames.Float, _SLOWEST_BOUNCE),
        ("timeStepsPerSecond", Sdf.ValueTypeNames.UInt, _RATE),
    ):
        whole.CreateAttribute(f"physxScene:{name}", kind, custom=False).Set(value)

    def law(name: str, of: Contact) -> Any:
        made = UsdShade.Material.Define(stage, f"/materials/{name}")
        api = UsdPhysics.MaterialAPI.Apply(made.GetPrim())
        api.CreateStaticFrictionAttr(of.sliding_friction)
        api.CreateDynamicFrictionAttr(of.sliding_friction)
        api.CreateRestitutionAttr(of.restitution)
        api.CreateDensityAttr(setup.density)
        return made

    def bind(prim: Any, made: Any) -> None:
        UsdPhysics.CollisionAPI.Apply(prim)
        UsdShade.MaterialBindingAPI.Apply(prim).Bind(
            made, UsdShade.Tokens.weakerThanDescendants, "physics"
        )

    ground = UsdGeom.Plane.Define(stage, "/ground")
    bind(ground.GetPrim(), law("ground", setup.ground))
    for body in setup.walls:
        mesh = triangles(body.shape)
        made = UsdGeom.Mesh.Define(stage, f"/{body.name}")
        made.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(mesh.vertices.astype("float32")))
        made.CreateFaceVertexCountsAttr([3] * len(mesh.faces))
        made.CreateFaceVertexIndicesAttr(mesh.faces.ravel().tolist())
        bind(made.GetPrim(), law(body.name, body.law))
    grain = law("grain", setup.grains)
    for i, (centre, radius) in enumerate(zip(setup.centres, setup.radii, strict=True)):
        ball = UsdGeom.Sphere.Define(stage, f"/grains/grain{i}")
        ball.CreateRadiusAttr(float(radius))
        ball.AddTranslateOp().Set(Gf.Vec3d(*map(float, centre)))
        UsdPhysics.RigidBodyAPI.Apply(ball.GetPrim())
        bind(ball.GetPrim(), grain)
    first, _, rest = stage.GetRootLayer().ExportToString().partition("\n")
    return {"pour.usda": f"{first}\n# {signed(setup.name, ENGINE)}\n{rest}"}
