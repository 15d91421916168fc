"""Scenes, materials and workflows that are made from Python."""

from __future__ import annotations

import random
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import plyflow
from plyflow import _yaml
from plyflow._ask import plain

yaml = pytest.importorskip("yaml", reason="PyYAML, against which the writer is held, is not in this environment")

WORDS = ["", "a", "no", "Yes", "null", "~", "1", "1.0", "-", "- a", "a: b", "a #b", "5 mm", "-45 deg", "1e5 Pa", "12 e", "0x1", "1_000", "12:30:45", "é",
         "line\nline", " lead", "tail ", "'", '"', "{", "}", "[x]", "a, b", "&a", "*a", "!t", "%d", "@x", "`y", "2001-01-01", "=", "<<", ".5", "1.", "+1",
         "${angle}", "90 deg + ${angle}", "../a/b.yaml", "\t", "\u2028", "1 mm2", "on", ".inf", "?", "? a", "|", ">", "0o7", "1e5", "-.inf"]  # fmt: skip


def value(random: random.Random, depth: int) -> object:
    kind = random.randrange(8 if depth < 4 else 5)
    if kind < 3:
        return random.choice(WORDS)
    if kind == 3:
        return random.choice([0, 7, -3, 1.5, -1e-9, 1e300, 0.1, 2.0, 1e16])
    if kind == 4:
        return random.choice([None, True, False])
    if kind < 7:
        return {random.choice(WORDS): value(random, depth + 1) for _ in range(random.randrange(4))}
    return [value(random, depth + 1) for _ in range(random.randrange(5))]


def test_what_is_written_is_read_back_by_another_reader() -> None:
    numbers = random.Random(1)
    for _ in range(3000):
        given = {"top": value(numbers, 0)}
        text = _yaml.dump(given)
        assert yaml.safe_load(text) == given, text


def test_what_is_written_means_the_same_to_the_program(tmp_path: Path) -> None:
    # Descriptions take any text: what the program makes of one is seen in the name of a step's file.
    for word in ("no", "1.0", "a: b", "12:30", "x # y"):
        workflow = plyflow.Workflow(word)
        workflow.step("drape", "forming-kinematic", scene="nowhere.yaml", element_size="8 mm")
        found = workflow.findings(tmp_path)
        assert [f for f in found if "name" in f.message] == [], word
        assert any("nowhere.yaml" in f.message + str(f.given) for f in found)


def test_numbers_that_are_none_are_refused() -> None:
    with pytest.raises(ValueError, match="finite"):
        plyflow.Scene("s", friction={"fabric_fabric": float("nan")}).to_yaml()
    with pytest.raises(TypeError, match="object"):
        plyflow.Scene("s", friction={"fabric_fabric": object()}).to_yaml()


def test_numbers_of_numpy_and_paths_become_plain() -> None:
    given = {"a": np.float64(0.5), "b": np.arange(2), "c": Path("x/y"), "d": (1, 2)}
    assert plain(given) == {"a": 0.5, "b": [0, 1], "c": "x/y", "d": [1, 2]}


def test_a_scene_of_the_demo_can_be_made_here_and_is_valid(tmp_path: Path, dome: Path) -> None:
    assert plyflow.open(dome)
    text = dome.with_name("scene.yaml").read_text()
    again = plyflow.Scene("dome", **{k: v for k, v in yaml.safe_load(text).items() if k not in ("plyflow_scene", "name")})
    again.validate(tmp_path)
    assert list(tmp_path.iterdir()) == [], "nothing is left behind"
    assert again.to_yaml() == text


def test_a_wrong_scene_is_told_with_the_line_of_its_text(tmp_path: Path) -> None:
    sheets = [plyflow.diaphragm("film"), plyflow.ply("ply_1", "ncf-fcim359", "96 metres", "96 mm", (0, 90))]
    scene = plyflow.Scene("wrong", tool={"hemisphere": {"radius": "50 mm", "facet_sise": "4 mm"}}, sheets=sheets, friction={})
    with pytest.raises(plyflow.InvalidInput) as caught:
        scene.validate(tmp_path)
    lines = scene.to_yaml().split("\n")
    by_line = {lines[f.line - 1]: f for f in caught.value.findings}
    unit = next(f for line, f in by_line.items() if "96 metres" in line)
    assert "96 metres" in lines[unit.line - 1][unit.column - 1 :]
    key = next(f for line, f in by_line.items() if "facet_sise" in line and "facet_size" in str(f))
    assert key.file == "<Scene wrong>"


def test_a_material_is_checked_by_the_program(tmp_path: Path) -> None:
    material = plyflow.Material("film", plugin="linear", thickness="50 um", areal_mass="lots")
    with pytest.raises(plyflow.InvalidInput, match="lots"):
        material.validate(tmp_path)


def test_a_file_is_written_whole_or_not_at_all(tmp_path: Path) -> None:
    workflow = plyflow.Workflow("w")
    with pytest.raises(plyflow.NotFound, match="make it first"):
        workflow.write(tmp_path / "nowhere" / "workflow.yaml")
    path = workflow.write(tmp_path / "workflow.yaml")
    assert path.read_text() == "plyflow: 1\nname: w\nsteps: {}\n"
    assert [p.name for p in tmp_path.iterdir()] == ["workflow.yaml"]


def test_every_name_of_the_package_is_there_and_the_command_waits_for_no_numpy() -> None:
    assert all(getattr(plyflow, name) is not None for name in plyflow.__all__)
    assert set(plyflow.__all__) <= set(dir(plyflow))
    code = "import sys, plyflow._installation; sys.exit(any(m in sys.modules for m in ('numpy', 'h5py', 'importlib.metadata')))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
