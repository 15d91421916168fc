"""Tests of the package against a run of the demo, which `scripts/check-wheel` makes.

``PLYFLOW_DEMO`` names the folder in which `plyflow demo --coarse` was run. Without it nothing can be tested, and that is an error.
"""

from __future__ import annotations

import os
from pathlib import Path

import pytest

import plyflow


@pytest.fixture(scope="session")
def demo() -> Path:
    """The workflow of the demo, which has been run."""
    folder = os.environ.get("PLYFLOW_DEMO")
    if not folder:
        pytest.fail("PLYFLOW_DEMO is not set: name the folder in which `plyflow demo --coarse` was run")
    return Path(folder) / "plyflow-demo" / "joggle-spar" / "workflow-coarse.yaml"


@pytest.fixture(scope="session")
def run(demo: Path) -> plyflow.Run:
    """The run of the demo."""
    opened = plyflow.open(demo)
    assert isinstance(opened, plyflow.Run)
    return opened


@pytest.fixture(scope="session")
def dome(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study of kinematic drapes over a hemisphere, that takes seconds: two angles, two sizes. It has not been run."""
    folder = tmp_path_factory.mktemp("dome")
    scene = plyflow.Scene(
        "dome",
        tool={"hemisphere": {"radius": "50 mm", "facet_size": "8 mm"}},
        sheets=[
            plyflow.diaphragm("lower"),
            plyflow.ply("ply_1", "woven-38616", "96 mm", "96 mm", (0, 90)),
            plyflow.diaphragm("upper"),
        ],
        friction={"tool_diaphragm": 0.5, "fabric_diaphragm": 0.4, "fabric_fabric": 0.35, "diaphragm_diaphragm": 0.3},
        process={"double_diaphragm": PROCESS},
    )
    scene.write(folder / "scene.yaml")
    workflow = plyflow.Workflow("dome")
    changed = {"file": "scene.yaml", "set": {"sheets.ply_1.fibre_1": "${angle}", "sheets.ply_1.fibre_2": "90 deg + ${angle}"}}
    changed["set"].update({"sheets.ply_1.length": "${size}", "sheets.ply_1.width": "${size}"})
    workflow.step("drape", "forming-kinematic", scene=changed, element_size="8 mm", net_spacing="4 mm")
    workflow.vary(angle=["0 deg", "45 deg"], size=["80 mm", "96 mm"])
    workflow.response("shear", "drape", "shear_max")
    return workflow.write(folder / "workflow.yaml")


PROCESS = {
    "frame_length": "600 mm",
    "frame_width": "600 mm",
    "bag_pressure": "1e5 Pa",
    "forming_pressure": "1e5 Pa",
    "clearance": "5 mm",
    "bagging_time": "80 ms",
    "lowering_time": "150 ms",
    "drawing_time": "200 ms",
    "settling_time": "40 ms",
    "film_pre_stretch": 0.01,
    "film_joint_margin": "30 mm",
}
