"""What a script of an engine in Python reads beside it: grains and walls as JSON."""

import json

from granulcal.export.mark import signed
from granulcal.export.mesh import triangles
from granulcal.export.setup import Setup

__all__ = ["places"]


def places(setup: Setup, engine: str) -> str:
    """Returns where the grains begin, how large they are, and the walls as meshes."""
    meshes = (triangles(body.shape) for body in setup.walls)
    return json.dumps(
        {
            "file": signed(setup.name, engine),
            "centres": setup.centres.tolist(),
            "radii": setup.radii.tolist(),
            "walls": [
                {"vertices": mesh.vertices.tolist(), "faces": mesh.faces.tolist()}
                for mesh in meshes
            ],
        }
    )
