"""The picture of docs/plugins/law-in-python.md: the law of that page, in plain Python."""

import re
import sys
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import runs
import style

sys.path.insert(0, str(runs.ROOT / "orchestrator" / "python"))


def law_in_python():
    """Shear stress over the shear angle, with the yarns rubbing on each other and without."""
    from plyflow import laws

    page = (runs.ROOT / "docs" / "plugins" / "law-in-python.md").read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "my_fabric.py"
        file.write_text(re.findall(r"```python\n(.*?)```", page, re.S)[0], encoding="utf-8")
        membrane = laws.load(file)
    constants = {"fibre": 5e4, "shear": 100.0, "stiffening": 400.0, "stick": 1000.0, "bending": 1e-3, "thickness": 3e-4, "areal_mass": 0.3}
    turns = np.radians([0.0, 20.0, 0.0, 30.0, 0.0, 40.0, 0.0])
    angles = np.concatenate([np.linspace(a, b, 200, endpoint=False) for a, b in zip(turns, turns[1:])] + [turns[-1:]])

    def stress(friction, angles):
        sheet, history = membrane.sheet(friction=friction, **constants), [0.0, 0.0, 0.0]
        return [membrane(sheet, 1.0, 1.0, float(np.sin(angle)), history)[2] for angle in angles]

    figure, axes = plt.subplots(figsize=(5, 3.2), layout="constrained")
    once = np.linspace(0.0, turns.max(), 200)
    axes.plot(np.degrees(once), stress(0.0, once), color=style.GREY, linestyle=(0, (4, 2)), label="without friction")
    axes.plot(np.degrees(angles), stress(20.0, angles), color=style.BLUE, label="friction of 20 N/m")
    axes.set(xlabel="shear angle (deg)", ylabel="shear stress S₁₂ (N/m)", xlim=(0, 41))
    axes.legend(loc="upper left")
    return style.save_svg(figure, "law-in-python")
