"""Draws the pictures of the book; see scripts/make-pictures."""

import sys
import time

import browser
import coupons
import diagrams
import drawings
import films
import law
import others
import runs
import spar

# By name: what draws it.
PICTURES = {
    "spar-zones": spar.spar_zones, "tool-spar": spar.tool_spar, "forming-stages": spar.forming_stages, "shear-angle": spar.shear_angle,
    "local-wrinkle": spar.local_wrinkle, "cross-section": spar.cross_section, "energy-ledger": spar.energy_ledger,
    "kinematic": spar.kinematic, "bias-extension": coupons.bias_extension, "cantilever": coupons.cantilever, "buckling": coupons.buckling,
    "unidirectional": coupons.unidirectional, "crossing": coupons.crossing, "hysteresis": coupons.hysteresis, "double-dome": coupons.double_dome, "tied": coupons.tied,
    "hemisphere": coupons.hemisphere, "speed-error": diagrams.speed_error, "bag-layers": diagrams.bag_layers,
    "workflow-graph": diagrams.workflow_graph, "floors": diagrams.floors, "law-in-python": law.law_in_python,
    "files-of-others": others.files_of_others, "export": drawings.export, "steered": drawings.steered, "new-part": drawings.new_part,
    "single-diaphragm": films.single_diaphragm, "study": browser.study, "report": browser.report,
    "report-answer": browser.report_answer, "report-limits": browser.report_limits, "report-fibres": browser.report_fibres,
    "report-inputs": browser.report_inputs, "report-beside": browser.report_beside,
}
# Largest files, in bytes.
LARGEST = {".png": 250_000, ".svg": 150_000}
LARGEST_TOGETHER = 3_200_000


def main(names: list[str]) -> int:
    unknown = [n for n in names if n not in PICTURES]
    if unknown:
        print(f"make-pictures: there is no picture {', '.join(unknown)}; there are {', '.join(PICTURES)}", file=sys.stderr)
        return 2
    bad = False
    for name in names or PICTURES:
        start = time.monotonic()
        path = PICTURES[name]()
        size = path.stat().st_size
        print(f"{path.relative_to(runs.ROOT)}: {size / 1000:.0f} kB, {time.monotonic() - start:.0f} s", flush=True)
        if size > LARGEST[path.suffix]:
            print(f"make-pictures: {path.name} is larger than {LARGEST[path.suffix] / 1000:.0f} kB", file=sys.stderr)
            bad = True
    together = sum(p.stat().st_size for p in runs.PICTURES.iterdir() if p.suffix in LARGEST)
    if together > LARGEST_TOGETHER:
        print(f"make-pictures: the pictures have {together / 1e6:.1f} MB together, more than {LARGEST_TOGETHER / 1e6} MB", file=sys.stderr)
        bad = True
    return int(bad)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
