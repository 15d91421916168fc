"""A step of Plyflow in Python. Take it as a start: change what is declared, then ``run``."""

import numpy as np

import plyflow
from plyflow import declare


@plyflow.step(
    "double-time", version="0.1.0", vendor="You", role="example",
    inputs={"formed": declare.port("forming", doc="An artifact with history/time.")},
    parameters={"factor": declare.number(default=2.0, doc="What the times are multiplied by.")},
    output="example",
    results={"sum": declare.result("s", doc="Sum of the multiplied times.")},
)
def run(step):
    """Multiplies the times of a history."""
    time = step.input("formed").array("history/time") * step.parameters["factor"]
    step.log(f"multiplied {time.size} times")
    step.write_array("history/time", time, unit="s")
    step.write_attributes({"count": int(time.size)})
    # One after the other, as a loop adds them: np.sum adds in another order and rounds otherwise.
    step.report("sum", float(np.cumsum(time)[-1]) if time.size else 0.0)
