"""Fabric laws in Python: made, judged, run."""

from __future__ import annotations

import json
import math
import os
import re
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from plugin_calls import Sheet

import plyflow
from plyflow import laws
from plyflow._law_library import LEVELS, make

# Where what is compiled is not what is tested, one level is enough, and takes half of the time.
ONE = LEVELS[:1]

# The sheet of the page on laws in C (docs/plugins/material.md), operation by operation.
SHEET = '''
import plyflow
from plyflow import declare

K1, K2, D, CUBIC = 1e5, 2e5, 1e-3, 1e-7


@plyflow.law("my-sheet", parameters={"shear_modulus": declare.quantity("force_per_length", default="1000 N/m", doc="G.")})
def membrane(p, c11, c22, c12):
    """A linear orthotropic sheet with a cubic bending law."""
    e11, e22 = 0.5 * (c11 - 1), 0.5 * (c22 - 1)
    return K1 * e11, K2 * e22, p.shear_modulus * c12, 0.5 * (K1 * e11 * e11 + K2 * e22 * e22 + p.shear_modulus * c12 * c12)


def moment(k):
    return D * k + CUBIC * k * k * k


def work(k):
    return 0.5 * D * k * k + 0.25 * CUBIC * k * k * k * k


@membrane.bending
def bending(k11, k22, k12):
    return moment(k11), moment(k22), moment(k12), work(k11) + work(k22) + 2 * work(k12)
'''

# Whatever a law may have: all forms of parameters, functions of math, histories of both parts, a loop, and tangents of its own.
RICH = '''
import math

import plyflow
from plyflow import declare

number = declare.number(default=1.0, doc="A number.")


@plyflow.law(
    "rich",
    version="1.2.3",
    vendor="Test",
    parameters={
        "fibre": declare.quantity("force_per_length", required=True, doc="Stiffness."),
        "terms": declare.list_of(declare.number(doc="A coefficient."), required=True, doc="Of odd powers."),
        "kind": declare.choice(["linear", "locking"], default="locking", doc="Of shear."),
        "softens": declare.boolean(default=True, doc="Whether fibres do."),
        "power": declare.integer(default=3, doc="Of locking."),
        "bending": declare.object_of({"stiff": number, "soft": number}, required=True, doc="Of folds."),
        "scale": declare.list_of(declare.quantity("curvature", doc="One."), required=True, doc="Of folds."),
    },
    history=2,
)
def membrane(p, dt, c11, c22, c12, history):
    """Everything at once."""
    e11, e22 = 0.5 * (c11 - 1.0), 0.5 * (c22 - 1.0)
    factor = 1.0
    if p.softens:
        # It is read and not written: where fibres soften on the way, the stress would be no derivative of this energy.
        factor = math.exp(-0.01 * history[1])
    history[0] = max(history[0], abs(c12))
    shear, energy = 0.0, 0.0
    for i in range(len(p.terms)):
        shear += p.terms[i] * c12 ** (2 * i + 1)
        energy += p.terms[i] * c12 ** (2 * i + 2) / (2 * i + 2)
    if p.kind == 1:
        shear += 10.0 * math.sinh(c12)
        energy += 10.0 * (math.cosh(c12) - 1.0)
    energy += 0.5 * p.fibre * factor * (e11 * e11 + e22 * e22)
    return p.fibre * factor * e11, p.fibre * factor * e22, shear, energy


@membrane.bending(history=2)
def bending(p, c11, k11, k22, k12, history):
    history[0] = max(history[0], abs(k11))
    m11, w11 = fold(p.bending.stiff, p.scale[0], k11)
    m22, w22 = fold(p.bending.soft, p.scale[1], k22)
    m12, w12 = fold(p.bending.soft, p.scale[1], k12)
    return m11, m22, m12, w11 + w22 + 2.0 * w12


def fold(stiff, scale, k):
    """A moment that goes over from one slope to half of it."""
    soft = 0.5 * stiff
    return soft * k + soft * scale * math.tanh(k / scale), 0.5 * soft * k * k + soft * scale * scale * math.log(math.cosh(k / scale))


@membrane.tangent
def tangent(p, k11, k22, k12):
    return slope(p.bending.stiff, p.scale[0], k11), slope(p.bending.soft, p.scale[1], k22), slope(p.bending.soft, p.scale[1], k12)


def slope(stiff, scale, k):
    return 0.5 * stiff * (1.0 + 1.0 / math.cosh(k / scale) ** 2)
'''
RICH_SHEET: dict[str, Any] = {
    "fibre": 5e4, "terms": [100.0, 400.0, 30.0], "kind": "locking", "softens": True, "power": 3, "bending": {"stiff": 2e-3, "soft": 1e-3},
    "scale": [100.0, 50.0], "thickness": 3e-4, "areal_mass": 0.3,
}  # fmt: skip


def written(folder: Path, text: str, name: str = "my_law.py") -> Path:
    path = folder / name
    path.write_text(textwrap.dedent(text))
    return path


def made(source: Path, levels: tuple[str, ...] = LEVELS, name: str = "liblaw.so") -> Path:
    return Path(make(laws.load(source), source, source.parent / name, levels)["library"])


def judged(library: Path, *words: str) -> tuple[int, dict[str, str]]:
    """What `plyflow check-plugin` says of a library: its code, and the lines that are no pass."""
    done = subprocess.run([str(plyflow.program()), "check-plugin", str(library), *words], capture_output=True, text=True, check=False)
    lines = [line.split() for line in done.stdout.splitlines() if line.startswith(("  FAILED", "  skipped", "  passed"))]
    return done.returncode, {words[1]: words[0] for words in lines}


@pytest.fixture(scope="module")
def sheet(tmp_path_factory: pytest.TempPathFactory) -> tuple[laws.Law, Path]:
    """The sheet of the page, and its library."""
    source = written(tmp_path_factory.mktemp("sheet"), SHEET)
    return laws.load(source), made(source)


@pytest.fixture(scope="module")
def rich(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The source of the law that has everything."""
    return written(tmp_path_factory.mktemp("rich"), RICH)


def states(lanes: int = 64) -> tuple[Any, Any]:
    """Metrics and curvatures, from a fixed stream of random numbers."""
    random = np.random.default_rng(7)
    metric = 0.1 * random.standard_normal((3, lanes)) + [[1.0], [1.0], [0.0]]
    return metric, 100.0 * random.standard_normal((3, lanes))


def test_a_law_keeps_the_contract_whole(sheet: tuple[laws.Law, Path]) -> None:
    code, checks = judged(sheet[1])
    assert code == 0 and len(checks) >= 27 and set(checks.values()) == {"passed"}, checks


def test_a_law_with_histories_and_all_forms_of_parameters_keeps_the_contract_whole(rich: Path) -> None:
    library = made(rich, name="libjudged.so")
    parts = {name: value for name, value in RICH_SHEET.items() if name not in ("thickness", "areal_mass")}
    parts.update(fibre="5e4 N/m", scale=["100 1/m", "50 1/m"])
    sheet = {"plyflow_material": 1, "name": "rich", "plugin": str(library), "thickness": "0.3 mm", "areal_mass": "0.3 kg/m2", "with": parts}
    file = rich.parent / "rich.yaml"
    file.write_text(json.dumps(sheet))
    code, checks = judged(library, "--material", str(file))
    assert code == 0 and len(checks) >= 27 and set(checks.values()) == {"passed"}, checks


def test_an_energy_that_is_not_the_integral_of_the_stress_is_found(tmp_path: Path) -> None:
    code, checks = judged(made(written(tmp_path, SHEET.replace("0.5 * (K1 * e11 * e11", "0.6 * (K1 * e11 * e11")), ONE))
    assert code == 7 and {name for name, said in checks.items() if said == "FAILED"} == {"stress", "cycle"}, checks


def test_a_stress_that_is_no_number_is_found(tmp_path: Path) -> None:
    text = SHEET.replace("import plyflow\n", "import math\nimport plyflow\n", 1).replace("p.shear_modulus * c12,", "math.sqrt(0.5 - c12) * c12,")
    code, checks = judged(made(written(tmp_path, text), ONE))
    assert code == 7 and {name for name, said in checks.items() if said == "FAILED"} == {"finite"}, checks


def test_compiled_code_has_the_bits_of_plain_python(sheet: tuple[laws.Law, Path]) -> None:
    # Only additions and products, which have one right result. Of functions such as exp the last bit may differ from Python's.
    law, library = sheet
    metric, curvature = states()
    given = {"shear_modulus": 321.0, "thickness": 3e-4, "areal_mass": 0.3}
    compiled = Sheet(library, given)
    p = law.sheet(**given)
    stress, energy, _, _ = compiled.membrane(metric)
    moment, work, _ = compiled.bending(metric, curvature)
    for lane in range(metric.shape[1]):
        assert (*stress[:, lane], energy[lane]) == law(p, *map(float, metric[:, lane]))
        assert (*moment[:, lane], work[lane]) == law.functions["bending"](*map(float, curvature[:, lane]))


def test_parameters_and_histories_arrive_as_in_plain_python(rich: Path) -> None:
    law, compiled = laws.load(rich), Sheet(made(rich, name="libarrive.so"), RICH_SHEET)
    assert (compiled.sizes.membrane, compiled.sizes.bending, compiled.sizes.bends) == (2, 2, 1)
    assert (compiled.sizes.thickness, compiled.sizes.areal_mass) == (3e-4, 0.3)
    metric, curvature = states()
    first = np.repeat([[0.1], [2.5]], 64, axis=1)
    stress, energy, _, history = compiled.membrane(metric, first)
    moment, work, tangent = compiled.bending(metric, curvature)
    p = law.sheet(**RICH_SHEET)
    for lane in range(64):
        remembers = np.array([0.1, 2.5])
        want = law(p, 1e-6, *metric[:, lane], remembers)
        assert np.allclose([*stress[:, lane], energy[lane]], want, rtol=1e-13, atol=0.0)
        assert history[:, lane].tolist() == remembers.tolist()
        want = law.functions["bending"](p, metric[0, lane], *curvature[:, lane], np.zeros(2))
        assert np.allclose([*moment[:, lane], work[lane]], want, rtol=1e-12, atol=0.0)
        assert np.allclose(tangent[:, lane], law.functions["tangent"](p, *curvature[:, lane]), rtol=1e-13, atol=0.0)


def test_code_for_both_kinds_of_processors_gives_the_same_bits(rich: Path) -> None:
    metric, curvature = states()
    answers = []
    for level in LEVELS:
        compiled = Sheet(made(rich, (level,), f"lib{level}.so"), RICH_SHEET)
        answers.append([*compiled.membrane(metric), *compiled.bending(metric, curvature)])
    for first, second in zip(*answers):
        assert np.array_equal(first, second)


def test_the_same_source_gives_the_same_bytes_in_any_folder_and_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = made(written(tmp_path, RICH))
    other = tmp_path / "an other folder"
    other.mkdir()
    # Settings of the user, and a comment, have no part in it.
    monkeypatch.setenv("NUMBA_OPT", "0")
    monkeypatch.setenv("PYTHONHASHSEED", "77")
    monkeypatch.chdir(other)
    (other / ".numba_config.yaml").write_text("boundscheck: 1\nopt: 0\n")
    second = made(written(other, "# Another comment.\n" + RICH, "other_name.py"), name="libother.so")
    assert first.read_bytes() == second.read_bytes()
    third = made(written(tmp_path, RICH.replace("-0.01 *", "-0.02 *")))
    assert third.read_bytes() != second.read_bytes()


FUNCTIONS = '''
import math

import numpy as np
import plyflow
from plyflow import declare

TABLE = np.array([0.1, 0.7, 1.3, 2.9])
TUPLE = (1.0, 2.0, 3.5)


@plyflow.law("functions", parameters={"n": declare.integer(default=3, doc="A power.")})
def membrane(p, c11, c22, c12):
    """Functions of mathematics, tables, loops."""
    x = abs(c12) + 0.2
    a = math.sin(x) + math.cos(x) + math.tan(x) + math.asin(0.1 * x) + math.acos(0.1 * x) + math.atan(x) + math.atan2(x, c11)
    a += math.sinh(x) + math.cosh(x) + math.tanh(x) + math.asinh(x) + math.acosh(1.0 + x) + math.atanh(0.1 * x)
    a += math.exp(x) + math.expm1(x) + math.log(x) + math.log1p(x) + math.log10(x) + math.log2(x) + math.sqrt(x) + math.hypot(x, c11)
    b = x**0.3 + math.pow(x, 1.7) + x**p.n + x ** (-p.n) + np.exp(x) + np.sqrt(x) + np.cbrt(x) + np.arctan2(x, c11) + np.maximum(x, 0.3)
    b += math.floor(3 * x) + math.ceil(3 * x) + math.trunc(3 * x) + (5 * x) % 0.7 + (5 * x) // 0.7 + math.copysign(x, c12) + round(3 * x)
    b += math.erf(x) + math.erfc(x) + math.gamma(x + 1.0) + math.lgamma(x + 1.0) + math.ldexp(x, 3) + np.sign(c12)
    c, i = 0.0, 0
    while i < len(TUPLE):
        c += TUPLE[i] * x**i
        i += 1
    for entry in TABLE:
        c += entry * x
    return a, b, c, between(x)


def between(x):
    for i in range(len(TABLE) - 1):
        if x < TABLE[i + 1]:
            return TABLE[i] + (x - TABLE[i]) / (TABLE[i + 1] - TABLE[i])
    return TABLE[-1]
'''


def test_functions_of_mathematics_and_tables_are_those_of_python_to_the_last_bits(tmp_path: Path) -> None:
    source = written(tmp_path, FUNCTIONS)
    law = laws.load(source)
    given = {"n": 3, "thickness": 1e-3, "areal_mass": 1.0}
    metric, _ = states()
    stress, energy, _, _ = Sheet(made(source), given).membrane(metric)
    for lane in range(metric.shape[1]):
        want = law(law.sheet(**given), *map(float, metric[:, lane]))
        assert np.allclose([*stress[:, lane], energy[lane]], want, rtol=1e-14, atol=0.0)


def test_measured_bounds_are_above_the_tangents_and_near_them(tmp_path: Path) -> None:
    # Both families share their strain, and one term ties them to shear: the bound is that of a full matrix.
    text = '''
    import plyflow

    @plyflow.law("tied")
    def membrane(c11, c22, c12):
        """A full matrix of moduli."""
        e, f = 0.5 * (c11 - 1.0), 0.5 * (c22 - 1.0)
        s11, s22, s12 = 9.0 * e + 4.0 * f + c12, 4.0 * e + 5.0 * f - 2.0 * c12, 3.0 * c12 + e - 2.0 * f
        return s11, s22, s12, 0.5 * (s11 * e + s22 * f + s12 * c12)
    '''
    root = math.sqrt(2.0)
    # c12 is twice E12: in the tensor's norm its column and row have a factor of root 2 each.
    matrix = np.array([[9.0, 4.0, root], [4.0, 5.0, -2.0 * root], [root, -2.0 * root, 6.0]])
    largest = float(np.linalg.eigvalsh(matrix)[-1])
    metric, _ = states(8)
    _, _, stiffness, _ = Sheet(made(written(tmp_path, text), ONE), {"thickness": 1e-3, "areal_mass": 1.0}).membrane(metric)
    assert (stiffness[0] >= largest).all() and (stiffness[0] <= 1.2 * largest).all(), (stiffness[0], largest)
    assert (stiffness[1] >= 3.0).all() and (stiffness[1] <= 3.05).all(), stiffness[1]


LAW = '''
import math
import numpy as np
import plyflow
from plyflow import declare

@plyflow.law("bad", parameters={"g": declare.number(default=1.0, doc="G")}, history=1)
def membrane(p, c11, c22, c12, history):
    """Bad."""
    x = c11
    LINE
    return x, 0.0, 0.0, 0.0
'''


@pytest.mark.parametrize(
    ("line", "at", "said"),
    [
        ("x = p.modulus", 11, "Unknown attribute 'modulus'"),
        ("x = np.zeros(3)[0]", 11, "'zeros' makes an array"),
        ("x = [c11][0]", 11, "makes no lists"),
        ("history[1] = x", 11, "remembers history[0]; declare them: history=2"),
        ("raise ValueError", 11, "cannot raise"),
        ("print(x)", 11, "cannot print"),
        ("x = nowhere", 11, "'nowhere' is not defined"),
        ("x = math.nothing(x)", 11, "no attribute 'nothing'"),
        ("with numba.objmode(): pass", 11, "object mode would run Python for every point"),
        ("x = 1.0 if c12 > 0 else 'a'", 11, "has no texts"),
        ("if c12 > 0: x = (x, x)", 12, "Cannot unify"),
        ("x = np.sort(np.array((c11, c12)))[0]", 11, "'array' makes an array"),
        ("return x, x, x", 11, "4 numbers: s11, s22, s12, energy"),
    ],
)
def test_what_cannot_be_compiled_is_refused_with_its_line_and_reason(tmp_path: Path, line: str, at: int, said: str) -> None:
    source = written(tmp_path, LAW.replace("LINE", line))
    with pytest.raises(plyflow.InvalidInput) as caught:
        make(laws.load(source), source, tmp_path / "libbad.so", ONE)
    finding = caught.value.findings[0]
    assert finding.file == str(source) and finding.line == at and said in str(finding), finding
    assert not list(tmp_path.glob("*.so"))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("x = 1\n", "the file has 0 laws"),
        ("def f(:\n", "this is no Python"),
        ("import nowhere\n", "No module named 'nowhere'"),
        (LAW.replace("default=1.0, ", "").replace("LINE", ""), "parameter 'g' may be absent"),
        (LAW.replace('"g"', '"thickness"').replace("LINE", ""), "every sheet has it already"),
        (LAW.replace('"g"', '"shear-modulus"').replace("LINE", ""), "as the law writes p.shear_modulus"),
        (LAW.replace("declare.number(default=1.0", "dict(type='string', default='x'").replace("LINE", ""), "of type string"),
        (LAW.replace("c12, history", "c13, history").replace("LINE", ""), "membrane takes 'c13'; expected: any of p, dt, c11, c22, c12, history"),
        (LAW.replace('    """Bad."""\n', "").replace("LINE", ""), "has no documentation"),
        (LAW.replace("history=1", "history=257").replace("LINE", ""), "0 to 256"),
    ],
)
def test_a_declaration_that_does_not_fit_is_refused(tmp_path: Path, text: str, said: str) -> None:
    source = written(tmp_path, text)
    with pytest.raises(plyflow.InvalidInput, match=str(source)) as caught:
        laws.load(source)
    assert said in str(caught.value)


def test_a_value_that_does_not_fit_is_named_when_a_sheet_is_made(sheet: tuple[laws.Law, Path]) -> None:
    with pytest.raises(ValueError, match="parameter shear_modulus: given null; expected a number"):
        Sheet(sheet[1], {"thickness": 1e-3, "areal_mass": 1.0})
    with pytest.raises(plyflow.PlyflowError, match="no value of 'shear_modulus'; give a number in SI units"):
        sheet[0].sheet(thickness=1e-3, areal_mass=1.0)
    with pytest.raises(plyflow.PlyflowError, match="no parameter shear; it has shear_modulus, thickness, areal_mass"):
        sheet[0].sheet(shear=1.0)


def test_without_numba_the_error_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from importlib import util

    source = written(tmp_path, SHEET)
    law = laws.load(source)
    monkeypatch.setattr(util, "find_spec", lambda name: None)
    with pytest.raises(plyflow.MissingPackage, match="pip install numba"):
        make(law, source, tmp_path / "liblaw.so")


def test_modules_beside_the_law_are_watched_and_compiled(tmp_path: Path) -> None:
    written(tmp_path, "def double(x):\n    return 2.0 * x\n", "doubling.py")
    text = LAW.replace("import math\n", "from doubling import double\n").replace("LINE", "x = double(c11)")
    source = written(tmp_path, text)
    told = make(laws.load(source), source, tmp_path / "made" / "libbad.so")
    beside = [path for path in told["watch"] if path.startswith(str(tmp_path))]
    assert beside == [str(tmp_path / "doubling.py"), str(source)]
    # A new version of the compiler, or of the carrier, makes it anew.
    names = [Path(path).name for path in told["watch"]]
    assert {"numba", "llvmlite", "libplyflow_python_law.so"} <= {name.split("-")[0] for name in names}, names
    assert told["library"] == str(tmp_path / "made" / "libbad.so")
    stress, _, _, _ = Sheet(Path(told["library"]), {"g": 1.0, "thickness": 1.0, "areal_mass": 1.0}).membrane(np.full((3, 8), 1.5))
    assert (stress[0] == 3.0).all()


def blocks(page: Path, language: str) -> list[str]:
    """The blocks of code of a page of the book."""
    return re.findall(rf"```{language}\n(.*?)```", page.read_text(encoding="utf-8"), re.S)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder for files that the program makes into libraries, with a cache of its own and this interpreter."""
    monkeypatch.setenv("PLYFLOW_PYTHON", sys.executable)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def runs_and_meets_its_closed_form(folder: Path, material: str = "my-fabric.yaml", runs: int = 1) -> None:
    code, checks = judged(folder / "my_fabric.py", "--material", str(folder / material))
    assert code == 0 and len(checks) >= 27 and set(checks.values()) == {"passed"}, checks
    words = [str(plyflow.program()), "run", str(folder / "workflow.yaml"), "--check", "--no-report"]
    refused = subprocess.run(words, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    assert refused.returncode != 0 and "plyflow trust" in refused.stderr
    done = subprocess.run([*words, "--trust"], stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    assert done.returncode == 0 and f"{runs} run, 0 cached" in done.stdout, done


def test_the_template_runs_in_a_workflow_and_meets_its_closed_form(folder: Path) -> None:
    subprocess.run([str(plyflow.program()), "new", "material", "my-fabric", "--python"], capture_output=True, check=True, cwd=folder)
    place = folder / "my-fabric"
    runs_and_meets_its_closed_form(place, "sheet.yaml", runs=2)
    # The library is that of the code, not of the words around it.
    source = place / "my_fabric.py"
    source.write_text("# A comment.\n" + source.read_text())
    words = [str(plyflow.program()), "run", str(place / "workflow.yaml"), "--check", "--no-report", "--trust"]
    again = subprocess.run(words, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=True)
    assert "0 run, 2 cached" in again.stdout
    source.write_text(source.read_text().replace('default="400 N/m"', 'default="500 N/m"'))
    again = subprocess.run(words, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    assert again.returncode == 5 and "2 run, 0 cached" in again.stdout, again


def test_the_law_of_the_page_runs_and_its_bounds_hold(folder: Path) -> None:
    page = Path(__file__).parents[3] / "docs" / "plugins" / "law-in-python.md"
    law, shown, bounds = blocks(page, "python")
    material, workflow = blocks(page, "yaml")
    for name, text in (("my_fabric.py", law), ("my-fabric.yaml", material), ("workflow.yaml", workflow)):
        (folder / name).write_text(text)
    runs_and_meets_its_closed_form(folder)
    (folder / "my_fabric.py").write_text(law + bounds)
    runs_again = judged(folder / "my_fabric.py", "--material", str(folder / "my-fabric.yaml"))
    assert runs_again[0] == 0 and set(runs_again[1].values()) == {"passed"}, runs_again
    paths = [str(folder), str(Path(plyflow.__file__).parents[1])]
    told = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    printed = subprocess.run([sys.executable, "-c", shown], capture_output=True, text=True, check=True, env=told).stdout.splitlines()
    assert len(printed) == 81 and float(printed[40].split()[1]) > float(printed[0].split()[1]) == 0.0 > float(printed[-1].split()[1])


def test_what_is_wrong_with_a_law_is_shown_where_a_material_names_it(folder: Path) -> None:
    source = written(folder, LAW.replace("LINE", "print(x)"), "my_fabric.py")
    sheet = {"plyflow_material": 1, "name": "bad", "plugin": "./my_fabric.py", "thickness": "0.3 mm", "areal_mass": "300 g/m2", "with": {}}
    (folder / "bad.yaml").write_text(json.dumps(sheet))
    frame = {"plugin": "coupon-picture-frame", "with": {"material": "bad.yaml", "path": ["0.3 rad"]}}
    (folder / "workflow.yaml").write_text(json.dumps({"plyflow": 1, "name": "bad", "steps": {"frame": frame}}))
    words = [str(plyflow.program()), "validate", str(folder / "workflow.yaml"), "--trust", "--format", "json"]
    told = json.loads(subprocess.run(words, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False).stdout)
    assert any(f"{source}:11:5: membrane: a law cannot print" in finding["message"] for finding in told), told


def test_the_command_says_what_is_wrong_with_a_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert laws.main([str(tmp_path / "nothing.py")]) == 1
    assert "there is no file" in capsys.readouterr().err
    source = written(tmp_path, LAW.replace("LINE", "print(x)"))
    assert laws.main([str(source), "-o", str(tmp_path / "x.so")]) == 3
    assert f"{source}:11:" in capsys.readouterr().err


def test_the_carrier_alone_is_no_plugin_for_the_program() -> None:
    told = subprocess.run([str(plyflow.program()), "plugins", "--format", "json"], capture_output=True, text=True, check=True)
    said = json.loads(told.stdout)
    assert not said["broken"], said["broken"]
    assert len(said["plugins"]) > 20 and not [p for p in said["plugins"] if "libplyflow_python_" in p["path"]]
