# The notebook first-study.ipynb, as a script: scripts/notebook writes one from the other, and CI runs it.
# %% [markdown]
# # A first study
#
# A woven fabric is characterised from its shear tests, formed over a dome between two diaphragms, and formed again with less and more friction.
# It takes about a minute on two cores, so its elements are large. Take smaller ones before you rely on its numbers.
#
# You need `pip install plyflow-*.whl pandas matplotlib`, and `xarray` for the last cell. Everything is written to the current folder.

# %%
import copy

import matplotlib.pyplot as plt
import numpy as np

import plyflow

print("Plyflow", plyflow.__version__)

# %% [markdown]
# ## From tests to a material
#
# Picture-frame tests come along with Plyflow: two strokes, each a CSV file with displacement and force. (They were computed from a published
# law, with noise.) The step `characterise-picture-frame`
# fits a shear law to them and puts it into a material file. The file of the `template` has what the test does not tell: thickness, mass, fibre
# modulus and bending law.

# %%
tests = plyflow.workflows_folder() / "characterisation" / "picture-frame" / "reference"
characterise = plyflow.Workflow("characterise")
characterise.step(
    "shear",
    "characterise-picture-frame",
    positive=[tests / "woven-1.csv", tests / "woven-2.csv"],
    frame_side="145 mm",
    template=plyflow.material("woven-38616"),
)
run = plyflow.run(characterise, path="characterise.yaml")
law = run["shear"]
(fabric,) = law.artifact.write_files("materials")
print(fabric)
run.results("shear")[["result", "value", "unit"]].head(8)

# %% picture=python-shear-law
(plot,) = law.artifact.attributes["plots"]
figure, axes = plt.subplots(figsize=(6, 3.6))
for series in plot["series"]:
    angle, force = law.array(series["x"]), law.array(series["y"])
    style = {"linestyle": "", "marker": ".", "markersize": 3} if series["style"] == "points" else {"color": "black"}
    axes.plot(np.degrees(angle), force, label=series["label"], **style)
axes.set(xlabel="shear angle [deg]", ylabel=f"normalised shear force [{force.unit}]")
axes.legend()
figure.tight_layout()

# %% [markdown]
# ## Forming a part
#
# A scene has the tool, the sheets from the tool upwards, the friction and the process. `validate` lets the program check it. What is wrong
# comes as an error with line and column, what was expected and what to do.
#
# The part, the fabric and the process are the same on both sides of the planes x and y, so a quarter is computed and the whole written.

# %%
scene = plyflow.Scene(
    "dome",
    symmetry=["x", "y"],
    tool={"hemisphere": {"radius": "50 mm", "facet_size": "6 mm"}},
    sheets=[
        plyflow.diaphragm("lower_film"),
        plyflow.ply("ply_1", fabric, "160 mm", "160 mm", (-45, 45)),
        plyflow.diaphragm("upper_film"),
    ],
    friction={"tool_diaphragm": 0.5, "fabric_diaphragm": 0.4, "fabric_fabric": 0.35, "diaphragm_diaphragm": 0.3},
    process={
        "double_diaphragm": {
            "frame_length": "600 mm",
            "frame_width": "600 mm",
            "bag_pressure": "1e5 Pa",
            "forming_pressure": "1e5 Pa",
            "clearance": "5 mm",
            "bagging_time": "20 ms",
            "lowering_time": "240 ms",
            "drawing_time": "200 ms",
            "settling_time": "20 ms",
            "film_pre_stretch": 0.01,
            "film_joint_margin": "30 mm",
        }
    },
)
scene.validate()
scene.write("dome.yaml")

wrong = copy.deepcopy(scene)
wrong["tool"]["hemisphere"]["radius"] = "50 millimetres"
for finding in wrong.findings():
    print(finding)

# %% [markdown]
# The workflow forms the scene with shell elements and measures wrinkles. `on_event` is called with everything that happens.

# %%
solver = {"element": "rf4", "element_size": "6 mm", "time_step": "12 us", "least_areal_mass": "3 kg/m2", "frames": 20}
part = plyflow.Workflow("dome")
part.step("formed", "forming-explicit", scene="dome.yaml", **solver)
part.step("measured", "defect-measurement", inputs={"formed": "formed"})


def follow(event):
    if event.kind in ("started", "finished"):
        print(event.kind, event.label)


run = plyflow.run(part, path="dome-workflow.yaml", on_event=follow)
run.defects()[["ply", "type", "length", "amplitude", "cause"]]

# %% picture=python-dome
def draw(axes, body, values, label, **colours):
    """A body seen from above, coloured by values on its triangles or its points."""
    x, y = 1e3 * np.asarray(body.points)[:, :2].T
    on_cells = len(values) == len(body.triangles())
    how = {"facecolors": values} if on_cells else {"shading": "gouraud"}
    picture = axes.tripcolor(x, y, body.triangles(), *([] if on_cells else [values]), **how, **colours)
    extend = "max" if np.max(values) > picture.get_clim()[1] else "neither"
    axes.figure.colorbar(picture, ax=axes, label=label, extend=extend)
    axes.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal")


formed, measured = run["formed"]["ply_1"], run["measured"]["ply_1"]
shear = np.degrees(formed.on_triangles(formed.field("shear_angle")))
distance = 1e3 * np.asarray(measured.field("nodal_distance"))
figure, axes = plt.subplots(1, 2, figsize=(9, 3.8))
draw(axes[0], formed, shear, "shear angle [deg]", cmap="RdBu_r", vmin=-30, vmax=30)
draw(axes[1], measured, distance, "distance from the tool [mm]", cmap="viridis", vmin=0, vmax=10)
for defect in run.defects().itertuples():
    if defect.type == "wrinkle":
        ridge = 1e3 * np.array(run["measured"].artifact.attributes["defects"][defect.Index]["ridge"])
        axes[1].plot(ridge[:, 0], ridge[:, 1], color="red", linewidth=2)
figure.tight_layout()

# %% [markdown]
# ## Friction
#
# A study runs the workflow for every value of a variable. `${mu}` stands for the value, in the scene too.

# %%
sweep = plyflow.Workflow("friction")
sweep.step("formed", "forming-explicit", scene={"file": "dome.yaml", "set": {"friction.fabric_diaphragm": "${mu}"}}, **solver)
sweep.step("measured", "defect-measurement", inputs={"formed": "formed"})
sweep.vary(mu=[0.1, 0.2, 0.3, 0.4])
sweep.response("wrinkles", "measured", "wrinkle_length.ply_1")
sweep.response("shear", "formed", "shear_max")
study = plyflow.run(sweep, path="friction.yaml").study()
study.to_frame()[["mu", "wrinkles", "shear", "status"]]

# %% picture=python-friction
data = study.to_xarray()
figure, axes = plt.subplots(figsize=(6, 3.4))
axes.plot(data["mu"], 1e3 * data["wrinkles"], "o-", color="tab:red")
axes.set(xlabel="coefficient of friction, fabric on film", ylim=(0, None))
axes.set_ylabel("length of all wrinkles [mm]", color="tab:red")
right = axes.twinx()
right.plot(data["mu"], np.degrees(data["shear"]), "s--", color="tab:blue")
right.set_ylabel("largest shear angle [deg]", color="tab:blue")
figure.tight_layout()

# %% [markdown]
# Where the film holds the fabric, the fabric shears less, and what it has too much of stands up in wrinkles.
