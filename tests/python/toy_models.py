"""Settings and a scene of models that are trained in a moment."""

import json

from signed import sign

from granulcal.pours.scene import Scene

QUICK = {"quiet": True, "method": "mdrff", "max_epochs": 3, "ensemble": 2, "features": 20}
SCENE = Scene.drop(0.02, count=3).to_toml()


def edit_json(folder, **changes):
    """Changes numbers of a kept model, and signs it."""
    path = folder / "model.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), **changes}))
    sign(folder)
