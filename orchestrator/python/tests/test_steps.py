"""Steps in Python: what they read and write, what they are made of, and how they fail."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from textwrap import dedent

import numpy as np
import pytest

import plyflow

HEAD = "import numpy as np\nimport plyflow\nfrom plyflow import declare\n"


class Place:
    """A folder with a workflow of one step `made`, in Python, and one that reads it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.workflow = folder / "workflow.yaml"
        self.write("steps:\n  made: {plugin: ./made.py}\n")

    def write(self, steps: str) -> None:
        self.workflow.write_text(f"plyflow: 1\nname: in-python\n{steps}", encoding="utf-8")

    def step(self, body: str, before: str = "", declared: str = 'output="example"', name: str = "made") -> None:
        """A step whose function has this body."""
        text = HEAD + dedent(before) + f'@plyflow.step("{name}", {declared})\ndef run(step):\n    """Makes something."""\n'
        self.folder.joinpath(f"{name}.py").write_text(text + "".join(f"    {line}\n" for line in dedent(body).strip().splitlines()), encoding="utf-8")

    def run(self, *words: str, trust: bool = True) -> subprocess.CompletedProcess[str]:
        command = [str(plyflow.program()), "run", "--no-report", *(["--trust"] if trust else []), *words, str(self.workflow)]
        return subprocess.run(command, capture_output=True, text=True, stdin=subprocess.DEVNULL, env=self.environment(), check=False)

    def environment(self) -> dict[str, str]:
        return {**os.environ, "PLYFLOW_PYTHON": sys.executable, "XDG_CACHE_HOME": str(self.folder / "cache")}

    def artifact(self, step: str = "made") -> plyflow.Artifact:
        opened = plyflow.open(self.workflow)
        assert isinstance(opened, plyflow.Run)
        return opened[step].artifact


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Place:
    made = Place(tmp_path)
    # What the program and the package are asked in this test is asked with the same cache.
    for name, value in made.environment().items():
        monkeypatch.setenv(name, value)
    return made


def test_what_a_step_writes_is_read_as_it_was_written_by_the_next_one(place: Place) -> None:
    place.step(
        """
        step.write_attributes({"note": "ü", "count": np.int64(3)})
        step.write_array("a/doubles", np.array([[0.1, -1e300], [5e-324, 2.0]]), unit="m")
        step.write_array("a/bytes", np.arange(5, dtype=np.uint8), unit="1")
        step.write_array("a/whole", [2**62, -1], unit="1")
        step.write_array("a/one", np.float64(7.5), unit="s")
        step.write_array("a/none", np.zeros((0, 3)), unit="m")
        points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.25]], dtype=float)
        step.define_mesh("sheet", points, [[0, 1, 2, 3]], attributes={"kind": "ply"})
        for i in range(3):
            with step.frame(time=0.5 * i) as frame:
                frame.points("sheet", points + i)
                frame.field("sheet", "points", "height", points[:, 2] * i, unit="m")
                frame.field("sheet", "cells", "pair", [[i, -0.5]], unit="1")
        step.report("last", 0.1 + 0.2)
        """,
        declared='output=declare.collection("example"), results={"last": declare.result("s", doc="A number.")}',
    )
    text = (place.folder / "made.py").read_text()
    (place.folder / "made.py").write_text(text + '    step.collection(["left", "right"])\n')
    place.step(
        """
        given = step.input("given")
        step.write_attributes({"seen": given.attributes, "item": step.item, "threads": step.threads, "with": step.parameters, "port": repr(given)})
        for path in ("a/doubles", "a/bytes", "a/whole", "a/one", "a/none"):
            array = given.array(path)
            step.write_array(path, array, unit="1")
        assert given.array("a/bytes", dtype="float64").dtype == np.float64 and not given.has("a/nothing")
        assert given.array("a/one").shape == () and given.array("a/none").shape == (0, 3)
        sheet = given.body("sheet")
        assert sheet.cells.tolist() == [[0, 1, 2, 3]] and sheet.attributes == {"kind": "ply"} and given.times == [0.0, 0.5, 1.0]
        assert (sheet.points(1) == sheet.reference + 1).all() and (sheet.points() == sheet.reference + 2).all()
        assert sheet.field("pair", 2).tolist() == [[2.0, -0.5]] and sheet.field("height").tolist() == [0, 0, 0, 0.5]
        for wrong in (lambda: sheet.field("depth"), lambda: sheet.points(3), lambda: given.body("tool"), lambda: given.array("b")):
            try:
                wrong()
            except plyflow.NotFound as error:
                step.log(str(error))
            else:
                raise AssertionError("nothing was raised")
        """,
        declared='output="example", inputs={"given": declare.port("example", doc="What was made.")}, '
        'parameters={"edge": declare.quantity("length", default="5 mm", doc="An edge.")}',
        name="reader",
    )
    place.write(
        "steps:\n  made: {plugin: ./made.py}\n"
        "  read: {plugin: ./reader.py, from: {given: made}, for_each: {side: made}, with: {edge: 2 cm}}\n"
    )
    done = place.run()
    assert done.returncode == 0, done.stderr
    made, read = place.artifact(), place.artifact("read[right]")
    for path in ("a/doubles", "a/bytes", "a/whole", "a/one", "a/none"):
        first, second = made.array(path), read.array(path)
        assert first.dtype == second.dtype and first.shape == second.shape and np.asarray(first).tobytes() == np.asarray(second).tobytes()
    assert made.array("a/doubles")[1, 0] == 5e-324 and made.array("a/whole")[0] == 2**62
    said = read.attributes
    assert said["seen"] == {"note": "ü", "count": 3} and said["item"] == [1] and said["with"] == {"edge": 0.02}
    assert said["port"] == "<input 'given': example of 'made'>"
    opened = plyflow.open(place.workflow)
    assert isinstance(opened, plyflow.Run) and float(opened.result("last", "made")) == 0.1 + 0.2


def test_the_same_step_gives_the_same_bytes_and_does_not_run_again(place: Place) -> None:
    place.step('step.write_attributes({"set": sorted({"a", "b", "c"}), "order": list({"x", "y", "z"})})\nprint("said", flush=True)')
    assert place.run().returncode == 0
    first = place.artifact().path.read_bytes()
    again = place.run()
    assert "1 cached" in again.stdout
    assert place.run("--force", "made").returncode == 0
    assert place.artifact().path.read_bytes() == first, "hashes of texts are the same in every process"
    logs = list((place.folder / ".plyflow").rglob("*.log"))
    assert any("said" in log.read_text() for log in logs), "what a step prints is in its log"


def test_a_step_is_what_its_modules_and_packages_are(place: Place) -> None:
    (place.folder / "tools").mkdir()
    (place.folder / "tools" / "__init__.py").write_text("from .inner import VALUE\n")
    (place.folder / "tools" / "inner.py").write_text("VALUE = 1\n")
    (place.folder / "unused.py").write_text("VALUE = 1\n")
    place.step('step.write_attributes({"value": tools.VALUE, "file": __file__})', before="import tools\n")
    assert place.run().returncode == 0
    assert place.artifact().attributes == {"value": 1, "file": "made.py"}
    (place.folder / "unused.py").write_text("VALUE = 2\n")
    assert "1 cached" in place.run().stdout
    (place.folder / "tools" / "inner.py").write_text("VALUE = 2\n")
    again = place.run()
    assert again.returncode == 0 and place.artifact().attributes["value"] == 2, again.stderr
    # What it carries says what it was made with, and nothing of where that lies.
    library = next(p for p in (place.folder / "cache").rglob("made.so"))
    data = library.read_bytes()
    length = int.from_bytes(data[-24:-16], "little")
    carried = json.loads(data[-24 - length : -24])
    assert set(carried["sources"]) == {"made.py", "tools/__init__.py", "tools/inner.py"}
    assert carried["packages"]["numpy"] == np.__version__ and str(place.folder).encode() not in data[-24 - length :]


def test_a_package_that_only_the_run_imports_is_asked_for(place: Place) -> None:
    late = 'import h5py\nstep.write_attributes({"version": h5py.__version__})'
    place.step(late)
    refused = place.run()
    assert refused.returncode == 4 and 'requires=["h5py"]' in refused.stderr, refused.stderr
    place.step(late, declared='output="example", requires=["h5py"]')
    done = place.run()
    assert done.returncode == 0, done.stderr
    place.step(late, declared='output="example", requires=["no-such-package"]')
    refused = place.run()
    assert refused.returncode == 3 and "requires the package no-such-package" in " ".join(refused.stderr.replace("│", " ").split()), refused.stderr


@pytest.mark.parametrize(
    ("body", "code", "expected"),
    [
        ('raise ValueError("the angle is 100")', 4, ["made.py:7: ValueError: the angle is 100"]),
        ("return {}[3]", 4, ["made.py:7: KeyError: there is no 3"]),
        ('step.write_array("x", [0.0, float("nan")], unit="m")', 4, ["NaN"]),
        ('step.write_array("x", [1.0], unit="mm")', 4, ["mm"]),
        ('step.write_array("x", ["a"], unit="m")', 4, ["made.py:7", "expected numbers"]),
        ('step.report("depth", 1.0)', 4, ["declares no result 'depth'", "there are: last"]),
        ('step.report("last", 1.0, unit="m")', 4, ["last"]),
        ('step.input("formed")', 4, ["declares no input 'formed'", "none"]),
        ('step.define_mesh("b", [[0, 0, 0]], [[0, 1, 2]])', 4, ["points from 0 to 0"]),
        ('import sys; sys.exit("no")', 4, ["sys.exit('no')"]),
        ("import os; os._exit(7)", 4, ["ended with code 7"]),
        ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", 4, ["signal 11"]),
        ("import helper", 4, ["ModuleNotFoundError", "at the top of the file"]),
        ("step.collection(['a'])", 4, []),
    ],
)
def test_a_failure_is_told_with_its_place(place: Place, body: str, code: int, expected: list[str]) -> None:
    place.step(body, declared='output="example", results={"last": declare.result("s", doc="A number.")}')
    (place.folder / "helper.py").write_text("")
    done = place.run()
    assert done.returncode == code, done.stderr
    for text in expected:
        assert text in done.stderr, done.stderr
    assert not list((place.folder / ".plyflow").rglob("*.vtkhdf")), "a step that has failed leaves no artifact"


@pytest.mark.parametrize(
    ("name", "text", "expected"),
    [
        ("made", "x = 1\n", "it has: none"),
        ("made", "import nothing_of_that_name\n", "made.py:1: ModuleNotFoundError"),
        ("made", "def run(:\n", "made.py:1: SyntaxError"),
        ("made", HEAD + '@plyflow.step("a", output="x")\ndef run(step):\n    pass\n', "says nowhere what it does"),
        ("made", HEAD + '@plyflow.step("a b", output="x")\ndef run(step):\n    """Does."""\n', "a b"),
        ("json", HEAD + '@plyflow.step("a", output="x")\ndef run(step):\n    """Does."""\n', "a module that this interpreter has already"),
        ("my-step", "x = 1\n", "letters, digits and underscores"),
        ("made", HEAD + "import os\nos._exit(0)\n", "ended without an answer"),
    ],
)
def test_a_file_that_is_no_step_is_refused_where_it_is_named(place: Place, name: str, text: str, expected: str) -> None:
    (place.folder / f"{name}.py").write_text(text)
    place.write(f"steps:\n  made: {{plugin: ./{name}.py}}\n")
    done = place.run()
    said = " ".join(done.stderr.replace("│", " ").split())
    assert done.returncode == 3 and "workflow.yaml:4:18" in said and expected in said, done.stderr


def test_nothing_of_a_strangers_file_is_run_without_consent(place: Place) -> None:
    place.step('step.write_attributes({})', before=f'open({str(place.folder / "ran")!r}, "w").close()\n')
    refused = place.run(trust=False)
    assert refused.returncode == 3 and "was not loaded" in refused.stderr and "made.py" in refused.stderr
    assert not (place.folder / "ran").exists()
    assert place.run().returncode == 0 and (place.folder / "ran").exists()
    # What is known of it from then is shown, and runs nothing; to run it anew needs consent again.
    (place.folder / "ran").unlink()
    shown = subprocess.run([plyflow.program(), "plan", place.workflow], capture_output=True, text=True, stdin=subprocess.DEVNULL, check=False)
    assert shown.returncode == 0 and "cached" in shown.stdout, shown.stderr
    refused = place.run("--force", "made", trust=False)
    assert refused.returncode == 3 and "made.py" in refused.stderr and not (place.folder / "ran").exists(), refused.stderr


def test_a_folder_of_plugins_is_searched_for_marked_files_alone(place: Place) -> None:
    folder = place.folder / "plugins"
    folder.mkdir()
    place.step("step.write_attributes({})")
    (place.folder / "made.py").rename(folder / "other_name.py")
    (folder / "script.py").write_text(f"open({str(place.folder / 'ran')!r}, 'w').close()\n")
    place.write("steps:\n  made: {plugin: made}\n")
    done = place.run("--plugins", str(folder), trust=False)
    assert done.returncode == 0, done.stderr
    assert not (place.folder / "ran").exists(), "a file without a decorated function is never run"


def _running(path: Path, wanted: int, seconds: float) -> bool:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if path.exists() and len(path.read_text().split()) >= wanted:
            return True
        time.sleep(0.02)
    return False


def test_a_step_is_stopped_and_goes_on_from_its_checkpoint(place: Place) -> None:
    place.step(
        f"""
        import pathlib, time
        kept = pathlib.Path(step.checkpoint()) / "done"
        done = int(kept.read_text()) if kept.exists() else 0
        pathlib.Path({str(place.folder / "begun")!r}).open("a").write(f"{{done}}\\n")
        while done < 40:
            done += 1
            kept.write_text(str(done))
            step.checkpoint_saved()
            if done < 4 or pathlib.Path({str(place.folder / "go")!r}).exists():
                step.progress(done / 40, phase="counting")
            else:
                while True:
                    step.progress(done / 40)
                    time.sleep(0.01)
        step.write_attributes({{"done": done}})
        """
    )
    command = [str(plyflow.program()), "run", "--no-report", "--trust", str(place.workflow)]
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=place.environment())
    assert _running(place.folder / "begun", 1, 30)
    time.sleep(0.5)
    process.send_signal(signal.SIGINT)
    assert process.wait(20) == 130, process.stderr.read() if process.stderr else ""
    (place.folder / "go").touch()
    done = place.run()
    assert done.returncode == 0, done.stderr
    begun = [int(line) for line in (place.folder / "begun").read_text().split()]
    assert begun[0] == 0 and begun[1] >= 4 and place.artifact().attributes == {"done": 40}


def test_limits_hold_for_the_interpreter_and_what_it_starts(place: Place) -> None:
    place.step(
        f"""
        import pathlib, subprocess, sys, time
        child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"], start_new_session=True)
        pathlib.Path({str(place.folder / "child")!r}).write_text(str(child.pid))
        time.sleep(600)
        """
    )
    place.write("steps:\n  made: {plugin: ./made.py, resources: {time_limit: 2 s}}\n")
    done = place.run()
    assert done.returncode == 4 and "time" in done.stderr, done.stderr
    child = int((place.folder / "child").read_text())
    assert not Path(f"/proc/{child}").exists(), "no process of a step outlives it"
    place.step("step.write_array('x', np.ones(100_000_000), unit='1')")
    place.write("steps:\n  made: {plugin: ./made.py, resources: {memory: 500 MiB}}\n")
    done = place.run()
    assert done.returncode == 4 and "memory" in done.stderr.lower(), done.stderr


def test_what_an_interpreter_costs_is_counted(place: Place) -> None:
    place.step(
        """
        import time
        end = time.process_time() + 0.5
        while time.process_time() < end:
            pass
        block = np.ones(30_000_000)
        step.write_attributes({"sum": float(block.sum())})
        """
    )
    assert place.run().returncode == 0
    record = json.loads(_record(place))
    assert record["cost"]["cpu_seconds"] > 0.5 and record["cost"]["peak_memory"] > 240_000_000


def _record(place: Place) -> str:
    text = next((place.folder / ".plyflow").rglob("*.record.json")).read_text()
    return text[: text.rindex("}") + 1]


def test_another_interpreter_has_its_own_packages_alone(place: Place) -> None:
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(place.folder / "bare")], check=True)
    other = {**place.environment(), "PLYFLOW_PYTHON": str(place.folder / "bare" / "bin" / "python")}
    command = [str(plyflow.program()), "run", "--no-report", "--trust", str(place.workflow)]
    place.step("step.write_attributes({})")
    refused = subprocess.run(command, capture_output=True, text=True, stdin=subprocess.DEVNULL, env=other, check=False)
    said = " ".join(refused.stderr.replace("│", " ").split())
    assert refused.returncode == 3 and "No module named 'numpy'" in said, "the numpy beside the package `plyflow` is of another interpreter"
    # A step that needs none runs there.
    (place.folder / "made.py").write_text('import plyflow\n@plyflow.step("made", output="x")\ndef run(step):\n    """Does."""\n    step.log("done")\n')
    done = subprocess.run(command, capture_output=True, text=True, stdin=subprocess.DEVNULL, env=other, check=False)
    assert done.returncode == 0, done.stderr


def test_a_run_from_python_says_whom_it_trusts(place: Place) -> None:
    place.step('step.write_attributes({"by": "python"})')
    with pytest.raises(plyflow.InvalidInput, match="was not loaded"):
        plyflow.run(place.workflow, report=False)
    with pytest.raises(TypeError, match="list of one"):
        plyflow.run(place.workflow, report=False, trust=str(place.folder / "made.py"))
    run = plyflow.run(place.workflow, report=False, trust=[place.folder / "made.py"])
    assert run["made"].artifact.attributes == {"by": "python"}
    (place.folder / "made.py").write_text((place.folder / "made.py").read_text() + "\n")
    with pytest.raises(plyflow.InvalidInput):
        plyflow.open(place.workflow)
    opened = plyflow.open(place.workflow, trust=True)
    assert isinstance(opened, plyflow.Run) and opened["made"].state == "to run"


def test_another_version_of_a_package_that_only_the_run_imports_makes_the_step_anew(place: Place) -> None:
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(place.folder / "own")], check=True)
    packages = next((place.folder / "own").glob("lib/python3*/site-packages"))
    described = packages / "late_thing-1.0.dist-info"
    described.mkdir()
    (described / "METADATA").write_text("Metadata-Version: 2.1\nName: late-thing\nVersion: 1.0\n")
    (described / "top_level.txt").write_text("late_thing\n")
    (packages / "late_thing.py").write_text("VALUE = 1\n")
    text = 'import plyflow\n@plyflow.step("made", output="x", requires=["late-thing"])\ndef run(step):\n    """Does."""\n    import late_thing\n'
    (place.folder / "made.py").write_text(text + '    step.write_attributes({"value": late_thing.VALUE})\n')
    other = {**place.environment(), "PLYFLOW_PYTHON": str(place.folder / "own" / "bin" / "python")}
    command = [str(plyflow.program()), "run", "--no-report", "--trust", str(place.workflow)]
    first = subprocess.run(command, capture_output=True, text=True, stdin=subprocess.DEVNULL, env=other, check=False)
    assert first.returncode == 0, first.stderr
    described = described.rename(packages / "late_thing-2.0.dist-info")
    (described / "METADATA").write_text("Metadata-Version: 2.1\nName: late-thing\nVersion: 2.0\n")
    (packages / "late_thing.py").write_text("VALUE = 2\n")
    again = subprocess.run(command, capture_output=True, text=True, stdin=subprocess.DEVNULL, env=other, check=False)
    assert again.returncode == 0 and "1 run, 0 cached" in again.stdout + again.stderr, again.stdout + again.stderr


def test_a_package_that_is_installed_in_place_is_refused(place: Place, tmp_path_factory: pytest.TempPathFactory) -> None:
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    (elsewhere / "in_place.py").write_text("VALUE = 1\n")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(place.folder / "own")], check=True)
    packages = next((place.folder / "own").glob("lib/python3*/site-packages"))
    described = packages / "in_place-1.0.dist-info"
    described.mkdir()
    (described / "METADATA").write_text("Metadata-Version: 2.1\nName: in-place\nVersion: 1.0\n")
    (described / "top_level.txt").write_text("in_place\n")
    (packages / "in_place.pth").write_text(f"{elsewhere}\n")
    (place.folder / "made.py").write_text('import in_place\nimport plyflow\n@plyflow.step("made", output="x")\ndef run(step):\n    """Does."""\n')
    other = {**place.environment(), "PLYFLOW_PYTHON": str(place.folder / "own" / "bin" / "python")}
    command = [str(plyflow.program()), "run", "--no-report", "--trust", str(place.workflow)]
    refused = subprocess.run(command, capture_output=True, text=True, stdin=subprocess.DEVNULL, env=other, check=False)
    said = " ".join(refused.stderr.replace("│", " ").split())
    assert refused.returncode == 3 and "neither beside it nor of an installed package" in said, refused.stderr
