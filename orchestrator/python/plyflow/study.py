"""Studies: a row for each point, as a frame, or as an array over the variables."""

from __future__ import annotations

from typing import Any, Mapping

from ._ask import needed

__all__ = ["Study"]


class Study:
    """The points of a study, as ``plyflow results --study`` tells them. Values of variables are in the units of the study, responses in SI.

    Attributes:
        name: of the workflow.
        variables: names, in the order of the study.
        responses: names.
        units: by variable and response.
        points: names of the points.
        optimisation: what an optimisation has led to, or ``None``.
    """

    def __init__(self, told: Mapping[str, Any]) -> None:
        self._told = told
        self.name = str(told["workflow"])
        self.variables = [str(v["name"]) for v in told["variables"]]
        self.responses = [str(r["name"]) for r in told["responses"]]
        self.units = {str(c["name"]): str(c["unit"] or "1") for c in [*told["variables"], *told["responses"]]}
        self.points = [str(p["point"]) for p in told["points"]]
        self.optimisation = told["optimisation"]

    def __repr__(self) -> str:
        done = sum(p["status"] == "done" for p in self._told["points"])
        return f"<Study {self.name}: {', '.join(self.responses)} over {', '.join(self.variables)}, {done} of {len(self.points)} points done>"

    def to_frame(self) -> Any:
        """A pandas DataFrame with a row for each point: its variables, its responses (NaN where there is none), ``status``, ``failed_step``,
        ``failure_class`` and ``cause``. ``attrs["units"]`` has the units.

        Raises:
            MissingPackage: pandas is not installed.
        """
        pandas = needed("pandas", "a study as a frame")
        rows = []
        for point in self._told["points"]:
            failure = point["failure"] or {}
            failed = {"failed_step": failure.get("step"), "failure_class": failure.get("class"), "cause": failure.get("cause")}
            rows.append({**point["values"], **point["responses"], "status": point["status"], **failed})
        columns = [*self.variables, *self.responses, "status", "failed_step", "failure_class", "cause"]
        frame = pandas.DataFrame(rows, columns=columns, index=pandas.Index(self.points, name="point"))
        for response in self.responses:
            frame[response] = pandas.to_numeric(frame[response])
        frame.attrs["units"] = dict(self.units)
        return frame

    def to_xarray(self) -> Any:
        """An ``xarray.Dataset`` of the responses and ``status``, with ``attrs["units"]`` on each.

        Where the points are all combinations of the variables' values, its dimensions are the variables. Otherwise there is one dimension,
        ``point``, along which the variables are coordinates.

        Raises:
            MissingPackage: xarray or pandas is not installed.
        """
        xarray = needed("xarray", "a study as an array")
        frame = self.to_frame()[[*self.variables, *self.responses, "status"]]
        combinations = 1
        for variable in self.variables:
            combinations *= frame[variable].nunique()
        is_grid = bool(self.variables) and len(frame) == combinations and not frame.duplicated(self.variables).any()
        if is_grid:
            data = xarray.Dataset.from_dataframe(frame.set_index(self.variables))
        else:
            data = xarray.Dataset.from_dataframe(frame).set_coords(self.variables)
        for name, unit in self.units.items():
            data[name].attrs["units"] = unit
        data.attrs["title"] = self.name
        return data
