"""How all pictures look: one font, white ground, colours that colour-blind readers can tell apart, the same bytes for the same data."""

import pathlib

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402
from PIL import Image  # noqa: E402

import runs  # noqa: E402

# Pixels of a picture for each inch of its figure: 7 inches are 1400 pixels, twice what a page shows.
DPI = 200
MM = 1000.0

INK = "#222222"
GREY = "#8a8a8a"
# Okabe and Ito's colours for colour-blind readers.
BLUE, ORANGE, GREEN, RED, PURPLE, SKY = "#0072b2", "#e69f00", "#009e73", "#d55e00", "#cc79a7", "#56b4e9"
TOOL = (0.80, 0.81, 0.83)
CLOTH = (0.90, 0.87, 0.80)

plt.rcParams.update({
    "figure.dpi": DPI, "savefig.dpi": DPI, "figure.facecolor": "white",
    "font.family": "DejaVu Sans", "font.size": 9, "axes.titlesize": 9, "axes.labelsize": 9, "legend.fontsize": 8,
    "xtick.labelsize": 8, "ytick.labelsize": 8, "text.color": INK, "axes.labelcolor": INK, "axes.edgecolor": GREY,
    "xtick.color": INK, "ytick.color": INK, "axes.spines.top": False, "axes.spines.right": False,
    "axes.grid": True, "grid.color": "#e6e6e6", "grid.linewidth": 0.6, "axes.axisbelow": True, "axes.linewidth": 0.7,
    "lines.linewidth": 1.6, "legend.frameon": False, "svg.hashsalt": "plyflow", "svg.fonttype": "path", "path.simplify": True,
    "path.simplify_threshold": 0.3,
})


def save_svg(figure, name: str) -> pathlib.Path:
    path = runs.PICTURES / f"{name}.svg"
    figure.savefig(path, metadata={"Date": None, "Creator": None})
    plt.close(figure)
    return path


def save_png(figure, name: str, maps=()) -> pathlib.Path:
    """Writes a figure of pixels; `maps` are the mappables whose colours must come out smooth."""
    figure.canvas.draw()
    pixels = np.asarray(figure.canvas.buffer_rgba())[:, :, :3]
    plt.close(figure)
    return save_pixels(pixels, name, maps)


def save_pixels(pixels: np.ndarray, name: str, maps=()) -> pathlib.Path:
    """Writes pixels with a palette of 256 colours, which takes a third of the room: some from the maps, the rest from the picture."""
    path = runs.PICTURES / f"{name}.png"
    image = Image.fromarray(np.ascontiguousarray(pixels))
    of_maps = [m.cmap(np.linspace(0, 1, 56 // len(maps)))[:, :3] for m in maps]
    # White first, and put where it was: Pillow finds a neighbour of it instead.
    palette = np.concatenate([np.full((1, 3), 255, np.uint8), *(np.rint(255 * c).astype(np.uint8) for c in of_maps)])
    own = image.quantize(256 - len(palette), method=Image.Quantize.MEDIANCUT, kmeans=2)
    palette = np.concatenate([palette, np.array(own.getpalette(), np.uint8).reshape(-1, 3)])[:256]
    chosen = Image.new("P", (1, 1))
    chosen.putpalette(palette.ravel().tolist())
    chosen = image.quantize(palette=chosen, dither=Image.Dither.FLOYDSTEINBERG)
    at = np.array(chosen)
    at[(pixels == 255).all(axis=2)] = 0
    drawn = Image.frombytes("P", image.size, at.tobytes())
    drawn.putpalette(palette.ravel().tolist())
    drawn.save(path, optimize=True)
    return path


def canvas(width: int, height: int):
    """A figure of so many pixels, and axes over all of it in pixels from the upper left corner."""
    figure = plt.figure(figsize=(width / DPI, height / DPI))
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(0, width), ylim=(height, 0))
    axes.axis("off")
    return figure, axes


def put(axes, picture: np.ndarray, x: float = 0, y: float = 0):
    """Puts a drawn picture with its upper left corner at a pixel of a canvas."""
    height, width = picture.shape[:2]
    axes.imshow(picture, extent=(x, x + width, y + height, y), interpolation="nearest", aspect="auto", zorder=0)


def scale_bar(axes, x: float, y: float, metres: float, pixels_per_metre: float):
    """A bar of a length, from x to the right."""
    length = metres * pixels_per_metre
    axes.plot([x, x + length], [y, y], color=INK, linewidth=2.2, solid_capstyle="butt")
    axes.text(x + length / 2, y - 8, f"{metres * MM:g} mm", ha="center", va="bottom")


def colour_bar(figure, rectangle, mappable, label: str, ticks=None):
    """A horizontal bar of colours in (x, y, width, height) pixels from the upper left corner."""
    x, y, width, height = rectangle
    across, up = figure.get_size_inches() * DPI
    axes = figure.add_axes((x / across, 1 - (y + height) / up, width / across, height / up))
    bar = figure.colorbar(mappable, cax=axes, orientation="horizontal", ticks=ticks)
    bar.outline.set_visible(False)
    bar.ax.tick_params(length=3, width=0.6)
    bar.set_label(label, labelpad=3)
    bar.ax.grid(False)
    return bar
