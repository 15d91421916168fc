"""The modules beside the tests, as their steps import them; and the example, which is run once."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import plyflow

HERE = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(HERE))


def call(folder, *words, code=0):
    """What the program says, run in a folder."""
    done = subprocess.run([str(plyflow.program()), *words], cwd=folder, capture_output=True, text=True, stdin=subprocess.DEVNULL, check=False)
    assert done.returncode == code, done.stdout + done.stderr
    return done.stdout + done.stderr


def artifact(folder, workflow, step):
    run = plyflow.open(folder / workflow)
    return run[step].artifact


@pytest.fixture(scope="session")
def study(tmp_path_factory):
    """A copy of the example, which has been run, with a list of trusted files and a cache of its own."""
    folder = tmp_path_factory.mktemp("workflows")
    monkeypatch = pytest.MonkeyPatch()
    for name, value in (("PLYFLOW_PYTHON", sys.executable), ("XDG_CACHE_HOME", folder / "cache"), ("XDG_CONFIG_HOME", folder / "config")):
        monkeypatch.setenv(name, str(value))
    shutil.copytree(HERE, folder / HERE.name, ignore=shutil.ignore_patterns(".plyflow", "__pycache__", "tests", "report*"))
    shutil.copytree(HERE.parent / "materials", folder / "materials")
    call(folder / HERE.name, "trust", "step_tool.py", "dxf_outline.py", "mesh_export.py")
    call(folder / HERE.name, "run", "--no-report", "workflow.yaml")
    yield folder / HERE.name
    monkeypatch.undo()
